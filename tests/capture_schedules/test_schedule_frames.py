"""Pictures taken with several schedules: what they are worth, against the closed form."""

import csv
import importlib.util
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from making import camera, radiance_for
from pydantic import ValidationError

from vcam_cli import load
from vcam_cli.capture_schedules import frames, frames_plots, photocurrents
from vcam_cli.capture_schedules.model import ScheduleFrames
from vcam_cli.capture_schedules.study import schedule
from vcam_cli.config import shipped
from vcam_cli.config.validation_messages import problems
from vcam_cli.errors import BadInput
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.images.exr import read_exr
from vcam_cli.files.images.images import read_picture
from vcam_cli.scheduling.sensor import Sensor
from vcam_cli.simulation.simulate import prepare

pytestmark = pytest.mark.long

SCENE = {
    "scene.source": {"kind": "chart", "chart": "step-wedge", "steps": 30, "density_range": 2.5},
    "effects": {"diffraction": "off"},
    "scene.radiance": radiance_for(60e3),
    "pixel.photodetector.dark_current": "600 e/s",
    "pixel.readout": {
        "conversion_gain": "50 uV/e",
        "full_well": "20 ke",
        "read_noise": "10 e",
        "reset_noise": "15 e",
    },
    "array": {"rows": 64, "columns": 64, "pattern": "monochrome"},
    "exposure": {"captures": {"schedule": "optimal", "count": 4, "max": "200 ms"}},
    "adc": {"bits": 14},
    "accuracy": "standard",
}
ASKED = {"camera": "made", "seeds": 12, "times": {"mine": ["1 ms", "9 ms", "40 ms"]}}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return camera(tmp_path_factory.mktemp("camera"), SCENE)


@pytest.fixture(scope="module")
def asked():
    return ScheduleFrames.model_validate(ASKED)


@pytest.fixture(scope="module")
def found(made, asked):
    return frames.take_frames(asked, made, workers=2)


def test_one_shot_for_each_schedule_and_estimator(found):
    names = [(shot.name, shot.estimator) for shot in found.shots]
    schedules = ("uniform", "optimal", "heuristic", "mine")
    assert names == [(s, e) for s in schedules for e in ("lsbs", "weighted")]
    assert found.rate.shape == (64, 64)


def test_schedules_have_the_same_first_and_longest_exposure(found):
    first = found.sensor.well / (float(found.rate.max()) + found.sensor.dark)
    last = found.shots[2].times[-1]
    for shot in found.shots[:6]:
        assert len(shot.times) == 4
        assert shot.times[0] == pytest.approx(first, rel=1e-6)
        assert shot.times[-1] == pytest.approx(last, rel=1e-12)
    uniform = np.array(found.shots[0].times)
    np.testing.assert_allclose(uniform[1:], last * np.arange(1, 4) / 3, rtol=1e-9)
    assert found.shots[6].times == (1e-3, 9e-3, 40e-3)


def test_measured_and_expected_snr_agree_within_three_standard_errors(found):
    """Where saturation is decided on the noiseless value; 3 and not 5: as the design asks."""
    for shot in found.shots:
        m = shot.measured
        assert abs(m.snr - shot.expected) < 3 * m.error, (shot.name, shot.estimator)
        assert m.error < 0.02 * m.snr


def test_real_saturation_loses_a_little(found):
    """Here a good deal: a wedge has few levels, and the best captures lie just on them, where half
    of the pixels are full by noise. Other captures meet hardly any pixel there.
    """
    loss = {shot.name: shot.noisy_loss for shot in found.shots if shot.estimator == "lsbs"}
    assert 0.03 < loss["optimal"] < 0.2
    assert loss["uniform"] < 0.06
    for shot in found.shots:
        spread = 5 * np.hypot(shot.measured.error, shot.measured.noisy_error)
        assert -spread / shot.measured.snr < shot.noisy_loss < 0.2


def test_the_optimum_is_the_best_and_weighting_gains(found):
    by = {(shot.name, shot.estimator): shot for shot in found.shots}
    for method in ("uniform", "heuristic", "mine"):
        assert by["optimal", "lsbs"].expected >= by[method, "lsbs"].expected * (1 - 2e-3)
        assert by[method, "weighted"].expected > by[method, "lsbs"].expected
    assert found.best_shot("lsbs").name == "optimal"
    below = found.db_below_best(by["uniform", "lsbs"])
    ratio = by["optimal", "lsbs"].expected / by["uniform", "lsbs"].expected
    assert below == pytest.approx(10 * np.log10(ratio), abs=0.2)


def test_pictures_are_the_camera_s_own(found, made):
    """Every picture is near the true photocurrents, and no two of them are the same."""
    rate = found.rate.astype(float)
    for shot in found.shots:
        times = np.array(shot.times)
        noise = np.sqrt((rate + 600) / times[0] + (10**2 + 15**2) / times[0] ** 2)
        inside = (rate + 600) * times[0] < found.sensor.well * 0.97
        assert np.all(np.abs(shot.photocurrent - rate)[inside] < 7 * noise[inside])
    pictures = {shot.photocurrent.tobytes() for shot in found.shots}
    assert len(pictures) == len(found.shots)


def test_mean_snr_of_one_level(tmp_path):
    """Even light, one capture: i^2 T^2 / ((i + d) T + noise) for every pixel."""
    flat = {
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "exposure": {"captures": ["20 ms"]},
        "scene.radiance": radiance_for(2e3),
    }
    made = camera(tmp_path, SCENE | flat)
    asked = ScheduleFrames.model_validate(
        ASKED | {"methods": [], "times": {"one": ["20 ms"]}, "estimators": ["lsbs"], "seeds": 20}
    )
    found = frames.take_frames(asked, made)
    (shot,), i = found.shots, float(np.median(found.rate))
    step = 20e3 / (2**14 - 1)
    expected = (i * 0.02) ** 2 / ((i + 600) * 0.02 + 100 + 225 + step**2 / 12)
    assert shot.expected == pytest.approx(expected, rel=1e-5)
    assert shot.measured.snr == pytest.approx(expected, rel=5 * np.sqrt(2 / 16 / 4096))


@pytest.mark.draws
def test_files(found, asked, made, tmp_path):
    with OutputFolder(tmp_path / "out", "study.json") as folder:
        frames.write_frames(found, asked, folder, "made", ("svg", "pdf"))
        folder.finish({})
    out = tmp_path / "out"
    rows = list(csv.DictReader((out / "frames.csv").read_text("utf-8").splitlines()))
    assert [row["schedule"] for row in rows[::2]] == ["uniform", "optimal", "heuristic", "mine"]
    assert float(rows[2]["below_best_db"]) == 0.0
    assert rows[6]["times"] == "0.001 0.009 0.04"
    for shot, row in zip(found.shots, rows, strict=True):
        channels, said = read_exr(out / "frames" / f"{shot.name}-{shot.estimator}.exr")
        assert np.array_equal(channels["photocurrent"], shot.photocurrent)
        assert said["vcam:estimator"] == shot.estimator
        assert float(row["measured_snr"]) == shot.measured.snr
        assert (out / "frames" / f"{shot.name}-{shot.estimator}.png").stat().st_size > 500
    for name in ("frames_lsbs.png", "noise_weighted.png"):
        assert (out / name).stat().st_size > 10_000
        assert ElementTree.parse((out / name).with_suffix(".svg")).getroot().tag.endswith("svg")
        assert (out / name).with_suffix(".pdf").read_bytes().startswith(b"%PDF")


def test_a_camera_that_takes_one_sample_is_refused(asked, tmp_path):
    single = camera(tmp_path, SCENE | {"exposure": {"time": "5 ms"}})
    with pytest.raises(BadInput, match="single sample"):
        frames.take_frames(asked, single)


def test_that_is_told_before_any_light_is_simulated(tmp_path, monkeypatch):
    def simulated(*_):
        raise AssertionError("light was simulated")

    monkeypatch.setattr(photocurrents, "camera_photocurrents", simulated)
    study = tmp_path / "study.yaml"
    study.write_text("kind: schedule\npdf: {camera: starter}\ncounts: [2]\nframes: {count: 2}\n")
    with pytest.raises(BadInput, match=r"study.yaml:4:9: frames.camera: has a single sample"):
        schedule(study, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("count", "longest"), [(1, 0.2), (4, 1e-6), (2, 1.0), (4, 1e-3 * (1 + 1e-9))]
)
def test_the_heuristic_takes_what_the_readout_allows(count, longest):
    """One capture, or none that any pixel saturates, are as many as there is light for."""
    rate = np.linspace(1e3, 2e7, 100, dtype=np.float32)[:, None]
    sensor = Sensor(20e3 * (1 + 1e-9), max_time=longest)
    times = frames._heuristic_times(rate, count, 3, sensor)
    assert 1 <= times.size <= count
    assert np.all(times <= longest)
    assert np.all(np.isfinite(times))
    assert times.min() == pytest.approx(min(1e-3, longest), rel=1e-6)


def test_an_array_of_colors_is_refused(asked, tmp_path):
    lit = {"scene.illuminant": "D65", "array.rows": 8, "array.columns": 8, "processing": []}
    colors = camera(tmp_path, SCENE | lit | {"array.pattern": "bayer-rggb"})
    with pytest.raises(BadInput, match="monochrome"):
        frames.take_frames(asked, colors)


def test_darkness_is_refused(asked, tmp_path):
    dark = camera(tmp_path, SCENE | {"scene.source": {"kind": "chart", "chart": "uniform",
                                                      "reflectance": 0}})  # fmt: skip
    with pytest.raises(BadInput, match="no light"):
        frames.take_frames(asked, dark)


@pytest.mark.parametrize(
    ("changes", "path", "words"),
    [
        ({"methods": [], "times": {}}, "methods", "no schedule"),
        ({"methods": ["best"]}, "methods.0", "best"),
        ({"times": {"mine": ["5 ms", "3 ms"]}}, "times.mine.1", "must rise"),
        ({"times": {"a b": ["5 ms"]}}, "times.a b", "not a name"),
        ({"times": {"optimal": ["5 ms"]}}, "times.optimal", "method's name"),
        ({"times": ["5 ms"]}, "times", "not a mapping"),
        ({"times": {"mine": ["5 m"]}}, "times.mine.0", "not a time"),
        ({"seeds": 2}, "seeds", "at least 6"),
        ({"zoom": {"x": 2, "y": 0}}, "zoom.x", "at most 1"),
        ({"segments": 0}, "segments", "at least 1"),
    ],
)
def test_bad_input(changes, path, words):
    with pytest.raises(ValidationError) as caught:
        ScheduleFrames.model_validate(ASKED | changes)
    found = {".".join(map(str, p.path)): f"{p.message}; {p.remedy}" for p in problems(caught.value)}
    assert words in found[path]


def test_what_is_written_reads_back(asked):
    zoomed = ScheduleFrames.model_validate(ASKED | {"zoom": {"x": 0.2, "y": 0.3}, "max": "50 ms"})
    for one in (asked, zoomed):
        assert ScheduleFrames.model_validate(one.model_dump(mode="json")) == one


# --- tones ---------------------------------------------------------------------------------------


def test_tones_are_logarithmic():
    values = np.array([1.0, 10.0, 100.0, 1e3, 0.0, -5.0, np.nan])
    assert frames_plots.tones(values, 1.0, 100.0).tolist() == [0, 128, 255, 255, 0, 0, 0]


def test_limits_of_a_picture():
    low, high = frames_plots.tone_limits(np.linspace(0, 1000, 1001))
    assert high == 1000
    assert 1 <= low <= 10
    assert frames_plots.tone_limits(np.zeros(4)) == (1.0, 2.0)
    low, high = frames_plots.tone_limits(np.full(4, 3.0))
    assert low < high == 3.0


def test_a_square_lies_within_the_picture(found):
    for x, y, size in ((0, 0, 0.3), (1, 1, 0.5), (0.5, 0.5, 1)):
        asked = ScheduleFrames.model_validate(ASKED | {"zoom": {"x": x, "y": y, "size": size}})
        rows, columns = frames._detail_square(asked, found)
        assert 0 <= rows.start < rows.stop <= 64
        assert 0 <= columns.start < columns.stop <= 64
        assert rows.stop - rows.start == columns.stop - columns.start == round(64 * size)


# --- in a study ----------------------------------------------------------------------------------

STUDY = """\
kind: schedule
pdf: {pdf}
counts: [2]
frames: {frames}
sensor: {{well_capacity: 20 ke, max_time: 200 ms}}
"""


def studied(folder, pdf: str, frames: str) -> Path:
    """A study beside the camera made.yaml."""
    camera(folder, SCENE | {"array.rows": 16, "array.columns": 60})
    (folder / "study.yaml").write_text(STUDY.format(pdf=pdf, frames=frames), "utf-8")
    return folder / "study.yaml"


@pytest.mark.parametrize(
    ("pdf", "key"),
    [("{camera: made.yaml}", ""), ("{uniform: {min: 0, max: 1}}", "camera: made.yaml, ")],
)
def test_a_study_takes_pictures(pdf, key, tmp_path):
    """With the pdf's camera, or one of its own."""
    frames = f"{{{key}count: 3, seeds: 6, methods: [optimal], estimators: [lsbs]}}"
    result = schedule(studied(tmp_path, pdf, frames), tmp_path / "out")
    (shot,) = result.frames.shots
    assert (shot.name, len(shot.times)) == ("optimal", 3)
    assert result.summary()["frames"][0]["expected_snr"] == shot.expected
    assert (tmp_path / "out" / "frames" / "optimal-lsbs.exr").exists()
    assert str(tmp_path / "made.yaml") in map(str, result.study.inputs)


def test_mistakes_of_pictures_are_told_with_their_places(tmp_path):
    none = studied(tmp_path, "{uniform: {min: 0, max: 1}}", "{count: 3}")
    with pytest.raises(BadInput, match=r"study.yaml:4:\d+: frames.camera: is missing"):
        schedule(none, tmp_path / "out")
    gone = studied(tmp_path, "{uniform: {min: 0, max: 1}}", "{camera: gone.yaml}")
    with pytest.raises(BadInput, match=r"study.yaml:4:18: frames.camera"):
        schedule(gone, tmp_path / "out")
    (tmp_path / "other").mkdir()
    single = camera(tmp_path / "other", SCENE | {"exposure": {"time": "5 ms"}})
    text = studied(tmp_path, "{uniform: {min: 0, max: 1}}", f"{{camera: {single.origin}}}")
    with pytest.raises(BadInput, match=r"study.yaml:4:18: frames.camera: has a single sample"):
        schedule(text, tmp_path / "out")


# --- what ships ----------------------------------------------------------------------------------


def test_the_shipped_scenes_are_what_their_script_draws():
    """Codes as they are; a rounding may fall the other way in another library's sums."""
    path = Path(__file__).parents[2] / "scripts" / "make_hdr_scenes.py"
    spec = importlib.util.spec_from_file_location("make_hdr_scenes", path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name, codes in script.everything().items():
        file = shipped.folder() / "scenes" / name
        read = read_picture(str(file), "linear", 1.0, ("file",)).data[..., 0]
        assert read.shape == codes.shape == (256, 256)
        assert np.abs(read * 65535 - codes).max() < 1.01
    assert script.everything()["hdr-scene.png"].max() == 4095


def test_the_shipped_scene_has_twelve_bits_and_the_bound_of_the_thesis():
    """imax over the mean, the bound on the gain of any schedule, is between 8 and 11."""
    rate = prepare(load("hdr-scene"))[0].rate
    assert rate.shape == (256, 256)
    assert 8 < float(rate.max() / rate.mean(dtype=float)) < 11
    assert 2000 < float(rate.max() / rate.min()) < 4096
