"""Where a lens that distorts images a direction: OpenCV's models, fisheye projections, tables.

Directions are given as x = X / Z, y = Y / Z, which is their place in the image of a lens without
distortion, in units of the focal length. y counts downwards. A mapping takes them to places in the
distorted image (`distort`) and back (`undistort`), which is NaN where no direction comes from.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import fields

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

STEPS = 16
"""Steps from the axis outwards in which a mapping is inverted, each from the one before: so a place
beyond a fold is distinguished from one that is reached without crossing it."""
NEWTON = 12
"""Iterations of Newton's method in a step, at most."""
NEAR, CLOSE = 1e-4, 1e-13
"""Changes at which it has converged on the way and in the last step: the next one is a square."""


class Mapping(ABC):
    """A mapping of directions to places in the image, both in units of the focal length."""

    @abstractmethod
    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where directions x, y of one shape are imaged."""

    @abstractmethod
    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the directions that are imaged at x, y of one shape; NaN for none."""


@dataclass(frozen=True)
class BrownConrady(Mapping):
    """OpenCV's model of radial, tangential and thin-prism distortion, without tilt.

    References
    ----------
    OpenCV documentation, Camera Calibration and 3D Reconstruction, calibrateCamera.
    D. C. Brown, Decentering Distortion of Lenses, Photogrammetric Engineering 32, 1966.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0

    @property
    def is_identity(self) -> bool:
        """Whether it changes nothing."""
        return not any(getattr(self, field.name) for field in fields(self))

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where directions x, y of one shape are imaged."""
        return self._with_jacobian(x, y)[:2]

    def _with_jacobian(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return x', y', dx'/dx, dx'/dy, dy'/dx, dy'/dy."""
        r2 = x * x + y * y
        top = 1 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        slope_top = self.k1 + r2 * (2 * self.k2 + 3 * self.k3 * r2)
        bottom = 1 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6))
        slope_bottom = self.k4 + r2 * (2 * self.k5 + 3 * self.k6 * r2)
        radial = top / bottom
        slope = (slope_top - radial * slope_bottom) / bottom  # by r2
        prism_x, prism_y = self.s1 + 2 * self.s2 * r2, self.s3 + 2 * self.s4 * r2
        return (
            x * radial
            + 2 * self.p1 * x * y
            + self.p2 * (r2 + 2 * x * x)
            + r2 * (self.s1 + self.s2 * r2),
            y * radial
            + self.p1 * (r2 + 2 * y * y)
            + 2 * self.p2 * x * y
            + r2 * (self.s3 + self.s4 * r2),
            radial + 2 * x * x * slope + 2 * self.p1 * y + 6 * self.p2 * x + 2 * x * prism_x,
            2 * x * y * slope + 2 * self.p1 * x + 2 * self.p2 * y + 2 * y * prism_x,
            2 * x * y * slope + 2 * self.p1 * x + 2 * self.p2 * y + 2 * x * prism_y,
            radial + 2 * y * y * slope + 6 * self.p1 * y + 2 * self.p2 * x + 2 * y * prism_y,
        )

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the directions that are imaged at x, y of one shape; NaN beyond a fold.

        From the axis outwards, by Newton's method: the mapping's determinant must stay positive on
        the way, as OpenCV's calibrations are to.
        """
        x, y = np.asarray(x, float), np.asarray(y, float)
        u, v, good = np.zeros(x.shape), np.zeros(x.shape), np.ones(x.shape, bool)
        with np.errstate(all="ignore"):
            for part in np.arange(1, STEPS + 1) / STEPS:
                enough, missed_most = (CLOSE, 1e-9) if part == 1 else (NEAR, 1e-3)
                for _ in range(NEWTON):
                    at_x, at_y, xx, xy, yx, yy = self._with_jacobian(u, v)
                    determinant = xx * yy - xy * yx
                    left_x, left_y = part * x - at_x, part * y - at_y
                    du = (yy * left_x - xy * left_y) / determinant
                    dv = (xx * left_y - yx * left_x) / determinant
                    u, v = u + du, v + dv
                    if np.nanmax(np.hypot(du, dv), initial=0.0) < enough:
                        break
                at_x, at_y, xx, xy, yx, yy = self._with_jacobian(u, v)
                missed = np.hypot(part * x - at_x, part * y - at_y)
                good &= (xx * yy - xy * yx > 0) & (missed < missed_most * (1 + np.hypot(x, y)))
                u, v = np.where(good, u, np.nan), np.where(good, v, np.nan)
        return u, v


class RadialMapping(Mapping):
    """A mapping that is symmetric about the axis: the height in the image by the field angle."""

    @abstractmethod
    def height(self, angle: Array) -> Array:
        """Return the height in the image of field angles [rad]."""

    @abstractmethod
    def angle(self, height: Array) -> Array:
        """Return the field angle of heights in the image [rad]; NaN for none."""

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where directions x, y of one shape are imaged."""
        ideal = np.hypot(x, y)
        factor = _ratio(self.height(np.arctan(ideal)), ideal)
        return x * factor, y * factor

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the directions that are imaged at x, y of one shape; NaN from 90 degrees on."""
        height = np.hypot(x, y)
        angle = self.angle(height)
        with np.errstate(invalid="ignore"):
            seen = np.where(angle < np.pi / 2, np.tan(angle), np.nan)
        factor = _ratio(seen, height)
        return x * factor, y * factor


def _ratio(top: Array, bottom: Array) -> Array:
    """Return a quotient that is 1 where both vanish, as of a mapping on the axis."""
    return np.asarray(np.divide(top, bottom, out=np.ones_like(bottom), where=bottom > 0))


PROJECTIONS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    "rectilinear": (np.tan, np.arctan),
    "equidistant": (lambda angle: angle, lambda height: height),
    "equisolid": (lambda angle: 2 * np.sin(angle / 2), lambda height: 2 * np.arcsin(height / 2)),
    "stereographic": (
        lambda angle: 2 * np.tan(angle / 2),
        lambda height: 2 * np.arctan(height / 2),
    ),
    "orthographic": (np.sin, np.arcsin),
}
"""Name of a projection -> height in the image by the field angle, and back."""


@dataclass(frozen=True)
class Projection(RadialMapping):
    """One of the projections that lenses are made for.

    References
    ----------
    R. Kingslake, A History of the Photographic Lens, 1989, chapter 10.
    """

    name: str

    def height(self, angle: Array) -> Array:
        """Return the height in the image of field angles [rad]."""
        return np.asarray(PROJECTIONS[self.name][0](angle))

    def angle(self, height: Array) -> Array:
        """Return the field angle of heights in the image [rad]; NaN for none."""
        with np.errstate(invalid="ignore"):
            return np.asarray(PROJECTIONS[self.name][1](height))


@dataclass(frozen=True)
class Fisheye(RadialMapping):
    """OpenCV's fisheye model: theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).

    References
    ----------
    J. Kannala and S. S. Brandt, IEEE Trans. Pattern Analysis and Machine Intelligence 28, 2006.
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    def height(self, angle: Array) -> Array:
        """Return the height in the image of field angles [rad]."""
        t = angle * angle
        return np.asarray(angle * (1 + t * (self.k1 + t * (self.k2 + t * (self.k3 + t * self.k4)))))

    def _slope(self, angle: Array) -> Array:
        t = angle * angle
        parts = 5 * self.k2 + t * (7 * self.k3 + 9 * self.k4 * t)
        return np.asarray(1 + t * (3 * self.k1 + t * parts))

    def angle(self, height: Array) -> Array:
        """Return the field angle of heights in the image [rad]; NaN beyond a fold."""
        height = np.asarray(height, float)
        angle, good = np.zeros(height.shape), np.ones(height.shape, bool)
        with np.errstate(all="ignore"):
            for part in np.arange(1, STEPS + 1) / STEPS:
                enough, missed_most = (CLOSE, 1e-9) if part == 1 else (NEAR, 1e-3)
                for _ in range(NEWTON):
                    change = (part * height - self.height(angle)) / self._slope(angle)
                    angle = angle + change
                    if np.nanmax(np.abs(change), initial=0.0) < enough:
                        break
                missed = np.abs(part * height - self.height(angle))
                good &= (self._slope(angle) > 0) & (missed < missed_most * (1 + height))
                angle = np.where(good, angle, np.nan)
        return angle


@dataclass(frozen=True)
class DistortionTable(Mapping):
    """A table over the height in the distorted image: real over ideal height, less 1.

    Straight in between; before the first and beyond the last height the value there.
    """

    heights: tuple[float, ...]
    """Rising."""
    distortions: tuple[float, ...]
    """(real - ideal) / ideal, above -1."""

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the places of an ideal image of what is imaged at x, y of one shape."""
        factor = 1 + np.interp(np.hypot(x, y), self.heights, self.distortions)
        return x / factor, y / factor

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where places x, y of an ideal image, of one shape, are imaged.

        Between two heights h the ideal one is h / (a + b h), whose inverse is closed.
        """
        ideal = np.hypot(x, y)
        heights, factors = np.array(self.heights), 1 + np.array(self.distortions)
        at = np.searchsorted(heights / factors, ideal)
        low = np.clip(at - 1, 0, len(heights) - 1)
        high = np.clip(at, 0, len(heights) - 1)
        step = heights[high] - heights[low]
        slope = np.divide(
            factors[high] - factors[low], step, out=np.zeros_like(ideal), where=step > 0
        )
        factor = (factors[low] - slope * heights[low]) / (1 - slope * ideal)
        return x * factor, y * factor

    @property
    def is_monotonic(self) -> bool:
        """Whether ideal heights rise with the real ones all the way."""
        heights, factors = np.array(self.heights), 1 + np.array(self.distortions)
        # d/dh of h / (a + b h) has the sign of a, the factor that a straight line has at 0.
        slope = np.diff(factors) / np.diff(heights)
        starts = factors[:-1] - slope * heights[:-1]
        return bool((factors > 0).all() and (starts > 0).all())


@dataclass(frozen=True)
class Chain(Mapping):
    """Mappings one after the other, the one next to the scene first."""

    mappings: tuple[Mapping, ...]

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where directions x, y of one shape are imaged."""
        for mapping in self.mappings:
            x, y = mapping.distort(x, y)
        return x, y

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the directions that are imaged at x, y of one shape; NaN for none."""
        for mapping in reversed(self.mappings):
            x, y = mapping.undistort(x, y)
        return x, y
