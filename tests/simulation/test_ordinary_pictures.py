"""A photograph as the scene, with nothing said of it: its colors, its crop, its white."""

import re

import numpy as np
import OpenImageIO as oiio
import pytest
from making import GONE, camera, long_except
from typer.testing import CliRunner

from vcam_cli import simulate
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput


def write(path, rows, columns, channels):
    """A picture of random light."""
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), oiio.ImageSpec(columns, rows, channels, "float"))
    values = np.random.default_rng(1).uniform(0.1, 0.9, (rows, columns, channels))
    assert out.write_image(values.astype(np.float32))
    assert out.close()
    return {"kind": "image", "file": str(path)}


def seen(folder, source, **changes):
    shape = {"array.rows": 12, "array.columns": 16}
    return simulate(camera(folder, shape | {"scene.source": source} | changes))


@pytest.mark.parametrize(("channels", "model"), [(1, "reflectance"), (3, "mallett")])
def test_channels_tell_what_they_mean(channels, model, tmp_path):
    source = write(tmp_path / "a.exr", 12, 16, channels)
    found, stated = seen(tmp_path, source), seen(tmp_path, source | {"model": model})
    np.testing.assert_array_equal(found.dn, stated.dn)
    said = [note for note in found.notes if "mallett" in note]
    assert len(said) == (channels == 3)
    assert not any("mallett" in note for note in stated.notes)


def test_two_channels_and_colors_as_reflectance_are_refused(tmp_path):
    with pytest.raises(BadInput, match="two color channels"):
        seen(tmp_path, write(tmp_path / "two.exr", 12, 16, 2))
    with pytest.raises(BadInput, match="mallett"):
        seen(tmp_path, write(tmp_path / "a.exr", 12, 16, 3) | {"model": "reflectance"})


@pytest.mark.parametrize(
    ("rows", "columns", "lost"),
    [(12, 16, {}), (24, 32, {}), (12, 32, {"width": 50.0}), (24, 16, {"height": 50.0}),
     (15, 16, {"height": 20.0})],
)  # fmt: skip
def test_a_crop_is_said_with_how_much(rows, columns, lost, tmp_path):
    """The array is 12 x 16; what is cut follows from the two aspects alone."""
    found = seen(tmp_path, write(tmp_path / "a.exr", rows, columns, 3))
    said = " ".join(note for note in found.notes if "cropped" in note)
    cut = {side: float(part) for part, side in re.findall(r"([\d.]+)% of its (\w+)", said)}
    assert cut == lost


def test_what_an_extent_leaves_beyond_the_array_is_said(tmp_path):
    """A scene of twice the width that the array sees loses half of both sides."""
    source = write(tmp_path / "a.exr", 12, 16, 1)
    draft = {"accuracy": "draft"}
    whole = seen(tmp_path, source, **draft)
    width = whole.frame.geometry.report(1.0)["scene_width"]
    found = seen(tmp_path, source, **draft, **{"scene.extent": {"width": f"{2e3 * width} mm"}})
    assert any("50.0% of its height and 50.0% of its width" in note for note in found.notes)
    smaller = seen(tmp_path, source, **draft, **{"scene.extent": {"width": f"{500 * width} mm"}})
    assert not any("cropped" in note for note in smaller.notes)


def test_notes_stand_in_the_terminal(tmp_path):
    source = write(tmp_path / "a.exr", 12, 32, 3)
    camera(tmp_path, {"scene.source": source, "array.rows": 12, "array.columns": 16})
    done = CliRunner().invoke(app, ["run", str(tmp_path / "made.yaml"), "-o", str(tmp_path / "o")])
    assert done.exit_code == 0
    assert "50.0% of its width cut off" in done.stderr
    assert "model: mallett" in done.stderr


@pytest.mark.parametrize("illuminant", long_except(["FL2"], ["A", "D65", "FL2"]))
def test_gray_patches_are_gray_by_default(illuminant, tmp_path):
    """The lowest row of a ColorChecker, without noise, in any light: the light is known.

    Its patches are spectrally flat to a few percent, and the light's color is told from a perfect
    white: what is left of color is below 4 % of their luminance (20 % with gray world under FL2).
    """
    made = camera(
        tmp_path,
        {
            "scene.source": {"kind": "chart", "chart": "colorchecker"},
            "scene.illuminant": illuminant,
            "scene.radiance": GONE,
            "scene.luminance": "100 cd/m2",
            "array.rows": 120,
            "array.columns": 160,
            "array.pattern": "bayer-rggb",
            "optics.transmittance": "ir-cut-650",
            "processing": GONE,
        },
    )
    ideal = simulate(made).ideal
    for x in (42, 68, 93, 119):  # columns in the patches 20 to 23 of the chart's lowest row
        patch = ideal[95:105, x - 3 : x + 3].mean((0, 1))
        assert np.ptp(patch) < 0.04 * patch.mean(), (x, patch)
