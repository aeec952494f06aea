"""From the lattice to the raw frame: places by hand, colors, and the polynomial between points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from making import GONE, camera

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.errors import CannotDo
from vcam_cli.readout.layout import interpolate
from vcam_cli.solve import layout as module
from vcam_cli.solve.layout import FINER, FINEST, camera_layout
from vcam_cli.solve.settings import camera_settings

SIZE = {"array.rows": 6, "array.columns": 4, "output.render": "none"}


def made(folder, pattern, **changes):
    found = camera(folder, SIZE | {"array.pattern": pattern} | changes)
    return camera_layout(found, geometry(found))


def scattered(folder, rows, **changes):
    """Pixels of 5 um at (x, y, color) in um."""
    lines = [f"{x!r},{y!r},{color}" for x, y, color in rows]
    (folder / "places.csv").write_text("\n".join(["x_um,y_um,color", *lines]))
    away = {"array.rows": GONE, "array.columns": GONE}
    return made(folder, {"positions": "places.csv"}, **away, **changes)


# --- rows and columns, stacked -------------------------------------------------------------------


def test_rows_and_columns_are_taken_as_they_are(tmp_path):
    place = made(tmp_path, "bayer-rggb")
    light = np.arange(24.0).reshape(6, 4)
    assert not place.is_scattered
    assert not place.full_color
    assert place.select_pixels(light) is light
    assert (place.color == np.tile([[0, 1], [1, 2]], (3, 2))).all()
    assert place.x[0] == pytest.approx([-7.5e-6, -2.5e-6, 2.5e-6, 7.5e-6], rel=1e-12)
    assert place.y[:, 0] == pytest.approx(5e-6 * (np.arange(6) - 2.5), rel=1e-12)
    assert (place.x == place.picture_x).all()
    assert (place.picture_y == place.y.T).all()


def test_stacked_pixels_have_all_colors(tmp_path):
    place = made(tmp_path, "stacked")
    light = np.arange(72.0).reshape(3, 6, 4)
    assert place.full_color
    assert place.planes
    assert not place.is_scattered
    assert place.mosaic.colors == ("R", "G", "B")
    assert place.select_pixels(light) is light


# --- honeycomb -----------------------------------------------------------------------------------

STEP = 5e-6 / np.sqrt(2)  # between rows, and from a row's pixel to the next row's


def test_places_of_a_honeycomb(tmp_path):
    """Columns two steps apart, rows one; the sensor 8 by 6 steps, the first pixel half a step in,
    every second row a step to the right."""
    place = made(tmp_path, "honeycomb")
    assert place.is_scattered
    assert not place.full_color
    even, odd = np.array([-3.5, -1.5, 0.5, 2.5]) * STEP, np.array([-2.5, -0.5, 1.5, 3.5]) * STEP
    assert place.x == pytest.approx(np.array([even, odd] * 3), rel=1e-12)
    rows = np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5]) * STEP
    assert place.y == pytest.approx(np.repeat(rows[:, None], 4, axis=1), rel=1e-12)
    nearest = np.hypot(place.x[2, 1] - place.x[1], place.y[2, 1] - place.y[1]).min()
    assert nearest == pytest.approx(5e-6, rel=1e-12)  # the pixel's own width and gap


def test_colors_of_a_honeycomb_turned_back_are_a_bayer_mosaic(tmp_path):
    place = made(tmp_path, "honeycomb", **{"array.rows": 12, "array.columns": 10})
    # turned by 45 degrees about the first pixel: whole numbers of pixels along both axes
    x, y = (place.x - place.x[0, 0]) / 5e-6, (place.y - place.y[0, 0]) / 5e-6
    along, down = (x + y) / np.sqrt(2), (y - x) / np.sqrt(2)
    i, j = np.rint(down).astype(int), np.rint(along).astype(int)
    assert down == pytest.approx(i, abs=1e-9)
    assert along == pytest.approx(j, abs=1e-9)
    assert (place.color == np.array([[0, 1], [1, 2]])[i % 2, j % 2]).all()


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 5), (2, 3), (7, 4)])
def test_a_honeycomb_takes_every_second_place(rows, columns, tmp_path):
    place = made(tmp_path, "honeycomb", **{"array.rows": rows, "array.columns": columns})
    light = np.arange(2.0 * rows * columns).reshape(rows, 2 * columns)
    expected = [[light[i, 2 * j + i % 2] for j in range(columns)] for i in range(rows)]
    assert (place.select_pixels(light) == np.array(expected)).all()
    assert place.color.shape == place.x.shape == place.y.shape == (rows, columns)


# --- places of their own -------------------------------------------------------------------------

PLACES = [(-21.0, 3.5, "G"), (4.25, -13.0, "R"), (0.0, 0.0, "W"), (17.7, 12.2, "B")]


def test_places_and_colors(tmp_path):
    place = scattered(tmp_path, PLACES)
    assert place.is_scattered
    assert place.planes
    assert not place.full_color
    assert place.mosaic.colors == ("R", "G", "B", "W")
    assert place.x == pytest.approx(np.array([[-21e-6, 4.25e-6, 0, 17.7e-6]]), rel=1e-12)
    assert place.y == pytest.approx(np.array([[3.5e-6, -13e-6, 0, 12.2e-6]]), rel=1e-12)
    assert (place.color == [[1, 0, 3, 2]]).all()


def test_the_lattice_is_as_large_as_the_sensor_and_finer_than_a_pixel(tmp_path):
    g = scattered(tmp_path, PLACES).lattice
    assert (g.columns * g.pitch_x, g.rows * g.pitch_y) == pytest.approx((47e-6, 31e-6), rel=1e-12)
    assert (5e-6 / g.pitch_x, 5e-6 / g.pitch_y) == pytest.approx((FINEST, FINEST), rel=0.02)


def test_light_is_read_at_the_places_in_their_colors(tmp_path):
    """A straight slope of another height for every color: a polynomial reads it exactly."""
    place = scattered(tmp_path, PLACES)
    g = place.lattice
    x = (np.arange(g.columns) + 0.5 - g.columns / 2) * g.pitch_x
    y = (np.arange(g.rows) + 0.5 - g.rows / 2) * g.pitch_y
    slope = 100 + x / 1e-6 + 2 * y[:, None] / 1e-6
    light = slope + 1000 * np.arange(4)[:, None, None]
    expected = [100 + x + 2 * y + 1000 * "RGBW".index(color) for x, y, color in PLACES]
    assert place.select_pixels(light) == pytest.approx(np.array([expected]), rel=1e-11)
    assert place.select_pixels(light.astype(np.float32)).dtype == np.float32


def test_light_is_never_below_zero(tmp_path):
    place = scattered(tmp_path, PLACES)
    light = np.zeros((4, place.lattice.rows, place.lattice.columns))
    light[:, ::4, ::4] = 1.0  # a polynomial swings below zero between such points
    assert place.select_pixels(light).min() >= 0


def test_a_fine_lattice_is_not_sampled_finer_still(tmp_path):
    found = camera(tmp_path, SIZE)
    knobs = camera_settings(found)
    fine = scattered(tmp_path, PLACES).settings(knobs)
    assert fine.oversampling == 1
    assert fine.wavelength_step == knobs.wavelength_step
    assert made(tmp_path, "honeycomb").settings(knobs) == knobs


def test_pixels_too_far_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_POINTS", 1000)
    with pytest.raises(CannotDo, match=r"0\.047 x 0\.031 mm") as caught:
        scattered(tmp_path, PLACES)
    assert "closer together" in str(caught.value)


# --- the picture ---------------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", ["honeycomb", "positions", "monochrome"])
def test_the_picture_covers_the_sensor_with_the_pixels_own_cells(pattern, tmp_path):
    oblong = {"pixel.width": "6 um", "pixel.height": "4 um", "pixel.gap_y": "0.5 um"}
    if pattern == "positions":
        place = scattered(tmp_path, PLACES, **oblong)
    else:
        place = made(tmp_path, pattern, **oblong, **{"array.rows": 37, "array.columns": 21})
    g = place.geometry
    sides = (place.picture_x, 6e-6, g.sensor_width), (place.picture_y, 4.5e-6, g.sensor_height)
    for at, pitch, side in sides:
        assert np.diff(at) == pytest.approx(pitch, rel=1e-9)
        assert at[0] == pytest.approx(-at[-1], abs=1e-12)
        assert len(at) * pitch == pytest.approx(side, abs=pitch / 2)


# --- between the points --------------------------------------------------------------------------


@given(
    st.lists(st.floats(-1, 1), min_size=8, max_size=8),
    st.lists(st.floats(-1, 1), min_size=8, max_size=8),
    st.floats(-0.5, 14.5),
    st.floats(-0.5, 11.5),
)
def test_polynomials_of_seventh_degree_are_read_exactly(across, down, column, row):
    # also half a point beyond the outermost: the rim of the sensor
    x, y = (np.arange(15) - 7) / 7, (np.arange(12) - 5.5) / 5.5
    plane = np.outer(np.polyval(down, y), np.polyval(across, x))
    expected = np.polyval(down, (row - 5.5) / 5.5) * np.polyval(across, (column - 7) / 7)
    found = interpolate(plane, np.array([row]), np.array([column]))
    assert found == pytest.approx(expected, abs=1e-10)  # numbers up to 64, weights up to 100


def test_points_are_read_as_they_are():
    plane = np.random.default_rng(2).normal(size=(9, 14)).astype(np.float32)
    row, column = (at.ravel().astype(float) for at in np.indices(plane.shape))
    found = interpolate(plane, row, column)
    assert found.dtype == np.float32
    assert (found == plane.ravel()).all()


@pytest.mark.parametrize(("per_pixel", "error"), [(2, 0.04), (1, 2e-4), (0.5, 1e-6)])
def test_waves_are_read_as_well_as_it_is_said(per_pixel, error):
    """The largest error over directions, phases and places, 8 points a pixel: not more than is
    said, and not so much less that it would say nothing. Half as fast: 2^8 times better."""
    rng = np.random.default_rng(3)
    row, column = rng.uniform(8, 24, (2, 4000))
    i, j = np.indices((32, 32))
    worst = 0.0
    for angle in np.radians([0, 10, 30, 45, 90]):
        for phase in np.radians([0, 45, 90]):
            fx, fy = np.array([np.cos(angle), np.sin(angle)]) * per_pixel / FINER

            def wave(y, x, fx=fx, fy=fy, phase=phase):
                return np.cos(2 * np.pi * (fx * x + fy * y) + phase)

            off = interpolate(wave(i, j), row, column) - wave(row, column)
            worst = max(worst, float(abs(off).max()))
    assert error / 4 < worst < error
