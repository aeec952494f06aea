"""Spectral images as OpenEXR files that other programs read.

The layout is that of A. Fichet, R. Pacanowski, A. Wilkie, "An OpenEXR Layout for Spectral Images",
Journal of Computer Graphics Techniques 10(3), 1-18, 2021: a channel a wavelength, named
"S0.550,000000nm" (S0 for light that is emitted, not reflected), and the attributes
spectralLayoutVersion and emissiveUnits.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np

from vcam_cli.files.atomic import cannot_write
from vcam_cli.files.exr import ExrWriter
from vcam_cli.files.rows import Attribute

ROWS_AT_ONCE = 64


def channel_name(wavelength: float) -> str:
    """Name of the channel of a wavelength [m]."""
    nanometers = f"{wavelength * 1e9:.6f}".replace(".", ",")
    return f"S0.{nanometers}nm"


def write_spectral(
    path: Path | str,
    wavelengths: Sequence[float] | np.ndarray,
    planes: Iterable[np.ndarray],
    shape: tuple[int, int],
    units: str,
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Writes one plane (h, w) for each wavelength [m] as float32 channels.

    units: of the values, as the layout has them ("W.m^-2.nm^-1"). The planes are asked for one by
    one and wait in a nameless file beside `path`, since EXR wants all channels of a row together:
    no more than one is in memory. Raises CannotDo (disk full, permission).
    """
    names = [channel_name(float(w)) for w in wavelengths]
    said = {"spectralLayoutVersion": "1.0", "emissiveUnits": units, **(attributes or {})}
    try:
        with TemporaryFile(dir=Path(path).parent) as waiting:
            for plane in planes:
                waiting.write(np.ascontiguousarray(plane, np.float32).tobytes())
            with ExrWriter(path, shape, names, said) as exr:
                for row in range(0, shape[0], ROWS_AT_ONCE):
                    count = min(ROWS_AT_ONCE, shape[0] - row)
                    exr.write_rows(row, _rows(waiting, names, shape, row, count))
    except OSError as error:
        raise cannot_write(path, error) from error


def _rows(
    waiting: BinaryIO, names: Sequence[str], shape: tuple[int, int], row: int, count: int
) -> dict[str, np.ndarray]:
    """The same rows of all planes."""
    height, width = shape
    found = {}
    for index, name in enumerate(names):
        waiting.seek(4 * width * (height * index + row))
        data = np.frombuffer(waiting.read(4 * width * count), np.float32)
        found[name] = data.reshape(count, width)
    return found
