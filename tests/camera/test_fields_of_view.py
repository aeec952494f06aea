"""Fields of view of lenses that are no pinholes: by their own formulas, and back."""

import math

import pytest
from making import GONE, camera

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.lens_mapping import fields_of_view

WIDTH, HEIGHT = 64 * 5e-6, 48 * 5e-6
HEIGHTS = {
    "equidistant": lambda t: t,
    "equisolid": lambda t: 2 * math.sin(t / 2),
    "stereographic": lambda t: 2 * math.tan(t / 2),
    "orthographic": math.sin,
}
FAR = {"scene.distance": "infinity", "optics.focal_length": GONE}


def seen(folder, changes):
    model = camera(folder, FAR | changes)
    found = geometry(model)
    return found, fields_of_view(model, found)


@pytest.mark.parametrize("name", HEIGHTS)
@pytest.mark.parametrize("side", ["horizontal", "vertical", "diagonal"])
def test_a_projection_sees_its_field_of_view(tmp_path, name, side):
    half = {"horizontal": WIDTH, "vertical": HEIGHT, "diagonal": math.hypot(WIDTH, HEIGHT)}[
        side
    ] / 2
    changes = {"optics.projection": name, "optics.field_of_view": {side: "70 deg"}}
    found, angles = seen(tmp_path, changes)
    assert found.focal_length == pytest.approx(half / HEIGHTS[name](math.radians(35)), rel=1e-12)
    assert angles[f"field_of_view_{side}"] == pytest.approx(math.radians(70), rel=1e-9)


@pytest.mark.parametrize(
    "distortion",
    [{"k1": -0.05, "p1": 0.002}, {"model": "fisheye", "k1": 0.01}],
    ids=["k1", "fisheye"],
)
def test_coefficients_see_it_too(tmp_path, distortion):
    changes = {"optics.distortion": distortion, "optics.field_of_view": "60 deg"}
    _, angles = seen(tmp_path, changes)
    # of the lower right corner and the upper left one, which tangential distortion tells apart
    assert angles["field_of_view_diagonal"] == pytest.approx(math.radians(60), rel=2e-3)


def test_a_table_sees_it_too(tmp_path):
    file = tmp_path / "d.csv"
    file.write_text("image_height_mm,distortion_percent\n0,0\n0.3,-12\n", encoding="utf-8")
    changes = {"optics.distortion": {"file": str(file)}, "optics.field_of_view": "60 deg"}
    found, angles = seen(tmp_path, changes)
    half = math.hypot(WIDTH, HEIGHT) / 2
    ideal = half / (1 - 0.12 * half / 0.3e-3)
    assert found.focal_length == pytest.approx(ideal / math.tan(math.radians(30)), rel=1e-9)
    assert angles["field_of_view_diagonal"] == pytest.approx(math.radians(60), rel=1e-9)


def test_a_pinhole_has_the_numbers_of_its_geometry(tmp_path):
    assert seen(tmp_path, {"optics.field_of_view": "60 deg"})[1] == {}
