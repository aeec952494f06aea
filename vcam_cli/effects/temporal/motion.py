"""Motion of the scene or the camera in the exposure: blur, and skew by a rolling shutter.

    H(f) = sinc(f_x v_x T + f_y v_y T),   sinc(u) = sin(pi u) / (pi u)

v is the velocity of the image on the sensor, T the exposure time; for other paths H is the mean of
exp(-2 pi i f x(t)) over the path.

The scene has the position of the file at the reference time, by default the middle of the exposure
of the array's central row, which begins at 0 s. The motion determines the computation:

- it moves evenly, and rows are exposed together or in turn: a sinc, and displaced rows (here);
- it moves along any path, and all pixels are exposed together: the path's own transfer (here);
- it turns, or lines see other parts of a path: sub-exposures (`sub_exposed_motion.py`).
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.image_motion import ExposedMotion, exposed_motion
from vcam_cli.effects.base import Effect
from vcam_cli.effects.blurs import GeometricTransfer, SeparableTransfer
from vcam_cli.effects.temporal.sub_exposed_motion import SubExposedMotion
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.physics.motion_blur import path_transfer
from vcam_cli.records import dataclass


class Motion(Effect):
    """Motion of the scene or the camera during the exposure: blur, skew and wobble."""

    name = "motion"
    reference = "mean over the path: Bracewell, The Fourier Transform and Its Applications, 2000"
    absent = "neither the source nor the camera moves"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Effect | None:
        """Return the motion of the image, or None where it stands still."""
        found = exposed_motion(camera, geometry)
        return None if found is None else image_motion(found, geometry)


def image_motion(exposed: ExposedMotion, geometry: Geometry) -> ImageMotion:
    """Return motion in an exposure as the plainest effect that has all of it.

    Parameters
    ----------
    exposed : ExposedMotion
        The motion, and when lines see it.
    geometry : Geometry
        Geometry of the array.
    """
    path, lines = exposed.trajectory, exposed.lines
    size = geometry.sensor_width, geometry.sensor_height, geometry.pitch_y
    if path.turns or (path.recorded is not None and lines.last):
        return SubExposedMotion(exposed, *size)
    if path.recorded is not None:
        return RecordedMotion(exposed, *size)
    vx, vy = path.velocity
    kind = MotionAlongAxis if vx == 0 or vy == 0 else ObliqueMotion
    if lines.last and not lines.go_along_y:
        return SubExposedMotion(exposed, *size, kind)
    return kind(exposed, *size)


@dataclass(frozen=True)
class EvenMotion(ImageMotion, Motion):
    """Uniform translation of the image: sinc of frequency times the path in the exposure.

    A rolling shutter displaces the image row by row: v line_time from one row to the next.
    """

    exposed: ExposedMotion
    width: float
    """Width of the sensor [m]."""
    height: float
    pitch: float
    """From one row to the next [m]."""

    @property
    def path(self) -> tuple[float, float]:
        """Path of the image in the exposure, along x and y [m]."""
        vx, vy = self.exposed.trajectory.velocity
        return vx * self.exposed.time, vy * self.exposed.time

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        path = float(np.hypot(*self.path))
        said = f"image path {path * 1e6:.3g} um ({path / self.pitch:.3g} pixels)"
        drift = float(np.hypot(*self.drift))
        return f"{said}, skew {100 * drift:.2g} % of the height" if drift else said

    @property
    def drift(self) -> tuple[float, float]:
        """Displacement of the image per length down the sensor, along x and y."""
        lines, (vx, vy) = self.exposed.lines, self.exposed.trajectory.velocity
        if not lines.go_along_y:
            return 0.0, 0.0
        sign = -1.0 if lines.direction == "up" else 1.0
        late = sign * lines.line_time / self.pitch
        return vx * late, vy * late

    @property
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the array's middle, along x and y [m]."""
        vx, vy = self.exposed.trajectory.velocity
        late = self.exposed.middle - self.exposed.trajectory.reference
        return vx * late, vy * late

    @property
    def travel(self) -> float:
        """How far from its place in the middle light comes to lie [m]."""
        path, drift = np.hypot(*self.path), np.hypot(*self.drift)
        return float(np.hypot(*self.displacement) + 0.5 * (path + drift * self.height))

    def part_of_exposure(self, start: float, stop: float) -> EvenMotion:
        """Return the motion from `start` to `stop` after a line's exposure begins [s]."""
        exposed = self.exposed.part_of_exposure(start, stop)
        return type(self)(exposed, self.width, self.height, self.pitch)


@dataclass(frozen=True)
class MotionAlongAxis(EvenMotion, SeparableTransfer):
    """Motion along rows, or along columns."""

    def along_x(self, frequency: Array) -> Array:
        """Return the transfer along x at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.path[0])

    def along_y(self, frequency: Array) -> Array:
        """Return the transfer along y at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.path[1])


@dataclass(frozen=True)
class ObliqueMotion(EvenMotion, GeometricTransfer):
    """Motion in any other direction."""

    is_symmetric = True

    @property
    def reach(self) -> float:
        """How far the blur throws light [m]."""
        return 0.5 * float(np.hypot(*self.path))

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        path_x, path_y = self.path
        return np.sinc(fx[None, :] * path_x + fy[:, None] * path_y)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction."""
        return np.sinc(frequency * (across[0] * self.path[0] + across[1] * self.path[1]))


@dataclass(frozen=True)
class RecordedMotion(ImageMotion, GeometricTransfer, Motion):
    """An image that goes any path while all pixels are exposed: the path's own transfer.

    The path is straight between the times of its record. Its mean is a displacement.
    """

    exposed: ExposedMotion
    width: float
    """Width of the sensor [m]."""
    height: float
    pitch: float

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        times, x, y = self._path()
        length = float(np.hypot(np.diff(x), np.diff(y)).sum())
        return (
            f"image path {length * 1e6:.4g} um ({length / self.pitch:.3g} pixels) over"
            f" {len(times)} points"
        )

    def _path(self) -> tuple[Array, Array, Array]:
        """Return the times of the path's points, and displacements there from its mean place."""
        recorded, begin = self.exposed.trajectory.recorded, self.exposed.begin
        assert recorded is not None
        end = begin + self.exposed.time
        inner = recorded.times[(recorded.times > begin) & (recorded.times < end)]
        times = np.concatenate([[begin], inner, [end]])
        x, y = self.exposed.trajectory.displacement(times)
        return times, x - self.displacement[0], y - self.displacement[1]

    @property
    def drift(self) -> tuple[float, float]:
        """No displacement per length: all rows see the image at the same time."""
        return 0.0, 0.0

    @property
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the middle of the exposure, along x and y [m]."""
        x, y = self.exposed.trajectory.displacement(np.array(self.exposed.middle))
        return float(x), float(y)

    @property
    def reach(self) -> float:
        """How far from the place in the middle of its path the blur throws light [m]."""
        _, x, y = self._path()
        return float(np.hypot(x, y).max())

    @property
    def travel(self) -> float:
        """How far from its place light comes to lie [m]."""
        return self.reach + float(np.hypot(*self.displacement))

    def part_of_exposure(self, start: float, stop: float) -> RecordedMotion:
        """Return the motion from `start` to `stop` after the exposure begins [s]."""
        exposed = self.exposed.part_of_exposure(start, stop)
        return RecordedMotion(exposed, self.width, self.height, self.pitch)

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        return path_transfer(fx, fy, *self._path())
