"""Motion of the scene or the camera in the exposure: blur, and skew by a rolling shutter.

The scene is where its file says in the middle of the exposure of the array's middle, where that
begins at 0 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.image_motion import image_velocity
from vcam_cli.effects.base import ImageMotion, PlaneTransfer, SeparableTransfer


@dataclass(frozen=True)
class Motion(ImageMotion):
    """Uniform translation of the image: sinc of frequency times the path in the exposure.

    A rolling shutter moves row by row what is seen: v line_time from one row to the next.
    """

    path_x: float
    path_y: float
    """Path of the image in the exposure [m]."""
    drift_x: float
    drift_y: float
    """Displacement of the image per length down the sensor, by the rows' own times."""
    moved_x: float
    moved_y: float
    """Displacement of the image before the exposure begins [m]."""
    height: float
    """Height of the sensor [m]."""
    pitch: float
    """From one row to the next [m]."""

    name = "motion"
    reference = "mean over the path: Bracewell, The Fourier Transform and Its Applications, 2000"
    absent = "the file gives no motion of its source, and no scene.camera_motion"

    @classmethod
    def from_camera(cls, camera, geometry):
        """Return the motion of the image, or None where it stands still."""
        vx, vy = image_velocity(camera, geometry)
        time = camera.exposure.time
        if not (vx or vy) or time is None:
            return None
        rolling, drift = camera.exposure.rolling, 0.0
        if rolling is not None:
            sign = -1.0 if rolling.direction == "up" else 1.0
            drift = sign * rolling.line_time / geometry.pitch_y
        sides = geometry.sensor_height, geometry.pitch_y
        kind = MotionAlongAxis if vx == 0 or vy == 0 else ObliqueMotion
        start = camera.exposure.start
        moved = vx * start, vy * start
        return kind(vx * time, vy * time, vx * drift, vy * drift, *moved, *sides)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        path = np.hypot(self.path_x, self.path_y)
        said = f"the image goes {path * 1e6:.4g} um, {path / self.pitch:.3g} pixels"
        drift = np.hypot(self.drift_x, self.drift_y)
        return f"{said}; skewed by {drift:.3g} of its height" if drift else said

    @property
    def drift(self) -> tuple[float, float]:
        """Displacement of the image per length down the sensor, along x and y."""
        return self.drift_x, self.drift_y

    @property
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the array's middle, along x and y [m]."""
        return self.moved_x, self.moved_y

    @property
    def travel(self) -> float:
        """How far from its place in the middle light comes to lie [m]."""
        path, drift = np.hypot(self.path_x, self.path_y), np.hypot(self.drift_x, self.drift_y)
        return float(np.hypot(self.moved_x, self.moved_y) + 0.5 * (path + drift * self.height))

    def mean_error(self, signal) -> float:
        """Return the most that leaving it out can change, light in place of dark [electrons]."""
        return float(signal.full_signal)

    def mean_transfer(self, fx: NDArray, fy: NDArray, spectrum) -> NDArray:
        """Return a transfer that loses as much, rms over all rows: (m, n).

        Of a wave that a row sees displaced by s, sinc(b) exp(2 pi i f s) is left; over all rows
        the exponential is sinc(f S) exp(2 pi i f D) in the mean, S being the displacement from
        first row to last, D that in the middle.
        """
        x, y = fx[None, :], fy[:, None]
        blur = np.sinc(x * self.path_x + y * self.path_y)
        shift = np.sinc((x * self.drift_x + y * self.drift_y) * self.height)
        shift = shift * np.cos(2 * np.pi * (x * self.moved_x + y * self.moved_y))
        return np.asarray(1 - np.sqrt(np.maximum(1 - 2 * blur * shift + blur**2, 0)))


@dataclass(frozen=True)
class MotionAlongAxis(Motion, SeparableTransfer):
    """Motion along rows, or along columns."""

    def along_x(self, frequency):
        """Return the transfer along x at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.path_x)

    def along_y(self, frequency):
        """Return the transfer along y at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.path_y)


@dataclass(frozen=True)
class ObliqueMotion(Motion, PlaneTransfer):
    """Motion in any other direction."""

    @property
    def reach(self) -> float:
        """How far the blur throws light [m]."""
        return 0.5 * float(np.hypot(self.path_x, self.path_y))

    def cutoff(self, wavelength):
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return np.inf

    def otf_plane(self, fx, fy, wavelength):
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        return np.sinc(fx[None, :] * self.path_x + fy[:, None] * self.path_y)
