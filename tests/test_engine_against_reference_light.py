"""The engine's lenses held to the slow camera of tests/reference.py.

Laser light, so that the diffraction integral is evaluated at three wavelengths only; pictures,
pixels and photodetectors that end where the reference's cells do. Standard accuracy: 2.5e-3 rms of
full signal with every effect on, 5e-3 (the promise) where the plan may choose.
"""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference as ref
import reference_scenes as scenes
from making import long_except
from reference_cameras import READOUT, Case, difference, error, leaves, lines, setup_of
from reference_light import Field, Measured
from reference_scenes import flat

import vcam_cli

PICTURE = leaves(24, 32, 3, seed=11)  # two samples a pixel along each side


def lasers(optics: str, pixel: str = "", pattern: str = "bayer-rggb", size="12, columns: 16"):
    """YAML of a camera for laser light at 50 mm; pixels of 4 um, photodetectors of 3 x 2 um."""
    return f"""
scene:
  source: {{kind: image, file: PICTURE, encoding: linear, model: laser}}
  radiance: 2 W/(sr m2)
  distance: 50 mm
optics: {{f_number: 4, focal_length: 2 mm, transmittance: 1, off_axis: none, {optics}}}
pixel:
  width: 4 um
  photodetector: {{width: 3 um, height: 2 um, quantum_efficiency: 0.5}}
  {READOUT}
  {pixel}
array: {{rows: {size}, pattern: {pattern}}}
"""


def laser_setup(camera, picture, **changes) -> ref.Setup:
    """Three lines, each a component; the picture's R is the 650 nm line."""
    setup = setup_of(
        camera, scenes.image_of(camera, picture), lines(450, 550, 650),
        parts=np.eye(3)[::-1], quantum=flat(0.5),
    )  # fmt: skip
    return replace(setup, cell=0.5e-6, **changes)


COMA = "zernike: {7: 0.03 um, 8: -0.05 um}"
LENSES = {
    "defocus": "defocus: 12 um",
    "spherical": "zernike: {11: 0.05 um}, defocus: -8 um",
    "coma": COMA,
    "tilt": "zernike: {2: 0.11 um, 3: -0.07 um}",
    "astigmatism": "zernike: {5: 0.05 um, 6: -0.04 um, 4: 0.03 um}",
    "mixed": "zernike: {5: 30 nm, 8: 60 nm, 9: -25 nm, 11: 30 nm}, defocus: 6 um",
    "two waves": "zernike: {8: 0.25 um}, defocus: 40 um",
}


@pytest.mark.parametrize(
    "lens",
    [lens if lens == "defocus" else pytest.param(lens, marks=pytest.mark.long) for lens in LENSES],
)
def test_wavefronts(lens, tmp_path):
    case = Case(lasers(LENSES[lens]), laser_setup, PICTURE)
    check(case, tmp_path)


def check(case: Case, folder: Path) -> None:
    """Everything on within half of the promise, the plan's choice within all of it."""
    camera = case.load(folder, "all", "all", "standard")
    expected = ref.mean_electrons(case.reference(camera, case.picture))
    assert error(camera, expected) < 2.5e-3
    assert error(case.load(folder, "auto", "auto", "standard"), expected) < 5e-3


def test_coma_has_its_orientation(tmp_path):
    # were it mirrored or turned, it would fit a mirrored or turned lens
    picture = leaves(12, 16, 3, seed=11)
    case = Case(lasers(COMA, size="6, columns: 8"), laser_setup, picture)
    camera = case.load(tmp_path, "coma", "all", "standard")
    setup = case.reference(camera, picture)
    found = np.asarray(vcam_cli.simulate(camera).mean_electrons, float)
    wrong = (
        ((7, -0.03e-6), (8, -0.05e-6)),
        ((7, 0.03e-6), (8, 0.05e-6)),
        ((8, 0.03e-6), (7, -0.05e-6)),
    )
    for terms in wrong:
        expected = ref.mean_electrons(replace(setup, lens=ref.Aberrated(ref.Wavefront(terms))))
        assert difference(found, expected) > 5e-3


def write_samples(folder: Path, samples: np.ndarray) -> Path:
    """Channels (n, rows, columns) as a float EXR."""
    import OpenImageIO as oiio

    path = folder / "psf.exr"
    n, rows, columns = samples.shape
    spec = oiio.ImageSpec(columns, rows, n, "float")
    spec.channelnames = tuple(f"w{k}" for k in range(n)) if n > 1 else ("Y",)
    out = oiio.ImageOutput.create(str(path))
    pixels = np.ascontiguousarray(np.moveaxis(samples, 0, 2).astype(np.float32))
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    assert out.close()
    return path


def comet(rows: int, columns: int, width: float, tail: float) -> np.ndarray:
    """A smooth lopsided spot with its tail to the lower right; samples 0.5 um apart."""
    y, x = np.indices((rows, columns)) - np.array([rows // 3, columns // 4])[:, None, None]
    head = np.exp(-(x**2 + y**2) / (2 * width**2))
    along, aside = (x + y) / np.sqrt(2), (x - y) / np.sqrt(2)
    return head + 0.2 * np.exp(-((along - tail) ** 2) / (2 * tail**2) - aside**2 / (2 * width**2))


@pytest.mark.parametrize("colors", [1, 2])
def test_measured_spread_functions(colors, tmp_path):
    samples = np.array([comet(21, 24, 1.6, 3.0), comet(21, 24, 2.4, 4.0)])[:colors]
    path = write_samples(tmp_path, samples)
    told = "wavelengths: [450 nm, 650 nm]" if colors == 2 else ""
    optics = f"psf: {{file: {path}, pitch: 0.5 um, {told}}}"
    lens = Measured(samples.astype(np.float32), 0.5e-6, (450e-9, 650e-9)[:colors])
    check(Case(lasers(optics), lambda c, p: laser_setup(c, p, lens=lens), PICTURE), tmp_path)


FIELDS = {
    "curved": "{field: 0, 4: 0 um}, {field: 0.6, 4: 20 nm}, {field: 1, 4: 60 nm, 11: 20 nm}",
    "steep": "{field: 0, 4: 0 um}, {field: 0.6, 4: 30 nm}, {field: 1, 4: 90 nm, 11: 20 nm}",
    "coma": "{field: 0, 8: 0 um}, {field: 1, 8: 0.08 um}",
    "mixed": "{field: 0, 11: 30 nm}, {field: 0.7, 8: 0.05 um, 6: 20 nm, 11: 30 nm},"
    " {field: 1, 8: 0.08 um, 6: 50 nm}",
}


@pytest.mark.long
@pytest.mark.parametrize("field", FIELDS)
def test_fields(field, tmp_path):
    # the diffraction integral of each pixel's own place, for every third pixel of a small array
    yaml = lasers(f"zernike: [{FIELDS[field]}]", pattern="monochrome")
    yaml = yaml.replace(
        "model: laser}", "model: reflectance}\n  illuminant: {monochromatic: 550 nm}"
    )
    case = Case(yaml, None, leaves(24, 32, 1, seed=12))
    camera = case.load(tmp_path, "field", "all", "standard")
    places, terms = zip(*camera.optics.zernike.terms, strict=True)
    setup = setup_of(camera, scenes.image_of(camera, case.picture), lines(550), quantum=flat(0.5))
    corner = np.hypot(8 * 4e-6, 6 * 4e-6)
    setup = replace(setup, cell=0.5e-6, lens=Field(places, terms, corner))
    chosen = np.zeros((12, 16), bool)
    chosen[::3, ::3] = chosen[-1, -1] = True
    expected = ref.electrons_of_field(setup, chosen)[chosen]
    for accuracy, bound in (("draft", 1e-2), ("standard", 2.5e-3), ("reference", 2e-4)):
        camera = case.load(tmp_path, "field", "all", accuracy)
        found = np.asarray(vcam_cli.simulate(camera).mean_electrons, float)
        assert np.sqrt(np.mean((found[chosen] - expected) ** 2)) < bound * found.max(), accuracy


# --- waves: nothing is approximated --------------------------------------------------------------


def grating(optics: str) -> Case:
    yaml = f"""
scene:
  source:
    {{kind: chart, chart: sinusoid, frequency: 70 lp/mm, contrast: 0.8, mean: 0.5,
     orientation: 25 deg, phase: 40 deg}}
  illuminant: {{monochromatic: 550 nm}}
  luminance: 300 cd/m2
  distance: 0.3 m
optics: {{f_number: 4, focal_length: 5 mm, transmittance: 1, off_axis: none, {optics}}}
pixel:
  width: 4 um
  photodetector: {{width: 2.5 um, height: 3 um, x: 0.2 um, y: 0.8 um, quantum_efficiency: 0.5}}
  READOUT
array: {{rows: 24, columns: 32, pattern: monochrome}}
"""
    return Case(
        yaml,
        lambda camera, picture: setup_of(
            camera, scenes.grating(camera), lines(550), quantum=flat(0.5)
        ),
    )


ALL_WAVES = set(itertools.product(LENSES, ("true", "false")))


# by rays alone the margin of spherical aberration takes four seconds; other lenses are as quick
@pytest.mark.parametrize(
    ("lens", "diffraction"),
    long_except(ALL_WAVES - {("spherical", "false")}, sorted(ALL_WAVES), several=True),
)
def test_waves_through_wavefronts(lens, diffraction, tmp_path):
    case = grating(f"{LENSES[lens]}, diffraction: {diffraction}")
    camera = case.load(tmp_path, "grating", "all", "reference")
    expected = ref.mean_electrons(case.reference(camera, None))
    assert error(camera, expected) < 1e-5  # of the pupil's points in the engine


# --- falloff and stray light ---------------------------------------------------------------------


def test_measured_falloff(tmp_path):
    # 0.2 % a micrometer, far steeper than a lens's: the engine applies it after the blur
    (tmp_path / "fall.csv").write_text(
        "image_height_mm,value\n0,1\n0.02,0.98\n0.04,0.94\n0.2,0.9\n"
    )
    table = ((0.0, 0.02e-3, 0.04e-3, 0.2e-3), (1.0, 0.98, 0.94, 0.9))
    yaml = lasers("").replace("off_axis: none", f"off_axis: {{file: {tmp_path}/fall.csv}}")
    case = Case(yaml, lambda c, p: laser_setup(c, p, illumination=table), PICTURE)
    check(case, tmp_path)


@pytest.mark.long
def test_stray_light(tmp_path):
    check(Case(lasers("stray_light: 0.06"), laser_setup, PICTURE), tmp_path)
