"""Frames of a data set in batches on a device: crops of pictures, at times and gains of their own.

Frames that differ in nothing else have a camera in common, which is made ready once. Frames of
charts, and those that need more than codes with and without noise, are computed one by one.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.batches.batch_camera import BatchCamera
from vcam_cli.batches.frames import frame_bytes, metered, ready, solved_for, timed_effects
from vcam_cli.batches.light import DeviceLight, ProcessorLight
from vcam_cli.batches.pictures import linear_pictures
from vcam_cli.camera.camera import Camera
from vcam_cli.datasets.frame_work import NPZ, FrameJob, noise_labels
from vcam_cli.devices.processor import Processor, require
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.frame_archive import archive_bytes
from vcam_cli.files.report import to_json
from vcam_cli.floats import own_float_errors
from vcam_cli.sweeps.sweep_result import Outcome, error_cell
from vcam_cli.units import parse

BATCH = 64
"""Frames that are computed together."""
OWN = ("exposure.time", "exposure.gain")
"""Keys that frames of a batch have each for itself."""
WRITTEN = {"raw", "clean"}


def batches_of(groups: Sequence[Sequence[FrameJob]]) -> tuple[list[list[FrameJob]], list[FrameJob]]:
    """Return the frames that batches compute, by their camera, and the others.

    Parameters
    ----------
    groups : sequence
        Frames to compute.
    """
    found: dict[str, list[FrameJob]] = defaultdict(list)
    others = []
    for job in (job for group in groups for job in group):
        scene = job.frame.scene
        if scene is None or scene.file is None or not set(job.write) <= WRITTEN:
            others.append(job)
            continue
        shared = {key: value for key, value in job.frame.values.items() if key not in OWN}
        size = [job.frame.crop.get(name) for name in ("rows", "columns")]
        found[to_json([shared, size, scene.source | {"file": ""}])].append(job)
    return list(found.values()), others


@own_float_errors
def compute_batches(
    jobs: Sequence[FrameJob], device: Processor, ask: Callable[[FrameJob], bool]
) -> Iterator[Outcome]:
    """Yield the outcomes of frames that have a camera in common.

    Parameters
    ----------
    jobs : sequence of FrameJob
        The frames.
    device : Processor
        Where they are computed.
    ask : callable
        Whether a frame is still to be computed; it is claimed then.
    """
    batched = _Batched(device)
    start = 0
    while start < len(jobs):
        wanted = [job for job in jobs[start : start + batched.at_once] if ask(job)]
        start += batched.at_once
        done: set[str] = set()
        try:
            with device.errors():
                for outcome in batched.outcomes(wanted) if wanted else ():
                    yield outcome
                    done.add(outcome.id)
        except BadInput as error:
            said = error_cell(error.problems)
            yield from (Outcome(job.id, error=said) for job in wanted if job.id not in done)
        except CannotDo as error:
            said = str(error)
            yield from (
                Outcome(job.id, error=said, final=False) for job in wanted if job.id not in done
            )


class _Batched:
    """A camera that frames have in common, and the pictures that were read last."""

    def __init__(self, device: Processor) -> None:
        self._device, self._pictures = device, dict[Path, Array]()
        self._camera: Camera | None = None
        self._ready: tuple[BatchCamera, DeviceLight | ProcessorLight, float] | None = None
        self.at_once = 1
        """Frames of the next batch: one makes the camera ready, then as many as memory holds."""

    def outcomes(self, jobs: Sequence[FrameJob]) -> Iterator[Outcome]:
        """Yield the outcomes of a batch."""
        start = time.perf_counter()
        if self._camera is None:
            self._camera = jobs[0].frame.camera(jobs[0].base)
        views: dict[str, int] = {}
        crops, shown = list[Array](), list[int]()
        for job in jobs:
            scene = job.frame.scene
            assert scene is not None
            view = to_json([scene.name, job.frame.crop])
            if view not in views:
                views[view] = len(views)
                crops.append(self._crop(job))
            shown.append(views[view])
        stack = self._device.stacked(crops)
        if self._ready is None:
            self._make_ready(self._camera, stack.shape[1:])
        assert self._ready is not None
        taker, light, white = self._ready
        rates = light.rates(linear_pictures(stack, self._device, self._camera))
        kept = defaultdict[float, list[tuple[int, float]]](list)
        chosen: dict[int, tuple[float, float]] = {}
        solved = taker.solved
        for number, (job, place) in enumerate(zip(jobs, shown, strict=True)):
            own_time, own_gain = (job.frame.values.get(key) for key in OWN)
            if own_time is None and solved.exposure.auto is not None and place not in chosen:
                chosen[place] = metered(solved, rates[place], white)
            base = chosen.get(place, (solved.exposure.time or 0.0, solved.gain))
            gain = base[1] if own_gain is None else float(own_gain)
            seconds = base[0] if own_time is None else _seconds(own_time)
            kept[gain].append((number, seconds))
        for gain, members in kept.items():
            index = self._device.put(np.array([shown[number] for number, _ in members]))
            times = [seconds for _, seconds in members]
            seeds = [jobs[number].frame.seed for number, _ in members]
            dn, clean = taker.take(rates[index], times, gain, seeds)
            pairs = zip(self._device.get(dn), self._device.get(clean), members, strict=True)
            spent = (time.perf_counter() - start) / len(jobs)
            for raw, plain, (number, seconds) in pairs:
                yield _outcome(jobs[number], taker, raw, plain, seconds, gain, spent)

    def _make_ready(self, camera: Camera, shape: tuple[int, ...]) -> None:
        """Make the camera ready for pictures of a shape, and choose how many are at once."""
        solved = solved_for(camera)
        if names := timed_effects(solved):
            message = f"{', '.join(names)}: the light depends on the exposure time"
            raise CannotDo(message, "use --device cpu")
        taker, light, _ = self._ready = ready(solved, shape, self._device)
        each = frame_bytes(taker) + light.bytes_per_picture(shape[-1])
        require(self._device, each, "a frame")
        self.at_once = min(BATCH, self._device.free_memory() // each)

    def _crop(self, job: FrameJob) -> Array:
        """Return the part of a picture that a frame shows; the last pictures are kept."""
        from vcam_cli.files.images.images import read_picture

        scene, crop = job.frame.scene, job.frame.crop
        assert scene is not None and scene.file is not None and self._camera is not None
        if scene.file not in self._pictures:
            source: Any = self._camera.scene.source
            read = read_picture(scene.file, source.encoding, source.white, ("scene", "source"))
            if len(self._pictures) >= 2 * BATCH:
                self._pictures.clear()
            self._pictures[scene.file] = read.data
        top, left = crop["row"], crop["column"]
        whole = self._pictures[scene.file]
        return whole[top : top + crop["rows"], left : left + crop["columns"]]


def _seconds(given: Any) -> float:
    return float(given) if isinstance(given, int | float) else parse(given, "time")


def _outcome(
    job: FrameJob,
    taker: BatchCamera,
    raw: Array,
    clean: Array,
    seconds: float,
    gain: float,
    spent: float,
) -> Outcome:
    """Return the labels of a frame and the archive of its arrays."""
    camera = taker.at_gain(gain)
    arrays = {"raw": raw, "clean": clean.astype(np.float32, copy=False)}
    labels = noise_labels(camera.solved, camera.chain, camera.effects, seconds, raw)
    archive = archive_bytes({kind: arrays[kind] for kind in job.write})
    return Outcome(job.id, labels, seconds=spent, frames={NPZ: archive})
