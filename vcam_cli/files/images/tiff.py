"""TIFF files of whole numbers, such as raw frames: baseline TIFF 6.0, and BigTIFF beyond 4 GB.

Written here, since raw frames need tags of any number and type and directories within directories,
which neither OpenImageIO nor Pillow writes.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import field
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

import vcam_cli
from vcam_cli.arrays import Array
from vcam_cli.files.atomic import write_whole
from vcam_cli.records import dataclass

Tag = tuple[int, str, int, Any]
"""Number, type as `struct` writes it, count, and value of a tag; rationals are flat pairs "2I",
and "x" is bytes without a meaning in TIFF."""

COLORS = {"R": 0, "G": 1, "B": 2, "C": 3, "M": 4, "W": 6}
"""Color -> its number in the tag CFAPattern of TIFF/EP (ISO 12234-2). Y is 5 there, yellow; here it
may be the luminance of a pixel without filter, which the tag has no color for."""
SOFTWARE = f"vcam {vcam_cli.__version__}"
GRAY, RGB, YCBCR = 1, 2, 6
"""PhotometricInterpretation."""
_TYPES = {"B": 1, "s": 2, "H": 3, "I": 4, "2I": 5, "x": 7, "2i": 10, "d": 12, "Q": 16}
_STRIPS, _TILES = (273, 279), (324, 325)
_CLASSIC_BYTES = (1 << 32) - (1 << 20)
"""Bytes of samples up to which all positions in a file fit into 32 bits."""


@dataclass(frozen=True)
class Directory:
    """Tags, the samples that they describe, and further directories."""

    tags: Sequence[Tag]
    samples: Sequence[bytes | memoryview] = ()
    """Strips, or tiles, as the file has them."""
    tiled: bool = False
    within: Mapping[int, Directory] = field(default_factory=dict)
    """Tag that points to a directory -> the directory."""

    @property
    def sample_bytes(self) -> int:
        """Bytes of the samples, those of directories within it included."""
        own = sum(len(part) for part in self.samples)
        return own + sum(each.sample_bytes for each in self.within.values())


def write_tiff(
    path: Path | str, samples: Array, description: str, tags: Sequence[Tag] = ()
) -> None:
    """Write whole numbers (rows, columns) or (rows, columns, C), uncompressed.

    They are uint16, or uint32 where one of `samples` is larger than that holds. Three channels are
    RGB, fewer or more are gray and what is beside it: programs that know no mosaic show that as it
    is. Raise CannotDo (disk full, permission).
    """
    photometric = RGB if samples.shape[2:] == (3,) else GRAY
    described = [*image_tags(samples.shape, photometric, 8 * samples.itemsize), *tags]
    described += [text(270, description), text(305, SOFTWARE)]
    write_directory(path, Directory(described, [raw_bytes(samples)]))


def image_tags(
    shape: Sequence[int],
    photometric: int,
    bits: int,
    compression: int = 1,
    reduced: bool = False,
    tile: tuple[int, int] | None = None,
) -> list[Tag]:
    """Return the tags that every image has.

    Parameters
    ----------
    shape : sequence of int
        Rows and columns; with the number of channels where there are more than one.
    photometric : int
        What the samples mean, PhotometricInterpretation.
    bits : int
        Bits of a sample.
    compression : int, optional
        Number of the compression; 1: uncompressed.
    reduced : bool, optional
        Whether it is a smaller copy of another image in the file.
    tile : (int, int), optional
        Rows and columns of a tile; one strip where there are none.
    """
    rows, columns, *rest = shape
    count = rest[0] if rest else 1
    beside = max(0, count - {GRAY: 1, RGB: 3}.get(photometric, count))
    parts = [(322, "I", 1, tile[1]), (323, "I", 1, tile[0])] if tile else [(278, "I", 1, rows)]
    return [
        (254, "I", 1, int(reduced)),
        (256, "I", 1, columns),
        (257, "I", 1, rows),
        (258, "H", count, (bits,) * count),
        (259, "H", 1, compression),
        (262, "H", 1, photometric),
        (277, "H", 1, count),
        *parts,
        (282, "2I", 1, (1, 1)),
        (283, "2I", 1, (1, 1)),
        (284, "H", 1, 1),
        (296, "H", 1, 1),
        (339, "H", count, (1,) * count),
        *([(338, "H", beside, (0,) * beside)] if beside else []),
    ]


def text(code: int, value: str) -> Tag:
    """Return a tag with a text: ASCII, as TIFF has it, other letters as escapes."""
    data = value.encode("ascii", "backslashreplace") + b"\0"
    return code, "s", len(data), data


def raw_bytes(samples: Array) -> memoryview:
    """Return samples as a file has them, little-endian."""
    ordered = np.ascontiguousarray(samples, samples.dtype.newbyteorder("<"))
    return ordered.reshape(-1).view(np.uint8).data


def write_directory(path: Path | str, first: Directory) -> None:
    """Write a TIFF file of a directory and those within it. Raise CannotDo."""
    wide = first.sample_bytes > _CLASSIC_BYTES
    with write_whole(path) as temporary, open(temporary, "wb") as file:
        head = (
            struct.pack("<2sHHHQ", b"II", 43, 8, 0, 16)
            if wide
            else struct.pack("<2sHI", b"II", 42, 8)
        )
        file.write(head)
        _Writer(file, "Q" if wide else "I").write(first)


@dataclass(frozen=True)
class _Writer:
    """Writes directories: tags before samples, so that a truncated file is recognized."""

    file: BinaryIO
    offset: str
    """Type of a position in the file."""

    def write(self, directory: Directory) -> int:
        """Write a directory, those within it and its samples; return where it begins."""
        start, sizes = self._end(), [len(part) for part in directory.samples]
        counts, places = (_TILES if directory.tiled else _STRIPS)[::-1]
        tags = list(directory.tags)
        if sizes:
            tags += [
                (counts, self.offset, len(sizes), sizes),
                (places, self.offset, len(sizes), sizes),
            ]
        tags += [(code, self.offset, 1, 0) for code in directory.within]
        self.file.write(bytes(len(self._directory(tags, 0)[0])))  # until all places are known
        known: dict[int, Any] = {code: self.write(each) for code, each in directory.within.items()}
        end = self._end()
        ends = np.cumsum([end + len(self._directory(tags, 0)[1]), *(_even(size) for size in sizes)])
        known[places] = ends[:-1].tolist()
        tags = [(code, kind, n, known.get(code, value)) for code, kind, n, value in tags]
        entries, values = self._directory(tags, end)
        self.file.write(values)
        for part in directory.samples:
            self.file.write(part)
            self._end()
        self.file.seek(start)
        self.file.write(entries)
        self._end()
        return start

    def _directory(self, tags: Sequence[Tag], at: int) -> tuple[bytes, bytes]:
        """Return entries, and the values that do not fit into them, which are to stand `at`."""
        place, wide = struct.Struct("<" + self.offset), self.offset == "Q"
        entries, values = [struct.pack("<Q" if wide else "<H", len(tags))], b""
        for code, kind, count, value in sorted(tags, key=itemgetter(0)):
            data = _packed(kind, value)
            if len(data) > place.size:
                values += data.ljust(_even(len(data)), b"\0")
                data = place.pack(at + len(values) - _even(len(data)))
            head = struct.pack(f"<HH{self.offset}", code, _TYPES[kind], count)
            entries.append(head + data.ljust(place.size, b"\0"))
        return b"".join(entries) + bytes(place.size), values

    def _end(self) -> int:
        """Go to the end, where positions are even, and return the position."""
        end = self.file.seek(0, 2)
        self.file.write(bytes(end % 2))
        return end + end % 2


def _even(size: int) -> int:
    return size + size % 2


def _packed(kind: str, value: Any) -> bytes:
    """Return a tag's value as the file has it."""
    if kind in "sx":
        return bytes(value)
    numbers = np.atleast_1d(np.asarray(value))
    return numbers.astype(np.dtype(kind[-1]).newbyteorder("<")).tobytes()


def mosaic_tags(block: Sequence[Sequence[str]]) -> list[Tag]:
    """Return the tags CFARepeatPatternDim and CFAPattern of TIFF/EP; () where a color has none."""
    names = [name for row in block for name in row]
    if not names or not set(names) <= set(COLORS):
        return []
    size = (len(block), len(block[0]))
    numbers = bytes(COLORS[name] for name in names)
    return [(33421, "H", 2, size), (33422, "B", len(numbers), tuple(numbers))]


def whole_numbers(values: Array, highest: float) -> Array:
    """Return codes as uint16, or uint32 where the highest one needs it."""
    return values.astype(np.uint16 if highest < 1 << 16 else np.uint32)
