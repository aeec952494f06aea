"""One camera taken for the study of accuracy: its mean signal, its render, what its plan expected.

The clock takes cameras in turns, so that whatever slows the machine for a while slows all of them;
each counts with the median of its runs, and the spread of them is shown beside it.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.stages import Observer
from vcam_cli.processing import process
from vcam_cli.quality import display
from vcam_cli.quality.scielab import s_cielab_map
from vcam_cli.studies import ablation
from vcam_cli.studies.simulate import Result, simulate

TURNS, TWICE, THRICE = 5, 4.0, 0.6
"""Runs of a camera at most; two where they take more than the second [s], three where more than
the third."""


@dataclass(frozen=True)
class Shot:
    """A frame of one setting."""

    ready: Prepared
    mean: NDArray
    """Noise-free raw signal [electrons]"""
    clean: NDArray | None
    """(rows, columns, channels) its render in linear light; None where there is none to judge."""
    noisy: NDArray | None
    """The same of the frame as it is, with its noise."""

    @property
    def lost(self) -> float:
        """Rms of what the plan expects the settings to lose of the spectrum [electrons]."""
        return self.ready.spectrum.lost * self.ready.exposure_time

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

    def looks_from(self, other: Shot, workers: int, noisy: bool = False) -> float | None:
        """Mean S-CIELAB between two renders, on the camera's display; None without renders.

        noisy: with their noise, which is alike only where both have as many bits.
        """
        one, two = (s.noisy if noisy else s.clean for s in (self, other))
        if one is None or two is None:
            return None
        shown = self.ready.camera.display
        screen = display.screen(shown, one.shape[1])
        each = s_cielab_map(one, two, screen, shown.filters, workers=workers)
        return float(each.mean(dtype=float))


@dataclass
class Clock:
    """Seconds of a frame of every camera that was taken: its text -> its runs."""

    workers: int
    runs: dict[str, list[float]] = field(default_factory=dict)
    _cameras: dict[str, Camera] = field(default_factory=dict)

    def shot(self, camera: Camera) -> Shot:
        """A frame of the camera; its time does not count."""
        return _shot(simulate(camera, self.workers))

    def timed(self, camera: Camera) -> Shot:
        """A frame of the camera, and its first run."""
        start = time.perf_counter()
        result = _whole(camera, self.workers)
        self._cameras[repr(camera)] = camera
        self.runs[repr(camera)] = [time.perf_counter() - start]
        return _shot(result)

    def add(self, camera: Camera) -> None:
        """A camera to be timed with the others."""
        self._cameras.setdefault(repr(camera), camera)
        self.runs.setdefault(repr(camera), [])

    def go(self, watch: Observer) -> None:
        """Runs all cameras in turns."""
        total = TURNS * len(self._cameras)
        for turn in range(TURNS):
            for i, (key, camera) in enumerate(self._cameras.items()):
                watch.step(turn * len(self._cameras) + i, total)
                if not _enough(self.runs[key]):
                    start = time.perf_counter()
                    _whole(camera, self.workers)
                    self.runs[key].append(time.perf_counter() - start)

    def seconds(self, camera: Camera) -> tuple[float, float]:
        """Median of the runs, and slowest less fastest. [s]"""
        runs = self.runs[repr(camera)]
        return statistics.median(runs), max(runs) - min(runs)


def _enough(runs: list[float]) -> bool:
    spent = sum(runs)
    return len(runs) >= (2 if spent > TWICE else 3 if spent > THRICE else TURNS)


def _whole(camera: Camera, workers: int) -> Result:
    """A frame from the scene to its render and metrics."""
    result = simulate(camera, workers)
    if camera.output.render:
        _ = result.render
    _ = result.metrics
    return result


def _shot(result: Result) -> Shot:
    """What is compared of a frame; its light and its noise are let go."""
    frame, processed = result.frame, result.processed
    shown = frame.camera.output.render and processed.full_color and processed.channels in (1, 3)
    clean = None
    if shown:
        codes = np.minimum(frame.to_dn(frame.mean_electrons), frame.picture_saturated_dn)
        steps = frame.camera.processing
        clean = process(codes, processed.context, steps, workers=processed.workers).linear
    names = Prepared.__dataclass_fields__
    kept = {name: getattr(frame, name) for name in names} | {"rate": np.empty((0, 0))}
    return Shot(Prepared(**kept), ablation.mean_raw(frame), clean, result.linear if shown else None)
