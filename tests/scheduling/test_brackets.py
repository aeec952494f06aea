"""Brackets of exposures: closed forms, simulated merging, and brute force over times."""

import itertools

import numpy as np
import pytest
from making import long_except

from vcam_cli.scheduling.brackets import bracket_bound, bracket_snr, optimal_bracket
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Constraints, Sensor

SHOT = Sensor()
NOISY = Sensor(20_000, 300, 10, 15)
CASES = {
    "uniform": (Pdf.uniform(0, 1), SHOT),
    "two segments": (Pdf.segments([0, 0.6], [0.3, 1], [0.8, 0.2]), SHOT),
    "levels": (Pdf.levels([0.01, 0.1, 1.0], [0.5, 0.3, 0.2]), SHOT),
    "wide": (Pdf.segments([1, 30, 300], [30, 300, 3000], [0.6, 0.3, 0.1]), SHOT),
    "noise": (Pdf.segments([10, 1e4], [1e3, 1e5], [0.7, 0.3]), NOISY),
}


def first(pdf, sensor):
    return sensor.well / (pdf.max + sensor.dark)


def test_shot_noise_alone_adds_up_what_does_not_saturate():
    """Uniform photocurrents from 0 to 1 and a well of one electron: an exposure t <= 1 is worth t
    times their mean 1/2, one of t >= 1 t times the integral of i up to 1 / t, 1 / (2 t)."""
    pdf = Pdf.uniform(0, 1)
    for times in ([0.4], [1.0, 1.0], [0.3, 2.0, 5.0]):
        expected = sum(t / 2 if t <= 1 else 1 / (2 * t) for t in times)
        assert bracket_snr(pdf, np.array(times)) == pytest.approx(expected, rel=1e-12)


def test_value_is_that_of_merged_exposures():
    """A level before four exposures, the longest saturated: Monte Carlo of 200 000 pixels, merged
    by inverse variance; SNR as a power ratio within 5 standard errors, 2 / sqrt(n) and less."""
    light, times, n = 4000.0, np.array([0.5, 1.0, 3.0, 20.0]), 200_000
    draw = np.random.default_rng(4)
    charge = draw.poisson((light + NOISY.dark) * times[:3, None], (3, n)).astype(float)
    noise = draw.normal(0, np.sqrt(NOISY.noise_floor), charge.shape)
    estimates = (charge + noise) / times[:3, None] - NOISY.dark
    variance = ((light + NOISY.dark) * times[:3] + NOISY.noise_floor) / times[:3] ** 2
    merged = np.average(estimates, axis=0, weights=1 / variance)
    found = light**2 / merged.var()
    stated = bracket_snr(Pdf.levels([light], [1.0]), times, NOISY)
    assert found == pytest.approx(stated, rel=5 * np.sqrt(2 / n))


@pytest.mark.parametrize(
    ("total", "name"),
    long_except(
        [(3.7, "uniform"), *((40.0, name) for name in CASES if name not in ("uniform", "noise"))],
        itertools.product([2.0, 3.7, 8.0, 40.0], CASES),
        several=True,
    ),
)
def test_no_times_of_a_fine_grid_are_better(name, total):
    """Two and three exposures, the first given: all sums of 300 times and of those at which a
    level or segment saturates. What is found lies off the grid and is at least as good."""
    pdf, sensor = CASES[name]
    t1 = first(pdf, sensor)
    room = (total - 1) * t1
    ends = np.concatenate([pdf.low, pdf.high]) + sensor.dark
    ends = ends[ends > 0]
    grid = np.concatenate([np.geomspace(t1 / 20, room, 300), sensor.well / ends])
    grid = np.unique(grid[grid <= room * (1 + 1e-12)])
    worth = np.array([expected_snr(pdf, [t], sensor) for t in grid])
    base = expected_snr(pdf, [t1], sensor)
    pair = worth[:, None] + worth[None]
    pair[grid[:, None] + grid[None] > room * (1 + 1e-12)] = -np.inf
    for count, best in ((2, worth.max()), (3, pair.max())):
        found = optimal_bracket(pdf, count, total * t1, sensor)
        assert found.times.sum() <= total * t1 * (1 + 1e-9)
        assert found.times[0] <= t1 * (1 + 1e-12)
        assert found.expected_snr >= (base + best) * (1 - 1e-6)
        assert found.expected_snr == pytest.approx(bracket_snr(pdf, found.times, sensor))


@pytest.mark.parametrize("name", long_except(["levels"], CASES))
def test_more_exposures_in_more_time_are_worth_more_and_stay_within_the_bound(name):
    pdf, sensor = CASES[name]
    t1 = first(pdf, sensor)
    found = [optimal_bracket(pdf, n, n * 3 * t1, sensor).expected_snr for n in (1, 2, 4)]
    assert all(np.diff(found) > 0)
    assert found[-1] <= bracket_bound(pdf, 12 * t1, sensor)


def test_bound_is_one_exposure_that_never_saturates():
    """Of a level closed: T i^2 / (i + dark + floor / T)."""
    pdf = Pdf.levels([500.0], [1.0])
    expected = 3.0 * 500.0**2 / (500 + NOISY.dark + NOISY.noise_floor / 3.0)
    assert bracket_bound(pdf, 3.0, NOISY) == pytest.approx(expected, rel=1e-12)


def test_readout_takes_time_between_exposures():
    """Whole frames, and a gap after each exposure but the last."""
    pdf, sensor = CASES["noise"]
    frame, gap = 0.02, 0.04
    found = optimal_bracket(pdf, 4, 1.0, sensor, Constraints(min_gap=gap, frame_time=frame))
    np.testing.assert_allclose(found.times / frame, np.round(found.times / frame), atol=1e-9)
    assert found.times.sum() + 3 * gap <= 1.0 * (1 + 1e-9)
    with pytest.raises(ValueError, match="do not fit"):
        optimal_bracket(pdf, 60, 1.0, sensor, Constraints(min_gap=gap, frame_time=frame))
