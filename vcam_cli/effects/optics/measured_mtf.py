"""Blur by a lens's measured modulation transfer.

It has both aberrations and diffraction in it, so the effect `diffraction` goes. What is measured
holds in all directions; its phase is unknown and set to 0.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.lens_mtf import MtfAtHeight, MtfCurve, lens_mtf
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.blurs import FieldTransfer, RadialTransfer, Zone
from vcam_cli.effects.optics.field_blur import ZoneWeight
from vcam_cli.effects.optics.wavefront_blur import GREEN, AberrationBlur
from vcam_cli.physics import diffraction
from vcam_cli.records import dataclass

SHARE = 0.9
"""Share of a point's light within the blur's reach."""


class MtfBlur(AberrationBlur):
    """What a measured modulation transfer is, wherever it holds."""

    reference = "ISO 15529:2010, modulation transfer function of a lens, as measured"


@dataclass(frozen=True)
class MeasuredMtf(MtfBlur, RadialTransfer):
    """Modulation transfer that is the same everywhere, straight between measured points.

    Between wavelengths it is straight, too; beyond the first and last that of these holds. A curve
    that ends above 0 goes on in its last ratio to the transfer of diffraction, as there is no light
    beyond the cut-off of diffraction.
    """

    measured: MtfAtHeight
    f_number: float
    magnification: float

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> MeasuredMtf | None:
        """Return the blur of a table for the whole field, or None where the file gives none."""
        found = lens_mtf(camera, geometry)
        if len(found) != 1:
            return None
        return cls(found[0], geometry.f_number, geometry.cone_magnification)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.contrast_clause()}{self.ending_clause()}"

    def contrast_clause(self) -> str:
        """Return up to which frequency half of the contrast is left, in green light."""
        f = np.linspace(0, self.cutoff(GREEN), 4097)
        half = f[np.argmax(self.otf(f, GREEN) < 0.5)]
        return f"measured MTF: 50 % at {half / 1e3:.3g} lp/mm"

    def ending_clause(self) -> str:
        """Return what holds beyond the last measured frequency; "" where nothing is left there."""
        last = min((c.frequencies[-1] for c in self.measured.curves if c.values[-1] > 0), default=0)
        return f"; beyond {last / 1e3:g} lp/mm as diffraction" if last else ""

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        frequency = np.abs(frequency)
        return sum(
            part * self._transfer(self.measured.curves[i], frequency, wavelength)
            for i, part in self._parts(wavelength)
        )  # type: ignore[return-value]

    def _parts(self, wavelength: float) -> tuple[tuple[int, float], ...]:
        """Return which curves make the transfer at a wavelength [m], and their shares."""
        waves = self.measured.wavelengths
        if len(waves) < 2:
            return ((0, 1.0),)
        at = float(np.interp(wavelength, waves, np.arange(len(waves))))
        low = min(int(at), len(waves) - 2)
        parts = (low, 1 - (at - low)), (low + 1, at - low)
        return tuple((i, part) for i, part in parts if part)

    def _transfer(self, curve: MtfCurve, frequency: Array, wavelength: float) -> Array:
        inside = np.interp(frequency, curve.frequencies, curve.values, right=0.0)
        last, value = curve.frequencies[-1], curve.values[-1]
        at_last = self._diffraction(np.array(last), wavelength)
        if value == 0 or at_last == 0:
            return inside
        beyond = value / at_last * self._diffraction(frequency, wavelength)
        return np.where(frequency > last, beyond, inside)

    def _diffraction(self, frequency: Array, wavelength: float) -> Array:
        return diffraction.otf_circular(frequency, wavelength, self.f_number, self.magnification)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero [cycles/m]."""
        light = float(diffraction.cutoff_frequency(wavelength, self.f_number, self.magnification))
        return max(_end(self.measured.curves[i], light) for i, _ in self._parts(wavelength))

    @property
    def reach(self) -> float:
        """How far from its place it throws most of the light, what diffraction throws aside [m].

        The light within a radius r is 2 pi r times the integral of H(f) J1(2 pi f r) over f.
        """
        from scipy.special import j1

        top = self.cutoff(GREEN)
        f = (np.arange(2048) + 0.5) / 2048 * top
        transfer = self.otf(f, GREEN)
        radii = np.geomspace(0.05, 300, 120) / top
        phase = 2 * np.pi * np.outer(radii, f)
        within = 2 * np.pi * radii * (j1(phase) @ transfer) * (top / len(f))
        return float(radii[np.argmax(within > SHARE)]) if (within > SHARE).any() else radii[-1]

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        f = np.linspace(0, self.cutoff(GREEN), 1025)
        return float(np.abs(1 - self.otf(f, GREEN)).max()) * signal.full_signal


@dataclass(frozen=True)
class FieldMtf(MtfBlur, FieldTransfer):
    """Modulation transfers at distances from the axis, straight in between."""

    places: tuple[MeasuredMtf, ...]
    """By rising distance from the axis."""
    half_diagonal: float
    """Half the diagonal of the sensor [m]."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> FieldMtf | None:
        """Return the blur of a table by image height, or None where the file gives none."""
        found = lens_mtf(camera, geometry)
        if len(found) < 2:
            return None
        lens = geometry.f_number, geometry.cone_magnification
        half_diagonal = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        return cls(tuple(MeasuredMtf(place, *lens) for place in found), half_diagonal)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        center, outermost = self.places[0], self.places[-1]
        return (
            f"center: {center.describe()}; {outermost.measured.height * 1e3:g} mm from it:"
            f" {outermost.describe()}"
        )

    @property
    def reach(self) -> float:
        """How far from its place it throws most of the light, what diffraction throws aside [m]."""
        return max(place.reach for place in self.places)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) at all places [m]."""
        largest: Array = np.max([place.spread(wavelengths) for place in self.places], axis=0)
        return largest

    def rings(self, count: int) -> tuple[Zone, ...]:
        """Return the measured places, each with its weight; between two both are straight."""
        rings = [place.measured.height / self.half_diagonal for place in self.places]
        stretches = tuple(pairwise(rings))
        return tuple(
            Zone(place, ZoneWeight(stretches, ring, 0, 0, self.half_diagonal))
            for place, ring in zip(self.places, rings, strict=True)
        )

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return max(place.mean_error(signal) for place in self.places)


def _end(curve: MtfCurve, light: float) -> float:
    """Return where a curve is zero for good; `light`: the cut-off of diffraction [cycles/m]."""
    values = np.array(curve.values)
    if values[-1] > 0:
        return max(light, curve.frequencies[-1])
    return curve.frequencies[int(np.flatnonzero(values)[-1]) + 1]
