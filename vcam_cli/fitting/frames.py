"""Files of raw frames -> stacks of codes, one a condition, without frames that are broken."""

from __future__ import annotations

import glob
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.mosaic import BLOCKS
from vcam_cli.errors import BadInput, Collector, bad
from vcam_cli.files.exr import read_exr
from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.files.images import open_image, read_samples
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.model import Measurement

OUTLIER = 10.0
"""Deviations of a frame's mean from the others' (scaled median deviation) that make it bad."""
LEAST_OUTLIER = 0.02
"""The same relative to the mean, whatever the others do."""


@dataclass(frozen=True)
class Stack:
    """Frames that were taken under the same conditions."""

    entry: FrameSet
    label: str
    frames: NDArray
    """Codes (n, rows, columns) [DN]."""
    dropped: tuple[str, ...]
    """Names of frames whose mean is far from the others'."""
    drift: float
    """Largest less smallest mean of a frame over their mean."""

    def plane(self, row: int, column: int, block: tuple[int, int]) -> NDArray:
        """Return the frames' pixels of one place of the color filter array (n, rows, columns)."""
        return self.frames[:, row :: block[0], column :: block[1]]


def color_block(measurement: Measurement) -> tuple[tuple[str, ...], ...]:
    """Return the colors of the smallest block that repeats; Y where there are no filters."""
    return BLOCKS[measurement.pattern]


def paths(measurement: Measurement) -> dict[int, list[Path]]:
    """Return the files of every entry that is to be fitted: number of the entry -> files.

    Raises BadInput where an entry has fewer than two frames besides those held out.
    """
    folder = measurement.origin.parent if measurement.origin else Path()
    found, problems = {}, Collector()
    for number, entry in enumerate(measurement.frames):
        if not isinstance(entry, FrameSet):
            continue
        files = [Path(name) for name in sorted(glob.glob(str(folder / entry.files)))]
        kept = files[: len(files) - math.floor(measurement.hold_out * len(files))]
        found[number] = kept
        least = 1 if entry.target == "slanted-edge" else 2
        if len(kept) < least:
            where = ("frames", number, "files")
            message = f"{len(files)} files in {folder} are {entry.files}, of which {len(kept)} fit"
            problems.add(where, message, f"give {least} frames or more that are not held out")
    try:
        problems.raise_if_any()
    except BadInput as error:
        raise error.with_places(measurement.locate) from None
    return found


def stacks(measurement: Measurement) -> Iterator[Stack]:
    """Yield the stack of every entry, one after the other: only one is in memory.

    Raises BadInput where a file is no frame, or frames differ in size.
    """
    shape: tuple[int, ...] | None = None
    for number, files in paths(measurement).items():
        entry = measurement.frames[number]
        assert isinstance(entry, FrameSet)
        frames = []
        for file in files:
            frame = _read(file, measurement, number)
            shape = shape or frame.shape
            if frame.shape != shape:
                message = f"{file.name} has {frame.shape} pixels, the first frame {shape}"
                raise _refusal(measurement, number, message, "give frames of one size")
            frames.append(frame)
        yield _without_outliers(entry, measurement.label(number), files, np.stack(frames))


def _without_outliers(entry: FrameSet, label: str, files: list[Path], frames: NDArray) -> Stack:
    means = frames.mean(axis=(1, 2))
    center = np.median(means)
    limit = max(OUTLIER * 1.4826 * float(np.median(abs(means - center))), LEAST_OUTLIER * center)
    good = abs(means - center) <= limit
    if good.sum() < 2 <= len(files) or len(files) < 3:
        good[:] = True
    dropped = tuple(file.name for file, kept in zip(files, good, strict=True) if not kept)
    used = means[good]
    return Stack(entry, label, frames[good], dropped, float(np.ptp(used) / max(used.mean(), 1.0)))


def _read(file: Path, measurement: Measurement, number: int) -> NDArray:
    try:
        codes = _codes(file)
    except (UnusableFile, OSError, ValueError) as error:
        message = f"{file.name} cannot be read: {error}"
        raise _refusal(measurement, number, message, "give TIFF, PNG, npy or EXR") from None
    assert measurement.levels is not None
    highest = 2**measurement.levels.bits - 1
    if codes.ndim != 2 or not np.array_equal(codes, np.rint(codes)):
        message = f"{file.name} is no raw frame: one channel of whole numbers is needed"
        raise _refusal(measurement, number, message, "give raw frames, not pictures")
    if codes.min() < 0 or codes.max() > highest:
        message = f"{file.name} has codes up to {codes.max():g}, more than {highest}"
        raise _refusal(measurement, number, message, "correct levels.bits")
    return codes.astype(np.uint16 if highest < 1 << 16 else np.uint32)


def _codes(file: Path) -> NDArray:
    """Return the numbers of a file, (rows, columns) where it has one channel."""
    if file.suffix == ".npy":
        return np.load(file, allow_pickle=False)
    if file.suffix == ".exr":
        channels, _ = read_exr(file)
        if "dn" in channels:
            return channels["dn"]
        return next(iter(channels.values())) if len(channels) == 1 else np.zeros((1, 1, 2))
    with open_image(file) as source:
        spec = source.spec()
        data, _ = read_samples(source, spec, tuple(range(spec.nchannels)))
    return data[:, :, 0] if data.shape[2] == 1 else data


def _refusal(measurement: Measurement, number: int, message: str, remedy: str) -> BadInput:
    path = ("frames", number, "files")
    return bad(path, message, remedy).with_places(measurement.locate)
