"""Sensors, light and scenes for tests of image formation, without a camera file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur, PlaneTransfer, RadialTransfer
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.estimates import bandwidth
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.pixel_response import scene_transfer
from vcam_cli.image_formation.settings import STANDARD, Settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.physics.pupil_harmonics import direction_harmonics
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, ChartScene, Scene
from vcam_cli.scenes.build import build
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.solve.solved import solve
from vcam_cli.spectra import Spectrum

PITCH = 2e-6
GRAY = Mosaic((("Y",),))
WHITE = Spectrum.flat(1.0)


def sensor(
    rows: int,
    columns: int,
    fill: tuple[float, float] = (1.0, 1.0),
    shift: tuple[float, float] = (0.0, 0.0),
    pitch: tuple[float, float] = (PITCH, PITCH),
) -> Geometry:
    """An array behind a lens far from its scene; fill, shift: parts of the pitch along x and y."""
    width, height = fill[0] * pitch[0], fill[1] * pitch[1]
    x, y = shift[0] * pitch[0], shift[1] * pitch[1]
    return Geometry(
        focal_length=5e-3, f_number=4.0, aperture_diameter=1.25e-3, object_distance=math.inf,
        focus_distance=math.inf, magnification=0.0, scene_scale=0.0,
        rows=rows, columns=columns, pixel_width=pitch[0], pixel_height=pitch[1],
        pitch_x=pitch[0], pitch_y=pitch[1], sensor_width=columns * pitch[0],
        sensor_height=rows * pitch[1], detector_width=width, detector_height=height, detector_x=x,
        detector_y=y, collecting_width=width, collecting_height=height, collecting_x=x,
        collecting_y=y, sampling_scale=1.0, exit_pupil_distance=5e-3, scene_width_on_sensor=None,
    )  # fmt: skip


def aperture(g: Geometry) -> PixelAperture:
    """The transfer function of the geometry's collecting areas."""
    return PixelAperture(g.collecting_width, g.collecting_height)


def light(
    *effects: Effect, weights: Any = None, wavelengths: Sequence[float] = (550e-9,)
) -> Transfer:
    """A transfer through the blurs among the effects; 1 electron a second unless told otherwise."""
    if weights is None:
        weights = np.full((1, 1, len(wavelengths)), 1 / len(wavelengths))
    return Transfer(np.asarray(wavelengths), np.asarray(weights, float), of_kind(effects, Blur))


def path(
    g: Geometry,
    *effects: Effect,
    transfer: Transfer | None = None,
    knobs: Settings = STANDARD,
    colors: Mosaic = GRAY,
    ceiling: float = np.inf,
) -> OpticalPath:
    """A path through the effects to the pixels of a sensor."""
    full = min(1.0, ceiling)
    return OpticalPath(transfer or light(*effects), g, knobs, colors, effects, 1, ceiling, full)


def on_chart(path: OpticalPath, chart: Chart, margin: int | None = None) -> ChartScene:
    """A chart of one component before a path, with the margin that the path needs."""
    g, knobs = path.geometry, path.settings
    if margin is None:
        used = path.transfer.wavelengths
        margin = bandwidth.margin(g, path.effects, (used[0], used[-1]), knobs)
    return chart_scene(chart, (WHITE,), WHITE, photon_rate.view(g, knobs, margin))


def of_picture(picture: Any, pitch: float, dtype: type = np.float64) -> ImageScene:
    """Samples (h, w) or (h, w, channels) as uniform squares of light."""
    samples = np.atleast_3d(np.asarray(picture, dtype))
    return ImageScene(
        spectra=(WHITE,) * samples.shape[2], white=WHITE, shape=samples.shape[:2], pitch_x=pitch,
        pitch_y=pitch, samples="squares", dtype=dtype, picture=samples, black=(0, 0), cut=(),
        seen=(1.0, 1.0),
    )  # fmt: skip


def signal(path: OpticalPath, scene: Scene) -> np.ndarray:
    """The signal of a gray path (rows, columns) [electrons / s]."""
    return photon_rate.photo_rate(path, scene).values


def of_camera(made: Camera, picture: Any = None) -> tuple[OpticalPath, Scene]:
    """The path and the scene of a camera, as the simulation makes them."""
    solved = solve(made)
    g, knobs, effects = solved.geometry, solved.settings, solved.effects.mean_signal
    band, colors = made.scene.wavelengths, solved.layout.mosaic
    margin = bandwidth.margin(g, effects, (band.start, band.stop), knobs)
    scene = build(made.scene, photon_rate.view(g, knobs, margin, effects), picture)
    transfer = scene_transfer(solved.response, scene.spectra, effects, knobs.wavelength_step)
    return OpticalPath(transfer, g, knobs, colors, effects, 1), scene


def rms(a: Any, b: Any = 0.0) -> float:
    """The rms difference of two arrays."""
    return float(np.sqrt(np.mean(np.square(np.asarray(a, float) - b))))


class EndlessBlur(Blur):
    """A blur of no camera, without a cut-off."""

    name = "aberration"

    @classmethod
    def from_camera(cls, camera, geometry):
        return None

    def describe(self):
        return ""

    def cutoff(self, wavelength):
        return np.inf


@dataclass(frozen=True)
class Gaussian(EndlessBlur, RadialTransfer):
    """A round Gaussian of a standard deviation [m]."""

    size: float

    @property
    def reach(self):
        return 3 * self.size

    def otf(self, frequency, wavelength):
        return np.exp(-2 * (np.pi * self.size * frequency) ** 2)


@dataclass(frozen=True)
class Leaning(EndlessBlur, PlaneTransfer):
    """A Gaussian that is wider along x than along y, and lies beside its place."""

    right: float
    down: float
    along_x: float
    along_y: float

    @property
    def reach(self):
        return 3 * max(self.along_x, self.along_y) + np.hypot(self.right, self.down)

    def otf_plane(self, fx, fy, wavelength):
        ex = np.exp(-2 * (np.pi * self.along_x * fx) ** 2 - 2j * np.pi * fx * self.right)
        ey = np.exp(-2 * (np.pi * self.along_y * fy) ** 2 - 2j * np.pi * fy * self.down)
        return ey[:, None] * ex[None, :]

    def harmonics(self, frequency, wavelengths):
        def values(angles):
            fx, fy = (np.multiply.outer(frequency, wave(angles)) for wave in (np.cos, np.sin))
            wide = (self.along_x * fx) ** 2 + (self.along_y * fy) ** 2
            found = np.exp(-2 * np.pi**2 * wide - 2j * np.pi * (fx * self.right + fy * self.down))
            return np.broadcast_to(found, (len(wavelengths), *found.shape))

        return direction_harmonics(values, 1e-12)
