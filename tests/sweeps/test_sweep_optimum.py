"""The optimum of a curve: where it is known, and how well its interval covers the truth."""

import math

import numpy as np
import pytest
from making import long_except

from vcam_cli.sweeps.optimum import find_optimum

X = np.linspace(5.3, 15, 20)


def curve(at: float) -> np.ndarray:
    """A cubic in ln(x) with its minimum, 2, at `at`."""
    u = np.log(X / at)
    return 2 + u**2 + 0.4 * u**3


@pytest.mark.parametrize("at", [6.0, 6.5, 9.123, 14.0])
@pytest.mark.parametrize("goal", ["min", "max"])
def test_a_cubic_is_found_exactly(at, goal):
    sign = 1 if goal == "min" else -1
    found = find_optimum(X, sign * curve(at)[None], goal)
    # Least squares of doubles lose some digits; the curve is flat there: the square root of 1e-15.
    assert found.place == pytest.approx(at, rel=1e-7)
    assert found.fitted == pytest.approx(2 * sign, rel=1e-12)
    assert found.value == pytest.approx(sign * curve(at).min(), rel=1e-12), "that of a point"
    assert found.low <= at <= found.high
    assert found.edge == ""


def test_parameters_that_are_not_positive_are_fitted_as_they_are():
    x = np.linspace(-3, 3, 13)
    found = find_optimum(x, ((x - 0.7) ** 2 + 0.1 * (x - 0.7) ** 3)[None], "min")
    assert found.place == pytest.approx(0.7, abs=1e-7)


def test_the_order_of_the_values_does_not_matter():
    rng = np.random.default_rng(5)
    curves = curve(8.0) + 0.02 * rng.standard_normal((4, 20))
    mixed = rng.permutation(20)
    assert find_optimum(X[mixed], curves[:, mixed], "min") == find_optimum(X, curves, "min")


@pytest.mark.parametrize("count", long_except([4], [2, 4, 16]))
def test_the_interval_covers_the_truth_as_often_as_it_says(count):
    """95 % intervals in 60 trials: fewer than 85 % would come about once in 1000.

    An interval that is always right because it is always wide is refused as well: the error of the
    mean of n curves is known to first order, sigma / (2 a sqrt(n)) at the curvature 2 a.
    """
    rng = np.random.default_rng(7)
    hits, widths = 0, []
    for at in rng.uniform(6.5, 12, 60):
        found = find_optimum(X, curve(at) + 0.02 * rng.standard_normal((count, 20)), "min")
        hits += found.low <= at <= found.high
        widths.append(found.high - found.low)
    assert hits >= 0.85 * 60
    assert np.median(widths) < 3 / np.sqrt(count)


def test_a_kink_is_no_cubic_and_the_interval_knows():
    at = 8.2
    sharp = np.maximum(0.3 * (X - at), 0.02 * (at - X))
    rng = np.random.default_rng(3)
    found = find_optimum(X, sharp + 1e-4 * rng.standard_normal((4, 20)), "min")
    assert found.low <= at <= found.high


def test_what_all_curves_share_does_not_widen_the_interval():
    """Repeats that differ by a shift of the whole curve agree on the optimum."""
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.standard_normal((8, 20))
    shifts = 5 * rng.standard_normal((8, 1))
    a, b = (find_optimum(X, curve(9.0) + noise + s, "min") for s in (0, shifts))
    assert b.place == pytest.approx(a.place, rel=1e-6)
    # Not to the last digit: the same draws, fitted to numbers a hundred times as large.
    assert (b.low, b.high) == pytest.approx((a.low, a.high), rel=1e-3)


def test_the_ends_of_the_range_are_told():
    low, high = find_optimum(X, curve(3.0)[None], "min"), find_optimum(X, curve(20.0)[None], "min")
    assert (low.place, low.edge) == (5.3, "low")
    assert (high.place, high.edge) == (15.0, "high")


def test_a_fit_that_dips_before_the_end_is_believed_outside_its_interval():
    """Points that rise from the first on: a cubic through noise dips inside, a real one too."""
    t = np.log(X / X[0])
    rises = 1 + 0.3 * t**2 + 0.002 * t
    noise = 0.002 * np.random.default_rng(3).standard_normal((4, len(X)))
    flat = find_optimum(X, rises + noise - noise.mean(axis=0) - 0.004 * t, "min")
    assert (flat.edge, flat.low) == ("low", 5.3)
    assert flat.place > 5.3, "the cubic's own minimum"
    dips = find_optimum(X, rises + noise / 20 - 0.025 * t, "min")
    assert dips.edge == ""
    assert 5.3 < dips.low <= X[0] * math.exp(0.023 / 0.6) <= dips.high
    assert (rises - 0.025 * t).argmin() == 0, "the best point is the first one"


def test_few_points():
    one = find_optimum(np.array([4.0]), np.array([[2.0], [3.0]]), "min")
    assert (one.place, one.value, one.edge) == (4.0, 2.5, "")
    two = find_optimum(np.array([4.0, 5.0]), np.array([[2.0, 1.0]]), "min")
    assert (two.place, two.edge, two.low) == (5.0, "high", 4.0)
    three = find_optimum(np.array([1.0, 2.0, 4.0]), np.array([[2.0, 1.0, 2.0]]), "min")
    assert (three.place, three.value) == (2.0, 1.0)
    assert (three.low, three.high) == (1.0, 4.0)


def test_three_points_are_no_curve():
    """A parabola through them would reach far below what was seen."""
    steep = find_optimum(np.array([2.0, 20.0, 200.0]), np.array([[66.0, 9.8, 4.3]]), "min")
    assert (steep.place, steep.value, steep.edge) == (200.0, 4.3, "high")


def test_what_is_no_number_is_refused():
    with pytest.raises(ValueError, match="finite"):
        find_optimum(X, np.full((1, 20), np.nan), "min")


def pole(x, at, slope, ripple, phase):
    """As the pixel-size study's: a pole where pixels have no photodiode left, then slow growth."""
    bend = (at - 4.9) ** 2 * slope
    return bend / (x - 4.9) + slope * x + ripple * np.sin(37 * x + phase)


def test_intervals_of_coarse_and_fine_grids_overlap():
    """Of ten studies at least nine, and they have the truth in them as often.

    Noise is as that of the shipped study; so is the coarse grid. Without the error of the cubic in
    the interval 23 of 40 overlap, and 14 have the truth in them.
    """
    rng = np.random.default_rng(11)
    fine, coarse = np.linspace(5.3, 11, 100), np.linspace(5.3, 15, 20)
    overlaps, hits, widths = 0, 0, []
    for _ in range(10):
        at, slope = rng.uniform(6.2, 8), rng.uniform(0.03, 0.1)
        found = []
        for x in (fine, coarse):
            truth = pole(x, at, slope, 0.02 * slope, rng.uniform(0, 6))
            noise = 0.03 * slope * rng.standard_normal((4, len(x)))
            found.append(find_optimum(x, truth + noise, "min"))
        a, b = found
        overlaps += a.low <= b.high and b.low <= a.high
        hits += b.low <= at <= b.high
        widths.append(b.high - b.low)
    assert np.median(widths) < 0.4, "less than a step of the coarse grid, 0.51"
    assert overlaps >= 9
    assert hits >= 9
