"""raw.tif: whole numbers that other readers find unchanged, and what they mean."""

import json

import numpy as np
import pytest
from making import QUIET, camera
from PIL import Image

from vcam_cli import simulate
from vcam_cli.files.images import tiff
from vcam_cli.files.images.exr import read_exr

tifffile = pytest.importorskip("tifffile", reason="tifffile reads raw.tif")

DESCRIPTION = 270
"""Tag of TIFF 6.0."""
COLOR = {
    "scene.illuminant": "D65",
    "scene.radiance": "10 W/(sr m2)",
    "scene.source": {"kind": "chart", "chart": "step-wedge"},
    "output.render": "none",
    "array.filters": "generic-rgb",
    "output.tiff": True,
}
PATTERNS = {
    "monochrome": (None, {}),
    "bayer-grbg": ([[1, 0], [2, 1]], {}),
    "quad-bayer": ([[0, 0, 1, 1]] * 2 + [[1, 1, 2, 2]] * 2, {}),
    "rgbw": ([[6, 2, 6, 1], [2, 6, 1, 6], [6, 1, 6, 0], [1, 6, 0, 6]], {}),
    "stacked": (None, {"array.filters": "silicon-layers"}),
    "honeycomb": (None, {}),
}
"""Pattern -> numbers of its colors as TIFF/EP has them (None: no mosaic in rows and columns)."""


def saved(folder, changes):
    """The result of a camera, and its raw.tif: codes, tags by number, codes as Pillow has them."""
    result = simulate(camera(folder, COLOR | changes))
    path = result.save(folder / "out") / "raw.tif"
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        codes, tags = page.asarray(), {tag.code: tag.value for tag in page.tags}
    if codes.dtype != np.uint16 or codes.ndim > 2:
        return result, codes, tags, None  # Pillow knows gray of 16 bits only
    with Image.open(path) as other:
        return result, codes, tags, np.asarray(other)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_codes_and_pattern_are_read_back(pattern, tmp_path):
    numbers, more = PATTERNS[pattern]
    result, codes, tags, other = saved(tmp_path, {"array.pattern": pattern} | more)
    assert codes.dtype == np.uint16
    assert np.ptp(codes) > 10
    assert np.array_equal(codes, result.dn)
    assert other is None or np.array_equal(other, result.dn)
    if numbers is None:
        assert 33421 not in tags
        assert 33422 not in tags
    else:
        assert tags[33421] == np.shape(numbers)
        assert np.array_equal(np.frombuffer(tags[33422], np.uint8), np.ravel(numbers))


def test_colors_that_the_tag_does_not_know_are_told_in_the_description_alone(tmp_path):
    changes = {
        "array.pattern": {"block": [["R", "E"], ["G", "B"]]},
        "array.filters": {"R": 0.2, "E": 0.5, "G": 0.3, "B": 0.1},
    }
    _, _, tags, _ = saved(tmp_path, changes)
    assert 33422 not in tags
    assert json.loads(tags[DESCRIPTION])["vcam:cfa"] == "RE/GB"


def test_sums_beyond_sixteen_bits_are_whole(tmp_path):
    binning = {"rows": 2, "columns": 2, "kind": "digital"}
    result, codes, _, _ = saved(tmp_path, {"array.binning": binning, "adc.bits": 16})
    assert codes.dtype == np.uint32
    assert np.array_equal(codes, result.dn)


@pytest.mark.parametrize(
    "adc",
    [
        {"bits": 12, "offset": "64 DN"},
        {"bits": 14, "kind": "logarithmic", "offset": "100 DN", "reference": "10 mV"},
    ],
    ids=lambda adc: adc.get("kind", "linear"),
)
def test_description_says_how_codes_become_light(adc, tmp_path):
    changes = {"adc": adc, "effects": QUIET, "array.pattern": "monochrome"}
    result, codes, tags, _ = saved(tmp_path, changes)
    said = json.loads(tags[DESCRIPTION])
    exr = read_exr(tmp_path / "out" / "raw.exr")[1]
    assert exr["vcam:dnMeaning"] == said["vcam:dnMeaning"]
    white, black = said["vcam:whiteLevel"], said["vcam:blackLevel"]
    if "kind" in adc:
        assert "((1 + r)^s - 1) / r" in said["vcam:dnMeaning"]
        r = said["vcam:adcFullScale"] / said["vcam:adcReference"]
        low, high = (
            ((1 + r) ** ((codes + half - 100) / (white - 100)) - 1) / r for half in (-0.5, 0.5)
        )
    else:
        assert "(dn - blackLevel) / (whiteLevel - blackLevel)" in said["vcam:dnMeaning"]
        low, high = ((codes + half - black) / (white - black) for half in (-0.5, 0.5))
    # The ADC is full at the full well, 100 ke; 0.01 e is the rounding of 32-bit numbers.
    assert (low * 1e5 < result.electrons + 0.01).all()
    assert (high * 1e5 > result.electrons - 0.01).all()


def test_the_same_camera_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        simulate(camera(tmp_path, COLOR)).save(tmp_path / name)
    assert (tmp_path / "a/raw.tif").read_bytes() == (tmp_path / "b/raw.tif").read_bytes()


@pytest.mark.parametrize("dtype", [np.uint16, np.uint32])
@pytest.mark.parametrize("shape", [(7, 5), (6, 9, 3), (6, 9, 4)])
def test_files_beyond_four_gigabytes_are_bigtiff(dtype, shape, tmp_path, monkeypatch):
    monkeypatch.setattr(tiff, "_CLASSIC_BYTES", 0)
    codes = np.random.default_rng(1).integers(0, 1 << 16, shape).astype(dtype)
    tiff.write_tiff(tmp_path / "a.tif", codes, "a text", tiff.mosaic_tags([["R", "G"]]))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.is_bigtiff
        page = file.pages[0]
        assert np.array_equal(page.asarray(), codes)
        assert page.description == "a text"
        assert page.tags[33422].value == bytes([0, 1])
