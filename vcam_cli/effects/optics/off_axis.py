"""Falloff of the light away from the optical axis.

    E(phi) / E(0) = (1 + a) / (2 a) (1 - A / sqrt(A^2 + 4 a)),   A = 1 - a + b

with a the squared tangent of half the image-side cone, 1 / (4 N^2 (1 - m)^2), and b that of the
angle phi off the axis. For a small aperture it is cos^4(phi); `cos4` uses this form at any
aperture. Measured tables of all light, or of each filter color, take its place.
"""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.falloff import Falloff, falloff, falloffs_by_color
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import Gain, NeutralGain
from vcam_cli.floats import rms
from vcam_cli.physics import radiometry
from vcam_cli.records import dataclass

ENTRIES = 1 << 17
"""Of the table of a measured falloff."""


@dataclass(frozen=True)
class OffAxis(NeutralGain):
    """Relative illumination E(phi)/E(0) of the image plane."""

    model: str
    tan2_cone: float
    """Squared tangent of the half-angle of the image-side cone."""
    image_distance: float
    half_width: float
    half_height: float
    """Half the sensor's width and height [m]."""

    name = "off_axis"
    reference = "Chen 2003, eq 2.22 (exact) and 2.21 (cos4)"
    absent = "optics.off_axis has the value none"
    origin = "lens"
    seconds_per_pixel = 2e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Gain | None:
        """Return the falloff, modeled or measured, or None where the file switches it off."""
        half = geometry.sensor_width / 2, geometry.sensor_height / 2
        if camera.optics.off_axis == "none":
            return None
        if measured := falloff(camera, geometry):
            return MeasuredFalloff.of(measured, geometry)
        if by_color := falloffs_by_color(camera, geometry):
            found = {c: MeasuredFalloff.of(own, geometry) for c, own in by_color.items()}
            return ColorFalloff(tuple(found.items()))
        tan2_cone = 1 / (4 * geometry.working_f_number**2)
        model = "cos4" if camera.optics.off_axis == "cos4" else "exact"
        return cls(model, tan2_cone, geometry.image_distance, *half)

    @property
    def corner(self) -> float:
        """Distance of the corner from the axis [m]."""
        return float(np.hypot(self.half_width, self.half_height))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        loss = 1 - float(self._relative_illumination((self.corner / self.image_distance) ** 2))
        return f"corners {100 * loss:.3g} % darker than the center"

    def _relative_illumination(self, tan2: ArrayLike) -> Array:
        if self.model == "cos4":
            return radiometry.relative_illumination_cos4(tan2)
        return radiometry.relative_illumination_exact(self.tan2_cone, tan2)

    def gain(self, x: Array, y: Array) -> Array:
        """Return the factor at the positions x (columns,), y (rows,) [m]: (rows, columns)."""
        x2 = ((x / self.image_distance) ** 2).astype(x.dtype)
        y2 = ((y / self.image_distance) ** 2).astype(y.dtype)
        tan2 = x2[None, :] + y2[:, None]
        polynomial = None if tan2.dtype == np.float64 else _polynomial(self)
        if polynomial is None:
            return self._relative_illumination(tan2).astype(tan2.dtype)
        out: Array = np.full_like(tan2, polynomial[-1])
        for coefficient in polynomial[-2::-1]:
            out *= tan2
            out += coefficient
        return out

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        radius2 = _quadrant(self.half_width, self.half_height)
        loss = 1 - self._relative_illumination(radius2 / self.image_distance**2)
        return 1.002 * rms(loss) * signal.full_signal


@remembered(4)
def _polynomial(falloff: OffAxis) -> tuple[np.float32, ...] | None:
    """Return coefficients in tan^2(phi), rising, to 1e-7 up to the corner; None for more than 12.

    Why: the exact form costs ten passes in 64 bits over every pixel, this one a few in 32.
    """
    top = (falloff.corner / falloff.image_distance) ** 2 * 1.001
    dense = np.linspace(0, top, 257)
    exact = falloff._relative_illumination(dense)
    for degree in range(1, 13):
        series = np.polynomial.Chebyshev.interpolate(
            falloff._relative_illumination, degree, [0, top]
        )
        if np.abs(series(dense) - exact).max() < 1e-7:
            return tuple(series.convert(kind=np.polynomial.Polynomial).coef.astype(np.float32))
    return None


@dataclass(frozen=True)
class MeasuredFalloff(NeutralGain):
    """Relative illumination over the distance from the axis, straight between measured points."""

    heights: tuple[float, ...]
    """Rising, from 0 [m]."""
    values: tuple[float, ...]
    """Relative to the axis."""
    half_width: float
    half_height: float
    """Half the sensor's width and height [m]."""
    origin_of_points: str = "measured"

    name = OffAxis.name
    reference = "ISO 13653:1996, relative illuminance in the image field, as measured"
    absent = OffAxis.absent
    origin = "lens"
    seconds_per_pixel = OffAxis.seconds_per_pixel

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the falloff where the file has measured points, else None."""
        found = OffAxis.from_camera(camera, geometry)
        return found if isinstance(found, cls) else None

    @classmethod
    def of(cls, found: Falloff, geometry: Geometry) -> Self:
        """Return the effect of a table.

        Parameters
        ----------
        found : Falloff
            Relative illumination over the distance from the axis.
        geometry : Geometry
            Geometry of the array.
        """
        half = geometry.sensor_width / 2, geometry.sensor_height / 2
        return cls(found.heights, found.values, *half, "traced" if found.is_traced else "measured")

    @property
    def corner_value(self) -> float:
        """Relative illumination of the corners."""
        return float(self._relative_illumination(np.hypot(self.half_width, self.half_height)))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.origin_of_points}: corners {_against_center(self.corner_value)}"

    def _relative_illumination(self, radius: Array | float) -> Array:
        return np.asarray(np.interp(radius, self.heights, self.values))

    def gain(self, x: Array, y: Array) -> Array:
        """Return the factor at the positions x (columns,), y (rows,) [m]: (rows, columns)."""
        x2, y2 = np.square(x), np.square(y)
        if x.dtype == np.float64:
            return self._relative_illumination(np.sqrt(x2[None, :] + y2[:, None]))
        scale = x.dtype.type((ENTRIES - 1) / self.heights[-1])
        out = np.empty((len(y), len(x)), x.dtype)
        for row, square in zip(out, y2, strict=True):  # a row at a time stays in the cache
            np.sqrt(x2 + square, out=row)
            row *= scale
            row += x.dtype.type(0.5)
            self._table.take(row.astype(np.intp), out=row, mode="clip")
        return out

    @cached_property
    def _table(self) -> Array:
        """Values at equally many distances; the nearest one is used.

        Why: `np.interp` searches its segment for every pixel, in 64 bits. A value that falls from
        1 to 0 is good to 4e-6.
        """
        return self._relative_illumination(np.linspace(0, self.heights[-1], ENTRIES)).astype(
            np.float32
        )

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        change = 1 - self._relative_illumination(
            np.sqrt(_quadrant(self.half_width, self.half_height))
        )
        return 1.002 * rms(change) * signal.full_signal


@dataclass(frozen=True)
class ColorFalloff(Gain):
    """Relative illumination of each filter color, as a lens and pixels with filters have it.

    Light meets the filters and microlenses of the corners at an angle, which passes less of some
    colors. It is part of the pixels: the irradiance in front of the filters does not have it.
    """

    by_color: tuple[tuple[str, MeasuredFalloff], ...]
    """The name of each color and its falloff."""

    name = OffAxis.name
    reference = MeasuredFalloff.reference
    absent = OffAxis.absent
    origin = "pixel"
    seconds_per_pixel = OffAxis.seconds_per_pixel

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the falloff where the file has one of each color, else None."""
        found = OffAxis.from_camera(camera, geometry)
        return found if isinstance(found, cls) else None

    def of_color(self, color: str) -> MeasuredFalloff:
        """Return the falloff of one color."""
        return dict(self.by_color)[color]

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        corners = (f"{c} {_against_center(own.corner_value)}" for c, own in self.by_color)
        return f"measured by color: corners {', '.join(corners)}"

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return max(own.mean_error(signal) for _, own in self.by_color)


def _against_center(corner: float) -> str:
    """Return how the corners are, relative to the center."""
    kind = "darker" if corner <= 1 else "brighter"
    return f"{100 * abs(1 - corner):.3g} % {kind} than the center"


def _quadrant(half_width: float, half_height: float) -> Array:
    """Return the squared distances from the axis of points all over a quadrant of the sensor [m2].

    A bound is the rms over a field at full signal everywhere, by the midpoint rule: 64 points a
    side give it to 1e-3 even at 160 degrees, which bounds are raised by.
    """
    at = (np.arange(64) + 0.5) / 64
    return np.asarray((at * half_width) ** 2 + ((at * half_height) ** 2)[:, None])
