"""The cosine basis of an axis, against dense sums and exact boxes."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.fft
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.image_formation.cosine_series import Axis, segments


@given(period=st.integers(1, 20), terms=st.integers(1, 120))
def test_segments_fold_every_cosine_right(period, terms):
    i = np.arange(period)
    folded_terms = []
    for basis, term, sign in segments(period, terms):
        for j, k in zip(i[basis], np.arange(terms)[term], strict=True):
            folded = sign * np.cos(np.pi * j * (i + 0.5) / period)
            # arguments reach pi k ~ 400: 1e-12 of rounding
            np.testing.assert_allclose(np.cos(np.pi * k * (i + 0.5) / period), folded, atol=1e-11)
            folded_terms.append(k)
    vanishing = {k for k in range(terms) if k % period == 0 and k // period % 2 == 1}
    assert sorted(folded_terms) == sorted(set(range(terms)) - vanishing)


@given(period=st.integers(1, 20), terms=st.integers(1, 120))
def test_segments_fold_every_sine_right(period, terms):
    i = np.arange(period)
    folded_terms = []
    for basis, term, sign in segments(period, terms, odd=True):
        for j, k in zip(i[basis] + 1, np.arange(terms)[term], strict=True):
            folded = sign * np.sin(np.pi * j * (i + 0.5) / period)
            np.testing.assert_allclose(np.sin(np.pi * k * (i + 0.5) / period), folded, atol=1e-11)
            folded_terms.append(k)
    vanishing = {k for k in range(terms) if k % (2 * period) == 0}
    assert sorted(folded_terms) == sorted(set(range(terms)) - vanishing)


@given(samples=st.integers(1, 12), count=st.integers(1, 90))
def test_coefficients_and_their_continuation_agree_with_the_definition(samples, count):
    values = np.random.default_rng(samples).random((2, samples))
    coefficients = scipy.fft.dct(values, type=2, axis=1)
    axis = Axis(samples, 1.0, samples, 1.0, 0.5, True, count / 2 / samples)
    n = np.arange(samples)
    k = np.arange(count)
    direct = 2 * values @ np.cos(np.pi * np.outer(n + 0.5, k) / samples)
    np.testing.assert_allclose(axis.extend(coefficients, count), direct, atol=1e-10)
    index, sign = axis.coefficient_index(k)
    np.testing.assert_allclose(coefficients[:, index] * sign, direct, atol=1e-10)


AXES = {
    "same pitch": Axis(12, 1.0, 12, 1.0, 0.5, True, 6.0),
    "pixels finer": Axis(7, 3.0, 21, 1.0, 0.5, True, 3.0),
    "pixels coarser": Axis(20, 0.5, 10, 1.0, 0.5, True, 4.0),
    "no common measure": Axis(10, 1.2, 12, 1.0, 0.5, True, 5.0),
    "window inside the scene": Axis(16, 1.0, 10, 1.0, 3.5, True, 5.0),
    "cropped between samples": Axis(11, 1.0, 10, 1.0, 0.75, True, 5.0),
    "detector off center": Axis(12, 1.0, 12, 1.0, 0.3, True, 5.0),
    "irrational pitch": Axis(13, 1.0, 9, np.sqrt(2), 0.2, True, 5.0),
    "one pixel": Axis(1, 1.0, 1, 1.0, 0.5, True, 5.0),
}


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_evaluation_equals_the_direct_sum(name, dtype, odd):
    axis = AXES[name]
    rng = np.random.default_rng(0)
    terms = rng.standard_normal((3, axis.terms)) / (1 + np.arange(axis.terms))
    position = axis.first + np.arange(axis.pixels) * axis.pixel_pitch
    factor = np.where(np.arange(axis.terms) == 0, 1, 2)[:, None]
    k = np.arange(axis.terms)[:, None]
    wave = np.sin if odd else np.cos
    direct = terms @ (factor * wave(np.pi * k * position / axis.length))

    def evaluated(along):
        total = 0
        for odd_pixels, share in axis.pixel_waves(odd):
            some = terms if share is None else terms * share
            folded = axis.fold(some.astype(dtype), odd_pixels)
            folded = folded if along else folded.T.copy()
            total = total + axis.evaluate(folded, axis=along, odd=odd_pixels)
        return total

    got = evaluated(along=1)
    assert got.dtype == dtype
    # float32: 24 bits through a transform of a few dozen terms
    np.testing.assert_allclose(got, direct, atol=1e-11 if dtype == np.float64 else 2e-5)
    columns = evaluated(along=0)
    np.testing.assert_allclose(columns, direct.T, atol=1e-11 if dtype == np.float64 else 2e-5)


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("kinds", [(False,), (True,), (False, True)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_rows_that_are_displaced_see_the_direct_sum(name, kinds, dtype):
    """By whole pixels and by less: waves beyond the Nyquist frequency fold in each row's way."""
    rng = np.random.default_rng(2)
    shifts = np.array([0.0, 0.31, -0.17, 1.0, -2.63])
    axis = replace(AXES[name], row_shifts=shifts)
    k = np.arange(axis.terms)
    waves = {odd: rng.standard_normal((5, axis.terms)) / (1 + k) for odd in kinds}
    position = axis.first + shifts[:, None] + np.arange(axis.pixels) * axis.pixel_pitch
    angle = np.pi * np.multiply.outer(position, k) / axis.length
    factor = np.where(k == 0, 1, 2)
    direct = sum(
        np.einsum("rk,rik->ri", factor * wave, (np.sin if odd else np.cos)(angle))
        for odd, wave in waves.items()
    )
    got = axis.evaluate_rows({odd: wave.astype(dtype) for odd, wave in waves.items()}, shifts)
    assert got.dtype == dtype
    np.testing.assert_allclose(got, direct, atol=1e-11 if dtype == np.float64 else 2e-5)


def test_photodetectors_off_center_need_no_chirp():
    centered, off, cropped = (
        AXES[name] for name in ("same pitch", "detector off center", "no common measure")
    )
    assert off.virtual_pixels == off.folded_terms == 12
    assert off.shift == pytest.approx(-0.2)
    assert len(off.pixel_waves()) == 2
    assert len(centered.pixel_waves()) == 1
    assert cropped.virtual_pixels == 12
    chirped = AXES["irrational pitch"]
    assert chirped.virtual_pixels is None
    assert chirped.window is None
    assert not chirped.shift


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("name", AXES)
def test_folding_by_pieces_is_the_folding(name, odd):
    axis = AXES[name]
    terms = np.random.default_rng(1).standard_normal(axis.terms)
    expected = axis.fold(terms, odd)
    got = np.zeros(axis.folded_terms)
    for start in range(0, axis.folded_terms, 4):
        piece = slice(start, min(start + 4, axis.folded_terms))
        for target, source, weights in axis.folding(piece, odd):
            got[target] += terms[source] * weights
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_averages_undo_the_mean_over_a_cell():
    """A cosine known by its cell means is evaluated as the cosine itself."""
    n, pitch = 40, 0.5
    k = 17
    edges = np.arange(n + 1) * pitch
    length = n * pitch
    w = np.pi * k / length
    means = np.diff(np.sin(w * edges)) / w / pitch
    axis = Axis(n, pitch, 20, 1.0, 0.5, False, 1.0)
    coefficients = scipy.fft.dct(means[None], type=2, axis=1)
    terms = axis.extend(coefficients, axis.terms) * axis.weights
    got = axis.evaluate(axis.fold(terms), axis=1)[0]
    np.testing.assert_allclose(got, np.cos(w * (np.arange(20) + 0.5)), atol=1e-12)
