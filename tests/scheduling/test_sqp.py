"""The thesis's search: it fails over all photocurrents at once, not over every assignment."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vcam_cli.scheduling.comparison_schedules import heuristic_photocurrents
from vcam_cli.scheduling.local_search import (
    assigned_schedule,
    assignment_count,
    objective_and_gradient,
    sqp_schedule,
)
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.shot_noise import optimal_schedules

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_rules.json").read_text())
THREE_SEGMENTS = "three_segment_fig45"
TEN_STARTS = range(10)
"""As many as the thesis took."""


def case(name, count):
    found = DATA["cases"][name]
    row = next(row for row in found["results"] if row["count"] == count)
    return Pdf.segments(*np.array(found["segments"]).T), row["optimal"]


pdfs = st.builds(
    lambda edges, shares: Pdf.segments(np.sort(edges)[::2], np.sort(edges)[1::2], shares),
    st.lists(st.integers(0, 1000), min_size=6, max_size=6, unique=True).map(np.array),
    st.lists(st.floats(0.01, 1.0), min_size=3, max_size=3),
)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 8, 10, 20])
@pytest.mark.parametrize("name", ["uniform_0_1", "uniform_0.1_1"])
def test_one_start_is_enough_for_a_uniform_pdf(name, count):
    pdf, optimal = case(name, count)
    found = sqp_schedule(pdf, count, seed=count)
    # the search ends where J rises by less than 1e-12; the optimum is flat
    assert found.expected_snr == pytest.approx(optimal["J"], rel=1e-9)
    np.testing.assert_allclose(found.times / found.times[0], optimal["t"], rtol=2e-3)


def test_ten_random_starts_miss_the_optimum_of_three_segments():
    """The optimum is 0.7863; the best of the thesis's ten starts stays 5 % below it.

    In which of many local optima a start ends depends on how the machine rounds: the best that
    any of them was seen to reach, 0.7497, is 4.7 % below the optimum.
    """
    pdf, optimal = case(THREE_SEGMENTS, 8)
    assert optimal["J"] == pytest.approx(0.7863380, abs=1e-7)
    found = [sqp_schedule(pdf, 8, seed=seed).expected_snr for seed in TEN_STARTS]
    assert max(found) < 0.96 * optimal["J"]
    assert max(found) - min(found) > 0.01  # nor do they agree


@pytest.mark.parametrize(
    ("name", "count"),
    [(THREE_SEGMENTS, 4), (THREE_SEGMENTS, 8), ("trap_2seg_N2", 2), ("uniform_0_1", 6)],
)
def test_with_captures_assigned_to_segments_one_start_finds_the_optimum(name, count):
    """As the thesis has it, against dynamic programming; see the test above for the difference."""
    pdf, optimal = case(name, count)
    for seed in range(3):
        found = assigned_schedule(pdf, count, seed=seed)
        assert found.expected_snr == pytest.approx(optimal["J"], rel=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_no_assignment_beats_the_global_optimum(data):
    pdf, count = data.draw(pdfs), data.draw(st.integers(1, 4))
    best = optimal_schedules(pdf, [count])[count]
    found = assigned_schedule(pdf, count, starts=2)
    assert found.expected_snr <= best.expected_snr * (1 + best.gap)
    assert found.expected_snr > 0.97 * best.expected_snr
    assert (np.diff(found.times) >= 0).all()


@pytest.mark.parametrize(("count", "ways"), [(1, 1), (2, 3), (8, 36), (20, 210)])
def test_ways_to_assign_captures_to_three_segments(count, ways):
    """Of N captures one is in the brightest segment: (N + 1) N / 2 ways for the others."""
    pdf, _ = case(THREE_SEGMENTS, 8)
    assert assignment_count(pdf, count) == ways == (count + 1) * count // 2
    gap = Pdf.segments([0, 1, 2, 3], [1, 2, 3, 4], [0.5, 0, 0.3, 0.2])  # holds no captures
    assert assignment_count(gap, count) == ways


def test_a_bad_start_stays_with_its_captures():
    """All but the first in the dark segment: one leaves it, where the optimum has two."""
    pdf, optimal = case(THREE_SEGMENTS, 8)
    start = np.append(1.0, np.linspace(0.07, 0.004, 7))
    found = sqp_schedule(pdf, 8, start=start)
    assert found.expected_snr < 0.99 * optimal["J"]
    for photocurrents, expected in ((found.photocurrents, 1), (1 / np.array(optimal["t"]), 2)):
        assert ((photocurrents > 0.0801) & (photocurrents < 0.4001)).sum() == expected


def test_from_the_heuristic_it_finds_the_optimum_of_three_segments():
    """The method is no worse than the thesis's: its start decides."""
    pdf, optimal = case(THREE_SEGMENTS, 8)
    found = sqp_schedule(pdf, 8, start=heuristic_photocurrents(pdf, 8))
    assert found.expected_snr == pytest.approx(optimal["J"], rel=1e-8)


def test_the_trap_of_two_segments():
    """Two captures: one local maximum in each segment, and starts that end in either."""
    pdf, optimal = case("trap_2seg_N2", 2)
    found = np.array([sqp_schedule(pdf, 2, seed=seed).expected_snr for seed in TEN_STARTS])
    best = np.isclose(found, optimal["J"], rtol=1e-9)
    assert best.any()
    assert (found[~best] < 0.91 * optimal["J"]).all()
    assert (~best).any()


@settings(max_examples=30, deadline=None)
@given(pdfs, st.integers(1, 7), st.integers(0, 100))
def test_gradient_is_that_of_the_objective(pdf, count, seed):
    rng = np.random.default_rng(seed)
    i = np.append(pdf.max, np.sort(rng.uniform(pdf.min + 0.1, pdf.max - 0.1, count - 1))[::-1])
    value, gradient = objective_and_gradient(pdf, i)
    assert value == pytest.approx(expected_snr(pdf, 1 / i), rel=1e-11)
    edges = np.concatenate([pdf.low, pdf.high])
    step = 1e-6
    for k in range(1, count):
        if np.abs(edges - i[k]).min() < step or np.diff(-i).min() < step:
            continue  # the derivative jumps there
        moved = [
            objective_and_gradient(pdf, i + side * step * np.eye(count)[k])[0] for side in (1, -1)
        ]
        numeric = (moved[0] - moved[1]) / (2 * step)
        # differences of J of about 1 lose 1e-16 / 1e-6, and the curvature's share
        assert gradient[k] == pytest.approx(numeric, rel=1e-4, abs=1e-8)


@settings(max_examples=10, deadline=None)
@given(pdfs, st.integers(1, 6), st.integers(0, 100))
def test_it_is_a_schedule_no_worse_than_its_start(pdf, count, seed):
    start = np.random.default_rng(seed).uniform(0, pdf.max, count)
    begin = np.maximum(np.sort(start)[::-1], pdf.min if pdf.min else 1e-3)
    begin[0] = pdf.max
    found = sqp_schedule(pdf, count, start=start)
    assert found.times.shape == (count,)
    assert found.photocurrents[0] == pytest.approx(pdf.max)
    assert (np.diff(found.times) >= 0).all()
    assert expected_snr(pdf, 1 / begin) - 1e-12 <= found.expected_snr <= 1 + 1e-11
    assert found.gap is None


def test_wide_ranges_and_dark_ends():
    for pdf in (Pdf.uniform(1e-8, 1), Pdf.segments([0, 0.5], [1e-6, 1], [0.5, 0.5])):
        found = sqp_schedule(pdf, 6, seed=3)
        assert np.isfinite(found.times).all()
        assert 0 < found.expected_snr <= 1 + 1e-11


def test_the_seed_decides():
    pdf, _ = case(THREE_SEGMENTS, 6)
    first, again, other = (sqp_schedule(pdf, 6, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.times, again.times)
    assert not np.array_equal(first.times, other.times)


def test_what_it_cannot_do():
    with pytest.raises(ValueError, match="segments, not levels"):
        sqp_schedule(Pdf.levels([1, 2], [1, 1]), 2)
    with pytest.raises(ValueError, match="at least one"):
        sqp_schedule(Pdf.uniform(0, 1), 0)
    with pytest.raises(ValueError, match="at least one start"):
        assigned_schedule(Pdf.uniform(0, 1), 2, starts=0)
    with pytest.raises(ValueError, match="needs 3"):
        sqp_schedule(Pdf.uniform(0, 1), 3, start=[1.0, 0.5])
