"""Lens files: encodings, traps and refusals of `.zmx`, and the YAML table."""

import math

import numpy as np
import pytest

from vcam_cli.errors import BadInput
from vcam_cli.lenses import files
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.glasses import ModelGlass, catalog, find

HEAD = """VERS 140730
MODE SEQ
NAME a singlet
UNIT MM X W X CM MR CPMM
FNUM 5 0
GCAT SCHOTT
FTYP 0 0 2 1 0 0 0
XFLN 0 0 0 0
YFLN 0 7 0 0
WAVM 1 5.875618E-1 1
PWAV 1
"""
SURFACES = """SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ INFINITY
SURF 1
  STOP
  TYPE STANDARD
  CURV 2.0E-2 0 0 0 0 ""
  DISZ 4.0
  GLAS N-BK7 0 0 1.5168 6.417E+1 0 0 0 0 0 0
  DIAM 1.2E+1 0 0 0 1 ""
SURF 2
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ 9.4E+1
  DIAM 1.2E+1 0 0 0 1 ""
SURF 3
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ 0
"""
TEXT = HEAD + SURFACES
MODEL = "GLAS ___BLANK 1 0 1.617 5.5E+1 0 0 0 0 0 0"
NAMED = "GLAS N-BK7 0 0 1.5168 6.417E+1 0 0 0 0 0 0"
FOCAL = 50 / 0.5168
"""Focal length of the thin lens, n rounded [mm]."""


def lens_of(tmp_path, content, name="lens.zmx", **given):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return files.read(path, given)


def focal_length(lens):
    return View(lens).paraxial.focal_length * 1e3


ENCODED = {
    "utf-16 with mark": TEXT.encode("utf-16"),
    "utf-16-le": TEXT.encode("utf-16-le"),
    "utf-16-be": TEXT.encode("utf-16-be"),
    "utf-16-be with mark": b"\xfe\xff" + TEXT.encode("utf-16-be"),
    "utf-8 with mark": TEXT.encode("utf-8-sig"),
    "latin-1": TEXT.replace("a singlet", "7°").encode("latin-1"),
    "cr only": TEXT.replace("\n", "\r").encode(),
    "crlf": TEXT.replace("\n", "\r\n").encode(),
    "nul at the end": TEXT.encode() + b"\0" * 9,
    "tabs, no indent": TEXT.replace("  ", "").replace(" ", "\t").encode(),
    "no types": "\n".join(row for row in TEXT.split("\n") if "TYPE" not in row).encode(),
    "no catalog": TEXT.replace("GCAT SCHOTT\n", "").encode(),
}


@pytest.mark.parametrize("content", ENCODED.values(), ids=ENCODED)
def test_every_encoding_reads_the_same(tmp_path, content):
    lens = lens_of(tmp_path, content)
    assert focal_length(lens) == pytest.approx(50 / (1.5168000 - 1), rel=1e-6)
    assert lens.field == pytest.approx(math.radians(7))
    assert lens.surfaces[0].semi_diameter == 0.012


def test_pupils_are_what_the_aperture_says(tmp_path):
    by_number = lens_of(tmp_path, TEXT)
    diameter = by_number.pupil_diameter
    assert diameter == pytest.approx(FOCAL / 5 * 1e-3, rel=1e-5)
    given = TEXT.replace("FNUM 5 0", f"ENPD {diameter * 1e3!r}")
    assert lens_of(tmp_path, given).pupil_diameter == pytest.approx(diameter, rel=1e-14)
    stop = TEXT.replace("FNUM 5 0", "FLOA").replace("1.2E+1 0", "9.0 1", 1)
    assert lens_of(tmp_path, stop).pupil_diameter == pytest.approx(18e-3, rel=1e-14)


def test_inches_are_inches(tmp_path):
    inches = lens_of(tmp_path, TEXT.replace("UNIT MM", "UNIT IN"))
    assert focal_length(inches) == pytest.approx(25.4 * focal_length(lens_of(tmp_path, TEXT)))


def test_apertures_that_are_fixed_clip(tmp_path):
    def clips(more):
        lens = lens_of(tmp_path, TEXT.replace("  DISZ 9.4E+1\n", f"  DISZ 9.4E+1\n{more}"))
        return lens.surfaces[1].clips, lens.surfaces[1].semi_diameter

    assert clips("") == (False, 0.012)
    assert clips("  CLAP 0 1.1E+1 0\n") == (True, 0.011)
    assert clips("  FLAP 0 1.2E+1 0\n") == (True, 0.012)


def test_model_glasses_are_read_in_any_case(tmp_path):
    for text in (MODEL, MODEL.lower().replace("glas", "GLAS")):
        lens = lens_of(tmp_path, TEXT.replace(NAMED, text))
        assert lens.surfaces[0].glass == ModelGlass("1.617/55", 1.617, 55.0)


def test_remarks_say_what_is_ignored_and_chosen(tmp_path):
    factors = TEXT.replace("PWAV 1", "VCYN 0 0.2 0 0\nPWAV 1")
    assert "vignetting factors are ignored" in lens_of(tmp_path, factors).remarks[0]
    beyond = TEXT.replace("PWAV 1", "VCYN 0 0 0.2 0\nPWAV 1")  # a field that is not used
    assert lens_of(tmp_path, beyond).remarks == ()
    several = TEXT.replace("GCAT SCHOTT", "GCAT OHARA SCHOTT")
    assert lens_of(tmp_path, several).remarks == ("glass N-BK7 is read as schott's",)
    near = TEXT.replace("DISZ INFINITY", "DISZ 500")
    assert "scene.distance" in lens_of(tmp_path, near).remarks[0]


def test_fields_as_image_heights_become_angles(tmp_path):
    for kind in (2, 3):
        lens = lens_of(tmp_path, TEXT.replace("FTYP 0", f"FTYP {kind}"))
        # the stop lies in the lens, where distortion is small
        assert math.tan(lens.field) == pytest.approx(7 / FOCAL, rel=0.03)


def test_the_user_gives_a_glass(tmp_path):
    unknown = TEXT.replace("N-BK7", "NBFD5")
    glass = ModelGlass("NBFD5", 1.7859, 44.2)
    lens = lens_of(tmp_path, unknown, nbfd5=glass)
    assert lens.surfaces[0].glass == glass


WRONG = {
    "unknown glass": (TEXT.replace("N-BK7", "XYZ99"), ":21", "not in the catalog", "nd: 1.5168"),
    "misspelt": (TEXT.replace("N-BK7", "N-SF22"), ":21", "did you mean N-SF2?"),
    "no stop": (TEXT.replace("  STOP\n", ""), "no surface is the stop"),
    "two stops": (TEXT.replace("SURF 2\n", "SURF 2\nSTOP\n"), ":24", "2 surfaces are the stop"),
    "no aperture": (TEXT.replace("FNUM 5 0\n", ""), "FNUM, ENPD"),
    "two apertures": (TEXT.replace("FNUM 5 0\n", "FNUM 5 0\nENPD 3\n"), "FNUM, ENPD"),
    "no number": (TEXT.replace("DISZ 4.0", "DISZ 4.four"), ":20", "'4.four'", "DISZ"),
    "nan": (TEXT.replace("DISZ 4.0", "DISZ nan"), ":20", "not a number"),
    "overflow": (TEXT.replace("DISZ 4.0", "DISZ 1e999"), ":20", "not a number"),
    "truncated": (TEXT[: TEXT.index("SURF 2")], "ends before its image plane"),
    "empty": ("", "no surfaces"),
    "mirror": (TEXT.replace("N-BK7", "MIRROR"), ":21", "mirror"),
    "tilt": (TEXT.replace("TYPE STANDARD", "TYPE COORDBRK", 2), ":13", "COORDBRK"),
    "grating": (TEXT.replace("SURF 2\n  TYPE STANDARD", "SURF 2\n  TYPE DGRATING"), "DGRATING"),
    "not sequential": (TEXT.replace("MODE SEQ", "MODE NSC"), ":2", "sequential"),
    "no unit": (TEXT.replace("UNIT MM X W X CM MR CPMM\n", ""), "UNIT MM"),
    "obscured": (TEXT.replace("DISZ 4.0", "DISZ 4.0\nCLAP 2 9 0"), "central obscuration"),
    "square": (TEXT.replace("DISZ 4.0", "DISZ 4.0\nSQAP 2 9 0"), "no circle"),
    "no wavelength": (TEXT.replace("PWAV 1", "PWAV 2"), "no wavelength 2"),
    "no power": (TEXT.replace("2.0E-2", "0.0"), "no positive power"),
    "curved image": (TEXT[:-40].replace("SURF 3\n", "SURF 3\nCURV 1 0\n"), "image"),
    "many surfaces": (HEAD + "SURF 1\n" * 300, "more than 200 surfaces"),
    "wild glass": (TEXT.replace(NAMED, "GLAS ___BLANK 1 0 0 0 0"), "nd lies between"),
    "r squared": (TEXT.replace("DISZ 4.0", "PARM 1 0.1\nDISZ 4.0"), "r^2"),
}


@pytest.mark.parametrize(("content", "said"), [(w[0], w[1:]) for w in WRONG.values()], ids=WRONG)
def test_what_cannot_be_traced_is_refused_with_its_line(tmp_path, content, said):
    with pytest.raises(BadInput) as error:
        lens_of(tmp_path, content)
    for part in said:
        assert part in str(error.value)


def test_a_file_that_is_too_large_is_refused(tmp_path):
    with pytest.raises(BadInput, match="larger than 4 MB"):
        lens_of(tmp_path, b"NOTE \n" * 800_000)


TABLE = """kind: lens
unit: mm
f_number: 5
field: 7 deg
surfaces:
  - {radius: 50, thickness: 4, glass: N-BK7, stop: true}
  - {radius: infinity, thickness: 94}
"""


def test_a_table_reads_as_the_same_lens(tmp_path):
    of_table, of_zmx = lens_of(tmp_path, TABLE, "lens.yaml"), lens_of(tmp_path, TEXT)
    assert focal_length(of_table) == pytest.approx(focal_length(of_zmx), rel=1e-14)
    assert of_table.pupil_diameter == pytest.approx(of_zmx.pupil_diameter, rel=1e-14)
    assert of_table.field == pytest.approx(of_zmx.field)


TABLES = {
    "unknown key": (TABLE.replace("radius: 50", "radios: 50"), ":6:", "radius"),
    "two stops": (TABLE.replace("thickness: 94", "thickness: 94, stop: true"), "are the stop"),
    "no stop": (TABLE.replace(", stop: true", ""), "no surface is the stop"),
    "no aperture": (TABLE.replace("f_number: 5\n", ""), "aperture is missing"),
    "radius 0": (TABLE.replace("radius: 50", "radius: 0"), ":6:", "infinity"),
    "nan": (TABLE.replace("thickness: 4,", "thickness: .nan,"), ":6:"),
    "glass": (TABLE.replace("N-BK7", "N-BK77"), ":6:", "surfaces.0.glass", "N-BK7"),
    "in glass": (TABLE.replace("thickness: 94", "thickness: 94, glass: N-BK7"), ":7:", "in glass"),
    "clips": (TABLE.replace("thickness: 94", "thickness: 94, clips: true"), "semi_diameter"),
    "not a lens": ("name: x\n", "no surfaces"),
    "no power": (TABLE.replace("radius: 50", "radius: -50"), "no positive power"),
}


@pytest.mark.parametrize(("content", "said"), [(w[0], w[1:]) for w in TABLES.values()], ids=TABLES)
def test_mistakes_of_a_table_are_said_with_their_place(tmp_path, content, said):
    with pytest.raises(BadInput) as error:
        lens_of(tmp_path, content, "lens.yaml")
    for part in said:
        assert part in str(error.value)


def test_catalog_glasses_have_the_makers_indices():
    # nd and Vd as their makers print them (data sheets of Schott, 2017, and Ohara)
    for name, nd, vd in (
        ("N-BK7", 1.5168, 64.17),
        ("N-SF6", 1.80518, 25.36),
        ("F2", 1.62004, 36.37),
    ):
        glass = find(name)[0]
        red, green, blue = glass.index(np.array([656.2725e-9, 587.5618e-9, 486.1327e-9]))
        assert green == pytest.approx(nd, abs=6e-6)
        assert (green - 1) / (blue - red) == pytest.approx(vd, abs=0.01)
    assert len(catalog()) > 200


def test_model_glasses_keep_nd_vd_and_the_normal_line():
    glass = ModelGlass("", 1.62, 36.4)
    blue, cyan, yellow, red = glass.index(
        np.array([435.8343e-9, 486.1327e-9, 587.5618e-9, 656.2725e-9])
    )
    assert yellow == pytest.approx(1.62, abs=1e-15)
    assert (yellow - 1) / (cyan - red) == pytest.approx(36.4, rel=1e-12)
    assert (blue - cyan) / (cyan - red) == pytest.approx(0.6438 - 0.001682 * 36.4, rel=1e-12)
