"""Rows of a spectrum that are looked at, and what they stand for."""

import numpy as np
import pytest

from vcam_cli.engine import few_rows
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import OfRuns


def axis(samples: int, squares: bool = True) -> Axis:
    """Samples of 1 um before as many pixels, followed to twice their Nyquist frequency."""
    return Axis(samples, 1e-6, samples, 1e-6, 0.5e-6, squares, 1e6)


@pytest.mark.parametrize("samples", [1, 2, 7, 30, 500, 4001])
def test_every_row_is_stood_for_once(samples):
    energy = np.random.default_rng(0).exponential(size=samples) ** 4
    y = axis(samples)
    terms, stand_for = few_rows.rows(y, energy)
    index, sign = y.base(np.arange(y.terms))
    own = energy[index] * np.square(sign * y.weights)
    assert (stand_for * own[terms]).sum() == pytest.approx(own.sum())
    assert (np.diff(terms) > 0).all() and terms[0] == 0 and terms[-1] < axis(samples).terms
    most = few_rows.FIRST + few_rows.OTHERS + few_rows.OUTSTANDING
    assert len(terms) == len(stand_for) <= most


def test_what_stands_out_is_looked_at_by_itself():
    energy = np.ones(1000)
    energy[[331, 777]] = 50.0, 1e4
    terms, stand_for = few_rows.rows(axis(1000), energy)
    for row in (331, 777):
        assert stand_for[terms == row].tolist() == [1.0]


@pytest.mark.parametrize("strange", [np.zeros(300), np.full(300, np.inf), np.full(300, np.nan)])
def test_nothing_stands_out_of_nothing(strange):
    terms, stand_for = few_rows.rows(axis(300), strange)
    assert stand_for.sum() == pytest.approx(axis(300).terms)
    assert len(terms) <= few_rows.FIRST + few_rows.OTHERS


def test_energy_of_rows():
    rng = np.random.default_rng(1)
    along, values = rng.normal(size=(50, 3)), rng.normal(size=(2, 3, 70))
    planes = np.einsum("yd,rdx->ryx", along, values)
    expected = np.square(planes).sum(axis=(0, 2))
    np.testing.assert_allclose(few_rows.energy(planes), expected)
    np.testing.assert_allclose(few_rows.energy(OfRuns(along, values)), expected)
