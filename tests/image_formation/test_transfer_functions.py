"""Effective transfer functions against direct sums over wavelength."""

from functools import cache

import numpy as np
import pytest
from making import long_except

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.transfer_functions import Band, Transfer, transfer
from vcam_cli.image_formation.transfer_tables import TableSize, mixtures, tabulate
from vcam_cli.spectra import PLANCK, SPEED_OF_LIGHT, Spectrum, illuminant

LENS = Diffraction(f_number=4.0, magnification=-0.02)
F = np.linspace(0, 500e3, 41)


def tables_of(exact, entries, tolerance):
    """Tables of as few mixtures of the spectra as the tolerance allows."""
    size = TableSize(exact.cutoff, entries, tolerance, 8)
    return tabulate(exact, size, mixtures(exact, size))


def bell(center, width=40e-9):
    nodes = np.linspace(400e-9, 700e-9, 301)
    return Spectrum.from_samples(nodes, np.exp(-(((nodes - center) / width) ** 2)))


def test_a_line_is_its_own_otf():
    """Monochromatic light: H is the OTF at that wavelength, no grid in between."""
    wavelength = 553.7e-9
    h = transfer(
        [Spectrum.line(wavelength, 2.0)], [bell(540e-9)], 3.0, Band(400e-9, 700e-9, 50e-9), [LENS]
    )
    photons = 2.0 * wavelength / (PLANCK * SPEED_OF_LIGHT)
    level = 3.0 * photons * bell(540e-9).evaluate(np.array([wavelength]))[0]
    np.testing.assert_allclose(
        h.radial_response(F)[0, 0], level * LENS.otf(F, wavelength), rtol=1e-12
    )


@pytest.mark.parametrize(("step", "kept"), [(20e-9, 4), (22e-9, 7), (50e-9, 7)])
def test_wavelengths_are_halved_no_coarser_than_the_coarsest_band(step, kept):
    """20 nm, at `draft`: light of lines further apart is not linear between them."""
    wavelengths = 450e-9 + step * np.arange(7)
    one = Transfer(wavelengths, np.ones((1, 1, 7)), (LENS,))
    half = one.with_half_the_wavelengths()
    assert len(half.wavelengths) == kept
    assert half.weights.sum() == pytest.approx(7)
    mean = (half.weights[0, 0] * half.wavelengths).sum() / 7
    assert mean == pytest.approx(wavelengths.mean())


@cache
def summed_directly(lamp: str) -> np.ndarray:
    """Photons times the OTF at midpoints of a grid that has every table's knots among its edges."""
    edges = np.linspace(400e-9, 700e-9, 6001)
    mid = (edges[1:] + edges[:-1]) / 2
    light = illuminant(lamp).evaluate(mid) * bell(540e-9).evaluate(mid)
    density = light * mid / (PLANCK * SPEED_OF_LIGHT)
    return sum(d * LENS.otf(F, w) for d, w in zip(density * np.diff(edges), mid, strict=True))


@pytest.mark.parametrize(("step", "tolerance"), [(20e-9, 5e-4), (10e-9, 1.3e-4), (2.5e-9, 8e-6)])
@pytest.mark.parametrize("lamp", long_except(["FL2"], ["D65", "FL2", "A"]))
def test_many_wavelengths_by_brute_force(lamp, step, tolerance):
    """A 0.05 nm sum, OTF at every wavelength.

    Linear interpolation between the nodes errs by step^2 / 8 times the second derivative of the
    OTF: (4 / pi) (f N (1 - m))^2 nu / sqrt(1 - nu^2), 8e12 / m^2 at 425 lp/mm: 1e-4 at 10 nm.
    """
    h = transfer([illuminant(lamp)], [bell(540e-9)], 1.0, Band(400e-9, 700e-9, step), [LENS])
    direct = summed_directly(lamp)
    got = h.radial_response(F)[0, 0]
    np.testing.assert_allclose(got, direct, atol=tolerance * direct[0])
    # the level does not depend on the step at all
    np.testing.assert_allclose(got[0], direct[0], rtol=1e-6)


def test_cutoff_is_that_of_the_shortest_wavelength_in_use():
    h = transfer(
        [Spectrum.line(500e-9)], [Spectrum.flat(1.0)], 1.0, Band(400e-9, 700e-9, 10e-9), [LENS]
    )
    assert h.cutoff == pytest.approx(LENS.cutoff(500e-9), rel=1e-12)
    assert (
        transfer([bell(5e-7)], [bell(5e-7)], 1.0, Band(400e-9, 700e-9, 1e-8), []).cutoff == np.inf
    )


def test_few_mixtures_stand_for_many_spectra():
    """24 random spectra through 3 colors: a handful of mixtures, within the tolerance asked for."""
    rng = np.random.default_rng(0)
    nodes = np.linspace(400e-9, 700e-9, 31)
    spectra = [Spectrum.from_samples(nodes, rng.random(31)) for _ in range(24)]
    colors = [bell(600e-9), bell(540e-9), bell(460e-9)]
    exact = transfer(spectra, colors, 1.0, Band(400e-9, 700e-9, 10e-9), [LENS])
    for tolerance in (1e-2, 1e-4, 1e-7):
        table = tables_of(exact, 2001, tolerance)
        rebuilt = np.tensordot(table.mix.T, table.radial, axes=1)
        truth = exact.radial_response(np.linspace(0, exact.cutoff, 2001))
        error = np.abs(rebuilt - truth).max() / exact.level.max()
        assert error <= 1.02 * tolerance
        # it is judged at 256 frequencies, this at 2001
        assert error == pytest.approx(table.error, rel=0.02, abs=1e-15)
    # three colors, blurred slightly differently at every wavelength: six mixtures do for 1 %
    assert len(tables_of(exact, 2001, 1e-2).mix) <= 6


def test_few_spectra_stay_as_they_are():
    exact = transfer([bell(5e-7), bell(6e-7)], [bell(5e-7)], 1.0, Band(4e-7, 7e-7, 1e-8), [LENS])
    table = tables_of(exact, 101, 1e-3)
    assert np.array_equal(table.mix, np.eye(2))
    assert table.error == 0


def test_spectra_that_do_not_cover_the_band_are_refused():
    with pytest.raises(ValueError, match="nm"):
        transfer([bell(5e-7)], [Spectrum.flat(1.0)], 1.0, Band(380e-9, 780e-9, 1e-8), [LENS])
