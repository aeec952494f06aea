"""`vcam plan --geometry`: scene and optics by the formulas of the thesis, section 2.3."""

import math
import re

import pytest
from typer.testing import CliRunner

from vcam_cli.commands.main import app

SIDES = 2e-3, 1e-3
"""Of the sensor [m]: 200 x 100 pixels of 10 um."""
CAMERA = (
    "array={columns: 200, rows: 100}", "pixel.width=10 um", "scene.distance=0.5 m",
    "optics={f_number: 4, focal_length: 8 mm}", "scene.wavelengths={start: 400 nm, stop: 700 nm}",
)  # fmt: skip


def printed(*sets):
    arguments = [part for each in (*CAMERA, *sets) for part in ("--set", each)]
    done = CliRunner().invoke(app, ["plan", "starter", "--geometry", "-q", *arguments])
    assert done.exit_code == 0, done.output
    return dict(re.findall(r"^  (\S.*?)  +(.*)$", done.stdout, re.MULTILINE))


def numbers(text):
    return [float(part) for part in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_the_thesis_s_tables():
    rows = printed()
    image = 1 / (1 / 8e-3 - 1 / 0.5)  # the lens equation
    scale = 0.5 / image
    assert numbers(rows["magnification"]) == [pytest.approx(-1 / scale, rel=1e-5)]
    for name, side in zip(
        ("width", "height", "diagonal"), (*SIDES, math.hypot(*SIDES)), strict=True
    ):
        angle = math.degrees(2 * math.atan(side / 2 / image))
        assert numbers(rows[name]) == pytest.approx([angle, side * scale], rel=1e-3)
    assert numbers(rows["clear diameter"]) == [2.0]
    assert numbers(rows["clear aperture"])[0] == pytest.approx(math.pi, rel=1e-5)
    # eq 2.17: the sine of half the cone that the image sees
    sine = math.sin(math.atan(1e-3 / image))
    assert numbers(rows["numerical aperture"]) == [pytest.approx(sine, rel=1e-5)]
    assert numbers(rows["wavelengths"])[:3] == [31, 400, 700]


def test_coordinates_of_the_samples_in_space_and_angle():
    """Centers of samples as wide as the resolution, over the side that the array sees."""
    rows = printed()
    image = 1 / (1 / 8e-3 - 1 / 0.5)
    for name, side in (("column coordinates", SIDES[0]), ("row coordinates", SIDES[1])):
        count, low, high, first, last = numbers(rows[name])[:5]
        half = side / 2 * (1 - 1 / count)  # the count is rounded, one in 360 samples
        assert (-low, high) == pytest.approx((half * 0.5 / image,) * 2, rel=3e-3)
        angle = math.degrees(math.atan(half / image))
        assert (-first, last) == pytest.approx((angle, angle), rel=3e-3)


def test_depth_of_field_for_a_pixel():
    """f^2 / (N c) + f, and where 1 / d is N c / (f v) away from 1 / s (v: image distance)."""
    rows = printed()
    image = 1 / (1 / 8e-3 - 1 / 0.5)
    away = 4 * 10e-6 / (8e-3 * image)
    near, far, circle = numbers(rows["depth of field"])
    assert circle == 10
    assert (near, far) == pytest.approx((1 / (1 / 0.5 + away), 1 / (1 / 0.5 - away)), rel=1e-4)
    assert numbers(rows["hyperfocal distance"])[0] == pytest.approx(1.6 + 8e-3, rel=1e-4)


def test_samples_end_where_the_frequencies_do():
    """Of samples p apart the highest frequency is 1 / 2p; of a side w they are 1 / 2w apart."""
    rows = printed()
    across, pitch = numbers(rows["spatial resolution"])
    (highest,) = numbers(rows["highest frequency"])
    assert highest == pytest.approx(1e3 / (2 * pitch), rel=1e-3)
    image = 1 / (1 / 8e-3 - 1 / 0.5)
    assert across == pytest.approx(pitch * 1e-6 * 0.5 / image, rel=1e-3)
    for name, side, count in zip(
        ("support of fx", "support of fy"),
        SIDES,
        reversed(numbers(rows["rows, columns"])),
        strict=True,
    ):
        low, high, step = numbers(rows[name])
        assert (low, high) == (0, highest)
        assert high / step == pytest.approx(count, abs=1)
        assert step == pytest.approx(0.5e-3 / side, rel=1e-3)


def test_a_scene_known_in_closed_form_has_no_samples():
    rows = printed("scene.source={kind: chart, chart: sinusoid, frequency: 20 lp/mm}")
    assert "closed form" in rows["samples"]
    assert "highest frequency" not in rows


def test_infinity_has_angles_alone():
    rows = printed("scene.distance=infinity")
    assert rows["distance"] == "infinite"
    assert rows["width"].endswith("infinite")
    assert numbers(rows["width"]) == [pytest.approx(math.degrees(2 * math.atan(1 / 8)), rel=1e-3)]


def test_it_is_of_one_scene():
    done = CliRunner().invoke(app, ["plan", "starter", "--geometry", "--scenes", "all"])
    assert done.exit_code == 2
    assert "leave out --scenes" in done.output
