"""`vcam run` from end to end: the files of a run, what is printed, and how it ends.

What the files hold is compared with what `simulate` gives in memory for the same camera; that
those numbers are right is the business of the tests of the engine.
"""

import csv
import hashlib
import json
import math
import os
import pty
import resource
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from typer.testing import CliRunner

import vcam_cli
from vcam_cli.camera.load import load
from vcam_cli.commands import main
from vcam_cli.config import shipped
from vcam_cli.errors import CannotDo
from vcam_cli.files.folder import OutputFolder
from vcam_cli.simulation.simulate import simulate

VCAM = [sys.executable, "-m", "vcam_cli.commands.main"]

CAMERA = """\
name: small
scene:
  source: {kind: chart, chart: sinusoid, frequency: 20 lp/mm, contrast: 0.8, orientation: 30 deg}
  luminance: 300 cd/m2
  distance: 1 m
optics: {f_number: 2.8, focal_length: 4 mm, transmittance: [0.95, ir-cut-650]}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.5, dark_current: 100 e/s}
  readout: {conversion_gain: 50 uV/e, voltage_swing: 1 V, read_noise: 5 e, reset_noise: ktc}
  fpn: {offset_pixel: 2 e, offset_column: 1 e, gain_pixel: 1 %}
array: {rows: 150, columns: 20}
exposure: {time: 20 ms}
adc: {bits: 12, offset: 64 DN}
"""
"""Three blocks of 64 rows, so that several workers have something to share."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text(CAMERA)
    return tmp_path


def vcam(*args: str, code: int = 0):
    """Runs `vcam run small.yaml ...` in this process; gives what it printed."""
    line = ["run", "small.yaml", *args]
    result = CliRunner().invoke(main.app, line, prog_name="vcam")
    assert result.exit_code == code, result.output + str(result.exception)
    return result


def process() -> subprocess.CompletedProcess:
    """Runs `vcam run small.yaml` as a user does."""
    env = os.environ | {"PYTHONPATH": str(Path(vcam_cli.__file__).parents[1])}
    return subprocess.run([*VCAM, "run", "small.yaml"], capture_output=True, text=True, env=env)


def sets(*items: str) -> list[str]:
    return [word for item in items for word in ("--set", item)]


def image(path: str) -> tuple[np.ndarray, oiio.ImageSpec]:
    """(h, w, channels) as stored, and the header."""
    source = oiio.ImageInput.open(path)
    assert source is not None, oiio.geterror()
    try:
        return source.read_image(0, 0, 0, source.spec().nchannels, source.spec().format), (
            oiio.ImageSpec(source.spec())
        )
    finally:
        source.close()


def raw(path: str = "out/small/raw.exr") -> dict[str, np.ndarray]:
    data, spec = image(path)
    return {name: data[:, :, i] for i, name in enumerate(spec.channelnames)}


def metrics(path: str = "out/small/metrics.csv") -> list[list[str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def record(path: str = "out/small/run.json") -> dict:
    return json.loads(Path(path).read_text("utf-8"))


def contents(folder: Path | str = ".") -> dict[str, bytes]:
    folder = Path(folder)
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class TestFiles:
    """Contract: raw.exr, render.png, metrics.csv, run.json, and ideal.exr where it is needed."""

    def test_a_plain_run_as_a_user_does_it(self, folder):
        result = process()
        assert result.returncode == 0, result.stderr
        assert set(contents("out")) == {
            "small/raw.exr", "small/render.png", "small/metrics.csv", "small/run.json"
        }  # fmt: skip
        assert "\x1b" not in result.stdout + result.stderr
        for name, value, _ in metrics()[1:]:
            assert any(
                line.split()[:2] == [name, f"{float(value):.6g}"]
                for line in result.stdout.splitlines()
            )
        assert set(contents()) == {f"out/{n}" for n in contents("out")} | {"small.yaml"}
        vcam("-o", "here")
        here, there = contents("here"), contents("out/small")
        for name in ("raw.exr", "render.png", "metrics.csv"):
            assert here[name] == there[name], "another process gives the same bytes"

    def test_raw_holds_what_was_simulated_in_full_precision(self):
        vcam(*sets("output.raw=[dn, electrons, volts]"))
        data, spec = image("out/small/raw.exr")
        expected = simulate(load("small.yaml"))
        assert spec.channelnames == ("dn", "electrons", "volts")
        assert spec.format == oiio.FLOAT
        assert not spec.channelformats
        assert spec.get_string_attribute("compression") in ("zip", "zips", "piz", "rle", "none")
        assert data.shape == (150, 20, 3)
        assert np.array_equal(data[:, :, 0], expected.dn)
        assert np.array_equal(data[:, :, 1], expected.electrons)
        assert np.array_equal(data[:, :, 2], expected.volts)
        # A frame that is worth comparing: codes in between, noise, whole numbers.
        assert np.array_equal(data[:, :, 0], np.rint(data[:, :, 0]))
        assert 64 < data[:, :, 0].min() < data[:, :, 0].max() < 4095

    def test_volts_and_codes_follow_from_electrons(self):
        vcam(*sets("output.raw=[volts, electrons, dn]", "pixel.readout.gain=2", "adc.bits=10"))
        found = raw()
        # float32 holds seven digits.
        assert found["volts"] == pytest.approx(found["electrons"] * 50e-6 * 2, rel=1e-6)
        codes = 64 + found["electrons"].astype(float) * 50e-6 * 2 / (1.0 * 2) * (1023 - 64)
        assert np.abs(found["dn"] - np.clip(codes, 0, 1023)).max() <= 0.5 + 1e-3

    @pytest.mark.parametrize("channels", [["dn"], ["volts"], ["electrons", "dn"]])
    def test_raw_holds_the_channels_asked_for(self, channels):
        vcam(*sets(f"output.raw=[{', '.join(channels)}]"))
        assert set(raw()) == set(channels)  # EXR keeps channels in the order of the alphabet

    def test_attributes_of_raw(self):
        vcam("--seed", "7", *sets("effects.dark_current=on"))
        _, spec = image("out/small/raw.exr")
        said = {a.name: a.value for a in spec.extra_attribs}
        run = record()
        black = 64 + 100 * 0.02 / (1 / 50e-6 / (4095 - 64))  # offset, and 2 dark electrons
        assert said["name"] == "small"
        assert said["vcam:version"] == vcam_cli.__version__
        assert (said["vcam:seedSensor"], said["vcam:seedFrame"]) == ("1", "7")
        # float32 attributes
        assert said["vcam:exposureTime"] == pytest.approx(0.02, rel=1e-6)
        assert said["vcam:blackLevel"] == pytest.approx(black, rel=1e-6)
        assert said["vcam:whiteLevel"] == 4095
        assert said["vcam:conversionGain"] == pytest.approx(50e-6, rel=1e-6)
        assert said["vcam:cfa"] == "RG/GB"
        assert said["vcam:configHash"] == run["hashes"]["camera"]

    def test_the_render_of_a_mosaic_is_rgb(self):
        vcam()
        data, spec = image("out/small/render.png")
        assert spec.channelnames == ("R", "G", "B")
        assert spec.format == oiio.UINT8
        assert np.array_equal(data, simulate(load("small.yaml")).render)

    def test_the_render_of_a_monochrome_array_is_gray(self):
        vcam(*sets("array.pattern=monochrome"))
        data, spec = image("out/small/render.png")
        assert spec.nchannels == 1
        assert spec.format == oiio.UINT8
        camera = load("small.yaml", ["array.pattern=monochrome"])
        assert np.array_equal(data[:, :, 0], simulate(camera).render)
        assert {a.name: a.value for a in image("out/small/raw.exr")[1].extra_attribs}[
            "vcam:cfa"
        ] == "monochrome"

    @pytest.mark.parametrize("pattern", ["bayer-rggb", "monochrome"])
    def test_a_render_of_16_bits(self, pattern):
        """65 536 codes of the same curve: the upper byte is that of 8 bits, to rounding."""
        options = ["output.render=16", f"array.pattern={pattern}"]
        vcam(*sets(*options))
        data, spec = image("out/small/render.png")
        assert spec.format == oiio.UINT16
        expected = simulate(load("small.yaml", options)).render
        assert expected.dtype == np.uint16
        assert np.array_equal(data.squeeze(), expected)
        coarse = simulate(load("small.yaml", [options[1]])).render
        assert np.abs(expected / 257 - coarse).max() <= 0.5 + 1e-2

    def test_irradiance_in_the_spectral_layout(self):
        """A channel for every 10 nm, the wavelength in its name; the numbers of the engine."""
        from vcam_cli.simulation import spectral_irradiance

        vcam(*sets("output.irradiance=true"))
        data, spec = image("out/small/irradiance.exr")
        said = {a.name: a.value for a in spec.extra_attribs}
        assert said["spectralLayoutVersion"] == "1.0"
        assert said["emissiveUnits"] == "W.m^-2.nm^-1"
        assert spec.channelnames == tuple(f"S0.{w},000000nm" for w in range(380, 781, 10))
        frame = simulate(load("small.yaml")).frame
        for channel, plane in enumerate(spectral_irradiance.planes(frame, 1)):
            np.testing.assert_allclose(data[:, :, channel], plane * 1e-9, rtol=2e-6)
        assert "irradiance.exr" in record()["files"]
        assert record()["stages"]["irradiance"] > 0

    def test_a_logarithmic_adc_says_how_to_read_its_codes(self):
        options = sets("adc.kind=logarithmic", "output.raw=[dn, volts]")
        vcam(*options)
        said = {a.name: a.value for a in image("out/small/raw.exr")[1].extra_attribs}
        assert said["vcam:adc"] == "logarithmic"
        assert "vcam:electronsPerDN" not in said
        full, bend, offset = (said[f"vcam:adc{k}"] for k in ("FullScale", "Reference", "Offset"))
        assert (full, bend) == (pytest.approx(1.0), pytest.approx(1e-3))  # V
        volts = raw()["volts"].astype(float)
        codes = offset + (4095 - offset) * np.log1p(volts / bend) / np.log1p(full / bend)
        assert np.abs(raw()["dn"] - np.clip(codes, 0, 4095)).max() <= 0.5 + 2e-2

    def test_no_render(self):
        vcam(*sets("output.render=none"))
        assert set(contents("out/small")) == {"raw.exr", "metrics.csv", "run.json"}

    @pytest.mark.parametrize("pattern", ["bayer-rggb", "monochrome"])
    def test_the_ideal_image_comes_with_a_quality_metric(self, pattern):
        options = ("quality=[mse, psnr]", f"array.pattern={pattern}")
        vcam(*sets(*options))
        data, spec = image("out/small/ideal.exr")
        expected = simulate(load("small.yaml", options))
        names = ("R", "G", "B") if pattern == "bayer-rggb" else ("Y",)
        assert spec.channelnames == names
        assert spec.format == oiio.FLOAT
        assert np.array_equal(data, expected.ideal)
        found = {name: (float(value), unit) for name, value, unit in metrics()[1:]}
        error = np.mean((expected.linear.astype(float) - expected.ideal) ** 2)
        # sums of float32 differences in another order
        assert found["mse"][0] == pytest.approx(error, rel=1e-5)
        assert found["psnr_db"] == (pytest.approx(-10 * math.log10(error), rel=1e-5), "dB")

    def test_metrics(self):
        vcam()
        rows = metrics()
        assert rows[0] == ["metric", "value", "unit"]
        found = {name: (float(value), unit) for name, value, unit in rows[1:]}
        assert list(found) == [
            "exposure_time", "mean_electrons", "saturated_fraction",
            "snr_db", "dynamic_range_db", "well_capacity", "quantized_dynamic_range_db",
            "picture_snr_db", "gray_snr_db", "base_iso", "digital_gain",
        ]  # fmt: skip
        assert found["exposure_time"] == (0.02, "s")
        mean = raw()["electrons"].mean(dtype=float)
        assert found["mean_electrons"] == (pytest.approx(mean, rel=1e-9), "e")
        assert found["saturated_fraction"] == (0, "")
        assert found["well_capacity"] == (pytest.approx(20000, rel=1e-12), "e")
        # Eqs 3.1 and 3.2: a well of 20000 e, 2 dark electrons, kTC of q / 50 uV at 300 K.
        q, k = 1.602176634e-19, 1.380649e-23
        floor = 5**2 + k * 300 * (q / 50e-6) / q**2
        dynamic_range = 20 * math.log10((20000 - 2) / math.sqrt(floor + 2))
        snr = 20 * math.log10(4000 / math.sqrt(floor + 4000 + 2))
        assert found["dynamic_range_db"] == (pytest.approx(dynamic_range, abs=1e-6), "dB")
        assert found["snr_db"] == (pytest.approx(snr, abs=1e-6), "dB")

    def test_saturated_pixels_are_counted(self):
        vcam(*sets("exposure.time=100 ms"))
        found = {name: float(value) for name, value, _ in metrics()[1:]}
        full = np.mean(
            raw()["electrons"] >= np.float32(20000 - 0.5 * 20000 / 4095)
        )  # the last code
        assert 0 < full < 1
        assert found["saturated_fraction"] == pytest.approx(full, abs=1e-12)

    def test_what_the_plan_leaves_out_does_not_improve_the_pixel(self):
        """A noise too small for this picture is still the floor of the dynamic range."""
        options = ["pixel.readout.read_noise=0.5 e", "pixel.readout.reset_noise=none"]
        found = []
        for effects in ("all", "auto"):
            vcam("-o", effects, *sets(*options, f"effects={effects}"))
            found.append({name: float(v) for name, v, _ in metrics(f"{effects}/metrics.csv")[1:]})
        dropped = {e["name"]: e["state"] for e in record("auto/run.json")["plan"]["effects"]}
        assert dropped["read_noise"] == "off"  # else this test says nothing
        assert found[1]["dynamic_range_db"] == pytest.approx(found[0]["dynamic_range_db"], abs=1e-9)
        assert found[1]["snr_db"] == pytest.approx(found[0]["snr_db"], abs=1e-9)


class TestRecord:
    """run.json: everything that the frame came from."""

    @pytest.fixture
    def run(self) -> dict:
        vcam(*sets("quality=[mse]"))
        return record()

    def test_the_resolved_camera_is_the_same_camera(self, run):
        Path("again.yaml").write_text(json.dumps(run["camera"]))
        assert load("again.yaml") == load("small.yaml", ["quality=[mse]"])
        for key in ("effects", "accuracy", "seed", "processing", "display", "output"):
            assert key in run["camera"], "defaults are filled in"
        assert run["camera"]["scene"]["wavelengths"]["start"] == "380 nm"

    def test_the_resolved_camera_runs_to_the_same_numbers(self, run):
        Path("again.yaml").write_text(json.dumps(run["camera"]))
        again = simulate(load("again.yaml"))
        assert np.array_equal(again.electrons, simulate(load("small.yaml")).electrons)

    def test_the_plan_says_what_becomes_of_every_effect(self, run):
        effects = run["plan"]["effects"]
        keys = {"name", "state", "by", "reason", "contribution", "unit", "seconds"}
        keys |= {"allowed", "saved", "free"}
        for effect in effects:
            assert set(effect) == keys
            assert effect["state"] in ("on", "off")
            assert effect["by"] in ("user", "plan", "camera")
            assert effect["reason"]
        names = {e["name"] for e in effects}
        assert names >= {
            "off_axis", "diffraction", "pixel_aperture", "dark_current", "shot_noise",
            "reset_noise", "read_noise", "fpn", "saturation", "quantization",
        }  # fmt: skip
        keys = {"effects", "settings", "seconds", "seconds_of_all", "memory_bytes"}
        assert set(run["plan"]) == keys
        assert run["plan"]["memory_bytes"] > 0
        assert run["plan"]["settings"]["tolerance"] == 0.005

    def test_the_geometry(self, run):
        geometry = run["geometry"]
        m = -4e-3 / (1 - 4e-3)
        expected = {
            "magnification": m,
            "image_distance": (1 - m) * 4e-3,
            "pixel_pitch_x": 4e-6,
            "nyquist_frequency": 125e3,
            "scene_width": 20 * 4e-6 / -m,
            "scene_height": 150 * 4e-6 / -m,
            "clear_aperture_area": math.pi / 4 * (4e-3 / 2.8) ** 2,
            "field_of_view_horizontal": 2 * math.atan(10 * 4e-6 / ((1 - m) * 4e-3)),
            "field_of_view_vertical": 2 * math.atan(75 * 4e-6 / ((1 - m) * 4e-3)),
        }
        found = {name: geometry[name] for name in expected}
        assert found == pytest.approx(expected, rel=1e-9)
        others = {
            "field_of_view_diagonal", "numerical_aperture", "sample_pitch_sensor",
            "sample_pitch_scene", "sample_pitch_angle", "diffraction_cutoff_550nm",
        }  # fmt: skip
        assert others <= set(geometry)

    def test_stages_seconds_and_memory(self, run):
        assert {"scene", "optics", "exposure", "capture", "processing", "files"} <= set(
            run["stages"]
        )
        assert all(seconds >= 0 for seconds in run["stages"].values())
        assert run["seconds"] > 0
        assert 20e6 < run["peak_memory_bytes"] < 64e9

    def test_versions_and_seeds(self, run):
        assert run["versions"]["vcam"] == vcam_cli.__version__
        assert run["versions"]["numpy"] == version("numpy")
        assert run["versions"]["OpenImageIO"] == version("OpenImageIO")
        assert run["seeds"] == {"sensor": 1, "frame": 1}

    def test_hashes_of_every_file_that_was_read(self, run, folder):
        inputs = run["hashes"]["inputs"]
        for name, digest in inputs.items():
            assert digest == hashlib.sha256(Path(name).read_bytes()).hexdigest()
        filters = shipped.folder() / "filters"
        expected = [folder / "small.yaml", filters / "generic-red.csv", filters / "ir-cut-650.csv"]
        assert {str(path) for path in expected} <= set(inputs)

    def test_the_hash_of_the_camera_tells_cameras_apart(self, run):
        vcam(*sets("quality=[mse]"))
        assert record()["hashes"]["camera"] == run["hashes"]["camera"]
        vcam(*sets("quality=[mse]", "pixel.readout.read_noise=5.5 e"))
        assert record()["hashes"]["camera"] != run["hashes"]["camera"]

    def test_files_are_named(self, run):
        assert run["files"] == ["ideal.exr", "metrics.csv", "raw.exr", "render.png"]
        assert run["name"] == "small"


class TestSummary:
    """What a person reads: what ran, what did not and why, the time, where the pictures are."""

    def test_it_counts_effects_and_names_every_picture(self):
        said = vcam(*sets("quality=[mse]")).stdout
        plan = record()["plan"]
        on = [e["name"] for e in plan["effects"] if e["state"] == "on"]
        described = [e for e in plan["effects"] if e["by"] != "camera"]
        text = " ".join(said.split())
        assert f"simulated {len(on)} of {len(described)} effects; skipped: " in text
        assert "saturation (0 % of full signal)" in text
        assert ", all of them about " in text
        for name in ("render.png", "raw.exr", "ideal.exr"):
            assert f"out/small/{name}" in said
        assert "delta_e.png" not in said
        assert f"{plan['seconds']:.2f} s were estimated" in said
        took = sum(record()["stages"].values())
        assert f"{took:.2f} s" in said
        assert max(map(len, said.splitlines())) <= 100

    def test_what_was_left_out_comes_with_what_it_would_change(self):
        options = ["pixel.readout.read_noise=0.5 e", "effects.fpn=off"]
        said = vcam(*sets(*options)).stdout
        [dropped] = [e for e in record()["plan"]["effects"] if e["name"] == "read_noise"]
        assert (dropped["state"], dropped["by"]) == ("off", "plan")
        text = " ".join(said.split())
        share = f"{100 * dropped['contribution']:.2g} % of temporal variance"
        assert f"read noise ({share})" in text
        assert "switched off: fixed-pattern noise" in text


class TestOptions:
    def test_json_is_one_document_and_nothing_else(self):
        result = vcam("--json")
        summary = json.loads(result.stdout)
        run = record()
        assert result.stderr == ""
        assert summary["out"] == "out/small"
        for key in ("metrics", "plan", "geometry", "stages", "seconds", "peak_memory_bytes"):
            assert summary[key] == run[key]
        assert summary["metrics"] == {name: float(value) for name, value, _ in metrics()[1:]}

    @pytest.mark.parametrize(
        "options",
        [
            ["scene.distance=infinity"],  # the scene is infinitely wide
            ["effects={shot_noise: off, read_noise: off, reset_noise: off, dark_current: off}"],
        ],
        ids=["far scene", "no noise"],
    )
    def test_json_where_a_number_is_infinite(self, options):
        """JSON has no infinity; run.json and stdout say it with the same word."""
        result = vcam("--json", *sets(*options))
        summary = json.loads(result.stdout, parse_constant=pytest.fail)
        assert summary["geometry"] == record()["geometry"]
        assert summary["metrics"] == record()["metrics"]
        assert "infinity" in [*summary["geometry"].values(), *summary["metrics"].values()]

    def test_quiet(self):
        result = vcam("-q")
        assert (result.stdout, result.stderr) == ("", "")
        assert Path("out/small/raw.exr").is_file()

    def test_out(self):
        vcam("-o", "a/b c")
        assert set(contents("a")) == {
            f"b c/{name}" for name in ("raw.exr", "render.png", "metrics.csv", "run.json")
        }
        assert not Path("out").exists()

    def test_set(self):
        vcam(*sets("pixel.width=8 um", "array.columns=12", "name=other"))
        run = record("out/other/run.json")
        assert run["camera"]["pixel"]["width"] == "8 um"
        assert raw("out/other/raw.exr")["dn"].shape == (150, 12)

    @pytest.mark.parametrize(
        ("level", "tolerance"),
        [("draft", 0.02), ("reference", 0.0002), ("0.01", 0.01), ("3 %", 0.03)],
    )
    def test_accuracy(self, level, tolerance):
        vcam("--accuracy", level)
        assert record()["plan"]["settings"]["tolerance"] == tolerance

    def test_another_frame_of_the_same_sensor(self):
        """The frame seed moves the temporal noise; the sensor's pattern stays where it is."""
        quiet = "effects={shot_noise: off, read_noise: off, reset_noise: off}"
        for seed in ("1", "2"):
            vcam("--seed", seed, "-o", f"noisy{seed}")
            vcam("--seed", seed, "-o", f"pattern{seed}", *sets(quiet))
        vcam("-o", "other", *sets(quiet, "seed.sensor=2"))
        vcam("-o", "bare", *sets(quiet.replace("}", ", fpn: off}")))
        noisy = [raw(f"noisy{seed}/raw.exr")["electrons"] for seed in "12"]
        pattern = [raw(f"pattern{seed}/raw.exr")["electrons"] for seed in "12"]
        assert np.mean(noisy[0] == noisy[1]) < 0.01
        assert np.array_equal(*pattern)
        assert not np.array_equal(pattern[0], raw("other/raw.exr")["electrons"])
        assert not np.array_equal(pattern[0], raw("bare/raw.exr")["electrons"])
        assert record("noisy2/run.json")["seeds"] == {"sensor": 1, "frame": 2}

    def test_the_seed_option_beats_the_file(self):
        vcam("--seed", "9", *sets("seed.frame=4"))
        assert record()["seeds"]["frame"] == 9

    def test_workers_change_no_byte(self):
        options = sets("quality=[mse, psnr]")
        for workers in ("1", "2", "5"):
            vcam("-o", workers, "--workers", workers, *options)
        one = contents("1")
        for other in (contents("2"), contents("5")):
            for name in ("raw.exr", "render.png", "metrics.csv", "ideal.exr"):
                assert other[name] == one[name], name

    def test_no_color_on_a_terminal_that_wants_none(self):
        """stderr is a terminal here: even then, NO_COLOR means no escape sequences."""
        control, terminal = pty.openpty()
        env = os.environ | {"NO_COLOR": "1", "TERM": "xterm-256color"}
        env["PYTHONPATH"] = str(Path(vcam_cli.__file__).parents[1])
        line = [*VCAM, "run", "small.yaml", *sets("pixel.widht=3 um")]
        run = subprocess.run(line, stdout=terminal, stderr=terminal, env=env)
        os.close(terminal)
        said = os.read(control, 1 << 16)
        os.close(control)
        assert run.returncode == 2
        assert b"pixel.widht" in said
        assert b"\x1b" not in said


class TestOutputFolder:
    def test_a_second_run_replaces_the_files_of_the_first_and_no_others(self):
        vcam(*sets("quality=[mse]"))
        mine = Path("out/small/notes.txt")
        mine.write_text("mine")
        first = contents("out/small")
        vcam("--seed", "2", *sets("output.render=none"))
        second = contents("out/small")
        assert set(first) - set(second) == {"render.png", "ideal.exr"}
        assert set(second) - set(first) == set()
        assert second["notes.txt"] == b"mine"
        assert second["raw.exr"] != first["raw.exr"]

    def test_a_file_of_the_users_is_not_overwritten(self):
        vcam()
        Path("out/small/ideal.exr").write_text("mine")
        before = contents("out")
        result = vcam(*sets("quality=[mse]"), code=2)
        assert "was not written by vcam" in result.stderr
        assert contents("out") == before

    def test_a_folder_in_the_way_leaves_the_former_results(self):
        vcam()
        Path("out/small/raw.exr").unlink()
        Path("out/small/raw.exr").mkdir()
        before = contents("out")
        assert "raw.exr is there already" in vcam("--seed", "2", code=2).stderr
        assert contents("out") == before
        assert "small/run.json" in before

    @pytest.mark.skipif(sys.platform == "darwin", reason="names are text there")
    def test_names_that_are_no_text(self, folder, monkeypatch):
        """Refused for results, which OpenImageIO could not write; all right around them."""
        monkeypatch.setattr("vcam_cli.simulation.simulate.simulate", pytest.fail)
        (line,) = vcam("-o", "o/b\udcffad", code=2).stderr.splitlines()
        assert "is no folder name: is not UTF-8; choose another folder" in line
        assert not Path("o").exists()
        monkeypatch.undo()
        place = folder / "b\udcffad"
        place.mkdir()
        monkeypatch.chdir(place)
        Path("small.yaml").write_text(CAMERA)
        vcam()
        assert str(place / "small.yaml") in record()["hashes"]["inputs"]

    def test_a_foreign_folder_is_refused(self):
        Path("mine").mkdir()
        Path("mine/raw.exr").write_text("mine")
        result = vcam("-o", "mine", code=2)
        assert result.stdout == ""
        assert "mine is not empty" in result.stderr
        assert contents("mine") == {"raw.exr": b"mine"}

    def test_a_folder_in_use_is_refused(self):
        vcam("-o", "used")
        before = contents("used")
        with OutputFolder("used"):
            result = vcam("-o", "used", "--seed", "5", code=3)
        assert "folder in use" in result.stderr
        assert contents("used") == before

    def test_the_folder_of_the_camera_file_is_not_vcams(self, folder):
        assert "not empty" in vcam("-o", ".", code=2).stderr
        assert contents() == {"small.yaml": CAMERA.encode()}

    def test_a_file_is_no_folder(self):
        Path("x").write_text("mine")
        assert "x is a file" in vcam("-o", "x", code=2).stderr


class TestFailures:
    """Whatever ends a run early leaves nothing new, and former results as they were."""

    @pytest.mark.parametrize("where", ["new", "old"])
    @pytest.mark.parametrize(
        ("error", "code"),
        [(CannotDo("the disk is full"), 3), (KeyboardInterrupt(), 130), (MemoryError(), 3)],
        ids=["disk", "interrupt", "memory"],
    )
    def test_at_the_last_file(self, error, code, where, monkeypatch):
        if where == "old":
            vcam()
        before = contents()

        def fail(*_):
            raise error

        monkeypatch.setattr("vcam_cli.simulation.output.outputs.write_metrics", fail)
        result = vcam("--seed", "2", code=code)
        assert result.stdout == ""
        assert len(result.stderr.splitlines()) == 1
        assert contents() == before
        assert Path("out").exists() == (where == "old")

    def test_a_disk_that_takes_no_more(self):
        """Files are limited to a fifth of raw.exr."""
        former = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, former[1]))
        try:
            result = vcam(code=3)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, former)
        assert "cannot write out/small/" in result.stderr
        assert len(result.stderr.splitlines()) == 1
        assert not Path("out").exists()

    @pytest.mark.parametrize(
        ("effect", "described"),
        [
            ("dark_current", ", dark_current: 100 e/s"),
            ("fpn", "  fpn: {offset_pixel: 2 e, offset_column: 1 e, gain_pixel: 1 %}\n"),
            ("read_noise", ", read_noise: 5 e"),
            ("microlens", ""),
        ],
    )
    def test_on_for_what_is_not_described(self, effect, described):
        text = CAMERA.replace(described, "")
        wish = f"effects: {{shot_noise: on, {effect}: on}}"
        Path("small.yaml").write_text(text + wish + "\n")
        (line,) = vcam(code=2).stderr.splitlines()
        place = f"{text.count(chr(10)) + 1}:{wish.rindex('on') + 1}"
        assert line.startswith(f"small.yaml:{place}: effects.{effect}: "), line
        assert not Path("out").exists()

    def test_all_mistakes_at_once(self):
        Path("small.yaml").write_text(CAMERA.replace("4 um", "4").replace("bits", "bit"))
        result = vcam(code=2)
        assert [line.split(": ")[0] for line in result.stderr.splitlines()] == [
            "small.yaml:8:10", "small.yaml:14:12",
        ]  # fmt: skip
        assert not Path("out").exists()


def picture(path: str, data: list, alpha: bool = False) -> None:
    """Writes a small 8-bit PNG from rows of codes, or of (R, G, B[, A])."""
    codes = np.array(data, np.uint8)
    codes = codes[:, :, None] if codes.ndim == 2 else codes
    spec = oiio.ImageSpec(codes.shape[1], codes.shape[0], codes.shape[2], "uint8")
    if alpha:
        spec.alpha_channel = codes.shape[2] - 1
    out = oiio.ImageOutput.create(path)
    assert out.open(path, spec)
    assert out.write_image(codes)
    assert out.close()


QUIET = sets(
    "effects={shot_noise: off, read_noise: off, reset_noise: off, fpn: off, dark_current: off,"
    " off_axis: off, diffraction: off}"
)
"""What is left is exact: every pixel sees the sample that its photodetector lies in."""


def still(source: str, *rest: str) -> None:
    """The camera with an image in front of it, one pixel a sample."""
    text = CAMERA.replace(CAMERA[CAMERA.index("{kind") : CAMERA.index("\n  lum")], source)
    Path("small.yaml").write_text(text.replace("{rows: 150, columns: 20}", rest[0]))


class TestImageFiles:
    def test_gray_reflectance_is_upright_and_in_proportion(self):
        codes = [[255, 0, 0, 128], [64, 0, 0, 0], [0, 0, 0, 200]]
        picture("gray.png", codes)
        still(
            "{kind: image, file: gray.png, encoding: linear, model: reflectance}",
            "{rows: 3, columns: 4, pattern: monochrome}",
        )
        vcam(*QUIET, "--accuracy", "reference")
        electrons = raw()["electrons"]
        # The photodetector is smaller than a sample; 1e-4: the table of the transfer function.
        expected = np.array(codes) / 255 * electrons[0, 0]
        assert electrons == pytest.approx(expected, abs=2e-3 * float(electrons[0, 0]))
        assert 100 < electrons[0, 0] < 20000
        inputs = record()["hashes"]["inputs"]
        digest = hashlib.sha256(Path("gray.png").read_bytes()).hexdigest()
        assert inputs[str(Path("gray.png").absolute())] == digest

    def test_srgb_codes_are_decoded(self):
        picture("gray.png", [[188, 255], [188, 255]])
        still(
            "{kind: image, file: gray.png, model: reflectance}",
            "{rows: 2, columns: 2, pattern: monochrome}",
        )
        vcam(*QUIET, "--accuracy", "reference")
        electrons = raw()["electrons"]
        linear = ((188 / 255 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
        assert electrons[:, 0] / electrons[:, 1] == pytest.approx([linear] * 2, abs=2e-3)

    @pytest.mark.parametrize(
        ("pattern", "place"),
        [
            ("bayer-rggb", (0, 0)),
            ("bayer-grbg", (0, 1)),
            ("bayer-gbrg", (1, 0)),
            ("bayer-bggr", (1, 1)),
        ],
    )
    def test_red_laser_light_reaches_the_red_pixels(self, pattern, place):
        picture("red.png", [[[255, 0, 0]] * 4] * 4)
        still(
            "{kind: image, file: red.png, model: laser}",
            f"{{rows: 4, columns: 4, pattern: {pattern}}}",
        )
        vcam(*QUIET)
        electrons = raw()["electrons"]
        red = electrons[place[0] :: 2, place[1] :: 2]
        others = np.ones((4, 4), bool)
        others[place[0] :: 2, place[1] :: 2] = False
        # At 650 nm the shipped red filter passes 0.53, green and blue 0.02.
        assert red.min() > 10 * electrons[others].max() > 0
        render, _ = image("out/small/render.png")
        assert render.shape == (4, 4, 3)
        _, spec = image("out/small/raw.exr")
        letters = pattern.removeprefix("bayer-").upper()
        assert spec.get_string_attribute("vcam:cfa") == f"{letters[:2]}/{letters[2:]}"

    def test_dropped_alpha_is_noted_on_stderr_and_in_the_record(self):
        picture("alpha.png", [[[9, 9, 9, 255]] * 4] * 4, alpha=True)
        still("{kind: image, file: alpha.png, model: laser}", "{rows: 4, columns: 4}")
        result = vcam("--json")
        assert "alpha" in result.stderr
        assert json.loads(result.stdout)["name"] == "small"
        assert any("alpha" in note for note in record()["notes"])
        assert vcam("-q").stderr == ""

    def test_color_as_reflectance_is_refused_with_the_other_models(self):
        picture("color.png", [[[255, 0, 0]] * 4] * 4)
        still("{kind: image, file: color.png, model: reflectance}", "{rows: 4, columns: 4}")
        result = vcam(code=2)
        assert result.stderr.startswith("small.yaml:3:")
        assert "laser" in result.stderr
        assert not Path("out").exists()

    def test_an_input_is_never_replaced(self):
        vcam()
        picture("out/small/render.png", [[255, 0], [0, 255]])
        still(
            "{kind: image, file: out/small/render.png, model: reflectance}",
            "{rows: 2, columns: 2, pattern: monochrome}",
        )
        before = contents()
        assert "is an input of this run" in vcam(code=2).stderr
        assert contents() == before
