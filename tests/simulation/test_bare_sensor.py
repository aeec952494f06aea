"""A sensor without a lens: `optics: none`, and irradiance from files."""

import json
import math

import numpy as np
import pytest
from making import GONE, LIGHT, PLANCK, camera

from vcam_cli.commands.geometry_table import geometry_table
from vcam_cli.errors import BadInput
from vcam_cli.simulation.simulate import simulate
from vcam_cli.solve.idle_keys import idle_keys

BARE = {"optics": "none", "scene.radiance": GONE, "scene.distance": GONE}
LINE = {**BARE, "scene.irradiance": "0.01 W/m2"}
AREA = 0.5 * 25e-12
"""Photodetector of the plain camera [m2], whose QE is 0.5 and time 10 ms."""
STACK = {"passivation": {"thickness": "0.7 um", "index": 2.0},
         "oxide": {"thickness": "6 um", "index": 1.46}}  # fmt: skip


def expected(irradiance, wavelength=550e-9):
    """Electrons of a line of light [W/m2], counted photon by photon."""
    return irradiance * wavelength / (PLANCK * LIGHT) * AREA * 0.5 * 0.01


def test_even_light_is_counted_as_it_falls(tmp_path):
    result = simulate(camera(tmp_path, LINE))
    assert result.mean_electrons == pytest.approx(expected(0.01), rel=1e-6)


@pytest.mark.parametrize(
    ("key", "value", "power"),
    [("radiance", "0.01 W/(sr m2)", 0.01 * math.pi), ("irradiance", "20 mW/m2", 0.02)],
)
def test_a_level_is_that_of_a_diffuser_in_the_sensors_place(key, value, power, tmp_path):
    made = camera(tmp_path, {**BARE, f"scene.{key}": value})
    assert simulate(made).mean_electrons == pytest.approx(expected(power), rel=1e-6)


def test_with_a_lens_irradiance_is_on_the_diffuser(tmp_path):
    """E = pi L."""
    power = {"scene.radiance": GONE, "scene.irradiance": f"{0.1 * math.pi} W/m2"}
    both = [simulate(camera(tmp_path, changes)).mean_electrons for changes in ({}, power)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)


def test_nothing_blurs_and_nothing_falls_off(tmp_path):
    """A pattern that lies on the sensor: a whole pixel's box alone averages it."""
    chart = {"kind": "chart", "chart": "sinusoid", "frequency": "40 lp/mm", "contrast": 1}
    detector = {"fill_factor": 1, "quantum_efficiency": 0.5}
    made = camera(tmp_path, {**LINE, "scene.source": chart, "pixel.photodetector": detector})
    x = (np.arange(64) - 31.5) * 5e-6
    edges = np.stack([x - 2.5e-6, x + 2.5e-6])
    steps = np.diff(np.sin(2 * math.pi * 40e3 * edges), axis=0)[0] / (2 * math.pi * 40e3)
    mean = 0.5 * (5e-6 + steps) / 5e-6 * 2 * expected(0.01)
    assert simulate(made).mean_electrons == pytest.approx(np.tile(mean, (48, 1)), rel=1e-4, abs=0.5)


def test_a_stack_of_layers_lets_normal_light_through(tmp_path):
    """QE is external at normal incidence: no more is lost, in the center or in the corners."""
    made = camera(tmp_path, {**LINE, "pixel.stack": STACK, "pixel.microlens": {"gain": 1.5}})
    bare = camera(tmp_path, {**LINE, "pixel.microlens": {"gain": 1.5}})
    found, plain = simulate(made).mean_electrons, simulate(bare).mean_electrons
    assert found == pytest.approx(plain, rel=1e-4)


def test_spectral_irradiance_of_a_file_counts_as_it_is(tmp_path):
    """A flat 1e-4 W/(m2 nm) from 500 to 600 nm: photons grow with the wavelength, exactly."""
    (tmp_path / "lamp.csv").write_text("wavelength_nm,value\n500,1e-4\n600,1e-4\n")
    changes = {
        **BARE,
        "scene.illuminant": {"file": "lamp.csv"},
        "scene.irradiance": "from-file",
        "scene.wavelengths": {"start": "500 nm", "stop": "600 nm"},
    }
    photons = 1e-4 * 1e9 * (600e-9**2 - 500e-9**2) / 2 / (PLANCK * LIGHT)
    result = simulate(camera(tmp_path, changes))
    assert result.mean_electrons == pytest.approx(photons * AREA * 0.5 * 0.01, rel=1e-6)


@pytest.mark.long
def test_the_irradiance_behind_a_lens_can_be_laid_on_a_bare_sensor(tmp_path):
    """irradiance.exr of one camera is the scene of another, which sees as much.

    The file holds means over cells; with photodetectors as large as cells nothing else is lost.
    """
    detector = {"fill_factor": 1, "quantum_efficiency": {"table": {380: 0.1, 780: 0.6}}}
    lamp = {"scene.illuminant": "A", "pixel.photodetector": detector, "optics.off_axis": "exact"}
    small = {"array.rows": 24, "array.columns": 32}
    chart = {"scene.source": {"kind": "chart", "chart": "colorchecker"}}
    lens = camera(
        tmp_path, small | lamp | chart | {"output": {"irradiance": True, "render": "none"}}
    )
    seen = simulate(lens)
    seen.save(tmp_path / "lens")
    source = {"kind": "hyperspectral", "file": "lens/irradiance.exr"}
    bare = {**BARE, **small, "scene.source": source, "scene.illuminant": GONE}
    made = camera(
        tmp_path, bare | {"scene.irradiance": "from-file", "pixel.photodetector": detector}
    )
    error = np.abs(simulate(made).mean_electrons - seen.mean_electrons)
    # both frames' own 2e-4; hats of 10 nm or less over a smooth lamp and a QE that is straight
    assert error.max() < 5e-4 * seen.mean_electrons.max()


@pytest.mark.parametrize(
    ("changes", "path", "words"),
    [
        ({"scene.extent": {"width": "1 m"}}, ("scene", "extent"), "bare sensor"),
        ({"scene.irradiance": "from-file"}, ("scene", "irradiance"), "neither"),
        ({"scene.luminance": "5 cd/m2"}, ("scene", "irradiance"), "both"),
        ({"effects": {"diffraction": "on"}}, ("effects", "diffraction"), "nothing"),
        ({"optics": "nonne"}, ("optics",), "nonne"),
    ],
)
def test_what_cannot_be_is_refused(changes, path, words, tmp_path):
    with pytest.raises(BadInput) as caught:
        simulate(camera(tmp_path, LINE | changes))
    problems = list(caught.value.problems)
    assert any(p.path == path and words in p.message for p in problems), problems


def test_an_irradiance_is_not_seen_through_a_lens(tmp_path):
    lens = camera(tmp_path, {"output": {"irradiance": True, "render": "none"}})
    simulate(lens).save(tmp_path / "lens")
    source = {"kind": "hyperspectral", "file": "lens/irradiance.exr"}
    gone = {"scene.illuminant": GONE, "scene.radiance": GONE, "scene.luminance": "9 cd/m2"}
    with pytest.raises(BadInput, match="optics: none"):
        simulate(camera(tmp_path, gone | {"scene.source": source}))


def test_what_a_bare_sensor_has_no_use_for_is_told(tmp_path):
    made = camera(tmp_path, {**LINE, "scene.distance": "3 m"})
    assert set(dict(idle_keys(made))) == {"scene.distance"}


def test_it_is_written_back_and_shown_as_it_is(tmp_path):
    made = camera(tmp_path, LINE)
    assert made.model_dump(mode="json")["optics"] == "none"
    assert made.with_({"optics": {"f_number": 4, "focal_length": "5 mm"}}).optics.is_lens
    result = simulate(made)
    table = geometry_table(result.frame.geometry.report(0), 10e-9, (380e-9, 780e-9))
    assert "a bare sensor" in table
    folder = simulate(made.with_({"output.dng": True})).save(tmp_path / "out")
    assert (folder / "raw.dng").is_file()
    said = json.loads((folder / "run.json").read_text())["geometry"]
    assert all(value is not None and value == value for value in said.values()), said
