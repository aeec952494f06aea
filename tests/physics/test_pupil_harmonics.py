"""Harmonics of the direction against the transfer functions that they are made of."""

import numpy as np
import pytest
from making import long_except

from vcam_cli.physics import aberration, diffraction, pupil_harmonics, ray_blur, zernike

N = 2.0
WAVELENGTHS = np.linspace(400e-9, 700e-9, 13)
WAVEFRONTS = {
    "coma": ((8, 60e-9),),
    "even": ((4, 50e-9), (6, 40e-9), (11, -30e-9)),
    "many": ((4, 20e-9), (5, 30e-9), (7, 50e-9), (9, -20e-9), (13, 25e-9)),
    "steep": ((6, 90e-9), (8, 200e-9)),
    "moved": ((2, 100e-9), (8, 60e-9)),
}
RANDOM = np.random.default_rng(4)
H, ANGLE = RANDOM.uniform(0, 1, 60), RANDOM.uniform(-np.pi, np.pi, 60)


def summed(harmonics, angle):
    """The transfer (..., n) of harmonics (..., n, m), in a direction for each frequency."""
    turned = harmonics * np.exp(1j * np.arange(harmonics.shape[-1]) * angle[:, None])
    return turned[..., ::2].real.sum(axis=-1) + 1j * turned[..., 1::2].imag.sum(axis=-1)


@pytest.mark.parametrize("name", WAVEFRONTS)
def test_they_are_what_a_grid_of_the_pupil_gives(name):
    terms = WAVEFRONTS[name]
    f = np.sort(H) / (WAVELENGTHS[0] * N)
    found = summed(aberration.otf_ratio_harmonics(f, WAVELENGTHS, N, terms), ANGLE)
    for ratio, w in zip(found, WAVELENGTHS, strict=True):
        expected = aberration.otf_ratio(f * np.cos(ANGLE), f * np.sin(ANGLE), w, N, terms)
        error = np.abs(ratio - expected) * diffraction.otf_circular(f, w, N, 0.0)
        assert error.max() < 1e-4


@pytest.mark.parametrize("name", ["coma", "even", "many"])
@pytest.mark.parametrize("wavelength", long_except([487e-9], [400e-9, 487e-9, 700e-9]))
def test_they_are_means_over_the_overlap_of_two_pupils(name, wavelength):
    """At any wavelength between the nodes, by 200,000 random points in each overlap."""
    terms = WAVEFRONTS[name]
    own = pupil_harmonics.pupil_harmonics(terms, WAVELENGTHS, zernike.max_slope(terms))
    h, angle = np.array([0.07, 0.4, 0.75]), np.array([0.3, -1.2, 2.5])
    found = summed(own.amplitudes(h[None], np.array([wavelength]))[0], angle)
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 200_000))
    for k in range(3):
        sx, sy = h[k] * np.cos(angle[k]), h[k] * np.sin(angle[k])
        inside = (np.hypot(x - sx, y - sy) < 1) & (np.hypot(x + sx, y + sy) < 1)
        px, py = x[inside], y[inside]
        path = zernike.wavefront(terms, px - sx, py - sy)
        path = path - zernike.wavefront(terms, px + sx, py + sy)
        light = np.exp(2j * np.pi * path / wavelength)
        assert abs(light.mean() - found[k]) < 5 * light.std() / np.sqrt(len(light))


@pytest.mark.parametrize("terms", [((8, 4e-7),), ((4, 3e-7), (7, 2e-7), (2, 1e-7)), ((4, 4e-7),)])
def test_they_are_what_rays_give_on_a_plane(terms):
    f = np.linspace(0, 4e5, 24)
    found = ray_blur.otf_harmonics(f, N, terms)
    angle = np.full(24, 0.6)
    expected = ray_blur.otf(f * np.cos(0.6), f * np.sin(0.6), N, terms).diagonal()
    np.testing.assert_allclose(summed(found, angle), expected, atol=2e-4)
