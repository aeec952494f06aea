"""One camera taken for the study of accuracy: its mean signal, its render, what its plan expected.

The clock takes cameras in turns, so that whatever slows the machine for a while slows all of them;
each counts with the median of its runs, and the spread of them is shown beside it.
"""

from __future__ import annotations

import hashlib
import statistics
import time
from dataclasses import field, replace

import numpy as np

from vcam_cli.accuracy_study import ablation
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.processing import process
from vcam_cli.progress import Observer
from vcam_cli.quality import display
from vcam_cli.quality.scielab import s_cielab_map
from vcam_cli.records import dataclass
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.scene_times import compute_frame
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.solve.settings import camera_settings

TURNS, TWICE, THRICE = 5, 4.0, 0.6
"""Runs of a camera at most; two where they take more than the second [s], three where more than
the third,"""
KNOWN = 0.1
"""and two where half their spread is no larger a part of the median."""


@dataclass(frozen=True)
class Shot:
    """A frame of one setting."""

    ready: Prepared
    mean: Array
    """Noise-free raw signal [electrons]"""
    clean: Array | None
    """(rows, columns, channels) its render in linear light; None without a render to judge."""
    noisy: Array | None
    """The same of the frame as it is, with its noise."""

    @property
    def expected_loss(self) -> float:
        """Rms of what the plan expects the settings to lose of the spectrum [electrons]."""
        return self.ready.spectrum.lost_rms * self.ready.exposure_time

    @property
    def left_out(self) -> tuple[str, ...]:
        """Effects that its plan leaves out."""
        decisions = self.ready.plan.decisions
        return tuple(d.name for d in decisions if d.state == "off" and d.by == "plan")

    @property
    def variance_lost(self) -> float:
        """Largest share of the temporal or fixed-pattern variance that they had."""
        by_scope: dict[str, float] = {}
        for d in self.ready.plan.decisions:
            if d.name in self.left_out and d.unit.endswith("variance"):
                by_scope[d.unit] = by_scope.get(d.unit, 0.0) + (d.contribution or 0.0)
        return max(by_scope.values(), default=0.0)

    def color_difference(self, other: Shot, workers: int, noisy: bool = False) -> float | None:
        """Return the mean S-CIELAB between two renders on the display; None without renders.

        noisy: with their noise, which is alike only where both have as many bits.
        """
        one, two = (s.noisy if noisy else s.clean for s in (self, other))
        if one is None or two is None:
            return None
        shown = self.ready.camera.display
        screen = display.display_screen(shown, one.shape[1])
        each = s_cielab_map(one, two, screen, shown.filters, workers=workers)
        return float(each.mean(dtype=float))


@dataclass
class Clock:
    """Seconds of a frame of every camera that was taken.

    Cameras that come to the same computation share their runs: those whose keys resolve to the same
    settings, and those whose plans and light turn out to be the same to the last bit.
    """

    workers: int
    device: str = "cpu"
    """Device of what is timed; other frames are the processor's."""
    runs: dict[str, list[float]] = field(default_factory=dict)
    """By `resolved` camera [s]"""
    _cameras: dict[str, Camera] = field(default_factory=dict)
    _found: dict[tuple[str, str, tuple[str, ...], bytes], str] = field(default_factory=dict)

    def shot(self, camera: Camera, shared: Shared | None = None) -> Shot:
        """Return a frame of the camera by the processor; its time does not count.

        shared: what cameras before this one had in common with it.
        """
        return _shot(simulate(camera, self.workers, shared=shared))

    def timed_shot(self, camera: Camera) -> Shot:
        """Return a frame of the camera, and its first run."""
        self.add(camera)
        return _shot(self._run(settings_key(camera)))

    def add(self, camera: Camera) -> None:
        """Add a camera to be timed with the others."""
        self._cameras.setdefault(settings_key(camera), camera)
        self.runs.setdefault(settings_key(camera), [])

    def run_all(self, watch: Observer, beside: Camera | None = None) -> None:
        """Run all cameras in turns.

        beside: one that others are compared with; it runs in every turn that another does, so that
        what slows the machine for a while slows it as well.
        """
        total = TURNS * len(self._cameras)
        always = "" if beside is None else settings_key(beside)
        for turn in range(TURNS):
            due = [
                k
                for k, runs in self.runs.items()
                if not is_median_known(runs) and len(runs) <= turn
            ]
            for i, key in enumerate(dict.fromkeys([always, *due]) if always and due else due):
                watch.step(turn * len(self._cameras) + i, total)
                if key == always or not is_median_known(
                    self.runs[key]
                ):  # it may share another's by now
                    self._run(key)

    def seconds(self, camera: Camera) -> tuple[float, float]:
        """Return the median of the runs, and the slowest less the fastest [s]."""
        runs = self.runs[settings_key(camera)]
        return statistics.median(runs), max(runs) - min(runs)

    def _run(self, key: str) -> Result:
        start = time.perf_counter()
        result = compute_frame(self._cameras[key], self.workers, self.device)
        self.runs[key].append(time.perf_counter() - start)
        first = self._found.setdefault(_computation(result), key)
        if self.runs[first] is not self.runs[key]:
            self.runs[first] += self.runs[key]
            self.runs[key] = self.runs[first]
        return result


def settings_key(camera: Camera) -> str:
    """Return all keys of a camera as a text, with the settings that its accuracy comes to."""
    rest = dict(camera) | {"accuracy": None}
    return f"{rest!r} {camera_settings(camera)!r}"


def _computation(result: Result) -> tuple[str, str, tuple[str, ...], bytes]:
    """Return the common result of two frames whose every step is the same."""
    frame = result.frame
    chosen = replace(frame.settings, tolerance=0, oversampling=0)
    way = replace(frame.spectrum, lost_rms=0, changes={})
    effects = tuple(e.name for e in frame.plan.active)
    light = hashlib.sha256(np.ascontiguousarray(frame.rate).data).digest()
    return repr(chosen), repr(way), effects, light


def is_median_known(runs: list[float]) -> bool:
    """Return whether the median of runs [s] is known to a tenth, or has taken long enough."""
    if len(runs) < 2:
        return False
    if (max(runs) - min(runs)) / 2 <= KNOWN * statistics.median(runs):
        return True
    spent = sum(runs)
    return len(runs) >= (2 if spent > TWICE else 3 if spent > THRICE else TURNS)


def _shot(result: Result) -> Shot:
    """Return what is compared of a frame; its light and its noise are let go."""
    frame, processed = result.frame, result.processed
    shown = frame.camera.output.render and processed.full_color and processed.channels in (1, 3)
    clean = None
    if shown:
        codes = np.minimum(frame.chain.to_dn(frame.mean_electrons), frame.picture_saturated_dn)
        steps = frame.camera.processing
        clean = process(codes, processed.context, steps, workers=processed.workers).linear
    names = Prepared.__dataclass_fields__
    kept = {name: getattr(frame, name) for name in names}
    kept |= {"rate": np.empty((0, 0)), "full_charge": None}
    return Shot(Prepared(**kept), ablation.mean_raw(frame), clean, result.linear if shown else None)
