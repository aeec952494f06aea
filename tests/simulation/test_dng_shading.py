"""Gain maps of raw.dng: even light through a lens that shades is even again behind them.

Adobe's reader says which map the file has; the arithmetic of the specification (chapter 7, GainMap)
is done here with SciPy's linear interpolation.
"""

import struct
from pathlib import Path

import numpy as np
import pytest
from making import camera
from raw_readers import adobe_codes, dngpy, libraw_codes, tifffile
from scipy.interpolate import RegularGridInterpolator

from vcam_cli import simulate

EVEN = {
    "scene.radiance": "4 W/(sr m2)",
    "scene.illuminant": "D65",
    "scene.source": {"kind": "chart", "chart": "uniform"},
    "optics": {"f_number": 2.8, "focal_length": "2 mm"},
    "array": {"rows": 120, "columns": 300, "pattern": "bayer-grbg", "filters": "generic-rgb"},
    "adc": {"bits": 16, "offset": "64 DN"},
    "effects": {"off_axis": "on", "shot_noise": "off"},
    "output.dng": True,
    "output.render": "none",
}
MEASURED = "image_height_mm,value\n0,1\n0.4,0.9\n0.9,0.3\n3,0.2\n"


def taken(folder: Path, changes: dict):
    result = simulate(camera(folder, EVEN | changes))
    return result, result.save(folder / "out") / "raw.dng"


def corrected(path: Path) -> np.ndarray:
    """Codes above black times the map that Adobe's reader finds, (rows, columns, colors)."""
    gain = dngpy.Dng(str(path)).get_gainmap()
    codes = np.atleast_3d(adobe_codes(path).astype(float))
    along = [
        start + step * np.arange(count)
        for start, step, count in (
            (gain.origin_v, gain.spacing_v, gain.rows),
            (gain.origin_h, gain.spacing_h, gain.cols),
        )
    ]
    places = [(np.arange(count) + 0.5) / count for count in codes.shape[:2]]
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    gains = RegularGridInterpolator(along, gain.to_numpy()[:, :, 0])(grid)
    with tifffile.TiffFile(path) as read:
        black = np.divide(*read.pages[0].tags["BlackLevel"].value[:2])
    return (codes - black) * gains[:, :, np.newaxis]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"array": {"rows": 100, "columns": 300, "pattern": "monochrome"}},
        {"array": {"rows": 100, "columns": 150, "pattern": "stacked", "filters": "silicon-layers"}},
        {"optics": {"f_number": 2.8, "focal_length": "2 mm", "off_axis": {"file": "lens.csv"}}},
        {
            "array": {
                "rows": 120,
                "columns": 304,
                "pattern": "quad-bayer",
                "filters": "generic-rgb",
                "binning": {"rows": 2, "columns": 2, "kind": "charge"},
            },
            "optics": {"f_number": 2.8, "focal_length": "1 mm"},
        },
    ],
    ids=["bayer", "monochrome", "stacked", "measured", "binned"],
)
def test_even_light_is_even_behind_the_gain_map(changes, tmp_path, capfd):
    (tmp_path / "lens.csv").write_text(MEASURED)
    result, path = taken(tmp_path, changes)
    assert np.array_equal(libraw_codes(path), result.dn)  # LibRaw applies no opcodes
    raw = adobe_codes(path).astype(float)
    flat = corrected(path)
    step = 2 if "bayer" in result.frame.camera.array.pattern else 1
    for top, left in np.ndindex(step, step):
        lattice = flat[top::step, left::step]
        axis = lattice[len(lattice) // 2, lattice.shape[1] // 2]
        # Rounding of codes; 64 straight pieces miss a curve by less, but for corners of its slope.
        tolerance = 1e-2 if "off_axis" in changes.get("optics", {}) else 1e-3
        assert lattice / axis == pytest.approx(np.ones_like(lattice), abs=tolerance)
        shaded = raw[top::step, left::step]
        assert np.ptp(shaded) > 0.05 * shaded.max()
    assert [*capfd.readouterr()] == ["", ""]  # Adobe's reader has nothing to say


def test_each_place_of_a_mosaic_has_a_map_of_its_own(tmp_path):
    """Darktable asks for four, one for each pixel of the 2 x 2 block."""
    with tifffile.TiffFile(taken(tmp_path, {})[1]) as file:
        value = file.pages[0].tags["OpcodeList2"].value
    (count,) = struct.unpack_from(">L", value)
    at, found = 4, []
    for _ in range(count):
        kind, since, _, size = struct.unpack_from(">4L", value, at)
        found.append((kind, since >> 24, *struct.unpack_from(">8L", value, at + 16)))
        at += 16 + size
    assert at == len(value)
    expected = [(9, 1, top, left, 120, 300, 0, 1, 2, 2) for top in (0, 1) for left in (0, 1)]
    assert found == expected


def test_a_lens_without_falloff_has_no_map(tmp_path):
    optics = {"f_number": 2.8, "focal_length": "2 mm", "off_axis": "none"}
    path = taken(tmp_path, {"optics": optics, "effects": {"shot_noise": "off"}})[1]
    with tifffile.TiffFile(path) as file:
        assert 51009 not in {tag.code for tag in file.pages[0].tags}
