"""What so many captures can tell of a pixel at most: dense matrices, every placing; gaps."""

import itertools

import numpy as np
import pytest

from vcam_cli.scheduling import chain_bound, weighted_schedules
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Sensor

FIRST = 0.2


def dense_precision(times, rate, sensor):
    """t' C^-1 t by a dense matrix."""
    covariance = rate * np.minimum.outer(times, times) + sensor.reset**2
    return times @ np.linalg.solve(covariance + sensor.read**2 * np.eye(len(times)), times)


@pytest.mark.parametrize("reset", [0.0, 9.0, 300.0])
@pytest.mark.parametrize("read", [3.0, 60.0])
def test_no_placing_of_the_captures_tells_more(read, reset):
    """Every placing on a grid of times between the first and the last, for dim and bright pixels.

    Where all but two are at the ends, that placing is on the grid, and the two are equal.
    """
    sensor = Sensor(1e6, 0, read, reset)
    rates, last = np.array([5.0, 300.0, 40000.0]), np.array([FIRST, 0.7, 2.5])
    for count in (1, 2, 3, 4):
        found = chain_bound.best_precision(count, FIRST, last[:, None], rates, sensor)
        for (row, end), (column, rate) in itertools.product(enumerate(last), enumerate(rates)):
            grid = np.linspace(FIRST, end, 8)
            ends = [FIRST, end] if count > 1 else [end]
            best = max(
                dense_precision(np.sort([*ends, *others]), rate, sensor)
                for others in itertools.combinations_with_replacement(grid, max(count - 2, 0))
            )
            assert found[row, column] == pytest.approx(best, rel=1e-9)


def test_it_is_convex_in_the_last_time_and_grows():
    """So straight lines between tabulated times lie above it."""
    last, sensor = np.linspace(FIRST, 3, 60)[:, None], Sensor(1e6, 0, 20, 40)
    for count in (2, 5):
        found = chain_bound.best_precision(count, FIRST, last, np.array([30.0, 3e4]), sensor)
        assert (np.diff(found, axis=0) > 0).all()
        assert (np.diff(found, 2, axis=0) > -1e-12 * found[1:-1]).all()


@pytest.mark.parametrize("count", [1, 16, 17, 40, 1000])
def test_a_table_serves_at_least_as_many_captures(count):
    assert count <= chain_bound._tabulated(count) < 1.2 * count + 1


def test_it_closes_the_gap_of_captures_at_free_times():
    """A scene of nearly three decades under a longest exposure, like that of the dark room."""
    pdf = Pdf.segments([7e3, 4e4, 1e6], [4e4, 3e5, 3.9e6], [0.6, 0.25, 0.15])
    sensor = Sensor(20000, 600, 10, 15, 0.2)
    found = weighted_schedules.optimal_schedules(pdf, [1, 2, 4], sensor)
    assert max(schedule.gap for schedule in found.values()) < 0.01
