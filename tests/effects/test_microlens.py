"""A microlens: the light it collects, the area it averages over, where that area stands."""

import math

import numpy as np
import pytest
from making import QUIET, camera

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry, pixel_centers
from vcam_cli.effects.pixel.microlens import Microlens

STACK = {
    "passivation": {"thickness": "1 um", "index": 2.0},
    "oxide": {"thickness": "9 um", "index": 1.46},
}
QUIETLY = {"effects": QUIET}


def mean_of(folder, changes) -> np.ndarray:
    return simulate(camera(folder, QUIETLY | changes)).mean_electrons


def grating(frequency: str) -> dict:
    wave = {"kind": "chart", "chart": "sinusoid", "contrast": 1, "mean": 0.5}
    return {"scene.source": wave | {"frequency": frequency}}


def test_a_pixels_efficiency_has_the_lens_in_it(tmp_path):
    """What makers print is of the whole pixel, its lens included: no second time."""
    bare = {"pixel.photodetector": {"fill_factor": 0.3, "quantum_efficiency": {"pixel": 0.5}}}
    with_lens = mean_of(tmp_path, bare | {"pixel.microlens": {"efficiency": 0.9}})
    np.testing.assert_allclose(with_lens, mean_of(tmp_path, bare), rtol=1e-12)


@pytest.mark.parametrize(
    ("lens", "fill_factor", "share"),
    [
        ({"gain": 1.8}, 0.5, 0.9),
        ({"gain": 2.5}, 0.5, 0.95),  # never more
        ({"gain": 1}, 0.5, 0.5),
        ({"efficiency": 0.8}, 0.25, 0.8),
        ({"efficiency": 1}, 0.25, 1.0),
        ({"gain": 3, "shift": "centered"}, 0.3, 0.9),
    ],
)
def test_it_collects_the_light_of_its_area(lens, fill_factor, share, tmp_path):
    """A plain scene: as many times the light as the area is larger."""
    bare = {"pixel.photodetector.fill_factor": fill_factor}
    ratio = mean_of(tmp_path, bare | {"pixel.microlens": lens}) / mean_of(tmp_path, bare)
    np.testing.assert_allclose(ratio, share / fill_factor, rtol=1e-9)
    g = geometry(camera(tmp_path, bare | {"pixel.microlens": lens}))
    assert g.effective_fill_factor == pytest.approx(share, rel=1e-12)
    assert g.fill_factor == pytest.approx(fill_factor, rel=1e-12)


def test_its_area_is_the_aperture(tmp_path):
    """Waves of 62.5 lp/mm fade as sinc of 4.5 um and not of the photodetector's 2.5 um."""
    wave = grating("62.5 lp/mm") | {"optics.diffraction": False}
    wave["pixel.photodetector.fill_factor"] = 0.25
    lens = {"pixel.microlens": {"efficiency": 0.81}}

    def contrast(changes: dict) -> float:
        signal = mean_of(tmp_path, changes)
        return float(np.ptp(signal) / 2 / signal.mean())

    expected = np.sinc(62.5e3 * 4.5e-6) / np.sinc(62.5e3 * 2.5e-6)
    assert contrast(wave | lens) / contrast(wave) == pytest.approx(expected, rel=1e-9)


def test_switched_off_it_is_the_bare_photodetector(tmp_path):
    """Size and place of the aperture as well, and the tunnel sees the whole angle again."""
    there = grating("62.5 lp/mm") | {"pixel.stack": STACK, "optics.focal_length": "1 mm"}
    off = there | {"pixel.microlens": {"gain": 1.8}, "effects": QUIET | {"microlens": "off"}}
    assert mean_of(tmp_path, off).tobytes() == mean_of(tmp_path, there).tobytes()


def test_the_signal_is_sampled_where_the_lenses_stand(tmp_path):
    """A wave at the pixels' centers, and at 1 - kappa times that where lenses follow the light.

    kappa is the mean depth per tangent, weighted by the distance squared, over the distance of the
    pupil; on this small field of 9 degrees within 0.8 % of its value straight on.
    """
    scene = grating("62.5 lp/mm") | {
        "pixel.stack": STACK,
        "optics.exit_pupil_distance": "1 mm",
        "optics.diffraction": False,
        "effects": QUIET | {"pixel_vignetting": "off"},
    }
    kappa = (1e-6 / 2.0 + 9e-6 / 1.46) / 1e-3
    for shift, scale in (("centered", 1.0), ("optimal", 1 - kappa)):
        made = camera(tmp_path, scene | {"pixel.microlens": {"gain": 1.5, "shift": shift}})
        g = geometry(made)
        assert 1 - g.sampling_scale == pytest.approx(1 - scale, rel=0.008)
        signal = simulate(made).mean_electrons
        x = pixel_centers(g)[0] * g.sampling_scale
        wave = np.cos(2 * np.pi * 62.5e3 * x) * np.sinc(62.5e3 * g.collecting_width)
        expected = np.broadcast_to(signal.mean() * (1 + wave) / (1 + wave).mean(), signal.shape)
        np.testing.assert_allclose(signal, expected, rtol=1e-9)


def test_sampled_scenes_shrink_as_well(tmp_path):
    """What moves is the gradient times the shift, to second order.

    The gradient by differences of neighbors is 1 % off at 8 lp/mm.
    """
    chart = {"kind": "chart", "chart": "csf", "max_frequency": "8 lp/mm"}
    scene = {"scene.source": chart, "pixel.stack": STACK, "optics.exit_pupil_distance": "0.5 mm"}
    blurs = {"diffraction": "on", "pixel_aperture": "on"}
    quiet = {"effects": QUIET | {"pixel_vignetting": "off", "off_axis": "off"} | blurs}
    centered, optimal = (
        mean_of(tmp_path, scene | quiet | {"pixel.microlens": {"gain": 1.5, "shift": shift}})
        for shift in ("centered", "optimal")
    )
    g = geometry(camera(tmp_path, scene | {"pixel.microlens": {"gain": 1.5}}))
    x, y = pixel_centers(g)
    down, across = np.gradient(centered, y, x)
    expected = (g.sampling_scale - 1) * (across * x + down * y[:, None])
    inside = np.s_[4:-4, 4:-4]
    error = (optimal - centered - expected)[inside]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(expected[inside] ** 2))


def test_it_follows_the_chief_ray(tmp_path):
    """Optimal: hardly darker in the corners than in the center. Centered: as without a lens."""
    there = {"pixel.stack": STACK, "optics": {"f_number": 8, "focal_length": "1 mm"}}

    def corner(changes: dict) -> float:
        signal = mean_of(tmp_path, there | {"optics.off_axis": "none"} | changes)
        return float(signal[0, 0] / signal[24, 32])

    bare = corner({})
    centered = corner({"pixel.microlens": {"gain": 1.8, "shift": "centered"}})
    optimal = corner({"pixel.microlens": {"gain": 1.8}})
    assert bare < 0.7
    assert centered == pytest.approx(bare, rel=1e-9)
    assert optimal > 0.97


@pytest.mark.parametrize(("gain", "state"), [(1.0001, "off"), (1.1, "on")])
def test_the_plan_leaves_out_one_that_gains_next_to_nothing(gain, state, tmp_path):
    chosen = {"pixel.microlens": {"gain": gain}, "effects": "auto", "accuracy": "draft"}
    decisions = simulate(camera(tmp_path, chosen)).frame.plan.decisions
    assert {d.name: d.state for d in decisions}["microlens"] == state


def test_what_it_says(tmp_path):
    made = camera(tmp_path, {"pixel.microlens": {"gain": 1.8}})
    found = Microlens.from_camera(made, geometry(made))
    assert found.describe() == "1.8 times the light; effective fill factor 90 %"
    assert found.on_axis == pytest.approx(1.8)
    assert math.isclose(found.share, 0.9)
