"""The light level: the perfect white meets what the file states, for every kind of lamp."""

import math

import pytest
from support import scene

from vcam_cli.errors import BadInput
from vcam_cli.scenes.light import white_radiance
from vcam_cli.spectra import integral, luminance

FLAT = {"kind": "chart", "chart": "uniform"}
RANGE = 380e-9, 780e-9
LAMPS = ["D65", "FL2", "equal-energy", {"blackbody": "3000 K"}, {"monochromatic": "550 nm"}]


@pytest.mark.parametrize("lamp", LAMPS)
def test_levels(lamp):
    white = white_radiance(scene(FLAT, illuminant=lamp, luminance="80 cd/m2"))
    assert luminance(white, *RANGE) == pytest.approx(80.0, rel=1e-12)
    white = white_radiance(scene(FLAT, illuminant=lamp, radiance="0.4 W/(sr m2)"))
    assert integral(white, *RANGE) == pytest.approx(0.4, rel=1e-12)
    white = white_radiance(scene(FLAT, illuminant=lamp, illuminance="300 lx"))
    assert math.pi * luminance(white, *RANGE) == pytest.approx(300.0, rel=1e-12)


def test_a_line_at_555_nm_gives_683_lumens_a_watt():
    lamp = {"monochromatic": "555 nm"}
    white = white_radiance(scene(FLAT, illuminant=lamp, luminance="683 cd/m2"))
    assert integral(white, *RANGE) == pytest.approx(1.0, rel=1e-4)  # 683 against 683.002


def test_only_the_simulated_wavelengths_count():
    narrow = {"start": "500 nm", "stop": "600 nm"}
    white = white_radiance(scene(FLAT, radiance="1 W/(sr m2)", wavelengths=narrow))
    assert integral(white, 500e-9, 600e-9) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("band", [("500 nm", "600 nm"), ("800 nm", "830 nm"), ("380 nm", "600 nm")])
def test_luminance_counts_the_whole_visible_light(band):
    """A part of the spectrum is as bright as it is beside the rest, visible or not."""
    narrow = {"start": band[0], "stop": band[1]}
    part = white_radiance(scene(FLAT, illuminant="D65", luminance="80 cd/m2", wavelengths=narrow))
    whole = white_radiance(scene(FLAT, illuminant="D65", luminance="80 cd/m2"))
    assert luminance(part, *RANGE) == pytest.approx(
        80.0, rel=1e-12 if band[1] != "830 nm" else 1e-5
    )
    assert part.scale == pytest.approx(whole.scale, rel=1e-5)  # of light beyond 780 nm


def test_a_lamp_known_in_part_counts_as_far_as_it_is_known(tmp_path):
    lamp = tmp_path / "lamp.csv"
    lamp.write_text("wavelength_nm,value\n450,1\n650,1\n")
    narrow = {"start": "500 nm", "stop": "600 nm"}
    white = white_radiance(scene(FLAT, illuminant={"file": str(lamp)}, luminance="80 cd/m2",
                                 wavelengths=narrow))  # fmt: skip
    assert luminance(white, 450e-9, 650e-9) == pytest.approx(80.0, rel=1e-12)


def test_a_lamp_that_nobody_sees_has_no_luminance():
    infrared = {"start": "900 nm", "stop": "1000 nm"}
    lamp = {"monochromatic": "950 nm"}
    dark = scene(FLAT, illuminant=lamp, luminance="100 cd/m2", wavelengths=infrared)
    with pytest.raises(BadInput, match=r"scene.illuminant: .*no visible light"):
        white_radiance(dark)
    lit = scene(FLAT, illuminant=lamp, radiance="1 W/(sr m2)", wavelengths=infrared)
    assert integral(white_radiance(lit), 900e-9, 1000e-9) == pytest.approx(1.0)


def test_a_lamp_that_does_not_cover_the_wavelengths_is_an_error(tmp_path):
    lamp = tmp_path / "lamp.csv"
    lamp.write_text("wavelength_nm,value\n400,1\n700,2\n")
    with pytest.raises(BadInput, match=r"scene.illuminant: .*400-700 nm"):
        white_radiance(scene(FLAT, illuminant={"file": str(lamp)}))
