"""The shipped tables equal colour-science, and the generic curves equal their formulas."""

import importlib.util
import re
import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from vcam_cli import spectra
from vcam_cli.spectra import Spectrum, integral

ROOT = Path(__file__).parent.parent
MEASURED = sorted(ROOT.glob("configs/filters/nikon-*.csv"))
GENERIC = sorted(
    {*ROOT.glob("configs/filters/*.csv"), *ROOT.glob("configs/pixels/*.csv")} - {*MEASURED}
)


@pytest.fixture(scope="module")
def colour() -> ModuleType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def test_illuminants(colour: ModuleType) -> None:
    for name in spectra.illuminant_names():
        if name == "equal-energy":
            continue
        lamp = colour.SDS_ILLUMINANTS[name]
        ours = spectra.illuminant(name)
        np.testing.assert_array_equal(
            ours.evaluate(lamp.wavelengths / 1e9), lamp.values, err_msg=name
        )


def test_observer(colour: ModuleType) -> None:
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    for table, values in zip(spectra.cmf(), observer.values.T, strict=True):
        np.testing.assert_array_equal(table.wavelength, observer.wavelengths / 1e9)
        np.testing.assert_array_equal(table.value, values)


def test_colorchecker(colour: ModuleType) -> None:
    theirs = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    ours = spectra.colorchecker()
    assert [name for name, _ in ours] == list(theirs)
    for name, patch in ours:
        np.testing.assert_array_equal(patch.tables[0].value, theirs[name].values, err_msg=name)


def test_display_primaries(colour: ModuleType) -> None:
    theirs = colour.MSDS_DISPLAY_PRIMARIES["Typical CRT Brainard 1997"]
    ours, white = spectra.display_primaries("crt-brainard")
    assert theirs.labels == ["red", "green", "blue"]
    for primary, values in zip(ours, theirs.values.T, strict=True):
        np.testing.assert_array_equal(primary.evaluate(theirs.wavelengths / 1e9), values)
    np.testing.assert_allclose(
        white.evaluate(theirs.wavelengths / 1e9), theirs.values.sum(1), rtol=1e-15
    )
    with pytest.raises(ValueError, match="crt-brainard, srgb"):
        spectra.display_primaries("p3")


def test_srgb_reflectances(colour: ModuleType) -> None:
    theirs = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    assert theirs.labels == ["red", "green", "blue"]
    for basis, values in zip(spectra.srgb_reflectances(), theirs.values.T, strict=True):
        np.testing.assert_array_equal(basis.evaluate(theirs.wavelengths / 1e9), values)


def test_colorchecker_under_d65_has_the_colors_of_colour_science(colour: ModuleType) -> None:
    """Within 0.05 % of white of colour-science's XYZ, which interpolates by splines."""
    d65 = spectra.illuminant("D65")
    cmf = [Spectrum(tables=(table,)) for table in spectra.cmf()]
    norm = integral(d65.multiply(cmf[1]), 360e-9, 780e-9)
    theirs = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    for name, patch in spectra.colorchecker()[::5]:
        ours = [integral(patch.multiply(d65, c), 360e-9, 780e-9) / norm for c in cmf]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            expected = colour.sd_to_XYZ(theirs[name], illuminant=colour.SDS_ILLUMINANTS["D65"])
        np.testing.assert_allclose(ours, expected / 100, atol=5e-4, err_msg=name)


def test_the_files_are_what_the_script_writes(colour: ModuleType) -> None:
    spec = importlib.util.spec_from_file_location("tables", ROOT / "scripts" / "make_tables.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    version = re.compile(r"colour-science [0-9.]+")
    for path, text in script.everything().items():
        shipped = (ROOT / path).read_text(encoding="utf-8")
        assert version.sub("", shipped) == version.sub("", text), f"{path} is stale"
    assert {ROOT / path for path in script.curves()} == set(GENERIC)
    assert {ROOT / path for path in script.cameras()} == set(MEASURED)


def test_silicon_absorbs_as_its_extinction_coefficient_says() -> None:
    """4 pi k / wavelength of the whole published table; rounded to 4 digits and less in the red."""
    published = ROOT / "tests" / "data" / "silicon-absorption-green-2008.csv"
    nm, per_cm, _, extinction = np.loadtxt(published, delimiter=",", skiprows=3).T
    table = spectra.silicon_absorption()
    np.testing.assert_array_equal(table.wavelength, nm / 1e9)
    np.testing.assert_array_equal(table.value, 100 * per_cm)
    np.testing.assert_allclose(table.value, 4 * np.pi * extinction / (nm * 1e-9), rtol=2e-3)
    assert not table.covers(349e-9, 400e-9)
    assert not table.covers(1000e-9, 1101e-9)


@pytest.mark.parametrize("file", GENERIC, ids=lambda file: file.stem)
def test_generic_curves_are_efficiencies(file: Path) -> None:
    table = spectra.read_spectrum(file)
    assert table.covers(300e-9, 1100e-9)
    assert (table.value >= 0).all()
    assert (table.value <= 1).all()
    assert np.abs(np.diff(table.value)).max() < 0.16, "smooth at 5 nm"
    assert "not a measurement" in file.read_text().splitlines()[0]


def test_the_measured_camera_is_that_of_colour_science(colour: ModuleType) -> None:
    theirs = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]
    for name, values in zip(theirs.labels, theirs.values.T, strict=True):
        ours = spectra.read_spectrum(ROOT / f"configs/filters/nikon-5100-{name}.csv")
        np.testing.assert_array_equal(ours.evaluate(theirs.wavelengths / 1e9), values, err_msg=name)


def test_generic_filters_see_their_own_color() -> None:
    peaks = {
        name: spectra.read_spectrum(ROOT / f"configs/filters/generic-{name}.csv").evaluate(
            nm * 1e-9
        )
        for name, nm in (("red", 610), ("green", 535), ("blue", 455))
    }
    assert peaks == pytest.approx({"red": 0.90, "green": 0.85, "blue": 0.82}, abs=0.005)
    cut = spectra.read_spectrum(ROOT / "configs/filters/ir-cut-650.csv")
    assert cut.evaluate(650e-9) == pytest.approx(0.485)
    assert cut.evaluate(750e-9) < 1e-4
