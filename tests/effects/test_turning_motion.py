"""Motion that turns: against sums over instants of waves, and of pictures that are turned by hand.

References use complex numbers, x + i y with y down, so that a turn by a clockwise is exp(i a).
"""

import itertools
import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from making import camera, long_except
from moving_waves import COLUMNS, IMAGE, ROWS, SCALE, STILL, TIME, WAVE, exposure, seen

from vcam_cli import simulate

SPIN = math.radians(4) / TIME
"""Four degrees in the exposure [rad/s]: 2.7 pixels in the corners."""
PLACES, INSTANTS = 1e-4, 2e-5
"""What splines of order 5 through 6 places a wave leave of it, and the shares of `reference`."""


def result(folder, *changes: dict):
    merged = dict(STILL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged))


def degrees(speed: float) -> str:
    return f"{math.degrees(speed)!r} deg/s"


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


@pytest.mark.parametrize(
    ("which", "direction"),
    long_except(
        [
            *(("rotate", "up"), ("rotate", "right"), ("roll", "up"), ("roll", "right")),
            *(("all", None), ("all", "down"), ("all", "left")),
        ],
        itertools.product(["rotate", "roll", "all"], [None, "down", "up", "left", "right"]),
        several=True,
    ),
)
def test_a_wave_that_turns_is_the_sum_of_its_instants(which, direction, tmp_path):
    """The scene turns clockwise and passes by, the camera rolls, pans and tilts: all at once."""
    scene = {"rotate": SPIN if which != "roll" else 0.0, "x": 0.0, "y": 0.0}
    turn = {"roll": 0.7 * SPIN if which != "rotate" else 0.0, "pan": 0.0, "tilt": 0.0}
    if which == "all":
        scene |= {"x": 0.3, "y": -0.2}
        turn |= {"pan": 0.15, "tilt": 0.4}
    still = result(tmp_path, {"scene.source": WAVE}).mean_electrons
    motion = {"rotate": degrees(scene["rotate"])}
    motion |= {name: f"{scene[name]!r} m/s" for name in ("x", "y")}
    moved = result(
        tmp_path,
        {"scene.source": WAVE | {"motion": motion}},
        {"scene.camera_motion": {name: degrees(speed) for name, speed in turn.items()}},
        exposure(direction),
    )

    def position(z, t):
        camera_shift = (-turn["pan"] + 1j * turn["tilt"]) * IMAGE * t
        scene_shift = (scene["x"] + 1j * scene["y"]) * SCALE * t
        within = (z - camera_shift) * np.exp(1j * turn["roll"] * t) - scene_shift
        return within * np.exp(-1j * scene["rotate"] * t)

    def turned(t):
        return (scene["rotate"] - turn["roll"]) * t

    truth = seen(still, position, turned, direction)
    error = rms(moved.mean_electrons - truth) / truth.max()
    assert error < PLACES + INSTANTS
    assert moved.frame.spectrum.sub_exposures >= 4
    # The same with the turn taken away differs by far more: the test would see it.
    assert rms(moved.mean_electrons - still) > 100 * error * truth.max()


def test_lines_across_columns_see_a_scene_that_passes_by(tmp_path):
    """A shutter that rolls to the left or right: even motion, one look for every column."""
    still = result(tmp_path, {"scene.source": WAVE}).mean_electrons
    motion = {"x": "0.3 m/s", "y": "-0.4 m/s"}
    for direction in ("left", "right"):
        moved = result(tmp_path, {"scene.source": WAVE | {"motion": motion}}, exposure(direction))
        truth = seen(still, lambda z, t: z - (0.3 - 0.4j) * SCALE * t, direction=direction)
        assert rms(moved.mean_electrons - truth) < PLACES * truth.max()
        assert moved.frame.spectrum.sub_exposures == 1


FINE = 8
"""Samples of a picture along each side of a pixel."""


def picture(file: Path, turn: float) -> dict:
    """Stripes and discs with sharp edges, turned clockwise, as samples of an image file.

    A sample on an edge is covered as far as the edge's distance says. What turns in at the border
    is drawn too, unlike what a moving picture has there.
    """
    x = (np.arange(COLUMNS * FINE) + 0.5) / FINE - COLUMNS / 2
    y = (np.arange(ROWS * FINE) + 0.5) / FINE - ROWS / 2
    z = (x[None, :] + 1j * y[:, None]) * np.exp(-1j * turn)

    def covered(distance):
        return np.clip(0.5 + distance * FINE, 0, 1)

    out = 0.2 + 0.5 * covered(3 - np.abs((z.real + 1) % 13.7 - 6.85)) * covered(3 - z.imag)
    for center, radius in ((10 + 12j, 7.0), (-14 + 10j, 5.0), (15 - 8j, 3.0)):
        out += covered(radius - np.abs(z - center)) * (0.95 - out)
    image = oiio.ImageOutput.create(str(file))
    image.open(str(file), oiio.ImageSpec(out.shape[1], out.shape[0], 1, "float"))
    image.write_image(np.ascontiguousarray(out[..., None], np.float32))
    image.close()
    named = {"kind": "image", "file": str(file), "model": "reflectance", "encoding": "linear"}
    return {"scene.source": named}


@pytest.fixture(scope="module")
def turned_by_hand(tmp_path_factory) -> np.ndarray:
    """The mean of still frames of that picture at 24 instants."""
    folder = tmp_path_factory.mktemp("instants")
    nodes, weights = np.polynomial.legendre.leggauss(24)
    frames = [
        result(folder, picture(folder / "still.exr", SPIN * TIME * node / 2)).mean_electrons
        for node in nodes
    ]
    return np.tensordot(weights / 2, frames, axes=1)


@pytest.mark.parametrize("preset", [0.02, 0.005, 0.001])
def test_a_picture_that_turns_is_the_mean_of_pictures_turned_by_hand(
    preset, turned_by_hand, tmp_path
):
    """Sharp edges, 24 instants, each a still frame: within the promise of every preset."""
    truth = turned_by_hand
    source = picture(tmp_path / "moving.exr", 0.0)
    source["scene.source"]["motion"] = {"rotate": degrees(SPIN)}
    found = result(tmp_path, source, {"accuracy": preset})
    inner = (slice(6, -6), slice(6, -6))  # elsewhere mirror images turn in
    error = (found.mean_electrons - truth)[inner]
    # 24 instants and the samples of the pictures leave 1e-4 of it.
    assert rms(error) < (preset + 1e-4) * truth.max()
    assert found.frame.spectrum.sub_exposure_error < 0.2 * preset


def test_a_turn_in_a_sequence_turns_the_photodetectors_with_the_camera(tmp_path):
    """After an eighth of a turn waves that lay along rows lie along the diagonal."""
    still = result(tmp_path, {"scene.source": WAVE}).mean_electrons
    eighth = {"scene.source": WAVE | {"motion": {"rotate": "45 deg/s"}}}
    reference = TIME / 2
    found = result(
        tmp_path, eighth, exposure(None, start="1 s", reference=f"{reference!r} s")
    ).mean_electrons
    speed = math.pi / 4
    truth = seen(
        still,
        lambda z, t: z * np.exp(-1j * speed * t),
        lambda t: speed * t,
        start=1 - reference,
    )
    assert rms(found - truth) < 2 * PLACES * truth.max()


def test_the_plan_weighs_a_turn(tmp_path):
    """Left out before an even field; on, and priced, before a picture without a bound."""
    states = []
    chart = {"kind": "chart", "chart": "siemens-star"}
    for source, speed in (
        ({"kind": "chart", "chart": "uniform"}, SPIN),
        (chart, SPIN * 1e-4),
        (chart, SPIN),
    ):
        changes = {"effects": "auto", "accuracy": "standard"}
        moving = {"scene.source": source | {"motion": {"rotate": degrees(speed)}}}
        found = result(tmp_path, changes, moving)
        states += [d.state for d in found.frame.plan.decisions if d.name == "motion"]
    assert states == ["off", "on", "on"]
    assert any("sub-exposures of the still image" in note for note in found.notes)


def test_without_turning_the_bytes_are_those_of_a_still_scene(tmp_path):
    source = {"kind": "chart", "chart": "siemens-star"}
    still = result(tmp_path, {"scene.source": source}).electrons
    stopped = {"scene.source": source | {"motion": {"rotate": "0 deg/s"}}}
    at_rest = {"scene.camera_motion": {"roll": "0 deg/s"}}
    assert result(tmp_path, stopped, at_rest).electrons.tobytes() == still.tobytes()
