"""Iterative histogram binning, against a version that works out every total anew in fractions."""

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from vcam_cli.scheduling.histogram_binning import (
    _Pairs,
    histogram_of_pdf,
    merge_bins,
    merged_histogram,
)
from vcam_cli.scheduling.pdf import Pdf

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_rules.json").read_text())


def equal(counts):
    """Counts over bins of equal width whose edges have rounding errors, as edges have."""
    return np.linspace(0.1, 0.9, len(counts) + 1), np.array(counts)


def absolute_deviation(counts, widths, groups):
    """Total sum of absolute differences from the mean densities of groups of bins."""
    total = Fraction(0)
    for first, end in groups:
        count, width = sum(counts[first:end]), sum(widths[first:end])
        total += sum(abs(counts[b] - widths[b] * Fraction(count, width)) for b in range(first, end))
    return total


def naive(counts, widths, segments):
    """The thesis's four steps as they stand: every total for every pair, the first of the least."""
    groups = [(b, b + 1) for b in range(len(counts))]
    trace = []
    while len(groups) > segments:
        tried = [
            [*groups[:j], (groups[j][0], groups[j + 1][1]), *groups[j + 2 :]]
            for j in range(len(groups) - 1)
        ]
        totals = [absolute_deviation(counts, widths, one) for one in tried]
        best = totals.index(min(totals))
        trace.append((groups[best][0], groups[best][1], groups[best + 1][1], totals[best]))
        groups = tried[best]
    return groups, trace


def found_merges(trace):
    return [(merge.first, merge.middle, merge.end) for merge in trace]


def check(histogram, counts, widths, segments, scale=1.0):
    pdf, trace = merge_bins(histogram, segments)
    groups, expected = naive(counts, widths, segments)
    assert found_merges(trace) == [merge[:3] for merge in expected]
    sads = [float(merge[3]) * scale for merge in expected]
    np.testing.assert_allclose(
        [m.absolute_deviation for m in trace], sads, rtol=1e-11, atol=1e-12 * scale * sum(counts)
    )
    edges = np.asarray(histogram[0], float)
    np.testing.assert_array_equal(pdf.low, edges[[first for first, _ in groups]])
    np.testing.assert_array_equal(pdf.high, edges[[end for _, end in groups]])
    shares = [sum(counts[first:end]) / sum(counts) for first, end in groups]
    np.testing.assert_allclose(pdf.probability, shares, rtol=1e-12)


@pytest.mark.parametrize("scale", [1, 0.1, 1 / 3e5], ids=["counts", "tenths", "probabilities"])
@pytest.mark.parametrize("name", DATA["binning"])
def test_examples(name, scale):
    """Every step, tie and total; scaled counts are no whole numbers and have the same ties."""
    example = DATA["binning"][name]
    edges, counts = equal(example["counts"])
    pdf, trace = merge_bins((edges, counts * scale), len(example["segments"]))
    assert found_merges(trace) == [tuple(step["merged"]) for step in example["trace"]]
    sads = [step["sad"] * scale for step in example["trace"]]
    np.testing.assert_allclose(
        [merge.absolute_deviation for merge in trace], sads, rtol=1e-13, atol=1e-15
    )
    shape, values = merged_histogram((edges, counts * scale), trace)
    np.testing.assert_array_equal(shape, edges[[0, *(end for _, end in example["segments"])]])
    np.testing.assert_allclose(values, np.array(example["values"]) * scale, rtol=1e-8)
    np.testing.assert_array_equal(pdf.low, shape[:-1])


def test_the_naive_version_knows_the_examples():
    """Its candidates are those worked out apart, so that it is worth comparing with."""
    for example in DATA["binning"].values():
        counts = example["counts"]
        _, trace = naive(counts, [1] * len(counts), len(example["segments"]))
        assert [merge[:3] for merge in trace] == [tuple(s["merged"]) for s in example["trace"]]
        assert float(trace[-1][3]) == pytest.approx(example["sad"], rel=1e-14)


small = st.lists(st.integers(0, 4), min_size=1, max_size=14).filter(any)
"""Ties at almost every step."""
ordinary = st.lists(st.integers(0, 10**6), min_size=1, max_size=14).filter(any)
huge = st.lists(st.integers(0, 20).map(lambda n: n * 2**60), min_size=2, max_size=8).filter(any)


@examples(60)
@given(small | ordinary, st.integers(1, 5))
def test_equal_bins(counts, segments):
    check(equal(counts), counts, [1] * len(counts), segments)


@settings(max_examples=40, deadline=None)
@given(small, st.integers(1, 5))
def test_probabilities_have_the_ties_of_their_counts(counts, segments):
    """Normalized counts differ by rounding errors, which must decide nothing."""
    edges, total = equal(counts)[0], sum(counts)
    check((edges, np.array(counts) / total), counts, [1] * len(counts), segments, 1 / total)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 6), st.integers(1, 4)), min_size=1, max_size=12).filter(
        lambda bins: any(count for count, _ in bins)
    ),
    st.sampled_from([1.0, 0.37]),
    st.integers(1, 4),
)
def test_unequal_bins(pairs, unit, segments):
    """Of densities, by width; widths of 2 and 3 are no multiples and go by floating point."""
    counts, widths = zip(*pairs, strict=True)
    edges = unit * np.concatenate([[0], np.cumsum(widths)])
    check((edges, counts), counts, widths, segments)


def test_a_bin_split_in_two_changes_nothing():
    counts, widths = [4, 1, 9, 3, 3, 8], [1, 2, 1, 3, 2, 1]
    edges = np.concatenate([[0], np.cumsum(widths)])
    fine = np.repeat(np.array(counts) / widths, widths)
    whole, _ = merge_bins((edges, counts), 3)
    split, trace = merge_bins((np.arange(11), fine), 3)
    np.testing.assert_array_equal(whole.low, split.low)
    np.testing.assert_allclose(whole.probability, split.probability, rtol=1e-14)
    assert trace[-1].absolute_deviation == pytest.approx(
        merge_bins((edges, counts), 3)[1][-1].absolute_deviation
    )


@settings(max_examples=20, deadline=None)
@given(huge)
def test_counts_beyond_64_bits(counts):
    check(equal(counts), counts, [1] * len(counts), 2)


def test_a_merge_may_bring_bins_closer():
    """Means are not medians: 5 6 and 1 7 5 differ from theirs by more than all five together."""
    counts = [5, 6, 1, 7, 5]
    check(equal(counts), counts, [1] * 5, 1)
    totals = [merge.absolute_deviation for merge in merge_bins(equal(counts), 1)[1]]
    np.testing.assert_allclose(totals, [1, 3, 23 / 3, 7.6], rtol=1e-14)


def test_many_bins_keep_their_probability_and_their_last_edge():
    counts = np.random.default_rng(5).poisson(1e3 * np.exp(-np.linspace(0, 8, 1024)))
    pdf, trace = merge_bins(equal(counts), 5)
    assert len(trace) == 1019
    assert pdf.low.size == 5
    assert pdf.probability.sum() == pytest.approx(1)
    for low, high, share in zip(pdf.low, pdf.high, pdf.probability, strict=True):
        inside = Pdf.histogram(*equal(counts))
        assert inside.cdf(high) - inside.cdf(low) == pytest.approx(share, abs=1e-12)


def test_as_many_segments_as_bins_or_more_change_nothing():
    pdf, trace = merge_bins(equal([1, 2, 3]), 3)
    assert trace == ()
    np.testing.assert_allclose(pdf.probability, np.array([1, 2, 3]) / 6)
    gaps = Pdf.segments([0, 0.5], [0.2, 1.0], [1, 1])
    assert merge_bins(gaps, 2) == (gaps, ())


def test_a_gap_is_an_empty_bin():
    pdf = Pdf.segments([0.1, 0.5, 0.7], [0.2, 0.7, 1.0], [1, 2, 1])
    edges, counts = histogram_of_pdf(pdf)
    np.testing.assert_allclose(edges, [0.1, 0.2, 0.5, 0.7, 1.0])
    np.testing.assert_allclose(counts, [0.25, 0, 0.5, 0.25])
    # widths in tenths 1 3 2 3: pairs add 2 |c w' - c' w| / (w + w') = 6/4, 12/5, 8/5
    few, trace = merge_bins(pdf, 2)
    assert found_merges(trace)[0] == (0, 1, 2)
    assert few.low.size == 2


def test_levels_become_bins_that_end_at_them():
    edges, counts = histogram_of_pdf(Pdf.levels([2, 3, 7], [1, 1, 2]))
    assert edges.tolist() == [1, 2, 3, 7]
    assert counts.tolist() == [0.25, 0.25, 0.5]
    edges, counts = histogram_of_pdf(Pdf.levels([0, 3, 7], [1, 1, 2]))
    assert edges.tolist() == [0, 3, 7]
    assert counts.tolist() == [0.5, 0.5]
    assert histogram_of_pdf(Pdf.levels([5], [1]))[0].tolist() == [0, 5]
    few, _ = merge_bins(Pdf.levels(np.arange(1, 257), np.arange(256, 0, -1)), 4)
    assert few.max == 256  # the brightest is not saturated, and not taken for brighter
    assert few.low.size == 4


def test_approximation_of_no_merges_is_the_histogram():
    edges, counts = equal([3, 1, 4, 1, 5])
    shape, values = merged_histogram((edges, counts), ())
    np.testing.assert_array_equal(shape, edges)
    np.testing.assert_allclose(values, counts, rtol=1e-12)
    _, densities = merged_histogram(([0, 1, 3], [3, 8]), ())
    assert densities.tolist() == [3, 4]


def test_fractions_that_share_a_float_are_told_apart():
    pairs = _Pairs(6)
    third, more = Fraction(1, 3), Fraction(1, 3) + Fraction(1, 10**40)
    for index, value in enumerate([Fraction(1), more, third, more, third]):
        pairs.put(index, value, 0.0)
    assert float(more) == float(third)
    assert pairs.first_minimum() == 2
    pairs.drop(2)
    assert pairs.first_minimum() == 4
    pairs.drop(4)
    assert pairs.first_minimum() == 1


@pytest.mark.parametrize(
    ("edges", "counts", "segments", "reason"),
    [
        ([0, 1, 2], [1, 1], 0, "at least one segment"),
        ([0, 1, 2], [1, -1], 1, "negative"),
        ([0, 1, 2], [0, 0], 1, "zero"),
        ([0, 2, 1], [1, 1], 1, "min"),
        ([0, 1, 2], [1, np.nan], 1, "finite"),
        ([0, 1, 2], [1, 1, 1], 1, "as many"),
    ],
)
def test_nonsense_is_refused(edges, counts, segments, reason):
    with pytest.raises(ValueError, match=reason):
        merge_bins((edges, counts), segments)
