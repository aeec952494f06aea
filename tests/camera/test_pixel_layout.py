"""What lies above the photodetector: where light is collected, and what is refused."""

import math

import numpy as np
import pytest
from making import camera

from vcam_cli.camera.derived import pixel_layout
from vcam_cli.camera.derived.geometry import geometry, pixel_centers
from vcam_cli.errors import BadInput

THICK = {
    "passivation": {"thickness": "0.5 um", "index": 2.0},
    "oxide": {"thickness": "4.5 um", "index": 1.46},
}


def solved(folder, **changes):
    return geometry(camera(folder, {k.replace("__", "."): v for k, v in changes.items()}))


def test_without_a_microlens_the_photodetector_collects(tmp_path):
    pd = {"width": "3 um", "height": "1 um", "x": "0.5 um", "y": "3.5 um"}
    g = solved(tmp_path, pixel__photodetector=pd | {"quantum_efficiency": 0.5}, pixel__stack=THICK)
    assert (g.collecting_width, g.collecting_height) == (g.detector_width, g.detector_height)
    assert (g.collecting_x, g.collecting_y) == (g.detector_x, g.detector_y)
    assert g.sampling_scale == 1
    x, y = pixel_centers(g, detector=True)
    cells = pixel_centers(g)
    np.testing.assert_allclose(x - cells[0], -0.5e-6, rtol=1e-6)
    np.testing.assert_allclose(y - cells[1], 1.5e-6, rtol=1e-6)


def test_a_microlens_collects_in_the_middle_in_the_pixels_shape(tmp_path):
    """Wherever the photodetector lies: the lens is made to reach it."""
    pd = {"width": "3 um", "height": "1 um", "x": "0.5 um", "y": "3 um"}
    g = solved(
        tmp_path,
        pixel__photodetector=pd | {"quantum_efficiency": 0.5},
        pixel__height="4 um",
        pixel__microlens={"efficiency": 0.81},
    )
    assert (g.collecting_width, g.collecting_height) == pytest.approx((4.5e-6, 3.6e-6), rel=1e-12)
    assert (g.collecting_x, g.collecting_y) == (0, 0)
    assert g.effective_fill_factor == pytest.approx(0.81, rel=1e-12)
    assert (g.detector_width, g.fill_factor) == pytest.approx((3e-6, 0.15), rel=1e-12)
    report = g.report(1)
    assert report["effective_fill_factor"] == pytest.approx(0.81, rel=1e-12)
    assert report["photodetector_area"] == pytest.approx(3e-12, rel=1e-12)


@pytest.mark.parametrize("lens", ["none", {"gain": 1.5}])
def test_an_exit_pupil_within_the_stack_is_refused(lens, tmp_path):
    """5 um of layers: lenses that follow the chief ray would stand in reverse order."""
    changes = {"pixel__stack": THICK, "pixel__microlens": lens}
    with pytest.raises(BadInput, match="is 5 um thick, but the exit pupil is only 5 um away"):
        solved(tmp_path, optics__exit_pupil_distance="5 um", scene__distance="infinity", **changes)
    beyond = solved(
        tmp_path, optics__exit_pupil_distance="5.1 um", scene__distance="infinity", **changes
    )
    assert beyond.sampling_scale > 0


@pytest.mark.parametrize(
    "changes",
    [
        {"pixel__microlens": {"gain": 1.5}},  # no stack to be shifted over
        {"pixel__stack": THICK},
        {"pixel__microlens": {"gain": 1.5, "shift": "centered"}, "pixel__stack": THICK},
        {
            "pixel__microlens": {"gain": 1.5},
            "pixel__stack": THICK,
            "effects": {"microlens": "off"},
        },
    ],
)
def test_lenses_stand_over_their_pixels(changes, tmp_path):
    g = solved(tmp_path, **changes)
    assert g.sampling_scale == 1
    if changes.get("effects"):
        assert g.collecting_width == g.detector_width


@pytest.mark.parametrize(
    ("degrees", "remains"), [(1.0, 1e-4), (15.0, 0.012), (25.0, 0.03), (35.0, 0.06)]
)
def test_lenses_follow_the_chief_ray(degrees, remains, tmp_path):
    """By Snell's law pixel by pixel: least squares over the array, and what they leave.

    remains: of the largest shift, up to which chief rays in the corner.
    """
    corner = math.hypot(64, 48) / 2 * 5e-6
    distance = corner / math.tan(math.radians(degrees))
    g = solved(
        tmp_path,
        pixel__microlens={"gain": 1.5},
        pixel__stack=THICK,
        optics__exit_pupil_distance=f"{distance!r} m",
    )
    x, y = np.meshgrid(*pixel_centers(g))
    radius = np.hypot(x, y)
    sine = np.sin(np.arctan(radius / distance))
    shift = 0.5e-6 * np.tan(np.arcsin(sine / 2)) + 4.5e-6 * np.tan(np.arcsin(sine / 1.46))
    kappa = (shift * radius).sum() / (radius**2).sum()
    # sums over 48 x 64 pixels are an integral to 1 / (12 x 48^2) of its curvature
    assert 1 - g.sampling_scale == pytest.approx(kappa, rel=1e-4)
    left = np.abs(shift - (1 - g.sampling_scale) * radius).max()
    assert left < remains * shift.max()
    assert left < 0.12e-6
    toward = pixel_centers(g, detector=True)[0] - pixel_centers(g)[0]
    assert toward[0] > 0 > toward[-1]


@pytest.mark.parametrize(
    ("lens", "fill_factor", "key"),
    [
        ({"gain": 1.5}, 0.96, "gain"),
        ({"efficiency": 0.3}, 0.5, "efficiency"),
        ({"efficiency": 0}, 0.5, "efficiency"),
    ],
)
def test_a_microlens_that_loses_light(lens, fill_factor, key, tmp_path):
    changes = {"pixel.microlens": lens, "pixel.photodetector.fill_factor": fill_factor}
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, changes)
    [problem] = caught.value.problems
    assert problem.path == ("pixel", "microlens", key)
    assert "less than the photodetector's own" in problem.message
    assert f"an efficiency of at least {fill_factor:g}" in problem.remedy
    assert "made.yaml:" in problem.where


@pytest.mark.parametrize("lens", [{"gain": 1}, {"efficiency": 0.5}])
def test_as_much_as_the_photodetector_is_enough(lens, tmp_path):
    g = solved(tmp_path, pixel__microlens=lens)
    assert g.effective_fill_factor == pytest.approx(0.5, rel=1e-12)


def test_layers_from_the_air_down(tmp_path):
    assert pixel_layout.layers(camera(tmp_path)) == ()
    made = camera(tmp_path, {"pixel.stack": THICK})
    np.testing.assert_allclose(pixel_layout.layers(made), ((0.5e-6, 2), (4.5e-6, 1.46)))


def test_the_exit_pupil_is_where_the_file_says(tmp_path):
    assert solved(tmp_path, optics__exit_pupil_distance="7 mm").exit_pupil_distance == 7e-3
    auto = solved(tmp_path)
    assert auto.exit_pupil_distance == auto.image_distance
    assert auto.report(1)["exit_pupil_distance"] == auto.image_distance
