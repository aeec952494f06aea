"""Hard cases of colors: CIELAB, CIEDE2000, color correction, white balance, tone."""

from __future__ import annotations

import mpmath as mp
import numpy as np

from vcam_cli.processing import color_correction, tone, white_balance
from vcam_cli.quality import cielab

from .hard_case import Case, in_digits

# --- CIELAB --------------------------------------------------------------------------------------

DIM = np.array([-1e-3, -1e-12, 0.0, 1e-300, 1e-12, 1e-4, 0.008, 0.009, 1.0])


def _lightness(value: mp.mpf) -> mp.mpf:
    if value <= mp.mpf("0.008856"):
        return mp.mpf("903.3") * value
    return 116 * mp.cbrt(value) - 16


LIGHTNESS = Case(
    "CIELAB lightness of black, and darker",
    "cube roots rise without end at 0, and of noise below black are no numbers",
    "CIE 15",
    lambda: in_digits(_lightness, DIM),
    lambda: cielab.lab(np.stack([DIM] * 3))[0],
    lambda: 116 * DIM ** (1 / 3) - 16,
    "116 (Y/Yn)^(1/3) - 16",
    1e-14,
    "a cube root less 16, of 0.009: lightness 8",
)

SHARMA = (
    ((50, 2.49, -0.001), (50, -2.49, 0.0009), 7.1792),
    ((50, 2.49, -0.001), (50, -2.49, 0.0011), 7.2195),
    ((50, -0.001, 2.49), (50, 0.0009, -2.49), 4.8045),
    ((50, -0.001, 2.49), (50, 0.0011, -2.49), 4.7461),
    ((50, 0, 0), (50, -1, 2), 2.3669),
    ((50, 2.5, 0), (50, 0, -2.5), 4.3065),
)
PAIRS = np.array([pair[:2] for pair in SHARMA], float).transpose(1, 2, 0)


def _hue_averaged() -> np.ndarray:
    """CIEDE2000 with hues from 0 to 360 degrees, their difference and their mean."""
    (l1, a1, b1), (l2, a2, b2) = PAIRS
    c7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(c7 / (c7 + 25.0**7))
    c1, c2 = np.hypot(stretch * a1, b1), np.hypot(stretch * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, stretch * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    cos, middle, c = (lambda x: np.cos(np.radians(x))), (h1 + h2) / 2, (c1 + c2) / 2
    t = 1 - 0.17 * cos(middle - 30) + 0.24 * cos(2 * middle)
    t = t + 0.32 * cos(3 * middle + 6) - 0.2 * cos(4 * middle - 63)
    off = ((l1 + l2) / 2 - 50) ** 2
    dl = (l2 - l1) / (1 + 0.015 * off / np.sqrt(20 + off))
    dc = (c2 - c1) / (1 + 0.045 * c)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(h2 - h1) / 2) / (1 + 0.015 * c * t)
    turn = 30 * np.exp(-(((middle - 275) / 25) ** 2))
    twist = -2 * np.sqrt(c**7 / (c**7 + 25.0**7)) * np.sin(np.radians(2 * turn))
    return np.sqrt(dl**2 + dc**2 + dh**2 + twist * dc * dh)


HUES = Case(
    "CIEDE2000 of opposite hues, and of gray",
    "the mean of two hues on either side of 0 or 180 degrees; gray has none",
    "Sharma et al. 2005, table 1",
    lambda: [delta for _, _, delta in SHARMA],
    lambda: cielab.delta_e(*PAIRS, "2000"),
    _hue_averaged,
    "hues in 0..360, differences and means as they come",
    5.1e-5,
    "four printed digits",
    absolute=True,
)

# --- color correction and white balance ----------------------------------------------------------

_CHART = np.random.default_rng(11)
TARGET = _CHART.uniform(0.05, 0.95, (24, 3))
_SEEN = TARGET @ np.array([[0.8, 0.15, 0.0], [0.2, 0.7, 0.25], [0.0, 0.15, 0.75]])
ALIKE = (
    np.stack([_SEEN[:, 0], _SEEN[:, 1], _SEEN[:, 1]], axis=1),
    np.stack([_SEEN[:, 0], _SEEN[:, 1], _SEEN[:, 1] + 2.0**-40 * _SEEN[:, 2]], axis=1),
    np.stack([_SEEN[:, 1]] * 3, axis=1),
)
"""What three filters see of 24 patches: two alike, almost alike, all three alike."""


def _fit_exact(signals: np.ndarray) -> list[mp.mpf]:
    """Least squares of CIELAB differences with a pull to the identity, rows summing to 1."""
    slope = color_correction.lab_slope(TARGET).tolist()
    half, third = 1 / mp.sqrt(2), 1 / mp.sqrt(6)
    free = mp.matrix([[half, third], [-half, third], [0, -2 * third]])  # what leaves white alone
    chroma = mp.matrix(signals.tolist()) * free
    left, right = mp.zeros(6), mp.zeros(6, 1)
    for p in range(24):
        miss = [mp.mpf(TARGET[p, i]) - mp.mpf(signals[p, i]) for i in range(3)]
        for a in range(3):
            line = [mp.mpf(slope[p][a][i]) * chroma[p, k] for i in range(3) for k in range(2)]
            wanted = mp.fsum(mp.mpf(slope[p][a][i]) * miss[i] for i in range(3))
            for m in range(6):
                right[m] += line[m] * wanted
                for n in range(6):
                    left[m, n] += line[m] * line[n]
    for m in range(6):
        left[m, m] += mp.mpf(color_correction.RIDGE) ** 2
    found = mp.lu_solve(left, right)
    weights = mp.matrix([[found[2 * i], found[2 * i + 1]] for i in range(3)])
    return list(mp.eye(3) + weights * free.T)


def _normal_equations(signals: np.ndarray) -> np.ndarray:
    return np.linalg.solve(signals.T @ signals, signals.T @ TARGET).T


COLOR_MATRIX = Case(
    "color correction, filters alike: singular matrices",
    "the patches do not say what part of a color goes to which of two equal filters",
    "normal equations",
    lambda: [_fit_exact(signals) for signals in ALIKE],
    lambda: [color_correction.fit_relative(signals, TARGET)[0] for signals in ALIKE],
    lambda: [_normal_equations(signals) for signals in ALIKE],
    "M = T'S (S'S)^-1",
    1e-10,
    "roundings of 1e-16 times slopes of 1e3 and differences of 1e2, over a squared pull of 1/4",
    absolute=True,
)

FRAMES = (
    (np.zeros(3), 100.0, [1, 1, 1]),
    (np.array([-1e-7, 2e-7, 1e-8]), 100.0, [1, 1, 1]),
    (np.array([50.0, 1e-20, 25.0]), 100.0, [1, 1, 2]),
    (np.array([50.0, -1e-3, 25.0]), 100.0, [1, 1, 2]),
    (np.zeros(3), 0.0, [1, 1, 1]),
)

BALANCE = Case(
    "white balance of a black frame, and of one light",
    "0/0; noise about black makes gains of any size and sign",
    "exactly 1 where it is dark",
    lambda: [gains for _, _, gains in FRAMES],
    lambda: [white_balance.gray_world_gains(means, white) for means, white, _ in FRAMES],
    lambda: [means.max() / means for means, _, _ in FRAMES],
    "largest mean / mean",
    0.0,
    "a property",
)

# --- tone ---------------------------------------------------------------


def _levels() -> np.ndarray:
    """The two float32 values about each of the 255 decision levels of 8-bit sRGB."""
    with mp.workdps(30):
        exact = [((mp.mpf(2 * k + 1) / 510 + mp.mpf("0.055")) / mp.mpf("1.055")) ** mp.mpf(2.4)
                 for k in range(255)]  # fmt: skip
    upper = np.array([np.float32(float(level)) for level in exact])
    return np.concatenate([upper, np.nextafter(upper, np.float32(0)), np.nextafter(upper, 1)])


LEVELS = _levels()


def _srgb_code(value: mp.mpf) -> mp.mpf:
    if value <= mp.mpf("0.0031308"):
        encoded = mp.mpf("12.92") * value
    else:
        encoded = mp.mpf("1.055") * mp.exp(mp.log(value) * 5 / 12) - mp.mpf("0.055")
    return mp.floor(encoded * 255 + mp.mpf(0.5))


def _in_float32() -> np.ndarray:
    linear = LEVELS
    curve = np.float32(1.055) * linear ** np.float32(1 / 2.4) - np.float32(0.055)
    encoded = np.where(linear <= np.float32(0.0031308), np.float32(12.92) * linear, curve)
    return np.floor(encoded * np.float32(255) + np.float32(0.5))


TONE = Case(
    "8-bit sRGB of the float32 beside every code's edge",
    "the next float32 has another code",
    "the curve",
    lambda: in_digits(_srgb_code, LEVELS),
    lambda: tone.encode(LEVELS, "srgb", 8),
    _in_float32,
    "the curve in float32",
    0.0,
    "every code",
    absolute=True,
)

CASES = (LIGHTNESS, HUES, COLOR_MATRIX, BALANCE, TONE)
