"""The bound from below on full signal: never above the array's own brightest pixel."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from optical_paths import (
    PITCH,
    Gaussian,
    Leaning,
    aperture,
    of_picture,
    on_chart,
    path,
    sensor,
    signal,
)

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates import peak_bound
from vcam_cli.image_formation.estimates.bandwidth import axes, highest_passed
from vcam_cli.image_formation.estimates.chart_cells import cell_grid
from vcam_cli.image_formation.estimates.peak_bound import window, window_spectrum
from vcam_cli.image_formation.estimates.scene_sampling import sampled_image
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.charts.csf import Csf
from vcam_cli.scenes.charts.siemens_star import SiemensStar

SHAPE = 33, 45
"""Pixels of the array, and half the samples of pictures."""
ROUNDING = 1e-5
"""Tables of the lens are straight between their entries."""


def full_signal(optical_path, scene) -> float:
    mixing = np.eye(len(scene.spectra)), 0.0
    highest = highest_passed(optical_path, scene)
    return sampled_image(optical_path, scene, highest, mixing).full_signal


def brightest(optical_path, scene) -> float:
    """The brightest pixel, of all frequencies that the lens passes, and a chart on fine cells."""
    last = 16.0 if math.isfinite(optical_path.transfer.cutoff) else 64.0
    knobs = replace(optical_path.settings, oversampling=last, float_width=64)
    return float(signal(replace(optical_path, settings=knobs), scene).max())


def point(at=(17, 30)):
    light = np.zeros((66, 90))
    light[at] = 1.0
    return light


RNG = np.random.default_rng(4)
PICTURES = {
    "even": np.ones((66, 90)),
    "noise": RNG.random((66, 90)),
    "point": point(),
    "point in the corner": point((0, 0)),
    "half": np.repeat([[0.1, 1.0]], 45, axis=1) * np.ones((66, 1)),
    "stripes": np.indices((66, 90))[1] % 2.0,
    # Where photodetectors are half as wide as pixels, nearly all of this falls between them.
    "stripes between the photodetectors": np.isin(np.indices((132, 180))[1] % 4, (0, 3)) * 1.0,
}
LENSES = {
    "f/1": (Diffraction(1.0, 0.0),),
    "f/8": (Diffraction(8.0, 0.0),),
    "soft": (Diffraction(2.0, 0.0), Gaussian(5e-6)),
    "beside its place": (Diffraction(2.0, 0.0), Leaning(8e-6, 3e-6, 1e-6, 2e-6)),
    "narrow": (Diffraction(2.0, 0.0), Leaning(0.3e-6, -0.2e-6, 0.2e-6, 0.3e-6)),
    "wide": (Diffraction(2.0, 0.0), Leaning(0.0, 0.0, 12e-6, 12e-6)),
    "no end": (Leaning(0.3e-6, -0.2e-6, 0.05e-6, 0.05e-6),),
}


def before(lens, shape=SHAPE, shift=(0.0, 0.0)):
    g = sensor(*shape, fill=(0.5, 0.5), shift=shift)
    return path(g, *LENSES[lens], aperture(g))


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("scale", [1.0, 1.04])
@pytest.mark.parametrize("name", PICTURES)
def test_no_pixel_before_a_picture_is_as_dark(name, scale, lens):
    """Pictures that just cover the array, and pictures without a common grid with the pixels."""
    picture, optical_path = PICTURES[name], before(lens)
    pitch = scale * SHAPE[1] * PITCH / picture.shape[1]
    scene = of_picture(picture, pitch)
    found, exact = full_signal(optical_path, scene), brightest(optical_path, scene)
    assert found <= exact * (1 + ROUNDING)


@dataclass(frozen=True)
class Margin(Chart):
    """A dim array, and light of a level beyond a place [m]."""

    place: float
    level: float

    def paint(self, x_edges, y_edges, mix, out):
        bright = np.clip((x_edges[1:] - self.place) / np.diff(x_edges), 0, 1)
        out[:] = mix[:, :1, None] * (1 + (self.level - 1) * bright)

    def values(self, x, y, mix):
        row = np.where(np.asarray(x) > self.place, self.level, 1.0)
        return np.multiply.outer(mix[:, 0], np.broadcast_to(row, (len(y), len(x))))


def charts(shape):
    """By the array's shape: some are brighter in the margin, by up to a million."""
    edge = (shape[1] / 2 + 2) * PITCH
    frame = Frame(shape[1] * PITCH, shape[0] * PITCH)
    return {
        "star": SiemensStar(9, 1.0),
        "chirp": Csf(frame, 0.9 / PITCH, 0.5, 0.9, 0.0),
        **{f"margin {level:g}": Margin(edge, level) for level in (0.0, 10.0, 1e3, 1e6)},
    }


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.2, -0.1)])
@pytest.mark.parametrize("lens", ["f/1", "f/8", "beside its place"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 4), SHAPE])
@pytest.mark.parametrize("name", charts(SHAPE))
def test_light_beside_the_array_is_not_taken_for_its_own(name, shape, lens, shift):
    optical_path = before(lens, shape, shift)
    scene = on_chart(optical_path, charts(shape)[name], margin=4)
    scene = scene.with_cells(cell_grid(scene, optical_path.geometry, 16.0))
    found, exact = full_signal(optical_path, scene), brightest(optical_path, scene)
    assert found <= exact * (1 + ROUNDING)


@pytest.mark.parametrize("name", ["even", "half", "noise"])
def test_the_bound_is_close_where_light_is_even_over_a_window(name):
    """The part that terms left out may bring; of noise, its mean."""
    picture, optical_path = PICTURES[name], before("f/8")
    scene = of_picture(picture, PITCH / 2)
    found, exact = full_signal(optical_path, scene), brightest(optical_path, scene)
    assert found > (0.97 if name != "noise" else 0.8 * picture.mean()) * exact


def test_the_bound_is_close_through_a_blur_that_the_tables_leave_out():
    """A blur of two pixels moves light by a small part of a window."""
    g = sensor(132, 180)
    optical_path = path(g, Diffraction(8.0, 0.0), Leaning(PITCH, 0.0, PITCH, PITCH), aperture(g))
    scene = of_picture(PICTURES["half"], 2 * PITCH)
    found, exact = full_signal(optical_path, scene), brightest(optical_path, scene)
    assert 0.9 * exact < found <= exact * (1 + ROUNDING)


@pytest.mark.parametrize("lens", ["f/1", "f/8"])
def test_of_a_single_pixel_it_is_the_signal(lens):
    optical_path = before(lens, (1, 1))
    scene = on_chart(optical_path, SiemensStar(9, 1.0), margin=4)
    scene = scene.with_cells(cell_grid(scene, optical_path.geometry, 16.0))
    assert full_signal(optical_path, scene) == pytest.approx(
        brightest(optical_path, scene), rel=1e-4
    )


def test_full_wells_are_full():
    g = sensor(*SHAPE)
    optical_path = path(g, Diffraction(4.0, 0.0), aperture(g), ceiling=0.25)
    assert full_signal(optical_path, of_picture(np.ones((66, 90)), PITCH / 2)) == 0.25


@pytest.mark.parametrize("pixels", [1, 2, 3, 8, 61])
def test_windows_are_means_of_pixels(pixels):
    """Weights that are nowhere negative, and their sum over waves one by one."""
    weight = window(pixels)
    assert (weight > 0).all()
    angle = np.linspace(0, 9 * np.pi, 400)
    exact = np.cos(np.outer(angle, np.arange(pixels) - (pixels - 1) / 2)) @ weight
    np.testing.assert_allclose(window_spectrum(angle, pixels), exact, atol=1e-11)


def test_detail_that_repeats_with_the_pixels_is_their_constant_light():
    """Harmonics of the pixel pitch are summed; others leave less than their part in a window."""
    g = sensor(200, 300)
    optical_path = path(g, Diffraction(1.0, 0.0), aperture(g))
    scene = of_picture(np.ones((200, 300)), PITCH)
    x, _ = axes(optical_path, scene, 6.5)
    windows = peak_bound._windows(x, 0.0, 0.25)
    assert {0, 600, 1200, 1800} <= set(windows.terms.tolist())
    assert len(windows.terms) < 0.15 * x.terms
    every, below, kept = windows.power
    assert every == below
    assert 0 <= every - kept < 1e-5 * every


def test_terms_up_to_a_part_of_the_highest_frequency_are_told_apart():
    """What lies beyond counts in the power of all, and in neither of the others."""
    g = sensor(200, 300)
    optical_path = path(g, Diffraction(1.0, 0.0), aperture(g))
    x, _ = axes(optical_path, of_picture(np.ones((200, 300)), PITCH), 6.5)
    windows = peak_bound._windows(x, 0.0, 0.25)
    some = windows.below(0.5)
    assert some.terms.max() < 0.5 * x.terms <= windows.terms.max()
    every, below, kept = some.power
    assert every == windows.power[0]
    assert kept <= below < 0.8 * every
    assert below - kept < 1e-5 * every


def test_a_spectrum_without_an_end_has_a_bound():
    """A mosaic of detail that no lens ends: waves alike in every second pixel are many."""
    rng = np.random.default_rng(7)
    g = sensor(60, 80, fill=(0.5, 0.5))
    lens = Leaning(0.3e-6, -0.2e-6, 0.05e-6, 0.05e-6)
    optical_path = path(g, lens, aperture(g))
    scene = of_picture(rng.random((75, 100)), 0.8 * PITCH)
    found, exact = full_signal(optical_path, scene), brightest(optical_path, scene)
    assert 0.1 * exact < found <= exact * (1 + ROUNDING)
