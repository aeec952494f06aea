"""Metadata by the conventions: names and types of OpenEXR's standard attributes, texts of PNG."""

import struct

import pytest
from making import GONE, camera
from PIL import Image

from vcam_cli import simulate

CAMERA = {
    "scene.illuminant": "D65",
    "optics": {"f_number": 4, "focal_length": "5 mm"},
    "exposure.time": "20 ms",
    "output": {"raw": ["dn", "electrons", "volts"], "irradiance": True},
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm", "step": "100 nm"},
}


def header(data: bytes) -> dict[str, tuple[str, object]]:
    """Attributes of an EXR file of one part: name -> its type and value ("OpenEXR File Layout")."""
    found, at = {}, 8
    while data[at]:
        name, kind, _ = data[at : at + 1000].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<i", data, at)
        value = data[at + 4 : at + 4 + size]
        read = {b"float": lambda v: struct.unpack("<f", v)[0], b"string": bytes.decode}.get(kind)
        found[name.decode()] = (kind.decode(), read(value) if read else value)
        at += 4 + size
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("metadata")
    result = simulate(camera(place, CAMERA))
    return result.save(place / "out"), result


@pytest.mark.parametrize("name", ["raw.exr", "irradiance.exr"])
def test_attributes_are_those_of_the_standard(name, folder):
    place, result = folder
    said = header((place / name).read_bytes())
    expected = {
        "expTime": 0.02,  # s
        "aperture": 4.0,
        "effectiveFocalLength": 5.0,  # mm
        "isoSpeed": result.metrics["base_iso"],
    }
    for attribute, value in expected.items():
        assert said[attribute] == ("float", pytest.approx(value, rel=1e-6))
    assert said["vcam:illuminant"] == ("string", "D65")
    assert said["comments"] == ("string", "simulated, no photograph")
    for name in ("software", "vcam:simulatedBy"):
        assert said[name][1].startswith("vcam ")


@pytest.mark.parametrize(
    ("lamp", "text"),
    [
        ({"blackbody": "3200 K"}, "blackbody 3200 K"),
        ({"file": "lamps/my lamp.csv"}, "file my lamp.csv"),
    ],
)
def test_lamps_of_all_kinds_have_a_name(lamp, text, tmp_path):
    (tmp_path / "lamps").mkdir()
    (tmp_path / "lamps/my lamp.csv").write_text("wavelength_nm,value\n300,1\n900,2\n")
    result = simulate(camera(tmp_path, CAMERA | {"scene.illuminant": lamp}))
    said = header((result.save(tmp_path / "out") / "raw.exr").read_bytes())
    assert said["vcam:illuminant"][1] == text


def test_every_channel_of_the_raw_frame_has_its_unit(folder):
    said = header((folder[0] / "raw.exr").read_bytes())
    units = {name: said[f"vcam:unit.{name}"][1] for name in CAMERA["output"]["raw"]}
    assert units == {"dn": "DN", "electrons": "e", "volts": "V"}


def test_irradiance_says_that_its_channels_are_means_over_bands(folder):
    said = header((folder[0] / "irradiance.exr").read_bytes())
    assert "over the channel's band" in said["vcam:quantity"][1]


def test_the_render_says_that_it_is_simulated_and_how(folder):
    with Image.open(folder[0] / "render.png") as picture:
        text = picture.info["Description"]
    assert "simulated, no photograph" in text
    assert "expTime 0.02" in text
    assert "vcam:illuminant D65" in text


def test_the_ideal_image_says_which_colors_it_has(tmp_path):
    """Red, green, blue and white of ITU-R BT.709, in the order of OpenEXR's `chromaticities`."""
    color = {"quality": ["mse"], "array.pattern": "bayer-rggb", "scene.illuminant": "D65"}
    result = simulate(camera(tmp_path, color | {"processing": GONE}))
    said = header((result.save(tmp_path / "color") / "ideal.exr").read_bytes())
    kind, value = said["chromaticities"]
    expected = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    assert kind == "chromaticities"
    assert struct.unpack("<8f", value) == pytest.approx(expected, rel=1e-6)
    assert said["comments"][1] == "simulated, no photograph"
    plain = {"processing": [{"demosaic": "bilinear"}]}  # colors of the camera, not of a display
    raw = simulate(camera(tmp_path, color | plain)).save(tmp_path / "raw")
    assert "chromaticities" not in header((raw / "ideal.exr").read_bytes())
