"""Where pixels stand: rows and columns, staggered rows, files of positions and what is wrong there.

Expected numbers are worked out in the tests; 1e-12 leaves room for rounding only.
"""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from making import GONE, camera

from vcam_cli.camera.derived import lattice as module
from vcam_cli.camera.derived.lattice import lattice, places
from vcam_cli.errors import BadInput

OBLONG = {
    "pixel.width": "5 um",
    "pixel.height": "4 um",
    "pixel.gap_x": "0.5 um",
    "output.render": "none",
}
SIZE = {"array.rows": GONE, "array.columns": GONE}
GOOD = "x_um,y_um,color\n-10,3,R\n4.5,-8,G\n0,0,W\n"


def made(folder, **changes):
    return lattice(camera(folder, {k.replace("__", "."): v for k, v in changes.items()} | OBLONG))


def scattered(folder: Path, text: str | bytes = GOOD, **changes):
    """A camera with a file of positions beside it."""
    file = folder / "places.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    pattern = {"array.pattern": {"positions": "places.csv"}}
    return camera(folder, OBLONG | SIZE | pattern | changes)


# --- rows and columns ----------------------------------------------------------------------------


def test_rows_and_columns(tmp_path):
    found = made(tmp_path, array__rows=6, array__columns=10)
    assert (found.rows, found.columns) == (6, 10)
    assert (found.pitch_x, found.pitch_y) == pytest.approx((5.5e-6, 4e-6), rel=1e-12)
    assert (found.width, found.height) == pytest.approx((55e-6, 24e-6), rel=1e-12)


def test_a_die_is_filled_with_whole_pixels(tmp_path):
    die = {"width": "56 um", "height": "25.9 um"}  # 10.2 columns, 6.5 rows: round to even
    found = made(tmp_path, array={"die": die, "pattern": "monochrome"})
    assert (found.rows, found.columns) == (6, 10)
    assert (found.width, found.height) == pytest.approx((55e-6, 24e-6), rel=1e-12)


@pytest.mark.parametrize("pattern", ["monochrome", "honeycomb"])
def test_a_die_smaller_than_a_pixel(pattern, tmp_path):
    die = {"width": "1 mm", "height": "1 um"}
    with pytest.raises(BadInput) as caught:
        made(tmp_path, array={"die": die, "pattern": pattern})
    [problem] = caught.value.problems
    assert problem.path == ("array", "die")
    assert "smaller than one pixel" in problem.message


# --- honeycomb -----------------------------------------------------------------------------------


def test_a_honeycomb_is_as_dense_as_rows_and_columns(tmp_path):
    found = made(tmp_path, array__rows=6, array__columns=10, array__pattern="honeycomb")
    assert (found.rows, found.columns) == (6, 10)
    assert found.pitch_x == pytest.approx(5.5e-6 * math.sqrt(2), rel=1e-12)
    assert found.pitch_y == pytest.approx(4e-6 / math.sqrt(2), rel=1e-12)
    assert found.width * found.height == pytest.approx(60 * 5.5e-6 * 4e-6, rel=1e-12)


def test_a_honeycomb_fills_a_die_with_as_many_pixels(tmp_path):
    die = {"width": "2 mm", "height": "2 mm"}
    square = made(tmp_path, array={"die": die, "pattern": "monochrome"})
    staggered = made(tmp_path, array={"die": die, "pattern": "honeycomb"})
    assert staggered.rows * staggered.columns == pytest.approx(
        square.rows * square.columns, rel=5e-3
    )
    assert staggered.width == pytest.approx(2e-3, abs=staggered.pitch_x / 2)
    assert staggered.height == pytest.approx(2e-3, abs=staggered.pitch_y / 2)


# --- positions -----------------------------------------------------------------------------------


def test_positions_are_read(tmp_path):
    found = places(scattered(tmp_path))
    assert found.x == pytest.approx(np.array([-10e-6, 4.5e-6, 0]), rel=1e-12)
    assert found.y == pytest.approx(np.array([3e-6, -8e-6, 0]), rel=1e-12)
    assert found.colors == ("R", "G", "W")


def test_the_sensor_holds_all_pixels_and_is_centered(tmp_path):
    # 10 um and half a pixel of 5 + 0.5 um on both sides; 8 um and half of 4
    found = lattice(scattered(tmp_path))
    assert (found.rows, found.columns) == (1, 3)
    assert (found.pitch_x, found.pitch_y) == pytest.approx((5.5e-6, 4e-6), rel=1e-12)
    assert (found.width, found.height) == pytest.approx((25.5e-6, 20e-6), rel=1e-12)


def test_positions_from_the_upper_left_corner(tmp_path):
    """Table 2.4's reference: a grid of 5 x 4 pixels of 5.5 x 4 um, its first center inside."""
    at = [(5.5 * (i + 0.5), 4 * (j + 0.5)) for j in range(4) for i in range(5)]
    header = "x_um,y_um,color\n"
    corner = header + "".join(f"{x},{y},G\n" for x, y in at)
    centered = header + "".join(f"{x - 13.75},{y - 8},G\n" for x, y in at)
    pattern = {"array.pattern": {"positions": "places.csv", "origin": "corner"}}
    one, two = scattered(tmp_path, corner, **pattern), scattered(tmp_path, centered)
    (tmp_path / "places.csv").write_text(corner, "utf-8")
    found, expected = places(one), np.array(at) * 1e-6 - (13.75e-6, 8e-6)
    assert found.x == pytest.approx(expected[:, 0], abs=1e-15)
    assert found.y == pytest.approx(expected[:, 1], abs=1e-15)
    assert lattice(one).width == pytest.approx(27.5e-6, rel=1e-12)
    (tmp_path / "places.csv").write_text(centered, "utf-8")
    assert places(two).x == pytest.approx(found.x, abs=1e-15)


def test_comments_blank_lines_and_spaces(tmp_path):
    text = "\ufeff# made by hand\n\nx_um, y_um ,color\n  1 , -2e0 ,  G \n\n# end\n"
    found = places(scattered(tmp_path, text))
    assert (found.x[0], found.y[0]) == pytest.approx((1e-6, -2e-6), rel=1e-12)
    assert found.colors == ("G",)


def test_one_pixel_on_the_axis(tmp_path):
    found = lattice(scattered(tmp_path, "x_um,y_um,color\n0,0,G\n"))
    assert (found.width, found.height) == pytest.approx((5.5e-6, 4e-6), rel=1e-12)


def test_a_file_that_changes_is_read_again(tmp_path):
    made_from = scattered(tmp_path)
    assert places(made_from).x[0] == pytest.approx(-10e-6)
    file = tmp_path / "places.csv"
    file.write_text(GOOD.replace("-10", "-12"))
    later = file.stat().st_mtime_ns + 10**9
    os.utime(file, ns=(later, later))
    assert places(made_from).x[0] == pytest.approx(-12e-6)


def test_clear_pixels_need_no_filter_and_others_do(tmp_path):
    own = {"array.filters": {"Q": 0.5}}
    assert places(scattered(tmp_path, "x_um,y_um,color\n0,0,Q\n1,1,Y\n", **own)).colors == (
        "Q",
        "Y",
    )


HEAD = "x_um,y_um,color\n"
BAD = {
    "an empty file": ("", "is empty"),
    "no header": ("1,2,R\n", "the header is '1,2,R'"),
    "another header": ("x,y,color\n1,2,R\n", "the header is 'x,y,color'"),
    "columns in another order": ("y_um,x_um,color\n1,2,R\n", "the header is 'y_um,x_um,color'"),
    "no pixels": (HEAD, "has no pixels"),
    "a column too few": (HEAD + "1,2,R\n1,2\n", ":3: has 2 columns; the header has 3"),
    "a column too many": (HEAD + "1,2,R,\n", ":2: has 4 columns"),
    "a word for a number": (HEAD + "1,2,R\nleft,2,R\n", ":3: 'left,2' is not a row of numbers"),
    "a missing number": (HEAD + ",2,R\n", ":2: ',2' is not a row of numbers"),
    "infinity": (HEAD + "1,inf,R\n", ":2: '1,inf' holds a value that is not finite"),
    "not a number": (HEAD + "nan,1,R\n", "not finite"),
    "no text": (b"\xff\xfe\x00\x01", "is not a text file"),
    "a color without a filter": (HEAD + "1,2,R\n1,3,Z\n", "of color 'Z', which has no filter"),
    "no color": (HEAD + "1,2,\n", "of color ''"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_told_where_they_are_named(name, tmp_path):
    text, says = BAD[name]
    with pytest.raises(BadInput) as caught:
        scattered(tmp_path, text)
    [problem] = caught.value.problems
    assert problem.path == ("array", "pattern", "positions")
    assert "made.yaml:" in problem.where
    assert "places.csv" in problem.message
    assert says in problem.message
    assert problem.remedy
    color = "color" in name.split()
    assert ("array.filters" if color else "x_um,y_um,color") in problem.remedy


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, OBLONG | SIZE | {"array.pattern": {"positions": "nowhere.csv"}})
    [problem] = caught.value.problems
    assert problem.path == ("array", "pattern", "positions")
    assert "nowhere.csv" in problem.message


def test_a_file_that_is_gone(tmp_path):
    made_from = scattered(tmp_path)
    (tmp_path / "places.csv").unlink()
    with pytest.raises(BadInput, match="cannot be read"):
        places(made_from)


def test_more_pixels_than_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_PIXELS", 4)
    places(scattered(tmp_path))  # the header is a row of them
    with pytest.raises(BadInput, match="has more than 4 rows; no more are read"):
        scattered(tmp_path, GOOD + "1,1,R\n")


def grid(x0, y0, rows=6, columns=8, pitch=5.0):
    """A file of pixels of which the first is at x0, y0 [um]."""
    lines = [f"{x0 + j * pitch},{y0 + i * pitch},G" for i in range(rows) for j in range(columns)]
    return "x_um,y_um,color\n" + "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("x0", "y0"), [(0, 0), (2.5, 2.5), (1000, 700), (-35, -25), (-40, 0), (0, -300)]
)
def test_an_array_beside_the_picture_is_refused(x0, y0, tmp_path):
    """With what to subtract: the middle of the array."""
    with pytest.raises(BadInput, match="outside the array") as caught:
        scattered(tmp_path, grid(x0, y0))
    remedy = caught.value.problems[0].remedy
    assert f"subtract {x0 + 17.5:g} from x_um and {y0 + 12.5:g} from y_um" in remedy
    made = scattered(tmp_path, grid(-17.5, -12.5))
    assert len(places(made).x) == 48


@pytest.mark.parametrize(("x0", "y0"), [(-17.5, -12.5), (-10, 0), (0, -8), (-6, -6)])
def test_an_array_off_the_middle_may_be(x0, y0, tmp_path):
    scattered(tmp_path, grid(x0, y0))


@pytest.mark.parametrize(("rows", "columns"), [(1, 8), (6, 1), (1, 1)])
def test_rows_and_single_pixels_may_be_anywhere(rows, columns, tmp_path):
    scattered(tmp_path, grid(30, 40, rows, columns))
