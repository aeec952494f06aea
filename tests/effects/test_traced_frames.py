"""Frames through a traced lens against each pixel's own convolution.

A pixel sees a wave with the contrast and the phase that the OTF of its own place has, traced for
its height and wavelength alone, turned with its azimuth. Lateral color is a shift of that place.
"""

import math

import numpy as np
import pytest
from layered_reference import write_exr
from making import QUIET, camera, long_except

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.lenses.wavefronts import trace_field

ROWS, COLUMNS, PITCH, SIDE = 72, 96, 20e-6, 20e-6 * math.sqrt(0.5)
FREQUENCY, ANGLE, PHASE = 35e3, math.radians(30), math.radians(25)
SAMPLES = 12
"""Samples of a picture along a pixel: what their steps add lies beyond the cut-off."""
WAVELENGTH = 430e-9
LENS = {
    "optics": {"prescription": {"use": "double-gauss", "scale": 0.091}, "off_axis": "none"},
    "scene.illuminant": {"monochromatic": "430 nm"},
    "scene.radiance": "2 W/(sr m2)",
    "pixel.width": "20 um",
    "pixel.readout.full_well": "100 Me",
    "pixel.readout.conversion_gain": "1 nV/e",
    "array": {"rows": ROWS, "columns": COLUMNS, "pattern": "monochrome"},
    "effects": {**QUIET, "distortion": "off"},
    "accuracy": 0.002,
}
WAVE = {
    "kind": "chart",
    "chart": "sinusoid",
    "frequency": "35 lp/mm",
    "orientation": "30 deg",
    "phase": "25 deg",
    "mean": 0.5,
    "contrast": 0.8,
}


def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    turns = FREQUENCY * (x * math.cos(ANGLE) - y * math.sin(ANGLE))
    return np.exp(1j * (2 * np.pi * turns + PHASE))


def picture(folder) -> dict:
    """The wave as a picture, its samples' averaging undone."""
    step = PITCH / SAMPLES
    x, y = ((np.arange(n * SAMPLES) - (n * SAMPLES - 1) / 2) * step for n in (COLUMNS, ROWS))
    lost = np.sinc(FREQUENCY * math.cos(ANGLE) * step) * np.sinc(FREQUENCY * math.sin(ANGLE) * step)
    light = 0.5 * (1 + 0.8 * wave(x[None, :], y[:, None]).real / lost)
    return {"kind": "image", "file": write_exr(folder / "wave.exr", light)}


def seen(model, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What pixels (n,) see over what they see of the mean."""
    solved = geometry(model)
    view = traced_view(model, solved.object_distance)
    heights, of = np.unique(np.hypot(x, y), return_inverse=True)
    front = trace_field(view, heights, WAVELENGTH, WAVELENGTH)
    f = FREQUENCY * complex(math.cos(ANGLE), -math.sin(ANGLE))
    found = []
    for place_x, place_y, k in zip(x.tolist(), y.tolist(), of.tolist(), strict=True):
        turned = f * (complex(place_x, place_y) / heights[k]).conjugate()
        place = front.at(k)
        half = place.half_frame(WAVELENGTH)
        grid = place.grid(WAVELENGTH, place.mask(256))
        at = [
            np.array([WAVELENGTH * g / h])
            for g, h in zip((turned.real, turned.imag), half, strict=True)
        ]
        transfer = complex(grid.interpolate(*at)[0])
        transfer *= np.exp(-2j * np.pi * turned.real * float(front.shifts[k, 0]))
        transfer *= np.sinc(f.real * SIDE) * np.sinc(f.imag * SIDE)
        found.append(1 + 0.8 * float((transfer * wave(place_x, place_y)).real))
    return np.array(found)


@pytest.mark.parametrize("kind", long_except(["chart"], ["chart", "picture"]))
def test_pixels_see_the_convolution_of_their_own_place(tmp_path, kind):
    source = WAVE if kind == "chart" else picture(tmp_path)
    model = camera(tmp_path, LENS | {"scene.source": source})
    even = camera(
        tmp_path,
        LENS | {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0.5}},
    )
    found = simulate(model).electrons / simulate(even).electrons
    rng = np.random.default_rng(4)
    rows, columns = rng.integers(10, ROWS - 10, 8), rng.integers(10, COLUMNS - 10, 8)
    x, y = ((n + 0.5 - size / 2) * PITCH for n, size in ((columns, COLUMNS), (rows, ROWS)))
    errors = found[rows, columns] - seen(model, x, y)
    assert np.sqrt(np.mean(np.square(errors))) < 0.002 * found.max()
