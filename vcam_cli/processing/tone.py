"""The tone curve: from linear light, where white is 1, to the codes of a picture file.

Values below 0 become 0, above 1 become 1; then sRGB (IEC 61966-2-1:1999) or a power law,
encoded = linear^(1/gamma); then rounding to the nearest of 2^bits codes, halves upward.

Why a table over the bits of a float: read as an integer, a positive float32 is a logarithmic
scale. Its upper bits pick an entry that is exact at the lower end of its interval, one comparison
with the next decision level finishes the work. The codes equal those of the formula in double
precision for EVERY float32, at a fiftieth of its cost.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Curve = float | str  # a gamma, or "srgb"

_ONE = int(np.float32(1).view(np.int32))
_SHIFTS = range(16, 8, -1)  # bits of a float32 left out of the table's index: 16 k to 2 M entries


def srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB encoding of linear light, clipped to [0, 1]; float64 in, float64 out."""
    linear = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)


def power_law(linear: np.ndarray, gamma: float) -> np.ndarray:
    """linear^(1/gamma), clipped to [0, 1]; float64."""
    return np.power(np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0), 1.0 / gamma)


def codes(linear: np.ndarray, curve: Curve, bits: int) -> np.ndarray:
    """Codes 0 .. 2^bits - 1 by the formula in double precision: uint8 up to 8 bits, else uint16."""
    encoded = srgb(linear) if curve == "srgb" else power_law(linear, float(curve))
    dtype = np.uint8 if bits <= 8 else np.uint16
    return np.floor(encoded * (2**bits - 1) + 0.5).astype(dtype)


@dataclass(frozen=True)
class _Table:
    shift: int
    code: np.ndarray  # (n,) uint8: the code at the lower end of each interval of bits
    level: np.ndarray  # (n,) float32: the smallest value with a higher code; last NaN


def encode(linear: np.ndarray, curve: Curve, bits: int) -> np.ndarray:
    """`codes` of float32 values, of the same shape; by table for 8 bits."""
    table = _table(curve) if bits == 8 else None
    if table is None:
        return codes(linear, curve, bits)
    linear = np.ascontiguousarray(linear, dtype=np.float32)
    index = np.right_shift(linear.view(np.int32), table.shift, dtype=np.int32).astype(np.intp)
    code = table.code.take(index, mode="clip")  # below 0 a float32 is a negative integer
    code += (linear >= table.level.take(index, mode="clip")).view(np.uint8)
    return code


@lru_cache(maxsize=8)
def _table(curve: Curve) -> _Table | None:
    """The smallest table whose intervals hold at most one decision level; None if there is none."""
    levels = _decision_levels(curve)
    for shift in _SHIFTS:
        edges = np.arange((_ONE >> shift) + 1) << shift
        code = np.searchsorted(levels, edges, side="right")
        if np.diff(code).max() <= 1:
            level = np.append(levels.astype(np.int32).view(np.float32), np.float32(np.nan))
            return _Table(shift, code.astype(np.uint8), level[code])
    return None


def _decision_levels(curve: Curve) -> np.ndarray:
    """(255,) the bits of the smallest float32 whose 8-bit code is above 0, 1, .. 254: bisection."""
    wanted = np.arange(255)
    low, high = np.zeros(255, np.int64), np.full(255, _ONE)
    while np.any(high - low > 1):
        middle = (low + high) // 2
        above = codes(middle.astype(np.int32).view(np.float32), curve, 8) > wanted
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high
