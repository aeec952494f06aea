"""Exact integrals of spectra over wavelength.

Between two neighboring knots a product of piecewise-linear tables is a polynomial whose degree is
the number of tables; Gauss-Legendre with n points integrates degree 2 n - 1 exactly. So one rule
on every interval of the union of all knots gives the integral up to rounding.
"""

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.spectra.spectrum import SAME_WAVELENGTH, Floats, Spectrum, merge_knots


@cache
def _gauss(points: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on 0..1."""
    node, weight = np.polynomial.legendre.leggauss(points)
    return (node + 1) / 2, weight / 2


def _check_range(start: float, stop: float) -> None:
    if not (np.isfinite(start) and np.isfinite(stop) and 0 <= start < stop):
        raise ValueError(f"wavelengths from {start:g} m to {stop:g} m are no rising range")


def _rule(knots: Floats, degree: int) -> tuple[Floats, Floats]:
    """Nodes and weights, both (intervals * points,), exact for `degree` in every interval."""
    node, weight = _gauss(degree // 2 + 1)
    width = np.diff(knots)
    nodes = knots[:-1, np.newaxis] + width[:, np.newaxis] * node
    return nodes.ravel(), (width[:, np.newaxis] * weight).ravel()


def quadrature(
    spectra: Iterable[Spectrum], start: float, stop: float, degree: int = 0
) -> tuple[Floats, Floats]:
    """Nodes and weights that integrate the product of all the given spectra exactly.

    Parameters
    ----------
    spectra : the factors (their lines, if any, are not in the rule: sum them)
    start, stop : range [m]
    degree : degree of a further polynomial factor in wavelength, on top of the spectra

    Returns
    -------
    nodes (n,) rising [m], strictly inside the range, and weights (n,) [m], all positive; their sum
    is stop - start. sum(weights * f(nodes)) is exact for f = the product of any of the spectra.

    Raises
    ------
    ValueError
        A spectrum does not cover the range, or the range does not rise.
    """
    _check_range(start, stop)
    factors = tuple(spectra)
    for spectrum in factors:
        spectrum.require(start, stop)
    tables = [table for spectrum in factors for table in spectrum.tables]
    knots = merge_knots(np.concatenate([[start], *(t.wavelength for t in tables)]), start, stop)
    return _rule(knots, degree + len(tables))


def integral(spectrum: Spectrum, start: float, stop: float) -> float:
    """The integral of a spectrum over wavelength from start to stop [m]: unit x m.

    Lines inside the range (its ends included) are summed, and have the unit of the integral.
    Raises ValueError where the spectrum does not cover the range.
    """
    if spectrum.lines is not None:
        return float(sum(power for _, power in _lines_inside(spectrum, start, stop)))
    nodes, weights = quadrature([spectrum], start, stop)
    return float(weights @ spectrum.at(nodes))


def hat_weights(spectrum: Spectrum, nodes: ArrayLike) -> Floats:
    """Integrals of spectrum x hat_j, exactly, for the hat functions on some wavelengths.

    hat_j is 1 at node j, 0 at all others and straight between, so sum_j weight_j F(node_j) is the
    integral of the spectrum times F interpolated linearly. The weights add up to the integral
    over the nodes' range: whatever F is, the level is exact.

    Parameters
    ----------
    spectrum : the weight; its lines, if any, are shared between the two nodes beside each
    nodes : (J,) rising [m], at least two

    Returns
    -------
    (J,) in the unit of the spectrum x m (lines: the unit of their powers)

    Raises
    ------
    ValueError
        Nodes that do not rise, or a range the spectrum does not cover.
    """
    grid = np.asarray(nodes, dtype=np.float64)
    if grid.ndim != 1 or grid.size < 2 or not (np.diff(grid) > 0).all():
        raise ValueError("hat functions need two or more rising wavelengths")
    start, stop = float(grid[0]), float(grid[-1])
    _check_range(start, stop)
    if spectrum.lines is not None:
        inside = _lines_inside(spectrum, start, stop)
        wavelength = np.array([wl for wl, _ in inside])
        power = np.array([p for _, p in inside])
    else:
        spectrum.require(start, stop)
        knots = merge_knots(np.concatenate([spectrum.knots(start, stop), grid]), start, stop)
        wavelength, weights = _rule(knots, spectrum.degree + 1)
        power = weights * spectrum.at(wavelength)
    return _share(grid, wavelength, power)


def _share(grid: Floats, wavelength: Floats, power: Floats) -> Floats:
    """Each power split between the two grid nodes beside its wavelength, by distance."""
    left = np.clip(np.searchsorted(grid, wavelength, side="right") - 1, 0, grid.size - 2)
    part = np.clip((wavelength - grid[left]) / (grid[left + 1] - grid[left]), 0.0, 1.0)
    low = np.bincount(left, power * (1 - part), minlength=grid.size)
    return np.asarray(low + np.bincount(left + 1, power * part, minlength=grid.size))


def _lines_inside(spectrum: Spectrum, start: float, stop: float) -> list[tuple[float, float]]:
    low, high = start * (1 - SAME_WAVELENGTH), stop * (1 + SAME_WAVELENGTH)
    return [(wl, power) for wl, power in spectrum.lines or () if low <= wl <= high]
