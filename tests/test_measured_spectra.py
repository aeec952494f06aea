"""Spectra from files as instruments write them: the same numbers, however they are written."""

from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from making import GONE, camera

from vcam_cli import simulate, spectra
from vcam_cli.errors import BadInput
from vcam_cli.solve.idle_keys import idle_keys

NM = np.array([380.0, 450.5, 550.0, 800.0])
VALUES = {"R": np.array([0.01, 0.02, 0.3, 0.9]), "G": np.array([0.1, 0.2, 0.8, 0.05]),
          "B": np.array([0.4, 0.7, 0.1, 0.0])}  # fmt: skip


def text(mark=",", comma=False, um=False, falling=False, above="", header=True, at="nm"):
    """The table as an instrument may write it."""
    order = slice(None, None, -1) if falling else slice(None)

    def number(value):
        shown = f"{value:.6g}"
        return shown.replace(".", ",") if comma else shown

    wave = (NM / 1000 if um else NM)[order]
    rows = zip(wave, *(v[order] for v in VALUES.values()), strict=True)
    names = [f"Wavelength ({at})", *VALUES]
    lines = [mark.join(names)] if header else []
    return above + "\n".join([*lines, *(mark.join(map(number, row)) for row in rows)]) + "\n"


FORMS = {
    "commas": text(),
    "semicolons": text(";"),
    "semicolons and decimal commas": text(";", comma=True),
    "tabs and decimal commas": text("\t", comma=True),
    "spaces": text("   ").replace("Wavelength (nm)", "nm"),
    "spaces and decimal commas": text("  ", comma=True).replace("Wavelength (nm)", "nm"),
    "falling": text(falling=True),
    "micrometers": text(um=True, at="um"),
    "micro sign": text(um=True, at="µm"),
    "an instrument's own lines": text(";", above="Spectrometer;X-7\nDate;1.2.2020 10:11\n\n"),
    "quoted names": text().replace("Wavelength (nm)", '"Wavelength (nm)"'),
    "a separator at the end": text(";").replace("\n", ";\n"),
    "Windows lines": text(";").replace("\n", "\r\n"),
    "units of the values": text().replace("R,G,B", "R [A/W],G [A/W],B [A/W]"),
}


def write(folder, content, encoding="utf-8"):
    file = Path(folder) / "qe.csv"
    file.write_bytes(content.encode(encoding))
    return file


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("color", VALUES)
def test_the_same_spectrum_in_every_form(form, color, tmp_path):
    table = spectra.read_spectrum(write(tmp_path, FORMS[form]), column=color)
    np.testing.assert_allclose(table.wavelength, NM * 1e-9, rtol=1e-15)
    np.testing.assert_array_equal(table.value, VALUES[color])


def test_without_a_header_columns_have_numbers(tmp_path):
    file = write(tmp_path, text(header=False))
    np.testing.assert_array_equal(spectra.read_spectrum(file, column="3").value, VALUES["G"])


def test_names_in_latin_1(tmp_path):
    file = write(tmp_path, text(";", um=True, at="µm"), "latin-1")
    np.testing.assert_allclose(spectra.read_spectrum(file, column="B").wavelength, NM * 1e-9)


def test_percent_in_a_header_counts_and_a_stated_unit_goes_first(tmp_path):
    content = "nm;QE (%)\n0,4;31,5\n0,9;12\n"
    table = spectra.read_spectrum(write(tmp_path, content), unit="um")
    np.testing.assert_allclose(table.wavelength, [4e-7, 9e-7], rtol=1e-15)
    np.testing.assert_allclose(table.value, [0.315, 0.12], rtol=1e-15)


def test_the_wavelength_may_stand_in_another_column(tmp_path):
    table = spectra.read_spectrum(write(tmp_path, "value,wavelength [nm]\n0.5,400\n0.6,700\n"))
    np.testing.assert_array_equal(table.value, [0.5, 0.6])


@examples(60)
@given(
    st.lists(st.floats(0.1, 20.0), min_size=2, max_size=6, unique=True),
    st.sampled_from([",", ";", "\t"]),
    st.booleans(),
)
def test_size_tells_micrometers_or_the_file_is_refused(tmp_path_factory, wave, mark, falling):
    """Whatever stands between 0.1 and 20 is never taken for nanometers."""
    wave = np.unique(np.round(wave, 6))[:: -1 if falling else 1]
    lines = [f"lambda{mark}value", *(f"{w:.6f}{mark}0.5" for w in wave)]
    table = spectra.read_spectrum(write(tmp_path_factory.mktemp("a"), "\n".join(lines)))
    np.testing.assert_allclose(table.wavelength, np.sort(wave) * 1e-6, rtol=1e-12)


LIT = {
    "scene.illuminant": "D65",
    "scene.radiance": GONE,
    "scene.luminance": "100 cd/m2",
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
    "array.pattern": "bayer-rggb",
}


def test_one_file_is_a_whole_set_of_filters(tmp_path):
    """The same frame as from three files of a column each."""
    write(tmp_path, text(";", comma=True))
    one = camera(tmp_path, LIT | {"array.filters": {"file": "qe.csv"}})
    found = simulate(one)
    each = {}
    for color, values in VALUES.items():
        lines = ["wavelength_nm,value", *(f"{w},{v}" for w, v in zip(NM, values, strict=True))]
        (tmp_path / f"{color}.csv").write_text("\n".join(lines), encoding="utf-8")
        each[color] = {"file": f"{color}.csv"}
    stated = simulate(camera(tmp_path, LIT | {"array.filters": each}))
    np.testing.assert_array_equal(found.mean_electrons, stated.mean_electrons)


@pytest.mark.parametrize(
    ("spectrum", "says"),
    [
        ({"file": "qe.csv"}, "3 columns of values (R, G, B); write which, for example column: R"),
        ({"file": "qe.csv", "column": "X"}, "no column 'X'; there are R, G, B"),
        ({"file": "qe.csv", "column": "R", "unit": "mm"}, "nm, um"),
    ],
)
def test_what_does_not_fit_is_refused(spectrum, says, tmp_path):
    write(tmp_path, text())
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, {"pixel.photodetector.quantum_efficiency": spectrum})
    assert says in str(caught.value)


SHORT = {"table": {500: 0.4, 600: 0.4}}
"""Ends within 400 to 700 nm."""
LINE = LIT | {"scene.illuminant": {"monochromatic": "680 nm"}, "array.pattern": "monochrome"}


def at_680(tmp_path, outside, spectrum):
    changes = {
        "scene.wavelengths.outside": outside,
        "pixel.photodetector.quantum_efficiency": spectrum,
    }
    return camera(tmp_path, LINE | changes)


@pytest.mark.parametrize(
    ("outside", "spectrum", "flat"),
    [
        ("hold", SHORT, 0.4),
        ("zero", SHORT, 0.0),
        ("zero", SHORT | {"outside": "hold"}, 0.4),
        ("hold", SHORT | {"outside": "zero"}, 0.0),
        ("hold", {"pixel": SHORT}, {"pixel": 0.4}),
    ],
)
def test_the_camera_says_once_what_holds_beyond_tables(outside, spectrum, flat, tmp_path):
    """A line beyond the table's end is seen as by the even spectrum of the value stated."""
    found = simulate(at_680(tmp_path, outside, spectrum)).mean_electrons
    even = simulate(at_680(tmp_path, "error", flat)).mean_electrons
    np.testing.assert_allclose(found, even, rtol=1e-6)


def test_every_measured_spectrum_of_the_camera_heeds_it(tmp_path):
    for color in VALUES:
        (tmp_path / f"{color}.csv").write_text("450,0.5\n650,0.7\n", encoding="utf-8")
    (tmp_path / "lamp.csv").write_text("450,3\n650,4\n", encoding="utf-8")
    short = {
        "scene.illuminant": [{"file": "lamp.csv"}, {"table": {450: 0.9, 650: 0.8}}],
        "optics.transmittance": [0.9, {"table": {420: 0.8, 690: 0.9}}],
        "pixel.photodetector.quantum_efficiency": SHORT,
        "array.filters": {color: {"file": f"{color}.csv"} for color in VALUES},
    }
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, LIT | short)
    assert len(caught.value.problems) == 6
    assert "scene.wavelengths: {outside: hold}" in str(caught.value)
    made = camera(tmp_path, LIT | short | {"scene.wavelengths.outside": "hold"})
    assert simulate(made).mean_electrons.min() > 0
    with pytest.raises(BadInput):
        made.with_({"scene.wavelengths.outside": "error"})


def test_physics_is_not_extended(tmp_path):
    layer = {"silicon": ["0 um", "2 um"]}
    far = {"scene.wavelengths": {"start": "400 nm", "stop": "1500 nm", "outside": "hold"}}
    with pytest.raises(BadInput, match=r"350-1100 nm.*narrow scene\.wavelengths"):
        camera(tmp_path, LIT | far | {"pixel.photodetector.quantum_efficiency": layer})


@pytest.mark.parametrize(("table", "idle"), [(SHORT, False), ({"table": {400: 1, 700: 1}}, True)])
def test_a_note_where_all_tables_cover_the_wavelengths(table, idle, tmp_path):
    told = [path for path, _ in idle_keys(at_680(tmp_path, "hold", table))]
    assert ("scene.wavelengths.outside" in told) == idle
