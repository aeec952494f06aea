"""Files for ISETCam: read by SciPy, their numbers against closed forms; read back as a scene.

The names of variables and fields are those that ISETCam's vcLoadObject, sceneGet, oiGet and
sensorGet look up (ISET/isetcam on GitHub).
"""

import math

import numpy as np
import pytest
from making import GONE, LIGHT, PLANCK, camera
from scipy.io import loadmat

from vcam_cli import BadInput, simulate
from vcam_cli.simulation import checks

WORKING = 4 * 1.0 / (1.0 - 5e-3)
CONE = math.pi / (1 + 4 * WORKING**2)
"""Irradiance on the axis per radiance of the plain camera, eq 2.18 [sr]."""
BAND = 400e-9
"""Wavelengths simulated [m]."""
FILES = {
    "scene.illuminant": "equal-energy",
    "scene.wavelengths": {"step": "20 nm"},
    "output.isetcam": True,
    "output.render": "none",
}


def written(folder, changes=None):
    result = simulate(camera(folder, FILES | (changes or {})))
    return result, result.save(folder / "out")


def struct(path, name):
    return loadmat(path, squeeze_me=True, struct_as_record=False)[name]


def photons(watts_per_m, nm):
    """Photons per second and nanometer."""
    return watts_per_m * 1e-9 * nm * 1e-9 / (PLANCK * LIGHT)


def test_a_uniform_scene_has_the_photons_of_the_closed_forms(tmp_path):
    """0.1 W/(sr m2) of even light over 400 nm; 1e-6: 32 bits."""
    _, out = written(tmp_path)
    nm = np.arange(380, 781, 20.0)
    scene, image = (
        struct(out / "scene.mat", "scene"),
        struct(out / "irradiance.mat", "opticalimage"),
    )
    assert (scene.type, image.type) == ("scene", "opticalimage")
    for found, level in ((scene, 0.1), (image, 0.1 * CONE)):
        np.testing.assert_allclose(found.spectrum.wave, nm)
        assert found.data.photons.shape == (48, 64, 21)
        expected = np.broadcast_to(photons(level / BAND, nm), (48, 64, 21))
        np.testing.assert_allclose(found.data.photons, expected, rtol=1e-6)
        # 64 pixels of 5 um, 5 mm / (1 - 5 mm / 1 m) behind the lens
        half = math.atan(32 * 5e-6 / (5e-3 / (1 - 5e-3)))
        assert found.wAngular == pytest.approx(math.degrees(2 * half))
    np.testing.assert_allclose(scene.illuminant.data.photons, photons(0.1 / BAND, nm), rtol=1e-9)
    assert scene.distance == 1.0
    assert (image.optics.fNumber, image.optics.focalLength) == (4.0, 0.005)
    np.testing.assert_array_equal(image.depthMap, np.ones((48, 64)))


def test_the_sensor_has_volts_codes_and_its_mosaic(tmp_path):
    color = {"array.pattern": "bayer-grbg", "array.filters": {"R": 0.2, "G": 0.9, "B": 0.5}}
    result, out = written(tmp_path, color | {"processing": GONE})
    sensor = struct(out / "volts.mat", "isa")
    np.testing.assert_allclose(sensor.data.volts, result.electrons * 20e-6, rtol=1e-6)
    np.testing.assert_array_equal(sensor.data.dv, result.dn)
    assert list(sensor.color.filterNames) == ["R", "G", "B"]
    assert sensor.cfa.pattern.tolist() == [[2, 1], [3, 2]]  # MATLAB counts from 1
    assert (sensor.rows, sensor.cols, sensor.integrationTime) == (48, 64, 0.01)
    assert sensor.pixel.width == 5e-6
    side = 5e-6 * math.sqrt(0.5)
    assert sensor.pixel.pdWidth == pytest.approx(side)
    assert sensor.pixel.pdXpos == pytest.approx((5e-6 - side) / 2)
    assert sensor.pixel.voltageSwing == pytest.approx(2.0)


def test_the_scene_that_is_written_is_the_scene_that_is_read(tmp_path):
    """Out and in again: the same electrons. Colors of smooth spectra, by bands of 5 nm."""
    chart = {
        "scene.source": {"kind": "chart", "chart": "step-wedge"},
        "scene.wavelengths": {"step": "5 nm"},
        "effects": {name: "off" for name in ("shot_noise", "diffraction", "pixel_aperture")},
        "scene.illuminant": {"blackbody": "3000 K"},
    }
    first, out = written(tmp_path, chart)
    source = {"kind": "hyperspectral", "file": str(out / "scene.mat")}
    again = chart | {"scene.source": source, "scene.illuminant": GONE}
    second = simulate(camera(tmp_path, FILES | again))
    # Bands of 5 nm are straight between their nodes; a black body bends by less than 1e-4 there.
    close = np.isclose(second.mean_electrons, first.mean_electrons, rtol=3e-4)
    # A sample stands for its whole pixel where an edge of the chart runs through it.
    assert close.mean() > 0.8


def test_the_same_camera_gives_the_same_bytes(tmp_path):
    names = ("scene.mat", "irradiance.mat", "volts.mat")
    first = [(written(tmp_path)[1] / name).read_bytes() for name in names]
    assert [(written(tmp_path)[1] / name).read_bytes() for name in names] == first


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"array.pattern": "honeycomb", "array.filters": "generic-rgb"},
            "only pixels in rows and columns",
        ),
        (
            {"pixel.readout": {"full_well": "10 ke"}, "pixel.photodetector.fill_factor": 0.5},
            "hold volts, which are unknown",
        ),
    ],
)
def test_what_the_structures_cannot_hold_is_refused(changes, why, tmp_path):
    camera(tmp_path, FILES | changes)
    with pytest.raises(BadInput, match=rf"output\.isetcam.*{why}"):
        checks.load(tmp_path / "made.yaml")
