"""Distortion and color errors of the lens in whole frames: centers of points, refusals."""

import math
import struct

import numpy as np
import pytest
from making import GONE, QUIET, camera, radiance_for
from moving_waves import COLUMNS, IMAGE, PITCH, ROWS

from vcam_cli import load, plan, simulate
from vcam_cli.errors import BadInput
from vcam_cli.image_formation import warps

SPACING = 50e-6
"""Of the points [m]: 10 pixels. Their diameter is 4.241 pixels, where J1(pi d) is 0: so pixels that
are squares of light see the centers of discs where they are."""
POINTS = {
    "scene.source": {
        "kind": "chart",
        "chart": "point-grid",
        "spacing": "50 um",
        "diameter": "21.206 um",
    },
    "scene.radiance": radiance_for(20000),
    "optics.diffraction": False,
    "pixel.photodetector.fill_factor": 1.0,
    "accuracy": "standard",
    "effects": QUIET | {"quantization": "off"},
}
PIXEL = 0.01
"""What centers of points may err [pixels]."""


def seen(folder, changes: dict) -> np.ndarray:
    return simulate(camera(folder, POINTS | changes)).mean_electrons.astype(float)


def centers(image: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Centroids x + i y [pixels from the center] near expected ones, by light within 4 pixels."""
    found = []
    for z in expected:
        column, row = z.real + (COLUMNS - 1) / 2, z.imag + (ROWS - 1) / 2
        left, top = round(column) - 4, round(row) - 4
        part = image[top : top + 9, left : left + 9]
        y, x = np.mgrid[top : top + 9, left : left + 9]
        light = part.sum()
        at = (part * x).sum() / light + 1j * (part * y).sum() / light
        found.append(at - (COLUMNS - 1) / 2 - 1j * (ROWS - 1) / 2)
    return np.array(found)


def grid() -> np.ndarray:
    """Points of the grid whose light lies on the array wherever it is displaced [pixels]."""
    x, y = np.meshgrid(np.arange(-2, 3), np.arange(-1, 2))
    return (x + 1j * y).ravel() * SPACING / PITCH


FOCAL = IMAGE / PITCH
"""Image distance [pixels]."""


def imaged(place, points: np.ndarray) -> np.ndarray:
    """Centers of light of discs about points: each part is as bright as it is large."""
    radius, step = 0.5 * 21.206e-6 / PITCH, 1e-3
    x, y = np.meshgrid(np.linspace(-radius, radius, 61), np.linspace(-radius, radius, 61))
    disc = (x + 1j * y)[np.hypot(x, y) <= radius]
    z = points[:, None] + disc
    dx, dy = (place(z + step) - place(z)) / step, (place(z + 1j * step) - place(z)) / step
    area = np.abs((dx.conj() * dy).imag)
    return (place(z) * area).sum(axis=1) / area.sum(axis=1)


def k1(z):
    return z * (1 - 25 * np.abs(z / FOCAL) ** 2)


@pytest.mark.parametrize(
    ("lens", "place"),
    [
        ({"optics.distortion": {"k1": -25}}, k1),
        (
            {"optics.distortion": {"p1": 0.5, "k1": -10}},
            lambda z: (
                z * (1 - 10 * np.abs(z / FOCAL) ** 2)
                + (z.real * z.imag + 0.5j * (np.abs(z) ** 2 + 2 * z.imag**2)) / FOCAL
            ),
        ),
    ],
)
def test_points_lie_where_the_model_images_them(lens, place, tmp_path):
    points = grid()
    expected = imaged(place, points)
    assert np.abs(expected - points).max() > 0.2
    found = centers(seen(tmp_path, lens), expected)
    assert np.abs(found - expected).max() < PIXEL


def test_lateral_color_moves_points_by_their_mean_magnification(tmp_path):
    """Of equal energy there are as many photons as the wavelength is long."""
    light = {
        "scene.illuminant": "equal-energy",
        "scene.wavelengths": {"start": "500 nm", "stop": "600 nm"},
        "optics.lateral_color": {"table": {500: "0 %", 600: "2 %"}},
    }
    w = np.linspace(500, 600, 2001)
    mean = np.trapezoid(w * 0.02 * (w - 500) / 100, w) / np.trapezoid(w, w)
    expected = grid() * (1 + mean)
    found = centers(seen(tmp_path, light), expected)
    assert np.abs(found - expected).max() < PIXEL


def test_lateral_color_that_groups_would_miss_takes_every_wavelength(tmp_path, monkeypatch):
    """Each has an image of its own, and their sum is that of groups within the tolerance."""
    light = {
        "scene.illuminant": "equal-energy",
        "scene.wavelengths": {"start": "500 nm", "stop": "600 nm"},
        "optics.lateral_color": {"table": {500: "0 %", 600: "0.3 %"}},
    }
    grouped = seen(tmp_path, light)
    images = []
    form = warps.image_layers

    def counted(path, scene):
        images.append(path.transfer.wavelengths)
        return form(path, scene)

    monkeypatch.setattr(warps, "image_layers", counted)
    monkeypatch.setattr(warps.GroupError, "rms", lambda *_: np.inf)
    every = seen(tmp_path, light)
    assert {len(own) for own in images} == {1}
    assert len(images) == len(np.unique(np.concatenate(images))) > 10
    error = np.sqrt(np.mean((every - grouped) ** 2)) / every.max()
    assert 0 < error <= 5e-3


def test_the_measured_lens_shows_what_was_measured(tmp_path):
    """Magnification against 550 nm at two wavelengths, from the part that ships."""
    table = load("starter").with_({"optics": "computar-8mm"}).optics.lateral_color
    lens = {"optics.lateral_color": {"table": {f"{w:g}": f"{100 * m} %" for w, m in table.points}}}
    points, found = grid(), {}
    for wavelength in (500, 550, 700):
        light = {"scene.illuminant": {"monochromatic": f"{wavelength} nm"}}
        at = centers(seen(tmp_path, lens | light), points)
        found[wavelength] = float((at * points.conj()).real.sum() / (np.abs(points) ** 2).sum())
    assert found[500] / found[550] - 1 == pytest.approx(-0.85e-3, abs=2e-4)
    assert found[700] / found[550] - 1 == pytest.approx(3.3e-3, abs=2e-4)


def test_a_shift_of_focus_is_a_defocus_of_its_wavelength(tmp_path):
    """Light of 450 nm is out of focus as if the sensor were there, that of 550 nm in focus."""
    shift = {"optics.focus_shift": {"table": {450: "60 um", 550: "0 um", 650: "-90 um"}}}
    for wavelength, defocus in ((450, 60), (550, 0), (600, -45)):
        light = {
            "scene.illuminant": {"monochromatic": f"{wavelength} nm"},
            "optics.diffraction": True,
        }
        by_color = seen(tmp_path, light | shift)
        by_defocus = seen(tmp_path, light | {"optics.defocus": f"{defocus} um"})
        np.testing.assert_allclose(by_color, by_defocus, rtol=1e-6, atol=1e-3)


def test_what_stays_below_a_hundredth_of_a_pixel_goes(tmp_path):
    """A wall shows no distortion; a scene shows none of 0.003 pixels and all of 3."""
    auto = {"effects": "auto"}
    wall = {"scene.source": {"kind": "chart", "chart": "uniform"}}
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
    for scene, coefficient, state in ((wall, -25, "off"), (edge, -0.02, "off"), (edge, -25, "on")):
        lens = {"optics.distortion": {"k1": coefficient}}
        found = plan(camera(tmp_path, POINTS | auto | scene | lens))
        [effect] = [e for e in found.effects if e["name"] == "distortion"]
        assert effect["state"] == state, (scene, coefficient)


def message(folder, changes: dict) -> str:
    with pytest.raises(BadInput) as error:
        camera(folder, POINTS | changes)
    return str(error.value)


def test_what_cannot_be_imaged_is_refused(tmp_path):
    folds = message(tmp_path, {"optics.distortion": {"k1": -400}})
    assert "optics.distortion" in folds
    assert "folds the image" in folds
    beyond = message(
        tmp_path, {"optics.projection": "equidistant", "optics.focal_length": "0.13 mm"}
    )
    assert "85 degrees" in beyond
    both = {"optics.projection": "equisolid", "optics.distortion": {"model": "fisheye", "k1": 0.1}}
    assert "contradicts" in message(tmp_path, both)
    table = tmp_path / "d.csv"
    table.write_text("image_height_mm,distortion_percent\n0,0\n0.1,0\n0.11,40\n")
    assert "folds the image" in message(tmp_path, {"optics.distortion": {"file": str(table)}})


def test_the_corrected_picture_is_that_of_a_lens_that_does_not_distort(tmp_path):
    """But for what two splines and two apertures blur: points lie where they belong."""
    steps = [{"black_level": "subtract"}, {"lens_distortion": "correct"}, {"gamma": 1}]
    changes = POINTS | {"optics.distortion": {"k1": -25}, "processing": steps}
    picture = simulate(camera(tmp_path, changes)).linear[..., 0].astype(float)
    points = grid()
    assert np.abs(centers(picture, points) - points).max() < 0.05


def test_raw_dng_says_how_to_undo_it(tmp_path):
    """WarpRectilinear has OpenCV's coefficients, in distances of the corner."""
    from vcam_cli.files.images import dng_opcodes
    from vcam_cli.simulation.output.raw_dng import _warp

    k1, k2, p1 = -25.0, 900.0, 0.2
    lens = {"optics.distortion": {"k1": k1, "k2": k2, "p1": p1}}
    found = _warp(simulate(camera(tmp_path, POINTS | lens)).frame)
    corner = math.hypot(ROWS, COLUMNS) / 2 / FOCAL
    wanted = [[1, k1 * corner**2, k2 * corner**4, 0, p1 * corner, 0]]
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    written = dng_opcodes.warp_rectilinear(found)
    assert struct.unpack(">6L", written[:24]) == (1, 1, 0x01030000, 1, 4 + 6 * 8 + 16, 1)
    assert struct.unpack(">8d", written[24:]) == (*found[0], 0.5, 0.5)


WEDGE = {
    "scene.source": {"kind": "chart", "chart": "step-wedge"},
    "array": {"rows": 120, "columns": 160, "pattern": "monochrome"},
    "effects": "auto",
}
CORNER = 100
"""Pixels from the center of that array."""
DAYLIGHT = {
    "scene.radiance": GONE,
    "scene.illuminant": "D65",
    "scene.luminance": "1000 cd/m2",
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
}


def in_plan(folder, changes: dict, name: str) -> dict:
    """What the plan says of an effect."""
    return next(e for e in plan(camera(folder, changes)).effects if e["name"] == name)


def change_by(folder, changes: dict, name: str) -> float:
    """Rms change of the mean signal by leaving an effect out, over full signal."""
    frames = [
        simulate(camera(folder, changes | {"effects": QUIET | {name: state}, "accuracy": "0.02 %"}))
        for state in ("on", "off")
    ]
    with_it, without = (frame.mean_electrons.astype(float) for frame in frames)
    return float(np.sqrt(np.mean((with_it - without) ** 2)) / with_it.max())


def test_a_hundredth_of_a_pixel_is_left_out_by_a_bound(tmp_path):
    corner = CORNER / 2
    k1 = -0.01 / corner * (FOCAL / corner) ** 2
    changes = POINTS | WEDGE | {"optics.distortion": {"k1": k1}}
    changes |= {"array.rows": 60, "array.columns": 80}
    found = in_plan(tmp_path, changes, "distortion")
    assert "by up to 0.01 pixels" in found["reason"]
    assert found["state"] == "off"
    changed = change_by(tmp_path, changes, "distortion")
    assert 1e-5 < changed <= found["contribution"] <= 0.0025
    exact = in_plan(tmp_path, changes | {"accuracy": "reference"}, "distortion")
    assert exact["state"] == "on"


def test_a_tenth_of_a_pixel_of_lateral_color_is_left_out_before_gray(tmp_path):
    percent = 0.05 / CORNER * 100
    table = {"table": {450: f"{-percent} %", 550: "0 %", 650: f"{percent} %"}}
    changes = POINTS | WEDGE | DAYLIGHT | {"optics.lateral_color": table}
    for pattern in ("monochrome", "bayer-rggb"):
        own = changes | {"array.pattern": pattern}
        found = in_plan(tmp_path, own, "lateral_color")
        assert "up to 0.1 pixels apart" in found["reason"]
        assert found["state"] == "off"
        changed = change_by(tmp_path, own, "lateral_color")
        assert 1e-5 < changed <= found["contribution"] <= 0.0025
    exact = in_plan(tmp_path, changes | {"accuracy": "reference"}, "lateral_color")
    assert exact["state"] == "on"


def test_the_ideal_picture_of_data_sets_is_distorted_as_the_raw_frame_is(tmp_path):
    """A slow wave, by the place in the scene that the camera's k1 images to each pixel."""
    frequency = 5e3
    wave = {"kind": "chart", "chart": "sinusoid", "frequency": "5 lp/mm", "contrast": 1}
    lens = {"optics.distortion": {"k1": -25}, "optics.lateral_color": {"table": {500: "1 %"}}}
    frame = simulate(camera(tmp_path, POINTS | lens | {"scene.source": wave})).frame
    x, y = np.meshgrid(np.arange(COLUMNS) - (COLUMNS - 1) / 2, np.arange(ROWS) - (ROWS - 1) / 2)
    seen = there = x + 1j * y
    for _ in range(60):
        there = there + seen - k1(there)
    light = (1 + np.cos(2 * np.pi * frequency * PITCH * there.real)) / 2
    white = frame.white_dn[0] - frame.black_dn
    ideal = (frame.ideal_dn()[0] - frame.black_dn) / white
    assert np.abs(ideal - light).max() < 2e-3
    raw = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)
    assert np.abs(raw - light).max() < 0.03  # which pixels blur; undistorted they are 0.1 apart
    assert np.ptp(frame.depth()) == 0  # along the axis


def test_raw_dng_corrects_each_color(tmp_path):
    """WarpRectilinear has a plane for each color: its magnification is that of its light."""
    from vcam_cli.simulation.output.raw_dng import _warp

    table = {"table": {450: "-1 %", 550: "0 %", 650: "1 %"}}
    lens = {"optics.distortion": {"k1": -25}, "optics.lateral_color": table}
    color = DAYLIGHT | {
        "array.pattern": "bayer-rggb",
        "pixel.photodetector.quantum_efficiency": 0.5,
        "accuracy": "draft",
    }
    frame = simulate(camera(tmp_path, POINTS | color | lens)).frame
    found = _warp(frame)
    corner = math.hypot(ROWS, COLUMNS) / 2 / FOCAL
    light = frame.transfer.weights.sum(axis=0)
    means = light @ frame.transfer.wavelengths / light.sum(axis=1) * 1e9
    change = np.interp(means, [450, 550, 650], [-0.01, 0, 0.01])
    order = [frame.mosaic.colors.index(name) for name in "RGB"]
    np.testing.assert_allclose(found[:, 0], 1 + change[order], atol=1e-4)
    assert found[0, 0] > found[1, 0] > found[2, 0]
    np.testing.assert_allclose(found[:, 1], -25 * corner**2 * found[:, 0], rtol=1e-3)
