"""Polygons on cells: against half planes, closed areas and their own point values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.scenes import polygons
from vcam_cli.scenes.charts.slanted_edge import half_plane_cover

SQUARE = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)  # y down: counterclockwise as seen


@pytest.mark.parametrize("angle", [0.0, 0.01, 0.4, math.pi / 4, 1.3, math.pi / 2, 2.2, -0.7])
def test_one_long_side_is_a_half_plane(angle):
    edges_x, edges_y = np.linspace(-1.1, 1, 12), np.linspace(-0.9, 1.2, 9)
    normal, along = np.array([math.cos(angle), math.sin(angle)]), 50.0
    side = along * np.array([-normal[1], normal[0]])
    corners = [side, -side, -side + along * normal, side + along * normal]
    found = polygons.cover(polygons.sides([np.array(corners)[::-1]]), edges_x, edges_y)
    x, y = (edges_x[1:] + edges_x[:-1]) / 2, (edges_y[1:] + edges_y[:-1]) / 2
    expected = half_plane_cover(
        np.add.outer(normal[1] * y, normal[0] * x),
        abs(normal[0]) * np.diff(edges_x),
        abs(normal[1]) * np.diff(edges_y)[:, None],
    )
    # sides of length 100 on cells of 0.2: rounding
    np.testing.assert_allclose(abs(found), expected, atol=1e-11)


@pytest.mark.parametrize(("x", "y"), [(0, 0), (-3, 0), (0, -3), (0.9, 0.9), (-0.5, 2), (3, 3)])
def test_parts_beyond_the_grid_do_not_count(x, y):
    square = polygons.sides([SQUARE]).scale_and_move(2.0, x, y)
    edges = np.linspace(0, 1.5, 4)
    inside = [np.diff(np.clip(edges, low, low + 2)) / 0.5 for low in (y, x)]
    np.testing.assert_allclose(polygons.cover(square, edges, edges), np.outer(*inside), atol=1e-14)


def test_a_hole_is_taken_away():
    frame = polygons.sides([SQUARE * 3, SQUARE[::-1] + 1])
    edges = np.arange(4.0)
    expected = np.ones((3, 3))
    expected[1, 1] = 0
    np.testing.assert_allclose(polygons.cover(frame, edges, edges), expected, atol=1e-15)
    points = polygons.contains_points(frame, edges[:3] + 0.5, edges[:3] + 0.5)
    np.testing.assert_array_equal(points, expected)


@given(st.lists(st.tuples(*[st.floats(-2, 2)] * 2), min_size=3, max_size=3, unique=True))
def test_triangles_have_their_area_and_cells_their_points(corners):
    corners = np.array(corners)
    (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[0]
    area = (ax * by - ay * bx) / 2  # positive: clockwise as seen, for y is down
    edges_x, edges_y = np.linspace(-2, 2, 7), np.array([-2, -1.9, -0.3, 0, 0.4, 1.7, 2])
    triangle = polygons.sides([corners])
    cover = polygons.cover(triangle, edges_x, edges_y)
    cells = np.outer(np.diff(edges_y), np.diff(edges_x))
    assert (cover * cells).sum() == pytest.approx(-area, abs=1e-12)
    assert (np.sign(-area) * cover).min() >= -1e-12
    points = 64
    at = (np.arange(points) + 0.5) / points
    x, y = ((e[:-1, None] + np.diff(e)[:, None] * at).ravel() for e in (edges_x, edges_y))
    mean = polygons.contains_points(triangle, x, y).reshape(6, points, 6, points).mean((1, 3))
    # each of three sides crosses at most 2 x 64 of 64^2 parts of a cell, half of each in error
    np.testing.assert_allclose(cover, mean, atol=3 / points)


@pytest.mark.parametrize("seed", range(8))
def test_a_part_of_the_grid_is_that_of_the_whole(seed):
    """Corners lie on the grid, as often as not."""
    rng = np.random.default_rng(seed)
    letters = polygons.sides(rng.integers(0, 9, (20, 3, 2)) / rng.choice([1, 1.5]))
    grid = np.arange(10.0)
    whole, points = (
        each(letters, grid, grid) for each in (polygons.cover, polygons.contains_points)
    )
    for _ in range(12):
        (top, bottom), (left, right) = np.sort(rng.choice(10, (2, 2), replace=False), axis=1)
        x, y = grid[left : right + 1], grid[top : bottom + 1]
        part = polygons.cover(letters, x, y)
        np.testing.assert_allclose(part, whole[top:bottom, left:right], atol=1e-12)
        seen = polygons.contains_points(letters, x[1:], y[1:])
        assert np.array_equal(seen, points[top + 1 : bottom + 1, left + 1 : right + 1])
