"""The step `lens_shading: correct`: even light comes out even, whatever fell off before."""

import numpy as np
import pytest
from making import QUIET, camera

from vcam_cli import load, simulate
from vcam_cli.camera.processing_steps import ColorCorrection, LensShading
from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, process

STEPS = ({"black_level": "subtract"}, {"lens_shading": "correct"}, {"gamma": 1})
FALLS = {"R": 0.5, "G": 0.2, "B": -0.1}
"""By how much the light of each color falls from the axis to 0.3 mm, in a straight line."""
DEMOSAIC = {"demosaic": "bilinear"}


def tables(folder):
    """Write one table of each color, and return the key's value."""
    for color, fall in FALLS.items():
        (folder / f"{color}.csv").write_text(f"image_height_mm,value\n0,1\n0.3,{1 - fall}\n")
    return {color: {"file": f"{color}.csv"} for color in FALLS}


@pytest.mark.parametrize("name", ["imx219", "imx477"])
def test_a_wall_before_a_measured_camera_is_even_and_neutral(name):
    """Corners that were down to 70 % differ from the center by less than 1e-3, in every color."""
    rows, columns = {"imx219": (2464, 3280), "imx477": (3040, 4056)}[name]
    binned = 8  # pixels as many, and as large, as have room in a test
    shot = load(name)
    changes = {
        "scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0.8},
        "array.rows": rows // binned // 2 * 2,
        "array.columns": columns // binned // 2 * 2,
        "pixel.width": f"{shot.pixel.width * binned * 1e6!r} um",
        "pixel.readout.full_well": "1000 ke",
        "adc.bits": 16,
        "effects": QUIET | {"off_axis": "on"},
        "quality": [],
    }
    usual = [
        {"black_level": "subtract"},
        {"demosaic": "bilinear"},
        {"white_balance": "illuminant"},
        {"color_correction": "fit"},
        {"gamma": 1},
    ]
    corrected = [usual[0], {"lens_shading": "correct"}, *usual[1:]]
    plain, even = (
        simulate(shot.with_(changes | {"processing": steps})).linear for steps in (usual, corrected)
    )
    center = even[rows // binned // 2, columns // binned // 2]
    assert plain.min() < 0.75 * plain.max()
    np.testing.assert_allclose(even, np.broadcast_to(center, even.shape), rtol=1e-3)
    assert np.ptp(center) < 1e-3 * center.mean()


def wall(folder, pattern, steps=STEPS, **changes):
    given = {
        "optics.off_axis": tables(folder),
        "array.pattern": pattern,
        "scene.illuminant": "E",
        "scene.radiance": "4 W/(sr m2)",
        "adc.bits": 16,
        "effects": QUIET | {"off_axis": "on"},
        "processing": list(steps),
    }
    return camera(folder, given | changes)


def light(folder, pattern, off_axis, **changes):
    """Linear light with the falloff that is undone, or without any."""
    effects = {"effects": QUIET | {"off_axis": off_axis}}
    return simulate(wall(folder, pattern, **effects | changes)).linear


QUAD = [{"black_level": "subtract"}, {"lens_shading": "correct"}, {"remosaic": "bayer-rggb"}]
REMOSAICED = [QUAD[0], QUAD[2], QUAD[1]]
WAYS = {
    "mosaic": ("bayer-rggb", {}),
    "quad": ("quad-bayer", {}),
    "remosaic behind": ("quad-bayer", {"steps": [*QUAD, DEMOSAIC, STEPS[2]]}),
    "remosaic before": ("quad-bayer", {"steps": [*REMOSAICED, DEMOSAIC, STEPS[2]]}),
    "behind demosaic": ("bayer-grbg", {"steps": [STEPS[0], DEMOSAIC, *STEPS[1:]]}),
    "stacked": ("stacked", {}),
    "binned": ("bayer-rggb", {"array.binning": {"rows": 2, "columns": 2, "kind": "charge"}}),
    "rgbw": ({"block": [["R", "B", "G"], ["G", "R", "B"], ["B", "G", "R"]]}, {}),
    "honeycomb": ("honeycomb", {"steps": [*STEPS[:2], DEMOSAIC, STEPS[2]]}),
}


NEIGHBORS = 2e-2
"""By how much the light of neighbors that stand for a pixel may differ: red falls by 1.3 % from
pixel to pixel in the corners, and pixels of one color are two apart."""
ALONE = 4e-4
"""Half a code of the darkest pixel, and what the light itself is good to."""


@pytest.mark.parametrize("way", WAYS)
def test_every_mosaic_is_as_if_nothing_fell_off(way, tmp_path):
    pattern, changes = WAYS[way]
    even, plain = (light(tmp_path, pattern, state, **changes) for state in ("on", "off"))
    interpolated = way in ("binned", "honeycomb", "behind demosaic", "remosaic before")
    np.testing.assert_allclose(even, plain, rtol=NEIGHBORS if interpolated else ALONE)


STACK = {
    "passivation": {"thickness": "0.7 um", "index": 2.0},
    "oxide": {"thickness": "6 um", "index": 1.46},
}


def test_what_pixels_keep_of_slanted_light_is_undone_too(tmp_path):
    """As the gain maps of raw.dng do."""
    pixels = {"optics.off_axis": "exact", "pixel.stack": STACK}
    lit = QUIET | {"pixel_vignetting": "on"}
    dark, even = (
        simulate(
            wall(tmp_path, "monochrome", [STEPS[0], step, STEPS[2]], **pixels, effects=lit)
        ).linear
        for step in ({"lens_shading": "none"}, {"lens_shading": "correct"})
    )
    assert dark.min() < 0.995 * dark.max()
    assert np.ptp(even) < ALONE * even.mean()


class Falling:
    """Light that falls to a half, then to a quarter, in the later rows of a picture."""

    def correction(self, color, rows, columns):
        return np.where(rows < 8, 1, np.where(rows < 16, 2, 4)).astype(np.float32)[:, None]


RGB = ("R", "G", "B")
IDENTITY = ColorCorrection.model_validate({"color_correction": {"matrix": np.eye(3).tolist()}})
CORRECT = LensShading(lens_shading="correct")


def test_a_raised_corner_is_not_taken_for_saturated():
    """Saturation rises with the light, place by place: what stays below it keeps its color."""
    context = Context(
        (RGB,), RGB, np.full(3, 100.0), 0.0, saturated_dn=100, planes=True, shading=Falling()
    )
    dn = np.broadcast_to(np.array([80.0, 60.0, 40.0])[:, None, None], (3, 24, 8)).copy()
    dn[1, 20] = 100
    seen = process(dn, context, [CORRECT, IDENTITY]).linear
    scale = np.repeat([1, 2, 4], 8)[:, None, None] / 100
    wanted = dn.transpose(1, 2, 0) * scale
    np.testing.assert_allclose(np.delete(seen, 20, 0), np.delete(wanted, 20, 0), rtol=1e-6)
    np.testing.assert_allclose(seen[20, :, 1], seen[20].max(axis=-1), rtol=1e-6)


def test_without_falloff_a_note_says_that_it_changes_nothing(tmp_path):
    for state, said in (("on", 0), ("off", 1)):
        shot = wall(tmp_path, "bayer-rggb", effects=QUIET | {"off_axis": state})
        found = [note for note in simulate(shot).notes if "lens_shading" in note]
        assert len(found) == said


MISTAKES = {
    "gains before black": (STEPS[1::-1], "lens_shading", "put black_level"),
    "by color": (
        [STEPS[0], DEMOSAIC, {"color_correction": "fit"}, STEPS[1]],
        "after color_correction",
        "put lens_shading first",
    ),
    "by place": (
        [STEPS[0], DEMOSAIC, {"lens_distortion": "correct"}, STEPS[1]],
        "after lens_distortion",
        "put lens_shading first",
    ),
    "no such way": ([{"lens_shading": "corrected"}], "corrected", "correct"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_refuses_an_order_that_cannot_work(name, tmp_path):
    steps, message, remedy = MISTAKES[name]
    with pytest.raises(BadInput) as caught:
        wall(tmp_path, "bayer-rggb", steps)
    assert message in str(caught.value)
    assert remedy in str(caught.value)


def test_scattered_pixels_need_the_grid_of_a_picture(tmp_path):
    with pytest.raises(BadInput, match="the falloff of scattered pixels"):
        wall(tmp_path, "honeycomb", **{"output.render": "none"})
