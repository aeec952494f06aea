"""Sequences: time goes on, temporal noise is new, the sensor stays."""

import csv
import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from making import GONE, QUIET, camera, radiance_for
from typer.testing import CliRunner

from vcam_cli import plan, simulate
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.files.images.images import read_picture
from vcam_cli.image_formation import photon_rate
from vcam_cli.progress import Silent
from vcam_cli.simulation import cost_model, sequence
from vcam_cli.simulation.sequence import frame_cameras

WAVE = {"kind": "chart", "chart": "sinusoid", "frequency": "20 lp/mm"}


def test_the_first_frame_is_the_camera_s_own(tmp_path):
    made = camera(tmp_path, {"pixel.fpn": {"dsnu": "20 e"}})
    [first] = frame_cameras(made, 1, 30)
    assert simulate(first).electrons.tobytes() == simulate(made).electrons.tobytes()


@pytest.mark.parametrize("lag", ["0 %", "2 %"])
def test_a_frame_is_held_beside_the_next_where_its_charge_lags(lag, tmp_path):
    made = camera(tmp_path, {"pixel.lag": lag, "effects": "all"})
    taken = sequence.frames(made, 3, 30, 1, Silent())
    _, result = next(taken)
    frame = weakref.ref(result.frame)
    del result
    next(taken)
    gc.collect()
    assert (frame() is None) == (lag == "0 %")


def test_noise_is_new_and_the_pattern_stays(tmp_path):
    """Differences of frames have twice the temporal variance and none of the pattern."""
    made = camera(
        tmp_path,
        {"scene.radiance": radiance_for(900), "pixel.fpn": {"dsnu": "60 e"}, "effects": "all"},
    )
    a, b = (simulate(each).electrons.astype(float) for each in frame_cameras(made, 2, 30))
    # 3072 pixels: five standard errors of a variance are 5 sqrt(2 / 3072) = 13 %
    assert np.var(a - b) / 2 == pytest.approx(900, rel=0.13)
    assert np.var(a) == pytest.approx(900 + 3600, rel=0.13)


@pytest.mark.parametrize("speed", [(0.05, 0.0), (0.03, -0.02)])
def test_what_moves_has_moved_on(speed, tmp_path):
    """Frame k shows the wave v k / F further on, in closed form."""
    source = WAVE | {"orientation": "30 deg"}
    source["motion"] = {"x": f"{speed[0]} m/s", "y": f"{speed[1]} m/s"}
    made = camera(tmp_path, {"scene.source": source, "effects": QUIET})
    frames = [simulate(each).mean_electrons for each in frame_cameras(made, 4, 40)]
    scale = 5e-3 / (1 - 5e-3)
    x, y = (np.arange(64) - 31.5) * 5e-6, ((np.arange(48) - 23.5) * 5e-6)[:, None]
    fx, fy = 20e3 * np.cos(np.pi / 6), -20e3 * np.sin(np.pi / 6)

    def wave(time):
        dx, dy = (v * scale * time for v in speed)
        return np.cos(2 * np.pi * (fx * (x - dx) + fy * (y - dy)))

    basis = np.stack([np.ones(x.size * y.size), wave(0).ravel()], axis=1)
    level, amplitude = np.linalg.lstsq(basis, frames[0].ravel(), rcond=None)[0]
    for number, frame in enumerate(frames):
        np.testing.assert_allclose(frame, level + amplitude * wave(number / 40), rtol=1e-9)


def test_a_picture_that_moves_by_whole_pixels_is_the_picture_moved(tmp_path):
    """Painted charts, too: what frame k shows is frame 0, so many columns further on."""
    per_second = 5e-6 / (5e-3 / (1 - 5e-3)) * 3 * 40  # 3 pixels a frame at 40 frames a second
    source = {"kind": "chart", "chart": "slanted-edge", "motion": {"x": f"{per_second!r} m/s"}}
    made = camera(tmp_path, {"scene.source": source, "effects": QUIET})
    first, *_, last = (simulate(each).mean_electrons for each in frame_cameras(made, 3, 40))
    # the promise at `reference`, for both of them
    error = last[:, 6:] - first[:, :-6]
    assert np.sqrt(np.mean(error**2)) < 2 * 2e-4 * first.max()


def test_a_lamp_flickers_on(tmp_path):
    lamp = {"monochromatic": "550 nm", "flicker": {"frequency": "100 Hz", "depth": "40 %"}}
    made = camera(tmp_path, {"scene.illuminant": lamp, "effects": QUIET, "exposure.time": "2 ms"})
    frames = [simulate(each).mean_electrons.mean() for each in frame_cameras(made, 5, 30)]
    middle = 2 * np.pi * 100 * (np.arange(5) / 30 + 1e-3)
    light = 1 + 0.4 * np.sinc(100 * 2e-3) * np.cos(middle)
    np.testing.assert_allclose(frames / np.mean(frames), light / light.mean(), rtol=1e-9)


@pytest.mark.parametrize(("speed", "lights"), [("0 m/s", 1), ("0.05 m/s", 6)])
def test_memory_stays_and_still_scenes_have_one_light(speed, lights, tmp_path, monkeypatch):
    """One light is kept, however many frames follow each other."""
    kept, found, true = [], [], sequence.simulate

    def watched(each, workers, watch, shared, device, before):
        result = true(each, workers, watch, shared, device, before)
        kept.append(shared.rate_cache.nbytes)
        found.append(id(result.frame.rate))
        lasting.append(result)
        return result

    lasting = []  # so that no two have one place in memory
    monkeypatch.setattr(sequence, "simulate", watched)
    source = WAVE | {"motion": {"x": speed}}
    made = camera(tmp_path, {"scene.source": source, "effects": QUIET})
    size = simulate(made).frame.rate.nbytes
    for _ in sequence.frames(made, 6, 40, 1, Silent()):
        pass
    assert len(set(found)) == lights
    assert kept == [size] * 6


@pytest.mark.parametrize(
    ("speed", "exposure", "lights"),
    [
        ("0 m/s", {"time": "2 ms"}, 1),
        ("0 m/s", {"auto": {"max": "5 ms"}}, 1),
        ("0.05 m/s", {"time": "2 ms"}, 5),
        ("0.05 m/s", {"auto": {"max": "5 ms"}}, 6),
    ],
)
def test_planned_time_counts_every_light_once(speed, exposure, lights, tmp_path, monkeypatch):
    """As many images as five frames form: a moving one is metered at rest first."""
    formed, true = [], photon_rate.photo_rate

    def counted(*arguments):
        formed.append(1)
        return true(*arguments)

    source = WAVE | {"motion": {"x": speed}}
    gone = {"exposure.time": GONE} if "auto" in exposure else {}
    given = {f"exposure.{key}": value for key, value in exposure.items()}
    made = camera(tmp_path, {"scene.source": source, "effects": QUIET} | gone | given)
    found = plan(made)
    monkeypatch.setattr(cost_model, "light_seconds", lambda *_: 10.0)
    once = replace(found.ready.plan, seconds=3.0 + 10 * (2 if lights == 6 else 1))
    found = replace(found, ready=replace(found.ready, plan=once))
    assert sequence.planned_seconds(found, 5)[0] == pytest.approx(5 * 3 + 10 * lights)
    monkeypatch.setattr(photon_rate, "photo_rate", counted)
    for _ in sequence.frames(made, 5, 40, 1, Silent()):
        pass
    assert len(formed) == lights


def test_exposures_have_to_fit(tmp_path):
    made = camera(tmp_path, {"exposure.time": "20 ms"})
    with pytest.raises(BadInput, match="do not fit 60 frames a second"):
        list(frame_cameras(made, 2, 60))


def test_the_command_writes_numbered_frames(tmp_path):
    camera(tmp_path, {"output": {"raw": ["dn"]}})
    made, out = str(tmp_path / "made.yaml"), tmp_path / "out"
    arguments = ["run", made, "-o", str(out), "-q", "--frames", "3", "--fps", "25"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    names = sorted(path.name for path in (out / "frames").iterdir())
    assert names == [f"{kind}_000{n}.{end}" for kind, end in FILES for n in (1, 2, 3)]
    with (out / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["start [s]"]) for row in rows] == [0, 0.04, 0.08]
    assert [row["seed"] for row in rows] == ["1", "2", "3"]
    assert read_picture(str(out / "strip.png"), "srgb", 1.0, ()).data.shape[:2] == (48, 3 * 64)
    alone = CliRunner().invoke(app, ["run", made, "-o", str(out), "--frames", "3"])
    assert alone.exit_code == 2


FILES = (("raw", "exr"), ("render", "png"))
