"""Saturation by noisy values, of levels, against a simulation of pixels."""

import numpy as np
import pytest

from vcam_cli.scheduling.full_noise import optimal_schedules
from vcam_cli.scheduling.objective import expected_snr, expected_snr_noisy_saturation
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Sensor

SENSOR = Sensor(well=5000, dark=20, read=10, reset=15)
WEDGE = Pdf.levels(np.geomspace(500, 50000, 7), np.ones(7))
PIXELS = 40_000


def simulated(pdf, times, sensor, seed=1):
    """Pixels of every level, read while they collect: the last sample before one is full."""
    random = np.random.default_rng(seed)
    total = 0.0
    for level, probability in zip(pdf.low, pdf.probability, strict=True):
        charge = sensor.reset * random.standard_normal(PIXELS)
        estimate, still = np.full(PIXELS, np.nan), np.full(PIXELS, True)
        for step, when in zip(np.diff(times, prepend=0), times, strict=True):
            charge = charge + random.poisson((level + sensor.dark) * step, PIXELS)
            sample = charge + sensor.read * random.standard_normal(PIXELS)
            still = still & (sample < sensor.well)
            estimate[still] = sample[still] / when - sensor.dark
        error = (estimate[~np.isnan(estimate)] - level) ** 2
        total += probability * level**2 * (error.size / PIXELS) / error.mean()
    return total


@pytest.mark.parametrize("count", [2, 4, 7])
def test_is_what_a_simulation_of_pixels_tells(count):
    times = optimal_schedules(WEDGE, [count], SENSOR)[count].times
    found = expected_snr_noisy_saturation(WEDGE, times, SENSOR)
    # five standard errors of a variance of so many pixels are 3.5 % of a level, 1.4 % of seven
    assert found == pytest.approx(simulated(WEDGE, times, SENSOR), rel=0.02)
    assert found < 0.93 * expected_snr(WEDGE, times, SENSOR), "captures stand on levels"


def test_far_from_the_well_it_is_the_closed_form():
    times = 0.8 * optimal_schedules(WEDGE, [4], SENSOR)[4].times  # 14 sigma below
    pdf = Pdf.levels([0, *SENSOR.saturation_limit(times) * 0.8], np.ones(5))
    expected = expected_snr(pdf, times, SENSOR)
    assert expected_snr_noisy_saturation(pdf, times, SENSOR) == pytest.approx(expected, rel=1e-12)


def test_where_every_capture_is_full_nothing_is_told():
    assert expected_snr_noisy_saturation(Pdf.levels([1e9], [1]), [1.0], SENSOR) == 0


def test_segments_are_refused():
    with pytest.raises(ValueError, match="not of segments"):
        expected_snr_noisy_saturation(Pdf.uniform(0, 1), [1.0], SENSOR)
