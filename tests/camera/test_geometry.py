"""Where everything lies: solved from whatever determines it, refused where it contradicts itself.

Expected numbers are worked out in the tests; 1e-9 leaves room for rounding only.
"""

import math
from itertools import combinations

import pytest
from making import GONE, camera, tree

from vcam_cli import load
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.errors import BadInput


def solved(folder, **changes) -> Geometry:
    return geometry(camera(folder, {k.replace("__", "."): v for k, v in changes.items()}))


def refused(folder, changes: dict) -> list:
    """The problems of a camera file, as they are told when it is loaded."""
    with pytest.raises(BadInput) as caught:
        camera(folder, changes)
    return list(caught.value.problems)


# --- the lens: f/4, 5 mm, an aperture of 1.25 mm, a scene at 1 m ----------------------------------

F, N, DISTANCE = 5e-3, 4.0, 1.0
ONE_MINUS_M = DISTANCE / (DISTANCE - F)
DIAGONAL = 5e-6 * math.hypot(48, 64)
TRIPLE = {
    "f_number": N,
    "focal_length": "5 mm",
    "aperture_diameter": "1.25 mm",
    "field_of_view": f"{2 * math.atan(DIAGONAL / 2 / (F * ONE_MINUS_M))!r} rad",
    "numerical_aperture": 1 / math.sqrt(1 + 4 * (N * ONE_MINUS_M) ** 2),
}
SAME = ({"focal_length", "field_of_view"}, {"f_number", "numerical_aperture"})
PAIRS = [pair for pair in combinations(TRIPLE, 2) if set(pair) not in SAME]


def lens(*names: str, **more) -> dict:
    return {"optics": {name: TRIPLE[name] for name in names} | more}


@pytest.mark.parametrize(
    ("pupil", "working"), [("15 mm", 3.0), ("20 mm", 2.0), ("auto", 2.0), ("10 m", 1.001001)]
)
def test_near_by_the_exit_pupil_sets_the_working_f_number(pupil, working, tmp_path):
    """Life size through 10 mm: f (P + 1) from the sensor, of diameter P f / N."""
    given = {"focal_length": "10 mm", "f_number": 4, "exit_pupil_distance": pupil}
    g = solved(tmp_path, optics=given, scene__distance="20 mm")
    assert g.magnification == pytest.approx(-1)
    assert g.working_f_number == pytest.approx(4 * working, rel=1e-6)
    cone = math.pi * math.sin(math.atan(1 / (2 * 4 * working))) ** 2
    assert g.irradiance_per_radiance == pytest.approx(cone, rel=1e-6)
    assert g.report(1)["diffraction_cutoff_550nm"] == pytest.approx(
        1 / (550e-9 * 4 * working), rel=1e-6
    )
    by_aperture = {"focal_length": "10 mm", "exit_pupil_distance": pupil}
    by_aperture["numerical_aperture"] = math.sqrt(cone / math.pi)
    same = solved(tmp_path, optics=by_aperture, scene__distance="20 mm")
    assert same.f_number == pytest.approx(4, rel=1e-6)
    by_both = {n: v for n, v in by_aperture.items() if n != "focal_length"}
    by_both["aperture_diameter"] = "2.5 mm"
    same = solved(tmp_path, optics=by_both, scene__distance="20 mm")
    assert (same.focal_length, same.f_number) == pytest.approx((10e-3, 4), rel=1e-6)


@pytest.mark.parametrize("distance", ["15 mm", "40 mm", "infinity"])
def test_blur_beside_the_focus_through_pupils_of_different_size(distance, tmp_path):
    """The cone of a point fills the entrance pupil, and is cut in the plane that is in focus."""
    f, number, larger = 10e-3, 4.0, 0.5
    given = {"focal_length": "10 mm", "f_number": number, "exit_pupil_distance": "15 mm"}
    given["focus_distance"] = "20 mm"
    g = solved(tmp_path, optics=given, scene__distance=distance)
    behind = f * (1 / larger - 1)  # of the principal plane: the entrance pupil
    sharp = 20e-3 + behind
    at = math.inf if distance == "infinity" else float(distance.split()[0]) * 1e-3 + behind
    blur = f / number * (1 - sharp / at)  # in the plane in focus, and at life size on the sensor
    assert g.focus_shift / g.working_f_number == pytest.approx(-blur, rel=1e-9)


def test_an_exit_pupil_that_no_light_leaves_is_refused(tmp_path):
    given = {"focal_length": "10 mm", "f_number": 4, "exit_pupil_distance": "9 mm"}
    [problem] = refused(tmp_path, {"optics": given, "scene.distance": "20 mm"})
    assert problem.path == ("optics", "exit_pupil_distance")
    assert "10 mm before the sensor" in problem.message


@pytest.mark.parametrize("pair", PAIRS, ids=" and ".join)
def test_every_pair_determines_the_lens(pair, tmp_path):
    g = solved(tmp_path, **lens(*pair))
    assert g.focal_length == pytest.approx(F, rel=1e-9)
    assert g.f_number == pytest.approx(N, rel=1e-9)
    assert g.aperture_diameter == pytest.approx(1.25e-3, rel=1e-9)
    assert g.magnification == pytest.approx(-F / (DISTANCE - F), rel=1e-9)
    assert g.image_distance == pytest.approx(F * ONE_MINUS_M, rel=1e-9)
    assert g.working_f_number == pytest.approx(N * ONE_MINUS_M, rel=1e-9)
    assert g.numerical_aperture == pytest.approx(TRIPLE["numerical_aperture"], rel=1e-9)


@pytest.mark.parametrize("count", [3, 4, 5])
def test_more_than_two_are_fine_where_they_agree(count, tmp_path):
    for names in combinations(TRIPLE, count):
        g = solved(tmp_path, **lens(*names))
        assert (g.focal_length, g.f_number) == pytest.approx((F, N), rel=1e-9)


@pytest.mark.parametrize("pair", PAIRS, ids=" and ".join)
def test_every_pair_at_infinity(pair, tmp_path):
    """No magnification: the image is at the focal length, tan theta = 1 / (2 N)."""
    angle = f"{2 * math.atan(DIAGONAL / 2 / F)!r} rad"
    far = TRIPLE | {"field_of_view": angle, "numerical_aperture": 1 / math.sqrt(1 + 4 * N**2)}
    optics = {name: far[name] for name in pair}
    g = solved(tmp_path, optics=optics, scene__distance="infinity")
    assert (g.focal_length, g.f_number) == pytest.approx((F, N), rel=1e-9)
    assert g.magnification == 0
    assert g.image_distance == g.focal_length
    assert g.object_distance == math.inf


def test_a_part_in_a_thousand_is_agreement_and_more_is_not(tmp_path):
    solved(tmp_path, **lens("f_number", "focal_length", aperture_diameter="1.2509 mm"))
    problems = refused(tmp_path, lens("f_number", "focal_length", aperture_diameter="1.26 mm"))
    assert [p.path for p in problems] == [("optics", "aperture_diameter")]


@pytest.mark.parametrize(
    ("optics", "path"),
    [
        (lens("f_number", "focal_length", aperture_diameter="2 mm"), "aperture_diameter"),
        (lens("f_number", "focal_length", field_of_view="46 deg"), "field_of_view"),
        (lens("f_number", "focal_length", numerical_aperture=0.3), "numerical_aperture"),
        (lens("aperture_diameter", "focal_length", numerical_aperture=0.3), None),
    ],
)
def test_lenses_that_contradict_themselves(optics, path, tmp_path):
    [problem] = refused(tmp_path, optics)
    assert problem.path[0] == "optics"
    assert path is None or problem.path == ("optics", path)
    assert problem.where.startswith("made.yaml:") or "made.yaml:" in problem.where
    assert "give two of f_number, focal_length and aperture_diameter" in problem.remedy


@pytest.mark.parametrize("pair", SAME, ids=lambda pair: " and ".join(sorted(pair)))
def test_two_names_of_one_quantity_are_not_two(pair, tmp_path):
    [problem] = refused(tmp_path, lens(*sorted(pair)))
    assert problem.path == ("optics",)
    assert "not determined" in problem.message
    assert problem.remedy


@pytest.mark.parametrize("distance", ["5 mm", "4 mm", "1 um"])
def test_no_image_from_within_the_focal_length(distance, tmp_path):
    [problem] = refused(tmp_path, {"scene.distance": distance})
    assert problem.path == ("scene", "distance")
    assert "no real image" in problem.message
    assert "further away" in problem.remedy


@pytest.mark.parametrize(
    ("optics", "key"),
    [
        ({"f_number": 0.49, "focal_length": "5 mm"}, "f_number"),
        ({"aperture_diameter": "10.3 mm", "focal_length": "5 mm"}, "aperture_diameter"),
        ({"f_number": 1e5, "focal_length": "5 mm"}, "f_number"),
        ({"aperture_diameter": "1 nm", "focal_length": "5 mm"}, "aperture_diameter"),
    ],
)
def test_lenses_that_air_does_not_allow(tmp_path, optics: dict, key: str) -> None:
    """However the f-number is told; f/0.5 itself is a lens."""
    (problem,) = refused(tmp_path, {"optics": optics})
    assert problem.path == ("optics", key)
    assert problem.remedy or "0.5" in problem.message or "10000" in problem.message
    assert solved(tmp_path, optics={"f_number": 0.5, "focal_length": "5 mm"}).f_number == 0.5


@pytest.mark.parametrize("given", ["1 K", "1e6 K", "-270 degC"])
@pytest.mark.parametrize(
    "key", ["pixel.temperature", "pixel.photodetector.dark_current_density.temperature"]
)
def test_temperatures_that_silicon_does_not_stand(tmp_path, key: str, given: str) -> None:
    density = {"pixel.photodetector.dark_current_density": {"value": "1 nA/cm2"}}
    (problem,) = refused(tmp_path, density | {key: given})
    assert problem.path == tuple(key.split("."))
    assert "out of range" in problem.message


SIDES = [("horizontal", 64), ("vertical", 48), ("diagonal", 80)]


@pytest.mark.parametrize(("side", "extent"), SIDES)
def test_a_field_of_view_says_what_it_is_over(side, extent, tmp_path):
    """Of 64 x 48 pixels: 90 degrees are an image distance of half the extent."""
    g = solved(
        tmp_path,
        optics={"f_number": 2, "field_of_view": {side: "90 deg"}},
        scene__distance="infinity",
    )
    report = g.report(1)
    assert report[f"field_of_view_{side}"] == pytest.approx(math.pi / 2, rel=1e-9)
    assert report["focal_pixels_x"] == pytest.approx(extent / 2, rel=1e-9)
    assert report["focal_pixels_y"] == pytest.approx(extent / 2, rel=1e-9)


@pytest.mark.parametrize("wrong", [{}, {"horizontal": "9 deg", "vertical": "8 deg"}, {"x": 1}])
def test_a_field_of_view_is_over_one_thing(wrong, tmp_path):
    problems = refused(tmp_path, {"optics": {"f_number": 2, "field_of_view": wrong}})
    assert all("field_of_view" in problem.path for problem in problems)


def test_a_field_of_view_spans_the_diagonal_of_the_array(tmp_path):
    """90 degrees over 5 x 4 um pixels with gaps: the image distance is half the diagonal."""
    g = solved(
        tmp_path,
        optics={"f_number": 2, "field_of_view": "90 deg"},
        scene__distance="infinity",
        pixel__height="4 um",
        pixel__gap_x="1 um",
    )
    half = 0.5 * math.hypot(64 * 6e-6, 48 * 4e-6)
    assert g.focal_length == pytest.approx(half, rel=1e-9)
    report = g.report(1)
    assert report["field_of_view_diagonal"] == pytest.approx(math.pi / 2, rel=1e-9)
    assert report["field_of_view_horizontal"] == pytest.approx(
        2 * math.atan(32 * 6e-6 / half), rel=1e-9
    )


# --- the array -----------------------------------------------------------------------------------


def die(width: str, height: str) -> dict:
    keys = {"array__rows": GONE, "array__columns": GONE}
    return keys | {"array__die": {"width": width, "height": height}}


@pytest.mark.parametrize(
    ("width", "height", "counts"),
    [
        ("0.5 mm", "0.25 mm", (50, 100)),
        ("0.5024 mm", "0.2524 mm", (50, 100)),  # rounded down,
        ("0.5026 mm", "0.2526 mm", (51, 101)),  # rounded up
        ("5 um", "5 um", (1, 1)),
        ("3 um", "3 um", (1, 1)),
    ],
)
def test_a_die_holds_as_many_pixels_as_round_to_it(width, height, counts, tmp_path):
    g = solved(tmp_path, **die(width, height))
    assert (g.rows, g.columns) == counts
    # the scene covers count x pitch, not the die
    assert g.sensor_width == pytest.approx(counts[1] * 5e-6, rel=1e-12)


def test_gaps_belong_to_the_pitch(tmp_path):
    g = solved(tmp_path, **die("0.6 mm", "0.55 mm"), pixel__gap_x="1 um", pixel__gap_y="0.5 um")
    assert (g.pitch_x, g.pitch_y) == pytest.approx((6e-6, 5.5e-6), rel=1e-12)
    assert (g.rows, g.columns) == (100, 100)
    assert g.report(2)["sample_pitch_sensor"] == pytest.approx(3e-6, rel=1e-12)
    assert g.report(2)["nyquist_frequency"] == pytest.approx(0.5 / 6e-6, rel=1e-12)


def test_a_die_smaller_than_a_pixel(tmp_path):
    changes = {k.replace("__", "."): v for k, v in die("2 um", "1 mm").items()}
    [problem] = refused(tmp_path, changes)
    assert problem.path == ("array", "die")
    assert "smaller than one pixel" in problem.message
    assert problem.remedy


# --- the photodetector ---------------------------------------------------------------------------


def detector(**keys) -> dict:
    return {"pixel.photodetector": {"quantum_efficiency": 0.5} | keys}


def test_a_fill_factor_is_centered_and_has_the_pixels_shape(tmp_path):
    g = solved(tmp_path, **detector(fill_factor=0.25), pixel__height="4 um", pixel__gap_x="1 um")
    assert (g.detector_width, g.detector_height) == pytest.approx((2.5e-6, 2e-6), rel=1e-12)
    assert (g.detector_x, g.detector_y) == pytest.approx((0, 0), abs=1e-18)
    assert g.fill_factor == pytest.approx(0.25, rel=1e-12)
    assert g.detector_area == pytest.approx(5e-12, rel=1e-12)


def test_a_size_without_a_place_is_centered(tmp_path):
    g = solved(tmp_path, **detector(width="3 um", height="1 um"))
    assert (g.detector_x, g.detector_y) == pytest.approx((0, 0), abs=1e-18)
    assert g.fill_factor == pytest.approx(3 / 25, rel=1e-12)


def test_a_place_counts_from_the_upper_left_corner(tmp_path):
    """Its center lies x + w/2 - pixel/2 to the right, y + h/2 - pixel/2 down."""
    g = solved(tmp_path, **detector(width="3 um", height="1 um", x="0.5 um", y="3.5 um"))
    assert g.detector_x == pytest.approx(-0.5e-6, rel=1e-9)
    assert g.detector_y == pytest.approx(1.5e-6, rel=1e-9)
    corner = solved(tmp_path, **detector(fill_factor=0.25, x="0 um", y="2.5 um"))
    assert corner.detector_x == pytest.approx(-1.25e-6, rel=1e-9)
    assert corner.detector_y == pytest.approx(1.25e-6, rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "side"),
    [
        ({"width": "6 um", "height": "3 um"}, "width"),
        ({"width": "3 um", "height": "6 um"}, "height"),
        ({"width": "3 um", "height": "3 um", "x": "2.1 um"}, "width"),
        ({"fill_factor": 0.5, "y": "3 um"}, "height"),
    ],
)
def test_a_photodetector_that_leaves_its_pixel(keys, side, tmp_path):
    [problem] = refused(tmp_path, detector(**keys))
    assert problem.path == ("pixel", "photodetector", side)
    assert "5 um" in problem.message
    assert "make it smaller" in problem.remedy


def test_a_photodetector_that_fills_its_pixel(tmp_path):
    for keys in ({"fill_factor": 1}, {"width": "5 um", "height": "5 um", "x": "0 um", "y": "0 um"}):
        assert solved(tmp_path, **detector(**keys)).fill_factor == pytest.approx(1, rel=1e-9)


def test_size_and_fill_factor_must_agree(tmp_path):
    solved(tmp_path, **detector(width="3 um", height="3 um", fill_factor=0.3601))
    [problem] = refused(tmp_path, detector(width="3 um", height="3 um", fill_factor=0.3))
    assert problem.path == ("pixel", "photodetector", "fill_factor")


# --- the scene -----------------------------------------------------------------------------------


def test_a_stated_width_is_seen_magnified(tmp_path):
    g = solved(tmp_path, scene__extent={"width": "10 cm"})
    assert g.scene_width_on_sensor == pytest.approx(0.1 * F / (DISTANCE - F), rel=1e-9)
    assert solved(tmp_path).scene_width_on_sensor is None


def test_a_scene_at_infinity_has_no_width(tmp_path):
    changes = {"scene.extent": {"width": "10 cm"}, "scene.distance": "infinity"}
    [problem] = refused(tmp_path, changes)
    assert problem.path == ("scene", "extent")
    assert "infinity" in problem.message
    assert "extent: sensor" in problem.remedy
    assert solved(tmp_path, scene__distance="infinity").report(1)["scene_width"] == math.inf


def test_the_sensor_sees_its_size_over_the_magnification(tmp_path):
    report = solved(tmp_path).report(1)
    assert report["scene_width"] == pytest.approx(64 * 5e-6 * (DISTANCE - F) / F, rel=1e-9)
    assert report["clear_aperture_area"] == pytest.approx(math.pi / 4 * 1.25e-3**2, rel=1e-9)
    cutoff = 1 / (550e-9 * N * ONE_MINUS_M)
    assert report["diffraction_cutoff_550nm"] == pytest.approx(cutoff, rel=1e-9)


# --- all of it -----------------------------------------------------------------------------------


def test_contradictions_are_told_all_at_once(tmp_path):
    changes = {
        "optics.aperture_diameter": "3 mm",
        "pixel.photodetector.x": "4 um",
        "scene.extent": {"width": "1 m"},
        "array": {"die": {"width": "1 um", "height": "1 um"}, "pattern": "monochrome"},
    }
    problems = refused(tmp_path, changes)
    assert {p.path for p in problems} == {
        ("optics", "aperture_diameter"),
        ("pixel", "photodetector", "width"),
        ("array", "die"),
    }
    assert all("made.yaml:" in p.where and p.remedy for p in problems)


def test_a_camera_that_is_right_is_not_refused(tmp_path):
    assert load(camera(tmp_path).origin).name == tree({})["name"]


def test_the_geometry_of_the_camera_before_is_kept():
    made = load("starter")
    first = geometry(made)
    assert geometry(made.model_copy()) is first
    assert geometry(load("starter", ["pixel.width=9 um"])) != first
    assert geometry(made) == first


def test_the_geometry_of_a_lens_in_a_file_is_solved_anew(tmp_path):
    """The file may have changed."""
    table = tmp_path / "distortion.csv"
    table.write_text("image_height_mm,distortion_percent\n0,0\n1,1\n")
    made = load("starter", [f"optics.distortion={{file: {table}}}"])
    assert geometry(made) == geometry(made)
    assert geometry(made) is not geometry(made)
