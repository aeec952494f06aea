"""Sensitivities per watt become electrons per photon, and a set of filters keeps its balance."""

from pathlib import Path

import numpy as np
import pytest
from camera_trees import camera

from vcam_cli import spectra
from vcam_cli.camera.sensor.array import Array
from vcam_cli.camera.spectrum import Spectral
from vcam_cli.spectra import integral, photons

ROOT = Path(__file__).parents[2]
NM = np.arange(380, 781, 5)
CURVES = {
    color: height * np.exp(-(((NM - peak) / width) ** 2))
    for color, peak, width, height in (
        ("R", 600, 45, 0.7),
        ("G", 530, 50, 1.0),
        ("B", 460, 35, 0.9),
    )
}


def table(values):
    return {int(nm): float(value) for nm, value in zip(NM, values, strict=True)}


def write(path, header="wavelength_nm,R,G,B"):
    rows = zip(NM, *CURVES.values(), strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]))
    return str(path)


def signals(filters):
    """Electrons of D65, by color."""
    light = photons(spectra.illuminant("D65"))
    array = Array.model_validate({"rows": 4, "columns": 4, "filters": filters})
    return {
        color: integral(light.multiply(spec.resolve()), 380e-9, 780e-9)
        for color, spec in array.filters.items()
    }


def forms(tmp_path):
    file = write(tmp_path / "rgb.csv")
    named = write(tmp_path / "named.csv", "nm,R per watt,G per watt,B per watt")
    apart = {color: {"table": table(curve), "per": "watt"} for color, curve in CURVES.items()}
    return {
        "file": {"file": file, "per": "watt"},
        "columns": {c: {"file": file, "column": c, "per": "watt"} for c in CURVES},
        "tables": apart,
        "names": {c: {"file": named, "column": f"{c} per watt"} for c in CURVES},
    }


@pytest.mark.parametrize("form", ["file", "columns", "tables", "names"])
def test_white_balance_is_that_of_the_curves_times_the_light(tmp_path, form) -> None:
    """Sensitivity per watt times watts, summed nanometer by nanometer."""
    fine = np.arange(380, 780.5, 0.5)
    light = spectra.illuminant("D65").evaluate(fine * 1e-9)
    truth = {c: float(np.interp(fine, NM, v) @ light) for c, v in CURVES.items()}
    found = signals(forms(tmp_path)[form])
    for color in "RB":
        expected = truth["G"] / truth[color]
        assert found["G"] / found[color] == pytest.approx(expected, rel=2e-3)
    as_photons = signals({c: {"table": table(v)} for c, v in CURVES.items()})
    assert as_photons["G"] / as_photons["R"] < 0.9 * truth["G"] / truth["R"]


def test_a_curve_is_unchanged_at_its_largest_value() -> None:
    given = {"table": table(CURVES["G"]), "per": "watt"}
    found = Spectral().read(given).resolve()
    wavelength = np.array([480, 530, 600]) * 1e-9
    expected = np.interp([480, 530, 600], NM, CURVES["G"]) * 530e-9 / wavelength
    np.testing.assert_allclose(found.evaluate(wavelength), expected, rtol=1e-12)
    between = np.interp(532.5, NM, CURVES["G"]) * 530 / 532.5
    assert found.evaluate(532.5e-9) == pytest.approx(between, rel=1e-5)


def test_no_fraction_becomes_more_than_one() -> None:
    """A blue of 0.9 beside a green of 1 at a wavelength 15 % longer."""
    filters = {c: {"table": table(v), "per": "watt"} for c, v in CURVES.items()}
    array = Array.model_validate({"rows": 4, "columns": 4, "filters": filters})
    highest = max(spec.resolve().evaluate(NM * 1e-9).max() for spec in array.filters.values())
    assert highest == pytest.approx(1.0)


def test_the_shipped_nikon_is_per_watt() -> None:
    """Multipliers that other programs have from the same curves, as given times the light."""
    fine = np.arange(380, 780.5, 0.5)
    light = spectra.illuminant("D65").evaluate(fine * 1e-9)
    found, truth = signals("nikon-5100"), {}
    for color, name in (("R", "red"), ("G", "green"), ("B", "blue")):
        curve = spectra.read_spectrum(ROOT / f"configs/filters/nikon-5100-{name}.csv", "zero")
        truth[color] = float(curve.evaluate(fine * 1e-9) @ light)
    for color in "RB":
        expected = truth["G"] / truth[color]
        assert found["G"] / found[color] == pytest.approx(expected, rel=1e-3)
    by_name = signals(
        {c: f"nikon-5100-{n}" for c, n in zip("RGB", ("red", "green", "blue"), strict=True)}
    )
    assert by_name == pytest.approx(found)


def test_a_lamp_is_written_out() -> None:
    given = camera(scene__illuminant={"table": {380: 1.0, 780: 2.0}})
    assert given.scene.illuminant.resolve().evaluate(580e-9) == pytest.approx(1.5)
    assert given.scene.illuminant.to_yaml() == {"table": {"380": 1.0, "780": 2.0}}
