"""Schedules with noise and constraints: independent optima, brute force, true certificates."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vcam_cli.scheduling import candidates, full_noise
from vcam_cli.scheduling.chains import best_chains, last_sample_rewards, row_maxima
from vcam_cli.scheduling.full_noise import optimal_schedules
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import SHOT_NOISE, Constraints, Sensor, first_capture_time

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_noise.json").read_text())
THREE = Pdf.segments(*np.array(DATA["segments_e"]).T)
NOISY = Sensor(20000, 20, 30, 10)


@pytest.mark.parametrize("case", DATA["full_model_lsbs"])
def test_full_noise_is_the_independent_optimum(case):
    sensor = Sensor(DATA["Qsat"], case["idc"], case["sigmaV"], case["sigmaC"])
    found = optimal_schedules(THREE, [case["N"]], sensor)[case["N"]]
    assert found.expected_snr == pytest.approx(case["J_opt"], rel=1e-9)
    # a worth exact to 1e-13 fixes times where it is flat to the square root of that
    np.testing.assert_allclose(found.times, case["t_opt"], rtol=1e-6)
    assert 0 <= found.gap < 1e-6


@pytest.mark.parametrize("case", DATA["shot"], ids=lambda case: case["name"])
def test_shot_noise_alone_is_the_independent_optimum(case):
    if case["atoms"]:
        pdf = Pdf.levels(case["atoms"]["levels"], case["atoms"]["prob"])
    else:
        pdf = Pdf.segments(*np.array(case["segments"]).T)
    values = {int(count): value for count, value in case["J"].items() if int(count) <= 10}
    found = optimal_schedules(pdf, list(values), SHOT_NOISE)
    for count, value in values.items():
        schedule = found[count]
        assert schedule.expected_snr == pytest.approx(value, rel=1e-9)
        assert schedule.gap < 2e-6
        if pdf.discrete:
            assert schedule.gap == 0


def test_counts_do_not_depend_on_each_other():
    together = optimal_schedules(THREE, [2, 5, 6], Sensor(20000, 20))
    alone = optimal_schedules(THREE, [5], Sensor(20000, 20))[5]
    assert list(together) == [2, 5, 6]
    np.testing.assert_allclose(together[5].times, alone.times, rtol=1e-6)
    assert together[5].expected_snr == pytest.approx(alone.expected_snr, rel=1e-12)


def brute_force(pdf, times, count, sensor, gap):
    """The best schedule that takes up to `count` of `times`, the first among them."""
    best = 0.0
    for more in range(count):
        for chosen in itertools.combinations(times[1:], more):
            schedule = np.array([times[0], *chosen])
            if (np.diff(schedule) >= gap * (1 - 1e-9)).all():
                best = max(best, expected_snr(pdf, schedule, sensor))
    return best


def random_case(seed):
    """Levels, a sensor, a number of captures, the longest times and a least gap."""
    rng = np.random.default_rng(seed)
    levels = np.sort(rng.choice(np.arange(1, 60), rng.integers(1, 7), replace=False)) * 1.0
    dark, read, reset = (rng.choice([0.0, size]) for size in (5.0, 10.0, 7.0))
    longest = rng.choice([np.inf, 500 / levels[0]])
    sensor = Sensor(1000, dark, read, reset, longest)
    times = np.unique(np.minimum(1000 / (levels + sensor.dark), longest))
    gap = rng.uniform(0.1, 0.6) * np.ptp(times) + 1e-6
    return Pdf.levels(levels, rng.random(len(levels)) + 0.01), sensor, rng, times, gap


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("limited", [False, True])
def test_levels_and_a_least_gap_are_brute_force(seed, limited):
    pdf, sensor, rng, times, gap = random_case(seed)
    count, gap = int(rng.integers(1, 5)), gap * limited
    tries = np.concatenate([times - gap * steps for steps in range(count)])
    tries = np.unique(np.concatenate([tries, np.linspace(times[0], times[-1], 8)]))
    tries = tries[tries >= times[0]][:30]
    found = optimal_schedules(pdf, [count], sensor, Constraints(gap))[count]
    assert found.expected_snr >= brute_force(pdf, tries, count, sensor, gap) * (1 - 1e-12)
    assert found.gap == 0
    steps = np.diff(found.times)
    assert ((steps >= gap * (1 - 1e-9)) | (steps == 0)).all()
    assert found.times[-1] <= sensor.max_time


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("discrete", [False, True])
def test_whole_frames_are_brute_force(seed, limited, discrete):
    pdf, sensor, rng, times, gap = random_case(seed)
    if not discrete:
        pdf = Pdf.histogram([0.5, *pdf.low], [*pdf.probability])
        times = 1000 / (np.array([pdf.max, pdf.min]) + sensor.dark)
        sensor = Sensor(1000, sensor.dark, sensor.read, sensor.reset, times[0] * 9)
        times = np.minimum(times, sensor.max_time)
    frame = times[0] / rng.uniform(1, 3)
    longest = min(times[-1], times[0] + 13 * frame)
    sensor = Sensor(sensor.well, sensor.dark, sensor.read, sensor.reset, longest)
    whole = np.arange(int(times[0] / frame), int(longest / frame * (1 + 1e-12)) + 1) * frame
    limits = Constraints(gap * limited, frame)
    found = optimal_schedules(pdf, [4], sensor, limits)[4]
    best = brute_force(pdf, whole, 4, sensor, limits.min_gap)
    assert found.expected_snr == pytest.approx(best, rel=1e-12)
    assert found.gap == 0
    np.testing.assert_allclose(found.times / frame, np.round(found.times / frame), atol=1e-9)


LIMITS = [
    Constraints(),
    Constraints(min_gap=2.0),
    Constraints(frame_time=0.01),
    Constraints(min_gap=0.5, frame_time=0.01),
]


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("sensor", [Sensor(20000), Sensor(20000, 5, 300, 0, 20.0)])
def test_the_gap_covers_what_coarse_candidates_miss(monkeypatch, limits, sensor):
    fine = optimal_schedules(THREE, [2, 3, 6], sensor, limits)
    monkeypatch.setattr(full_noise, "REFINEMENTS", 0)
    for size in (8, 50):
        monkeypatch.setattr(candidates, "SIZE", size)
        coarse = optimal_schedules(THREE, [2, 3, 6], sensor, limits)
        for count, schedule in coarse.items():
            best = fine[count].expected_snr
            assert schedule.expected_snr <= best * (1 + fine[count].gap)
            assert schedule.expected_snr * (1 + schedule.gap) >= best * (1 - 1e-11)


def test_the_gap_falls_with_the_square_of_the_spacing(monkeypatch):
    monkeypatch.setattr(full_noise, "REFINEMENTS", 0)
    gaps = []
    for size in (1024, 4096):
        monkeypatch.setattr(candidates, "SIZE", size)
        gaps.append(optimal_schedules(THREE, [8], NOISY)[8].gap)
    assert gaps[0] / gaps[1] == pytest.approx(16, rel=0.3)


def test_a_capture_between_levels_may_be_best(monkeypatch):
    """Longest times 1, 10, 14; five apart: the one at 10 gives way to the one at 14."""
    pdf = Pdf.levels([1, 1 / 10, 1 / 14], [0.1, 0.3, 0.6])
    found = optimal_schedules(pdf, [3], SHOT_NOISE, Constraints(5.0))[3]
    np.testing.assert_allclose(found.times, [1, 9, 14], rtol=1e-12)
    assert found.expected_snr == pytest.approx(0.1 + 0.3 * 0.9 + 0.6, rel=1e-11)
    assert found.gap == 0
    monkeypatch.setattr(candidates, "MOST", 3)  # too many levels for any time between them
    found = optimal_schedules(pdf, [3], SHOT_NOISE, Constraints(5.0))[3]
    np.testing.assert_allclose(found.times, [1, 10, 10], rtol=1e-12)
    assert found.expected_snr == pytest.approx(0.1 + 0.3 + 0.6 / 1.4, rel=1e-11)
    # the bound moves 9 to 10 and leaves 14
    assert found.expected_snr * (1 + found.gap) == pytest.approx(1, rel=1e-11)


def test_rewards_are_the_objective():
    rng = np.random.default_rng(4)
    for pdf in (THREE, Pdf.levels(np.geomspace(0.01, 2e4, 99), rng.random(99))):
        for sensor in (NOISY, Sensor(20000), Sensor(20000, 0, 0.1, 0), Sensor(20000, 0, 3e3, 0)):
            times = np.sort(20000 / (rng.uniform(1, 20000, 60) + sensor.dark))
            times[0] = 20000 / (pdf.max + sensor.dark)
            rewards = last_sample_rewards(pdf, times, sensor)
            chain = np.array([0, 7, 8, 31, 59])
            found = rewards.own[chain].sum() - rewards.loss(chain[:-1], chain[1:]).sum()
            # interpolation is exact to 3e-13
            assert found == pytest.approx(expected_snr(pdf, times[chain], sensor), rel=2e-12)


@pytest.mark.parametrize("seed", range(20))
def test_row_maxima_of_a_monge_staircase(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 40, 2)
    matrix = rng.random((rows, columns)).cumsum(axis=0).cumsum(axis=1)  # supermodular
    matrix += rng.normal(0, 20, rows)[:, None] + rng.normal(0, 20, columns)
    lower = np.minimum(np.sort(rng.integers(0, columns, rows)), columns - 1)
    upper = np.full(rows, columns - 1)
    best, found = row_maxima(lambda r, c: matrix[r, c], lower, upper)
    allowed = np.where(np.arange(columns) >= lower[:, None], matrix, -np.inf)
    np.testing.assert_array_equal(found, allowed.argmax(axis=1))
    np.testing.assert_array_equal(best, allowed.max(axis=1))


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1, 1e4), st.floats(0.01, 1)), min_size=2, max_size=12),
    st.floats(0, 50),
    st.floats(0, 60),
    st.floats(0.5, 50),
    st.floats(0, 3),
)
def test_more_is_better_and_less_is_worse(points, dark, read, longest, gap):
    pdf = Pdf.levels([p[0] for p in points], [p[1] for p in points])
    sensor, limits = Sensor(1e4, dark, read, 5.0, longest), Constraints(gap)

    def values(sensor, limits=limits):
        found = optimal_schedules(pdf, range(1, 6), sensor, limits)
        return np.array([found[n].expected_snr for n in range(1, 6)])

    here = values(sensor)
    above = here * (1 + 1e-12)
    assert (np.diff(here) >= -1e-12 * here[1:]).all()
    assert (values(Sensor(1e4, dark + 1, read, 5.0, longest)) <= above).all()
    assert (values(Sensor(1e4, dark, read + 1, 5.0, longest)) <= above).all()
    assert (values(Sensor(1e4, dark, read, 9.0, longest)) <= above).all()
    assert (values(Sensor(1e4, dark, read, 5.0, longest / 2)) <= above).all()
    assert (values(sensor, Constraints(gap + 0.5)) <= above).all()


def test_fewer_levels_than_captures_repeat_the_last():
    pdf = Pdf.levels([10.0, 100.0, 1000.0], [1.0, 1.0, 1.0])
    found = optimal_schedules(pdf, [8], Sensor(1000, 0, 3, 0))[8]
    np.testing.assert_allclose(found.times, [1, 10, *[100] * 6], rtol=1e-12)
    assert (found.distinct_captures, found.gap) == (3, 0)


def test_a_gap_wider_than_all_leaves_one_capture():
    found = optimal_schedules(THREE, [3], Sensor(20000, 20, 30, 0, 8.0), Constraints(100.0))[3]
    assert found.distinct_captures == 1
    assert found.times[0] == pytest.approx(20000 / 20020)
    assert found.gap < 1e-9


def test_captures_that_would_stand_closer_stand_the_gap_apart():
    sensor = Sensor(20000, 20)
    free = optimal_schedules(THREE, [8], sensor)[8].times
    found = optimal_schedules(THREE, [8], sensor, Constraints(2.0))[8].times
    assert free[1] - free[0] < 2
    assert free[2] - free[1] < 2
    assert found[1] - found[0] == pytest.approx(2.0, rel=1e-9)
    assert (np.diff(found) >= 2 * (1 - 1e-9)).all()


def test_hard_pdfs():
    for pdf in (
        Pdf.uniform(0, 1),
        Pdf.uniform(1e-8, 1),
        Pdf.segments([0, 0.5, 0.9], [1e-7, 0.6, 1], [1e-12, 1, 1e-12]),
        Pdf.levels([0, 1e-8, 1], [0.4, 0.3, 0.3]),
    ):
        for sensor in (SHOT_NOISE, Sensor(1.0, 0.1, 0.05, 0.01), Sensor(1.0, 0, 0.1, 0, 50.0)):
            found = optimal_schedules(pdf, [1, 3], sensor)
            for schedule in found.values():
                assert np.isfinite(schedule.times).all()
                assert (np.diff(schedule.times) >= 0).all()
                assert 0 < schedule.expected_snr <= 1
                assert 0 <= schedule.gap < 1e-5


def test_mistakes_are_said():
    with pytest.raises(ValueError, match="at least one capture"):
        optimal_schedules(THREE, [3, 0], NOISY)
    with pytest.raises(ValueError, match="frame"):
        optimal_schedules(THREE, [3], NOISY, Constraints(frame_time=2.0))
    assert optimal_schedules(THREE, [], NOISY) == {}


HIDDEN = [
    (Pdf.uniform(0, 1), Sensor(20000, dark=1e6)),
    (Pdf.uniform(0, 1), Sensor(1e-3, read=1000)),
    (Pdf.segments([0, 0.5], [0.1, 1], [0.9, 0.1]), Sensor(2000, dark=1e4, read=30)),
]


@pytest.mark.parametrize(("pdf", "sensor"), HIDDEN)
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_signal_that_noise_hides_keeps_its_certificate(pdf, sensor, gap):
    """No larger than the candidates' ratio squared less 1, and no schedule tried exceeds it."""
    start = first_capture_time(pdf, sensor)
    limits = Constraints(min_gap=gap * start)
    found = optimal_schedules(pdf, [3], sensor, limits)[3]
    # half of the candidates are geometric, and those near 0 are cut at 1e-9 of the pixels
    assert found.gap <= (1e9 ** (2 * 2 / candidates.SIZE) - 1) * 1.05
    last = sensor.well / max(sensor.dark, 1e-6)
    tried = np.concatenate([np.geomspace(start, last, 15), np.linspace(start, last, 15)])
    spaced = [start + gap * start, start + 2 * gap * start]
    best = brute_force(pdf, np.unique([*tried, *spaced, *found.times]), 3, sensor, gap * start)
    assert best <= found.expected_snr * (1 + found.gap + 1e-12)


def test_segments_as_narrow_as_rounding_are_seen():
    """well / t - dark falls short of the end of such a segment by more than its width."""
    pdf = Pdf.histogram([0.5, np.nextafter(0.5, 1), 0.9, np.nextafter(0.9, 1)], [3, 0, 2])
    found = optimal_schedules(pdf, [1, 2], NOISY)
    chains = best_chains(pdf, found[2].times, NOISY, Constraints(), 2)
    for count in (1, 2):
        assert chains.value(count) == pytest.approx(found[count].expected_snr, rel=1e-9)
        levels = optimal_schedules(Pdf.levels([0.5, 0.9], [3, 2]), [count], NOISY)[count]
        assert found[count].expected_snr == pytest.approx(levels.expected_snr, rel=1e-9)
