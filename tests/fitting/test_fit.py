"""From frames to a camera file: drawn cameras, broken frames, colors, edges, the command."""

import csv
import json
import math
from types import SimpleNamespace

import blind
import numpy as np
import pytest
import yaml
from emva1288.process import routines
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.fitting import sensor
from vcam_cli.fitting.fit import fit
from vcam_cli.verification import measurement_file
from vcam_cli.verification.measured_points import measured_points
from vcam_cli.verification.prediction import predict
from vcam_cli.verification.stack_statistics import Estimate

ROWS, FRAMES = 96, 8
INVOKE = CliRunner()


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """A drawn camera, its frames and its measurement file's content."""
    folder = tmp_path_factory.mktemp("bench")
    known = blind.truth(100)
    return folder, known, blind.bench(known, folder, ROWS, FRAMES)


def fitted(folder, form, **changes):
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | changes))
    return fit(measurement_file.read(folder / "bench.yaml"))


def test_a_drawn_camera_comes_back(taken):
    """All twelve parameters within five standard errors; half a 90 % interval is 1.645 of them."""
    folder, known, form = taken
    found = fitted(folder, form)
    named = {p.name: p for p in found.parameters}
    assert set(known) <= set(named)
    for name, value in known.items():
        p = named[name]
        assert abs(p.value - value) <= 5 / 1.645 * (p.high - p.low) / 2, name
        assert p.low < p.value < p.high
    assert found.unknown == ["sharpness: needs frames of an edge"]
    assert found.notes == []


def test_its_camera_file_makes_frames_like_those_measured(taken, tmp_path):
    """Mean and variance of a flat frame of half of the light, beside one measured, to 3 %."""
    folder, _, form = taken
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(fitted(folder, form).camera))
    camera = load(tmp_path / "camera.yaml")
    light = next(e for e in form["frames"] if e["name"] == "flat0.5")["irradiance"]
    pair = [simulate(camera.with_({"scene.irradiance": light, "seed.frame": n})).dn for n in (1, 2)]
    real = [np.load(folder / f"flat0.5_{n:02d}.npy") for n in range(2)]
    told = [(np.mean(p), np.var(p[0] - p[1].astype(float))) for p in (pair, real)]
    assert told[0][0] == pytest.approx(told[1][0], rel=0.01)
    assert told[0][1] == pytest.approx(told[1][1], rel=5 * math.sqrt(2 * 2 / ROWS**2) + 0.01)


def test_the_standards_own_program_finds_the_same_gain(taken, monkeypatch):
    """The EMVA's program on pairs of the same frames: gain and dark noise within both intervals."""
    from emva1288.process.data import Data1288
    from emva1288.process.results import Results1288

    folder, known, form = taken
    found = {p.name: p for p in fitted(folder, form).parameters}
    monkeypatch.setattr(np, "asfarray", lambda a: np.asarray(a, float), raising=False)
    temporal, still = {}, {}
    for level in (0.0, *blind.LEVELS[:-1]):
        name = f"flat{level:g}" if level else "dark10"
        frames = [np.load(f).astype(np.int64) for f in sorted(folder.glob(f"{name}_*.npy"))]
        photons = level * known["full_well"] / known["quantum_efficiency.Y"]
        told = routines.get_int_imgs(frames[:2])
        temporal[photons] = {**told, "sum": told["sum"].sum(), "pvar": told["pvar"].sum()}
        if level in (0.0, 0.5):
            still[photons] = routines.get_int_imgs(frames)
    sizes = {"width": ROWS, "height": ROWS}
    data = {"temporal": {1.0: temporal}, "spatial": {1.0: still}, **sizes}
    theirs = Results1288(Data1288(data).data)
    pairs = math.sqrt(
        FRAMES / 4
    )  # they use two frames of each stack, so that their error is larger
    for name, value in (
        ("system_gain", theirs.K),
        ("quantum_efficiency.Y", theirs.QE / 100),
        ("dsnu", theirs.DSNU1288),
    ):
        p = found[name]
        reach = 5 / 1.645 * (p.high - p.low) / 2 * pairs
        assert value == pytest.approx(p.value, abs=reach), name


def test_what_is_wrong_with_frames_is_said(taken, tmp_path):
    """A bad frame, light that drifts, a wrong black level: said, and the gain is still found."""
    folder, known, form = taken
    for file in folder.glob("*.npy"):
        np.save(tmp_path / file.name, np.load(file))
    broken = tmp_path / "flat0.5_03.npy"
    np.save(broken, np.load(broken) // 2)
    for n in range(FRAMES):
        drifting = tmp_path / f"flat0.5_{n:02d}.npy"
        if n != 3:
            np.save(drifting, np.rint(np.load(drifting) * (1 + 0.004 * n)).astype(np.uint16))
    found = fitted(tmp_path, form, levels={"bits": 12, "black": 20})
    said = " ".join(found.notes)
    assert "flat0.5_03.npy is unlike the others" in said
    assert "flat0.5: the light drifts by" in said
    assert "levels.black is 20, but dark frames have" in said
    assert found.value("system_gain") == pytest.approx(known["system_gain"], rel=0.05)


def test_dark_codes_that_are_cut_off_are_said(taken, tmp_path):
    folder, known, form = taken
    for file in folder.glob("*.npy"):
        lower = np.load(file).astype(int) - round(known["black_level"])
        np.save(tmp_path / file.name, np.maximum(lower, 0).astype(np.uint16))
    assert "of the dark codes are clipped at 0" in " ".join(fitted(tmp_path, form).notes)


def test_what_frames_cannot_tell_is_named(taken):
    folder, _, form = taken
    left_out = ("dark1", "dark400", "flat1.5")
    fewer = [
        {key: value for key, value in entry.items() if key != "irradiance"}
        for entry in form["frames"]
        if entry["name"] not in left_out
    ]
    found = fitted(folder, form, frames=fewer)
    named = " ".join(found.unknown)
    for word in ("dark current", "quantum efficiency", "full well", "irradiance", "sharpness"):
        assert word in named
    assert found.value("dark_current") is None


def test_tails_bands_and_defects_are_found(tmp_path):
    known = blind.truth(101) | {"row_noise": 0.0, "column_noise": 0.0, "read_noise": 0.0}
    changes = {
        "pixel.readout.heavy_tailed_noise": {"rms": "40 e", "shape": -0.1},
        "pixel.readout.correlated_row_noise": {"rms": "20 e", "correlation": 0.8},
        "pixel.defects": {"hot": 0.004, "dead": 0.006},
    }
    found = fitted(tmp_path, blind.bench(known, tmp_path, ROWS, FRAMES, 7, changes))
    assert found.value("read_noise") == pytest.approx(40, rel=0.03)
    assert found.value("read_noise_shape") == pytest.approx(-0.1, abs=0.03)
    assert found.value("row_noise") == pytest.approx(20, rel=0.2)
    assert found.value("row_correlation") == pytest.approx(0.8, abs=0.1)
    for name, share in (("hot", 0.004), ("dead", 0.006)):
        assert found.value(name) == pytest.approx(share, abs=5 * math.sqrt(share) / ROWS)
    assert set(found.camera["pixel"]["readout"]) >= {"heavy_tailed_noise", "correlated_row_noise"}
    (tmp_path / "found.yaml").write_text(yaml.safe_dump(found.camera))
    assert load(tmp_path / "found.yaml").pixel.readout.correlated_row_noise.correlation < 1


@pytest.mark.long
def test_traps_and_shading_are_found(tmp_path):
    """Each within five standard errors; the other noise is as it would be without them."""
    known = blind.truth(102)
    changes = {
        "pixel.readout.telegraph_noise": {
            "fraction": "4 %", "amplitude": "60 e", "occupancy": "30 %",
        },
        "pixel.fpn.shading": {"offset": "8 e", "gain": "2 %"},
    }  # fmt: skip
    found = fitted(tmp_path, blind.bench(known, tmp_path, ROWS, FRAMES, 8, changes))
    named = {p.name: p for p in found.parameters}
    truth = known | {
        "telegraph_fraction": 0.04,
        "telegraph_amplitude": 60,
        "telegraph_occupancy": 0.3,
        "shading_offset": 8,
        "shading_gain": 0.02,
    }
    for name, value in truth.items():
        p = named[name]
        assert abs(p.value - value) <= 5 / 1.645 * (p.high - p.low) / 2, name
    assert "read_noise_shape" not in named
    assert "flat frames are not uniform" in " ".join(found.notes)
    (tmp_path / "found.yaml").write_text(yaml.safe_dump(found.camera))
    told = load(tmp_path / "found.yaml").pixel
    assert told.readout.telegraph_noise.occupancy == pytest.approx(0.3, abs=0.1)
    assert told.fpn.shading.gain == pytest.approx(0.02, rel=0.1)


@pytest.mark.long
def test_dark_current_over_temperature(tmp_path):
    """Doubled every 7 K: within five standard errors; verify predicts the warm frames."""
    known = blind.truth(103)
    density = known["dark_current"] * 1.602176634e-19 / 16e-12
    camera = {
        "pixel.photodetector.dark_current_density": {
            "value": f"{density!r} A/m2",
            "temperature": "300 K",
            "doubling": "7 K",
        }
    }
    form = blind.bench(known, tmp_path, ROWS, FRAMES, 9, camera)
    for kelvin in (290, 310):
        warm = tmp_path / str(kelvin)
        warm.mkdir()
        at = camera | {"pixel.temperature": f"{kelvin} K"}
        taken = blind.bench(known, warm, ROWS, FRAMES, 9, at)["frames"]
        form["frames"] += [
            entry | {"files": f"{kelvin}/{entry['files']}", "temperature": f"{kelvin} K"}
            for entry in taken
            if entry["name"] in ("dark1", "dark400")
        ]
    without = {"frames": form["frames"]}
    with pytest.raises(BadInput, match="the flat frames give no temperature"):
        fitted(tmp_path, form, **without)
    for entry in form["frames"]:
        entry.setdefault("temperature", "300 K")
    found = fitted(tmp_path, form)
    named = {p.name: p for p in found.parameters}
    for name, value in (known | {"dark_current_doubling": 7.0}).items():
        p = named[name]
        assert abs(p.value - value) <= 5 / 1.645 * (p.high - p.low) / 2, name
    (tmp_path / "found.yaml").write_text(yaml.safe_dump(found.camera))
    camera = load(tmp_path / "found.yaml")
    points, *_ = measured_points(camera, measurement_file.read(tmp_path / "bench.yaml"))
    for _, point in points[-4:]:
        assert predict(camera, point).value == pytest.approx(point.signal.value, rel=0.01)


def edge(pitch: float, blur: float, rng: np.random.Generator, rows: int = 120) -> np.ndarray:
    """An edge of 5 degrees behind a Gaussian blur [m], averaged over 5 x 5 points of each pixel."""
    from scipy.special import erf

    y, x = np.indices((rows, rows), dtype=float)
    steps = (np.arange(5) - 2) / 5
    slope = math.tan(math.radians(5))
    out = sum(
        erf(((x + i - rows / 2) + slope * (y + j - rows / 2)) * pitch * math.cos(math.atan(slope))
            / (math.sqrt(2) * blur))
        for i in steps for j in steps
    ) / 25  # fmt: skip
    return np.rint(1000 + 700 * out + 4 * rng.standard_normal(out.shape)).astype(np.uint16)


def test_a_gain_is_that_of_all_electrons():
    """Offsets of 3 DN; gains of 2 % on a signal of 900 DN, and 100 DN and 10 DN of dark signal."""

    def stack(electrons, seconds):
        variance = Estimate(9 + (0.02 * electrons) ** 2, 0.1)
        patterns = {"Y": SimpleNamespace(pixel=variance, column=variance, slow=variance)}
        return SimpleNamespace(patterns=patterns, entry=SimpleNamespace(exposure=seconds))

    line = sensor.Dark(Estimate(64, 0.1), Estimate(1000, 1))
    found = sensor.gain_variances(stack(1000, 0.1), stack(10, 0.01), "Y", 900, line)
    assert [each.value for each in found] == pytest.approx([0.02**2] * 3, rel=1e-12)


def test_sharpness_of_an_edge(taken):
    """MTF50 of a Gaussian of sigma times the sinc of a pixel, by bisection; to 2 %."""
    folder, _, form = taken
    rng = np.random.default_rng(3)
    pitch, blur = 4e-6, 3e-6
    for n in range(4):
        np.save(folder / f"edge_{n}.npy", edge(pitch, blur, rng, ROWS))
    low, high = 0.0, 1 / pitch
    for _ in range(60):
        f = (low + high) / 2
        mtf = math.exp(-2 * (math.pi * blur * f) ** 2) * np.sinc(f * pitch)
        low, high = (f, high) if mtf > 0.5 else (low, f)
    frames = [
        *form["frames"],
        {"files": "edge_*.npy", "exposure": "10 ms", "target": "slanted-edge"},
    ]
    found = fitted(folder, form, frames=frames)
    assert found.value("mtf50.Y") == pytest.approx(low * 1e-3, rel=0.02)


def test_colors_of_a_mosaic_are_told_apart(taken, tmp_path):
    """The same frames read as a mosaic: all colors have the numbers of the sensor."""
    folder, known, form = taken
    found = fitted(folder, form, pattern="bayer-rggb")
    for color in "RGB":
        name = f"quantum_efficiency.{color}"
        assert found.value(name) == pytest.approx(known["quantum_efficiency.Y"], rel=0.02)
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(found.camera))
    assert load(tmp_path / "camera.yaml").array.pattern == "bayer-rggb"


@pytest.mark.draws
def test_the_command_writes_camera_table_and_json(taken, tmp_path):
    folder, _, form = taken
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | {"hold_out": "20 %"}))
    arguments = ["fit", str(folder / "bench.yaml"), "-o", str(tmp_path / "out"), "--json"]
    arguments += ["--report", "--format", "svg"]
    result = INVOKE.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    with (tmp_path / "out" / "parameters.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["parameter", "value", "low", "high", "unit", "method"]
    assert [r["parameter"] for r in rows] == [p["parameter"] for p in told["parameters"]]
    assert load(tmp_path / "out" / "camera.yaml").optics.is_lens is False
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    for name in ("photon_transfer", "dark_signal", "intervals"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 1000
        assert (tmp_path / "out" / f"{name}.svg").read_text("utf-8").startswith("<?xml")
        assert page.count(f"{name}.png") > 0
    assert "not determined by the frames: sharpness" in page
    assert json.loads((tmp_path / "out" / "fit.json").read_text())["unknown"]


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"frames": [{"files": "no_*.tif", "exposure": "1 ms"}]}, ("frames", 0, "files")),
        ({"levels": {"bits": 6}}, ("frames", 0, "files")),
        ({"frames": [{"signal": "1 V", "exposure": "1 ms"}]}, ("frames",)),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_its_place(taken, changes, path):
    folder, _, form = taken
    with pytest.raises(BadInput) as caught:
        fitted(folder, form, **changes)
    [problem] = caught.value.problems
    assert problem.path == path
    assert problem.remedy
    assert "bench.yaml" in str(problem)


@pytest.mark.long
def test_intervals_hold_the_truth_of_sixty_cameras(tmp_path):
    """90 % intervals of 720 parameters: 86 to 94 % of them.

    Twenty would not do: errors of gain, efficiency and well of a camera are one and the same.
    The mean of the errors is 0 to five of its standard errors: a bias larger than that would be a
    third of the intervals' halves, and they would hold less than they say.
    """
    held, errors = [], {}
    for number in range(60):
        folder = tmp_path / str(number)
        folder.mkdir()
        known, found = blind.blind_fit(number, folder, 128, 8)
        for p in found.parameters:
            if p.name in known:
                held.append(p.low <= known[p.name] <= p.high)
                errors.setdefault(p.name, []).append(p.value / known[p.name] - 1)
    assert 0.86 <= np.mean(held) <= 0.94
    for name, listed in errors.items():
        assert abs(np.mean(listed)) < 5 * np.std(listed) / math.sqrt(len(listed)), name
