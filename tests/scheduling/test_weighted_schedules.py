"""The optimal linear estimate's worth by other quadratures, its schedules and their bound."""

import itertools
import json
from pathlib import Path

import mpmath
import numpy as np
import pytest

from vcam_cli.scheduling import full_noise, objective
from vcam_cli.scheduling.chain_bound import upper_bounds
from vcam_cli.scheduling.estimators import weighted_variance
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import UNCONSTRAINED, Constraints, Sensor, first_capture_time
from vcam_cli.scheduling.weighted_schedules import optimal_schedules
from vcam_cli.scheduling.weighted_snr import weighted_expected_snr

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_noise.json").read_text())
SEGMENTS = np.array(DATA["segments_e"]).T
THREE = Pdf.segments(*SEGMENTS)
DARK_FLOOR = Pdf.segments([0, *SEGMENTS[0, 1:]], SEGMENTS[1], SEGMENTS[2])
TIMES = np.array([0.9, 3.0, 3.0, 11.0, 40.0, 90.0])
LOW_LIGHT = Sensor(20000, 20, 60, 60, max_time=8.0)


def upper_bound(pdf, count, sensor, limits=UNCONSTRAINED):
    """Of so many captures alone."""
    return upper_bounds(pdf, count, sensor, limits)[-1]


def decibels(value):
    return 10 * np.log10(value)


def by_mpmath(pdf, times, sensor):
    """Dense linear algebra and tanh-sinh quadrature with 20 digits."""
    with mpmath.workdps(20):
        limits = [mpmath.mpf(float(limit)) for limit in sensor.saturation_limit(times)]
        total = mpmath.mpf(0)
        for low, high, density in zip(pdf.low, pdf.high, pdf.density, strict=True):
            cuts = sorted({low, high, *(x for x in limits if low < x < high)})
            for a, b in itertools.pairwise(mpmath.mpf(cut) for cut in cuts):
                clean = [float(t) for t, limit in zip(times, limits, strict=True) if limit >= b]

                def value(i, clean=clean):
                    return i * i * dense_precision(i + sensor.dark, clean, sensor)

                if clean:
                    total += density * mpmath.quad(value, [a, b])
        return float(total)


def dense_precision(rate, times, sensor):
    n, reset = len(times), mpmath.mpf(sensor.reset) ** 2
    matrix = mpmath.matrix(n, n)
    for j, k in itertools.product(range(n), range(n)):
        matrix[j, k] = rate * min(times[j], times[k]) + reset + (sensor.read**2 if j == k else 0)
    vector = mpmath.matrix(times)
    return (vector.T * mpmath.lu_solve(matrix, vector))[0]


@pytest.mark.parametrize(
    ("pdf", "sensor"),
    [
        (THREE, Sensor(20000, 20, 30, 10)),
        (DARK_FLOOR, Sensor(20000, 0, 0.01, 50)),
        (THREE, Sensor(20000, 0, 3000, 1000)),
    ],
)
def test_the_mean_is_that_of_dense_matrices(pdf, sensor):
    times = TIMES[[0, 1, 4]]
    found = weighted_expected_snr(pdf, times, sensor)
    # saturation has a slack of 1e-12
    assert found == pytest.approx(by_mpmath(pdf, times, sensor), rel=1e-10)


def test_levels_are_the_estimate_s_variance():
    levels = np.array([0.0, 10.0, 150.0, 1e3, 2e4])
    pdf, sensor = Pdf.levels(levels, [1, 2, 3, 4, 5]), Sensor(20000, 5, 30, 20)
    total = 0.0
    for level, probability in zip(levels, pdf.probability, strict=True):
        clean = TIMES[(level + 5) * TIMES <= 20000]
        if level and len(clean):
            total += probability * level**2 / weighted_variance(level, clean, 5.0, 900.0, 400.0)
    assert weighted_expected_snr(pdf, TIMES, sensor) == pytest.approx(total, rel=1e-12)


def test_a_fine_histogram_is_its_levels():
    """Many narrow segments, where few points are used, against a level in each middle."""
    edges = np.geomspace(1, 20000, 4000)
    rng = np.random.default_rng(1)
    weight, sensor = rng.random(3999), Sensor(20000, 0, 30, 20)
    times = 20000 / edges[[-1, 3000, 2000, 500]]
    segments = weighted_expected_snr(Pdf.histogram(edges, weight), times, sensor)
    middles = Pdf.levels((edges[1:] + edges[:-1]) / 2, weight)
    # midpoint rule: (width / i)^2 / 12, 0.25 % wide
    assert segments == pytest.approx(weighted_expected_snr(middles, times, sensor), rel=2e-6)


def test_without_readout_noise_the_last_sample_is_all():
    sensor = Sensor(20000, 20)
    assert weighted_expected_snr(THREE, TIMES, sensor) == objective.expected_snr(
        THREE, TIMES, sensor
    )
    small = weighted_expected_snr(THREE, TIMES, Sensor(20000, 20, 1e-4, 0))
    assert small == pytest.approx(objective.expected_snr(THREE, TIMES, sensor), rel=1e-9)
    found = optimal_schedules(THREE, [5], sensor)[5]
    assert np.array_equal(found.times, full_noise.optimal_schedules(THREE, [5], sensor)[5].times)


def test_reads_at_one_time_share_their_read_noise():
    pdf = Pdf.levels([100.0], [1.0])
    twice = weighted_expected_snr(pdf, [5.0, 5.0], Sensor(1000, 3, 30, 7))
    quieter = weighted_expected_snr(pdf, [5.0], Sensor(1000, 3, 30 / 2**0.5, 7))
    assert twice == pytest.approx(quieter, rel=1e-12)


def oracle_pdf():
    """Levels of the independent values, see `blue_pdf` in the data."""
    levels, weights = [], []
    for number, (low, high, probability) in enumerate(SEGMENTS.T):
        edges = (np.linspace if number == 2 else np.geomspace)(low, high, 101)
        levels.append((edges[1:] + edges[:-1]) / 2)
        weights.append(probability * np.diff(edges) / (high - low))
    return Pdf.levels(np.concatenate(levels), np.concatenate(weights))


@pytest.mark.parametrize("case", [case for case in DATA["blue"] if case["N"] == 4])
def test_independent_values(case):
    pdf, sensor = oracle_pdf(), Sensor(DATA["Qsat"], case["idc"], case["sV"], case["sC"])
    last = full_noise.optimal_schedules(pdf, [4], sensor)[4]
    assert decibels(last.expected_snr) == pytest.approx(case["lsbs_opt"], abs=1e-9)
    np.testing.assert_allclose(last.times / last.times[0], case["t_lsbs"], rtol=1e-9)
    kept = weighted_expected_snr(pdf, last.times, sensor)
    assert decibels(kept) == pytest.approx(case["blue_on_lsbs_sched"], abs=1e-9)
    found = optimal_schedules(pdf, [4], sensor)[4]
    assert decibels(found.expected_snr) >= case["blue_opt"] - 1e-9
    bound = decibels(upper_bound(pdf, 4, sensor))
    assert decibels(found.expected_snr) <= bound <= case["ub"] + 1e-9


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize(
    ("sensor", "limits"),
    [
        pytest.param(Sensor(20000, 0, 100, 200), Constraints(), marks=pytest.mark.long),
        (Sensor(20000, 20, 0, 100), Constraints()),
        (LOW_LIGHT, Constraints(min_gap=1.0)),
        (LOW_LIGHT, Constraints(min_gap=1.0, frame_time=0.25)),
    ],
)
def test_no_schedule_exceeds_the_bound(discrete, sensor, limits):
    rng = np.random.default_rng(5)
    pdf = oracle_pdf() if discrete else DARK_FLOOR
    bounds = upper_bounds(pdf, 5, sensor, limits)
    first = first_capture_time(pdf, sensor, limits)
    longest = min(sensor.max_time, 100.0)
    room = longest - first - 4 * limits.min_gap
    for _ in range(30):
        times = np.sort(np.append(0.0, room * rng.random(4) ** rng.choice([0.1, 1, 4])))
        times += first + limits.min_gap * np.arange(5)
        if limits.frame_time:  # a gap of whole frames stays one
            times = np.floor(times / limits.frame_time * (1 + 1e-12)) * limits.frame_time
        for count in range(1, 6):
            value = weighted_expected_snr(pdf, times[:count], sensor)
            assert value <= bounds[count - 1] * (1 + 1e-11)


def test_the_bound_is_reached_where_all_captures_belong_at_the_end():
    """Nobody saturates within the longest exposure: all reads at its end."""
    pdf, sensor = Pdf.uniform(1, 2000), Sensor(20000, 20, 30, 20, max_time=0.1)
    found = optimal_schedules(pdf, [8], sensor)[8]
    np.testing.assert_allclose(found.times, 0.1, rtol=1e-12)
    assert found.gap < 1e-9
    last = full_noise.optimal_schedules(pdf, [8], sensor)[8]
    assert decibels(found.expected_snr / last.expected_snr) > 3


@pytest.mark.parametrize("limits", [Constraints(), Constraints(0.5), Constraints(0.5, 0.25)])
def test_never_below_the_last_sample_s_schedule(limits):
    pdf = Pdf.levels([30.0, 400.0, 2000.0, 20000.0], [3, 2, 2, 1])
    found = optimal_schedules(pdf, [1, 2, 4, 6], LOW_LIGHT, limits)
    last = full_noise.optimal_schedules(pdf, [1, 2, 4, 6], LOW_LIGHT, limits)
    before = 0.0
    for count, schedule in found.items():
        used = np.unique(last[count].times)
        assert schedule.expected_snr >= weighted_expected_snr(pdf, used, LOW_LIGHT)
        assert schedule.expected_snr >= before
        assert schedule.gap >= 0
        before = schedule.expected_snr
        assert len(schedule.times) == count
        assert schedule.times[-1] <= 8.0
        apart = np.diff(schedule.times if not limits.min_gap else np.unique(schedule.times))
        assert (apart >= limits.min_gap * (1 - 1e-9)).all()
        if limits.frame_time:
            assert np.array_equal(schedule.times % 0.25, np.zeros(count))


def test_three_captures_of_two_levels_are_brute_force():
    pdf, sensor = Pdf.levels([100.0, 4000.0], [0.7, 0.3]), Sensor(20000, 20, 60, 60, max_time=40.0)
    first = first_capture_time(pdf, sensor)
    tries = np.unique(np.append(np.linspace(first, 40, 50), 20000 / 120))
    tries = tries[tries <= 40]
    best = max(
        weighted_expected_snr(pdf, [first, *more], sensor)
        for more in itertools.combinations_with_replacement(tries, 2)
    )
    found = optimal_schedules(pdf, [3], sensor)[3]
    assert found.expected_snr >= best * (1 - 1e-9)
    assert found.expected_snr <= upper_bound(pdf, 3, sensor)


def test_mistakes_are_said():
    with pytest.raises(ValueError, match="at least one"):
        upper_bound(THREE, 0, LOW_LIGHT)
    with pytest.raises(ValueError, match="above 0"):
        weighted_expected_snr(THREE, [0.0, 1.0], LOW_LIGHT)
    assert optimal_schedules(THREE, [], LOW_LIGHT) == {}


@pytest.mark.parametrize("limits", [Constraints(), Constraints(frame_time=0.01)])
def test_reset_noise_alone_has_a_bound(limits):
    """A difference of two captures is free of it: the bound's noise is 0 but for the first."""
    pdf, sensor = Pdf.uniform(0, 1e5), Sensor(20000, 0, 0, 15, 1.0)
    found = optimal_schedules(pdf, [3], sensor, limits)[3]
    assert 0 <= found.gap < 0.05
    bound = upper_bound(pdf, 3, sensor, limits)
    assert found.expected_snr <= bound
    # as if there were no reset noise, and no less than what the last sample alone is worth
    last = full_noise.optimal_schedules(pdf, [3], sensor, limits)[3].expected_snr
    free = full_noise.optimal_schedules(pdf, [3], Sensor(20000, max_time=1.0), limits)[
        3
    ].expected_snr
    assert last < found.expected_snr < free


def test_the_bound_sees_segments_as_narrow_as_rounding():
    pdf = Pdf.segments([0.5, 0.9], [np.nextafter(0.5, 1), np.nextafter(0.9, 1)], [3, 2])
    sensor = Sensor(20000, 20, 10, 15)
    levels = Pdf.levels([0.5, 0.9], [3, 2])
    for count in (1, 2):
        expected = upper_bound(levels, count, sensor)
        assert upper_bound(pdf, count, sensor) == pytest.approx(expected, rel=1e-3)
