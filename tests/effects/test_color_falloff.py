"""Relative illumination of each filter color from files of their own."""

import io
import math

import numpy as np
import pytest
from making import QUIET, camera

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.optics.off_axis import ColorFalloff, OffAxis
from vcam_cli.errors import BadInput
from vcam_cli.simulation.output.raw_dng import MAP_POINTS
from vcam_cli.simulation.simulate import prepare

FALLS = {"R": 0.5, "G": 0.2, "B": -0.1}
"""By how much the light of each color falls from the axis to 0.3 mm, in a straight line."""
HALF = math.hypot(64 * 5e-3, 48 * 5e-3) / 2
"""Distance of the corner from the axis [mm]."""


def files(folder, falls=FALLS):
    """Write one table of each color, in scales of their own, and return the key's value."""
    for scale, (color, fall) in enumerate(falls.items(), 1):
        end = scale * (1 - fall)
        (folder / f"{color}.csv").write_text(f"image_height_mm,value\n0,{scale}\n0.3,{end}\n")
    return {color: {"file": f"{color}.csv"} for color in falls}


def made(folder, pattern="bayer-rggb", **changes):
    given = {"optics.off_axis": files(folder), "array.pattern": pattern}
    return camera(folder, given | {"effects": QUIET | {"off_axis": "on"}} | changes)


def straight(color: str, row: float, column: float) -> float:
    """By hand: the factor of a color at a pixel."""
    height = 5e-3 * math.hypot(row - 23.5, column - 31.5)
    return 1 - FALLS[color] * height / 0.3


BAYER = [["R", "G"], ["G", "B"]]
QUAD = [["R", "R", "G", "G"]] * 2 + [["G", "G", "B", "B"]] * 2


@pytest.mark.parametrize(("pattern", "block"), [("bayer-rggb", BAYER), ("quad-bayer", QUAD)])
def test_each_pixel_has_the_factor_of_its_color(pattern, block, tmp_path):
    """In 64 bits, of even light: over the same camera without it, at every pixel."""
    exact = {"accuracy": {"preset": "reference", "float_width": 64}}
    found = simulate(made(tmp_path, pattern, **exact)).mean_electrons
    plain = simulate(made(tmp_path, pattern, **exact | {"effects": QUIET | {"off_axis": "off"}}))
    for row, column in np.ndindex(found.shape):
        color = block[row % len(block)][column % len(block)]
        ratio = found[row, column] / plain.mean_electrons[row, column]
        assert ratio == pytest.approx(straight(color, row, column), rel=1e-6)


def test_stacked_pixels_have_it_in_every_color(tmp_path):
    found = simulate(made(tmp_path, "stacked")).mean_electrons
    off = made(tmp_path, "stacked", effects=QUIET | {"off_axis": "off"})
    plain = simulate(off).mean_electrons
    for color, ratio in zip("RGB", np.moveaxis(found / plain, -1, 0), strict=True):
        for row, column in ((0, 0), (23, 31), (47, 5)):
            assert ratio[row, column] == pytest.approx(straight(color, row, column), rel=1e-5)


def test_stray_light_is_that_of_each_color_behind_it(tmp_path):
    """Veiling glare lies behind the falloff: (1 - s) own + s mean of the color."""
    parts = {"optics.stray_light": 0.1}
    effects = QUIET | {"off_axis": "on", "stray_light": "on"}
    found = simulate(made(tmp_path, **parts, effects=effects)).mean_electrons
    plain = simulate(made(tmp_path)).mean_electrons
    red = plain[::2, ::2]
    np.testing.assert_allclose(found[::2, ::2], 0.9 * red + 0.1 * red.mean(), rtol=2e-6)


def test_bound_holds_for_every_color(tmp_path):
    """What leaving it out changes is at most the bound, of which red has the largest share."""
    shot = made(tmp_path)
    effect = OffAxis.from_camera(shot, geometry(shot))
    assert isinstance(effect, ColorFalloff)
    x, y = (np.arange(64) - 31.5) * 5e-6, (np.arange(48) - 23.5) * 5e-6
    bound = effect.mean_error(SignalLevels(full_signal=1.0, time=1.0))
    rms = [np.sqrt(np.mean((effect.of_color(c).gain(x, y) - 1) ** 2)) for c in FALLS]
    assert max(rms) <= bound <= 1.01 * max(rms)
    assert "R 33.3 % darker than the center" in effect.describe()
    assert "B 6.67 % brighter than the center" in effect.describe()


def test_the_axis_keeps_its_color(tmp_path):
    """Tables are relative to the axis: balance, base ISO and white stay."""
    with_it, without = (
        simulate(made(tmp_path, effects=QUIET | {"off_axis": state})) for state in ("on", "off")
    )
    assert with_it.metrics["base_iso"] == without.metrics["base_iso"]
    center = slice(23, 25), slice(31, 33)
    np.testing.assert_allclose(
        with_it.mean_electrons[center], without.mean_electrons[center], rtol=0.5 * 0.0036 / 0.3
    )


def test_a_raw_file_undoes_it_by_color(tmp_path):
    """raw.dng: one map of gains for each place of the mosaic, the inverse of its own color."""
    tifffile = pytest.importorskip("tifffile")
    result = simulate(made(tmp_path, **{"output.dng": True}))
    result.save(tmp_path / "out")
    with tifffile.TiffFile(tmp_path / "out" / "raw.dng") as file:
        pages = [p for page in file.pages for p in (page, *(page.pages or ()))]
        [value] = [p.tags["OpcodeList2"].value for p in pages if "OpcodeList2" in p.tags]
    data = io.BytesIO(bytes(value))
    assert int.from_bytes(data.read(4), "big") == 4
    corner = 1 / MAP_POINTS  # maps reach from edge to edge
    for color in "RGGB":
        data.read(16)
        header = data.read(32 + 8 + 32 + 4)
        assert int.from_bytes(header[32:36], "big") == MAP_POINTS
        values = np.frombuffer(data.read(4 * MAP_POINTS**2), ">f4")
        assert values[0] == pytest.approx(1 / (1 - FALLS[color] * HALF / 0.3), rel=corner * 1e-3)


@pytest.mark.parametrize("asked", [True, False])
def test_irradiance_in_front_of_the_filters_lacks_it(asked, tmp_path):
    """And a note says so; without such output there is nothing to say."""
    found = list(prepare(made(tmp_path, **{"output.irradiance": asked}), 1)[1])
    assert len([note for note in found if "in front of the filters" in note]) == asked


REFUSED = {
    "no green": ({"R": 0.1, "B": 0.2}, "off_axis", "has no table for G", "add G:"),
    "no such color": (FALLS | {"W": 0.1}, "W", "W is no color of the array", "remove W"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refuses_colors_that_are_not_those_of_the_array(name, tmp_path):
    falls, key, message, remedy = REFUSED[name]
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, {"optics.off_axis": files(tmp_path, falls), "array.pattern": "bayer-rggb"})
    [problem] = caught.value.problems
    assert problem.path[-1] == key
    assert message in problem.message
    assert remedy in problem.remedy


def test_says_which_file_is_wrong(tmp_path):
    given = files(tmp_path)
    (tmp_path / "G.csv").write_text("image_height_mm,value\n0,1\n0.1,1\n")
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, {"optics.off_axis": given, "array.pattern": "bayer-rggb"})
    [problem] = caught.value.problems
    assert problem.path == ("optics", "off_axis", "G", "file")
    assert "add rows up to 0.2 mm" in problem.remedy


@pytest.mark.parametrize("given", [{"R": 1}, {"fiel": "r.csv"}, {}, {"R": {"file": 3}}])
def test_refuses_what_is_no_table(given, tmp_path):
    with pytest.raises(BadInput):
        camera(tmp_path, {"optics.off_axis": given, "array.pattern": "bayer-rggb"})


def test_tables_by_color_replace_one_table(tmp_path, monkeypatch):
    """An override leaves nothing of the table it replaces, and the other way round."""
    monkeypatch.chdir(tmp_path)
    by_color = files(tmp_path)
    one = camera(tmp_path, {"optics.off_axis": {"file": "R.csv"}, "array.pattern": "bayer-rggb"})
    several = one.with_({"optics.off_axis": by_color})
    assert set(several.optics.off_axis) == {"R", "G", "B"}
    assert several.with_({"optics.off_axis": {"file": "R.csv"}}).optics == one.optics
