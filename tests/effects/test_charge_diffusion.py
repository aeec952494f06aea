"""Diffusion of charge in whole cameras: each way from a scene to its pixels, what is refused.

The transfer itself is held to account in tests/physics/test_silicon.py.
"""

import math

import numpy as np
import pytest
from making import GONE, QUIET, camera

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.pixel.charge_diffusion import ChargeDiffusion
from vcam_cli.errors import BadInput
from vcam_cli.files.images.png import write_png

LENGTHS = {"diffusion_length": "20 um", "depletion_width": "0.4 um", "substrate_depth": "5 um"}
HAS = {"pixel.photodetector.charge_diffusion": LENGTHS, "effects": QUIET}
ABSORPTION = {550: 0.639, 650: 0.279, 750: 0.131}
"""Wavelength [nm] -> absorption of silicon [1/um], Green 2008."""


def mtf(per_um, absorption, length=20.0, depleted=0.4, neutral=5.0):
    """2.28 over itself at rest, by integrating the collection probability [um]."""
    node, weight = np.polynomial.legendre.leggauss(60)
    z = neutral * (node + 1) / 2

    def collected(f):
        k = math.hypot(1 / length, 2 * math.pi * f)
        below = absorption * np.exp(-absorption * (depleted + z))
        below = below * np.sinh((neutral - z) * k) / np.sinh(neutral * k)
        return 1 - math.exp(-absorption * depleted) + neutral / 2 * np.sum(weight * below)

    return collected(per_um) / collected(0.0)


def sinusoid(nm, orientation="0 deg"):
    wave = {"kind": "chart", "chart": "sinusoid", "frequency": "62.5 lp/mm", "contrast": 1}
    return {
        "scene.source": wave | {"mean": 0.5, "orientation": orientation},
        "scene.illuminant": {"monochromatic": f"{nm} nm"},
    }


def amplitude(folder, changes):
    mean = simulate(camera(folder, changes)).mean_electrons
    return np.sqrt(2) * mean.std() / mean.mean()


@pytest.mark.parametrize("nm", ABSORPTION)
@pytest.mark.parametrize("lens", [True, False])
def test_a_wave_keeps_the_part_that_is_collected_below_it(nm, lens, tmp_path):
    """20 whole periods on 64 columns: the amplitude is a rms. Absorption is read to 3 digits."""
    scene = sinusoid(nm) | {"optics.diffraction": lens}
    with_it = amplitude(tmp_path, scene | HAS)
    without = amplitude(tmp_path, scene | {"effects": QUIET})
    assert with_it / without == pytest.approx(mtf(0.0625, ABSORPTION[nm]), rel=2e-4)


def test_red_light_blurs_more_than_green():
    transfer = ChargeDiffusion(20e-6, 0.4e-6, 5e-6)
    values = [transfer.otf(np.array([100e3]), nm * 1e-9)[0] for nm in (450, 550, 650, 750, 850)]
    assert np.all(np.diff(values) < 0)


def test_it_is_the_same_in_all_directions(tmp_path):
    """The mean square contrast of a slanted wave depends on its frequency's length only.

    Without the photodetector's own blur, which is a square's. 37 degrees leaves a part of a period
    at the borders: 1 %.
    """
    changes = HAS | {"optics.diffraction": False, "array": {"rows": 64, "columns": 64}}
    changes["array"]["pattern"] = "monochrome"
    changes["effects"] = QUIET | {"pixel_aperture": "off"}
    flat = amplitude(tmp_path, changes | sinusoid(650))
    slanted = amplitude(tmp_path, changes | sinusoid(650, orientation="37 deg"))
    assert slanted == pytest.approx(flat, rel=0.01)
    assert flat == pytest.approx(mtf(0.0625, 0.279), rel=0.01)


def stripes(folder):
    """A picture of 4 black and 4 white columns in turns, two samples a pixel."""
    path = folder / "stripes.png"
    columns = np.tile(np.repeat([0, 255], 4), 16).astype(np.uint8)
    write_png(path, np.tile(columns, (96, 1)))
    return {
        "scene.source": {"kind": "image", "file": str(path), "model": "reflectance"},
        "scene.illuminant": {"monochromatic": "650 nm"},
        "scene.extent": "sensor",
        "optics.diffraction": False,
    }


def test_a_picture_without_any_cutoff(tmp_path):
    """Stripes 10 um wide as their Fourier series: nothing in it ends, neither lens nor diffusion.

    Every harmonic n of the square wave 1/2 + sum 2 / (pi n) sin(2 pi n x / 20 um) passes with the
    photodetector's sinc and the diffusion's transfer. The engine follows the spectrum as far as the
    tolerance asks: 1e-4 of full signal in `reference`. Absorption is read to 3 digits.
    """
    made = camera(tmp_path, stripes(tmp_path) | HAS)
    row = simulate(made).mean_electrons[24]
    width = geometry(made).detector_width * 1e6
    x = (np.arange(64) + 0.5) * 5.0
    n = np.arange(1, 4001, 2)
    f = n / 20.0
    passed = np.array([mtf(each, 0.279) for each in f[:200]])
    passed = np.append(passed, np.full(len(f) - 200, passed[-1]))  # constant from 20 / um on
    waves = np.sin(2 * math.pi * np.outer(x, f))
    expected = 0.5 - waves @ (2 / (math.pi * n) * np.sinc(f * width) * passed)
    inside = slice(8, 56)  # the borders are mirrored
    np.testing.assert_allclose(row[inside] / row[inside].mean() / 2, expected[inside], atol=1e-4)


def test_uniform_light_is_left_alone(tmp_path):
    with_it = simulate(camera(tmp_path, HAS)).mean_electrons
    without = simulate(camera(tmp_path, {"effects": QUIET})).mean_electrons
    np.testing.assert_allclose(with_it, without, rtol=1e-12)


@pytest.mark.parametrize(
    ("start", "stop", "fine"),
    [("350 nm", "1100 nm", True), ("349 nm", "780 nm", False), ("380 nm", "1101 nm", False)],
)
def test_wavelengths_that_silicon_is_not_known_for(start, stop, fine, tmp_path):
    outside = {"scene.wavelengths": {"start": start, "stop": stop}}
    if fine:
        assert simulate(camera(tmp_path, HAS | outside)).mean_electrons.min() > 0
        return
    with pytest.raises(BadInput, match=r"scene\.wavelengths: .* silicon is known for 350-1100 nm"):
        camera(tmp_path, HAS | outside)


def test_wavelengths_matter_only_where_silicon_does(tmp_path):
    outside = {"scene.wavelengths": {"start": "300 nm", "stop": "1200 nm"}}
    camera(tmp_path, outside)
    off = QUIET | {"charge_diffusion": "off"}
    made = camera(tmp_path, HAS | outside | {"effects": off})
    assert simulate(made).mean_electrons.min() > 0


@pytest.mark.parametrize("name", LENGTHS)
@pytest.mark.parametrize("value", [GONE, "0 um", "-1 um", "5 nm/s", 3])
def test_every_length_is_needed_and_positive(name, value, tmp_path):
    lengths = {key: length for key, length in LENGTHS.items() if key != name}
    if value is not GONE:
        lengths[name] = value
    with pytest.raises(BadInput, match=name):
        camera(tmp_path, {"pixel.photodetector.charge_diffusion": lengths})
