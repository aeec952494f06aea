"""The optimum for shot noise alone: independent values, closed form, brute force, certificate."""

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from vcam_cli.scheduling import shot_noise, shot_noise_grid
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.shot_noise import local_maximum, objective_value, optimal_schedules
from vcam_cli.scheduling.shot_noise_grid import best_captures, concave_hull, photocurrent_grid

DATA = Path(__file__).parents[1] / "data" / "capture_schedules_shot_noise.json"
VALUES = json.loads(DATA.read_text("utf-8"))
TWENTY = range(1, 21)

HARD = {
    "atoms": Pdf.segments([0.1, 0.5, 1 - 1e-12], [0.1 + 1e-12, 0.5 + 1e-12, 1], [1, 1, 1]),
    "atom in a broad scene": Pdf.segments([0, 0.5, 0.9], [0.4, 0.5 + 1e-12, 1], [1, 1, 1]),
    "eight decades": Pdf.segments(
        np.geomspace(1e-8, 0.1, 8), np.append(np.geomspace(1e-7, 0.1, 7), 1.0), np.ones(8)
    ),
    "half in the dark": Pdf.segments([0, 1e-8], [1e-8, 1], [1, 1]),
    "bright tip": Pdf.segments([0, 0.9999e8], [1, 1e8], [1 - 1e-6, 1e-6]),
    "improbable": Pdf.segments([0, 0.5, 3, 10], [0.3, 1, 4, 11], [1e-12, 1, 1e-12, 1e-12]),
    "next to impossible": Pdf.segments([0, 0.5, 3, 10], [0.3, 1, 4, 11], [1e-30, 1, 1e-30, 1e-30]),
    "almost from 0": Pdf.uniform(1e-300, 1),
    "small units": Pdf.uniform(1e-201, 1e-200),
    "large units": Pdf.uniform(1e199, 1e200),
    "many bins": Pdf.histogram(np.linspace(0, 1, 1025), np.random.default_rng(0).pareto(0.7, 1024)),
}


def pdf_of(case):
    if "levels" in case:
        return Pdf.levels(case["levels"], case["weights"])
    return Pdf.segments(*np.array(case["segments"]).T)


def best_of_all(levels, weights, count):
    """The best subset of at most `count` levels, its J and its photocurrents, by trying all."""
    pdf = Pdf.levels(levels, weights)
    useful = sorted((level for level in levels if level > 0), reverse=True)
    found = (0.0, ())
    for others in combinations(useful[1:], min(count, len(useful)) - 1):
        captures = (useful[0], *others)
        value = expected_snr(pdf, 1 / np.array(captures))
        # equal but for rounding: the brighter last capture is the shorter schedule
        if value > found[0] + 1e-13 or (value > found[0] - 1e-13 and captures > found[1]):
            found = (value, captures)
    return found


@st.composite
def level_sets(draw):
    levels = draw(st.lists(st.integers(0, 60), min_size=2, max_size=9, unique=True))
    weights = draw(st.lists(st.integers(1, 9), min_size=len(levels), max_size=len(levels)))
    return [float(level) for level in levels], [float(weight) for weight in weights]


@st.composite
def segment_sets(draw):
    widths = draw(st.lists(st.floats(0.02, 1), min_size=1, max_size=5))
    gaps = draw(st.lists(st.sampled_from([0.0, 0.1, 1.0]), min_size=5, max_size=5))
    weights = draw(st.lists(st.floats(0.01, 1), min_size=len(widths), max_size=len(widths)))
    ends = np.cumsum([part for pair in zip(gaps, widths, strict=False) for part in pair])
    low = np.append(gaps[0], ends[1:-1:2] + gaps[1 : len(widths)])
    return Pdf.segments(low, ends[1::2], weights)


@pytest.mark.parametrize("case", VALUES["cases"], ids=lambda case: case["name"])
def test_independent_optima(case):
    pdf = pdf_of(case)
    found = optimal_schedules(pdf, [result["count"] for result in case["results"]])
    for result in case["results"]:
        schedule = found[result["count"]]
        gain = schedule.expected_snr * pdf.max / pdf.mean
        assert gain == pytest.approx(result["gain"], rel=1e-9)  # as the values are given
        used = len(result["photocurrents"])
        # J is flat at its top: 1e-9 of it is some 3e-5 of a capture; Newton ends at rounding
        assert schedule.photocurrents[:used] == pytest.approx(result["photocurrents"], rel=1e-8)
        assert schedule.photocurrents.size == result["count"]
        assert schedule.gap is not None
        assert result["J"] / schedule.expected_snr - 1 <= schedule.gap + 1e-14  # rounding
        assert schedule.gap <= 1e-6


@pytest.mark.parametrize("entry", VALUES["table41"]["entries"], ids=lambda e: str(e["count"]))
def test_table_4_1_to_every_printed_digit(entry):
    misprints = {(m["count"], m["capture"]): m for m in VALUES["table41"]["misprints"]}
    schedule = optimal_schedules(Pdf.uniform(0, 1), [entry["count"]])[entry["count"]]
    ratios = schedule.times[1:] / schedule.times[0]
    assert ratios == pytest.approx(entry["exact"], rel=1e-9)
    for capture, (ratio, printed) in enumerate(zip(ratios, entry["printed"], strict=True), start=2):
        digits = len(printed.partition(".")[2])
        if (entry["count"], capture) in misprints:
            assert f"{ratio:.{digits}f}" != printed
        else:
            assert f"{ratio:.{digits}f}" == printed
    assert len(misprints) == 3


def test_uniform_from_0_is_the_recurrence():
    v = [0.5]
    while len(v) < 40:
        v.append((1 + v[-1] ** 2) / 2)
    found = optimal_schedules(Pdf.uniform(0, 1), range(1, 41))
    for count, schedule in found.items():
        assert schedule.expected_snr == pytest.approx(v[count - 1], rel=1e-13)
        ratios = schedule.photocurrents[1:] / schedule.photocurrents[:-1]
        assert ratios == pytest.approx([v[count - 1 - k] for k in range(1, count)], rel=1e-7)


def test_uniform_above_0_is_the_recurrence_too():
    """x_N = imin / i_N and x_{k-1} = (1 + x_k^2) / 2; their product is imin / imax."""
    for count in (2, 5, 12):
        captures = optimal_schedules(Pdf.uniform(0.1, 1), [count])[count].photocurrents
        ratios = np.append(captures, 0.1)[1:] / captures
        assert ratios[:-1] == pytest.approx((1 + ratios[1:] ** 2) / 2, rel=1e-9)


@examples(120)
@given(level_sets(), st.integers(1, 7))
def test_levels_agree_with_all_subsets(levels, count):
    values, weights = levels
    expected, captures = best_of_all(values, weights, count)
    schedule = optimal_schedules(Pdf.levels(values, weights), [count])[count]
    assert schedule.expected_snr == pytest.approx(expected, rel=1e-12)
    assert schedule.gap == 0.0
    filled = [*captures, *[captures[-1]] * (count - len(captures))]
    assert schedule.photocurrents == pytest.approx(filled, rel=1e-14)


@examples(60)
@given(segment_sets(), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_no_random_schedule_beats_the_optimum(pdf, count, seed):
    schedule = optimal_schedules(pdf, [count])[count]
    assert schedule.gap <= 1e-6
    bound = schedule.expected_snr * (1 + schedule.gap)
    rng = np.random.default_rng(seed)
    edges = np.concatenate([pdf.low, pdf.high])
    for _ in range(30):
        others = rng.choice([*edges[edges > 0], *rng.uniform(pdf.min, pdf.max, 20)], count - 1)
        near = schedule.photocurrents[1:] * rng.normal(1, 1e-3, count - 1)
        for captures in (others, near):
            times = 1 / np.append(pdf.max, captures)
            assert expected_snr(pdf, times) <= bound + 1e-15


@settings(max_examples=15, deadline=None)
@given(segment_sets())
def test_the_value_rises_ever_less_with_captures(pdf):
    found = optimal_schedules(pdf, range(1, 10))
    values = np.array([schedule.expected_snr for schedule in found.values()])
    assert np.all(np.diff(values) >= -1e-14)
    # the optimum itself is concave in N, and each value is within its gap
    assert np.all(np.diff(values, 2) <= 4e-6 * values[-1])
    assert values[-1] <= 1 + 1e-12


@settings(max_examples=25, deadline=None)
@given(level_sets())
def test_the_value_over_levels_is_concave(levels):
    found = optimal_schedules(Pdf.levels(*levels), range(1, 9))
    values = [schedule.expected_snr for schedule in found.values()]
    assert np.all(np.diff(values, 2) <= 1e-13)


@pytest.mark.parametrize("unit", [1e-19, 1e-3, 6e18])
def test_the_unit_of_photocurrents_does_not_matter(unit):
    for pdf, scaled in (
        (Pdf.segments([0, 2, 5], [1, 3, 9], [3, 1, 1]), [0, 2, 5]),
        (Pdf.levels([1.0, 2.0, 5.0], [3, 1, 1]), None),
    ):
        other = (
            Pdf.levels(pdf.low * unit, pdf.probability)
            if scaled is None
            else Pdf.segments(pdf.low * unit, pdf.high * unit, pdf.probability)
        )
        one, two = optimal_schedules(pdf, [2, 6]), optimal_schedules(other, [2, 6])
        for count in one:
            assert two[count].expected_snr == pytest.approx(one[count].expected_snr, rel=1e-12)
            assert two[count].times * unit == pytest.approx(one[count].times, rel=1e-7)


@pytest.mark.parametrize("name", HARD)
def test_hard_scenes_are_finite_and_certified(name):
    pdf = HARD[name]
    found = optimal_schedules(pdf, TWENTY)
    values = np.array([schedule.expected_snr for schedule in found.values()])
    assert np.isfinite(values).all()
    assert np.all(np.diff(values) >= -1e-12)
    assert values[-1] <= 1 + 1e-11
    for count, schedule in found.items():
        assert 0 <= schedule.gap <= 1e-6
        assert np.isfinite(schedule.times).all()
        assert (schedule.times > 0).all()
        assert np.all(np.diff(schedule.times) >= 0)
        assert schedule.photocurrents[0] == pdf.max
        assert schedule.expected_snr == expected_snr(pdf, schedule.times)
        rival = 1 / np.append(pdf.max, np.geomspace(pdf.max, pdf.max * 1e-9, count)[1:])
        assert expected_snr(pdf, rival) <= schedule.expected_snr * (1 + schedule.gap)


def test_three_atoms_need_three_captures():
    found = optimal_schedules(HARD["atoms"], [3])[3]
    assert found.expected_snr == pytest.approx(1.0, rel=1e-11)
    assert found.photocurrents == pytest.approx([1, 0.5, 0.1], rel=2e-11)  # upper ends


def test_a_finer_grid_tightens_the_certificate():
    pdf = Pdf.segments([0.0, 0.3], [0.2, 1.0], [0.7, 0.3])
    coarse, fine = (optimal_schedules(pdf, [5], gap)[5] for gap in (1e-4, 1e-8))
    assert fine.gap < 1e-8 < coarse.gap < 1e-4
    assert coarse.expected_snr == pytest.approx(fine.expected_snr, rel=1e-12)


@settings(max_examples=40, deadline=None)
@given(segment_sets(), st.integers(2, 6), st.sampled_from([1e-2, 1e-3, 1e-4]))
def test_the_grids_bound_holds(pdf, count, loss):
    chosen = photocurrent_grid(pdf, loss, loss)
    chains = best_captures(chosen.points, pdf.first_moment(chosen.points), count)
    on_grid = objective_value(pdf, chosen.points[chains[-1]])
    best = optimal_schedules(pdf, [count])[count].expected_snr
    assert on_grid <= best * (1 + 1e-6)
    assert best <= chosen.bound(on_grid, count)
    assert np.isin(pdf.high[pdf.high > chosen.points[0]], chosen.points).all()
    # the steps of the root overshoot the loss asked for by their second order
    assert chosen.loss <= loss * 2


def test_captures_beyond_the_levels_repeat_the_last():
    schedule = optimal_schedules(Pdf.levels([0.0, 1.0, 2.0], [5, 1, 1]), [5])[5]
    assert schedule.photocurrents.tolist() == [2, 1, 1, 1, 1]
    assert schedule.expected_snr == pytest.approx(2 / 7)  # black has no SNR
    assert schedule.distinct_captures == 2


def test_of_equal_schedules_the_shorter_is_chosen():
    # A second capture at 2 is worth (2 w_2 + w_1) / 2, at 1 it is w_1 + w_2 2 / 4: equal weights.
    pdf = Pdf.levels([1.0, 2.0, 4.0], [1.0, 1.0, 3.0])
    both = [expected_snr(pdf, [0.25, 1 / second]) for second in (2.0, 1.0)]
    assert both[0] == pytest.approx(both[1], rel=1e-14)
    assert optimal_schedules(pdf, [2])[2].photocurrents.tolist() == [4.0, 2.0]


def test_rounding_does_not_break_a_tie():
    for unit in np.random.default_rng(2).uniform(0.1, 9, 100):
        pdf = Pdf.levels(unit * np.array([0.1, 0.2, 0.4]), [0.1, 0.1, 0.3])
        assert optimal_schedules(pdf, [2])[2].photocurrents[-1] == unit * 0.2


def test_a_capture_climbs_over_an_edge_where_the_density_rises():
    pdf = Pdf.segments([0.0, 0.3], [0.3, 1.0], [0.1, 0.9])
    found = local_maximum(pdf, np.array([1.0, 0.3]))
    best = optimal_schedules(pdf, [2])[2].photocurrents
    assert best[1] > 0.31
    assert found == pytest.approx(best, rel=1e-9)


def test_a_dark_end_left_out_is_in_the_bound():
    pdf = Pdf.uniform(0, 1)
    chosen = photocurrent_grid(pdf, 1e-7, 0.3)
    chains = best_captures(chosen.points, pdf.first_moment(chosen.points), 6)
    on_grid = objective_value(pdf, chosen.points[chains[-1]])
    best = optimal_schedules(pdf, [6])[6].expected_snr  # its last capture is at 0.125
    assert chosen.bound(on_grid, 6) - chosen.below < best <= chosen.bound(on_grid, 6)


def test_without_polish_the_gap_still_holds(monkeypatch):
    pdf = Pdf.segments([0.0, 0.3], [0.3, 1.0], [0.6, 0.4])
    best = optimal_schedules(pdf, TWENTY)
    monkeypatch.setattr(shot_noise, "local_maximum", lambda pdf, captures: captures)
    for count, schedule in optimal_schedules(pdf, TWENTY, gap=1e-2).items():
        short = best[count].expected_snr / schedule.expected_snr - 1
        assert -1e-14 <= short <= schedule.gap <= 1e-2


def test_counts_come_back_in_their_order_and_must_be_counts():
    assert list(optimal_schedules(Pdf.uniform(0, 1), [4, 2, 3])) == [4, 2, 3]
    assert optimal_schedules(Pdf.uniform(0, 1), []) == {}
    for wrong in ([0], [2, -1], [1.5]):
        with pytest.raises(ValueError, match="captures"):
            optimal_schedules(Pdf.uniform(0, 1), wrong)


@pytest.mark.parametrize("kind", ["noise", "arcs", "concave", "line", "heavy tail"])
def test_the_hull_is_that_of_a_sweep(kind):
    rng = np.random.default_rng(3)
    m = np.cumsum(rng.uniform(0.1, 1, 3000))
    v = {
        "noise": rng.random(3000),
        "arcs": np.sqrt(m % 300) + np.sqrt(m),  # concave arcs with a drop after each
        "concave": np.sqrt(m),
        "line": np.repeat([0.0, 1.0], 1500),
        "heavy tail": rng.pareto(0.5, 3000),
    }[kind]
    swept = shot_noise_grid._swept_hull(m, v, np.arange(m.size))
    assert concave_hull(m, v).tolist() == swept.tolist()


def test_a_hull_of_many_dents_is_swept_and_few_are_bridged(monkeypatch):
    m = np.cumsum(np.random.default_rng(4).uniform(0.1, 1, 5000))
    v = np.sqrt(m % 300) + np.sqrt(m)
    expected = shot_noise_grid._swept_hull(m, v, np.arange(m.size)).tolist()
    monkeypatch.setattr(shot_noise_grid, "POINTS_PER_BRIDGE", 1)
    assert concave_hull(m, v).tolist() == expected
    monkeypatch.setattr(shot_noise_grid, "POINTS_PER_BRIDGE", 10**9)
    monkeypatch.setattr(shot_noise_grid, "ROUNDS", 1)
    assert concave_hull(m, v).tolist() == expected
