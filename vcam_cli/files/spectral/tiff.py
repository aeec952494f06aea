"""Multichannel TIFF as a file of spectra: a channel or a page a band, and a table that says which.

TIFF has no tag for wavelengths, so they are given as CSV, either in a file beside the picture
(scene.csv beside scene.tif) or as the text of the picture's ImageDescription tag:

    wavelength_nm,reflectance        or    wavelength_nm,radiance
    400,0.0001                             400,1
    410,0.0001                             410,1

One row a channel (or a page, where each has one channel), in their order. The second column is
the value of a stored 1: a reflectance, or a radiance in W/(sr m2 nm). So 16-bit codes
with 10000 for a reflectance of 1 have 0.0001 in every row.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np

from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.files.images.images import check_size, is_in_strips, open_image, read_samples
from vcam_cli.files.images.rows import pending_error
from vcam_cli.files.spectral.data import PER_NM, SpectralData, check_length, finite_numbers

LONGEST = 1 << 20  # bytes of a table


def open_tiff(path: Path) -> SpectralData:
    """Return the header of a multichannel TIFF. Raise UnusableFile."""
    with open_image(path) as source:
        spec = source.spec()
        if spec.depth > 1 or spec.deep:
            raise UnusableFile("is a volume, not an image")
        in_strips = is_in_strips(spec)
        pages = _pages(source, spec)
    bands = spec.nchannels if spec.nchannels > 1 else pages
    check_size(spec, bands)
    sidecar = path.with_suffix(".csv")
    wavelengths, quantity, gain = _table(sidecar, spec.get_string_attribute("ImageDescription"))
    check_length(bands, wavelengths)
    several = pages > 1 and spec.nchannels > 1
    notes = ("only the first of several images in the file is used",) if several else ()
    unit = PER_NM if quantity == "radiance" else 1.0
    return SpectralData(
        (spec.height, spec.width), wavelengths, quantity, lambda: _read(path, pages), gain * unit,
        notes=notes,
        read_rows=(lambda start, stop: _read(path, pages, (start, stop))) if in_strips else None,
    )  # fmt: skip


def _pages(source: Any, first: Any) -> int:
    """Return the number of pages. Raise UnusableFile where they are not of one size and kind."""
    count = 1
    while source.seek_subimage(count, 0):
        spec = source.spec()
        same = (spec.width, spec.height, spec.nchannels) == (first.width, first.height, 1)
        if first.nchannels == 1 and not (same and str(spec.format) == str(first.format)):
            raise UnusableFile(
                "has pages of different sizes or kinds", "give one page a band, all alike"
            )
        count += 1
    pending_error(source.geterror)
    return count


def _read(path: Path, pages: int, rows: tuple[int, int] | None = None) -> np.ndarray:
    with open_image(path) as source:
        spec = source.spec()
        if spec.nchannels > 1:
            return read_samples(source, spec, tuple(range(spec.nchannels)), rows=rows)[0]
        first = read_samples(source, spec, (0,), rows=rows)[0]
        out = np.empty((len(first), spec.width, pages), first.dtype)
        out[:, :, 0] = first[:, :, 0]
        for page in range(1, pages):
            out[:, :, page] = read_samples(source, spec, (0,), page, rows)[0][:, :, 0]
        return out


def _table(
    sidecar: Path, description: str
) -> tuple[np.ndarray, Literal["radiance", "reflectance"], np.ndarray]:
    """Return the wavelengths [m], the quantity of the values, and the value of a stored 1."""
    write = f"write {sidecar.name} with the lines wavelength_nm,reflectance and 400,1 and so on"
    text = description
    if sidecar.is_file():
        if sidecar.stat().st_size > LONGEST:
            raise UnusableFile(f"{sidecar.name} beside it is too long", write)
        text = sidecar.read_text("utf-8-sig", "replace")
    lines = [line.strip() for line in text.splitlines()]
    head, *rows = [x for x in lines if x and not x.startswith("#")] or [""]
    for quantity in ("radiance", "reflectance"):
        if head.replace(" ", "") == f"wavelength_nm,{quantity}":
            cells = [row.split(",") for row in rows]
            if not cells or any(len(row) != 2 for row in cells):
                raise UnusableFile("its table of wavelengths has rows without two numbers", write)
            wavelengths = finite_numbers([row[0] for row in cells], "its wavelength_nm")
            return (
                wavelengths * 1e-9,
                quantity,
                finite_numbers([row[1] for row in cells], f"its {quantity}"),
            )
    raise UnusableFile(
        "has no table of wavelengths in a CSV file or in its ImageDescription", write
    )
