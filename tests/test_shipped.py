"""What ships: every camera loads and runs, every part has its use, every number makes sense."""

import csv
import json
import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from every import every
from making import long_except
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.readouts import readouts
from vcam_cli.camera.sensor.noise import at_gain
from vcam_cli.capture_schedules import schedule_file
from vcam_cli.commands.list_ import first_comment
from vcam_cli.commands.main import app
from vcam_cli.config import shipped
from vcam_cli.datasets import dataset_file
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.simulation.scene_plans import scene_settings
from vcam_cli.solve.effects import camera_effects
from vcam_cli.sweeps import expectations, figures, sweep_file, sweep_points
from vcam_cli.sweeps.study_cameras import StudyCameras

CAMERAS = shipped.names("cameras")
YAMLS = sorted(shipped.folder().glob("*/*.yaml"))
TABLES = sorted(shipped.folder().glob("*/*.csv"))
MEASURED = sorted(shipped.folder().glob("filters/nikon-*.csv"))
"""Copied from a publication, where all others are formulas."""
MEASURED_COLOR = (Path(__file__).parents[1] / "docs/measured-color.md").read_text("utf-8")
"""The page that shows measured filter sets, which need no camera each."""
SMALL = ("array.rows=64", "array.columns=80", "accuracy=draft")


def label(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@cache
def loaded(name: str):
    """A shipped camera."""
    return load(name)


@cache
def small(name: str):
    """A shipped camera with fewer pixels, simulated."""
    return simulate(load(name, SMALL))


@cache
def files_of_cameras() -> set[Path]:
    return {file for name in CAMERAS for file in loaded(name).files}


def picture(path: Path) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8))


def test_there_are_some():
    assert {"still-life", "12mp-bayer", "starter", "low-light"} <= set(CAMERAS)
    assert YAMLS
    assert TABLES


@pytest.mark.parametrize("name", CAMERAS)
class TestCameras:
    def test_validates_and_is_named_after_its_file(self, name):
        result = CliRunner().invoke(app, ["validate", name], prog_name="vcam")
        assert (result.exit_code, result.stdout) == (0, f"{name}: ok ({name})\n")

    @pytest.mark.long
    def test_the_exposure_suits_the_scene(self, name):
        result = small(name)
        well = electrical(result.frame.camera).full_well
        assert 1e-4 <= result.exposure_time <= 1
        assert np.isfinite(result.electrons).all()
        # Neither black nor burnt out: something between a thousandth and all of the well.
        bright = np.quantile(result.mean_electrons, 0.99)
        assert well / 1000 < bright
        metrics = dict(result.metrics)
        if result.times:  # the first sample measures what is bright
            assert bright * min(result.times) / max(result.times) < well
            assert metrics["hdr_saturated_fraction"] < 0.01
        else:
            assert bright < well
            assert metrics["saturated_fraction"] < 0.01

    def test_the_lens_and_the_pixels_could_be_built(self, name):
        camera = loaded(name)
        g = geometry(camera)
        if g.has_lens:
            assert 0.9 <= g.f_number <= 22
            assert 1e-3 <= g.focal_length <= 0.1
            assert math.radians(5) < 2 * math.atan(g.sensor_width / 2 / g.image_distance) < 2.1
        assert 0.5e-6 <= g.pitch_x <= 20e-6  # the smallest that are sold have 0.5 um
        assert 0.5e-6 <= g.pitch_y <= 20e-6
        assert 0.1 <= g.fill_factor <= 1 + 1e-9
        assert 250 <= camera.pixel.temperature <= 350
        for readout in readouts(camera):
            e = electrical(readout.camera)
            assert 5e-6 <= e.conversion_gain <= 300e-6
            assert 0.2 <= e.voltage_swing <= 3
            assert 1e3 <= e.full_well <= 2e5
            assert 8 <= e.bits <= 16
            assert e.adc_full_scale / 2**e.bits < e.electrons_per_dn * 1.5
            assert at_gain(readout.camera.pixel.readout.read_noise, 1.0) < 0.01 * e.full_well


TRACED = {"double-gauss", "phone-double-gauss"}
"""Lenses by prescriptions, which take seconds; test_traced_frames.py has frames through one."""


RUN = (
    *("12mp-bayer", "ar0132at", "cfa-honeycomb", "cfa-rgbw", "csf-color-0.35um", "dual-pixel"),
    *("everything", "eye-chart", "fisheye", "hdr-captures", "imx586", "imx708", "imx900"),
    *("kai-02170", "lateral-color", "mt9v011", "split-pixel", "starter", "street", "table-top"),
    *("test-pixel-0.18um", "x3-junctions", "x3-stacked"),
)
"""Together they have every effect, scene, pattern, processing step and section of them all."""


@pytest.mark.parametrize("name", long_except(set(RUN) - TRACED, CAMERAS))
def test_a_camera_runs(name, tmp_path):
    """And the picture has dark and light areas, and is not mostly clipped."""
    line = ["run", name, "-q", "-o", str(tmp_path / "out")]
    line += [word for item in SMALL for word in ("--set", item)]
    result = CliRunner().invoke(app, line, prog_name="vcam")
    assert result.exit_code == 0, result.output
    assert (result.stdout, result.stderr) == ("", "")
    run = json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))
    assert run["name"] == name
    for file in ("raw.exr", "render.png", "metrics.csv"):
        assert (tmp_path / "out" / file).stat().st_size > 100
    if loaded(name).optics.is_lens:  # a bare sensor under even light takes no picture
        render = picture(tmp_path / "out" / "render.png").astype(float)
        assert render.std() > 10
        assert 20 < render.mean() < 240  # an eye chart is white paper, most of it
        assert np.mean((render == 0) | (render == 255)) < 0.25


def test_the_benchmark_camera():
    """Twelve megapixels, Bayer, and every effect that it describes on."""
    camera = loaded("12mp-bayer")
    assert (camera.array.rows, camera.array.columns) == (3000, 4000)
    assert camera.array.pattern == "bayer-rggb"
    assert camera.effects == "all"
    states = {d.name: d.state for d in small("12mp-bayer").frame.plan.decisions}
    noises = ("shot_noise", "fpn", "reset_noise", "read_noise", "dark_current")
    assert [states[noise] for noise in noises] == ["on"] * 5


def test_everything_has_every_effect_of_its_architecture():
    """But for what a CCD has, depth, which is of a scene, and what its read noise includes.

    Its lens does not distort and has no low-pass filter, its pixels have no crosstalk and no
    measured pattern, and a drain takes all excess charge: the figures of README are of that. Its
    pan has the motion.
    """
    camera = loaded("everything")
    described = camera_effects(camera, geometry(camera)).found
    missing = {name for name, effect in described.items() if effect is None}
    assert missing == {
        *("charge_transfer", "smear", "reset_noise", "depth", "adc_noise", "distortion", "lag"),
        *("crosstalk", "jitter", "blooming", "low_pass", "fpn_maps", "lateral_color"),
    }
    assert camera.effects == "auto"


@pytest.mark.long
def test_everything_stands_before_every_scene_of_the_plan():
    """The sets of effects differ: what each scene needs."""
    small = ("array.rows=48", "array.columns=64", "accuracy=draft")
    sets = set()
    for scene, changes in scene_settings(["all"]).items():
        result = simulate(load("everything", (*small, *changes)), 1)
        assert np.isfinite(result.electrons).all(), scene
        sets.add(tuple(d.state for d in result.frame.plan.decisions))
    assert len(sets) >= 5


def test_the_starter_is_complete_by_itself():
    """It is copied to the user's folder, so it can lean on nothing beside it."""
    assert [file.name for file in load("starter").files if file.suffix == ".yaml"] == [
        "starter.yaml"
    ]
    assert "$schema" not in shipped.find("cameras", "starter").read_text()


def test_low_light_is_as_good_as_light_gets():
    """Shot noise and quantization are all there is: Poisson statistics at every level."""
    result = small("low-light")
    on = {d.name for d in result.frame.plan.decisions if d.state == "on"}
    assert not on & {"read_noise", "reset_noise", "fpn", "dark_current"}
    z = (result.electrons - result.mean_electrons) / np.sqrt(result.mean_electrons)
    # The variance of n draws of unit variance has a standard error of sqrt(2 / n); 5 of them.
    assert float(z.var()) == pytest.approx(1, abs=5 * math.sqrt(2 / z.size))
    assert 20 < result.mean_electrons.mean() < 2000


def shown_scenes() -> set[str]:
    """Scenes that a page of the documentation puts before a camera that has another."""
    pages = (Path(__file__).parents[1] / "docs").rglob("*.md")
    named = (re.findall(r"vcam run .*--set scene=([\w-]+)", p.read_text("utf-8")) for p in pages)
    return {name for names in named for name in names}


class TestFiles:
    def test_each_begins_with_a_sentence_that_says_what_it_is(self):
        def check(path):
            lines = path.read_text("utf-8").splitlines()
            if "yaml-language-server" in lines[0]:
                lines = lines[1:]
            assert re.match(r"# [A-Z]", lines[0]), lines[0]
            assert len(first_comment(path)) > 20
            assert max(len(line) for line in lines) <= 100

        every(YAMLS, check)

    def test_the_schema_of_each_is_there(self):
        def check(path):
            first = path.read_text("utf-8").splitlines()[0]
            match = re.search(r"\$schema=(\S+)", first)
            if path.parent.name == "cameras" and path.stem != "starter":
                assert match, "editors need it"
            if match:
                assert (path.parent / match[1]).is_file()

        every(YAMLS, check)

    def test_some_camera_uses_each(self):
        """But studies, which use cameras, measurements, and lenses, which have a name."""
        shown = shown_scenes()

        def check(path):
            if path.parent.name in ("studies", "measurements", "lenses"):
                return
            if path.parent.name == "scenes" and path.stem in shown:
                return
            if path.parent.name == "filters" and f"`{path.stem}`" in MEASURED_COLOR:
                return
            assert path.resolve() in files_of_cameras()

        every(YAMLS, check)


@pytest.mark.parametrize("path", TABLES, ids=label)
class TestTables:
    def test_some_file_names_it(self, path):
        texts = [file.read_text("utf-8") for file in YAMLS]
        assert any(re.search(rf"\b{re.escape(path.stem)}\b", text) for text in texts)

    def test_is_what_its_comment_says(self, path):
        comments, rows = read(path)
        if path in MEASURED:
            assert any("doi:10." in line for line in comments)
            return
        (line,) = [c for c in comments if "value = " in c]
        formula = line.partition("value = ")[2].partition(",")[0]
        python = re.sub(r"(?<=\d) (?=exp)", " * ", formula).replace("^", "**")
        wavelength, value = np.array(rows, float).T
        names = {"exp": np.exp, "wavelength_nm": wavelength}
        # Rounded to 5 decimals; 1e-12 for the last bit of the rounding.
        assert np.abs(eval(python, {}, names) - value).max() <= 0.5e-5 + 1e-12

    def test_covers_every_wavelength_with_fractions(self, path):
        wavelength, value = np.array(read(path)[1], float).T
        # A camera's sensitivities end where they were measured; its infrared cut is in them.
        assert wavelength[0] <= 380
        assert wavelength[-1] >= (780 if path in MEASURED else 1000)
        assert np.all(np.diff(wavelength) > 0)
        assert value.min() >= 0
        assert value.max() <= 1


def read(path: Path) -> tuple[list[str], list[list[str]]]:
    """Comment lines, and the rows of a spectrum."""
    lines = path.read_text("utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    assert header in (["wavelength_nm", "value"], ["wavelength_nm", "value (per watt)"])
    return comments, rows


def test_names_are_clear_across_kinds():
    """Spectra are looked up by name alone."""
    stems = [path.stem for path in TABLES]
    assert len(stems) == len(set(stems))


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(shipped.files("studies")))
def test_studies_make_their_cameras_and_one_of_each_case_runs(name):
    file = shipped.find("studies", name)
    if "kind: schedule" in file.read_text(encoding="utf-8"):
        assert schedule_file.read(name).model.name == name
        return
    if "kind: dataset" in file.read_text(encoding="utf-8"):
        found = dataset_file.read(name)
        assert found.model.name == name
        assert simulate(found.frame(0).camera(found.base)).dn.std() > 0
        return
    grid = sweep_points.grid(sweep_file.read(name))
    cameras = StudyCameras(grid)
    figures.plan(cameras)
    expectations.plan(cameras)
    assert grid.study.model.name == name
    assert not grid.problems
    for point in {p.case: p for p in grid.points}.values():
        found = {metric: value for metric, value in simulate(point.camera).metrics.items()}
        assert all(np.isfinite(found[metric]) for metric in grid.study.model.metrics)
