"""Cameras that look at point grids: at random, and those that once were wrong, by name.

Pitches of 1 to 10 um, fill factors of 0.01 to 1, f/0.7 to f/45, spacings commensurate with the
pitch and not, arrays from a single pixel up, monochrome and Bayer, photodetectors centered and not.

    camera = CAMERAS["random-17"]
    model = camera.load(folder, "standard")              # the validated camera file
    truth = camera.truth(model)                          # (rows, columns) [electrons]
    error_of_mean(model, truth)                          # rms over full signal, of the engine
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lattice_truth
import making
import numpy as np
from reference import Setup, one_minus_m
from reference_cameras import Light, continuous, lines, setup_of
from reference_scenes import flat, lamp, planck

from vcam_cli import simulate
from vcam_cli.camera.camera import Camera

COUNT = 220
TOLERANCES = {"draft": 0.02, "standard": 0.005, "reference": 0.0002}
COMMENSURATE = (1 / 2, 1 / 3, 1 / 4, 2 / 3, 1, 4 / 3, 3 / 2, 2, 5 / 2, 3, 4, 7 / 5, 6)
"""Spacing over pitch."""
SIZES = ((1, 1), (1, 2), (2, 3), (3, 4), (5, 7), (8, 8), (13, 11), (20, 24), (31, 37), (64, 80))
PATTERNS = ("monochrome", "monochrome", "bayer-rggb", "bayer-grbg", "bayer-gbrg", "bayer-bggr")
LAMPS: tuple[Any, ...] = ("D65", "A", "FL2", "FL11", {"blackbody": "3000 K"})
FULL_WELL = 100e3  # of the plain camera [electrons]


@dataclass(frozen=True)
class PeriodicCamera:
    """The plain camera of tests/making.py with changes, before a point grid."""

    name: str
    changes: dict[str, Any]

    @property
    def pixels(self) -> int:
        return int(self.changes["array.rows"] * self.changes["array.columns"])

    def load(self, folder: Path, accuracy: str) -> Camera:
        """The camera as a user's file gives it, every effect on `auto`."""
        return making.camera(folder, {**self.changes, "effects": "auto", "accuracy": accuracy})

    def truth(self, camera: Camera) -> np.ndarray:
        """Mean electrons of every pixel, exact, before saturation: (rows, columns)."""
        grid = camera.scene.source
        return lattice_truth.mean_signal(self.setup(camera), grid.spacing, grid.diameter)

    def setup(self, camera: Camera) -> Setup:
        """The camera's numbers for tests/reference.py."""
        return setup(camera, light_of(self.changes.get("scene.illuminant")))


def setup(camera: Camera, light: Light) -> Setup:
    """The numbers of a plain camera: half of the photons on the photodetector are counted."""
    return setup_of(camera, None, light, quantum=flat(0.5))


def light_of(illuminant: Any) -> Light:
    """The lamp that a camera file names; None: that of the plain camera, 550 nm."""
    if illuminant is None:
        return lines(550)
    if isinstance(illuminant, str):
        return continuous(lamp(illuminant))
    if "blackbody" in illuminant:
        temperature = float(illuminant["blackbody"].removesuffix("K"))
        return continuous(lambda wavelength: planck(wavelength, temperature))
    return lines(float(illuminant["monochromatic"].removesuffix("nm")))


def full_signal(truth: np.ndarray, full_well: float = FULL_WELL) -> float:
    """Largest noise-free mean signal on the array, at most the full well, at least 1 electron."""
    return max(1.0, min(full_well, float(truth.max())))


def error_of_mean(camera: Camera, truth: np.ndarray) -> float:
    """Rms over the array of (mean raw of the engine - truth) over full signal."""
    found = np.asarray(simulate(camera, workers=1).mean_electrons, np.float64)
    assert found.shape == truth.shape
    well = camera.pixel.readout.full_well
    difference = np.minimum(found, well) - np.minimum(truth, well)
    return float(np.sqrt(np.mean(difference**2))) / full_signal(truth, well)


# --- the cameras ---------------------------------------------------------------------------------


def _um(meters: float) -> str:
    return f"{meters * 1e6:.12g} um"


def radiance_for(white: float, width: float, f_number: float, area: float = 1.0) -> str:
    """Radiance by which the perfect white gives a square pixel so many electrons at 550 nm.

    area: that of the photodetector over the pixel's (eqs 2.18, 2.23).
    """
    working = f_number * one_minus_m(5e-3, 1.0)
    photons = math.pi / (1 + 4 * working**2) * 550e-9 / (making.PLANCK * making.LIGHT)
    return f"{white / (photons * 0.5 * area * width**2 * 0.01):.6g} W/(sr m2)"


def grid(spacing: float, diameter: float) -> dict[str, Any]:
    """The chart; lengths in m."""
    chart = {"kind": "chart", "chart": "point-grid"}
    return {**chart, "spacing": _um(spacing), "diameter": _um(diameter)}


def plain_camera(
    name: str, width: float, f_number: float, size: tuple[int, int], spacing: float, diameter: float
) -> PeriodicCamera:
    """A monochrome camera of half-filled pixels under 550 nm; lengths in m."""
    changes = {
        "scene.source": grid(spacing, diameter),
        "scene.radiance": radiance_for(10e3, width, f_number, 0.5),
        "optics.f_number": f_number,
        "pixel.width": _um(width),
        "array.rows": size[0],
        "array.columns": size[1],
    }
    return PeriodicCamera(name, changes)


NAMED = (
    # 500 lp/mm pass the lens (cut-off 649) and fold to zero frequency in every pixel.
    plain_camera("period-divides-the-pitch", 4e-6, 2.8, (48, 64), 2e-6, 1.5e-6),
    # The spread of the lens reaches far beyond the array.
    plain_camera("small-array-at-f32", 2e-6, 32, (20, 24), 17.3e-6, 9e-6),
    plain_camera("twelve-pixels-at-f22", 4e-6, 22, (3, 4), 21.7e-6, 8e-6),
)


def random_camera(number: int) -> PeriodicCamera:
    """A camera drawn at random; every number gives another, always the same."""
    rng = np.random.default_rng((17, number))

    def between(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    width = between(1e-6, 10e-6)
    ratio = COMMENSURATE[int(rng.integers(len(COMMENSURATE)))]
    if number % 3 == 2:
        ratio = between(0.2, 9)
    spacing = width * ratio
    slowest = 45.0 if number % 4 == 3 else min(45.0, 0.95 * spacing / 550e-9)
    f_number = between(0.7, max(slowest, 0.71))  # so that three of four see the first harmonic
    fill = 1.0 if number % 7 == 6 else between(0.01, 1)
    rows, columns = SIZES[int(rng.integers(len(SIZES)))]
    changes = {
        "scene.source": grid(spacing, float(rng.uniform(0.1, 0.98)) * spacing),
        "scene.radiance": radiance_for(between(300, 2e5), width, f_number, fill),
        "optics.f_number": f_number,
        "pixel.width": _um(width),
        "pixel.photodetector": _photodetector(rng, width, fill, number % 5 == 4),
        "array.rows": rows,
        "array.columns": columns,
        "array.pattern": PATTERNS[int(rng.integers(len(PATTERNS)))],
    }
    if number % 9 == 8:
        changes["scene.illuminant"] = LAMPS[int(rng.integers(len(LAMPS)))]
    elif number % 9 in (4, 5):
        changes["scene.illuminant"] = {"monochromatic": f"{int(rng.integers(420, 680))} nm"}
    return PeriodicCamera(f"random-{number}", changes)


def _photodetector(
    rng: np.random.Generator, width: float, fill: float, aside: bool
) -> dict[str, Any]:
    """Square and centered, or an upright rectangle somewhere in the pixel."""
    if not aside:
        return {"fill_factor": fill, "quantum_efficiency": 0.5}
    wide = math.sqrt(fill) ** float(rng.uniform(0.6, 1.4))
    sides = width * min(1.0, wide), width * min(1.0, fill / wide)
    x, y = (float(rng.uniform(0, width - side)) for side in sides)
    places = zip(("width", "height", "x", "y"), (*sides, x, y), strict=True)
    return {**{key: _um(value) for key, value in places}, "quantum_efficiency": 0.5}


CAMERAS = {each.name: each for each in (*NAMED, *map(random_camera, range(COUNT)))}
SMALL = [name for name, each in CAMERAS.items() if each.pixels <= 100]
QUICK = (*(each.name for each in NAMED if each.name not in SMALL), *SMALL[:24])
"""Names of those that every run of the tests judges."""
