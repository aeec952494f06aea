"""Exact integrals of spectra over wavelength.

Between two neighboring knots a product of piecewise-linear tables is a polynomial whose degree is
the number of tables; Gauss-Legendre with n points integrates degree 2 n - 1 exactly. So one rule
on every interval of the union of all knots gives the integral up to rounding.
"""

import math
from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.spectra.spectrum import SAME_WAVELENGTH, Floats, Spectrum, Table, merge_knots


@cache
def _gauss(points: int) -> tuple[Floats, Floats]:
    """Return Gauss-Legendre nodes and weights on 0..1."""
    node, weight = np.polynomial.legendre.leggauss(points)
    return (node + 1) / 2, weight / 2


def _check_range(start: float, stop: float) -> None:
    if not (np.isfinite(start) and np.isfinite(stop) and 0 <= start < stop):
        raise ValueError(f"wavelengths from {start:g} m to {stop:g} m are no rising range")


def _gauss_rule(knots: Floats, degree: int) -> tuple[Floats, Floats]:
    """Return nodes and weights (intervals * points,), exact for `degree` in each interval."""
    node, weight = _gauss(degree // 2 + 1)
    width = np.diff(knots)
    nodes = knots[:-1, np.newaxis] + width[:, np.newaxis] * node
    return nodes.ravel(), (width[:, np.newaxis] * weight).ravel()


def quadrature(
    spectra: Iterable[Spectrum], start: float, stop: float, degree: int = 0
) -> tuple[Floats, Floats]:
    """Return a rule that integrates the product of all the given spectra exactly.

    Parameters
    ----------
    spectra : iterable of Spectrum
        The factors. Their lines, if any, are not in the rule: sum them.
    start, stop : float
        Range of wavelengths [m].
    degree : int
        Degree of a further polynomial factor in wavelength, on top of the spectra.

    Returns
    -------
    nodes : ndarray
        Wavelengths (n,), rising [m], strictly inside the range.
    weights : ndarray
        Weights (n,) [m], all positive; their sum is stop - start. sum(weights * f(nodes)) is exact
        for f = the product of any of the spectra.

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
    return _gauss_rule(knots, degree + len(tables))


def integral(spectrum: Spectrum, start: float, stop: float) -> float:
    """Return the integral of a spectrum over wavelength.

    Parameters
    ----------
    spectrum : Spectrum
        What is integrated. Lines inside the range (its ends included) are summed, and have the unit
        of the integral.
    start, stop : float
        Range of wavelengths [m].

    Returns
    -------
    float
        Integral [unit of the spectrum x m].

    Raises
    ------
    ValueError
        The spectrum does not cover the range.
    """
    if spectrum.lines is not None:
        return float(sum(power for _, power in _lines_inside(spectrum, start, stop)))
    nodes, weights = quadrature([spectrum], start, stop)
    return float(weights @ spectrum.evaluate(nodes))


def hat_weights(spectrum: Spectrum, nodes: ArrayLike) -> Floats:
    """Return the exact integrals of spectrum x hat_j, for the hat functions on some wavelengths.

    hat_j is 1 at node j, 0 at all others and straight between, so sum_j weight_j F(node_j) is the
    integral of the spectrum times F interpolated linearly. The weights add up to the integral
    over the nodes' range: whatever F is, the level is exact.

    Parameters
    ----------
    spectrum : Spectrum
        The weight; its lines, if any, are shared between the two nodes beside each.
    nodes : array_like
        Wavelengths (J,), rising [m], at least two.

    Returns
    -------
    ndarray
        Weights (J,) [unit of the spectrum x m]; of lines in the unit of their powers.

    Raises
    ------
    ValueError
        Nodes that do not rise, or a range the spectrum does not cover.
    """
    grid = _checked_nodes(nodes)
    start, stop = float(grid[0]), float(grid[-1])
    if spectrum.lines is not None:
        inside = _lines_inside(spectrum, start, stop)
        wavelength = np.array([wl for wl, _ in inside])
        power = np.array([p for _, p in inside])
    else:
        spectrum.require(start, stop)
        knots = merge_knots(np.concatenate([spectrum.knots(start, stop), grid]), start, stop)
        wavelength, weights = _gauss_rule(knots, spectrum.degree + 1)
        power = weights * spectrum.evaluate(wavelength)
    return _split_between_nodes(grid, wavelength, power)


def _checked_nodes(nodes: ArrayLike) -> Floats:
    """Return two or more rising wavelengths as an array; ValueError where they are not."""
    grid = np.asarray(nodes, dtype=np.float64)
    if grid.ndim != 1 or grid.size < 2 or not (np.diff(grid) > 0).all():
        raise ValueError("hat functions need two or more rising wavelengths")
    _check_range(grid[0], grid[-1])
    return grid


def pair_weights(
    spectra: Sequence[Spectrum], others: Sequence[Spectrum], nodes: ArrayLike
) -> Floats:
    """Return `hat_weights` of the product of every one of some spectra with every one of others.

    One rule for them all: each spectrum is looked up once, not once for each of its products.

    Parameters
    ----------
    spectra : sequence of Spectrum
        K of them, some with lines maybe.
    others : sequence of Spectrum
        C of them, without lines.
    nodes : array_like
        Wavelengths (J,), rising [m], at least two.

    Returns
    -------
    ndarray
        Weights (K, C, J) [unit of the product x m]; of lines in the unit of their powers.

    Raises
    ------
    ValueError
        Nodes that do not rise, a range that one of the spectra does not cover, others with lines.
    """
    grid = _checked_nodes(nodes)
    if any(other.lines is not None for other in others):
        raise ValueError("spectra with lines stand first")
    out = np.zeros((len(spectra), len(others), grid.size))
    smooth = [k for k, s in enumerate(spectra) if s.lines is None]
    if smooth:
        out[smooth] = _pair_weights_of_tables([spectra[k] for k in smooth], others, grid)
    for k, spectrum in enumerate(spectra):
        if spectrum.lines is not None:
            out[k] = [hat_weights(spectrum.multiply(other), grid) for other in others]
    return out


def _pair_weights_of_tables(
    spectra: Sequence[Spectrum], others: Sequence[Spectrum], grid: Floats
) -> Floats:
    """Return `pair_weights` of spectra without lines."""
    tables = {id(table): table for s in (*spectra, *others) for table in s.tables}
    for table in tables.values():
        table.require(grid[0], grid[-1])
    bends = {id(table.wavelength): table.wavelength for table in tables.values()}
    knots = merge_knots(np.concatenate([grid, *bends.values()]), grid[0], grid[-1])
    degree = max(s.degree for s in spectra) + max((o.degree for o in others), default=0)
    wavelength, weights = _gauss_rule(knots, degree + 1)
    known = _table_values(tables, wavelength)

    def values(spectrum: Spectrum) -> Floats:
        factors = (known[id(table)] for table in spectrum.tables)
        return np.asarray(math.prod(factors, start=np.full(wavelength.shape, spectrum.scale)))

    first = np.array([values(s) * weights for s in spectra])
    second = np.array([values(o) for o in others]).reshape(-1, wavelength.size)
    return _split_between_nodes(grid, wavelength, first[:, np.newaxis] * second)


def _table_values(tables: dict[int, Table], wavelength: Floats) -> dict[int, Floats]:
    """Return the values of tables at wavelengths that they cover.

    Those of the same knots are looked up together.
    """
    alike: dict[tuple[int, bool], list[int]] = {}
    for name, table in tables.items():
        alike.setdefault((id(table.wavelength), table.outside == "zero"), []).append(name)
    out: dict[int, Floats] = {}
    for (_, ends), names in alike.items():
        knots = tables[names[0]].wavelength
        if ends or len(names) == 1 or len(knots) == 1:
            out |= {name: tables[name].evaluate(wavelength) for name in names}
            continue
        right = np.clip(np.searchsorted(knots, wavelength), 1, len(knots) - 1)
        part = np.clip((wavelength - knots[right - 1]) / (knots[right] - knots[right - 1]), 0, 1)
        values = np.array([tables[name].value for name in names])
        low = values[:, right - 1]
        out |= dict(zip(names, low + part * (values[:, right] - low), strict=True))
    return out


def _split_between_nodes(grid: Floats, wavelength: Floats, power: Floats) -> Floats:
    """Return each power (..., n) split between the two grid nodes beside it, by distance.

    The wavelengths (n,) rise and lie within the grid.
    """
    left = np.clip(np.searchsorted(grid, wavelength, side="right") - 1, 0, grid.size - 2)
    part = np.clip((wavelength - grid[left]) / (grid[left + 1] - grid[left]), 0.0, 1.0)
    out = np.zeros((*power.shape[:-1], grid.size))
    starts = np.flatnonzero(np.diff(left, prepend=-1))
    if len(starts):
        out[..., left[starts] + 1] = np.add.reduceat(power * part, starts, axis=-1)
        out[..., left[starts]] += np.add.reduceat(power * (1 - part), starts, axis=-1)
    return out


def _lines_inside(spectrum: Spectrum, start: float, stop: float) -> list[tuple[float, float]]:
    """Return the lines of a spectrum in a range, its ends included."""
    low, high = start * (1 - SAME_WAVELENGTH), stop * (1 + SAME_WAVELENGTH)
    return [(wl, power) for wl, power in spectrum.lines or () if low <= wl <= high]
