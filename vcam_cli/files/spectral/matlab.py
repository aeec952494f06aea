"""Variables of MATLAB files, versions 5 to 7: arrays of numbers, and structures of them.

The layout is that of "MAT-File Format" (The MathWorks, R2024a): a header of 128 bytes, then
elements of a tag (type, bytes) and data, each variable one element, packed by zlib or not.

Why a reader of our own: SciPy's believes what a file says of itself. A damaged one can end the
process or take all memory. Here every size is checked against the bytes of the file, only the
requested variables are unpacked, and no more of them than fits the memory.
"""

import math
import mmap
import zlib
from collections.abc import Collection
from contextlib import closing
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vcam_cli import memory
from vcam_cli.errors import CannotDo
from vcam_cli.files.file_checks import UnusableFile

HEADER = 128
TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Numbers of the types that data has in the file."""
MATRIX, PACKED = 14, 15
STRUCTURE = 2
NUMBERS = dict(enumerate(("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"), 6))
"""Classes of arrays, and what their numbers are."""
COMPLEX = 0x0800
DEEPEST, LONGEST_NAME = 8, 64
PIECE, ASKED = 1 << 16, 1 << 26
"""Bytes that are unpacked at once, and above which the free memory is checked."""
SUSPECT, MOST_RATIO = 1 << 30, 300
"""Largest compression ratio of a variable of more bytes than that."""
NO_NUMBERS = np.empty(0, object)
"""The value of text, cells and all else that is not read."""

Order = Literal["<", ">"]
Value = np.ndarray | dict[str, Any]


def read_variables(path: Path, names: Collection[str]) -> dict[str, Value]:
    """Return some of a file's variables: arrays in MATLAB's order of axes, structures as dicts.

    Raise UnusableFile for another or a damaged file, CannotDo without enough memory.
    """
    with (
        open(path, "rb") as file,
        closing(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) as m,
    ):
        if m[126:128] not in (b"IM", b"MI"):
            raise UnusableFile("is no complete MATLAB file of version 5 to 7")
        order: Order = "<" if m[126:128] == b"IM" else ">"
        try:
            return _variables(_Bytes(m, order, HEADER, len(m)), names, path)
        except (_Damaged, zlib.error) as error:
            raise UnusableFile(f"is no complete MATLAB file ({str(error)[:80]})") from None


def read_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return name and shape of a file's variables of real numbers. Raise UnusableFile."""
    with (
        open(path, "rb") as file,
        closing(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) as m,
    ):
        order: Order = "<" if m[126:128] == b"IM" else ">"
        bytes_, found = _Bytes(m, order, HEADER, len(m)), dict[str, tuple[int, ...]]()
        while bytes_.position < bytes_.stop:
            try:
                kind, inside = bytes_.element(padded=False)
                flags, shape, name = _head(_beginning(inside) if kind == PACKED else inside)
            except (_Damaged, zlib.error):
                break  # what is whole before it is known
            if flags & 0xFF in NUMBERS and not flags & COMPLEX:
                found[name] = shape
        return found


class _Damaged(Exception):
    """A claim of a file that its bytes do not bear out."""


class _Bytes:
    """Consecutive elements in some bytes, read one after the other."""

    def __init__(self, data: Any, order: Order, start: int, stop: int) -> None:
        self.data, self.order, self.position, self.stop = data, order, start, stop

    def element(self, padded: bool = True) -> tuple[int, "_Bytes"]:
        """Return the type and the data of the next element."""
        first, length = (int(v) for v in self._integers(self.position, 2))
        start = self.position + 8
        if first >> 16:  # small: type, length and data in eight bytes
            first, length, start = first & 0xFFFF, first >> 16, self.position + 4
            if length > 4:
                raise _Damaged("a small element is too long")
            self.position += 8
        else:
            self.position = start + length + (-length % 8 if padded else 0)
        if start + length > self.stop:
            raise _Damaged("it ends too early")
        self.position = min(self.position, self.stop)
        return first, _Bytes(self.data, self.order, start, start + length)

    def numbers(self, kind: int) -> np.ndarray:
        """Return all of it as numbers of a type of the file, in memory of their own."""
        if kind not in TYPES:
            raise _Damaged(f"data of type {kind}")
        dtype = np.dtype(TYPES[kind])
        if (self.stop - self.position) % dtype.itemsize:
            raise _Damaged("numbers are cut short")
        stored = np.frombuffer(self.data[self.position : self.stop], dtype.newbyteorder(self.order))
        return stored.astype(dtype, copy=False)

    def _integers(self, start: int, count: int) -> np.ndarray:
        if start + 4 * count > self.stop:
            raise _Damaged("it ends too early")
        return np.frombuffer(self.data[start : start + 4 * count], f"{self.order}u4")


def _variables(bytes_: _Bytes, names: Collection[str], path: Path) -> dict[str, Value]:
    """Return the variables that are wanted, by name."""
    found: dict[str, Value] = {}
    while bytes_.position < bytes_.stop:
        kind, inside = bytes_.element(padded=False)
        if kind == PACKED:
            unpacked = _unpack(inside, names, path)
            if unpacked is None:
                continue
            kind, inside = unpacked.element(padded=False)
        if kind == MATRIX and inside.position < inside.stop:
            name, value = _matrix(inside, path, names)
            if name in found:
                raise _Damaged(f"it holds {name} twice")
            if value is not None:
                found[name] = value
    return found


def _unpack(packed: _Bytes, names: Collection[str], path: Path) -> _Bytes | None:
    """Return the element that is packed; None for a variable that is not wanted."""
    try:
        if _head(_beginning(packed))[2] not in names:
            return None
    except _Damaged:
        return None  # not a spectral variable: its name is too long, or it has too many axes
    unpack, out = zlib.decompressobj(), bytearray()
    for start in range(packed.position, packed.stop, PIECE):
        given = packed.data[start : min(start + PIECE, packed.stop)]
        while given and not unpack.eof:
            out += unpack.decompress(given, MOST_RATIO * PIECE)
            given = unpack.unconsumed_tail
            if len(out) > max(SUSPECT, MOST_RATIO * (packed.stop - packed.position)):
                raise _Damaged(f"it unpacks to more than {MOST_RATIO} times its size")
            check_memory(path, len(out))
    return _Bytes(memoryview(out), packed.order, 0, len(out))


def _beginning(packed: _Bytes) -> _Bytes:
    """Return the head of an array that is packed."""
    data = packed.data[packed.position : min(packed.position + PIECE, packed.stop)]
    begin = zlib.decompressobj().decompress(data, 4 * LONGEST_NAME + 512)
    return _Bytes(begin, packed.order, 8, len(begin))


def check_memory(path: Path, count: int) -> None:
    """Raise CannotDo for more bytes than fit the memory twice: as read, and as used."""
    if count > ASKED and 2 * count > memory.available():
        message = f"{path} needs {2 * count / 1e9:.1f} GB of memory, and less is free"
        raise CannotDo(message, "crop the scene, or use a machine with more memory")


def _head(inside: _Bytes) -> tuple[int, tuple[int, ...], str]:
    """Return class with flags, shape and name of an array."""
    flags = inside.element()[1].numbers(6)
    shape = inside.element()[1].numbers(5)
    name = inside.element()[1]
    if len(flags) < 1 or not 2 <= len(shape) <= 32 or shape.min() < 0:
        raise _Damaged("an array without class or shape")
    if name.stop - name.position > LONGEST_NAME:
        raise _Damaged("a name is too long")
    text = bytes(name.data[name.position : name.stop]).decode("latin-1")
    return int(flags[0]), tuple(int(n) for n in shape), text


def _matrix(
    inside: _Bytes, path: Path, names: Collection[str] | None = None, depth: int = 0
) -> tuple[str, Value | None]:
    """Return name and value of an array; the value is None for a name that is not wanted."""
    flags, shape, name = _head(inside)
    if names is not None and name not in names:
        return name, None
    kind = flags & 0xFF
    if kind == STRUCTURE and shape == (1, 1) and depth < DEEPEST:
        return name, _structure(inside, path, depth)
    if kind not in NUMBERS or flags & COMPLEX:
        return name, NO_NUMBERS
    stored_type, data = inside.element()
    count, whole = math.prod(shape), np.dtype(NUMBERS[kind])
    check_memory(path, max(data.stop - data.position, min(count, data.stop) * whole.itemsize))
    values = data.numbers(stored_type)
    if len(values) != count:
        raise _Damaged(f"{name[:20] or 'an array'} has {len(values)} numbers, not {count}")
    return name, values.astype(whole, copy=False).reshape(shape, order="F")


def _structure(inside: _Bytes, path: Path, depth: int) -> dict[str, Any]:
    """Return the fields of one structure."""
    lengths = inside.element()[1].numbers(5)
    names = inside.element()[1]
    length = int(lengths[0]) if len(lengths) else 0
    if not 1 <= length <= LONGEST_NAME:
        raise _Damaged("a structure without names")
    found: dict[str, Any] = {}
    for start in range(names.position, names.stop, length):
        name = bytes(names.data[start : min(start + length, names.stop)]).split(b"\0")[0]
        kind, value = inside.element()
        if kind != MATRIX:
            raise _Damaged("a field that is no array")
        empty = value.position == value.stop
        read = NO_NUMBERS if empty else _matrix(value, path, None, depth + 1)[1]
        found[name.decode("latin-1")] = read
    return found
