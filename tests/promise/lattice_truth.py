"""Charts of point-grid by their Fourier series: the truth for what folds onto the pixels.

A square lattice of discs, spacing p and diameter d at most p, one disc at the array's center:

    c_kl = (pi d^2 / 4 p^2) 2 J1(x) / x,  x = pi d sqrt(k^2 + l^2) / p.

Exact to rounding for spectral lines, to 1e-7 for continuous spectra (three Gauss points a
nanometer, tests/reference.py).
"""

from __future__ import annotations

import math

import numpy as np
from fourier import Series, cutoff, mean_electrons
from reference import Setup
from scipy.special import j1


def point_grid(spacing: float, diameter: float, highest: float) -> Series:
    """The lattice's harmonics up to a frequency [cycles/m]; lengths in m."""
    most = math.floor(spacing * highest)
    k, order = np.arange(most + 1), np.arange(-most, most + 1)
    x = math.pi * diameter / spacing * np.hypot.outer(order, k)
    spot = np.ones_like(x)
    np.divide(2 * j1(x), x, out=spot, where=x > 0)
    both = np.where(k > 0, 2.0, 1.0)  # +k and -k
    area = math.pi * diameter**2 / (4 * spacing**2)
    return Series(k / spacing, order / spacing, area * spot * both)


def mean_signal(setup: Setup, spacing: float, diameter: float) -> np.ndarray:
    """Mean photo-electrons of a camera that looks at a point grid: (rows, columns)."""
    return mean_electrons(setup, point_grid(spacing, diameter, cutoff(setup)))
