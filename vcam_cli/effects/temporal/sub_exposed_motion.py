"""Motion that no transfer function describes: the still image, looked at where it was at instants.

An image that turns moves further the further it is from its center, and lines of a rolling shutter
that see a camera shake each see another part of the path. At any instant, though, what a pixel sees
is the still image at another place; an exposure is the mean over instants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.image_motion import ExposedMotion
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.records import dataclass

PLACES = 5
"""Places along each side of the sensor at which motion is looked at for the plan."""
INSTANTS = 32
"""Instants of an exposure at which it is looked at, at least."""
MOST_INSTANTS = 512


@dataclass(frozen=True)
class SubExposedMotion(ImageMotion):
    """Turning, or another path for every line."""

    exposed: ExposedMotion
    width: float
    """Width of the sensor [m]."""
    height: float
    pitch: float
    blur_kind: Callable[[ExposedMotion, float, float, float], ImageMotion] | None = None
    """Kind of the blur by motion, where it is the same everywhere and lines differ in their places
    alone: one instant is enough then."""

    name = "motion"
    reference = "mean over instants of the exposure, by Gauss-Legendre quadrature"
    absent = ""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return nothing: `Motion.from_camera` chooses among the kinds of motion."""
        return

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        path = self.longest_path
        turn = self._turn_in_exposure()
        said = f"; the image turns by {np.degrees(turn):.3g} deg" if turn else ""
        return (
            f"image path up to {path * 1e6:.4g} um ({path / self.pitch:.3g} pixels) in the exposure"
            f" of a line, displacement up to {self.travel / self.pitch:.3g} pixels{said}"
        )

    def _turn_in_exposure(self) -> float:
        end = np.array([0.0, self.exposed.time]) + self.exposed.begin
        return float(np.ptp(self.exposed.trajectory.image_turn(end)))

    def still_places(self, x: Array, y: Array, share: float) -> tuple[Array, Array]:
        """Return where in the still image pixels look when they had a share of their exposure.

        Parameters
        ----------
        x, y : Array
            Positions (columns,) right of the axis and (rows,) below it [m].
        share : float
            Time since a line's exposure began over all of it, 0 to 1.

        Returns
        -------
        tuple of Array
            Positions x and y in the still image, of shapes that broadcast to (rows, columns) [m].
        """
        times = self.exposed.times(x, y, share)
        return self.exposed.trajectory.still_places(x[None, :], y[:, None], times)

    @property
    def blur(self) -> ImageMotion | None:
        """The blur by motion about the place of the still image, where there is one."""
        if self.blur_kind is None:
            return None
        return self.blur_kind(self.exposed.centered, self.width, self.height, self.pitch)

    @property
    def mean_turn(self) -> float:
        """Turn of the image in the middle of the exposure, clockwise [rad]."""
        return float(self.exposed.trajectory.image_turn(np.array(self.exposed.middle)))

    @property
    def drift(self) -> tuple[float, float]:
        """No displacement of whole rows beside what the instants have."""
        return 0.0, 0.0

    @property
    def displacement(self) -> tuple[float, float]:
        """No displacement beside what the instants have."""
        return 0.0, 0.0

    @property
    def is_uniform(self) -> bool:
        """No: places, or lines, move each by itself."""
        return False

    @property
    def travel(self) -> float:
        """How far from its place light comes to lie [m]."""
        return float(np.hypot(*self._displacements()).max())

    @property
    def longest_path(self) -> float:
        """Largest distance between two instants of one pixel, about [m]."""
        x, y = self._displacements()
        return float(np.hypot(np.ptp(x, axis=0), np.ptp(y, axis=0)).max())

    def _displacements(self) -> tuple[Array, Array]:
        """Return by how much the image is displaced at some instants and places (n, places) [m]."""
        x, y = (np.linspace(-0.5, 0.5, PLACES) * size for size in (self.width, self.height))
        count, recorded = INSTANTS, self.exposed.trajectory.recorded
        if recorded is not None:
            rows = np.searchsorted(recorded.times, [0.0, self.exposed.time])
            count = min(max(count, 2 * int(rows[1] - rows[0])), MOST_INSTANTS)
        if recorded is not None and self.exposed.lines.last:
            finer = min(MOST_INSTANTS // 2, len(recorded.times))
            if self.exposed.lines.go_along_y:
                y = np.linspace(-0.5, 0.5, max(PLACES, finer)) * self.height
            else:
                x = np.linspace(-0.5, 0.5, max(PLACES, finer)) * self.width
        found = [self.still_places(x, y, share) for share in np.linspace(0, 1, count)]
        dx = [np.broadcast_to(x - at_x, (len(y), len(x))).ravel() for at_x, _ in found]
        dy = [np.broadcast_to(y[:, None] - at_y, (len(y), len(x))).ravel() for _, at_y in found]
        return np.array(dx), np.array(dy)

    def part_of_exposure(self, start: float, stop: float) -> SubExposedMotion:
        """Return the motion from `start` to `stop` after a line's exposure begins [s]."""
        return replace(self, exposed=self.exposed.part_of_exposure(start, stop))
