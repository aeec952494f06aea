"""Cutting a map of depth: shares of layers, their number, what lies hidden and where."""

import numpy as np
import pytest
from making import long_except
from scipy.signal import fftconvolve

from vcam_cli.scenes.depth_cut import LEAST_JUMP, cut_depth
from vcam_cli.scenes.depth_detail import disc_transfer, full_signal, picture_detail
from vcam_cli.scenes.depth_slopes import (
    divided,
    mean_slope,
    slope_change,
    slope_error,
    slopes,
    source,
    steepest,
)

PITCH = 1e-6
PIXEL = 4e-6
ALL = np.arange(48)


def passes(frequency: np.ndarray) -> np.ndarray:
    return np.ones_like(frequency)


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1, (48, 48))


def cut(radius: np.ndarray, allowed: float = 1e-3, picture: np.ndarray | None = None):
    picture = noise() if picture is None else picture
    full = full_signal(picture, PITCH, PIXEL)

    def detail_of(light: np.ndarray):
        return picture_detail(light, PITCH, (PIXEL, PIXEL), passes, full, PIXEL)

    return cut_depth(radius, picture, PITCH, PIXEL, detail_of, allowed)


def test_a_disc_passes_nothing_at_the_first_zero_of_its_transfer():
    """Airy's constant: J1 is 0 at 3.8317 = 2 pi 0.6098."""
    radius = 10e-6
    found = disc_transfer(np.array([0.0, 1.0, 0.60983 / radius]), radius)
    assert found == pytest.approx([1, 1, 0], abs=1e-5)


def test_the_power_of_a_wave_is_half_its_squared_amplitude():
    """Of a wave much longer than a pixel, whose full signal is 1."""
    x = (np.arange(256) + 0.5) / 256
    wave = 0.5 + 0.5 * np.cos(2 * np.pi * x) * np.ones((256, 1))
    detail = picture_detail(
        wave, PITCH, (PIXEL, PIXEL), passes, full_signal(wave, PITCH, PIXEL), PIXEL
    )
    assert detail.power.sum() == pytest.approx(0.5 * 0.5**2, rel=2e-2)
    at = float((detail.power * detail.frequency).sum() / detail.power.sum())
    assert at == pytest.approx(1 / 256e-6, rel=2e-2)


@pytest.mark.parametrize("period", [4, 6])
def test_detail_finer_than_pixels_is_what_their_means_have(period):
    """A lattice before photodetectors of 6.9 samples, which lie anywhere on it: brute force.

    It is at least that, and at most the sum of all harmonics in phase, in closed form.
    """
    row = np.isin(np.arange(252) % period, (0, period - 1)).astype(float)  # mirrored, it goes on
    width = 6.9
    sums = np.concatenate([[0], row.cumsum()])
    at = np.random.default_rng(0).uniform(0, 245, 5000)
    place = np.arange(len(sums))
    means = (np.interp(at + width, place, sums) - np.interp(at, place, sums)) / width
    detail = picture_detail(
        row * np.ones((252, 1)), PITCH, (width * PITCH, width * PITCH), passes, 1.0, width * PITCH
    )
    n = np.arange(1, 1000)
    harmonics = 2 / period * np.sinc(2 * n / period) * np.sinc(n / period * width)
    in_phase = np.sqrt(2) * np.abs(harmonics).sum()
    assert means.std() <= detail.rms(np.ones_like(detail.frequency)) <= in_phase


def test_what_is_in_focus_is_a_layer_of_its_own():
    """Light across an edge is proportional to |r|: mixtures of both sides of 0 miss its kink."""
    radius = np.linspace(30e-6, -10e-6, 48)[:, None] + np.zeros((48, 48))
    assert 0.0 in cut(radius, 5e-3).radii
    assert 0.0 not in cut(radius + 11e-6, 5e-3).radii


def test_shares_of_a_sample_add_up_and_have_its_radius():
    radius = np.linspace(30e-6, -10e-6, 48)[:, None] + np.zeros((48, 48))
    found = cut(radius)
    layers = np.array([found.coverage(number, ALL, ALL) for number in range(len(found.radii))])
    assert layers.sum(axis=0) == pytest.approx(1)
    assert np.tensordot(found.radii, layers, 1) == pytest.approx(radius, abs=1e-12)
    assert (np.diff(found.radii) < 0).all()
    assert found.is_used().all()


@pytest.mark.parametrize("allowed", long_except([1e-2, 1e-4], [1e-2, 1e-3, 1e-4]))
def test_the_blur_between_layers_is_as_exact_as_predicted(allowed):
    """Of the whole picture at a radius midway between two layers, blurred by sums over discs."""
    radius = np.linspace(24e-6, 8e-6, 48)[:, None] + np.zeros((48, 48))
    picture = np.kron(noise(1)[::4, ::4], np.ones((4, 4)))
    found = cut(radius, allowed, picture)
    fine, wide = 6, 200
    large = np.kron(np.tile(picture, (3, 3)), np.ones((fine, fine)))
    y, x = np.mgrid[-wide : wide + 1, -wide : wide + 1]
    seen = []
    first, second = found.radii[:2]
    for own in ((first + second) / 2, first, second):
        disc = (np.hypot(x, y) * PITCH / fine <= abs(own)).astype(float)
        blurred = fftconvolve(large, disc / disc.sum(), mode="same")
        inner = blurred[48 * fine : 96 * fine, 48 * fine : 96 * fine]
        side = round(PIXEL / PITCH) * fine
        seen.append(inner.reshape(48 * fine // side, side, -1, side).mean(axis=(1, 3)))
    error = float(np.sqrt(np.square(seen[0] - (seen[1] + seen[2]) / 2).mean()))
    # In the middle it is the largest; discs of squares and the picture's border leave the rest.
    assert error <= 1.6 * max(found.error, 2e-5) + 2e-4


def rows_on_pixels(radius: np.ndarray) -> np.ndarray:
    """Means over pixels (12,) of rows (48,), each behind a disc of its own: in closed form."""

    def primitive(t: np.ndarray) -> np.ndarray:  # twice, of the profile of a disc of the radius 1
        inner = np.clip(t, -1, 1)
        root = np.sqrt(1 - inner**2)
        inside = inner / 2 + (inner * np.arcsin(inner) + root - root**3 / 3) / np.pi
        return inside + np.maximum(t - 1, 0)

    edges = (np.arange(13) * 4)[:, None] * PITCH
    total = np.zeros((12, 48))
    for start in (-48, 0, 48):  # the picture goes on as its mirror image
        place = (np.arange(48) + start) * PITCH
        order = np.arange(48) if start == 0 else np.arange(48)[::-1]
        own = radius[order]
        swept = own * (primitive((edges - place) / own) - primitive((edges - place - PITCH) / own))
        total[:, order] += np.diff(swept, axis=0) / PIXEL
    return total


@pytest.mark.parametrize("allowed", [3e-3, 1e-3, 3e-4])
def test_smooth_light_on_a_slope_errs_as_predicted(allowed):
    """Hardly any detail but that of the shares: cover is not even, nor what it mixes."""
    radius = np.linspace(24e-6, 8e-6, 48)
    light = np.linspace(0.2, 0.8, 48)
    found = cut(radius[:, None] + np.zeros((48, 48)), allowed, light[:, None] * np.ones((48, 48)))
    first, share = found.first[:, 0].astype(int), found.share[:, 0]
    near, far = rows_on_pixels(found.radii[first]), rows_on_pixels(found.radii[first + 1])
    true = rows_on_pixels(radius)
    lacks = near * (1 - share) + far * share - true
    seen = true @ light
    error = lacks @ light - seen / true.sum(axis=1) * lacks.sum(axis=1)
    rms = float(np.sqrt(np.square(error).mean())) / float(seen.max())
    assert len(found.radii) > 2
    assert found.error <= allowed
    assert found.error / 20 <= rms <= found.error


def test_few_values_are_layers_themselves():
    radius = np.where(noise() > 0.5, 20e-6, np.where(noise(1) > 0.5, 5e-6, -8e-6))
    found = cut(radius)
    assert found.radii == pytest.approx([20e-6, 5e-6, -8e-6])
    assert found.error < 1e-3
    assert not found.share[found.first < 1].any()


@pytest.mark.parametrize("why", ["no detail", "no blur", "one distance"])
def test_one_layer_is_enough(why):
    radius = np.linspace(30e-6, -10e-6, 48)[:, None] + np.zeros((48, 48))
    picture = noise()
    if why == "no detail":
        picture = np.full((48, 48), 0.5)
    else:
        radius = 1e-3 * radius if why == "no blur" else np.full((48, 48), 7e-6)
    assert len(cut(radius, picture=picture).radii) == 1


def test_what_rays_pass_by_is_hidden_and_no_more():
    """A step of 12 samples: so far behind the edge, and there the samples at the edge go on."""
    radius = np.where(np.arange(48) < 24, 10e-6, -2e-6) * np.ones((48, 1))
    hidden = cut(radius).hidden
    rows, columns = np.unravel_index(hidden.samples, radius.shape)
    assert columns.max() == 23
    assert 11 <= 24 - columns.min() <= 14
    assert np.bincount(rows).min() == np.bincount(rows).max()
    assert (hidden.sources == rows * 48 + 24).all()
    assert hidden.unknown > 0.1


@pytest.mark.parametrize("kind", ["slope", "steep slope", "small step"])
def test_smooth_surfaces_hide_nothing(kind):
    """A slope folds under the rays, and hides itself, where it rises by a sample a sample."""
    columns = np.arange(48) * np.ones((48, 1))
    rise = {"slope": 0.3, "steep slope": 0.9, "small step": 0}[kind]
    step = 0.9 * LEAST_JUMP * PIXEL if kind == "small step" else 0
    radius = rise * PITCH * columns + np.where(columns < 24, step, 0)
    assert not len(cut(radius).hidden.samples)


def test_parts_of_samples_lie_on_the_slope_and_steps_stay():
    """Straight between the middles of samples; a jump is not smoothed."""
    slope = 0.3 * np.arange(8) + np.zeros((6, 1))
    fine = divided(slope, 4)
    assert fine.shape == (24, 32)
    inner = 0.3 * ((np.arange(32) + 0.5) / 4 - 0.5)
    assert fine[:, 2:-2] == pytest.approx(np.broadcast_to(inner[2:-2], (24, 28)))
    assert fine[:, :2] == pytest.approx(0)  # the picture goes on as its mirror image
    step = np.where(np.arange(8) < 4, 3.0, 0.0) + np.zeros((6, 1))
    assert (divided(step, 3) == step.repeat(3, 0).repeat(3, 1)).all()


def test_even_backgrounds_are_known():
    radius = np.where(np.arange(48) < 24, 10e-6, -2e-6) * np.ones((48, 1))
    picture = np.where(np.arange(48) < 24, noise(), 0.3)
    hidden = cut(radius, picture=picture).hidden
    assert (hidden.unknown, hidden.most_unknown) == (0, 0)


def test_slopes_are_the_gradient_of_a_paraboloid_and_keep_light():
    """Even light on an even slope of radius r and rise g: Q = -g^2 / 4; steps have no slope."""
    radius = 0.1 * np.arange(48) * np.ones((32, 1))
    down, right = slopes(radius)
    assert not down.any()
    assert right == pytest.approx(0.1)
    assert steepest((down, right)) == pytest.approx(0.2 / 3)
    tilted = source(np.ones((1, 32, 48)), (down, right), 2.0)[0]
    assert tilted[:, 1:-1] == pytest.approx(0, abs=1e-12)  # its flux is even
    light = noise()[None]
    moved = source(light, slopes(0.1 * np.arange(light.shape[2]) * np.ones(light.shape[1:])), 3.0)
    assert moved.sum() == pytest.approx(0, abs=1e-9)  # to one side comes what the other lacks
    for high in (5.0, 0.4):
        step = np.where(np.arange(48) < 24, high, 0.0) * np.ones((32, 1))
        assert not any(rise.any() for rise in slopes(step))


def test_a_map_in_steps_rises_as_a_smooth_one_and_its_error_is_predicted():
    """Of 0.1 a sample, in steps of four, which are a pixel."""
    smooth = 0.1 * np.arange(48.0) + np.zeros((48, 48))
    steps = 0.4 * (np.arange(48) // 4) + np.zeros((48, 48))
    assert mean_slope(steps, 4) == pytest.approx(mean_slope(smooth, 4), rel=0.05)
    assert mean_slope(smooth, 4) == pytest.approx(0.1, rel=1e-12)
    picture = noise()
    full = full_signal(picture, PITCH, PIXEL)
    detail = picture_detail(picture, PITCH, (PIXEL, PIXEL), passes, full, PIXEL)
    found = [slope_change(detail, PITCH * r, PITCH, 4) for r in (steps, smooth)]
    assert found[0] == pytest.approx(found[1], rel=0.1)
    assert 0 < slope_error(detail, PITCH * smooth, PITCH, 4) < found[1]
