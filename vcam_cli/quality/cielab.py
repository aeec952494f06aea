"""CIELAB, and the color difference Delta E by its formulas of 1976, 1994 and 2000.

Colors are planes first: (3, ...) X, Y, Z or L*, a*, b*. The float type of the input is kept.

Below the threshold the functions are straight lines that go on below zero, so that values darker
than black (noise after the black level) count with their error.

References
----------
.. [1] CIE 015:2018, Colorimetry, 4th edition, sections 8.2.1 and 8.3, doi:10.25039/TR.015.2018.
.. [2] G. Sharma, W. Wu, E. Dalal, "The CIEDE2000 color-difference formula: implementation notes,
   supplementary test data, and mathematical observations", Color Research and Application 30,
   21-30, 2005, doi:10.1002/col.20070.
"""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from vcam_cli.arrays import Array

Formula = Literal["1976", "1994", "2000"]
THRESHOLD = 0.008856
"""X/Xn, Y/Yn or Z/Zn above which the function is a cube root; below, a straight line."""
DIM_LIGHTNESS = 903.3
"""L* per Y/Yn below the threshold."""
_SLOPE, _OFFSET = 7.787, 16.0 / 116.0


def lab(relative: Array) -> Array:
    """Return CIELAB of colors relative to white [1].

    L* = 116 f(Y/Yn) - 16, a* = 500 (f(X/Xn) - f(Y/Yn)), b* = 200 (f(Y/Yn) - f(Z/Zn)) with
    f(t) = t^(1/3) above t = 0.008856, else 7.787 t + 16/116; there L* = 903.3 Y/Yn.

    Parameters
    ----------
    relative : ndarray
        X/Xn, Y/Yn, Z/Zn (3, ...) [dimensionless].

    Returns
    -------
    ndarray
        L*, a*, b* (3, ...) [dimensionless], of the same float type.
    """
    f = np.cbrt(relative)
    dim = np.less_equal(relative, THRESHOLD)
    any_dim = bool(dim.any())
    if any_dim:
        np.copyto(f, _SLOPE * relative + _OFFSET, where=dim)
    out = np.empty_like(f)
    out[0] = 116.0 * f[1] - 16.0
    if any_dim:
        np.copyto(out[0], DIM_LIGHTNESS * relative[1], where=dim[1])
    out[1] = 500.0 * (f[0] - f[1])
    out[2] = 200.0 * (f[1] - f[2])
    return out


def delta_e(color: Array, reference: Array, formula: Formula = "1976") -> Array:
    """Return the color difference Delta E of colors from a reference [1].

    Parameters
    ----------
    color : ndarray
        L*, a*, b* (3, ...) [dimensionless].
    reference : ndarray
        L*, a*, b* of the same shape.
    formula : {"1976", "1994", "2000"}
        "1976" is the distance; "1994", for graphic arts, has weights from the reference's chroma;
        "2000" is CIEDE2000. All parametric factors k are 1.

    Returns
    -------
    ndarray
        Delta E (...) [dimensionless], 0 or more.

    Raises
    ------
    ValueError
        The shapes differ, or the formula is unknown.
    """
    if color.shape != reference.shape or color.shape[:1] != (3,):
        raise ValueError(f"two arrays (3, ...) of one shape, not {color.shape}, {reference.shape}")
    if formula not in FORMULAS:
        raise ValueError(f"formula {formula!r}; it must be one of {', '.join(FORMULAS)}")
    return FORMULAS[formula](color, reference)


def delta_e_1976(color: Array, reference: Array) -> Array:
    """Return the CIE 1976 color difference: the Euclidean distance in CIELAB [1].

    Parameters
    ----------
    color, reference : ndarray
        L*, a*, b* (3, ...) [dimensionless], of one shape.

    Returns
    -------
    ndarray
        Delta E (...) [dimensionless].
    """
    change = color - reference
    np.square(change, out=change)
    difference: Array = np.sqrt(change[0] + change[1] + change[2])
    return difference


def delta_e_1994(color: Array, reference: Array) -> Array:
    """Return the CIE94 color difference for graphic arts [1].

    The weights are 1, 1 + 0.045 C, 1 + 0.015 C with the reference's chroma C.

    Parameters
    ----------
    color, reference : ndarray
        L*, a*, b* (3, ...) [dimensionless], of one shape.

    Returns
    -------
    ndarray
        Delta E (...) [dimensionless].
    """
    light, a, b = color - reference
    of_color, of_reference = np.hypot(color[1], color[2]), np.hypot(reference[1], reference[2])
    chroma = of_color - of_reference
    hue2 = np.maximum(a * a + b * b - chroma * chroma, 0.0)
    chroma = chroma / (1.0 + 0.045 * of_reference)
    difference: Array = np.sqrt(
        light * light + chroma * chroma + hue2 / (1.0 + 0.015 * of_reference) ** 2
    )
    return difference


def delta_e_2000(color: Array, reference: Array) -> Array:
    """Return the CIEDE2000 color difference, as [2] writes it (equation numbers of that paper).

    Parameters
    ----------
    color, reference : ndarray
        L*, a*, b* (3, ...) [dimensionless], of one shape.

    Returns
    -------
    ndarray
        Delta E (...) [dimensionless].
    """
    (l1, a1, b1), (l2, a2, b2) = color, reference
    mean_chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2  # 3
    stretch = 1.5 - 0.5 * _toward_one(mean_chroma)  # 4, 5
    c1, c2 = np.hypot(stretch * a1, b1), np.hypot(stretch * a2, b2)  # 6
    h1, h2 = np.arctan2(b1, stretch * a1), np.arctan2(b2, stretch * a2)  # 7 [rad]
    turn = np.remainder(h2 - h1 + np.pi, 2 * np.pi) - np.pi  # 10, -180 to 180 degrees
    gray = c1 * c2 == 0
    turn = np.where(gray, 0.0, turn)
    hue = 2 * np.sqrt(c1 * c2) * np.sin(turn / 2)  # 11
    lightness, chroma = (l1 + l2) / 2, (c1 + c2) / 2  # 12, 13
    middle = np.where(gray, h1 + h2, h1 + turn / 2)  # 14: the hue on the shorter way
    weight = (  # 15
        1
        - 0.17 * np.cos(middle - math.radians(30))
        + 0.24 * np.cos(2 * middle)
        + 0.32 * np.cos(3 * middle + math.radians(6))
        - 0.20 * np.cos(4 * middle - math.radians(63))
    )
    degrees = np.remainder(np.rad2deg(middle), 360.0)
    rotation = math.radians(30) * np.exp(-(((degrees - 275) / 25) ** 2))  # 16
    off = (lightness - 50) ** 2
    dl = (l2 - l1) / (1 + 0.015 * off / np.sqrt(20 + off))  # 18
    dc = (c2 - c1) / (1 + 0.045 * chroma)  # 19
    dh = hue / (1 + 0.015 * chroma * weight)  # 20
    twist = -2 * _toward_one(chroma) * np.sin(2 * rotation)  # 17, 21
    square = dl * dl + dc * dc + dh * dh + twist * dc * dh
    difference: Array = np.sqrt(np.maximum(square, 0.0))  # 22
    return difference


def _toward_one(chroma: Array) -> Array:
    """Return sqrt(C^7 / (C^7 + 25^7)), which does not overflow for any C."""
    seventh = (25.0 / np.maximum(chroma, 1e-3)) ** 7
    return 1.0 / np.sqrt(1.0 + seventh)


FORMULAS: dict[str, Callable[[Array, Array], Array]] = {
    "1976": delta_e_1976,
    "1994": delta_e_1994,
    "2000": delta_e_2000,
}
