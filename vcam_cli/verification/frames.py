"""Files of raw frames -> stacks of codes, one a condition, without frames that are broken."""

from __future__ import annotations

import glob
import hashlib
import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.mosaic import BLOCKS
from vcam_cli.errors import BadInput, Collector, bad
from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.records import dataclass
from vcam_cli.verification.frame_files import Page, pages, read_page
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import robust_deviation

OUTLIER = 10.0
"""Deviations of a frame's mean from the others' (scaled median deviation) that make it bad."""
LEAST_OUTLIER = 0.02
"""The same relative to the mean, whatever the others do."""

LEAST_SIDE = 4
"""Rows and columns of a color that statistics of rows and columns need."""
SPREAD = 0.5
"""Standard deviation of codes from which two frames are never equal by coincidence [DN]."""
_FORMATS = "give TIFF, PNG, PGM, npy, EXR, DNG or other raw files of cameras"


@dataclass(frozen=True)
class Stack:
    """Frames that were taken under the same conditions."""

    entry: FrameSet
    label: str
    frames: Array
    """Codes (n, rows, columns) [DN]."""
    dropped: tuple[str, ...]
    """Names of frames whose mean is far from the others'."""
    drift: float
    """Largest less smallest mean of a frame over their mean."""
    shift: int = 0
    """Bits by which the codes in the files are shifted left."""

    @property
    def notes(self) -> list[str]:
        """Notes on frames left out, for the user."""
        told = [f"{self.label}: {name} is unlike the others and left out" for name in self.dropped]
        if self.shift:
            told.append(
                f"{self.label}: the codes in the files are shifted left by {self.shift} bits, which"
                " is undone"
            )
        return told


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
) -> dict[int, list[Page]]:
    """Return the frames of every entry that are to be fitted: number of the entry -> pages.

    held_out: those that are to be predicted instead: all where none are held out; of edges alone
    where `edges` is true, else of all others.

    Raises BadInput where a file is no file of frames, or an entry has too few of them: one to
    predict, two to fit.
    """
    folder = measurement.origin.parent if measurement.origin else Path()
    found, problems = {}, Collector()
    for number, entry in enumerate(measurement.frames):
        is_edge = isinstance(entry, FrameSet) and entry.target == "slanted-edge"
        if not isinstance(entry, FrameSet) or (held_out and is_edge != edges):
            continue
        where = ("frames", number, "files")
        try:
            files = _named(folder, entry.files)
            listed = [page for file in files for page in pages(file)]
        except UnusableFile as error:
            raise _refusal(measurement, number, str(error), error.remedy or _FORMATS) from None
        kept = len(listed) - math.floor(measurement.hold_out * len(listed))
        found[number] = listed[:kept] if not held_out else listed[kept:] or listed
        least = 1 if held_out or is_edge else 2
        if len(found[number]) < least:
            message = (
                f"{len(files)} files in {folder} are {entry.files}: {len(listed)} frames, and"
                f" {kept} of them are not held out"
            )
            problems.add(where, message, f"give {least} frames or more that are not held out")
    raise_if_any(problems, measurement)
    return found


def _named(folder: Path, name: str) -> list[Path]:
    """Return the files of a name in a folder: the one of just this name, or all of a pattern."""
    alone = folder / name
    if alone.exists():
        return [alone]
    pattern = name if Path(name).is_absolute() else f"{glob.escape(str(folder))}/{name}"
    return sorted(Path(each) for each in glob.glob(pattern))


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
    measurement: Measurement, pages_of: dict[int, list[Page]]
) -> Iterator[tuple[int, Stack]]:
    """Yield number and stack of entries, likewise.

    Raises BadInput where a file is no frame, frames differ in size, or one is listed twice.
    """
    shape: tuple[int, ...] | None = None
    seen: dict[object, Page] = {}
    shift = _shift(measurement, pages_of) if pages_of else 0
    for number, listed in pages_of.items():
        entry = measurement.frames[number]
        assert isinstance(entry, FrameSet)
        frames = []
        for page in listed:
            frame = _read(page, measurement, number, shift)
            shape = shape or frame.shape
            if frame.shape != shape:
                message = f"{page.name} has {frame.shape} pixels, the first frame {shape}"
                raise _refusal(measurement, number, message, "give frames of one size")
            for mark in _marks(page, frame):
                other = seen.setdefault(mark, page)
                if other is not page:
                    message = f"{page.name} is a copy of {other.name}: not an independent frame"
                    raise _refusal(measurement, number, message, "list every frame once")
            frames.append(frame)
        stack = _without_outliers(entry, measurement.label(number), listed, np.stack(frames))
        yield number, replace(stack, shift=shift)


def _marks(page: Page, frame: Array) -> Iterator[object]:
    """Yield what no two frames have in common: file and page, and codes that have noise."""
    yield page.path.resolve(), page.number
    inner = frame[(frame > 0) & (frame < frame.max())]
    if inner.size and float(inner.std()) > SPREAD:
        yield hashlib.blake2b(frame.tobytes(), digest_size=16).digest()


def _shift(measurement: Measurement, pages_of: dict[int, list[Page]]) -> int:
    """Return by how many bits the codes of all frames are shifted left in their files.

    Instruments write 12 bits at the upper end of 16. All codes are multiples of 16 then, those of
    dark frames, too, which are within 12 bits.
    """
    assert measurement.levels is not None
    common = most = 0
    for number, listed in pages_of.items():
        codes = _stored(listed[0], measurement, number)
        if codes.dtype.kind != "u":
            return 0
        spare = 8 * codes.dtype.itemsize - measurement.levels.bits
        common = int(np.gcd(common, np.gcd.reduce(codes, axis=None)))
        most = max(most, int(codes.max()))
        if spare <= 0 or common % 2**spare:
            return 0
    return spare if common and most >= 2**measurement.levels.bits else 0


def _without_outliers(entry: FrameSet, label: str, files: list[Page], frames: Array) -> Stack:
    means = frames.mean(axis=(1, 2))
    center = np.median(means)
    limit = max(OUTLIER * robust_deviation(means), LEAST_OUTLIER * center)
    good = abs(means - center) <= limit
    if good.sum() < 2 <= len(files) or len(files) < 3:
        good[:] = True
    dropped = tuple(file.name for file, kept in zip(files, good, strict=True) if not kept)
    used = means[good]
    return Stack(entry, label, frames[good], dropped, float(np.ptp(used) / max(used.mean(), 1.0)))


def _stored(page: Page, measurement: Measurement, number: int) -> Array:
    """Return the codes of a frame as they are in its file, (rows, columns)."""
    colors = "".join(itertools.chain(*color_block(measurement)))
    try:
        codes = read_page(page, colors, measurement.readout)
    except (UnusableFile, OSError, ValueError, EOFError) as error:
        message = f"{page.name} cannot be read: {error}"
        raise _refusal(measurement, number, message, _FORMATS) from None
    if codes.ndim != 2 or not codes.size or not np.array_equal(codes, np.rint(codes)):
        message = f"{page.name} is no raw frame: one channel of whole numbers is needed"
        raise _refusal(measurement, number, message, "give raw frames, not pictures")
    block = color_block(measurement)
    least = [LEAST_SIDE * side for side in (len(block), len(block[0]))]
    if codes.shape[0] < least[0] or codes.shape[1] < least[1]:
        message = f"{page.name} has {codes.shape[0]} x {codes.shape[1]} pixels"
        remedy = f"give frames of {least[0]} x {least[1]} pixels or more"
        raise _refusal(measurement, number, message, remedy)
    return codes


def _read(page: Page, measurement: Measurement, number: int, shift: int) -> Array:
    codes = _stored(page, measurement, number)
    if shift:
        codes = codes >> shift
    assert measurement.levels is not None
    highest = 2**measurement.levels.bits - 1
    if codes.min() < 0:
        message = f"{page.name} has codes down to {codes.min():g}, an ADC gives none below 0"
        raise _refusal(measurement, number, message, "give frames with their black level in them")
    if codes.max() > highest:
        message = f"{page.name} has codes up to {codes.max():g}, more than {highest}"
        raise _refusal(measurement, number, message, "correct levels.bits")
    return codes.astype(np.uint16 if highest < 1 << 16 else np.uint32)


def _refusal(measurement: Measurement, number: int, message: str, remedy: str) -> BadInput:
    path = ("frames", number, "files")
    return bad(path, message, remedy).with_places(measurement.locate)
