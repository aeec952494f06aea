"""What a newcomer writes first is answered with the key and the value that are meant."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from every import every
from typer.testing import CliRunner

from vcam_cli.camera import hint_tables, hints
from vcam_cli.camera.load import load
from vcam_cli.camera.scene.sources import CHARTS
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput

BASE = """
scene: {source: {kind: chart, chart: colorchecker}, luminance: 100 cd/m2}
optics: {f_number: 2.8, focal_length: 4.5 mm}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.5}
  readout: {conversion_gain: 40 uV/e, full_well: 25 ke}
array: {rows: 48, columns: 64}
exposure: {time: 60 ms}
"""
"""A camera that leaves open what it can."""
STEPS = "processing=[demosaic: bilinear, white_balance: illuminant]"
GUESSES = {
    "iso=800": "exposure.iso: 800",
    "ev=1 EV": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "ev=1": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "exposure.analog_gain=8": "exposure.gain: 8",
    "array.pattern=bayer": "array.pattern: bayer-rggb",
    "array.pattern=RGGB": "array.pattern: bayer-rggb",
    "array.pattern=gray": "array.pattern: monochrome",
    "optics.f_number=f/2.8": "optics.f_number: 2.8",
    "optics.f_number=F8": "optics.f_number: 8",
    "pixel.full_well=20 ke": "pixel.readout.full_well: 20 ke",
    "full_well=20 ke": "pixel.readout.full_well: 20 ke",
    "scene.luminance=300 lux": "scene.illuminance: 300 lx",
    "scene.luminance=300 lx": "scene.illuminance: 300 lx",
    "scene.illuminance=50 cd/m2": "scene.luminance: 50 cd/m2",
    "scene.illuminance=300 lux": "scene.illuminance: 300 lx",
    "scene.illuminant=5500K": "scene.illuminant: {blackbody: 5500 K}",
    "scene.illuminant=tungsten": "scene.illuminant: A",
    "exposure.shutter_speed=1/60 s": "exposure.time: 1/60 s",
    "exposure.time=1/60": "exposure.time: 1/60 s",
    "pixel.size=2 um": "pixel.width: 2 um",
    "bits=12": "adc.bits: 12",
    "pixel.qe=0.6": "pixel.photodetector.quantum_efficiency: 0.6",
    "pixel.read_noise=3 e": "pixel.readout.read_noise: 3 e",
    "pixel.dark_current=3 e/s": "pixel.photodetector.dark_current: 3 e/s",
    "pixel.photodetector.fill_factor=50": "pixel.photodetector.fill_factor: 50 %",
    "optics.transmittance=95": "optics.transmittance: 95 %",
    "array.cfa=bayer": "array.pattern: bayer-rggb",
    "pixel.temperature=20 C": "pixel.temperature: 20 degC",
    "optics.focal_length=50": "optics.focal_length: 3.2 mm",
    # the value that was given, where it is one
    "pixel.full_well=6000": "pixel.readout.full_well: 6000 e",
    "pixel.full_well=6000 e-": "pixel.readout.full_well: 6000 e",
    "pixel.readout.full_well=6 ke-": "pixel.readout.full_well: 6 ke",
    "pixel.read_noise=1.8 e- rms": "pixel.readout.read_noise: 1.8 e",
    "pixel.readout.read_noise=1.8 electrons": "pixel.readout.read_noise: 1.8 e",
    "pixel.dark_current=3 e-/s": "pixel.photodetector.dark_current: 3 e/s",
    "pixel.qe=60%": "pixel.photodetector.quantum_efficiency: 60%",
    "pixel.prnu=1": "pixel.fpn.prnu: 1 %",
    "pixel.size=1.4": "pixel.width: 1.4 um",
    "array.width=4032": "array.columns: 4032",
    "optics.aperture=f/1.8": "optics.f_number: 1.8",
    "exposure.shutter=1/500": "exposure.time: 1/500 s",
    # words of other programs
    "output.dng=yes": "output.dng: true",
    "optics.diffraction=no": "optics.diffraction: false",
    "effects.shot_noise=false": "effects.shot_noise: off",
    "effects.fpn=0": "effects.fpn: off",
    "quality=psnr": "quality: [psnr]",
    "output.raw=electrons": "output.raw: [electrons]",
    "output.raw=tiff": "output: {tiff: true}",
    "seed=5": "seed: {frame: 5}",
    "optics.transmittance=1.2": "optics.transmittance: 1.2 %",
    # a value in place of its section
    "exposure=1/30 s": "exposure: {time: 1/30 s}",
    "exposure=1/30": "exposure: {time: 1/30 s}",
    "exposure=ISO 400": "exposure: {time: 30 ms, iso: 400}",
    "adc=10 bit": "adc: {bits: 10}",
    "adc=12-bit": "adc: {bits: 12}",
    "array=640x480": "array: {columns: 640, rows: 480}",
    "optics=f/1.8": "optics: {f_number: 1.8, focal_length: 4.5 mm}",
    # numbers among letters, units that files do not have
    "exposure.iso=ISO800": "exposure.iso: 800",
    "adc.bits=10 bit": "adc.bits: 10",
    "array.rows=48 px": "array.rows: 48",
    "array.rows=3k": "array.rows: 3000",
    "array.columns=64.0": "array.columns: 64",
    "scene.distance=10 feet": "scene.distance: 3.048 m",
    "scene.illuminance=10 footcandles": "scene.illuminance: 107.639 lx",
    "scene.distance=inf": "scene.distance: infinity",
    "adc.offset=64": "adc.offset: 64 DN",
    "optics.fov=80": "optics.field_of_view: 80 deg",
    "optics.hfov=80 deg": "optics.field_of_view: {horizontal: 80 deg}",
    "optics.vertical_fov=40": "optics.field_of_view: {vertical: 40 deg}",
    "optics.field_of_view=80": "optics.field_of_view: 80 deg",
    "name=my phone": "name: my-phone",
    "name=“phone”": "name: phone",
    # what telephones are sold with
    "array.resolution=12MP": "array.columns: 4000 and array.rows: 3000",
    "array.megapixels=12": "array.columns: 4000 and array.rows: 3000",
    "array.size=4032x3024": "array.columns: 4032 and array.rows: 3024",
    "optics.focal_length=26 mm equivalent": "optics.field_of_view: 79.5 deg",
    "optics.equivalent_focal_length=26 mm": "optics.field_of_view: 79.5 deg",
    "optics.focal_length_35mm=26": "optics.field_of_view: 79.5 deg",
    "exposure.iso=auto": "exposure: {auto: {max: 100 ms, max_gain: 16}}",
    "exposure.hdr=true": "exposure.captures: [5 ms, 30 ms]",
    "exposure.shutter=rolling": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "pixel.rolling_shutter=true": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "pixel.microlens=1.8": "pixel.microlens: {gain: 1.8}",
    "pixel.microlens=true": "pixel.microlens: {gain: 1.8}",
    "pixel.fpn=1%": "pixel.fpn: {prnu: 1 %}",
    "pixel.architecture=4T": "pixel.architecture: aps-4t",
    "pixel.width=1.4 µ": "pixel.width: 1.4 um",
    "pixel.dark_current=5 e-/s/pix": "pixel.photodetector.dark_current: 5 e/s",
    "pixel.photodetector.dark_current=5 e/pixel/s": "pixel.photodetector.dark_current: 5 e/s",
    "array=64,48": "array: {columns: 64, rows: 48}",
    "array.binning=2x2": "array.binning: {rows: 2, columns: 2}",
    "array.binning=2": "array.binning: {rows: 2, columns: 2}",
    "array.cfa=quad": "array.pattern: quad-bayer",
    "scene.illuminant=6500": "scene.illuminant: {blackbody: 6500 K}",
    "scene.illuminant=cloudy": "scene.illuminant: D65",
    "scene.color_temperature=5500": "scene.illuminant: {blackbody: 5500 K}",
    "optics.ir_cut=650": "optics.transmittance: [0.95, ir-cut-650]",
    "optics.zoom=2": "optics.focal_length: 8 mm",
    "output=dng": "output: {dng: true}",
    "output.bits=16": "output.render: 16",
    "quality=all": "quality: [mse, psnr, cielab, s-cielab]",
    # words of EMVA 1288 and of lens makers
    "pixel.system_gain=0.37 DN/e": "adc.gain: 0.37 DN/e",
    "adc.black_level=240": "adc.offset: 240 DN",
    "exposure.black_level=240": "adc.offset: 240 DN",
    "pixel.pedestal=64 DN": "adc.offset: 64 DN",
    "exposure.gain=6 dB": "exposure.gain: 1.995",
    "exposure.gain=-6 dB": "exposure.gain: 0.5012",
    "optics.cra=30 deg": "optics.exit_pupil_distance: 5 mm",
    "optics.flare=2 %": "optics.stray_light: 2 %",
    "optics.cos4=true": "optics.off_axis: cos4",
    # parts of a camera by names of their own
    "sensor.width=3 um": "pixel.width: 3 um",
    "sensor.rows=48": "array.rows: 48",
    "sensor.qe=0.6": "pixel.photodetector.quantum_efficiency: 0.6",
    "lens.f_number=2": "optics.f_number: 2",
    "camera.iso=100": "exposure.iso: 100",
    # words for values
    "scene.source=macbeth": "scene.source: {kind: chart, chart: colorchecker}",
    "scene.source.chart=macbeth": "scene.source.chart: colorchecker",
    "scene.illuminant=LED": "scene.illuminant: LED-B3",
    "scene.illuminant=CWF": "scene.illuminant: FL2",
    "processing=none": "processing: []",
    "processing.demosaic=malvar": "processing.demosaic: edge-aware",
    "processing.white_balance=awb": "processing.white_balance: gray-world",
    "accuracy=high": "accuracy: reference",
    "temperature=300": "pixel.temperature: 300 K",
    # a file in place of what names it
    "array.filters=qe.csv": "array.filters: {file: qe.csv}",
    "scene.illuminant=lamp.csv": "scene.illuminant: {file: lamp.csv}",
    "optics.psf=psf.csv": "optics.psf: {file: psf.csv, pitch: 0.5 um}",
    "optics.mtf=mtf.csv": "optics.mtf: {file: mtf.csv}",
    "optics.off_axis=falloff.csv": "optics.off_axis: {file: falloff.csv}",
    "optics.vignetting=falloff.csv": "optics.off_axis: {file: falloff.csv}",
    # shutters, noise, gains as makers of cameras write them
    "shutter=rolling": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "shutter={rolling: {readout_time: 20 ms}}": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "shutter=global": "exposure.shutter: global",
    "shutter=1/60 s": "exposure.time: 1/60 s",
    "shutter=1/60": "exposure.time: 1/60 s",
    "noise={read: 5 e}": "pixel.readout.read_noise: 5 e",
    "noise=3 e-": "pixel.readout.read_noise: 3 e",
    "noise=off": "effects: {shot_noise: off, read_noise: off, fpn: off}",
    "adc.gain=2.5 e-/ADU": "adc.gain: 0.4 DN/e",
    "adc.gain=2.5 e/DN": "adc.gain: 0.4 DN/e",
    "adc.gain=0.4 ADU/e-": "adc.gain: 0.4 DN/e",
    "pixel.readout.read_noise=5 e-": "pixel.readout.read_noise: 5 e",
}
"""A first guess -> what it is to be led to."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("camera.yaml").write_text(BASE, encoding="utf-8")
    Path("photo.png").touch()
    rows = "\n".join(f"{nm},0.5,0.4,0.3" for nm in range(380, 781, 10))
    Path("qe.csv").write_text(f"wavelength,R,G,B\n{rows}\n")
    Path("lamp.csv").write_text("nm,W\n380,1\n780,2\n")
    Path("psf.csv").write_text("0,1,0\n1,2,1\n0,1,0\n")
    Path("mtf.csv").write_text("frequency_lp_per_mm,value\n0,1\n100,0\n")
    Path("falloff.csv").write_text("image_height_mm,value\n0,1\n5,0.5\n")


def remedy_of(guess):
    """The remedy's own words, and the path that they begin at where they name no other."""
    with pytest.raises(BadInput) as caught:
        load_with(guess)
    problem = caught.value.problems[0]
    return problem.remedy, guess.partition("=")[0]


def test_a_guess_is_led_to_what_is_meant():
    def check(guess, meant):
        remedy, _ = remedy_of(guess)
        path, _, value = meant.partition(": ")
        if path != guess.partition("=")[0]:
            assert path.removeprefix("scene.") in remedy, remedy
        is_asked = "did you mean" in remedy
        asked = value.removeprefix("300 ").removeprefix("20 ") if is_asked else value
        assert asked in remedy, remedy

    every(GUESSES.items(), check)


def test_what_is_meant_is_right():
    every(sorted(set(GUESSES.values())), accept)


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("pixel:\n  width:3 um", "write width: 3 um, with a space behind the colon"),
        ("optics: {f_number: 2,8}", "write numbers with a decimal point, as in 2.8"),
        ("pixel: {width: “3 um”}", "write 3 um, with straight quotes or none"),
        ("optics.focal_length: 5 mm", "write optics: {focal_length: 5 mm}"),
        ("pixel: {readout.read_noise: 5 e-}", "write readout: {read_noise: 5 e}"),
        ("kind: camera", "remove it: a file without kind is a camera"),
    ],
)
def test_yaml_that_is_not_quite(wrong, meant):
    Path("mine.yaml").write_text(f"extends: camera.yaml\n{wrong}\n", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        load("mine.yaml")
    assert caught.value.problems[0].remedy == meant


def test_the_time_of_all_rows_is_led_to_that_of_one():
    with pytest.raises(BadInput) as caught:
        load_with("exposure.shutter={rolling: {readout_time: 20 ms}}")
    remedies = [problem.remedy for problem in caught.value.problems]
    assert any(said.endswith("20 ms over 1000 rows are line_time: 20 us") for said in remedies)


def test_a_field_of_view_is_that_of_film():
    """50 mm on 36 mm x 24 mm see 46.8 deg from corner to corner, as lenses are specified."""
    remedy, _ = remedy_of("optics.focal_length=50 mm (35mm equivalent)")
    assert remedy.startswith("write optics.field_of_view: 46.8 deg")


def test_a_far_word_is_not_led_astray():
    remedy, _ = remedy_of("optics.lens=none")
    assert "write one of the allowed keys" in remedy


def accept(entry):
    """Load a camera with entries "path: value and path: value"."""
    for one in re.split(" and (?=[a-z]+[.:])", entry):
        path, _, value = one.partition(": ")
        if path == "optics.prescription":  # of a camera whose lens is traced, and a file that ships
            assert load("double-gauss", [f"{path}={{use: cooke-triplet}}"]).optics.prescription
            continue
        ccd = ["pixel.architecture=ccd"] if "charge_transfer" in path else []
        load_with(*ccd, f"{path}={value}")


def load_with(*sets):
    """The camera, with steps where one of them is asked for."""
    named = any(item.startswith("processing.") for item in sets)
    return load("camera.yaml", [*([STEPS] if named else []), *sets])


def test_every_key_that_is_named_exists_and_takes_its_value():
    elsewhere = (e for words in hint_tables.ELSEWHERE.values() for e in words.values())
    every(sorted({*hint_tables.KEYS.values(), *elsewhere}), accept)


def test_every_value_that_is_named_is_taken():
    def check(path, value):
        if path == "scene.source.chart":  # some charts need more keys
            assert value in CHARTS
        else:
            load_with(f"{path}={value}")

    tables = hint_tables.VALUES.items()
    every(sorted({(path, value) for path, words in tables for value in words.values()}), check)


def test_a_mosaic_by_its_letters():
    remedy, _ = remedy_of("array.pattern=RCCB")
    assert remedy.startswith("write {block: [[R, C], [C, B]]}")


@pytest.mark.parametrize("kind", ["photo", "JPEG", "picture"])
def test_a_photograph_is_an_image(kind):
    remedy, _ = remedy_of(f"scene.source={{kind: {kind}, file: photo.png}}")
    assert remedy == "write image"


@pytest.mark.parametrize("word", hint_tables.NOT_SIMULATED)
def test_what_is_not_simulated_is_said(word):
    """And is no key anywhere: what comes to be simulated leaves this table."""
    assert word not in {key.name for key in hints.index()}
    remedy, _ = remedy_of(f"pixel.{word}=1")
    assert "is not simulated" in remedy


@pytest.mark.parametrize(
    "guess",
    ["scene.flash=on", "array.flash=1", "effects.flash=on"],
)
def test_what_is_not_simulated_is_said_wherever_it_is_looked_for(guess):
    assert "not simulated" in remedy_of(guess)[0]


def test_no_word_of_the_table_is_a_key_of_that_place():
    """A word that is a key somewhere is led elsewhere only where it is none."""
    for above, words in hint_tables.ELSEWHERE.items():
        here = {key.name for key in hints.index() if key.path[:-1] == above}
        assert not here & set(words), above


def test_an_unknown_word_is_not_led_astray():
    remedy, _ = remedy_of("fps=30")
    assert "write one of the allowed keys" in remedy


def test_a_step_of_processing_is_named_as_one():
    remedy, _ = remedy_of("white_balance=auto")
    assert "a step of processing: - white_balance: gray-world" in remedy


@pytest.mark.parametrize(
    ("option", "meant"),
    [
        ("--iso", "exposure.iso=800"), ("--time", "exposure.time=30 ms"),
        ("--f-number", "optics.f_number=2.8"), ("--rows", "array.rows=480"),
        ("--bits", "adc.bits=10"), ("--qe", "pixel.photodetector.quantum_efficiency=0.5"),
    ],
)  # fmt: skip
def test_an_option_that_is_a_key_is_led_to_set(option, meant):
    """And what it is led to is taken."""
    path, _, value = meant.partition("=")
    done = CliRunner().invoke(app, ["run", "camera.yaml", option, "1"], prog_name="vcam")
    assert done.exit_code == 2
    assert f'--set {path}="{value}"' in done.stderr
    load("camera.yaml", [meant])


def test_it_is_led_there_in_a_process_of_its_own():
    line = [sys.executable, "-m", "vcam_cli.commands.main", "run", "camera.yaml", "--iso", "1"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 2
    assert '--set exposure.iso="800"' in done.stderr


def test_a_field_of_view_of_no_side_is_told_that_it_is_the_diagonals():
    with pytest.raises(BadInput, match=r"which is over the diagonal, or {horizontal: 80 deg}"):
        load("starter", ["optics.fov=80 deg"])


NEEDS_MORE = {
    "optics.aperture_diameter",  # two of three are given
    "pixel.photodetector.dark_current_density.doubling",  # needs the temperature
    "pixel.photodetector.dark_current.doubling",
    "pixel.readout.charge_transfer",  # of a ccd
    "adc.reference",  # of a logarithmic ADC
    *("optics.prescription.glasses.nd", "optics.prescription.glasses.vd"),  # of a glass by its name
    *(f"array.filters.{name}" for name in ("column", "unit", "table", "outside", "silicon", "per")),
}
"""Keys whose examples are right beside another key that the plain camera does not have."""


def test_every_example_of_a_key_is_taken_by_it():
    """`vcam explain` prints them; what else the key needs may be missing."""
    elsewhere = ("there is no file", "there is no such key", "is missing")
    refused = []
    for key in hints.index():
        if key.path[0] == "processing" or key.dotted in NEEDS_MORE:
            continue
        try:
            load("camera.yaml", [f"{key.dotted}={key.example}"])
        except BadInput as error:
            refused += [
                f"{key.dotted}: {problem.message}"
                for problem in error.problems
                if ".".join(map(str, problem.path)).startswith(key.dotted)
                and not any(said in problem.message for said in elsewhere)
            ]
    assert refused == []
