"""Optical low-pass filters: displaced copies of the image, against their closed forms."""

import math

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import load, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.optics.low_pass import LowPass, LowPassAlongAxes, ObliqueLowPass
from vcam_cli.effects.optics.turned_transfer import TurnedTransfer
from vcam_cli.errors import BadInput

FREQUENCY = 62.5e3
"""Of a wave along the rows, twenty whole periods on the array [cycles/m]."""
WAVE = {"kind": "chart", "chart": "sinusoid", "frequency": "62.5 lp/mm", "contrast": 1, "mean": 0.5}
SEEN = {
    "scene.source": WAVE,
    "scene.radiance": radiance_for(2000),
    "effects": QUIET,
    "accuracy": {"preset": "reference", "float_width": 64},
}
SPLIT = ("both", "x", "y", "diagonal")


def filtered(displacement: str, axes: str = "both") -> dict:
    return {"optics.low_pass": {"displacement": displacement, "axes": axes}}


def mean(folder, *changes: dict) -> np.ndarray:
    merged = dict(SEEN)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged)).mean_electrons


def effect(folder, axes: str, displacement: str = "4 um"):
    made = camera(folder, filtered(displacement, axes))
    return LowPass.from_camera(made, geometry(made))


def amplitude(signal: np.ndarray) -> float:
    """That of the wave, with the sign of its phase on the first column."""
    spectrum = np.fft.rfft(signal.mean(axis=0)) / signal.shape[1]
    return float(2 * abs(spectrum[20]))


@pytest.mark.parametrize("layers", [False, True], ids=["flat", "out of focus before white"])
@pytest.mark.parametrize(
    ("axes", "along_x"),
    [("both", 1.0), ("x", 1.0), ("y", 0.0), ("diagonal", 1 / math.sqrt(2))],
)
def test_a_wave_keeps_the_cosine_of_half_its_phase_between_the_copies(
    axes, along_x, layers, tmp_path
):
    scene = {}
    if layers:
        white = {"source": {"kind": "chart", "chart": "uniform"}, "distance": "1 m"}
        both = [{"source": WAVE, "distance": "0.8 m"}, white]
        scene = {"scene.source": {"kind": "layers", "layers": both}, "accuracy": "standard"}
    sharp = amplitude(mean(tmp_path, scene))
    soft = amplitude(mean(tmp_path, scene, filtered("5.3 um", axes)))
    expected = math.cos(math.pi * FREQUENCY * 5.3e-6 * along_x)
    # the wave is exact; a layer is sampled within half a percent of full signal
    assert soft == pytest.approx(expected * sharp, abs=0.005 * sharp if layers else 1e-6 * sharp)


def test_nothing_is_left_of_a_wave_of_half_a_cycle_per_displacement(tmp_path):
    assert amplitude(mean(tmp_path, filtered("8 um"))) < 1e-9 * amplitude(mean(tmp_path))


@pytest.mark.parametrize("axes", SPLIT)
def test_light_is_kept(axes, tmp_path):
    even = {"scene.source": {"kind": "chart", "chart": "uniform"}}
    kept = mean(tmp_path, even, filtered("6 um", axes))
    np.testing.assert_allclose(kept, mean(tmp_path, even), rtol=1e-9)


@pytest.mark.parametrize("axes", SPLIT)
def test_bounds_of_what_it_takes(axes, tmp_path):
    """The plan's bound, by the mean distance of the copies, and that of low frequencies."""
    found = effect(tmp_path, axes)
    fx, fy = np.linspace(-3e5, 3e5, 41), np.linspace(-3e5, 3e5, 40)
    if isinstance(found, LowPassAlongAxes):
        otf = np.outer(found.along_y(fy), found.along_x(fx))
    else:
        otf = found.otf_plane(fx, fy, 550e-9)
    length = np.hypot(fx, fy[:, None])
    (spread,) = found.spread(np.array([550e-9]))
    assert spread == pytest.approx(2e-6 * (math.sqrt(2) if axes == "both" else 1))
    assert found.reach == pytest.approx(spread)
    assert np.all(np.abs(1 - otf) <= 2 * math.pi * length * spread + 1e-12)
    assert np.all(np.abs(1 - otf) <= (math.pi * length * 4e-6) ** 2 / 2 + 1e-12)
    copies = [np.exp(-2j * np.pi * (fx * x + fy[:, None] * y)) for x, y in found.copies.T]
    np.testing.assert_allclose(otf, np.mean(copies, axis=0), atol=1e-12)


def test_a_turned_scene_meets_it_as_any_other_blur_along_axes():
    still = LowPassAlongAxes(((3e-6, 0.0), (0.0, 2e-6)))
    turned, fx, fy = still.seen_by_turned(0.4), np.linspace(-2e5, 2e5, 9), np.linspace(0, 2e5, 7)
    expected = TurnedTransfer(still, 0.4)
    np.testing.assert_allclose(
        turned.otf_plane(fx, fy, 550e-9), expected.otf_plane(fx, fy, 550e-9), atol=1e-12
    )
    across = math.cos(0.3), math.sin(0.3)
    np.testing.assert_allclose(
        turned.otf_along(fx, across, 550e-9), expected.otf_along(fx, across, 550e-9), atol=1e-12
    )


def test_a_diagonal_is_a_turned_axis():
    along_x = LowPassAlongAxes(((4e-6, 0.0),)).seen_by_turned(-math.pi / 4)
    diagonal = ObliqueLowPass(((4e-6 / math.sqrt(2),) * 2,))
    np.testing.assert_allclose(along_x.plates, diagonal.plates, atol=1e-18)


def test_false_color_of_a_star_falls(tmp_path):
    """Colors that a gray star gets by aliasing, rms."""
    star = (
        *("scene.source={kind: chart, chart: siemens-star}", "optics.f_number=2", "quality=[]"),
        *("array.rows=60", "array.columns=80"),
    )

    def false_color(*sets: str) -> float:
        render = simulate(load("starter", (*star, *sets))).render.astype(float)
        return float(np.sqrt(np.mean(np.square(render - render.mean(axis=2, keepdims=True)))))

    assert false_color("optics.low_pass={displacement: 4 um}") < 0.5 * false_color()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"displacement": "-1 um"}, "displacement"),
        ({"displacement": "2 um", "axes": "z"}, "axes"),
        ({"axes": "x"}, "displacement"),
        ("yes", "low_pass"),
    ],
)
def test_a_wrong_filter_is_refused_at_its_place(given, said, tmp_path):
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, {"optics.low_pass": given})
