"""NumPy's npz as a file of spectra.

Arrays by name: `wavelength_nm` (bands,), and either `radiance` (h, w, bands) [W/(sr m2 nm)] or
`reflectance` (h, w, bands), perfect white = 1. A file of radiances may hold `white` (bands,), the
radiance of a perfect white diffuser in the scene [W/(sr m2 nm)].
"""

import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Literal

import numpy as np

from vcam_cli.files.file_checks import UnusableFile, truncated_file
from vcam_cli.files.spectral.data import (
    MOST_WAVELENGTHS,
    PER_NM,
    SpectralData,
    check_length,
    finite_numbers,
)

_WRITE = "write it with numpy.savez(NAME, wavelength_nm=..., radiance=...) or reflectance=..."
MOST_ARRAYS, LONGEST_HEADER = 1000, 10_000


def open_npz(path: Path) -> SpectralData:
    """Return the header of an npz file. Raise UnusableFile."""
    try:
        with zipfile.ZipFile(path) as archive:
            stored = {
                info.filename.removesuffix(".npy"): info.compress_type == zipfile.ZIP_STORED
                for info in _arrays(archive)
            }
            shapes = {
                info.filename.removesuffix(".npy"): _header(archive, info)
                for info in _arrays(archive)
            }
            quantity = _quantity(shapes)
            wavelengths = _list(archive, shapes, "wavelength_nm") * 1e-9
            white = None
            if "white" in shapes and quantity == "radiance":
                white = _list(archive, shapes, "white") * PER_NM
    except (zipfile.BadZipFile, EOFError, zlib.error):
        raise UnusableFile("is no complete npz file", _WRITE) from None
    shape = shapes[quantity]
    if len(shape) != 3:
        raise UnusableFile(f"its {quantity} has {len(shape)} axes, not (h, w, bands)", _WRITE)
    check_length(shape[2], wavelengths)
    if white is not None:
        check_length(shape[2], white, "values of white")
    known = {"wavelength_nm", quantity, "white"}
    spare = sorted(set(shapes) - known)
    notes = (f"{', '.join(spare)} in the file not used",) if spare else ()
    gain = PER_NM if quantity == "radiance" else 1.0
    return SpectralData(
        (shape[0], shape[1]), wavelengths, quantity, lambda: _read(path, quantity), gain,
        white=white, notes=notes,
        read_rows=_stored_rows(path, quantity) if stored[quantity] else None,
    )  # fmt: skip


def _quantity(shapes: dict[str, tuple[int, ...]]) -> Literal["radiance", "reflectance"]:
    if ("radiance" in shapes) == ("reflectance" in shapes):
        found = ", ".join(shapes) or "nothing"
        raise UnusableFile(f"needs one of radiance and reflectance; it holds {found}", _WRITE)
    if "wavelength_nm" not in shapes:
        raise UnusableFile("has no wavelength_nm", _WRITE)
    return "radiance" if "radiance" in shapes else "reflectance"


def _arrays(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Return the archive's arrays, packed in the ways that NumPy packs them."""
    found = [info for info in archive.infolist() if info.filename.endswith(".npy")]
    if len(found) > MOST_ARRAYS:
        raise UnusableFile(f"holds more than {MOST_ARRAYS} arrays", _WRITE)
    for info in found:
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise UnusableFile(f"{info.filename} in it is not packed as NumPy does it", _WRITE)
    return found


def _header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the shape of a real array whose bytes are all there."""
    with archive.open(info) as file:
        try:
            shape, _, kind = _array_header(file)
            begins = file.tell()
        except ValueError:
            raise UnusableFile(f"{info.filename} in it is no array", _WRITE) from None
    if kind.kind not in "uif":
        raise UnusableFile(f"{info.filename} in it holds no real numbers", _WRITE)
    if begins + int(np.prod(shape, dtype=object)) * kind.itemsize > info.file_size:
        raise truncated_file(f"{info.filename} claims {' x '.join(map(str, shape))} values")
    return tuple(shape)


def _array_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, order of axes and type of an array in NumPy's format."""
    version = np.lib.format.read_magic(file)
    begins = file.tell()
    if int.from_bytes(file.read(2 if version == (1, 0) else 4), "little") > LONGEST_HEADER:
        raise ValueError("a header too long")  # which NumPy would read before it reports it
    file.seek(begins)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(file)
    return np.lib.format.read_array_header_2_0(file)


def _list(archive: zipfile.ZipFile, shapes: dict[str, tuple[int, ...]], name: str) -> np.ndarray:
    if int(np.prod(shapes[name], dtype=object)) > MOST_WAVELENGTHS:
        raise UnusableFile(f"its {name} has more than {MOST_WAVELENGTHS} values")
    with archive.open(f"{name}.npy") as file:
        return finite_numbers(_whole(file), f"its {name}")


def _read(path: Path, name: str) -> np.ndarray:
    """Return an array of the archive."""
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as file:
        return _whole(file)


def _stored_rows(path: Path, name: str) -> Callable[[int, int], np.ndarray]:
    """Return what reads some rows of an array that is not compressed, through a map of the file."""
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo(f"{name}.npy")
        with archive.open(info) as file:
            shape, by_column, kind = _array_header(file)
            begins = file.tell()
    with path.open("rb") as raw:  # a local header of 30 bytes, two of them lengths that follow
        raw.seek(info.header_offset)
        local = raw.read(30)
    begins += info.header_offset + 30 + sum(struct.unpack("<HH", local[26:30]))

    def read(start: int, stop: int) -> np.ndarray:
        # A map of every call: pages that were read count to the process as long as one is there.
        return np.array(
            np.memmap(path, kind, "r", begins, shape, "F" if by_column else "C")[start:stop]
        )

    return read


def _whole(file: IO[bytes]) -> np.ndarray:
    try:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except (zipfile.BadZipFile, EOFError, ValueError, zlib.error):
        raise truncated_file() from None
