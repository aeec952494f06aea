"""Broken camera files: every one is refused with place, path and remedy, and nothing is written.

Each case is the good file below with some text replaced, and the lines it must put on stderr:
(line:column, path, a part of the message, a part of the remedy), all of them and no others.
"""

import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from typer.testing import CliRunner

from vcam_cli.commands.main import app

GOOD = """\
name: good
scene:
  source: {kind: chart, chart: uniform}
  illuminant: D65
  luminance: 100 cd/m2
  distance: 1 m
optics:
  f_number: 2.8
  focal_length: 3.2 mm
  transmittance: 0.9
pixel:
  width: 6.5 um
  photodetector:
    fill_factor: 0.3
    quantum_efficiency: 0.5
  readout:
    conversion_gain: 20 uV/e
    voltage_swing: 1 V
array: {rows: 6, columns: 8, pattern: bayer-rggb}
exposure: {time: 30 ms}
adc: {bits: 10}
"""

IMAGE = "{kind: image, file: PICTURE, model: laser}"
CUBE = "{kind: hyperspectral, file: PICTURE}"
CHART = "{kind: chart, chart: uniform}"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """The current folder: pictures and tables, whole and broken."""
    monkeypatch.chdir(tmp_path)
    image("good.exr", np.full((4, 4, 3), 0.5))
    image("nan.exr", np.full((4, 4, 3), np.nan))
    image("negative.exr", np.full((4, 4, 3), -0.5))
    image("gray.exr", np.full((4, 4, 1), 0.5))
    image("two.exr", np.full((4, 4, 2), 0.5))
    nm = np.arange(400.0, 701.0, 100.0)
    np.savez("cube.npz", wavelength_nm=nm, reflectance=np.full((2, 2, 4), 0.5))
    np.savez("light.npz", wavelength_nm=nm, radiance=np.full((2, 2, 4), 0.5))
    np.savez("holes.npz", wavelength_nm=nm, radiance=np.full((2, 2, 4), np.nan))
    Path("truncated.exr").write_bytes(Path("good.exr").read_bytes()[:-40])
    Path("text.png").write_text("this is no picture\n")
    Path("empty.png").write_bytes(b"")
    Path("short.csv").write_text("wavelength_nm,value\n500,0.5\n600,0.5\n")
    Path("lens.csv").write_text("image_height_mm,value\n0,1\n0.02,0.5\n")
    Path("mixed.csv").write_text("wavelength_nm,value\n500,0.5\n700,0.5\n400,0.5\n")
    Path("words.csv").write_text("wavelength_nm,value\n400,high\n700,low\n")
    Path("loop.yaml").write_text("extends: ./loop.yaml\n")
    return tmp_path


def image(name: str, pixels: np.ndarray) -> None:
    out = oiio.ImageOutput.create(name)
    height, width, channels = pixels.shape
    assert out.open(name, oiio.ImageSpec(width, height, channels, "float"))
    assert out.write_image(np.ascontiguousarray(pixels, np.float32))
    assert out.close()


def run(*args: str):
    return CliRunner().invoke(app, ["run", "broken.yaml", *args], prog_name="vcam")


def broken(*changes: tuple[str, str]) -> str:
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


Line = tuple[str, str, str, str]
CASES: dict[str, tuple[str, list[Line]]] = {}


def case(name: str, *changes: tuple[str, str], says: list[Line], text: str | None = None) -> None:
    assert name not in CASES
    CASES[name] = broken(*changes) if text is None else text, says


# --- the YAML itself
case("an empty file", text="", says=[("1:1", "", "the file is empty", "vcam init")])
case("nothing but a comment", text="# hm\n", says=[("1:1", "", "is empty", "vcam init")])
case("a list", text="- a\n- b\n", says=[("1:1", "", "a mapping is needed", "key: value")])
case(
    "a tag",
    ("2.8", "!!float 2.8"),
    says=[("8:13", "optics.f_number", "tag:yaml.org,2002:float", "remove it")],
)
case(
    "a key twice",
    ("f_number: 2.8", "f_number: 2.8\n  f_number: 4"),
    says=[("9:3", "optics", "'f_number' is given twice (first in line 8)", "remove one")],
)
case("a tab", ("  f_number", "\tf_number"), says=[("8:1", "", "a tab", "use spaces")])
case(
    "an open bracket",
    ("{bits: 10}", "{bits: 10"),
    says=[("22:1", "", "is not YAML: did not find expected ',' or '}'", "brackets")],
)
case(
    "an alias bomb",
    text="\n".join(
        ["a0: &a0 [" + "x, " * 20 + "]"]
        + [f"a{i}: &a{i} [" + f"*a{i - 1}, " * 20 + "]" for i in range(1, 12)]
    ),
    says=[("4:60", "a3", "more than 100000 values", "CSV")],
)
case(
    "a deep nest",
    text="a: " + "[" * 1000,
    says=[("1:67", "a", "nested deeper than 64 levels", "flatten")],
)
case(
    "a study",
    text="kind: sweep\nname: pixel-size\n",
    says=[("1:7", "kind", "this is a study (kind: sweep)", "give a camera file")],
)

# --- keys
case(
    "an unknown key",
    ("  transmittance", "  transmitance"),
    says=[("10:17", "optics.transmitance", "no such key", "did you mean transmittance?")],
)
case(
    "an unknown section",
    ("adc:", "adcs:"),
    says=[("21:7", "adcs", "there is no such key here", "did you mean adc?")],
)
case(
    "a missing section",
    ("exposure: {time: 30 ms}\n", ""),
    says=[("1:1", "exposure", "is missing", "exposure: {time: 30 ms}")],
)
case(
    "an empty value",
    ("f_number: 2.8", "f_number:"),
    says=[("8:12", "optics.f_number", "is empty", "write a number such as 2.8")],
)
case(
    "a schedule without captures",
    ("{time: 30 ms}", "{captures: {schedule: optimal, count: 0, max: 1 s}}"),
    says=[("20:49", "exposure.captures.count", "0 is out of range", "at least 1")],
)
case(
    "a schedule of another kind",
    ("{time: 30 ms}", "{captures: {schedule: best, count: 8, max: 1}}"),
    says=[
        ("20:33", "exposure.captures.schedule", "best", "optimal"),
        ("20:54", "exposure.captures.max", "bare number", "100 ms"),
    ],
)

# --- quantities and numbers
case(
    "a bare number",
    ("6.5 um", "6.5"),
    says=[("12:10", "pixel.width", "6.5 is a bare number", "for example 6.5 um")],
)
case(
    "another dimension",
    ("6.5 um", "6.5 ms"),
    says=[("12:10", "pixel.width", "is a time, not a length", "for example 6.5 um")],
)
case(
    "a unit in capitals",
    ("6.5 um", "6.5 UM"),
    says=[("12:10", "pixel.width", "there is no unit 'UM'", "did you mean um?")],
)
case(
    "a decimal comma",
    ("6.5 um", "'6,5 um'"),
    says=[("12:10", "pixel.width", "has a comma", "write a decimal point")],
)
case(
    "not a number",
    ("f_number: 2.8", "f_number: .nan"),
    says=[("8:13", "optics.f_number", "nan is not", "write")],
)
case(
    "infinity",
    ("f_number: 2.8", "f_number: .inf"),
    says=[("8:13", "optics.f_number", "inf is not", "write")],
)
case(
    "too large a number",
    ("f_number: 2.8", "f_number: 1e999"),
    says=[("8:13", "optics.f_number", "inf is not", "write")],
)
case(
    "a negative size",
    ("6.5 um", "-6.5 um"),
    says=[("12:10", "pixel.width", "'-6.5 um' is negative", "write a positive length")],
)
case(
    "no time",
    ("30 ms", "0 s"),
    says=[("20:18", "exposure.time", "'0 s' is zero", "write a positive time")],
)
case(
    "half a row",
    ("rows: 6", "rows: 6.5"),
    says=[("19:15", "array.rows", "6.5 is not a whole number", "such as 512")],
)
case(
    "too many bits",
    ("bits: 10", "bits: 40"),
    says=[("21:13", "adc.bits", "40 is out of range", "at most 24")],
)
case(
    "a percentage as a fraction",
    ("efficiency: 0.5", "efficiency: 50"),
    says=[
        (
            "15:25",
            "pixel.photodetector.quantum_efficiency",
            "50 is out of range",
            "write 50 %, or 0.5",
        )
    ],
)

# --- what contradicts itself
case(
    "optics that disagree",
    ("3.2 mm", "3.2 mm\n  aperture_diameter: 9 mm"),
    says=[("10:22", "optics.aperture_diameter", "a focal length of 25.2 mm", "give two of")],
)
case(
    "an object inside the focal length",
    ("1 m\n", "3 mm\n"),
    says=[("6:13", "scene.distance", "lies within its focal length", "further away")],
)
case(
    "a size at infinity",
    ("distance: 1 m", "distance: infinity\n  extent: {width: 1 m}"),
    says=[("7:11", "scene.extent", "no width in meters", "extent: sensor")],
)
case(
    "two light levels",
    ("100 cd/m2", "100 cd/m2\n  illuminance: 300 lx"),
    says=[("6:16", "scene.illuminance", "cannot both be given", "keep one")],
)
case(
    "no light level",
    ("  luminance: 100 cd/m2\n", ""),
    says=[("2:1", "scene", "the light level is missing", "luminance: 100 cd/m2")],
)
case(
    "a photodetector larger than its pixel",
    ("fill_factor: 0.3", "width: 9 um\n    height: 9 um"),
    says=[("14:12", "pixel.photodetector.width", "from -1.25 to 7.75 um", "make it smaller")],
)
case(
    "a fill factor that disagrees",
    ("fill_factor: 0.3", "fill_factor: 0.3\n    width: 1 um\n    height: 1 um"),
    says=[("14:18", "pixel.photodetector.fill_factor", "make it 0.0236686", "give the fill")],
)
case(
    "a readout that disagrees",
    ("1 V", "1 V\n    full_well: 10 ke"),
    says=[("19:16", "pixel.readout.full_well", "is 50000 e, not 10000 e", "two of the three")],
)
case(
    "a relative illumination that ends before the corner",
    ("f_number: 2.8", "f_number: 2.8\n  off_axis: {file: lens.csv}"),
    says=[("9:20", "optics.off_axis.file", "is 0.0325 mm from the axis", "up to 0.0325 mm")],
)
case(
    "a spectrum as relative illumination",
    ("f_number: 2.8", "f_number: 2.8\n  off_axis: {file: short.csv}"),
    says=[("9:20", "optics.off_axis.file", "the header is", "image_height_mm,value")],
)
case(
    "a passive pixel whose bit line is missing",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: pps"),
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    reset_noise: ktc"),
    says=[("17:3", "pixel.readout.bit_line_capacitance", "is missing", "2000 fF")],
)
case(
    "transfer of charge without a ccd",
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    charge_transfer: {phases: 3}"),
    says=[("19:22", "pixel.readout.charge_transfer", "an aps-3t pixel transfers no", "ccd")],
)
case(
    "charge that never arrives",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: ccd"),
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    charge_transfer: {inefficiency: 1}"),
    says=[("20:37", "pixel.readout.charge_transfer.inefficiency", "out of range", "less than 1")],
)
case(
    "captures of a readout that destroys",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: ccd"),
    ("time: 30 ms", "captures: [5 ms, 30 ms]"),
    says=[("21:22", "exposure.captures", "a ccd pixel destroys its charge", "aps-3t or dps")],
)
case(
    "more noise than numbers",
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    read_noise: 1e300 e\n    reset_noise: 2e9 e"),
    says=[
        ("19:17", "pixel.readout.read_noise", "out of range; it must be at most 1000 Me", ""),
        ("20:18", "pixel.readout.reset_noise", "out of range; it must be at most 1000 Me", ""),
    ],
)
case(
    "more defects than pixels",
    ("width: 6.5 um", "width: 6.5 um\n  defects: {hot: 60 %, dead: 50 %}"),
    says=[("13:12", "pixel.defects", "are 1.1 of all", "at most 1")],
)
case(
    "a die smaller than a pixel",
    ("rows: 6, columns: 8", "die: {width: 1 um, height: 1 um}"),
    says=[("19:14", "array.die", "smaller than one pixel", "a larger die")],
)
case(
    "rows without columns",
    ("rows: 6, columns: 8", "rows: 6"),
    says=[("19:8", "array.columns", "is missing", "add columns")],
)
case(
    "a lamp beside light",
    (CHART, IMAGE.replace("PICTURE", "good.exr")),
    says=[("4:15", "scene.illuminant", "emits light has no lamp", "remove it")],
)
NARROW = ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 400 nm, stop: 700 nm}")
case(
    "wavelengths beyond those of a file",
    (CHART, CUBE.replace("PICTURE", "cube.npz")),
    says=[
        ("2:1", "scene.wavelengths", "covers 400 nm to 700 nm, but 380 to 780 nm", "start: 400 nm")
    ],
)
case(
    "a lamp on light from a file",
    (CHART, CUBE.replace("PICTURE", "light.npz")),
    NARROW,
    says=[("4:15", "scene.illuminant", "holds radiances, which are light", "remove the illum")],
)
case(
    "a level from a file of reflectances",
    (CHART, CUBE.replace("PICTURE", "cube.npz")),
    ("100 cd/m2", "from-file"),
    NARROW,
    says=[("5:14", "scene.luminance", "holds reflectances", "100 cd/m2")],
)
case(
    "a level from a chart",
    ("100 cd/m2", "from-file"),
    says=[("5:14", "scene.luminance", "no absolute radiance in a file", "100 cd/m2")],
)
case(
    "a file of spectra with holes",
    (CHART, CUBE.replace("PICTURE", "holes.npz")),
    ("  illuminant: D65\n", ""),
    NARROW,
    says=[("3:39", "scene.source.file", "not finite (nan at row 0, column 0, 400 nm", "by 0")],
)
case(
    "a picture where spectra belong",
    (CHART, CUBE.replace("PICTURE", "good.exr")),
    says=[("3:39", "scene.source.file", "no channels named like S0.550", "spectral .exr")],
)
case(
    "wavelengths in disorder",
    ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 700 nm, stop: 400 nm}"),
    says=[("7:38", "scene.wavelengths.stop", "must be longer than start", "exchange")],
)
case(
    "steps in an order that cannot work",
    ("adc:", "processing: [gamma: 2.2, demosaic: bilinear]\nadc:"),
    says=[("21:36", "processing.1.demosaic", "demosaic after gamma", "put gamma last")],
)
case(
    "an effect of nothing",
    ("adc:", "effects: {read_noise: on}\nadc:"),
    says=[("21:23", "effects.read_noise", "there is nothing to simulate", "describe it")],
)

# --- the process behind the pixel
MEASURED = """\
  width: 6.5 um
  photodetector:
    fill_factor: 0.3
    quantum_efficiency: 0.5
  readout:
    conversion_gain: 20 uV/e
    voltage_swing: 1 V
"""
JUNCTION = "{depth: 0.2 um, depletion_width: 0.2 um, substrate_depth: 5 um}"


def processed(name: str, *pixel: str, says: list[Line]) -> None:
    """A case whose pixel (from line 12 on) is left to a technology."""
    case(name, (MEASURED, "".join(f"  {line}\n" for line in pixel)), says=says)


processed(
    "a misspelt technology",
    "technology: cmos-0.53um",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:15", "pixel.technology.from", "not a technology that ships", "'cmos-0.35um'")],
)
processed(
    "no technology but a number",
    "technology: 0.35",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:15", "pixel.technology", "0.35 is not a technology", "cmos-0.35um")],
)
processed(
    "a pixel too small for its transistors",
    "technology: cmos-0.35um",
    "width: 4 um",
    "photodetector: {}",
    says=[("13:10", "pixel.width", "too small for its transistors", "that works is 5.097 um")],
)
processed(
    "a feature size far from the technology's",
    "technology: {from: cmos-0.35um, feature_size: 0.01 um}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:49", "pixel.technology.feature_size", "too far from the 0.35 um", "factor of 20")],
)
processed(
    "thresholds that leave no swing",
    "technology:",
    "  from: cmos-0.35um",
    "  thresholds: {reset: 1 V, bias: 2 V, bias_gate: 0.5 V, follower_gate_source: 1 V}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("14:17", "pixel.technology.thresholds", "a swing of -0.2 V", "raise the supply")],
)
processed(
    "a negative swing",
    "technology: {from: cmos-0.35um, voltage_swing: -1 V}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:50", "pixel.technology.voltage_swing", "is negative", "a positive voltage")],
)
processed(
    "a swing beyond the reset voltage",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {}",
    "readout: {voltage_swing: 3 V}",
    says=[("15:28", "pixel.readout.voltage_swing", "2.25 V would bias the", "a smaller")],
)
processed(
    "a depletion region without width",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {junction: {depletion_width: 0 um}}",
    says=[
        ("14:47", "pixel.photodetector.junction.depletion_width", "is zero", "a positive length")
    ],
)
processed(
    "a substrate of no depth",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {junction: {substrate_depth: -1 um}}",
    says=[
        ("14:47", "pixel.photodetector.junction.substrate_depth", "negative", "a positive length")
    ],
)
processed(
    "a dark current beyond its model",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {dark_current_density: junction}",
    "temperature: 500 K",
    says=[("15:16", "pixel.temperature", "known from 77 to 400 K", "as a number")],
)
case(
    "a junction without numbers",
    ("quantum_efficiency: 0.5", "quantum_efficiency: junction"),
    says=[
        ("15:25", "pixel.photodetector.quantum_efficiency", "needs junction.depletion_width",
         "add pixel.photodetector.junction.depletion_width: 0.2 um"),
    ],
)  # fmt: skip
case(
    "a capacitance without a technology",
    ("fill_factor: 0.3", "fill_factor: 0.3\n    capacitance: junction"),
    says=[
        ("15:18", "pixel.photodetector.capacitance", "needs capacitance.sidewall",
         "name a technology")
    ],
)  # fmt: skip
case(
    "wavelengths beyond silicon",
    ("quantum_efficiency: 0.5", f"quantum_efficiency: junction\n    junction: {JUNCTION}"),
    ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 300 nm, stop: 700 nm}"),
    ("illuminant: D65", "illuminant: equal-energy"),
    ("pattern: bayer-rggb", "pattern: monochrome"),
    says=[("7:16", "scene.wavelengths", "known for 350-1100 nm", "narrow them")],
)

# --- what lies above the photodetector
LENS = "  width: 6.5 um\n  microlens: {gain: 2}"
case(
    "a microlens stated twice",
    ("  width: 6.5 um", LENS.replace("gain: 2", "gain: 2, efficiency: 0.9")),
    says=[("13:36", "pixel.microlens.efficiency", "efficiency and gain cannot", "keep one")],
)
case(
    "a microlens without strength",
    ("  width: 6.5 um", LENS.replace("gain: 2", "shift: centered")),
    says=[("13:14", "pixel.microlens", "its strength is missing", "write for example gain: 1.8")],
)
case(
    "a microlens that loses light",
    ("  width: 6.5 um", LENS.replace("gain: 2", "efficiency: 0.2")),
    says=[("13:27", "pixel.microlens.efficiency", "less than the photodetector's own", "0.3")],
)
case(
    "a microlens on a photodetector that is too large for it",
    ("  width: 6.5 um", LENS),
    ("fill_factor: 0.3", "fill_factor: 0.97"),
    says=[("13:21", "pixel.microlens.gain", "0.95 of the pixel's area", "remove the microlens")],
)
case(
    "layers that cannot be",
    (
        "  width: 6.5 um",
        "  width: 6.5 um\n  stack: {passivation: {thickness: -1 um, index: 2},\n"
        "          oxide: {thickness: 5 um, index: 0.9}}",
    ),
    says=[
        ("13:36", "pixel.stack.passivation.thickness", "-1 um", ""),
        ("14:43", "pixel.stack.oxide.index", "0.9 is out of range", "at least 1"),
    ],
)
case(
    "an exit pupil in the sensor",
    ("  transmittance: 0.9", "  exit_pupil_distance: 0 mm"),
    says=[("10:24", "optics.exit_pupil_distance", "is zero", "a positive length")],
)

# --- words and names
case(
    "an unknown chart",
    ("uniform", "unifrom"),
    says=[("3:32", "scene.source.chart", "'unifrom' is not allowed", "did you mean uniform?")],
)
case(
    "a parameter of another chart",
    ("uniform", "uniform, frequency: 3 lp/mm"),
    says=[("3:52", "scene.source.frequency", "no such key", "remove it")],
)
case(
    "an unknown illuminant",
    ("D65", "D66"),
    says=[("4:15", "scene.illuminant", "'D66' is no known illuminant", "did you mean 'D65'?")],
)
case(
    "an unknown spectrum",
    ("transmittance: 0.9", "transmittance: [0.9, ir-cut-660]"),
    says=[("10:24", "optics.transmittance.1", "'ir-cut-660'", "did you mean 'ir-cut-650'?")],
)
case(
    "an unknown pattern",
    ("bayer-rggb", "bayer-rgbg"),
    says=[("19:39", "array.pattern", "'bayer-rgbg' is not allowed", "did you mean bayer-rggb?")],
)
case(
    "an unknown effect",
    ("adc:", "effects: {difraction: off}\nadc:"),
    says=[("21:23", "effects.difraction", "no such key", "did you mean diffraction?")],
)
case(
    "an unknown metric",
    ("adc:", "quality: [psrn]\nadc:"),
    says=[("21:11", "quality.0", "'psrn' is not allowed", "did you mean psnr?")],
)
case(
    "an unknown accuracy",
    ("adc:", "accuracy: standrd\nadc:"),
    says=[("21:11", "accuracy", "'standrd' is not allowed", "did you mean standard?")],
)
case(
    "an unknown part",
    ("adc:", "array: {use: vga-bayr}\nadc:"),
    ("array: {rows: 6, columns: 8, pattern: bayer-rggb}\n", ""),
    says=[("20:14", "array", "'vga-bayr' is not an array", "did you mean 'vga-bayer'?")],
)
case(
    "a name that is no folder's",
    ("name: good", "name: ../up"),
    says=[("1:7", "name", "'../up' is not a name", "write")],
)
case(
    "a filter too few",
    ("bayer-rggb", "bayer-rggb, filters: {R: 0.9, G: 0.9}"),
    says=[("19:60", "array.filters", "has no filter for B", "add B")],
)

# --- files
PICTURE = "scene.source.file"
LAMP = "  illuminant: D65\n"
for _name, _file, _message, _remedy in (
    ("a missing image", "god.exr", "there is no file 'god.exr'", "did you mean 'good.exr'?"),
    ("a folder as an image", ".", "'.' is not a regular file", "give the path of a file"),
    ("a device as an image", "/dev/zero", "is not a regular file", "give the path of a file"),
    ("an image at a URL", "'http://a.org/b.png'", "is a URL", "download the file"),
    ("a truncated image", "truncated.exr", "is no image that can be read", "convert it"),
    ("text as an image", "text.png", "is no image that can be read", "convert it"),
    ("an empty image", "empty.png", "the file is empty", "give a whole image file"),
    ("an image of NaN", "nan.exr", "nan at row 0, column 0", "replace such values"),
    ("an image below zero", "negative.exr", "holds a negative value (-0.5", "replace such values"),
    ("an image of two channels", "two.exr", "two color channels", "one (gray) or three (R, G, B)"),
):
    case(
        _name,
        (CHART, IMAGE.replace("PICTURE", _file)),
        (LAMP, ""),
        says=[("3:31", PICTURE, _message, _remedy)],
    )
case(
    "a picture in color as a reflectance",
    (CHART, IMAGE.replace("PICTURE", "good.exr").replace("laser", "reflectance")),
    says=[("3:48", "scene.source.model", "needs one channel", "mallett, laser, rgb-display")],
)
case(
    "a picture without color where colors are needed",
    (CHART, IMAGE.replace("PICTURE", "gray.exr")),
    (LAMP, ""),
    says=[("3:31", PICTURE, "the image has 1 channel", "write model: reflectance")],
)
case(
    "too few rows for a demosaic",
    ("rows: 6", "rows: 1"),
    says=[("19:15", "array.rows", "1 x 8 pixels cannot be demosaiced", "at least 2 x 2")],
)
for _name, _file, _at, _path, _message, _remedy in (
    ("a missing table", "shrt.csv", "10:25", ".file", "no file 'shrt.csv'", "'short.csv'?"),
    ("a table too short", "short.csv", "10:18", "", "380-780 nm is needed", "outside: zero"),
    ("a table in no order", "mixed.csv", "10:25", ".file", "400 nm follows 700 nm", "400,0.31"),
    ("a table of words", "words.csv", "10:25", ".file", "words.csv:2", "400,0.31"),
):
    case(
        _name,
        ("transmittance: 0.9", f"transmittance: {{file: {_file}}}"),
        says=[(_at, f"optics.transmittance{_path}", _message, _remedy)],
    )

# --- all at once
case(
    "six mistakes",
    ("f_number: 2.8", "f_number: 2.8 mm"),
    ("6.5 um", "6.5"),
    ("rows: 6", "rows: -6"),
    ("30 ms", "30 mm"),
    ("bits: 10", "bits: ten"),
    ("D65", "D66"),
    says=[
        ("4:15", "scene.illuminant", "'D66'", "'D65'?"),
        ("8:13", "optics.f_number", "2.8 mm", "write"),
        ("12:10", "pixel.width", "bare number", "6.5 um"),
        ("19:15", "array.rows", "-6 is out of range", "at least 1"),
        ("20:18", "exposure.time", "is a length, not a time", "30 ms"),
        ("21:13", "adc.bits", "'ten' is not a whole number", "such as 10"),
    ],
)
case(
    "mistakes of several kinds",
    ("1 m\n", "3 mm\n"),
    ("time: 30 ms", "captures: {schedule: optimal, count: 2, max: -1 s}"),
    ("transmittance: 0.9", "transmittance: {file: short.csv}"),
    says=[
        ("6:13", "scene.distance", "lies within its focal length", "further away"),
        ("10:18", "optics.transmittance", "380-780 nm", "outside"),
        ("20:57", "exposure.captures.max", "is negative", "a positive time"),
    ],
)
case(
    "a Noll index twice",
    ("f_number: 2.8", "f_number: 2.8\n  zernike: {4: 0.1 um, '04': 0.2 um}"),
    says=[("9:30", "optics.zernike.04", "Noll index 4 comes twice", "keep one of them")],
)
case(
    "a wavefront in the wrong unit",
    ("f_number: 2.8", "f_number: 2.8\n  zernike: {8: 0.1 mm}"),
    says=[("9:12", "optics.zernike", "at most 200 can be followed", "check the unit")],
)
case(
    "a point spread function beside defocus, from no image",
    ("f_number: 2.8", "f_number: 2.8\n  defocus: 1 um\n  psf: {file: text.png, pitch: 1 um}"),
    says=[("9:12", "optics.defocus", "cannot be given beside psf", "psf: none")],
)
case(
    "a point spread function below zero",
    (
        "f_number: 2.8",
        "f_number: 2.8\n  psf: {file: negative.exr, pitch: 1 um, wavelengths: "
        "[450 nm, 550 nm, 650 nm]}",
    ),
    says=[("9:15", "optics.psf.file", "negative value", "by 0")],
)
case(
    "mistakes that others used to hide",
    ("1 m\n", "1 mm\n"),
    (CHART, IMAGE.replace("PICTURE", "two.exr").replace("laser", "reflectance")),
    ("fill_factor: 0.3", "width: 9 um\n    height: 9 um"),
    ("bits: 10}", "bits: 4, offset: 20 DN}\neffects: {fpn: on}"),
    says=[
        ("3:31", PICTURE, "two color channels", "one (gray) or three"),
        ("6:13", "scene.distance", "lies within its focal length", "further away"),
        ("14:12", "pixel.photodetector.width", "from -1.25 to 7.75 um", "make it smaller"),
        ("22:24", "adc.offset", "20 DN leaves no number", "more bits"),
        ("23:16", "effects.fpn", "there is nothing to simulate", "describe it"),
    ],
)


@pytest.mark.parametrize("name", CASES)
def test_refused_with_place_path_and_remedy_and_nothing_written(name, folder):
    text, says = CASES[name]
    Path("broken.yaml").write_text(text)
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == len(says), result.stderr
    for line, (place, path, message, remedy) in zip(lines, says, strict=True):
        head, _, body = line.partition(": " if not path else f": {path}: ")
        assert head == f"broken.yaml:{place}", line
        assert message in body, line
        assert re.search(rf"[;?] .*{re.escape(remedy)}", body), line
    assert contents(folder) == before


ELSEWHERE = ("a study",)  # is a file that `vcam validate` knows
BY_ITS_CONTENT = (
    *ELSEWHERE,
    "a truncated image",
    "an image of NaN",
    "an image below zero",
    "a file of spectra with holes",
)


@pytest.mark.parametrize("name", [name for name in CASES if name not in BY_ITS_CONTENT])
def test_validate_refuses_what_run_refuses(name, folder):
    """All but what only the pixels of a picture tell: `vcam validate` reads its header."""
    Path("broken.yaml").write_text(CASES[name][0])
    validated = CliRunner().invoke(app, ["validate", "broken.yaml"], prog_name="vcam")
    assert (validated.exit_code, validated.stderr) == (2, run("-o", "result").stderr)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_good_file_is_good(folder):
    """Else every case above might fail for a reason of its own."""
    Path("broken.yaml").write_text(GOOD)
    result = run("-o", "result", "-q")
    assert result.exit_code == 0, result.output
    assert (folder / "result" / "raw.exr").is_file()


def test_there_are_many():
    assert len(CASES) >= 60


def test_too_large_for_the_memory(folder):
    Path("broken.yaml").write_text(
        broken(("rows: 6, columns: 8", "rows: 1000000, columns: 1000000"))
    )
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 3, result.output
    assert re.fullmatch(
        r"1000000 x 1000000 pixels need .* GB .*; use fewer pixels.*\n", result.stderr
    )
    assert contents(folder) == before


def test_a_missing_camera_file(folder):
    result = run()
    assert result.exit_code == 2
    assert "there is no file 'broken.yaml'" in result.stderr


def test_files_that_refer_to_each_other_in_a_circle(folder):
    Path("broken.yaml").write_text("extends: ./loop.yaml\n")
    result = run()
    assert result.exit_code == 2
    assert result.stderr.startswith("loop.yaml:1:10: the files refer to each other in a circle")


def test_a_foreign_output_folder_is_refused_and_left_alone(folder):
    Path("broken.yaml").write_text(GOOD)
    Path("result").mkdir()
    Path("result/mine.txt").write_text("mine")
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 2
    assert contents(folder) == before
