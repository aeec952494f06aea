"""Point spread functions from image files (any that OpenImageIO reads), NPY files and text grids.

A text grid is rows of numbers apart by commas, semicolons, tabs or spaces, below whatever a lens
program writes above them (Zemax and Code V do). A file is taken as it lies, its first row on top;
an EXR by its display window. Its values are light in any unit, integers too, and never a coded
gray.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.files.file_checks import UnusableFile, brief_reason, check_file, convert_errors
from vcam_cli.files.images.images import (
    check_size,
    extract_display_window,
    open_image,
    read_samples,
)

ROUNDING = 1e-3
"""Part of the largest value below which a negative one is the rounding of a lens program."""
_REMEDY = (
    "give an EXR, TIFF, NPY or text file with one channel, or an image or NPY file with one for "
    "each of psf.wavelengths"
)
MOST_TEXT = 1 << 24
"""Largest text that is read [bytes]: a grid of a thousand times a thousand."""
MOST_SAMPLES = 10**8
"""Most samples of an array that is read."""
_TEXT = (".csv", ".txt", ".dat", ".psf", ".asc")
_ALPHA = ("A", "ALPHA")


def read_psf(
    path: Path | str, channels: int, yaml_path: tuple[str | int, ...] | str
) -> NDArray[np.float64]:
    """Return a point spread function (channels, rows, columns), each channel of sum 1.

    channels: as many as the file must have, alpha aside. Raise BadInput (with `yaml_path`) for a
    file that is missing, no image, damaged, of another number of channels, with a value that is
    not finite or clearly negative, or all zero; CannotDo where it may not be read or does not fit
    the memory.
    """
    path = Path(path)
    with convert_errors(path, yaml_path, _REMEDY):
        check_file(path)
        if path.suffix.lower() in _TEXT:
            stored = _read_text(path, channels)
        elif path.suffix.lower() == ".npy":
            stored = _read_npy(path, channels)
        else:
            with open_image(path) as source:
                stored = _read_channels(source, channels)
        return np.array([_normalize(stored[:, :, k]) for k in range(channels)])


def _read_channels(source: Any, channels: int) -> Array:
    """Return the channels as they are in the file, (rows, columns, channels)."""
    spec = source.spec()
    if spec.deep or spec.depth > 1:
        raise UnusableFile("is a deep image or a volume, not an image")
    names = spec.channelnames
    chosen = tuple(
        k for k, name in enumerate(names) if name.upper() not in _ALPHA and k != spec.alpha_channel
    )
    if len(chosen) != channels:
        raise UnusableFile(_wrong_channel_count(len(chosen), channels))
    check_size(spec, channels)
    data, notes = read_samples(source, spec, chosen)
    if source.format_name() == "openexr":
        data = extract_display_window(data, spec, notes)
    return data


def _read_npy(path: Path, channels: int) -> Array:
    """Return an array (rows, columns) or (channels, rows, columns) as (rows, columns, channels)."""
    try:
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise UnusableFile(
            f"is no NPY file that can be read ({brief_reason(str(error), path)})"
        ) from None
    if stored.dtype.kind not in "fiu" or stored.ndim not in (2, 3) or not stored.size:
        raise UnusableFile(f"holds {stored.dtype} of shape {stored.shape}, not a grid of numbers")
    if stored.size > MOST_SAMPLES:
        raise UnusableFile(
            f"holds {stored.size:.3g} samples, and at most {MOST_SAMPLES:.0g} are read"
        )
    planes = stored.reshape(-1, *stored.shape[-2:])
    if len(planes) != channels:
        raise UnusableFile(_wrong_channel_count(len(planes), channels))
    return np.moveaxis(np.asarray(planes, np.float64), 0, -1)


def _read_text(path: Path, channels: int) -> Array:
    """Return the grid of a text file (rows, columns, 1): its first run of rows of numbers."""
    if channels != 1:
        raise UnusableFile(_wrong_channel_count(1, channels))
    if path.stat().st_size > MOST_TEXT:
        raise UnusableFile(f"is larger than {MOST_TEXT >> 20} MB", "give it as an NPY file")
    rows: list[list[float]] = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        cells = _numbers(line)
        if cells and (not rows or len(cells) == len(rows[0])):
            rows.append(cells)
        elif len(rows) > 1 and cells:
            raise UnusableFile(
                f"has {len(cells)} columns in line {number}; the rows above have {len(rows[0])}"
            )
        elif len(rows) > 1 and line.strip():
            raise UnusableFile(f"has no row of numbers in line {number}, below {len(rows)} rows")
        elif line.strip():
            rows = [cells] if cells else []  # a lone row of numbers was part of the head
    if len(rows) < 2:
        raise UnusableFile("has no grid of numbers")
    return np.array(rows)[:, :, None]


def _text(path: Path) -> str:
    """Return the text of a file; lens programs write UTF-16 as well."""
    data = path.read_bytes()
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _numbers(line: str) -> list[float]:
    """Return the two or more numbers of a line; [] for any other line."""
    for mark in (";", "\t", ",", None):
        cells = [cell for cell in line.strip().split(mark) if cell.strip()]
        if mark != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            numbers = [float(cell) for cell in cells]
        except ValueError:
            continue
        if len(numbers) > 1:
            return numbers
    return []


def _wrong_channel_count(found: int, wanted: int) -> str:
    has = f"has {found} channel{'s' * (found != 1)}"
    if wanted == 1:
        return f"{has}, where one for all wavelengths is needed"
    return f"{has}, but psf.wavelengths lists {wanted}"


def _normalize(plane: Array) -> NDArray[np.float64]:
    """Return a plane of light with the sum 1."""
    light = plane.astype(np.float64)
    if not np.isfinite(light).all():
        raise UnusableFile("holds a value that is not finite; light is 0 or more")
    top, least = float(light.max()), float(light.min())
    if least < -ROUNDING * max(top, 0.0):
        row, column = np.unravel_index(np.argmin(light), light.shape)
        raise UnusableFile(
            f"holds a negative value ({least:g} at row {row}, column {column}); light is 0 or more",
            "replace such values, for example by 0",
        )
    if not top > 0:
        raise UnusableFile("is zero everywhere, which is no point spread function")
    light = np.maximum(light, 0.0) / top  # so that the sum of large numbers does not overflow
    normalized: NDArray[np.float64] = light / light.sum()
    return normalized
