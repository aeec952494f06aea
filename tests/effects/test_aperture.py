"""Cameras whose aperture is no circle, against sums over points of it."""

import math

import numpy as np
import pytest
from layered_reference import changes, pupil_sum, random_scene, write_exr
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.errors import BadInput

SHAPE = {"blades": 5, "rotation": "12 deg", "obscuration": "30 %"}
SIDE, PITCH = 48, 5e-6
FEW = 1e-3
"""Of full signal, rms: what sums over few points err; 6e-4 between 600 and 1200 of them."""
SHIFT = 400e-6
"""Of the image plane: at f/4 a point becomes 100 um wide, of which diffraction is a small part."""
QUIET_STAR = {
    "array": {"rows": SIDE, "columns": SIDE, "pattern": "monochrome"},
    "pixel.photodetector": {"fill_factor": 1, "quantum_efficiency": 0.5},
    "pixel.readout.full_well": "1000 Me",
    "pixel.readout.conversion_gain": "1 nV/e",
    "scene.radiance": radiance_for(1e6),
    "scene.distance": "infinity",
    "effects": QUIET,
    "accuracy": "standard",
}


def star(folder) -> dict:
    """One bright sample the size of a pixel, in the middle of the array."""
    light = np.zeros((SIDE + 1, SIDE + 1))
    light[SIDE // 2, SIDE // 2] = 1.0
    return {"kind": "image", "file": write_exr(folder / "star.exr", light)}


def inside(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Whether points lie in the shape: between a pentagon's sides, around the obscuration."""
    found = x**2 + y**2 >= 0.09
    for k in range(5):
        middle = math.radians(12) + (2 * k + 1) * math.pi / 5
        found &= x * math.cos(middle) + y * math.sin(middle) <= math.cos(math.pi / 5)
    return found


def diffracted(sign: int) -> np.ndarray:
    """The star through the aperture as waves, a sum over points of it: (rows, columns), sum 1."""
    u = (np.arange(400) + 0.5) / 200 - 1
    x, y = np.meshgrid(u, u)
    turns = sign * SHIFT / (8 * 4**2 * 550e-9) * (x**2 + y**2)
    light = inside(x, y) * np.exp(2j * np.pi * turns)
    parts = 4
    at = ((np.arange(parts * SIDE) + 0.5) / parts - SIDE / 2) * PITCH
    waves = np.exp(-2j * np.pi / (2 * 4 * 550e-9) * np.outer(at, u))
    found = np.abs(waves @ light @ waves.T) ** 2
    box = np.ones(parts) / parts  # of the star
    for axis in (0, 1):
        found = np.apply_along_axis(np.convolve, axis, found, box)
    found = (found[1:-2] + found[2:-1])[:, 1:-2] + (found[1:-2] + found[2:-1])[:, 2:-1]
    found = found.reshape(SIDE, parts, SIDE, parts).sum(axis=(1, 3))
    return found / found.sum()


@pytest.mark.parametrize("sign", [1, -1])
def test_out_of_focus_a_point_becomes_the_aperture(tmp_path, sign):
    changes = QUIET_STAR | {"optics.defocus": f"{sign * SHIFT * 1e6} um", "optics.aperture": SHAPE}
    found = simulate(camera(tmp_path, changes | {"scene.source": star(tmp_path)})).electrons
    expected = diffracted(sign)
    # Rays have crossed where the image plane lies in front of the sensor: the shape is turned.
    assert np.abs(expected - diffracted(-sign)).sum() > 0.1
    assert np.abs(found / found.sum() - expected).sum() < 0.02


@pytest.mark.parametrize(
    ("seed", "sharp"), [(1, True), pytest.param(3, False, marks=pytest.mark.long)]
)
def test_layers_are_a_sum_over_points_of_the_aperture(tmp_path, seed, sharp):
    """One of two in focus, or none: each hides the other by rays through the open parts."""
    scene = random_scene(np.random.default_rng(seed), 2, sharp)
    still = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "0.2 %"}
    given = still | changes(scene, tmp_path) | {"optics.aperture": SHAPE}
    frame = simulate(camera(tmp_path, given)).frame
    found = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)

    def error(opens, points) -> float:
        truth = pupil_sum(scene, 550e-9, points, 4, opens)
        return float(np.sqrt(np.mean(np.square(found - truth))) / truth.max())

    promised = frame.spectrum.depth.error + FEW
    assert frame.spectrum.depth.error <= 2e-3
    assert error(inside, 800) <= promised  # such a sum errs by 0.1 %, of fewer points by 0.2 %
    assert error(lambda x, y: inside(-x, -y), 100) > promised, "the test would not find it"


def test_light_is_the_circles_by_the_area(tmp_path):
    whole = geometry(camera(tmp_path, {}))
    part = geometry(camera(tmp_path, {"optics.aperture": SHAPE}))
    share = 5 / (2 * math.pi) * math.sin(2 * math.pi / 5) - 0.09
    assert part.irradiance_per_radiance == pytest.approx(whole.irradiance_per_radiance * share)
    assert part.f_number == whole.f_number
    levels = [
        float(simulate(camera(tmp_path, {"effects": QUIET, **more})).electrons.mean())
        for more in ({}, {"optics.aperture": SHAPE})
    ]
    assert levels[1] == pytest.approx(share * levels[0], rel=1e-5)


def test_in_focus_an_annulus_has_the_closed_forms_contrast(tmp_path):
    from physics.test_opening import annulus

    frequency, wavelength, f_number = 60e3, 550e-9, 16
    wave = {
        "kind": "chart",
        "chart": "sinusoid",
        "frequency": "60 lp/mm",
        "contrast": 1,
        "orientation": "0 deg",
    }
    changes = {
        "scene.source": wave,
        "scene.distance": "infinity",
        "optics.f_number": f_number,
        "optics.aperture": {"obscuration": "40 %"},
        "effects": QUIET,
    }
    found = simulate(camera(tmp_path, changes)).electrons
    x = (np.arange(found.shape[1]) - (found.shape[1] - 1) / 2) * PITCH
    basis = np.stack([np.ones(len(x)), np.cos(2 * np.pi * frequency * x)], axis=1)
    level, amplitude = np.linalg.lstsq(basis, found.mean(axis=0), rcond=None)[0]
    expected = float(annulus(np.array([frequency * wavelength * f_number]), 0.4)[0])
    expected *= np.sinc(frequency * PITCH * math.sqrt(0.5))
    assert amplitude / level == pytest.approx(expected, abs=1e-3)


def test_a_shape_that_is_a_circle_is_refused(tmp_path):
    for shape in ({}, {"rotation": "5 deg"}, {"obscuration": "30 %", "rotation": "5 deg"}):
        with pytest.raises(BadInput, match="circle"):
            camera(tmp_path, {"optics.aperture": shape})


WRONG = {
    "optics.diffraction": (False, "is simulated with diffraction"),
    "optics.zernike": ([{"field": 1, 4: "0.1 um"}], "the same all over the field"),
    "optics.aperture": ({"blades": 2}, "blades"),
    "optics.psf": ({"file": "psf.exr", "pitch": "1 um"}, "cannot be combined with psf"),
}


@pytest.mark.parametrize(("path", "change"), WRONG.items(), ids=WRONG)
def test_what_is_not_simulated_is_refused(tmp_path, path, change):
    value, said = change
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, {"optics.aperture": SHAPE, path: value})
