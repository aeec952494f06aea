"""Frames of a data set in batches on a device: crops of pictures, at times and gains of their own.

Frames that differ in nothing else have a camera in common, which is made ready once in a process.
Frames of charts, and those that need more than codes with and without noise, are computed one by
one.
"""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.batches.batch_camera import BatchCamera
from vcam_cli.batches.frames import frame_bytes, metered, ready, solved_for, timed_effects
from vcam_cli.batches.light import DeviceLight, SingleLight
from vcam_cli.batches.pictures import linear_pictures
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.datasets.drawing import Frame
from vcam_cli.devices.processor import Processor, require
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.images.images import read_picture
from vcam_cli.files.report import to_json
from vcam_cli.floats import own_float_errors
from vcam_cli.records import dataclass
from vcam_cli.units import parse

BATCH = 64
"""Frames that are computed together, at most."""
PICTURES = 1 << 29
"""Bytes of pictures that are kept: other crops of them follow."""
CAMERAS = 2
"""Cameras that stay ready."""
OWN = ("exposure.time", "exposure.gain")
"""Keys that frames of a batch have each for itself."""
WRITTEN = {"raw", "clean"}
Taken = tuple[Frame, BatchCamera, Array, Array, float, float]
"""A frame, its camera, codes with and without noise, exposure time [s] and gain."""


def batch_key(frame: Frame, write: Sequence[str]) -> str | None:
    """Return what frames of one batch have in common; None of a frame that no batch computes.

    Parameters
    ----------
    frame : Frame
        The frame, as it was drawn.
    write : sequence of str
        Kinds of arrays that are written.
    """
    scene = frame.scene
    if scene is None or scene.file is None or not set(write) <= WRITTEN:
        return None
    shared = {key: value for key, value in frame.values.items() if key not in OWN}
    size = [frame.crop.get(name) for name in ("rows", "columns")]
    return to_json([shared, size, {**scene.source, "file": ""}])


@dataclass(frozen=True)
class _Begun:
    """Frames of one gain whose codes are on their way to the processor."""

    frames: Sequence[Frame]
    times: Sequence[float]
    gain: float
    taker: BatchCamera
    dn: Callable[[], Array]
    clean: Callable[[], Array]


def _finished(groups: Sequence[_Begun]) -> Iterator[Taken]:
    """Yield the frames of groups as their codes arrive."""
    for group in groups:
        arrays = zip(group.frames, group.dn(), group.clean(), group.times, strict=True)
        for frame, raw, plain, time in arrays:
            plain = plain.astype(np.float32, copy=False)
            yield frame, group.taker, raw, plain, time, group.gain


class DeviceFrames:
    """Batches of frames that have a camera in common, on a device."""

    def __init__(self, camera: Camera, device: Processor) -> None:
        self._device, self._camera = device, camera
        self._pictures: OrderedDict[Path, Array] = OrderedDict()
        self._ready: tuple[BatchCamera, DeviceLight | SingleLight, float] | None = None
        self._at_once = 1
        """Frames of a batch: one makes the camera ready, then as many as memory holds."""

    @own_float_errors
    def take(self, frames: Sequence[Frame]) -> Iterator[Taken]:
        """Yield frames as they are taken: those of one gain one after the other.

        Parameters
        ----------
        frames : sequence of Frame
            Frames of one `batch_key`.

        Raises
        ------
        BadInput, CannotDo
            As a simulation does.
        """
        start, begun = 0, list[_Begun]()
        with self._device.errors():
            try:
                while start < len(frames):
                    stop = start + self._at_once
                    # It is computed while codes of the one before are copied and used.
                    ahead = self._batch(frames[start:stop])
                    yield from _finished(begun)
                    start, begun = stop, ahead
            except BadInput:
                yield from _finished(begun)
                raise
            yield from _finished(begun)

    def _batch(self, frames: Sequence[Frame]) -> list[_Begun]:
        """Begin a batch: groups of one gain, whose codes are copied."""
        views: dict[str, int] = {}
        crops, shown = list[Array](), list[int]()
        for frame in frames:
            assert frame.scene is not None
            view = to_json([frame.scene.name, frame.crop])
            if view not in views:
                views[view] = len(views)
                crops.append(self._crop(frame))
            shown.append(views[view])
        stack = self._device.stacked(crops)
        taker, light, white = self._ready or self._make_ready(stack.shape[1:])
        rates = light.rates(linear_pictures(stack, self._device, self._camera))
        by_gain: dict[float, list[tuple[int, float]]] = defaultdict(list)
        for number, (frame, place) in enumerate(zip(frames, shown, strict=True)):
            time, gain = self._exposure(frame, rates[place], white)
            by_gain[gain].append((number, time))
        groups = []
        for gain, members in by_gain.items():
            index = self._device.put(np.array([shown[number] for number, _ in members]))
            times = [time for _, time in members]
            seeds = [frames[number].seed for number, _ in members]
            own = [frames[number] for number, _ in members]
            copies = map(self._device.fetch, taker.take(rates[index], times, gain, seeds))
            groups.append(_Begun(own, times, gain, taker, *copies))
        return groups

    def _exposure(self, frame: Frame, rate: Array, white: float) -> tuple[float, float]:
        """Return the exposure time [s] and the gain of a frame."""
        assert self._ready is not None
        solved = self._ready[0].solved
        own = [frame.values.get(key) for key in OWN]
        base = solved.exposure.time or 0.0, solved.gain
        if own[0] is None and solved.exposure.auto is not None:
            base = metered(solved, rate, white)
        return _seconds(own[0], base[0]), base[1] if own[1] is None else float(own[1])

    def _make_ready(
        self, shape: tuple[int, ...]
    ) -> tuple[BatchCamera, DeviceLight | SingleLight, float]:
        """Make the camera ready for pictures of a shape, and choose how many are at once."""
        solved = solved_for(self._camera)
        if names := timed_effects(solved):
            message = f"{', '.join(names)}: the light depends on the exposure time"
            raise CannotDo(message, "use --device cpu")
        taker, light, white = ready(solved, shape, self._device)
        each = frame_bytes(taker) + light.bytes_per_picture(shape[-1]) + waiting_bytes(taker)
        require(self._device, each, "a frame")
        self._at_once = min(BATCH, self._device.free_memory() // each)
        self._ready = taker, light, white
        return self._ready

    def _crop(self, frame: Frame) -> Array:
        """Return the part of a picture that a frame shows; the last pictures are kept."""
        scene, crop = frame.scene, frame.crop
        assert scene is not None and scene.file is not None
        if scene.file not in self._pictures:
            source: Any = self._camera.scene.source
            read = read_picture(scene.file, source.encoding, source.white, ("scene", "source"))
            self._pictures[scene.file] = read.data
            while len(self._pictures) > 1 and self._picture_bytes > PICTURES:
                self._pictures.popitem(last=False)
        top, left = crop["row"], crop["column"]
        whole = self._pictures[scene.file]
        return whole[top : top + crop["rows"], left : left + crop["columns"]]

    @property
    def _picture_bytes(self) -> int:
        return sum(picture.nbytes for picture in self._pictures.values())


def waiting_bytes(taker: BatchCamera) -> int:
    """Return the memory of a frame's codes, with and without noise, until they are copied."""
    g = taker.solved.geometry
    return g.rows * g.columns * (np.dtype(np.uint32).itemsize + np.dtype(taker.dtype).itemsize)


_KEPT: OrderedDict[tuple[int, str], DeviceFrames] = OrderedDict()


def device_frames(
    first: Frame, write: Sequence[str], base: Document[Camera], device: Processor
) -> DeviceFrames:
    """Return what takes the frames of a frame's `batch_key`; the last ones are kept.

    Parameters
    ----------
    first : Frame
        One of the frames.
    write : sequence of str
        Kinds of arrays that are written.
    base : Document
        The data set's camera file.
    device : Processor
        The device.
    """
    key = id(device), to_json([base.tree.plain(), batch_key(first, write)])
    if key not in _KEPT:
        _KEPT[key] = DeviceFrames(first.camera(base), device)
        while len(_KEPT) > CAMERAS:
            _KEPT.popitem(last=False)
    _KEPT.move_to_end(key)
    return _KEPT[key]


def _seconds(given: Any, other: float) -> float:
    """Return an exposure time as YAML has it [s]; `other` for None."""
    if given is None:
        return other
    return float(given) if isinstance(given, int | float) else parse(given, "time")
