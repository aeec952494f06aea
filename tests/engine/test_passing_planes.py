"""Planes that pass one by one give the light of planes that are held together."""

import numpy as np
import pytest

from vcam_cli import load
from vcam_cli.engine import coefficients, few_rows
from vcam_cli.engine.coefficients import OfRuns, passes
from vcam_cli.studies.simulate import prepare


@pytest.fixture(scope="module")
def still_life():
    camera = load("still-life")
    small = camera.array.model_copy(update={"rows": 48, "columns": 64})
    # As fine however it is painted: what is lost is a guess, from rows that may be others.
    accuracy = camera.accuracy.model_copy(update={"oversampling": 10})
    return camera.model_copy(update={"array": small, "accuracy": accuracy})


def test_light_is_the_same_one_by_one(still_life, monkeypatch):
    together, _ = prepare(still_life, workers=2)
    assert together.spectrum.planes > 1
    monkeypatch.setattr(coefficients, "HELD", 1)
    alone, _ = prepare(still_life, workers=2)
    again, _ = prepare(still_life, workers=1)
    assert alone.spectrum.held * together.spectrum.planes == together.spectrum.held
    # A stretch of rows is interpolated where all planes that are there allow it, and read where
    # one does not: both are within half an entry of a table, 2e-5 of what a term adds.
    largest = together.rate.max()
    np.testing.assert_allclose(alone.rate, together.rate, atol=5e-6 * largest, rtol=0)
    np.testing.assert_array_equal(alone.rate, again.rate)
    # Each looks at rows of its own, of which the promise is a tenth; and so much is what they miss.
    monkeypatch.setattr(few_rows, "FIRST", 1 << 20)
    every, _ = prepare(still_life, workers=2)
    assert every.spectrum.looked > 2 * alone.spectrum.looked
    for some in (together, alone):
        assert some.spectrum.lost == pytest.approx(every.spectrum.lost, rel=0.1)
        assert some.spectrum.changes == pytest.approx(every.spectrum.changes, rel=0.05)


def test_one_plane_has_nobody_to_wait_for():
    assert not passes(1 << 40, 1, 4)
    assert passes(1 << 26, 2, 4) and not passes(1 << 20, 2, 4)


def test_rows_of_runs_are_those_of_all():
    rng = np.random.default_rng(0)
    along, values = rng.random((40, 7)), rng.random((2, 7, 33))
    lazy, index = OfRuns(along, values), np.array([3, 0, 39])
    expected = np.einsum("yd,rdx->ryx", along, values)
    assert lazy.shape == expected.shape
    np.testing.assert_allclose(np.array([plane[index] for plane in lazy]), expected[:, index])
    np.testing.assert_allclose(np.asarray(lazy), expected)
