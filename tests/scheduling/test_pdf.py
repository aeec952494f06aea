"""Pdfs of photocurrents, against plain sums and quadrature, and what they refuse."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.scheduling.pdf import Pdf

HALVES = Pdf.segments([0.0, 0.3, 0.6], [0.3, 0.6, 1.0], [4.0, 0.0, 1.0])


def test_uniform_has_the_moments_of_the_square():
    pdf = Pdf.uniform(1, 3)
    at = np.array([0.0, 1.0, 2.0, 3.0, 9.0])
    assert pdf.cdf(at) == pytest.approx([0, 0, 0.5, 1, 1], abs=1e-15)
    assert pdf.first_moment(at) == pytest.approx([0, 0, 0.75, 2, 2], abs=1e-15)
    assert (pdf.min, pdf.max, pdf.mean, pdf.discrete) == (1, 3, 2, False)


def test_probabilities_are_normalized_and_gaps_hold_nothing():
    assert HALVES.probability == pytest.approx([0.8, 0, 0.2])
    assert HALVES.cdf([0.3, 0.45, 0.6, 0.8]) == pytest.approx([0.8, 0.8, 0.8, 0.9])
    assert HALVES.mean == pytest.approx(0.8 * 0.15 + 0.2 * 0.8)


def test_segments_of_no_probability_are_not_the_brightest_nor_the_darkest():
    pdf = Pdf.segments([0, 1, 2], [1, 2, 3], [0, 1, 0])
    assert (pdf.min, pdf.max) == (1, 2)
    assert Pdf.levels([0.0, 1.0, 7.0], [1, 1, 0]).max == 1


def test_levels_count_from_the_level_on():
    pdf = Pdf.levels([4.0, 1.0, 2.0, 1.0], [1, 1, 1, 1])  # any order, repeated
    assert pdf.discrete
    assert pdf.low.tolist() == [1, 2, 4]
    assert pdf.cdf([0.9, 1, 1.9, 4, 5]) == pytest.approx([0, 0.5, 0.5, 1, 1])
    assert pdf.first_moment([0.9, 1, 2, 4]) == pytest.approx([0, 0.5, 1.0, 2.0])


def test_a_histogram_is_its_segments():
    pdf = Pdf.histogram([0, 1, 3], [1, 3])
    assert pdf.density == pytest.approx([0.25, 0.375])
    assert pdf.high.tolist() == [1, 3]


@examples(50)
@given(st.lists(st.tuples(st.floats(0.01, 5), st.floats(0, 1)), min_size=1, max_size=6))
def test_moments_are_the_integrals_of_the_density(parts):
    widths, weights = np.array(parts).T
    if weights.sum() < 1e-3:
        weights = weights + 1
    pdf = Pdf.histogram(np.concatenate([[0.2], 0.2 + np.cumsum(widths)]), weights)
    x = 0.2 + 0.7 * widths.sum()
    steps = np.linspace(0.2, x, 20001)
    middle = (steps[1:] + steps[:-1]) / 2
    density = pdf.density[np.searchsorted(pdf.high, middle, side="right")]
    # of 20000 steps one or a few hold an edge, where the middle's density is not the mean's
    off = 6 * (x - 0.2) / 20000 * density.max() * x
    assert pdf.cdf(x) == pytest.approx(np.sum(density) * (x - 0.2) / 20000, abs=off)
    moment = np.sum(density * middle) * (x - 0.2) / 20000
    assert pdf.first_moment(x) == pytest.approx(moment, abs=off)


def test_the_dark_end_of_a_wide_range_keeps_its_digits():
    pdf = Pdf.segments([1e-8, 0.5], [2e-8, 1.0], [0.5, 0.5])
    inside = pdf.first_moment(2e-8) - pdf.first_moment(1.5e-8)
    assert inside == pytest.approx(0.25 * 1.75e-8, rel=1e-13)


@pytest.mark.parametrize(
    ("low", "high", "probability", "says"),
    [
        ([], [], [], "empty"),
        ([0], [1], [0], "all probabilities are zero"),
        ([0], [1], [-1], "not be negative"),
        ([-1], [1], [1], "not be negative"),
        ([0], [np.inf], [1], "finite"),
        ([0], [1], [np.nan], "finite"),
        ([0, 0.5], [0.6, 1], [1, 1], "overlap"),
        ([0.5, 0], [1, 0.5], [1, 1], "ascend"),
        ([1], [0], [1], "below its min"),
        ([0, 1], [1, 1], [1, 1], "not both"),
        ([2, 1], [2, 1], [1, 1], "rise"),
        ([0], [0], [1], "no photocurrent is above 0"),
        ([0, 1], [1, 2], [1], "as many probabilities"),
    ],
)
def test_what_is_no_pdf_is_refused(low, high, probability, says):
    with pytest.raises(ValueError, match=says):
        Pdf(np.array(low, float), np.array(high, float), np.array(probability, float))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: Pdf.uniform(1, 1), "above its min"),
        (lambda: Pdf.segments([0, 1], [1, 1], [1, 1]), "above its min"),
        (lambda: Pdf.levels([0.0], [1]), "no photocurrent is above 0"),
        (lambda: Pdf.levels([1.0, 2.0], [1]), "as many weights"),
        (lambda: Pdf.levels([], []), "empty"),
        (lambda: Pdf.levels([1.0], [0]), "zero"),
        (lambda: Pdf.histogram([1.0], []), "two edges"),
    ],
)
def test_what_makes_no_pdf_is_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()


def test_counts_whose_sum_overflows_are_fine_and_arrays_handed_in_stay():
    counts = np.array([1.7e308, 1.7e308])
    assert Pdf.histogram([0, 1, 2], counts).probability == pytest.approx([0.5, 0.5])
    assert counts.tolist() == [1.7e308, 1.7e308]
    with pytest.raises(ValueError, match="read-only"):
        HALVES.low[0] = 1
