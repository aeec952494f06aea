"""The heuristic schedule, against values worked out apart and the thesis's rules."""

import json
from fractions import Fraction
from math import ceil, floor
from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.scheduling.comparison_schedules import (
    captures_per_segment,
    heuristic_photocurrents,
)
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_rules.json").read_text())
CASES = [(name, row) for name, case in DATA["cases"].items() for row in case["results"]]


def pdf_of(segments):
    return Pdf.segments(*np.array(segments).T)


@pytest.mark.parametrize("name", DATA["heuristic"])
def test_examples(name):
    example = DATA["heuristic"][name]
    found = heuristic_photocurrents(pdf_of(example["segments"]), example["count"])
    np.testing.assert_allclose(found, example["photocurrents"], rtol=1e-14)
    shares = np.array(example["segments"])[::-1, 2]
    assert captures_per_segment(shares, example["count"]) == example["captures"]


@pytest.mark.parametrize(("name", "row"), CASES, ids=lambda value: str(value)[:20])
def test_schedules_of_whole_cases(name, row):
    pdf, expected = pdf_of(DATA["cases"][name]["segments"]), row["heuristic"]
    found = heuristic_photocurrents(pdf, row["count"])
    np.testing.assert_allclose(pdf.max / found, expected["t"], rtol=1e-12)
    # times a rounding error above 1 / i are not saturated: a slack of 1e-12
    assert expected_snr(pdf, 1 / found) == pytest.approx(expected["J"], rel=1e-11)


def exact_counts(shares, count):
    """The thesis's rules in rational arithmetic."""
    total, counts = sum(shares), []
    for s, share in enumerate(shares):
        if s == 0:
            counts.append(ceil(Fraction(share * count, total)))
        else:
            left = count - sum(counts)
            counts.append(floor(Fraction(left * share, sum(shares[s:])) + Fraction(1, 2)))
    return counts


@examples(150)
@given(st.lists(st.integers(1, 40), min_size=1, max_size=6), st.integers(1, 200))
def test_counts_are_those_of_exact_arithmetic(shares, count):
    """Small whole shares have many ties; normalized they are all off by rounding errors."""
    probability = np.array(shares) / sum(shares)
    assert captures_per_segment(probability, count) == exact_counts(shares, count)


@examples(60)
@given(
    st.lists(st.floats(1e-12, 1.0), min_size=1, max_size=6),
    st.lists(st.floats(1e-8, 1.0), min_size=12, max_size=12, unique=True),
    st.integers(1, 60),
)
def test_every_schedule_is_one(shares, edges, count):
    edges = np.sort(edges)[: 2 * len(shares)]
    if (np.diff(edges) < 1e-12).any():
        return
    pdf = Pdf.segments(edges[::2], edges[1::2], shares)
    found = heuristic_photocurrents(pdf, count)
    assert found.shape == (count,)
    assert found[0] == pdf.max
    assert (np.diff(found) < 0).all()
    assert (found > pdf.min).all()


def test_segments_without_probability_are_dropped():
    full = Pdf.segments([0, 0.1, 0.4, 0.8, 0.9], [0.1, 0.4, 0.5, 0.9, 1.0], [0.0, 1, 0, 1, 0])
    bare = Pdf.segments([0.1, 0.8], [0.4, 0.9], [1, 1])
    for count in range(1, 12):
        np.testing.assert_array_equal(
            heuristic_photocurrents(full, count), heuristic_photocurrents(bare, count)
        )


def test_a_bright_segment_of_next_to_no_probability_still_has_the_first_capture():
    pdf = Pdf.segments([0, 0.9], [0.5, 1.0], [1.0, 1e-14])
    np.testing.assert_allclose(heuristic_photocurrents(pdf, 1), [1.0])
    np.testing.assert_allclose(heuristic_photocurrents(pdf, 3), [1.0, 0.5, 0.25])


def test_what_it_cannot_do():
    with pytest.raises(ValueError, match="segments, not levels"):
        heuristic_photocurrents(Pdf.levels([1, 2], [1, 1]), 2)
    with pytest.raises(ValueError, match="at least one"):
        heuristic_photocurrents(Pdf.uniform(0, 1), 0)
