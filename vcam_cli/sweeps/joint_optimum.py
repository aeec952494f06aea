"""The best values of several parameters together.

The best point of a grid, and the optima along lines through it, miss an optimum that lies between
the lines where parameters act on each other: along a valley that runs across the grid. So a
quadratic with all products of two parameters is fitted to the mean around the best point, in
ln(parameter) where that is positive, and the optimum is where it is best between the ends of what
was fitted. As for one parameter (`optimum`), the interval is that of means drawn again, and reaches
to the neighbors of the best point where the quadratic is not believed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.sweeps.optimum import (
    FEW_DRAWS,
    MAX_MISFIT,
    Optimum,
    bootstrap_means,
    excess_error,
    range_end,
    snap_to_range,
    variance_of_mean,
    widened_interval,
)

MIN_POINTS = 3
"""Number of values of a parameter above which it is fitted."""
MIN_BOOTSTRAP_CURVES = 16
"""Number of curves above which means are drawn from them: fewer spread the slopes of a fit less
than noise does, and its many points tell the noise."""
REACHES = (2, 1)
"""Points on either side of the best that are fitted: at first, and where noise does not explain
what that leaves."""


def find_joint_optimum(
    parameters: Sequence[Array], curves: Array, goal: str
) -> tuple[Optimum, ...]:
    """Return the optimum of each parameter, all of them together.

    Parameters
    ----------
    parameters : sequence of (n_i,) arrays
        Values of each parameter, at least `MIN_POINTS`.
    curves : (m, n_1, n_2, ...) array
        The metric over the grid, by repeats and seeds.
    goal : str
        "min" or "max".

    Raises
    ------
    ValueError
        For numbers that are not finite, or too few.
    """
    orders = [np.argsort(parameter) for parameter in parameters]
    axes = [np.asarray(p, float)[order] for p, order in zip(parameters, orders, strict=True)]
    sign = 1 if goal == "min" else -1
    y = sign * np.asarray(curves, float)[np.ix_(np.arange(len(curves)), *orders)]
    if not y.size or not np.isfinite(y).all() or min(map(len, axes)) < MIN_POINTS:
        raise ValueError("a joint optimum needs finite numbers, three or more of each parameter")
    scales = [np.log(axis) if axis[0] > 0 else axis for axis in axes]
    best = [int(i) for i in np.unravel_index(int(y.mean(axis=0).argmin()), y.shape[1:])]
    fit = _Fit(scales, y, best)
    places, fitted = fit.minimum(fit.mean[None])
    drawn = bootstrap_means(fit.curves, fit.rest, MIN_BOOTSTRAP_CURVES)
    found = fit.minimum(drawn)[0] if len(drawn) else np.empty((0, len(axes)))
    errors = _interpolation_errors(fit, (scales, y, best))
    value = max(float(fitted[0]), float(y.mean(axis=0).min()))
    return tuple(
        _parameter_optimum(
            axis,
            (scale, best[i], float(places[0, i]), found[:, i], errors[i], fit.follows),
            sign * value,
            sign * float(fitted[0]),
        )
        for i, (axis, scale) in enumerate(zip(axes, scales, strict=True))
    )


def _interpolation_errors(fit: _Fit, known: tuple[Sequence[Array], Array, Sequence[int]]) -> Array:
    """Return the standard error (k,) of the minimum that the spread does not explain.

    By how much the quadratic through the points of another reach differs; as its error goes with
    the square of the reach, the narrower one has a third of the difference.
    """
    scales, y, best = known
    other = _Fit(scales, y, best, tuple(reach for reach in REACHES if reach != fit.reach))
    drawn = bootstrap_means(y.reshape(len(y), -1), fit.rest, MIN_BOOTSTRAP_CURVES)[:FEW_DRAWS]
    curves = np.concatenate([y.mean(axis=0).reshape(1, -1), drawn])
    shape = (len(curves), *y.shape[1:])
    every = curves.reshape(shape)
    differences = (
        other.minimum(other.fitted_part(every))[0] - fit.minimum(fit.fitted_part(every))[0]
    )
    spreads = differences[1:].std(axis=0) if len(drawn) else np.zeros(len(scales))
    share = 1.0 if fit.reach == max(REACHES) else 1 / 3
    return np.array(
        [share * excess_error(differences[:1, i], spreads[i]) for i in range(len(scales))]
    )


def _parameter_optimum(
    axis: Array,
    known: tuple[Array, int, float, Array, float, bool],
    value: float,
    fitted: float,
) -> Optimum:
    """Return the optimum of one of the parameters."""
    scale, best, place, drawn, error, follows = known
    low, high = widened_interval(place, drawn, error, (scale[0], scale[-1]))
    if not follows:
        low = np.fmin(low, min(place, scale[max(0, best - 1)]))
        high = np.fmax(high, max(place, scale[min(len(scale) - 1, best + 1)]))
    back = np.exp if axis[0] > 0 else np.asarray
    place, low, high = (snap_to_range(float(back(v)), axis) for v in (place, low, high))
    edge = range_end((place, low, high), best, axis)
    return Optimum(place, low, high, value, edge, fitted)


class _Fit:
    """A quadratic of several parameters around the best point of a grid.

    Parameters
    ----------
    scales : sequence of (n_i,) arrays
        The parameters, rising.
    y : (m, n_1, n_2, ...) array
        Curves, to be least.
    best : tuple of int
        Their mean's best point.
    """

    def __init__(
        self,
        scales: Sequence[Array],
        y: Array,
        best: Sequence[int],
        reaches: Sequence[int] = REACHES,
    ) -> None:
        noise = variance_of_mean(y.reshape(len(y), -1))
        for reach in reaches:
            self.reach = reach
            self._choose(scales, y, best, reach)
            square = self._misfit()
            self.follows = square <= MAX_MISFIT * noise
            if self.follows:
                break
        left = 0.0 if math.isnan(noise) else noise
        self.rest = math.nan if math.isnan(square) else math.sqrt(max(0.0, square - left))
        """Rms of what the fit leaves beside the spread; nan where nothing is known of it."""

    def _choose(self, scales: Sequence[Array], y: Array, best: Sequence[int], reach: int) -> None:
        """Take the points that are fitted, and their powers."""
        sizes = [min(len(scale), 2 * reach + 1) for scale in scales]
        starts = [
            min(max(0, b - reach), len(scale) - size)
            for b, scale, size in zip(best, scales, sizes, strict=True)
        ]
        windows = [slice(a, a + size) for a, size in zip(starts, sizes, strict=True)]
        some = [scale[window] for scale, window in zip(scales, windows, strict=True)]
        self.middle = np.array([(s[0] + s[-1]) / 2 for s in some])
        self.half = np.array([(s[-1] - s[0]) / 2 for s in some])
        grid = np.meshgrid(*some, indexing="ij")
        places = (np.stack([g.ravel() for g in grid], axis=1) - self.middle) / self.half
        self.pairs = list(itertools.combinations_with_replacement(range(len(some)), 2))
        products = [places[:, i] * places[:, j] for i, j in self.pairs]
        self.powers = np.column_stack([np.ones(len(places)), places, *products])
        self._windows = windows
        self.curves = self.fitted_part(y)
        """(m, points) of what is fitted."""
        self.mean = self.curves.mean(axis=0)

    def fitted_part(self, y: Array) -> Array:
        """Return of curves (m, n_1, n_2, ...) the points that are fitted: (m, points)."""
        return y[(slice(None), *self._windows)].reshape(len(y), -1)

    def _misfit(self) -> float:
        """Return the mean square from the mean to its fit by degree of freedom; nan without."""
        free = len(self.mean) - self.powers.shape[1]
        fit = self.powers @ np.linalg.lstsq(self.powers, self.mean, rcond=None)[0]
        return float(np.square(self.mean - fit).sum()) / free if free > 0 else math.nan

    def minimum(self, means: Array) -> tuple[Array, Array]:
        """Return where quadratics fitted to means (d, points) are least: (d, k); the values (d,).

        Within the box of what is fitted: on the inside, or on one of its faces, edges or corners;
        each is tried.
        """
        count = len(self.middle)
        c = np.linalg.lstsq(self.powers, means.T, rcond=None)[0].T
        slope, bend = c[:, 1 : count + 1], np.zeros((len(c), count, count))
        for number, (i, j) in enumerate(self.pairs, count + 1):
            bend[:, i, j] += c[:, number]
            bend[:, j, i] += c[:, number]
        places, values = np.zeros((len(c), count)), np.full(len(c), np.inf)
        for held in itertools.product((None, -1.0, 1.0), repeat=count):
            t = np.tile([0.0 if end is None else end for end in held], (len(c), 1))
            free = [i for i, end in enumerate(held) if end is None]
            if free:
                pull = slope[:, free] + np.einsum("dij,dj->di", bend[:, free], t)
                t[:, free] = -np.einsum(
                    "dij,dj->di", np.linalg.pinv(bend[:, free][..., free]), pull
                )
            inside = (np.abs(t) <= 1 + 1e-12).all(axis=1)
            q = c[:, 0] + (slope * t).sum(axis=1) + 0.5 * np.einsum("di,dij,dj->d", t, bend, t)
            better = inside & (q < values)
            places[better], values[better] = t[better], q[better]
        return self.middle + self.half * places, values
