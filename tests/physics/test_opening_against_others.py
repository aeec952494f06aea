"""Obscured apertures against GalSim and poppy, where they are installed."""

import math

import numpy as np
import pytest

from vcam_cli.physics import shaped_pupil
from vcam_cli.physics.opening import Opening


def otf(opening: Opening, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the OTF at lags in radii."""
    pupil = opening.mask(512)
    grid = shaped_pupil.grid_of_paths(pupil, np.zeros((pupil.samples,) * 2))
    return grid.interpolate(x, y).real


def lags() -> tuple[np.ndarray, np.ndarray]:
    length = np.linspace(0.05, 1.9, 24)
    angle = np.linspace(0.1, 3.0, 24) * 2
    return length * np.cos(angle), length * np.sin(angle)


@pytest.mark.parametrize("obscuration", [0.2, 0.45])
def test_annuli_are_those_of_galsim(obscuration):
    galsim = pytest.importorskip("galsim", reason="GalSim is not installed")
    # Its Airy has the wavelength over the diameter for its unit of angle: cut-off 1 cycle.
    other = galsim.Airy(lam_over_diam=1.0, obscuration=obscuration, scale_unit=galsim.radians)
    x, y = lags()
    theirs = [
        other.kValue(math.pi * a, math.pi * b).real / other.kValue(0, 0).real
        for a, b in zip(x, y, strict=True)
    ]
    assert np.abs(otf(Opening(obscuration=obscuration), x, y) - theirs).max() < 5e-4


def test_struts_are_those_of_galsim():
    galsim = pytest.importorskip("galsim", reason="GalSim is not installed")
    step = 8.2 / 2048
    vane = 21 * step / 2  # of its grid a strut covers whole rows
    aperture = galsim.Aperture(
        diam=2.0,
        lam=500,
        obscuration=0.3,
        nstruts=4,
        strut_thick=vane,  # of the diameter; ours is half the width in radii
        strut_angle=0 * galsim.degrees,
        pupil_plane_size=8.2,
        pupil_plane_scale=step,
    )
    open_ones = aperture.illuminated.astype(float)
    spectrum = np.fft.fft2(open_ones)
    whole = np.fft.fftshift(np.fft.ifft2(np.abs(spectrum) ** 2).real) / open_ones.sum()
    x, y = lags()
    column, row = (np.rint(a / step).astype(int) for a in (x, y))
    middle = len(whole) // 2
    theirs = whole[middle + row, middle + column]
    ours = otf(Opening(obscuration=0.3, spiders=4, vane=vane), column * step, row * step)
    assert np.abs(ours - theirs).max() < 1e-3


def test_an_obscured_hexagon_is_that_of_poppy():
    poppy = pytest.importorskip("poppy", reason="poppy is not installed")
    aperture = poppy.CompoundAnalyticOptic(
        opticslist=[
            poppy.HexagonAperture(side=1.0),
            poppy.SecondaryObscuration(secondary_radius=0.3, n_supports=4, support_width=0.08),
        ]
    )
    size, step = 1024, 2.4 / 1024
    wave = poppy.Wavefront(wavelength=1e-6, npix=size, diam=2.4)
    open_ones = np.abs(aperture.get_transmission(wave))
    padded = np.zeros((2 * size, 2 * size))
    padded[:size, :size] = open_ones
    whole = np.fft.fftshift(np.fft.ifft2(np.abs(np.fft.fft2(padded)) ** 2).real)
    whole /= (open_ones**2).sum()
    x, y = lags()
    column, row = (np.rint(a / step).astype(int) for a in (x, y))
    theirs = whole[size + row, size + column]
    found = [
        otf(Opening(6, rotation, 0.3, 4, 0.04), column * step, row * step)
        for rotation in (0.0, math.pi / 2)
    ]
    assert min(float(np.abs(ours - theirs).max()) for ours in found) < 3e-3
