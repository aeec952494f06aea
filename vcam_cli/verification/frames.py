"""Files of raw frames -> stacks of codes, one a condition, without frames that are broken."""

from __future__ import annotations

import glob
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.mosaic import BLOCKS
from vcam_cli.errors import BadInput, Collector, bad
from vcam_cli.files.file_checks import UnusableFile, is_raw
from vcam_cli.files.images.camera_raw import read_codes
from vcam_cli.files.images.exr import read_exr
from vcam_cli.files.images.images import open_image, read_samples
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import robust_deviation

OUTLIER = 10.0
"""Deviations of a frame's mean from the others' (scaled median deviation) that make it bad."""
LEAST_OUTLIER = 0.02
"""The same relative to the mean, whatever the others do."""

_FORMATS = "give TIFF, PNG, npy, EXR, DNG or other raw files of cameras"


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

    @property
    def notes(self) -> list[str]:
        """What the user is told of frames that are left out."""
        return [f"{self.label}: {name} is unlike the others and left out" for name in self.dropped]


def color_block(measurement: Measurement) -> tuple[tuple[str, ...], ...]:
    """Return the colors of the smallest block that repeats; Y where there are no filters."""
    return BLOCKS[measurement.pattern]


def color_planes(measurement: Measurement) -> dict[str, list[tuple[slice, slice]]]:
    """Return where the pixels of each color are: rows and columns of its places in the block."""
    block = color_block(measurement)
    planes: dict[str, list[tuple[slice, slice]]] = {}
    for row, column in np.ndindex(len(block), len(block[0])):
        place = slice(row, None, len(block)), slice(column, None, len(block[0]))
        planes.setdefault(block[row][column], []).append(place)
    return planes


def paths(
    measurement: Measurement, held_out: bool = False, edges: bool = False
) -> dict[int, list[Path]]:
    """Return the files of every entry that is to be fitted: number of the entry -> files.

    held_out: those that are to be predicted instead: all where none are held out; of edges alone
    where `edges` says so, else of all others.

    Raises BadInput where an entry has too few: one to predict, two to fit.
    """
    folder = measurement.origin.parent if measurement.origin else Path()
    found, problems = {}, Collector()
    for number, entry in enumerate(measurement.frames):
        is_edge = isinstance(entry, FrameSet) and entry.target == "slanted-edge"
        if not isinstance(entry, FrameSet) or (held_out and is_edge != edges):
            continue
        files = [Path(name) for name in sorted(glob.glob(str(folder / entry.files)))]
        kept = len(files) - math.floor(measurement.hold_out * len(files))
        found[number] = files[:kept] if not held_out else files[kept:] or files
        least = 1 if held_out or is_edge else 2
        if len(found[number]) < least:
            where = ("frames", number, "files")
            message = f"{len(files)} files in {folder} are {entry.files}, of which {kept} fit"
            problems.add(where, message, f"give {least} frames or more that are not held out")
    raise_if_any(problems, measurement)
    return found


def raise_if_any(problems: Collector, measurement: Measurement) -> None:
    """Raise BadInput with all problems, at their places in the measurement's file."""
    try:
        problems.raise_if_any()
    except BadInput as error:
        raise error.with_places(measurement.locate) from None


def stacks(measurement: Measurement) -> Iterator[Stack]:
    """Yield the stack of every entry that is fitted, one after the other: only one is in memory.

    Raises BadInput where a file is no frame, or frames differ in size.
    """
    return (stack for _, stack in numbered_stacks(measurement, paths(measurement)))


def numbered_stacks(
    measurement: Measurement, files_of: dict[int, list[Path]]
) -> Iterator[tuple[int, Stack]]:
    """Yield number and stack of entries, likewise.

    Raises BadInput where a file is no frame, or frames differ in size.
    """
    shape: tuple[int, ...] | None = None
    for number, files in files_of.items():
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
        stack = _without_outliers(entry, measurement.label(number), files, np.stack(frames))
        yield number, stack


def _without_outliers(entry: FrameSet, label: str, files: list[Path], frames: NDArray) -> Stack:
    means = frames.mean(axis=(1, 2))
    center = np.median(means)
    limit = max(OUTLIER * robust_deviation(means), LEAST_OUTLIER * center)
    good = abs(means - center) <= limit
    if good.sum() < 2 <= len(files) or len(files) < 3:
        good[:] = True
    dropped = tuple(file.name for file, kept in zip(files, good, strict=True) if not kept)
    used = means[good]
    return Stack(entry, label, frames[good], dropped, float(np.ptp(used) / max(used.mean(), 1.0)))


def _read(file: Path, measurement: Measurement, number: int) -> NDArray:
    try:
        codes = _codes(file, measurement)
    except (UnusableFile, OSError, ValueError) as error:
        message = f"{file.name} cannot be read: {error}"
        raise _refusal(measurement, number, message, _FORMATS) from None
    assert measurement.levels is not None
    highest = 2**measurement.levels.bits - 1
    if codes.ndim != 2 or not np.array_equal(codes, np.rint(codes)):
        message = f"{file.name} is no raw frame: one channel of whole numbers is needed"
        raise _refusal(measurement, number, message, "give raw frames, not pictures")
    if codes.min() < 0 or codes.max() > highest:
        message = f"{file.name} has codes up to {codes.max():g}, more than {highest}"
        raise _refusal(measurement, number, message, "correct levels.bits")
    return codes.astype(np.uint16 if highest < 1 << 16 else np.uint32)


def _codes(file: Path, measurement: Measurement) -> NDArray:
    """Return the numbers of a file, (rows, columns) where it has one channel."""
    if is_raw(file):
        codes, colors = read_codes(file)
        meant = "".join(itertools.chain(*color_block(measurement)))
        if colors and colors != meant:
            raise UnusableFile(f"its pixels are {colors}, and pattern says {meant}")
        return codes
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
