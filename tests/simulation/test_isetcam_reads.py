"""ISETCam itself reads scene.mat, irradiance.mat and volts.mat back, in Octave.

Skipped without Octave (octave-cli, with its image package) or without ISETCam: the variable
VCAM_ISETCAM names a folder that holds it.
"""

import os
import shutil
import subprocess

import numpy as np
import pytest
from making import LIGHT, PLANCK, camera

from vcam_cli import simulate

ISETCAM = os.environ.get("VCAM_ISETCAM", "")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not shutil.which("octave-cli"), reason="Octave is not installed here"),
    pytest.mark.skipif(not ISETCAM, reason="VCAM_ISETCAM names no folder of ISETCam"),
]
PHOTODETECTOR = {"width": "3 um", "height": "4 um", "x": "1 um", "y": "0.5 um"}
CAMERA = {
    "scene.illuminant": "equal-energy",
    "scene.wavelengths": {"step": "20 nm"},
    "array.pattern": "bayer-grbg",
    "array.filters": {"R": 0.2, "G": 0.9, "B": 0.5},
    "pixel.photodetector": {**PHOTODETECTOR, "quantum_efficiency": 0.5},
    "output.isetcam": True,
    "output.render": "none",
}
SCRIPT = """
pkg load image
warning('off', 'all');
addpath(genpath('{isetcam}'));
say = @(name, value) printf('%s %s\\n', name, sprintf('%.9g ', double(value)));
load('scene.mat'); load('irradiance.mat'); load('volts.mat');
say('scene.wavelengths', sceneGet(scene, 'wave'));
say('scene.distance', sceneGet(scene, 'distance'));
say('scene.illuminant', sceneGet(scene, 'illuminant photons'));
photons = sceneGet(scene, 'photons');
say('scene.photons', photons(24, :, 6));
oi = opticalimage;
photons = oiGet(oi, 'photons');
say('image.photons', photons(24, :, 6));
say('image.spacing', oiGet(oi, 'sample spacing'));
say('image.f_number', oiGet(oi, 'optics fnumber'));
say('sensor.electrons', sensorGet(isa, 'electrons'));
say('sensor.codes', sensorGet(isa, 'dv'));
say('sensor.mosaic', sensorGet(isa, 'pattern'));
say('sensor.time', sensorGet(isa, 'exp time'));
say('sensor.pixel', sensorGet(isa, 'pixel size'));
say('sensor.fill_factor', pixelGet(isa.pixel, 'fill factor'));
say('sensor.photodetector', pixelGet(isa.pixel, 'pd position'));
own = oiSet(oiCreate(), 'optics fnumber', oiGet(oi, 'optics fnumber'));
own = oiSet(own, 'optics focal length', oiGet(oi, 'optics focal length'));
own = oiCompute(scene, oiSet(own, 'optics offaxis method', 'skip'));
photons = oiGet(own, 'photons');
margin = (size(photons)(1:2) - size(oiGet(oi, 'photons'))(1:2)) / 2;
say('own.photons', photons(margin(1) + 24, margin(2) + (1:64), 6));
"""


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """The result of steps of gray, and what ISETCam reads in its files: name -> numbers."""
    return read_back(tmp_path_factory.mktemp("steps"), "step-wedge")


def read_back(folder, chart):
    result = simulate(camera(folder, CAMERA | {"scene.source": {"kind": "chart", "chart": chart}}))
    out = result.save(folder / "out")
    (out / "read_back.m").write_text(SCRIPT.format(isetcam=ISETCAM))
    command = ["octave-cli", "--no-gui", "-q", "read_back.m"]
    done = subprocess.run(command, cwd=out, capture_output=True, text=True, check=False)
    found = {}
    for line in done.stdout.splitlines():
        name, *numbers = line.split()
        if "." in name:
            found[name] = np.array(numbers, float)
    assert "own.photons" in found, done.stderr
    return result, found


def test_isetcam_reads_the_scene_that_was_lit(read):
    """Steps of gray in 0.1 W/(sr m2) of even light over 400 nm, at 480 nm; 1e-6: 32 bits."""
    _, found = read
    nm = np.arange(380, 781, 20.0)
    np.testing.assert_allclose(found["scene.wavelengths"], nm)
    per_watt = 1e-9 * nm * 1e-9 / (PLANCK * LIGHT)
    white = 0.1 / 400e-9 * per_watt
    np.testing.assert_allclose(found["scene.illuminant"], white, rtol=1e-6)
    assert found["scene.photons"].max() == pytest.approx(white[5], rel=1e-6)
    assert np.ptp(found["scene.photons"]) > white[5] / 2
    assert found["scene.distance"] == 1


def test_isetcam_reads_samples_a_pixel_apart(read):
    _, found = read
    np.testing.assert_allclose(found["image.spacing"], 5e-6, rtol=1e-6)
    assert found["image.f_number"] == 4


def test_isetcam_makes_the_same_optical_image_of_even_light(tmp_path):
    """In the middle; beyond the scene ISETCam has darkness, into which diffraction takes 0.2 %."""
    _, found = read_back(tmp_path, "uniform")
    middle = slice(28, 36)
    np.testing.assert_allclose(
        found["own.photons"][middle], found["image.photons"][middle], rtol=3e-3
    )


def test_isetcam_reads_what_the_sensor_counted(read):
    """Its electrons are volts over the conversion gain."""
    result, found = read
    columns = np.asarray(result.electrons).T.ravel()  # Octave counts down the columns
    np.testing.assert_allclose(found["sensor.electrons"], columns, atol=0.5)
    np.testing.assert_array_equal(found["sensor.codes"], result.dn.T.ravel())
    assert found["sensor.mosaic"].tolist() == [2, 3, 1, 2]
    assert found["sensor.time"] == 0.01
    assert found["sensor.pixel"].tolist() == [5e-6, 5e-6]
    assert found["sensor.fill_factor"] == pytest.approx(12 / 25)
    np.testing.assert_allclose(found["sensor.photodetector"], [1e-6, 0.5e-6], rtol=1e-6)
