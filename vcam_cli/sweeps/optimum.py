"""The best value of a parameter, and how well it is known.

Every repeat and seed gives a curve of the metric over the parameter; they are averaged before the
optimum is sought. Near the best point of the mean a cubic in ln(parameter) is fitted (in the
parameter itself where it is not positive), to as many points as it can follow, and the optimum is
the cubic's. The interval is that of the optima of curves drawn again with replacement (the
bootstrap): repeats and seeds cannot tell these apart. Whole curves are drawn, so that what a repeat
does to all values at once stays together.

Where the mean departs from its cubic by more than its spread explains (a metric with a kink), or
there is a single curve and the spread is not known, the cubic is not believed: what it leaves is
drawn as well, and the interval reaches to the neighbors of the best point at least, between which
the optimum of any curve with a single one lies.

A cubic may also follow within the spread and still miss the optimum, all the more of a coarse grid:
beside a pole its error at the points is small and its minimum lies off. Cubics through fewer of the
points, and quartics, err otherwise. By how much their optima differ from the cubic's, beyond what
the spread explains, is taken as the standard error of the interpolation, and added in squares.

Reference: B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, Chapman & Hall, 1993,
sections 6.2 and 13.3.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

DRAWS = 1000
"""Number of means of curves that are drawn."""
SEED = 1
CONFIDENCE = 0.95
"""Share of the drawn optima within low..high."""
MIN_BOOTSTRAP_CURVES = 4
"""Number of curves above which means are drawn from them."""
DEGREE = 3
MIN_FIT_POINTS = 5
"""Number of points that are fitted at least: a cubic passes through fewer, whatever they say."""
REACH_SHARE, MIN_REACH = 0.2, 3
"""Points on either side of the best that are fitted at first: a share of all, a number at least."""
LEAST_SHARE = 0.5
"""Share of the fitted points that a further fit has at least: fewer tell of noise alone."""
FEW_DRAWS = 200
"""Draws that tell how far optima of fits differ by the spread: their standard deviation to 5 %."""
QUANTILE = 1.96
"""Of the normal distribution, for the share `CONFIDENCE`."""
MAX_MISFIT = 4.0
"""Mean square by which the mean may depart from its fit, over its own variance."""


@dataclass(frozen=True)
class Optimum:
    """The best value of one parameter."""

    place: float
    low: float
    """The lower end of the interval of the place."""
    high: float
    """The upper end of the interval."""
    value: float
    """The metric at the optimum, no better than at the best point."""
    edge: str = ""
    """low | high: there is no optimum inside the range; this end is as good as any place in it."""
    fitted: float = math.nan
    """The metric of the fit there, which may be better than at any point; nan without a fit."""


def find_optimum(parameter: Array, curves: Array, goal: str) -> Optimum:
    """Return the optimum of curves (n, points) over a parameter (points,), for the goal min or max.

    Raises ValueError for curves without points, or with what is not finite.
    """
    order = np.argsort(parameter)
    x = np.asarray(parameter, float)[order]
    y = np.asarray(curves, float)[:, order] * (1 if goal == "min" else -1)
    if not y.size or not np.isfinite(y).all():
        raise ValueError("an optimum needs finite numbers")
    if len(x) < MIN_FIT_POINTS:
        return _best_point(x, y.mean(axis=0), goal)
    scale = np.log(x) if x[0] > 0 else x
    window, rest, follows = _fit_window(scale, y)
    best, value = (float(part[0]) for part in _minima(scale, y.mean(axis=0)[None], window))
    drawn = bootstrap_means(y, rest)
    found = _minima(scale, drawn, window)[0]
    error = _interpolation_error(scale, y.mean(axis=0), drawn[:FEW_DRAWS], window)
    low, high = widened_interval(best, found, error, (scale[0], scale[-1]))
    if not follows and len(x) > 2:
        i = int(y.mean(axis=0).argmin())
        low = np.fmin(low, min(best, scale[max(0, i - 1)]))
        high = np.fmax(high, max(best, scale[min(len(x) - 1, i + 1)]))
    back = np.exp if x[0] > 0 else np.asarray
    place, low, high = (snap_to_range(float(back(v)), x) for v in (best, low, high))
    edge = range_end((place, low, high), int(y.mean(axis=0).argmin()), x)
    sign = 1 if goal == "min" else -1
    inside = max(value, float(y.mean(axis=0).min()))
    return Optimum(place, low, high, sign * inside, edge, sign * value)


def range_end(interval: tuple[float, float, float], best: int, x: Array) -> str:
    """Return the end of the range, low or high, that is as good as any place in it; "" for none.

    An optimum lies inside where points on both sides of the best one are worse. Where the best
    point is an end, the fit may have its optimum before it: believed where its interval leaves that
    end out. interval: place, low and high; x: the points, rising.
    """
    place, low, high = interval
    last = len(x) - 1
    if last > 0 and (place == x[0] or (best == 0 and low <= x[0])):
        return "low"
    return "high" if last > 0 and (place == x[-1] or (best == last and high >= x[-1])) else ""


def widened_interval(
    best: float, drawn: Array, error: float, ends: tuple[float, float]
) -> tuple[float, float]:
    """Return the interval of optima that are drawn, with an error of the fit added in squares.

    error: the standard error that is in no draw; ends: of the range, beyond which nothing lies.
    """
    low = high = best
    if drawn.size:
        tail = (1 - CONFIDENCE) / 2
        low, high = np.quantile(drawn, [tail, 1 - tail], method="inverted_cdf")
        low, high = min(low, best), max(high, best)
    reach = QUANTILE * error
    low, high = best - math.hypot(best - low, reach), best + math.hypot(high - best, reach)
    return max(low, min(best, ends[0])), min(high, max(best, ends[1]))


def excess_error(differences: Array, spreads: Array | float) -> float:
    """Return the rms by which optima of further fits differ, beyond what noise explains.

    differences: of each fit's optimum from that of the fit that is used (n,); spreads: the standard
    deviations of these differences over draws (n,), 0 where there are none.
    """
    if not differences.size:
        return 0.0
    return math.sqrt(np.maximum(0.0, differences**2 - spreads**2).mean())


def _interpolation_error(x: Array, mean: Array, drawn: Array, window: _Window) -> float:
    """Return the standard error of the cubic's minimum that the spread does not explain.

    From cubics through fewer points, and from quartics through a few more, whose own error is of a
    higher order; the two are independent. drawn: means of curves drawn again (n, points).
    """
    curves = np.concatenate([mean[None], drawn])
    used = _window_minima(x, curves, window, DEGREE)
    best, square = int(mean.argmin()), 0.0
    for others, degree in (
        (window.parts(best, LEAST_SHARE), DEGREE),
        (window.extensions(len(x)), DEGREE + 1),
    ):
        different = [_window_minima(x, curves, other, degree) - used for other in others]
        if different:
            d = np.array(different)
            spread = d[:, 1:].std(axis=1) if len(drawn) else 0.0
            square += excess_error(d[:, 0], spread) ** 2
    return math.sqrt(square)


def _window_minima(x: Array, curves: Array, window: _Window, degree: int) -> Array:
    """Return where polynomials through curves (n, points) in a window are least.

    To 1/200 of half the window, which is little beside the differences of fits.
    """
    some = x[window.points]
    middle, half = (some[0] + some[-1]) / 2, (some[-1] - some[0]) / 2
    t = np.linspace(-1.0, 1.0, 401)
    powers, tried = (np.vander(u, degree + 1) for u in ((some - middle) / half, t))
    c = np.linalg.lstsq(powers, curves[:, window.points].T, rcond=None)[0]
    return np.asarray(middle + half * t[(tried @ c).argmin(axis=0)])


def _best_point(x: Array, mean: Array, goal: str) -> Optimum:
    """Return the best point itself, and its neighbors as the interval: too few for a curve."""
    i = int(mean.argmin())
    low, high = x[max(0, i - 1)], x[min(len(x) - 1, i + 1)]
    ends = {0: "low", len(x) - 1: "high"} if len(x) > 1 else {}
    value = float(mean[i]) if goal == "min" else -float(mean[i])
    return Optimum(float(x[i]), float(low), float(high), value, ends.get(i, ""))


def snap_to_range(value: float, x: Array) -> float:
    """Return the value, with what the logarithm did to values of the range undone."""
    nearest = float(x[np.abs(x - value).argmin()]) if math.isfinite(value) else value
    return nearest if math.isclose(value, nearest, rel_tol=1e-12) else value


@dataclass(frozen=True)
class _Window:
    """The points that are fitted: those from `start`, `size` of them."""

    start: int
    size: int

    @property
    def points(self) -> slice:
        """The points as a slice."""
        return slice(self.start, self.start + self.size)

    def parts(self, best: int, share: float) -> list[_Window]:
        """Return the shorter windows in it that have the best point inside, of a share at least."""
        least = max(MIN_FIT_POINTS, math.ceil(share * self.size))
        end = self.start + self.size
        return [
            _Window(start, size)
            for start in range(self.start, best)
            for size in range(max(least, best + 2 - start), end - start + 1)
            if size < self.size
        ]

    def extensions(self, points: int) -> list[_Window]:
        """Return it with a point more at one end or both, of a row of points; itself, if long."""
        first, last = self.start, self.start + self.size
        ends = {
            (max(0, first - a), min(points, last + b)) for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))
        }
        return [_Window(a, b - a) for a, b in sorted(ends) if b - a > MIN_FIT_POINTS]

    def centered_on(self, best: int, points: int) -> _Window:
        """Return itself where it has the best point of a curve, moved there otherwise."""
        if self.start <= best < self.start + self.size:
            return self
        return replace(self, start=min(max(0, best - self.size // 2), points - self.size))

    def shorter(self, best: int) -> tuple[_Window, ...]:
        """Return it without one of its ends, where a point is left on that side of the best one."""
        last = self.start + self.size - 1
        left = (_Window(self.start + 1, self.size - 1),) if self.start + 1 < best else ()
        right = (_Window(self.start, self.size - 1),) if last - 1 > best else ()
        return left + right


def _fit_window(x: Array, curves: Array) -> tuple[_Window, float, bool]:
    """Return the points around the best one of the mean that a cubic follows.

    Ends that it cannot follow are left out one by one: near a pole, only on its side. Also the rms
    by which the mean departs from the fit, less what its own spread explains, where that is known
    (nan where nothing is); and whether the spread explains it.
    """
    points = len(x)
    mean, noise = curves.mean(axis=0), variance_of_mean(curves)
    best, reach = int(mean.argmin()), max(MIN_REACH, round(REACH_SHARE * points))
    size = min(points, 2 * reach + 1)
    window = _Window(min(max(0, best - reach), points - size), size)
    square = _misfit(x, mean, window)
    while square > MAX_MISFIT * noise and window.size > MIN_FIT_POINTS:
        shorter = window.shorter(best)
        if not shorter:
            break
        window = min(shorter, key=lambda w: _misfit(x, mean, w))
        square = _misfit(x, mean, window)
    if math.isnan(square):
        return window, math.nan if math.isnan(noise) else 0.0, False
    rest = math.sqrt(max(0.0, square - (0.0 if math.isnan(noise) else noise)))
    return window, rest, square <= MAX_MISFIT * noise


def _misfit(x: Array, mean: Array, window: _Window) -> float:
    """Return the mean square from a curve to its cubic by degree of freedom; nan without."""
    powers, y = _powers(x[window.points]), mean[window.points]
    free = window.size - powers.shape[1]
    fit = powers @ np.linalg.lstsq(powers, y, rcond=None)[0]
    return float(np.square(y - fit).sum()) / free if free else math.nan


def variance_of_mean(curves: Array) -> float:
    """Return the variance of the mean of curves, but for shifts of the whole; nan of a single one.

    The same at all points, which makes it well known from few curves.
    """
    count, points = curves.shape
    if count < 2 or points < 2:
        return math.nan
    rest = curves - curves.mean(axis=0)
    rest = rest - rest.mean(axis=1, keepdims=True)
    return float(np.square(rest).sum() / ((count - 1) * (points - 1) * count))


def bootstrap_means(curves: Array, rest: float, least: int = MIN_BOOTSTRAP_CURVES) -> Array:
    """Return means of curves drawn with replacement: (DRAWS, points).

    The spread of n curves around their own mean is too small by (n - 1) / n, which is undone. Few
    curves make too few means: normal errors of the same variance replace them. rest: rms of what
    the fit leaves beside the spread, all there is of a single curve; least: number of curves that
    are not few. None where nothing is known.
    """
    rng = np.random.default_rng(SEED)
    count, points = curves.shape
    mean, variance = curves.mean(axis=0), variance_of_mean(curves)
    if math.isnan(variance) and math.isnan(rest):
        return np.empty((0, points))
    if count >= least:
        chosen = rng.integers(count, size=(DRAWS, count))
        weights = np.stack([(chosen == i).sum(axis=1) for i in range(count)], axis=1) / count
        out = mean + math.sqrt(count / (count - 1)) * (weights @ (curves - mean))
    else:
        spread = 0.0 if math.isnan(variance) else math.sqrt(variance)
        out = mean + spread * rng.standard_normal((DRAWS, points))
    return np.asarray(out + rest * rng.standard_normal((DRAWS, points)))


def _powers(x: Array) -> Array:
    """Return powers (points, degree + 1) of the parameter, from -1 to 1 over these points.

    One point is left to smooth, where there are enough.
    """
    degree = min(DEGREE, len(x) - 1 if len(x) <= DEGREE else len(x) - 2)
    middle, half = (x[0] + x[-1]) / 2, (x[-1] - x[0]) / 2 or 1.0
    return np.vander((x - middle) / half, degree + 1, increasing=True)


def _minima(x: Array, curves: Array, window: _Window) -> tuple[Array, Array]:
    """Return where every curve is least, and how much it is there.

    The minimum of the cubic, or an end of the range that is better; the best point itself where
    the cubic has none.
    """
    best = curves.argmin(axis=1)
    rows = np.arange(len(curves))
    places, values = x[best], curves[rows, best]
    if window.size < 3:
        return places, values
    windows = [window.centered_on(int(i), len(x)) for i in best]
    for own in dict.fromkeys(windows):
        these = rows[[w == own for w in windows]]
        some = x[own.points]
        powers = _powers(some)
        c = np.zeros((DEGREE + 1, these.size))
        c[: powers.shape[1]] = np.linalg.lstsq(powers, curves[these, own.points].T, rcond=None)[0]
        t, found = _cubic_minima(c)
        here = np.polynomial.polynomial.polyval(t, c, tensor=False)
        # A curve whose fit is best at an end of the range is best there.
        for end, side in ((0, -1.0), (len(x) - 1, 1.0)):
            if own.start <= end < own.start + own.size:
                found &= here <= np.polynomial.polynomial.polyval(side, c)
        place = (some[0] + some[-1]) / 2 + t * (some[-1] - some[0]) / 2
        places[these] = np.where(found, place, places[these])
        values[these] = np.where(found, here, values[these])
    return places, values


def _cubic_minima(c: Array) -> tuple[Array, Array]:
    """Return where cubics c0 + c1 t + c2 t^2 + c3 t^3 are least, and whether in -1..1.

    The root of the derivative at which the curve bends upward, in the form that loses no digits.
    """
    square = c[2] ** 2 - 3 * c[1] * c[3]
    root = np.sqrt(np.maximum(square, 0))
    safe = c[2] + root > abs(c[2]) * 1e-3
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(safe, -c[1] / (c[2] + root), (root - c[2]) / (3 * c[3]))
    found = (square > 0) & np.isfinite(t) & (abs(t) <= 1)
    return np.where(found, t, 0.0), found
