"""The mean SNR of a schedule, against mpmath, plain sums over levels and independent values."""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest
from examples import examples
from hypothesis import example, given
from hypothesis import strategies as st

from vcam_cli.scheduling import objective
from vcam_cli.scheduling.objective import expected_snr, expected_snr_bound
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import SHOT_NOISE, Constraints, Sensor, first_capture_time

DATA = Path(__file__).parents[1] / "data" / "capture_schedules_shot_noise.json"
FULL = json.loads(DATA.read_text("utf-8"))["full_noise"]
NOISY = Sensor(well=20000.0, dark=30.0, read=10.0, reset=15.0)


def plain(levels, weights, times, sensor):
    """Equation 4.1 level by level."""
    total = 0.0
    for i, weight in zip(levels, weights / np.sum(weights), strict=True):
        usable = [t for t in times if (i + sensor.dark) * t <= sensor.well * (1 + 1e-12)]
        if usable and i > 0:
            t = max(usable)
            noise = (i + sensor.dark) * t + sensor.read**2 + sensor.reset**2
            total += weight * (i * t) ** 2 / noise
    return total


@examples(100)
@given(
    st.one_of(st.just(0.0), st.floats(1e-9, 1e4)),
    st.floats(1e-12, 1e4),
    st.one_of(st.just(0.0), st.floats(1e-12, 1e8)),
)
@example(1.0, 0.4999, 1.0)  # just where the series ends, and just beyond
@example(1.0, 0.5001, 1.0)
@example(0.0, 0.2499, 1.0)
def test_the_mean_over_a_piece_is_that_of_the_primitive(low, width, noise):
    high = low + width
    with mpmath.workdps(120):  # the primitive loses up to three times 20 digits
        a, b, c = mpmath.mpf(low), mpmath.mpf(high), mpmath.mpf(noise)

        def signal(x):
            return x * x / 2 - c * x + (c * c * mpmath.log(1 + x / c) if noise else 0)

        def fill(x):
            return x - 2 * c * mpmath.log(x + c) - c * c / (x + c) if noise else x

        if a == b:
            expected, filled = a * a / (a + c) if a else mpmath.mpf(0), (a / (a + c)) ** 2
        else:
            expected, filled = (signal(b) - signal(a)) / (b - a), (fill(b) - fill(a)) / (b - a)
        expected, filled = float(expected), float(filled)
    ends = np.array([low]), np.array([high])
    # a few roundings: all terms are positive
    assert objective.mean_snr_rate(*ends, np.array([noise]))[0] == pytest.approx(
        expected, rel=3e-14
    )
    assert objective.mean_squared_signal_fraction(*ends, noise)[0] == pytest.approx(
        filled, rel=3e-14
    )


@examples(100)
@given(
    st.lists(st.integers(0, 40), min_size=1, max_size=12, unique=True),
    st.lists(st.integers(1, 40), min_size=1, max_size=5),
    st.sampled_from([Sensor(40.0), Sensor(40.0, dark=3.0), Sensor(40.0, 1.0, 2.0, 3.0)]),
)
def test_levels_are_plain_sums(levels, ends, sensor):
    if max(levels) == 0:
        levels = [*levels, 1]
    weights = 1.0 + np.arange(len(levels))
    times = sensor.well / (np.array(ends) + sensor.dark)
    found = expected_snr(Pdf.levels(levels, weights), times, sensor)
    assert found == pytest.approx(plain(levels, weights, times, sensor), rel=1e-12)


@pytest.mark.parametrize("sensor", [Sensor(20000.0), NOISY])
def test_segments_are_the_limit_of_many_levels(sensor):
    low, high, weights = [0.0, 500.0, 4000.0], [500.0, 900.0, 9000.0], [0.5, 0.2, 0.3]
    times = sensor.well / np.array([9000.0, 5000.0, 700.0, 100.0])
    count = 20000
    inner = (np.arange(count) + 0.5) / count
    levels = np.concatenate([a + (b - a) * inner for a, b in zip(low, high, strict=True)])
    dense = plain(levels, np.repeat(weights, count), times, sensor)
    found = expected_snr(Pdf.segments(low, high, weights), times, sensor)
    # a capture's limit falls within a cell: 1 of 20000, worth at most the mean
    assert found == pytest.approx(dense, rel=1e-4)


@pytest.mark.parametrize("case", FULL)
def test_full_noise_agrees_with_independent_values(case):
    sensor = Sensor(case["well"], case["dark"], case["read"], case["reset"])
    pdf = Pdf.segments(*np.array(case["segments"]).T)
    times = case["well"] / (np.array(case["photocurrents"]) + case["dark"])
    # the values were summed from primitives, which cancel to about 1e-12
    assert expected_snr(pdf, times, sensor) == pytest.approx(case["J"], rel=1e-11)


def test_without_a_sensor_it_is_the_sum_of_moments():
    pdf = Pdf.uniform(0, 1)
    captures = np.array([1.0, 0.5])
    assert expected_snr(pdf, 1 / captures) == pytest.approx(0.375 / 1 + 0.125 / 0.5, rel=1e-14)


def test_what_saturates_every_capture_has_no_snr():
    pdf = Pdf.levels([1.0, 2.0], [1, 1])
    assert expected_snr(pdf, [1.0]) == pytest.approx(0.5)  # only the darker one
    assert expected_snr(pdf, [2.0]) == 0.0
    assert expected_snr(Pdf.uniform(1, 2), [4.0]) == 0.0


def test_dark_current_alone_may_fill_the_well():
    assert expected_snr(Pdf.uniform(0, 1), [1.0], Sensor(well=1.0, dark=2.0)) == 0.0


def test_a_time_rounded_up_does_not_saturate_its_photocurrent():
    for level in np.random.default_rng(0).uniform(0.1, 10, 200):
        time = np.nextafter(np.nextafter(1 / level, np.inf), np.inf)
        assert expected_snr(Pdf.levels([level], [1]), [time]) == pytest.approx(1.0, rel=1e-12)
        assert expected_snr(Pdf.levels([level], [1]), [time * (1 + 1e-9)]) == 0.0
        near = Pdf.uniform(level * (1 - 1e-12), level)  # as narrow as the slack
        assert expected_snr(near, [time]) == pytest.approx(1.0, rel=1e-11)


def test_order_and_repeats_of_times_do_not_matter():
    pdf, times = Pdf.uniform(0, 2), np.array([0.5, 0.9, 3.0])
    expected = expected_snr(pdf, times)
    assert expected_snr(pdf, [3.0, 0.5, 0.9, 0.9]) == expected


@pytest.mark.parametrize(
    "sensor", [SHOT_NOISE, Sensor(1.0, 0.1, 0.2, 0.3), Sensor(1.0, 0.1, max_time=2)]
)
@pytest.mark.parametrize(
    "pdf", [Pdf.uniform(0, 1), Pdf.levels([0, 0.1, 1], [1, 1, 1]), Pdf.uniform(0.5, 3)]
)
def test_the_best_snr_is_approached_by_many_captures(pdf, sensor):
    limit = min(sensor.max_time, 1e5)
    times = np.geomspace(1 / 3.3, limit, 30000)
    own = sensor.well / np.maximum(pdf.high + sensor.dark, 1e-9)
    times = np.append(times, np.minimum(own, limit))
    many = expected_snr(pdf, times, sensor)
    best = expected_snr_bound(pdf, sensor)
    assert many <= best * (1 + 1e-12)
    # neighboring times differ by 4e-4 at most, SNR by less than twice that
    assert many == pytest.approx(best, rel=1e-3)


def test_without_noise_the_best_is_a_full_well_but_for_the_black():
    assert expected_snr_bound(Pdf.uniform(0, 1)) == pytest.approx(1.0)
    assert expected_snr_bound(Pdf.levels([0, 1], [3, 1])) == pytest.approx(0.25)
    assert expected_snr_bound(Pdf.uniform(0, 1), Sensor(7.0)) == pytest.approx(7.0)


def test_the_first_capture_just_holds_the_brightest():
    pdf = Pdf.segments([0, 90, 200], [90, 100, 300], [1, 1, 0])
    assert first_capture_time(pdf, Sensor(2000.0, dark=25.0)) == pytest.approx(16.0)
    assert first_capture_time(pdf, Sensor(2000.0, max_time=3.0)) == 3.0
    assert first_capture_time(pdf, Sensor(2000.0), Constraints(frame_time=3.0)) == 18.0
    # 0.7 / 0.1 is 6.999999999999999 frames
    assert first_capture_time(
        Pdf.uniform(0, 1), Sensor(0.7), Constraints(frame_time=0.1)
    ) == pytest.approx(0.7)
    with pytest.raises(ValueError, match="saturates the brightest"):
        first_capture_time(pdf, Sensor(2000.0), Constraints(frame_time=21.0))


@pytest.mark.parametrize("times", [[0.0], [-1.0, 1.0], [np.inf], [np.nan]])
def test_times_must_be_times(times):
    with pytest.raises(ValueError, match="capture times"):
        expected_snr(Pdf.uniform(0, 1), times)


@pytest.mark.parametrize("wrong", [{"well": 0}, {"dark": -1}, {"read": np.inf}, {"max_time": 0}])
def test_sensors_must_be_possible(wrong):
    with pytest.raises(ValueError, match="must be"):
        Sensor(**wrong)


def test_constraints_must_be_possible():
    with pytest.raises(ValueError, match="must be"):
        Constraints(min_gap=-1.0)


def test_a_schedule_knows_its_captures_and_how_many_differ():
    schedule = objective.evaluate_schedule(Pdf.uniform(0, 1), [2.0, 1.0, 2.0])
    assert schedule.times.tolist() == [1, 2, 2]
    assert schedule.photocurrents.tolist() == [1, 0.5, 0.5]
    assert schedule.expected_snr == pytest.approx(0.625)
    assert schedule.distinct_captures == 2
