"""The gain of pixel vignetting: its series against the pupil itself, and in a frame."""

from dataclasses import replace

import numpy as np
import pytest
from every import every
from making import QUIET, camera, long_except

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry, pixel_centers
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel.pixel_vignetting import PixelVignetting, _series

STACK = {
    "passivation": {"thickness": "0.7 um", "index": 2.0},
    "oxide": {"thickness": "3 um", "index": 1.46},
}
LARGE = {"array.rows": 1500, "array.columns": 2000, "pixel.stack": STACK}
FIELDS = {
    "like a telephone": {"pixel.width": "1.5 um", "optics.f_number": 2.8},
    "wide open": {"pixel.width": "2.5 um", "optics.f_number": 1.2},
    "stopped down": {"pixel.width": "2.5 um", "optics.f_number": 16},
    "dark corners": {
        "pixel.width": "1.2 um",
        "pixel.height": "1.7 um",
        "optics.f_number": 16,
        "optics.focal_length": "2 mm",
    },
    "microlenses": {"pixel.width": "1.5 um", "pixel.microlens": {"gain": 1.5}},
}


def effect(folder, **changes) -> PixelVignetting:
    made = camera(folder, {key.replace("__", "."): value for key, value in changes.items()})
    found = PixelVignetting.from_camera(made, geometry(made))
    assert found is not None
    return found


@pytest.mark.parametrize(
    "field", long_except(["like a telephone", "wide open", "microlenses"], FIELDS)
)
def test_the_series_agrees_with_the_pupil(field, tmp_path):
    """At random places of all quadrants: half of the tolerance anywhere, a tenth of it rms."""
    finest = effect(tmp_path, **LARGE, **FIELDS[field], accuracy="reference")
    place = np.random.default_rng(3).uniform(-1, 1, (2, 24))
    x, y = place[0] * finest.half_width, place[1] * finest.half_height
    exact = finest.exact_gain(x[None, :], y[:, None])

    def check(accuracy):
        found = effect(tmp_path, **LARGE, **FIELDS[field], accuracy=accuracy)
        error = found.gain(x, y) - exact
        assert np.abs(error).max() < found.tolerance / 2
        assert np.sqrt(np.mean(error**2)) < found.tolerance / 10
        # where the light does not end within the field a few 1e-5 are all there is
        if field in ("wide open", "microlenses"):
            assert np.abs(error).max() < 1e-4
        rounded = found.gain(x.astype(np.float32), y.astype(np.float32))
        assert rounded.dtype == np.float32
        # 32-bit places are 6e-8 of the field off, sums of up to 65 terms a few 1e-6
        np.testing.assert_allclose(rounded, found.gain(x, y), atol=1e-5)

    every(["draft", "standard", "reference"], check)


def test_some_corners_are_dark(tmp_path):
    """Else the test above has not seen light that ends in the field; and never less than none."""
    found = effect(tmp_path, **LARGE, **FIELDS["dark corners"])
    at = np.linspace(0, 1, 50)
    gain = found.gain(at * found.half_width, at * found.half_height)
    assert np.mean(gain < 1e-3) > 0.1
    assert gain.min() >= 0


def test_a_series_is_computed_once(tmp_path):
    _series.cache_clear()
    first, again = (effect(tmp_path, pixel__stack=STACK) for _ in range(2))
    places = np.zeros(3)
    first.gain(places, places)
    again.gain(places, places)
    again.mean_error(SignalLevels(1.0, 1.0))
    assert _series.cache_info().misses == 1


def test_beyond_the_array_as_at_its_border(tmp_path):
    found = effect(tmp_path, pixel__stack=STACK)
    border, y = np.array([found.half_width]), np.zeros(1)
    assert found.gain(2 * border, y) == found.gain(border, y)


@pytest.mark.parametrize("internal", [False, True])
def test_a_quantum_efficiency_of_the_silicon_loses_the_reflected_light_as_well(internal, tmp_path):
    """Straight on (8/9) (1 - (0.54 / 3.46)^2) passes; a measured efficiency has that in it."""
    found = replace(effect(tmp_path, pixel__stack=STACK), internal=internal)
    shallow = replace(found, layers=((0.0, 2.0), (0.0, 1.46)))
    passes = 8 / 9 * (1 - (0.54 / 3.46) ** 2) if internal else 1
    # f/4 and 0.2 mm off the axis: its angles lose 1e-5 more
    assert shallow.on_axis == pytest.approx(passes, rel=1e-4)


def test_nothing_but_a_stack_gives_it(tmp_path):
    made = camera(tmp_path, {"optics.exit_pupil_distance": "1 mm"})
    assert PixelVignetting.from_camera(made, geometry(made)) is None


def test_layers_like_air_without_depth_take_nothing(tmp_path):
    layer = {"thickness": "0 um", "index": 1}
    found = effect(tmp_path, pixel__stack={"passivation": layer, "oxide": layer})
    x = np.linspace(-1, 1, 9) * found.half_width
    np.testing.assert_allclose(found.gain(x, x), 1, atol=1e-9)
    assert found.mean_error(SignalLevels(1.0, 1.0)) < 1e-9


def test_the_exit_pupil_sets_the_angles(tmp_path):
    """From half the distance light comes to a pixel as it else does to one twice as far out."""
    near, far = (
        effect(
            tmp_path, pixel__stack=STACK, optics__exit_pupil_distance=d, scene__distance="infinity"
        )
        for d in ("2.5 mm", "5 mm")
    )
    assert near.cone == far.cone  # the f-number is that of the light
    x, y = np.array([[1e-4]]), np.array([[5e-5]])
    assert near.exact_gain(x, y) == pytest.approx(far.exact_gain(2 * x, 2 * y), rel=1e-12)
    auto = effect(tmp_path, pixel__stack=STACK)
    assert auto.pupil_distance == pytest.approx(5e-3 / (1 - 5e-3), rel=1e-12)  # (1 - m) f


def test_the_tunnel_stands_above_the_photodetector(tmp_path):
    """Moved in its pixel it keeps its light, in all quadrants."""
    moved = {"fill_factor": 0.3, "quantum_efficiency": 0.5, "x": "0 um", "y": "1 um"}
    centered = {"fill_factor": 0.3, "quantum_efficiency": 0.5}
    one, other = (
        effect(tmp_path, pixel__stack=STACK, pixel__photodetector=p) for p in (moved, centered)
    )
    assert one == other
    x = np.linspace(0, 1, 5) * one.half_width
    np.testing.assert_allclose(one.gain(x, x), one.gain(-x, -x)[:, :], rtol=1e-12)


def test_a_frame_is_darker_by_the_gain(tmp_path):
    """A plain scene: without the effect, times the gain at the pixels' centers."""
    changes = {"pixel.stack": STACK, "optics.focal_length": "1 mm"}
    on = simulate(camera(tmp_path, changes | {"effects": QUIET}))
    off = simulate(camera(tmp_path, changes | {"effects": QUIET | {"pixel_vignetting": "off"}}))
    found = PixelVignetting.from_camera(on.frame.camera, on.frame.geometry)
    x, y = pixel_centers(on.frame.geometry)
    expected = off.mean_electrons * found.exact_gain(x[None, :], y[:, None])
    np.testing.assert_allclose(on.mean_electrons, expected, rtol=1e-4)
    assert on.mean_electrons.min() < 0.9 * on.mean_electrons.max()


def test_the_bound_is_the_loss_of_a_plain_field(tmp_path):
    """Full signal is what the brightest pixel has behind its tunnel; without it all have more."""
    found = effect(tmp_path, **LARGE, **FIELDS["wide open"])
    x = np.linspace(-1, 1, 301) * found.half_width
    y = np.linspace(-1, 1, 301) * found.half_height
    gain = found.gain(x, y)
    change = (1 - gain) / gain.max()
    rms = float(np.sqrt(np.mean(change**2)))
    assert rms <= found.mean_error(SignalLevels(1.0, 1.0)) * 1.01 <= rms * 1.02


def test_it_says_what_is_lost_where(tmp_path):
    """The small pixel of the pixel size study: 30 % in the corner of its die."""
    study = {
        "pixel.stack": {
            "passivation": {"thickness": "0 um", "index": 2},
            "oxide": {"thickness": "3.22 um", "index": 1.46},
        },
        "pixel.width": "6 um",
        "pixel.photodetector.fill_factor": (2.6177 / 6) ** 2,
        "optics": {"f_number": 1.2, "focal_length": "8 mm"},
        "scene.distance": "infinity",
        "array": {"die": {"width": "2.7136 mm", "height": "2.7136 mm"}, "pattern": "monochrome"},
    }
    said = effect(tmp_path, **study).describe()
    # 1 - 0.63861 / 0.86724, from the oracle's table of the first case
    assert said.startswith("blocks 26.4 % of the light in the center, 30")
    assert said.endswith(" % in the corners")
