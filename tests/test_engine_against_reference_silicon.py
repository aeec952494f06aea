"""The engine's silicon and pixels held to the slow camera of tests/reference.py.

Standard accuracy: 2.5e-3 rms of full signal with every effect on, 5e-3 (the promise) where the plan
may choose; 1e-6 at `reference` where neither side approximates. Lamps are uniform or of few lines
where a picture has to be blurred wavelength by wavelength.
"""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference as ref
import reference_pixel as layers
import reference_readout as readout
import reference_scenes as scenes
from making import long_except
from reference_cameras import READOUT, Case, continuous, error, leaves, lines, setup_of
from reference_process import PROCESSES, photodiode
from reference_scenes import flat, lamp
from reference_silicon import Diffusion, dark_density

import vcam_cli

PICTURE = leaves(24, 32, 3, seed=21)  # two samples a pixel along each side


def camera(
    pixel: str, detector: str = "width: 3 um, height: 2 um, quantum_efficiency: 0.5",
    optics: str = "f_number: 4, focal_length: 2 mm", pattern: str = "bayer-rggb",
    size: str = "rows: 12, columns: 16", extra: str = READOUT,
) -> str:  # fmt: skip
    """YAML of a camera for laser light at 50 mm; pixels of 4 um."""
    return f"""
scene:
  source: {{kind: image, file: PICTURE, encoding: linear, model: laser}}
  radiance: 2 W/(sr m2)
  distance: 50 mm
optics: {{transmittance: 1, off_axis: none, {optics}}}
pixel:
  width: 4 um
  photodetector: {{{detector}}}
  {extra}
  {pixel}
array: {{{size}, pattern: {pattern}}}
"""


def laser_setup(camera, picture, quantum=None, **changes) -> ref.Setup:
    """Three lines, each a component; the picture's R is the 650 nm line."""
    setup = setup_of(
        camera, scenes.image_of(camera, picture), lines(450, 550, 650),
        parts=np.eye(3)[::-1], quantum=quantum or flat(0.5),
    )  # fmt: skip
    return replace(setup, **{"cell": 0.5e-6, **changes})


def check(case: Case, folder: Path) -> None:
    """Everything on within half of the promise, the plan's choice within all of it."""
    camera = case.load(folder, "all", "all", "standard")
    expected = ref.mean_electrons(case.reference(camera, case.picture))
    if camera.pixel.readout.charge_transfer is not None:
        given = camera.pixel.readout.charge_transfer
        expected = readout.transferred(expected, given.inefficiency, given.phases)
    assert error(camera, expected) < 2.5e-3
    assert error(case.load(folder, "auto", "auto", "standard"), expected) < 5e-3


# --- diffusion of charge -------------------------------------------------------------------------

LAYERS = Diffusion(20e-6, 0.5e-6, 8e-6)
DIFFUSION = (
    "charge_diffusion: {diffusion_length: 20 um, depletion_width: 0.5 um, substrate_depth: 8 um}"
)
DETECTOR = f"width: 3 um, height: 2 um, quantum_efficiency: 0.5, {DIFFUSION}"


@pytest.mark.parametrize("diffraction", ["true", "false"])
def test_diffusion_of_pictures(diffraction, tmp_path):
    yaml = camera("", DETECTOR, f"f_number: 4, focal_length: 2 mm, diffraction: {diffraction}")
    check(Case(yaml, lambda c, p: laser_setup(c, p, silicon=LAYERS), PICTURE), tmp_path)


def test_diffusion_under_a_lamp(tmp_path):
    # 60 nm of daylight, 180 wavelengths: deep red, which blurs most
    yaml = camera("", DETECTOR, "f_number: 4, focal_length: 2 mm, diffraction: false", "monochrome")
    yaml = yaml.replace("model: laser}", "model: reflectance}\n  illuminant: D65")
    yaml = yaml.replace(
        "distance: 50 mm", "wavelengths: {start: 630 nm, stop: 690 nm}\n  distance: 50 mm"
    )
    case = Case(
        yaml,
        lambda c, p: replace(
            setup_of(c, scenes.image_of(c, p), continuous(lamp("D65"), 630e-9, 690e-9),
                     quantum=flat(0.5)),
            silicon=LAYERS, cell=0.5e-6,
        ),
        leaves(24, 32, 1, seed=22),
    )  # fmt: skip
    check(case, tmp_path)


GRATING = """
scene:
  source:
    {kind: chart, chart: sinusoid, frequency: 70 lp/mm, contrast: 0.8, mean: 0.5,
     orientation: 25 deg, phase: 40 deg}
  illuminant: {monochromatic: 650 nm}
  luminance: 300 cd/m2
  distance: 0.3 m
optics: {f_number: 4, focal_length: 5 mm, transmittance: 1, off_axis: none}
pixel:
  width: 4 um
  photodetector: {DETECTOR}
  READOUT
array: {rows: 24, columns: 32, pattern: monochrome}
"""


def test_diffusion_of_waves(tmp_path):
    case = Case(
        GRATING.replace("DETECTOR", DETECTOR),
        lambda c, p: replace(
            setup_of(c, scenes.grating(c), lines(650), quantum=flat(0.5)), silicon=LAYERS
        ),
    )
    camera = case.load(tmp_path, "grating", "all", "reference")
    # the Hankel integral of Airy's pattern is good to 1e-7
    assert error(camera, ref.mean_electrons(case.reference(camera, None))) < 1e-6


# --- photodiodes of processes --------------------------------------------------------------------

UNIFORM = """
scene:
  source: {kind: chart, chart: uniform, reflectance: 0.18}
  illuminant: D65
  luminance: 300 cd/m2
  distance: 1 m
optics: {f_number: 2.8, focal_length: 5 mm, transmittance: 1, off_axis: none}
pixel:
  width: 6.5 um
  technology: TECHNOLOGY
  temperature: 308 K
  photodetector: {kind: KIND}
array: {rows: 8, columns: 12, pattern: monochrome}
"""
GRAY = ref.Waves((0.18,), (0.0,), (0.0,), (0.0,))


@pytest.mark.parametrize("kind", ["ndiff-psub", "nwell-psub", "pinned", "photogate"])
@pytest.mark.parametrize("name", PROCESSES)
def test_photodiodes_of_processes(name, kind, tmp_path):
    # size, QE and dark current all from the technology. QE is straight between wavelengths 0.25 nm
    # apart in the engine: 6e-5 at most, less than 1e-7 over a lamp's spectrum
    case = Case(UNIFORM.replace("TECHNOLOGY", name).replace("KIND", kind), None)
    camera = case.load(tmp_path, "process", "all", "reference")
    diode = photodiode(PROCESSES[name], 6.5e-6, 6.5e-6, kind)
    setup = setup_of(camera, GRAY, continuous(lamp("D65")), quantum=diode.external_efficiency)
    setup = replace(setup, aperture=(0.0, 0.0, *diode.side), dark_rate=diode.dark_rate(308.0))
    assert error(camera, ref.mean_electrons(setup)) < 1e-6


JUNCTION = {  # of the 0.35 um process, for 2.31
    "hole_diffusivity": 2e-4, "electron_diffusivity": 20e-4, "donors": 5e25, "acceptors": 8e22,
    "hole_lifetime": 1e-7, "electron_lifetime": 1e-6,
}  # fmt: skip


def test_dark_current_of_a_junction(tmp_path):
    # 2.31 and the perimeter's, with light; what is depleted lies on both sides of the junction,
    # as much charge on the one as on the other. Intrinsic concentrations are known to some percent
    # (9.65e9 / cm3 at 300 K, Altermatt 2003), so the law is checked at the package's own
    from vcam_cli.physics.silicon import intrinsic_concentration

    yaml = UNIFORM.replace("TECHNOLOGY", "cmos-0.35um").replace("308 K", "300 K")
    yaml = yaml.replace("kind: KIND", "quantum_efficiency: 0.5, dark_current_density: junction")
    camera = Case(yaml.replace("300 lx", "1e-9 lx"), None).load(
        tmp_path, "dark", "all", "reference"
    )
    diode = photodiode(PROCESSES["cmos-0.35um"], 6.5e-6, 6.5e-6)
    x1, x2, x3 = diode.depths
    share = JUNCTION["acceptors"] / (JUNCTION["acceptors"] + JUNCTION["donors"])
    n_i = float(intrinsic_concentration(300.0))
    assert n_i == pytest.approx(9.65e15, rel=0.05)
    density = dark_density(
        n_i, {**JUNCTION, "x1": x1, "neutral": x3 - x2}, share * (x2 - x1), (1 - share) * (x2 - x1)
    )
    rate = (density * diode.area + diode.edge_current) / ref.CHARGE
    setup = setup_of(camera, GRAY, continuous(lamp("D65")), quantum=flat(0.5))
    setup = replace(setup, aperture=(0.0, 0.0, *diode.side), dark_rate=rate)
    assert error(camera, ref.mean_electrons(setup)) < 1e-6


def test_reset_noise_of_a_process(tmp_path):
    # capacitance of junction, sidewall and gate; 12288 equal pixels, so five times 1.3 %
    yaml = UNIFORM.replace("TECHNOLOGY", "cmos-0.35um").replace("KIND", "ndiff-psub")
    yaml = yaml.replace(
        "array: {rows: 8, columns: 12",
        "  readout: {reset_noise: ktc}\narray: {rows: 96, columns: 128",
    )
    camera = Case(yaml, None).load(tmp_path, "ktc", "{shot_noise: off}", "standard")
    diode = photodiode(PROCESSES["cmos-0.35um"], 6.5e-6, 6.5e-6)
    expected = readout.reset_variance("aps-3t", diode.capacitance, 308.0)
    found = np.asarray(vcam_cli.simulate(camera).electrons, float)
    assert found.var() == pytest.approx(expected, rel=5 * math.sqrt(2 / found.size))


@pytest.mark.parametrize(
    ("architecture", "told"),
    [
        ("aps-3t", ""), ("dps", ""), ("aps-4t", ""), ("ccd", ""),
        ("pps", ", bit_line_capacitance: 200 fF"),
    ],
)  # fmt: skip
def test_noise_of_architectures(architecture, told, tmp_path):
    # variances and column terms on 96 x 128 equal pixels; columns' own from their means
    noise = "read_noise: 6 e, column_noise: 9 e, row_noise: 4 e, reset_noise: ktc"
    yaml = UNIFORM.replace("  technology: TECHNOLOGY\n", f"  architecture: {architecture}\n")
    yaml = yaml.replace(
        "{kind: KIND}",
        "{fill_factor: 0.5, quantum_efficiency: 0.5, capacitance: 5 fF, dark_current: 5 ke/s}\n"
        f"  readout: {{voltage_swing: 20 V, {noise}{told}}}\n"
        "  fpn: {offset_pixel: 5 e, offset_column: 7 e, gain_pixel: 0.4 %, dark: 20 %}",
    ).replace("rows: 8, columns: 12", "rows: 96, columns: 128")
    camera = Case(yaml, None).load(tmp_path, "noise", "all", "standard")
    setup = setup_of(camera, GRAY, continuous(lamp("D65")), quantum=flat(0.5))
    columns = 1.0 if architecture in ("aps-3t", "aps-4t", "pps") else 0.0
    variances = readout.noise_variance(
        setup, read=6, row=4, offset_pixel=5, gain_pixel=0.004, dark=0.2
    )
    reset = readout.reset_variance(architecture, 5e-15, 308.0, bit_line=200e-15)
    pixels = float(sum(v.mean() for v in variances.values())) - 16 + reset
    found = np.asarray(vcam_cli.simulate(camera).electrons, float)
    found = found - found.mean(axis=1, keepdims=True)  # without the rows' own
    of_columns = found.mean(axis=0)
    count = found.size
    expected = columns * (9**2 + 7**2) + pixels / 96
    assert of_columns.var(ddof=1) == pytest.approx(expected, rel=5 * math.sqrt(2 / 127))
    rest = (found - of_columns).var() * count / (count - 96 - 128)
    assert rest == pytest.approx(pixels, rel=5 * math.sqrt(2 / count))


# --- layers and microlenses ----------------------------------------------------------------------

STACK = (
    "stack: {passivation: {thickness: 0.5 um, index: 2.0}, oxide: {thickness: 3 um, index: 1.46}}"
)
LAYERED = layers.Stack((0.5e-6, 2.0), (3e-6, 1.46))
WIDE = "f_number: 1.8, focal_length: 0.1 mm"  # chief rays of 22 degrees in the corners


@pytest.mark.long
@pytest.mark.parametrize("pupil", [None, 0.06e-3])
def test_tunnels(pupil, tmp_path):
    told = f", exit_pupil_distance: {pupil * 1e3} mm" if pupil else ""
    yaml = camera(STACK, optics=WIDE + told)
    changes = {"stack": LAYERED, "tunnel": (3e-6, 2e-6), "pupil": pupil}
    check(Case(yaml, lambda c, p: laser_setup(c, p, **changes), PICTURE), tmp_path)


@pytest.mark.long
def test_tunnels_over_a_junction(tmp_path):
    # internal QE: all that the faces reflect is lost, and the technology's 0.75 is not
    technology = f"technology: cmos-0.35um\n  {STACK}"
    extra = READOUT.replace("voltage_swing: 20 V", "voltage_swing: 2 V")
    yaml = camera(technology, "width: 3 um, height: 2 um", WIDE, extra=extra)
    diode = photodiode(replace(PROCESSES["cmos-0.35um"], swing=2.0), 6.5e-6, 6.5e-6)
    changes = {"stack": LAYERED, "tunnel": (3e-6, 2e-6), "internal": True, "dark_rate":
        replace(diode, area=6e-12, perimeter=10e-6).dark_rate()}  # fmt: skip

    def reference(c, p):
        return laser_setup(c, p, quantum=diode.quantum_efficiency, **changes)

    check(Case(yaml, reference, PICTURE), tmp_path)


LENSLETS = list(itertools.product(["gain: 1.8", "efficiency: 0.81"], ["optimal", "centered"]))


@pytest.mark.parametrize(("told", "shift"), long_except([LENSLETS[-1]], LENSLETS, several=True))
def test_microlenses(shift, told, tmp_path):
    # the collecting area, centered in its pixel, takes the photodetector's place as aperture; sharp
    # light, so that its shift shows
    yaml = camera(
        f"{STACK}\n  microlens: {{{told}, shift: {shift}}}", optics=WIDE + ", diffraction: false"
    )
    number = float(told.split()[1])
    share = number if "efficiency" in told else layers.effective(number, None, 6 / 16)
    side = 4e-6 * layers.side(share)
    changes = {"stack": LAYERED, "tunnel": (3e-6, 2e-6), "aperture": (0.0, 0.0, side, side)}

    def reference(c, p):
        return laser_setup(c, p, microlens=shift, cell=0.25e-6, **changes)

    check(Case(yaml, reference, PICTURE), tmp_path)


# --- ccd, and everything -------------------------------------------------------------------------


def test_charge_transfer(tmp_path):
    detector = "width: 3 um, height: 2 um, quantum_efficiency: 0.5, dark_current: 20 ke/s"
    extra = "readout: {conversion_gain: 20 uV/e, voltage_swing: 20 V," \
        " charge_transfer: {inefficiency: 2e-3, phases: 3}}"  # fmt: skip
    yaml = camera("architecture: ccd", detector, extra=extra)
    check(Case(yaml, laser_setup, PICTURE), tmp_path)


@pytest.mark.long
def test_everything_together(tmp_path):
    (tmp_path / "fall.csv").write_text("image_height_mm,value\n0,1\n0.04,0.985\n0.2,0.9\n")
    optics = (
        "f_number: 2.8, focal_length: 0.4 mm, exit_pupil_distance: 0.3 mm, stray_light: 0.03,"
        " zernike: {5: 30 nm, 8: 50 nm, 11: 20 nm}, defocus: 4 um"
    )
    detector = f"{DETECTOR}, dark_current: 20 ke/s"
    extra = "readout: {conversion_gain: 20 uV/e, voltage_swing: 20 V," \
        " charge_transfer: {inefficiency: 1e-4, phases: 3}}"  # fmt: skip
    pixel = f"architecture: ccd\n  {STACK}\n  microlens: {{efficiency: 0.5625, shift: optimal}}"
    yaml = camera(pixel, detector, optics, extra=extra)
    yaml = yaml.replace("off_axis: none", f"off_axis: {{file: {tmp_path}/fall.csv}}")
    changes = {
        "stack": LAYERED, "tunnel": (3e-6, 2e-6), "aperture": (0.0, 0.0, 3e-6, 3e-6),
        "pupil": 0.3e-3, "microlens": "optimal", "silicon": LAYERS, "cell": 0.25e-6,
        "illumination": ((0.0, 0.04e-3, 0.2e-3), (1.0, 0.985, 0.9)),
    }  # fmt: skip
    check(Case(yaml, lambda c, p: laser_setup(c, p, **changes), PICTURE), tmp_path)
