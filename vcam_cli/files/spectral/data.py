"""Header of a spectral file, and the function that reads its samples.

A reader (one module a format) opens a file, checks every claim of its header against the length of
the file, and returns a `SpectralData`; the checks and units of all formats are in `hyperspectral`.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.records import dataclass
from vcam_cli.scenes.hyperspectral import Quantity

PER_NM = 1e9
"""Radiance per nanometer as radiance per meter."""
GAINS: dict[Quantity, float] = {
    "radiance": PER_NM,
    "irradiance": PER_NM / math.pi,
    "reflectance": 1.0,
}
"""Factors on what files hold per nanometer, with which scenes are made."""
MOST = 1e100
"""The largest number of a list: what units make of it is finite in 64 bits."""
MOST_LIGHT = 1e30
"""The largest radiance [W/(sr m2 m)] or reflectance: 32 bits end at 3.4e38."""
MOST_WAVELENGTHS = 10**6
"""Largest number of wavelengths in a file."""


@dataclass(frozen=True)
class SpectralData:
    """The header of a spectral file.

    Values in the file x `gain` + `offset` are radiances [W/(sr m2 m)] or reflectances (white = 1).
    """

    shape: tuple[int, int]
    """Rows and columns."""
    wavelengths: np.ndarray
    """The wavelengths (bands,) [m], in the order of the file."""
    quantity: Quantity
    read: Callable[[], Any]
    """Returns the values (h, w, bands) as stored."""
    gain: float | np.ndarray = 1.0
    """The gain of all bands, or one for each."""
    offset: float | np.ndarray = 0.0
    """The offset of all bands, or one for each."""
    no_data: float | None = None
    """The value that marks missing data; may be NaN."""
    used: np.ndarray | None = None
    """Whether each band (bands,) is in use; None for all."""
    white: np.ndarray | None = None
    """The radiance (bands,) of a perfect white [W/(sr m2 m)], where the file holds it."""
    notes: tuple[str, ...] = ()
    copies: float = 0
    """How many times `read` holds the values, as float32, beside those that it returns."""
    read_rows: Callable[[int, int], np.ndarray] | None = None
    """Returns the values (n, w, bands) of the rows from one to another, where they can be read by
    themselves: then the file is never in memory."""


def finite_numbers(values: Any, what: str) -> np.ndarray:
    """Return a list of finite numbers (n,), float64. Raise UnusableFile with the list's name."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except (ValueError, TypeError):
        raise UnusableFile(f"{what} is not a list of numbers") from None
    if found.size != max(found.shape, default=1) or not np.isfinite(found).all():
        raise UnusableFile(f"{what} is not a list of finite numbers")
    if np.abs(found).max(initial=0.0) > MOST:
        raise UnusableFile(f"{what} has a number beyond {MOST:g}", "look for a wrong unit")
    return found.ravel()


def check_length(bands: int, wavelengths: np.ndarray, what: str = "wavelengths") -> None:
    """Raise UnusableFile where there are not as many wavelengths (or others) as bands."""
    if len(wavelengths) != bands:
        raise UnusableFile(f"holds {bands} bands but {len(wavelengths)} {what}")
