"""Means over photodetectors against summed overlaps and means of many points."""

import numpy as np
import pytest
from making import camera
from optical_paths import aperture, of_picture, on_chart, path, sensor, signal
from test_filtering import GRIDS

from vcam_cli.image_formation.box_average import box_averages, point_values
from vcam_cli.image_formation.estimates.bandwidth import axes
from vcam_cli.scenes import bands
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.colorchecker import ColorChecker, largest_card
from vcam_cli.scenes.charts.dead_leaves import dead_leaves
from vcam_cli.scenes.charts.siemens_star import SiemensStar
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.scenes.charts.step_wedge import step_wedge
from vcam_cli.simulation.simulate import prepare

ONE = np.ones((1, 1))


def overlaps(low, size, edges):
    """The part of boxes from `low` on, of a size, that lies between neighboring edges."""
    shared = np.minimum.outer(low + size, edges[1:]) - np.maximum.outer(low, edges[:-1])
    return np.clip(shared, 0, None) / size


@pytest.mark.parametrize("grid", ["aligned", "coarse picture", "odd ratio", "off center"])
@pytest.mark.parametrize("size", [0.3, 0.55, 1.0])
def test_boxes_equal_summed_overlaps(grid, size):
    x, y = GRIDS[grid]
    plane = np.random.default_rng(4).random((y.samples, x.samples))
    fits = all(
        a.first - size / 2 >= 0 and a.first + (a.pixels - 1) * a.pixel_pitch + size / 2 <= a.length
        for a in (x, y)
    )

    def shares(axis):
        low = axis.first + np.arange(axis.pixels) * axis.pixel_pitch - size / 2
        return overlaps(low, size, np.arange(axis.samples + 1) * axis.sample_pitch)

    expected = shares(y) @ plane @ shares(x).T
    g = sensor(y.pixels, x.pixels, fill=(size, size), pitch=(1.0, 1.0))
    got = box_averages(of_picture(plane, x.sample_pitch), ONE, g, (x, y), 1)[0]
    inner = (slice(None), slice(None)) if fits else (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(got[inner], expected[inner], atol=1e-12)


@pytest.mark.parametrize("size", [(0.3, 0.55), (1.0, 1.0), (2.6, 1.7)])
@pytest.mark.parametrize("grid", GRIDS)
def test_pictures_are_mirrored_at_their_borders(grid, size):
    """Boxes that reach beyond, against the picture laid out with its mirror images around it."""
    x, y = GRIDS[grid]
    plane = np.random.default_rng(6).random((y.samples, x.samples))
    wide = np.pad(plane, [(a.samples, a.samples) for a in (y, x)], mode="symmetric")

    def shares(axis, width):
        low = axis.first + np.arange(axis.pixels) * axis.pixel_pitch - width / 2
        edges = np.arange(-axis.samples, 2 * axis.samples + 1) * axis.sample_pitch
        return overlaps(low, width, edges)

    expected = shares(y, size[1]) @ wide @ shares(x, size[0]).T
    g = sensor(y.pixels, x.pixels, fill=size, pitch=(1.0, 1.0))
    got = box_averages(of_picture(plane, x.sample_pitch), ONE, g, (x, y), 1)[0]
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_a_point_reads_the_sample_under_it():
    plane = np.arange(48.0).reshape(6, 8)
    scene = of_picture(plane, 3e-6)
    got = point_values(scene, ONE, sensor(18, 24, pitch=(1e-6, 1e-6)))[0]
    assert np.array_equal(got, np.kron(plane, np.ones((3, 3))))
    # without an aperture the whole computation is that of points
    alone = path(sensor(18, 24, pitch=(1e-6, 1e-6)))
    np.testing.assert_array_equal(signal(alone, scene), got.astype(np.float32))


FRAME = Frame(24e-6, 18e-6)
RECTANGLES = {
    "colorchecker": ColorChecker(largest_card(FRAME)),
    "step wedge": step_wedge(7, 2.0, FRAME),
}
FILLS = {"gaps": (0.5, 0.7), "no gap along y": (0.6, 1.0), "whole": (1.0, 1.0)}
SHIFT = {"gaps": (0.2, -0.1), "no gap along y": (-0.15, 0.0), "whole": (0.0, 0.0)}


@pytest.mark.parametrize("fill", FILLS)
@pytest.mark.parametrize("name", RECTANGLES)
def test_rectangles_by_their_overlaps(name, fill):
    chart = RECTANGLES[name]
    g = sensor(18, 24, FILLS[fill], SHIFT[fill], pitch=(1e-6, 1e-6))
    optical_path = path(g, aperture(g))
    scene = on_chart(optical_path, chart)
    mix = np.random.default_rng(1).random((3, 25))
    got = box_averages(scene, mix, g, axes(optical_path, scene, 1.0), 1)

    def ends(edges):
        return np.concatenate([[-1.0], edges[np.isfinite(edges)], [1.0]])

    x, y = (ends(e) for e in chart.edges())
    light = chart.values((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, mix)
    low_x = (np.arange(24) - 11.5) * 1e-6 + g.collecting_x - g.collecting_width / 2
    low_y = (np.arange(18) - 8.5) * 1e-6 + g.collecting_y - g.collecting_height / 2
    down, across = overlaps(low_y, g.collecting_height, y), overlaps(low_x, g.collecting_width, x)
    expected = np.einsum("yd,rde,xe->ryx", down, light, across)
    # charts are painted in the type of the view, 32 bits here
    np.testing.assert_allclose(got, expected, rtol=1e-5)


POINTS = {"slanted edge": SlantedEdge(0.1, 1.0), "star": SiemensStar(9, 1.0)}


@pytest.mark.parametrize("fill", FILLS)
@pytest.mark.parametrize("name", POINTS)
def test_areas_by_many_points(name, fill):
    """Against points, 200 along each side of a photodetector.

    An edge that leaves a row of points at the wrong side by half a step at most errs by 1 / 400.
    """
    g = sensor(6, 8, FILLS[fill], SHIFT[fill], pitch=(1e-6, 1e-6))
    got = signal(path(g, aperture(g)), on_chart(path(g, aperture(g)), POINTS[name]))
    place = (np.arange(200) + 0.5) / 200 - 0.5
    x = (np.arange(8)[:, None] - 3.5) * 1e-6 + g.collecting_x + place * g.collecting_width
    y = (np.arange(6)[:, None] - 2.5) * 1e-6 + g.collecting_y + place * g.collecting_height
    points = POINTS[name].values(x.ravel(), y.ravel(), ONE).reshape(6, 200, 8, 200)
    np.testing.assert_allclose(got, points.mean(axis=(1, 3)), atol=1 / 400)


def test_dead_leaves_in_parts():
    """Photodetectors that hold many leaves: against points, 100 along each side."""
    g = sensor(4, 6, (0.8, 0.6), pitch=(1e-6, 1e-6))
    leaves = dead_leaves(2, Frame(24e-6, 24e-6))
    optical_path = path(g, aperture(g))
    scene = on_chart(optical_path, leaves)
    mix = np.random.default_rng(3).random((1, 12))
    got = box_averages(scene, mix, g, axes(optical_path, scene, 1.0), 1)[0]
    place = (np.arange(100) + 0.5) / 100 - 0.5
    x = (np.arange(6)[:, None] - 2.5) * 1e-6 + place * g.collecting_width
    y = (np.arange(4)[:, None] - 1.5) * 1e-6 + place * g.collecting_height
    points = leaves.values(x.ravel(), y.ravel(), mix)[0].reshape(4, 100, 6, 100)
    np.testing.assert_allclose(got, points.mean(axis=(1, 3)), atol=2e-3)


def test_bands_of_rows_are_those_of_all(monkeypatch):
    g = sensor(11, 14, (0.5, 0.7), pitch=(1e-6, 1e-6))
    optical_path = path(g, aperture(g))
    scene = on_chart(optical_path, POINTS["star"])
    whole = box_averages(scene, ONE, g, axes(optical_path, scene, 1.0), 1)
    monkeypatch.setattr(bands, "CELLS", 90)  # three rows at once
    banded = box_averages(scene, ONE, g, axes(optical_path, scene, 1.0), 1)
    np.testing.assert_allclose(banded, whole, atol=1e-12)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_a_single_row_or_column(shape):
    g = sensor(*shape, (0.5, 0.7), (0.1, -0.1), pitch=(1e-6, 1e-6))
    found = signal(path(g, aperture(g)), on_chart(path(g, aperture(g)), SlantedEdge(0.3, 1.0)))
    place = (np.arange(400) + 0.5) / 400 - 0.5
    x = (np.arange(shape[1])[:, None] - (shape[1] - 1) / 2) * 1e-6 + g.collecting_x
    y = (np.arange(shape[0])[:, None] - (shape[0] - 1) / 2) * 1e-6 + g.collecting_y
    x, y = x + place * g.collecting_width, y + place * g.collecting_height
    points = SlantedEdge(0.3, 1.0).values(x.ravel(), y.ravel(), ONE)
    expected = points.reshape(shape[0], 400, shape[1], 400).mean(axis=(1, 3))
    np.testing.assert_allclose(found, expected, atol=1 / 800)


@pytest.mark.parametrize("aperture", ["on", "off"])
@pytest.mark.parametrize("kind", ["colorchecker", "step-wedge"])
def test_a_chart_without_blur_is_never_sampled(kind, aperture, tmp_path):
    """Against points, 100 along each pixel: next to an edge they err by one of about 70."""
    changes = {
        "array.rows": 12, "array.columns": 16, "scene.source": {"kind": "chart", "chart": kind},
        "effects": {"diffraction": "off", "pixel_aperture": aperture},
    }  # fmt: skip
    made, _ = prepare(camera(tmp_path, changes), 1)
    assert made.spectrum.cells == 0
    assert not made.spectrum.lost_rms
    g, fine = made.geometry, 100
    place = (np.arange(fine) + 0.5) / fine - 0.5
    y, x = ((np.arange(n)[:, None] - (n - 1) / 2 + place) for n in (g.rows, g.columns))
    light = made.scene.values_at(
        x.ravel() * g.pitch_x, y.ravel() * g.pitch_y, made.transfer.level.T
    )
    points = light.reshape(g.rows, fine, g.columns, fine)
    share = g.collecting_width / g.pitch_x if aperture == "on" else 2 / fine
    inside = np.abs(place) < share / 2
    expected = points[:, inside][..., inside].mean(axis=(1, 3))
    apart = np.abs(made.rate - expected) / expected.max()
    assert apart.max() < 0.015
    assert np.sqrt(np.mean(apart**2)) < 2e-3
