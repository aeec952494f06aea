"""Hard cases of capture schedules: signal-to-noise ratios, pdfs that are narrow or wide."""

from __future__ import annotations

import itertools

import mpmath as mp
import numpy as np

from vcam_cli.scheduling import objective
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.shot_noise import optimal_schedules

from .hard_case import Case, in_digits, pairs

# --- eq 4.1 --------------------------------------------------------------------------------------


def _signal_exact(low: mp.mpf, high: mp.mpf, noise: mp.mpf) -> mp.mpf:
    """Mean of i^2 / (i + c) by its primitive."""
    with mp.workdps(150):
        ends = [x * x / 2 - noise * x + noise**2 * mp.log1p(x / noise) for x in (high, low)]
        return (ends[0] - ends[1]) / (high - low)


def _signal_by_primitive(low: np.ndarray, high: np.ndarray, noise: np.ndarray) -> np.ndarray:
    ends = [x**2 / 2 - noise * x + noise**2 * np.log(1 + x / noise) for x in (high, low)]
    return (ends[0] - ends[1]) / (high - low)


def _fill_exact(low: mp.mpf, high: mp.mpf) -> mp.mpf:
    """Mean of (i / (i + 1))^2 by its primitive."""
    with mp.workdps(150):
        ends = [x - 2 * mp.log1p(x) - 1 / (1 + x) for x in (high, low)]
        return (ends[0] - ends[1]) / (high - low)


def _fill_by_primitive(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    ends = [x - 2 * np.log(1 + x) - 1 / (1 + x) for x in (high, low)]
    return (ends[0] - ends[1]) / (high - low)


UP_TO, NOISE = pairs(10.0 ** np.arange(-12, 9, 2), [1e-3, 1.0, 1e6])
UP_TO = UP_TO * NOISE

FAINT = Case(
    "4.1 mean SNR from 0 to x, x/c from 1e-12 to 1e8",
    "x^2/2 - c x + c^2 ln(1 + x/c): all of it cancels where x << c",
    "the primitive, 150 digits",
    lambda: in_digits(_signal_exact, 0 * UP_TO, UP_TO, NOISE),
    lambda: objective.mean_snr_rate(0 * UP_TO, UP_TO, NOISE),
    lambda: _signal_by_primitive(0 * UP_TO, UP_TO, NOISE),
    "the primitive",
    2e-15,
    "some ten roundings",
)

START, WIDTH = pairs(10.0 ** np.arange(-9, 10, 3), 10.0 ** np.arange(-14, 1, 2))
END = START * (1 + WIDTH)

NARROW = Case(
    "4.1 mean SNR over segments 1e-14 wide",
    "the primitive is the same at both ends",
    "the primitive, 150 digits",
    lambda: in_digits(_signal_exact, START, END, np.ones(START.size)),
    lambda: objective.mean_snr_rate(START, END, np.ones(START.size)),
    lambda: _signal_by_primitive(START, END, np.ones(START.size)),
    "the primitive",
    2e-15,
    "some ten roundings",
)

FILL = Case(
    "mean of (i / (i + c))^2, faint and narrow",
    "three terms that cancel to the third power of i/c",
    "the primitive, 150 digits",
    lambda: in_digits(_fill_exact, START, END),
    lambda: objective.mean_squared_signal_fraction(START, END, 1.0),
    lambda: _fill_by_primitive(START, END),
    "the primitive",
    4e-15,
    "some ten roundings, of squares",
)

# --- wide and narrow pdfs ------------------------------------------------------------------------

DECADES = 10.0 ** np.arange(-8, 1)
SHARES = np.array([3, 1, 4, 1, 5, 9, 2, 6]) / 31 * np.array([1e-6] * 7 + [1])
"""Of eight decades of photocurrents; nearly all pixels are in the brightest."""
WIDE = Pdf.segments(DECADES[:-1], DECADES[1:], SHARES)
CAPTURES = 1 / DECADES[:0:-1]
"""One capture for each decade."""


def _wide_exact() -> list[mp.mpf]:
    """What each pixel earns is i t: decade by decade."""
    total, weight = mp.mpf(0), mp.fsum(map(mp.mpf, SHARES.tolist()))
    for low, high, share in zip(DECADES[:-1], DECADES[1:], SHARES, strict=True):
        a, b = mp.mpf(float(low)), mp.mpf(float(high))
        total += mp.mpf(float(share)) / weight * (a + b) / 2 / b
    moments = [
        mp.fsum(
            mp.mpf(float(s)) / weight * (mp.mpf(float(a)) + mp.mpf(float(b))) / 2
            for a, b, s in zip(DECADES[:k], DECADES[1 : k + 1], SHARES[:k], strict=True)
        )
        for k in (1, 2, 3)
    ]
    return [total, *moments]


def _from_the_bright_end() -> list[object]:
    """First moments as the mean less what is brighter, as a histogram of captures is read."""
    share = SHARES / SHARES.sum()
    parts = share * (DECADES[:-1] + DECADES[1:]) / 2
    below = parts.sum() - np.concatenate([np.cumsum(parts[::-1])[::-1], [0]])
    worth = np.sum(np.diff(below) / DECADES[1:])
    return [worth, below[1:4]]


RANGE = Case(
    "4.6 E[SNR], photocurrents over a range of 1e8",
    "dark pixels are 1e-14 of the first moment, and are divided by 1e-8",
    "decade by decade",
    _wide_exact,
    lambda: [objective.expected_snr(WIDE, CAPTURES), WIDE.first_moment(DECADES[1:4])],
    _from_the_bright_end,
    "first moments as the mean less the brighter",
    1e-14,
    "sums of eight parts",
)

ATOMS = np.array([1e-8, 3e-6, 1e-3, 0.2, 1.0])
CHANCES = np.array([0.1, 0.2, 0.3, 0.25, 0.15])
THIN = 1e-13
"""Relative width of the segments."""
COUNTS = (2, 3, 4, 5)


def _best_of_all() -> list[mp.mpf]:
    """The best captures among the atoms, by trying all."""
    out = []
    for count in COUNTS:
        tried = itertools.combinations(range(4), count - 1)
        out.append(max(_worth([*chosen, 4]) for chosen in tried))
    return out


def _worth(chosen: list[int]) -> mp.mpf:
    total = mp.mpf(0)
    for k, (value, chance) in enumerate(zip(ATOMS.tolist(), CHANCES.tolist(), strict=True)):
        above = min(c for c in chosen if c >= k)
        total += mp.mpf(chance) * mp.mpf(value) / mp.mpf(float(ATOMS[above]))
    return total / mp.fsum(map(mp.mpf, CHANCES.tolist()))


def _near_atomic() -> list[float]:
    pdf = Pdf.segments(ATOMS * (1 - THIN), ATOMS, CHANCES)
    found = optimal_schedules(pdf, COUNTS)
    return [found[count].expected_snr for count in COUNTS]


def _on_even_grid() -> list[float]:
    """The best captures on 1000 even steps of the range, judged at the atoms."""
    grid = np.unique(np.ceil(ATOMS * 1000) / 1000)
    out = []
    for count in COUNTS:
        tried = itertools.combinations(grid[:-1], min(count, len(grid)) - 1)
        sets = [np.array([*chosen, grid[-1]]) for chosen in tried]
        out.append(max(_earned(captures) for captures in sets))
    return out


def _earned(captures: np.ndarray) -> float:
    above = captures[np.searchsorted(captures, ATOMS)]
    return float(np.sum(CHANCES * ATOMS / above))


NEAR_ATOMS = Case(
    "optimal schedule of segments 1e-13 wide",
    "five near-atoms over a range of 1e8, of density up to 1e20",
    "all choices",
    _best_of_all,
    _near_atomic,
    _on_even_grid,
    "captures on 1000 even steps",
    2e-13,
    "the segments' width, and the certified gap",
)

CASES = (FAINT, NARROW, FILL, RANGE, NEAR_ATOMS)
