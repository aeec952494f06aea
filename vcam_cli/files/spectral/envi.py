"""ENVI: a text header NAME.hdr and a raw file beside it.

The header's keys are those of "ENVI Header Files" (NV5 Geospatial): samples, lines, bands, header
offset, data type, interleave, byte order, wavelength, wavelength units, data ignore value, bbl (1
for a band in use, 0 for a bad one, whose light is that between its neighbors).

ENVI has no key that says what the values are, so it is read off the keys that scale them:
- `reflectance scale factor`: the value in the file that is a reflectance of 1;
- `data reflectance gain values` and `data reflectance offset values`, one a band;
- `data gain values` and `data offset values`, one a band, which give radiance in W/(m2 um sr);
- `data units = W/(m2 nm sr)` or another of `UNITS`: radiance in that unit.
A header with none of these is refused, since nothing tells radiance from counts.
"""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.errors import CannotDo
from vcam_cli.files.file_checks import UnusableFile, truncated_file
from vcam_cli.files.spectral.data import PER_NM, SpectralData, check_length, finite_numbers

TYPES = {
    1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
"""ENVI's numbers of sample types that are real."""
LENGTHS = {
    "nm": 1e-9, "nanometer": 1e-9, "nanometers": 1e-9,
    "um": 1e-6, "micrometer": 1e-6, "micrometers": 1e-6, "micron": 1e-6, "microns": 1e-6,
}  # fmt: skip
UNITS = {
    "W/(m2nmsr)": PER_NM, "W/(m2umsr)": 1e6, "mW/(m2nmsr)": 1e-3 * PER_NM,
    "uW/(cm2nmsr)": 1e-2 * PER_NM, "W/(m2msr)": 1.0,
}  # fmt: skip
"""Unit without spaces, nm before sr -> radiance of a value of 1 in the file [W/(sr m2 m)]."""
INTERLEAVES = {"bsq": (1, 2, 0), "bil": (0, 2, 1), "bip": (0, 1, 2)}
"""Interleave -> order of the file's axes that gives (h, w, bands)."""
ENDINGS = ("", ".img", ".dat", ".raw", ".bin", ".bsq", ".bil", ".bip")
LONGEST = 1 << 24  # bytes of a header


def open_envi(path: Path) -> SpectralData:
    """Return the header of an ENVI file. Raise UnusableFile."""
    keys = _keys(path)
    height, width, bands = (_whole_number(keys, name) for name in ("lines", "samples", "bands"))
    wavelengths = _wavelengths(keys)
    check_length(bands, wavelengths)
    if keys.get("file compression", "0") != "0":
        raise UnusableFile("is compressed, which is not read", "save it without compression")
    kind, order = _sample(keys)
    interleave = keys.get("interleave", "bsq").lower()
    if interleave not in INTERLEAVES:
        raise UnusableFile(f"has interleave {interleave!r}; known are {', '.join(INTERLEAVES)}")
    raw = data_file(path)
    offset = _whole_number(keys, "header offset", 0)
    claimed = offset + height * width * bands * kind.itemsize
    length = raw.stat().st_size
    if length < claimed:
        raise truncated_file(f"{raw.name} has {length} bytes, its header says {claimed}")
    notes = (f"{raw.name} is longer than its header says",) if length > claimed else ()
    sizes = {"bsq": (bands, height, width), "bil": (height, bands, width)}
    shape = sizes.get(interleave, (height, width, bands))

    def read_rows(start: int, stop: int) -> np.ndarray:
        return _rows(raw, offset, kind.newbyteorder(order), shape, interleave, (start, stop))

    used = _bands_in_use(keys, bands)
    if used is not None:
        notes = (*notes, f"{bands - used.sum()} of {bands} bands are marked as bad (bbl), not used")
    return SpectralData(
        (height, width), wavelengths, **_scale(keys, bands), read=lambda: read_rows(0, height),
        notes=notes, no_data=_no_data(keys, kind), used=used, read_rows=read_rows,
    )  # fmt: skip


def _rows(
    raw: Path,
    offset: int,
    kind: np.dtype,
    shape: tuple[int, int, int],
    interleave: str,
    rows: tuple[int, int],
) -> np.ndarray:
    """Return some rows (n, w, bands) of a raw file whose axes have this shape in their order."""
    along = INTERLEAVES[interleave][0]
    pieces = shape[:along]  # of a file band by band, each band's rows are a piece
    count = rows[1] - rows[0]
    out = np.empty((*pieces, count, *shape[along + 1 :]), kind)
    row_bytes = kind.itemsize * math.prod(shape[along + 1 :])
    with open(raw, "rb") as file:
        for number, piece in enumerate(out.reshape(math.prod(pieces), -1)):
            file.seek(offset + (number * shape[along] + rows[0]) * row_bytes)
            if file.readinto(piece.data.cast("B")) != piece.nbytes:
                raise CannotDo(f"{raw} has become shorter while it was read", "run it again")
    return out.transpose(INTERLEAVES[interleave])


def data_file(path: Path) -> Path:
    """Return the raw file of a header. Raise UnusableFile without one."""
    for ending in ENDINGS:
        for spelt in (ending, ending.upper()):
            found = path.with_suffix(spelt)
            if found.is_file():
                return found
    tried = ", ".join(path.with_suffix(ending).name for ending in ENDINGS)
    raise UnusableFile(f"has no raw file beside it; looked for {tried}", "put it beside the header")


def _keys(path: Path) -> dict[str, str]:
    """Return the header's keys, in lower case, and their values as text without braces."""
    if path.stat().st_size > LONGEST:
        raise UnusableFile("is too long for a header")
    text = path.read_text("latin-1")
    if not text.lstrip().startswith("ENVI"):
        raise UnusableFile("is no ENVI header: it does not begin with ENVI")
    found = {}
    lines = iter(text.splitlines())
    for line in lines:
        name, equals, value = line.partition("=")
        if not equals or name.lstrip().startswith(";"):
            continue
        parts = [value]
        if value.lstrip().startswith("{"):
            while "}" not in parts[-1]:
                parts.append(next(lines, "}"))
        found[" ".join(name.lower().split())] = " ".join(parts).strip().strip("{}").strip()
    return found


def _whole_number(keys: dict[str, str], name: str, default: int | None = None) -> int:
    text = keys.get(name, "" if default is None else str(default))
    if not re.fullmatch(r"\d{1,15}", text):
        wrong = f"{name} is {text!r}, not a whole number" if text else f"has no {name}"
        raise UnusableFile(f"its header: {wrong}", f"write {name} = ...")
    return int(text)


def _bands_in_use(keys: dict[str, str], bands: int) -> np.ndarray | None:
    """Return whether each band is in use; None where all are."""
    if not keys.get("bbl"):
        return None
    said = _list(keys, "bbl")
    check_length(bands, said, "values of bbl")
    used = said != 0
    return None if used.all() else used


def _no_data(keys: dict[str, str], kind: np.dtype) -> float | None:
    """Return the value of missing data, rounded as the file's samples are; None without one."""
    text = keys.get("data ignore value", "")
    if not text:
        return None
    if text.lower().strip("+-") in ("nan", "inf"):
        return float(text)
    value = float(finite_numbers(text, "its data ignore value")[0])
    with np.errstate(over="ignore"):
        return float(kind.type(value)) if kind.kind == "f" else value


def _sample(keys: dict[str, str]) -> tuple[np.dtype, Any]:
    """Return the type of a sample, and NumPy's letter of its byte order."""
    number, big = _whole_number(keys, "data type"), _whole_number(keys, "byte order", 0)
    if number not in TYPES:
        raise UnusableFile(f"has data type {number}; known are {', '.join(map(str, TYPES))}")
    if big not in (0, 1):
        raise UnusableFile(f"has byte order {big}; it is 0 (little endian) or 1 (big endian)")
    return np.dtype(TYPES[number]), "><"[1 - big]


def _wavelengths(keys: dict[str, str]) -> np.ndarray:
    if "wavelength" not in keys:
        raise UnusableFile("its header has no wavelength", "write wavelength = {400, 410, ...}")
    unit = keys.get("wavelength units", "")
    if unit.lower() not in LENGTHS:
        raise UnusableFile(
            f"has wavelength units {unit!r}, which are unknown",
            "write wavelength units = Nanometers, or Micrometers",
        )
    return _list(keys, "wavelength") * LENGTHS[unit.lower()]


def _list(keys: dict[str, str], name: str) -> np.ndarray:
    values = [part.strip() for part in keys[name].split(",") if part.strip()]
    return finite_numbers(values, f"its {name}")


def _scale(keys: dict[str, str], bands: int) -> dict[str, Any]:
    """Return quantity, gain and offset, see the module."""
    if "reflectance scale factor" in keys:
        factor = _list(keys, "reflectance scale factor")
        if factor.size != 1 or not factor[0] > 0:
            raise UnusableFile("has a reflectance scale factor that is not positive")
        return {"quantity": "reflectance", "gain": 1 / float(factor[0])}
    for kind, quantity, unit in (
        ("data reflectance", "reflectance", 1.0),
        ("data", "radiance", UNITS["W/(m2umsr)"]),
    ):
        if f"{kind} gain values" in keys:
            found = {"gain": _list(keys, f"{kind} gain values"), "offset": np.zeros(bands)}
            if f"{kind} offset values" in keys:
                found["offset"] = _list(keys, f"{kind} offset values")
            for name, values in found.items():
                check_length(bands, values, f"{kind} {name} values")
            return {"quantity": quantity} | {name: unit * v for name, v in found.items()}
    unit_text = "".join(keys.get("data units", "").split()).replace("srnm", "nmsr")
    if unit_text.replace("srum", "umsr") not in UNITS:
        given = f"has data units {keys['data units']!r}" if "data units" in keys else "does not say"
        raise UnusableFile(
            f"{given}: whether it holds radiance or reflectance, and in which unit, is not known",
            "write into the header reflectance scale factor = 1 (the value of a reflectance of 1), "
            "or data units = W/(m2 nm sr)",
        )
    return {"quantity": "radiance", "gain": UNITS[unit_text.replace("srum", "umsr")]}
