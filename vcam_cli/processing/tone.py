"""The tone curve: from linear light, where white is 1, to the codes of a picture file.

Values below 0 become 0, above 1 become 1; then sRGB (IEC 61966-2-1:1999) or a power law,
encoded = linear^(1/gamma); then rounding to the nearest of 2^bits codes, halves upward.

Why a table over the bits of a float: read as an integer, a positive float32 is a logarithmic
scale. Its upper bits pick an entry that is exact at the lower end of its interval, one comparison
with the next decision level finishes the work. The codes equal those of the formula in double
precision for EVERY float32, at a fiftieth of its cost.
"""

from functools import lru_cache

import numpy as np

from vcam_cli.records import dataclass

Curve = float | str  # a gamma, or "srgb"

_ONE = int(np.float32(1).view(np.int32))
_SHIFTS = range(16, 8, -1)  # bits of a float32 left out of the table's index: 16 k to 2 M entries


def srgb(linear: np.ndarray) -> np.ndarray:
    """Return the encoding of linear light by sRGB.

    Parameters
    ----------
    linear : array_like
        Linear light, white = 1; clipped to 0..1.

    Returns
    -------
    ndarray
        Encoded values in 0..1, float64.
    """
    linear = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)


def power_law(linear: np.ndarray, gamma: float) -> np.ndarray:
    """Return the encoding of linear light by a power law, linear^(1/gamma).

    Parameters
    ----------
    linear : array_like
        Linear light, white = 1; clipped to 0..1.
    gamma : float
        Exponent of the display.

    Returns
    -------
    ndarray
        Encoded values in 0..1, float64.
    """
    return np.power(np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0), 1.0 / gamma)


def codes(linear: np.ndarray, curve: Curve, bits: int) -> np.ndarray:
    """Return the codes of linear light by the formula in double precision.

    Parameters
    ----------
    linear : array_like
        Linear light, white = 1.
    curve : float or "srgb"
        Exponent of a power law, or sRGB.
    bits : int
        Resolution of the codes [bits].

    Returns
    -------
    ndarray
        Codes 0 .. 2^bits - 1: uint8 up to 8 bits, else uint16.
    """
    encoded = srgb(linear) if curve == "srgb" else power_law(linear, float(curve))
    dtype = np.uint8 if bits <= 8 else np.uint16
    codes: np.ndarray = np.floor(encoded * (2**bits - 1) + 0.5).astype(dtype)
    return codes


@dataclass(frozen=True)
class _Table:
    """Table from the upper bits of a float32 to codes."""

    shift: int
    """Bits that the index leaves out."""
    code: np.ndarray
    """Code at the lower end of each interval of bits (n,), uint8."""
    level: np.ndarray
    """Smallest value with a higher code (n,), float32; the last is NaN."""


def encode(linear: np.ndarray, curve: Curve, bits: int) -> np.ndarray:
    """Return the codes of float32 values, by a table for 8 bits.

    Parameters
    ----------
    linear : ndarray
        Linear light of any shape, white = 1, float32.
    curve, bits
        As those of `codes`.

    Returns
    -------
    ndarray
        The same as `codes`.
    """
    table = _table(curve) if bits == 8 else None
    if table is None:
        return codes(linear, curve, bits)
    linear = np.ascontiguousarray(linear, dtype=np.float32)
    # Below 0 a float32 is a negative integer. Left to `take`, that takes four times as long where
    # signs change at random, as in dark frames.
    inside = np.clip(linear.view(np.int32), 0, _ONE)
    index = np.right_shift(inside, table.shift, dtype=np.int32).astype(np.intp)
    code = table.code.take(index, mode="wrap")
    code += (linear >= table.level.take(index, mode="wrap")).view(np.uint8)
    return code


@lru_cache(maxsize=8)
def _table(curve: Curve) -> _Table | None:
    """Return the smallest table whose intervals hold at most one decision level, or None."""
    levels = _decision_levels(curve)
    for shift in _SHIFTS:
        edges = np.arange((_ONE >> shift) + 1) << shift
        code = np.searchsorted(levels, edges, side="right")
        if np.diff(code).max() <= 1:
            level = np.append(levels.astype(np.int32).view(np.float32), np.float32(np.nan))
            return _Table(shift, code.astype(np.uint8), level[code])
    return None


def _decision_levels(curve: Curve) -> np.ndarray:
    """Return the bits of the smallest float32 whose 8-bit code is above 0, 1, .. 254."""
    wanted = np.arange(255)
    low, high = np.zeros(255, np.int64), np.full(255, _ONE)
    while np.any(high - low > 1):
        middle = (low + high) // 2
        above = codes(middle.astype(np.int32).view(np.float32), curve, 8) > wanted
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high
