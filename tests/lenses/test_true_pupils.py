"""OTFs on the true pupil: closed forms, and a dense correlation of the oracle's wavefronts."""

import math
from functools import cache

import numpy as np
import pytest

from tests.lenses.oracle import ORACLE
from tests.making import long_except
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.files import shipped_lens
from vcam_cli.lenses.wavefronts import trace_field
from vcam_cli.physics import aberration, shaped_pupil, zernike

SCALE = 0.1
"""Of the lenses: wavefronts scale with them, and a tenth is correlated in little time."""


def disk(x, y):
    return np.hypot(x, y) < 1


def disk_otf(lag):
    half = np.minimum(lag / 2, 1)
    return 2 / np.pi * (np.arccos(half) - half * np.sqrt(1 - half**2))


LAGS = np.random.default_rng(3).uniform(-1.4, 1.4, (2, 500))


def test_a_disk_has_the_otf_of_diffraction():
    clear = np.zeros(len(shaped_pupil.exponents(4)))
    found = shaped_pupil.otf_grid(shaped_pupil.mask(disk, 192), clear, 4)
    expected = disk_otf(np.hypot(*LAGS))
    assert np.abs(found.interpolate(*LAGS) - expected).max() < 1.5e-4  # edges of 192 samples


def test_an_annulus_has_the_otf_of_overlapping_disks():
    # |outer| + ... by inclusion and exclusion of disks; O'Neill 1956, doi:10.1364/JOSA.46.000285
    inner = 0.4
    clear = np.zeros(len(shaped_pupil.exponents(4)))

    def ring(x, y):
        return (np.hypot(x, y) < 1) & (np.hypot(x, y) > inner)

    def cross(lag):
        """Overlap of the disks of radius 1 and `inner`, over pi."""
        d = np.clip(lag, 1 - inner, 1 + inner)
        a = np.arccos((d**2 + inner**2 - 1) / (2 * d * inner))
        b = np.arccos((d**2 + 1 - inner**2) / (2 * d))
        kite = np.sqrt((1 + inner - d) * (d + inner - 1) * (d - inner + 1) * (d + inner + 1)) / 2
        return (inner**2 * a + b - kite) / np.pi

    lag = np.hypot(*LAGS)
    area = 1 - inner**2
    whole = disk_otf(lag) + inner**2 * disk_otf(lag / inner) - 2 * cross(lag)
    found = shaped_pupil.otf_grid(shaped_pupil.mask(ring, 256), clear, 4).interpolate(*LAGS)
    assert np.abs(found - whole / area).max() < 5e-4


def test_coma_and_astigmatism_match_the_round_pupils_ratio():
    terms = ((4, 0.05e-6), (6, 0.15e-6), (8, 0.1e-6), (11, 0.05e-6))
    wave = 550e-9
    at = np.linspace(-1, 1, 31)
    x, y = (a.ravel() for a in np.meshgrid(at, at))
    waves = np.linalg.lstsq(
        shaped_pupil.basis(x, y, 6), zernike.wavefront(terms, x, y) / wave, rcond=None
    )[0]
    found = shaped_pupil.otf_grid(shaped_pupil.mask(disk, 192), waves, 6).interpolate(*LAGS)
    ratio = aberration.otf_ratio(LAGS[0] / (2 * wave), LAGS[1] / (2 * wave), wave, 1.0, terms)
    assert np.abs(found - ratio * disk_otf(np.hypot(*LAGS))).max() < 2e-4


@cache
def small(name):
    return View(shipped_lens(name).scaled(SCALE))


def dense_mtf(view, angle, wave, oracle, samples=256):
    """MTF along x and y of the oracle's wavefront, on a grid of direction cosines.

    The map from the stop to direction cosines is a polynomial through traced rays, inverted.
    """
    at = np.linspace(-1, 1, 21)
    px, py = (a.ravel() for a in np.meshgrid(at, at))
    inside = np.hypot(px, py) < 0.999
    px, py = px[inside], py[inside]
    place = view.aim(angle, wave, px, py)
    rays = view.wavefront(angle, wave, *place, view.chief(angle, wave))
    basis = shaped_pupil.basis(px, py, 12)
    along = np.linalg.lstsq(basis, rays.x[0, 0], rcond=None)[0]
    # odd in y: y times polynomials even in it
    across = np.linalg.lstsq(basis * py[:, None], rays.y[0, 0], rcond=None)[0]
    theta = np.linspace(0, 2 * np.pi, 721)
    rim = shaped_pupil.basis(np.cos(theta), np.sin(theta), 12)
    rim_x, rim_y = rim @ along, np.sin(theta) * (rim @ across)
    middle, half_x, half_y = (rim_x.max() + rim_x.min()) / 2, np.ptp(rim_x) / 2, np.ptp(rim_y) / 2
    step = 2.04 / samples
    grid = (np.arange(samples) - (samples - 1) / 2) * step
    x, y = np.meshgrid(middle + half_x * grid, half_y * grid)
    u, v = (x - middle) / half_x, y / half_y
    for _ in range(12):  # u = x - (X(u, v) - its linear part), a contraction
        found = shaped_pupil.basis(u, v, 12)
        u = np.clip(u - (found @ along - x) / half_x, -1.3, 1.3)
        v = np.clip(v - (v * (found @ across) - y) / half_y, -1.3, 1.3)
    path = zernike.wavefront(tuple(zip(range(1, 38), oracle, strict=True)), u, v)
    # the share of a cell that lies inside, by its distance from the edge
    inside = np.clip((1 - np.hypot(u, v)) / step + 0.5, 0, 1)
    inside -= (
        np.roll(inside, 1, 0) + np.roll(inside, -1, 0) + np.roll(inside, 1, 1)
        + np.roll(inside, -1, 1) - 4 * inside
    ) / 24  # fmt: skip
    spectrum = np.fft.fft2(inside * np.exp(2j * np.pi * SCALE * path), (2 * samples,) * 2)
    found = np.abs(np.fft.ifft2(np.abs(spectrum) ** 2)) / inside.sum()
    lags = np.arange(1, samples)
    return lags * step * half_x, found[0, 1:samples], lags * step * half_y, found[1:samples, 0]


@pytest.mark.parametrize(
    ("name", "every"),
    long_except(
        [("cooke-triplet", 3)],
        [("cooke-triplet", 3), ("cooke-triplet", 1), ("double-gauss", 1), ("topogon", 1)],
        several=True,
    ),
)
def test_mtf_is_that_of_the_oracles_wavefronts(name, every):
    """Of every so many of them, the first one among these."""
    view = small(name)
    for degrees, micrometers, oracle in ORACLE[name]["wavefronts"][::every]:
        angle, wave = np.array([math.radians(degrees)]), np.array([micrometers * 1e-6])
        height = view.heights(angle, np.array([view.lens.primary]))[0]
        found = trace_field(view, height, wave[0], wave[0], vignetted=False).at(0)
        half = found.half_frame(wave[0])
        samples = shaped_pupil.samples_across(found.slope / wave[0])
        if samples > 256:
            continue  # the dense grid would need as many
        grid = found.grid(wave[0], found.mask(samples))
        lag_x, along, lag_y, across = dense_mtf(view, angle, wave, oracle)
        assert np.abs(np.abs(grid.interpolate(lag_x / half[0], 0 * lag_x)) - along).max() < 1e-3
        assert np.abs(np.abs(grid.interpolate(0 * lag_y, lag_y / half[1])) - across).max() < 1e-3


@pytest.mark.parametrize(
    ("name", "least", "most"), [("double-gauss", 1.2, 1.4), ("topogon", 1.45, 1.7)]
)
def test_tangential_blur_is_that_of_the_narrower_pupil(name, least, most):
    # a round pupil of the axial f-number throws rays too near by 1 / cos^3 of the chief ray
    view = small(name)
    angle = np.array([view.lens.field])
    height = view.heights(angle, np.array([view.lens.primary]))[0]
    found = trace_field(view, np.array([0.0, *height]), 550e-9, 550e-9, vignetted=False)
    narrower = found.half_frames[0, 0, 0] / found.half_frames[1, 0, 0]
    assert least < narrower < most
    assert narrower == pytest.approx(1 / math.cos(view.lens.field) ** 3, rel=0.08)
