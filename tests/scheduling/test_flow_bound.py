"""The bound on schedules at whole frames: dense matrices, every schedule by brute force, gaps."""

import itertools

import numpy as np
import pytest
from making import long_except

from vcam_cli.scheduling import flow_bound, weighted_schedules
from vcam_cli.scheduling.chain_bound import upper_bounds
from vcam_cli.scheduling.mixtures import best_mixture
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Constraints, Sensor
from vcam_cli.scheduling.weighted_snr import weighted_expected_snr

FRAME = 10e-3


def dense_precision(times, reads, rate, sensor):
    """t' (K + read^2 / X)^-1 t by a dense matrix, and t - K w."""
    covariance = rate * np.minimum.outer(times, times) + sensor.reset**2
    weights = np.linalg.solve(covariance + np.diag(sensor.read**2 / reads), times)
    return times @ weights, times - covariance @ weights


def test_the_filter_is_the_dense_formula_and_its_derivative():
    rng = np.random.default_rng(1)
    sensor = Sensor(1000, 20, 7, 11, 1.0)
    times, reads = np.sort(rng.random(6)), 0.1 + 0.9 * rng.random(6)
    rates = np.array([30.0, 900.0])
    precision, residuals = flow_bound._filter(times[:, None], reads[:, None], rates, sensor)
    for k, rate in enumerate(rates):
        value, rest = dense_precision(times, reads, rate, sensor)
        assert precision[k] == pytest.approx(value, rel=1e-12)
        np.testing.assert_allclose(residuals[:, k], rest, rtol=1e-9, atol=1e-12)
        for j in range(6):
            step = 1e-6 * np.eye(6)[j]
            up, down = (
                dense_precision(times, reads + sign * step, rate, sensor)[0] for sign in (1, -1)
            )
            assert (up - down) / 2e-6 == pytest.approx(residuals[j, k] ** 2 / 49, rel=1e-6)


def test_the_precision_is_concave_in_the_reads():
    rng = np.random.default_rng(2)
    sensor = Sensor(1000, 5, 3, 20, 1.0)
    times = np.linspace(0.1, 1, 12)[:, None]
    for _ in range(50):
        one, two = rng.random((2, 12, 1)) ** 4
        values = [
            float(flow_bound._filter(times, x, np.array([400.0]), sensor)[0][0])
            for x in (one, two, (one + two) / 2)
        ]
        assert values[2] >= (values[0] + values[1]) / 2 * (1 - 1e-12)


def test_the_best_mixture_is_that_of_a_fine_grid():
    points = np.array([[1.0, 0.0, 0.2], [0.0, 1.0, 0.1], [0.3, 0.3, 0.9]])
    worth = np.array([0.1, 0.0, -0.05])

    def value(x):
        return float(np.sqrt(x + 0.01).sum()), 0.5 / np.sqrt(x + 0.01)

    shares = best_mixture(value, points, worth, np.array([1.0, 0.0, 0.0]))
    assert shares.sum() == pytest.approx(1)
    grid = [np.array([a, b, 100 - a - b]) / 100 for a in range(101) for b in range(101 - a)]
    best = max(value(s @ points)[0] + worth @ s for s in grid)
    assert value(shares @ points)[0] + worth @ shares >= best * (1 - 1e-5)


def scenes():
    rng = np.random.default_rng(3)
    yield "two segments", Pdf.segments([0, 1500], [1000, 9000], [0.7, 0.3])
    yield "one segment", Pdf.segments([100], [8000], [1])
    yield "levels", Pdf.levels(np.sort(rng.uniform(50, 9000, 9)), rng.random(9))


@pytest.mark.parametrize(("name", "pdf"), list(scenes()))
@pytest.mark.parametrize(
    ("gap", "reset"),
    long_except(
        [(0.0, 0.0), (2 * FRAME, 30.0)],
        itertools.product([0.0, 2 * FRAME], [0.0, 30.0]),
        several=True,
    ),
)
def test_no_schedule_exceeds_it_and_the_best_comes_close(name, pdf, reset, gap):
    sensor = Sensor(1000, 30, 12, reset, 24 * FRAME)
    constraints = Constraints(gap, FRAME)
    first = int(sensor.well / (pdf.max + sensor.dark) / FRAME)
    frames = range(first + 1, 25)
    least = max(1, round(gap / FRAME))
    bounds = flow_bound.flow_bounds(pdf, [1, 2, 3, 4], sensor, constraints)
    for count in (1, 2, 3, 4):
        best = 0.0
        for rest in itertools.combinations(frames, count - 1):
            numbers = np.array([first, *rest])
            if (np.diff(numbers) >= least).all():
                best = max(best, weighted_expected_snr(pdf, numbers * FRAME, sensor))
        assert best <= bounds[count] * (1 + 1e-9)
        assert bounds[count] <= best * 1.03, (count, bounds[count] / best)
        if count == 1:  # every pixel sees the one read; sums of 32-bit numbers are rounded up
            assert bounds[count] == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize(
    ("frame", "counts"),
    [(20e-3, [2, 4]), pytest.param(5e-3, [2, 3, 4, 6, 8, 12], marks=pytest.mark.long)],
)
def test_it_closes_the_gap_of_the_study_in_low_light(frame, counts):
    """Below 1 % for all; 9 % for four captures by the bound of chains alone."""
    pdf = Pdf.segments([0, 500], [500, 5000], [0.8, 0.2])
    sensor, constraints = Sensor(1000, 20, 10, 20, 1.0), Constraints(0.0, frame)
    found = weighted_schedules.optimal_schedules(pdf, counts, sensor, constraints)
    assert max(schedule.gap for schedule in found.values()) < 0.01
    chains = upper_bounds(pdf, 4, sensor, constraints)
    assert chains[3] / found[4].expected_snr > 1.05


@pytest.mark.parametrize(
    ("sensor", "constraints"),
    [
        (Sensor(1000, 20, 10, 20, 1.0), Constraints()),
        (Sensor(1000, 20, 0, 20, 1.0), Constraints(0.0, 5e-3)),
        (Sensor(1000, 20, 10, 20), Constraints(0.0, 5e-3)),
        (Sensor(1000, 20, 10, 20, 1.0), Constraints(0.0, 1e-4)),
    ],
)
def test_nothing_is_said_where_it_does_not_apply(sensor, constraints):
    pdf = Pdf.segments([0, 500], [500, 5000], [0.8, 0.2])
    assert flow_bound.flow_bounds(pdf, [2], sensor, constraints) == {2: np.inf}


def test_more_captures_than_fit_are_left_open():
    sensor = Sensor(1000, 20, 10, 20, 0.1)
    found = flow_bound.flow_bounds(
        Pdf.segments([0], [12000], [1]), [2, 50], sensor, Constraints(0.0, 0.01)
    )
    assert found[50] == np.inf
    assert found[2] < np.inf
