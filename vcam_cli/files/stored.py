"""What a reader of spectral files finds in a file's header, and how its samples are fetched.

A reader (one module a format) opens a file, believes nothing that the file's length does not bear
out, and gives a `Stored`; checks and units that all formats share are in `hyperspectral`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vcam_cli.files.images import Unusable
from vcam_cli.scenes.hyperspectral import Quantity

PER_NM = 1e9
"""Radiance per nanometer as radiance per meter."""
MOST_WAVELENGTHS = 10**6
"""Of a file: more than these are not looked at."""


@dataclass(frozen=True)
class Stored:
    """A file's header. Values in the file x `gain` + `offset` are radiances [W/(sr m2 m)] or
    reflectances (white = 1)."""

    shape: tuple[int, int]
    """(h, w)"""
    wavelengths: np.ndarray
    """(bands,) in the file's order [m]"""
    quantity: Quantity
    read: Callable[[], Any]
    """Gives (h, w, bands) as stored, perhaps still on the disk."""
    gain: float | np.ndarray = 1.0
    """A number, or one a band."""
    offset: float | np.ndarray = 0.0
    nothing: float | None = None
    """Value that stands for no data."""
    white: np.ndarray | None = None
    """(bands,) radiance of a perfect white [W/(sr m2 m)], where the file says it."""
    notes: tuple[str, ...] = ()


def numbers(values: Any, what: str) -> np.ndarray:
    """A list of finite numbers (n,), float64; Unusable with the list's name for anything else."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except (ValueError, TypeError):
        raise Unusable(f"{what} is not a list of numbers") from None
    if found.size != max(found.shape, default=1) or not np.isfinite(found).all():
        raise Unusable(f"{what} is not a list of finite numbers")
    return found.ravel()


def lengths(bands: int, wavelengths: np.ndarray, what: str = "wavelengths") -> None:
    """Unusable where there are not as many wavelengths (or others) as bands."""
    if len(wavelengths) != bands:
        raise Unusable(f"holds {bands} bands but {len(wavelengths)} {what}")
