"""Motion: blur and skew against closed forms, and against sums over instants of still scenes."""

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import yaml
from making import GONE, QUIET, camera, long_except, radiance_for, tree

from vcam_cli import load, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.image_motion import trajectory
from vcam_cli.errors import BadInput
from vcam_cli.simulation import checks

PITCH, ROWS, COLUMNS, TIME, LINE = 5e-6, 48, 64, 0.01, 50e-6
SCALE = 5e-3 / (1 - 5e-3)
"""Size of the magnification of a thin lens of 5 mm at 1 m."""
STILL = {"scene.radiance": radiance_for(40000), "effects": QUIET}
ROLLING = {"exposure": {"time": "10 ms", "shutter": {"rolling": {"line_time": "50 us"}}}}
RISING = {
    "exposure": {
        "time": "10 ms",
        "shutter": {"rolling": {"line_time": "50 us", "direction": "up"}},
    }
}
PATHS = [(3.0, 0.0), (0.0, 5.5), (2.0, -1.5)]
"""Of the image in the exposure [pixels]."""
EVERY_PATH = pytest.mark.parametrize("path", PATHS)


def motion(path: tuple[float, float]) -> dict:
    """Motion that takes the image so many pixels in the exposure."""
    x, y = (f"{pixels * PITCH / SCALE / TIME!r} m/s" for pixels in path)
    return {"x": x, "y": y}


def mean(folder, *changes: dict) -> np.ndarray:
    merged = dict(STILL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged)).mean_electrons


def delays(exposure: dict) -> np.ndarray:
    """When each row is exposed, after the middle of the array, over the exposure time."""
    rows = np.arange(ROWS) - (ROWS - 1) / 2
    return {0: 0.0, 1: 1.0, 2: -1.0}[[{}, ROLLING, RISING].index(exposure)] * rows * LINE / TIME


@pytest.mark.parametrize("exposure", [{}, ROLLING, RISING], ids=["global", "down", "up"])
@pytest.mark.parametrize("angle", long_except([30], [0, 90, 30]))
@EVERY_PATH
def test_a_wave_keeps_a_sinc_and_is_seen_where_it_is(path, angle, exposure, tmp_path):
    """Contrast sinc(f . path), phase by each row's time: in closed form, to rounding."""
    source = {"kind": "chart", "chart": "sinusoid", "frequency": "23 lp/mm"}
    source["orientation"] = f"{angle} deg"
    fx = 23e3 * PITCH * math.cos(math.radians(angle))
    fy = -23e3 * PITCH * math.sin(math.radians(angle))
    x, y = np.arange(COLUMNS) - (COLUMNS - 1) / 2, np.arange(ROWS) - (ROWS - 1) / 2

    def wave(dx, dy):
        return np.cos(2 * np.pi * (fx * (x - dx) + fy * (y[:, None] - dy)))

    still = mean(tmp_path, {"scene.source": source})
    basis = np.stack([np.ones(still.size), wave(0, 0).ravel()], axis=1)
    level, amplitude = np.linalg.lstsq(basis, still.ravel(), rcond=None)[0]
    moving = mean(tmp_path, {"scene.source": source | {"motion": motion(path)}}, exposure)
    left = np.sinc(fx * path[0] + fy * path[1])
    late = delays(exposure)[:, None]
    expected = level + amplitude * left * wave(path[0] * late, path[1] * late)
    np.testing.assert_allclose(moving, expected, rtol=1e-9)


def picture(file: Path, dx: float = 0.0, dy: float = 0.0) -> dict:
    """A scene of smooth waves, displaced by so many pixels, as samples of an image file."""
    fine = 8
    x = (np.arange(COLUMNS * fine) + 0.5) / fine - dx
    y = (np.arange(ROWS * fine) + 0.5) / fine - dy
    out = np.full((len(y), len(x)), 0.5)
    for k, m, strength in ((9, 0, 0.12), (0, 7, 0.1), (12, 10, 0.15)):
        along_y = np.cos(np.pi * m * y / ROWS)[:, None]
        out += strength * along_y * np.cos(np.pi * k * x / COLUMNS)
    image = oiio.ImageOutput.create(str(file))
    image.open(str(file), oiio.ImageSpec(len(x), len(y), 1, "float"))
    image.write_image(np.ascontiguousarray(out[..., None], np.float32))
    image.close()
    named = {"kind": "image", "file": str(file), "model": "reflectance", "encoding": "linear"}
    return {"scene.source": named}


@pytest.mark.parametrize("exposure", [{}, ROLLING, RISING], ids=["global", "down", "up"])
@pytest.mark.parametrize("path", long_except([(2.0, -1.5)], PATHS))
def test_a_picture_is_the_sum_of_the_instants_that_each_row_sees(path, exposure, tmp_path):
    """Gauss-Legendre over the exposure, still frames of a picture that is moved by hand.

    Left and right of the array the picture is mirrored, and a moved one has its mirror elsewhere:
    the outer columns are left out. The rest agrees to the rounding of samples into squares.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    rows = [30] if exposure else [10, 30]
    late = delays(exposure)[30]
    truth = 0.0
    for node, weight in zip(nodes / 2 + late, weights / 2, strict=True):
        still = mean(tmp_path, picture(tmp_path / "still.exr", path[0] * node, path[1] * node))
        truth = truth + weight * still[rows]
    source = picture(tmp_path / "moving.exr")
    source["scene.source"]["motion"] = motion(path)
    found = mean(tmp_path, source, exposure)[rows]
    inner = slice(12, -12)
    np.testing.assert_allclose(found[:, inner], truth[:, inner], atol=2e-4 * truth.max())


def test_skew_of_an_edge(tmp_path):
    """An upright edge leans by v line_time / pitch, within 0.5 %: its place in every row."""
    source = {"kind": "chart", "chart": "slanted-edge", "angle": "0 deg", "contrast": 1}
    path = (16.0, 0.0)
    moving = mean(tmp_path, {"scene.source": source | {"motion": motion(path)}}, ROLLING)
    dark_columns = COLUMNS - moving.sum(axis=1) / moving.max()
    slope = np.polyfit(np.arange(ROWS), dark_columns, 1)[0]
    assert slope == pytest.approx(path[0] * LINE / TIME, rel=0.005)
    profile = moving[ROWS // 2]
    # The edge's width is the path: from 10 % to 90 % it is 0.8 of it, within half a pixel.
    inside = np.flatnonzero((profile > 0.1 * profile.max()) & (profile < 0.9 * profile.max()))
    assert len(inside) == pytest.approx(0.8 * path[0], abs=1)


def test_velocity_of_the_image_from_angles_and_focal_length(tmp_path):
    """Of a far scene f w, against the turn along x, with it along y (tilt is up)."""
    turn = {"pan": "10 deg/s", "tilt": "3 deg/s"}
    made = camera(tmp_path, {"scene.camera_motion": turn, "scene.distance": "infinity"})
    x, y = trajectory(made, geometry(made)).velocity
    assert x == pytest.approx(-5e-3 * math.radians(10), rel=1e-12)
    assert y == pytest.approx(5e-3 * math.radians(3), rel=1e-12)


def test_a_pan_is_the_same_as_the_scene_passing_by(tmp_path):
    source = {"kind": "chart", "chart": "slanted-edge"}
    speed = math.radians(20) * 1.0  # at 1 m: image distance over magnification is the distance
    moved = mean(tmp_path, {"scene.source": source | {"motion": {"x": f"{-speed!r} m/s"}}})
    panned = mean(tmp_path, {"scene.source": source, "scene.camera_motion": {"pan": "20 deg/s"}})
    np.testing.assert_allclose(panned, moved, rtol=1e-9)


def test_the_plan_leaves_motion_out_where_nothing_is_seen_to_move(tmp_path):
    """Under auto it goes before a uniform field, and stays before an edge."""
    auto = {"effects": "auto", "accuracy": "standard", "scene.camera_motion": {"pan": "20 deg/s"}}
    states = []
    for chart in ("uniform", "slanted-edge"):
        source = {"scene.source": {"kind": "chart", "chart": chart}}
        for exposure in ({}, ROLLING):
            made = camera(tmp_path, STILL | auto | source | exposure)
            decisions = simulate(made).frame.plan.decisions
            states += [d.state for d in decisions if d.name == "motion"]
    assert states == ["off", "off", "on", "on"]


def test_what_is_not_in_the_file_is_said(tmp_path):
    """A picture that ends is mirrored; of a pan, corner motion is underestimated."""
    source = picture(tmp_path / "moving.exr")
    source["scene.source"]["motion"] = motion((4.0, 0.0))
    notes = simulate(camera(tmp_path, STILL | source)).notes
    assert any("up to 2 pixels move in and are mirrored" in note for note in notes)
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
    turn = {"scene.camera_motion": {"pan": "20 deg/s"}}
    [note] = [n for n in simulate(camera(tmp_path, STILL | edge | turn)).notes if "corner" in n]
    corner = math.hypot(ROWS, COLUMNS) / 2 * PITCH / (SCALE * 1.0)
    assert f"{100 * corner**2:.2g} %" in note


def test_without_speed_the_bytes_are_those_of_a_still_scene(tmp_path):
    few = {"array.rows": 12, "array.columns": 16}
    source = {"kind": "chart", "chart": "siemens-star"}
    still = mean(tmp_path, {"scene.source": source}, few)
    stopped = mean(tmp_path, {"scene.source": source | {"motion": {"x": "0 m/s"}}}, ROLLING, few)
    assert still.tobytes() == stopped.tobytes()


def test_meters_a_second_need_a_distance(tmp_path):
    far = {"scene.distance": "infinity", "scene.source.motion": {"x": "1 m/s"}}
    file = tmp_path / "wrong.yaml"
    file.write_text(yaml.safe_dump(tree(far), sort_keys=False), encoding="utf-8")
    with pytest.raises(BadInput, match="object at infinity"):
        checks.load(str(file))


def test_a_scene_may_overtake_the_shutter(tmp_path):
    """What moves faster than lines are read is seen reversed, in finite numbers."""
    edge = {"kind": "chart", "chart": "slanted-edge", "motion": {"y": "50 m/s"}}
    assert np.isfinite(mean(tmp_path, {"scene.source": edge}, ROLLING)).all()


@pytest.mark.long
def test_layers_may_overtake_the_shutter():
    sets = ["scene.source.motion.y=1000 km/s", "array.rows=12", "array.columns=16"]
    assert np.isfinite(simulate(load("street", sets)).mean_electrons).all()


@pytest.mark.parametrize("chart", ["sinusoid", "slanted-edge", "step-wedge"])
def test_rows_are_read_by_number_wherever_photodetectors_are(chart, tmp_path):
    """Before a scene that is even along columns, photodetectors in any height see the same.

    A wave, an edge that has a closed form, and a chart that is sampled.
    """
    keys = {"sinusoid": {"frequency": "40 lp/mm"}, "slanted-edge": {"angle": "0 deg"}}
    source = {"kind": "chart", "chart": chart, "motion": motion((6.0, 0.0)), **keys.get(chart, {})}
    found = []
    for top in (1.5, 2.5):
        place = {"width": "2 um", "height": "2 um", "x": "1.5 um", "y": f"{top} um"}
        place |= {"fill_factor": GONE}
        detector = {f"pixel.photodetector.{name}": value for name, value in place.items()}
        found.append(mean(tmp_path, {"scene.source": source}, ROLLING, detector))
    assert np.ptp(found[0]) > 0.1 * found[0].max()
    assert found[1] == pytest.approx(found[0], rel=1e-6)
