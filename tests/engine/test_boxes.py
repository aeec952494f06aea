"""Means over boxes against summed overlaps, of samples and of rectangles."""

import numpy as np
import pytest
from making import camera
from test_sampling import GRIDS

from vcam_cli.engine import boxes
from vcam_cli.scenes.base import Rectangles
from vcam_cli.studies.simulate import prepare


@pytest.mark.parametrize("grid", ["aligned", "coarse picture", "odd ratio", "off center"])
@pytest.mark.parametrize("size", [0.3, 0.55, 1.0])
def test_boxes_equal_summed_overlaps(grid, size):
    x, y = GRIDS[grid]
    plane = np.random.default_rng(4).random((y.samples, x.samples))
    fits = all(
        a.first - size / 2 >= 0 and a.first + (a.pixels - 1) * a.pixel_pitch + size / 2 <= a.length
        for a in (x, y)
    )

    def overlaps(axis):
        low = axis.first + np.arange(axis.pixels) * axis.pixel_pitch - size / 2
        edge = np.arange(axis.samples) * axis.sample_pitch
        shared = np.minimum(low[:, None] + size, edge + axis.sample_pitch) - np.maximum(
            low[:, None], edge
        )
        return np.clip(shared, 0, None) / size

    expected = overlaps(y) @ plane @ overlaps(x).T
    got = boxes.of_samples(plane, x, y, size, size)
    inner = (slice(None), slice(None)) if fits else (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(got[inner], expected[inner], atol=1e-12)


def test_box_of_no_size_reads_the_sample_under_it():
    x, y = GRIDS["coarse picture"]
    plane = np.arange(48.0).reshape(6, 8)
    got = boxes.of_samples(plane, x, y, 0.0, 0.0)
    assert np.array_equal(got, np.kron(plane, np.ones((3, 3))))


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize(("width", "height"), [(0.0, 0.0), (0.3, 0.55), (1.0, 1.0), (2.6, 1.7)])
def test_rectangles_are_as_their_samples(grid, width, height):
    """Edges between samples: the same light, and the same mirrors around it."""
    x, y = GRIDS[grid]
    edges = [np.array([0, 1, 4, 5, a.samples]) for a in (x, y)]
    values = np.random.default_rng(6).random((2, 4, 4))
    light = Rectangles(
        edges[0] * x.sample_pitch - x.length / 2, edges[1] * y.sample_pitch - y.length / 2, values
    )
    got = boxes.of_rectangles(light, x, y, width, height, np.float64)
    for plane, own in zip(got, values, strict=True):
        samples = own.repeat(np.diff(edges[1]), axis=0).repeat(np.diff(edges[0]), axis=1)
        expected = boxes.of_samples(samples, x, y, width, height)
        np.testing.assert_allclose(plane[:], expected, atol=1e-12)


@pytest.mark.parametrize("aperture", ["on", "off"])
@pytest.mark.parametrize("kind", ["colorchecker", "step-wedge"])
def test_a_chart_without_blur_is_never_sampled(kind, aperture, tmp_path):
    """Against points, 100 along each pixel: next to an edge they err by one of about 70."""
    changes = {
        "array.rows": 12, "array.columns": 16, "scene.source": {"kind": "chart", "chart": kind},
        "effects": {"diffraction": "off", "pixel_aperture": aperture},
    }  # fmt: skip
    made, _ = prepare(camera(tmp_path, changes), 1)
    assert made.spectrum.samples == 0 and not made.spectrum.lost
    g, fine = made.geometry, 100
    place = (np.arange(fine) + 0.5) / fine - 0.5
    y, x = ((np.arange(n)[:, None] - (n - 1) / 2 + place) for n in (g.rows, g.columns))
    light = made.scene.at(x.ravel() * g.pitch_x, y.ravel() * g.pitch_y, made.transfer.level.T)
    points = light.reshape(g.rows, fine, g.columns, fine)
    share = g.collecting_width / g.pitch_x if aperture == "on" else 2 / fine
    inside = np.abs(place) < share / 2
    expected = points[:, inside][..., inside].mean(axis=(1, 3))
    apart = np.abs(made.rate - expected) / expected.max()
    assert apart.max() < 0.015 and np.sqrt(np.mean(apart**2)) < 2e-3
