"""Blur by a wavefront error that is the same everywhere in the field.

With diffraction it is a factor on the transfer function of a perfect lens; with diffraction
switched off it is the blur of geometrical rays.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.color_errors import WavelengthTable
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect, SignalLevels, switched_off
from vcam_cli.effects.blurs import PlaneTransfer, RadialTransfer
from vcam_cli.physics import aberration, diffraction, ray_blur, zernike
from vcam_cli.physics.ray_spot import RaySpot
from vcam_cli.physics.zernike import DEFOCUS, Terms
from vcam_cli.records import dataclass

GREEN = 550e-9
"""Wavelength that descriptions refer to [m]."""
FEW_HARMONICS = 64
"""Harmonics of the direction of wavefronts of few waves: up to 73 are seen where slopes are
steepest, half as many in the mean over the rings."""
SURE_OF_SLOPE = 1.02
"""Factor on the largest slope of a wavefront, which is found to about 1 %."""
MANY_WAVES = 0.18
"""Rms wavefront error from which the Strehl ratio says less than the blur's width [waves]."""


class AberrationBlur(Effect):
    """What all kinds of the effect `aberration` have in common."""

    name = "aberration"
    reference = "Hopkins 1955, doi:10.1098/rspa.1955.0158; Noll 1976, doi:10.1364/JOSA.66.000207"
    absent = "optics has no defocus, focus_shift, zernike, psf or mtf"
    origin = "lens"

    def seen_by_half_pupil(self) -> tuple[Effect, ...]:
        """Return nothing: defocus by half a pupil (`half_pupil.py`) takes the place of it."""
        return ()


@dataclass(frozen=True)
class Lens:
    """The cone in which light comes to the sensor, and whether it comes as waves."""

    working_f_number: float
    """Image distance over the diameter of the exit pupil, N (1 - m)."""
    diffracts: bool

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Lens:
        """Return the lens of a camera, which diffracts unless its file switches that off.

        Parameters
        ----------
        camera : Camera
            Camera as its file describes it.
        geometry : Geometry
            Geometry of the array.

        Returns
        -------
        Lens
            F-number, and whether the lens diffracts.
        """
        diffracts = camera.optics.diffraction and not switched_off(camera, "diffraction")
        return cls(geometry.working_f_number, diffracts)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer of an aberration is zero.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Frequency [cycles/m]; inf without diffraction.
        """
        if not self.diffracts:
            return math.inf
        return float(diffraction.cutoff_frequency(wavelength, self.working_f_number))

    def reach(self, terms: Terms) -> float:
        """Return the distance from the ideal image point within which almost all light lies.

        Parameters
        ----------
        terms : Terms
            Coefficients of the wavefront by Noll index [m].

        Returns
        -------
        float
            Distance on the sensor [m].
        """
        _, tilt = zernike.split_tilt(terms)
        moved = 2 * self.working_f_number * math.hypot(*tilt)
        airy = 2 * GREEN * self.working_f_number if self.diffracts else 0.0
        return moved + ray_blur.blur_radius(terms, self.working_f_number) + airy

    def farthest_ray(self, terms: Terms) -> float:
        """Return a bound on the distance between a ray on the sensor and the ideal image point.

        Parameters
        ----------
        terms : Terms
            Coefficients of the wavefront by Noll index [m].

        Returns
        -------
        float
            Distance on the sensor [m].
        """
        return 2 * self.working_f_number * SURE_OF_SLOPE * zernike.max_slope(terms)

    def describe(self, terms: Terms) -> str:
        """Return a clause with the numbers of a wavefront.

        Parameters
        ----------
        terms : Terms
            Coefficients of the wavefront by Noll index [m].

        Returns
        -------
        str
            Clause: error in waves, and Strehl ratio or width of the blur.
        """
        rest, tilt = zernike.split_tilt(terms)
        waves = zernike.rms(rest) / GREEN
        if not zernike.combine(terms):
            return "no wavefront error, Strehl ratio 1"
        if not rest:
            moved = [2e6 * self.working_f_number * slope for slope in tilt]
            return f"moves the image by {moved[0]:.4g} um to the right and {moved[1]:.4g} um down"
        error = f"{waves:.3g} waves rms at 550 nm"
        if self.diffracts and waves < MANY_WAVES:
            return f"{error}, Strehl ratio {zernike.strehl(rest, GREEN):.2f}"
        width = 2e6 * ray_blur.blur_radius(rest, self.working_f_number)
        return f"{error}, blurs points to {width:.4g} um"


def wavefronts(camera: Camera, geometry: Geometry) -> tuple[tuple[float | None, Terms], ...]:
    """Return the wavefronts that a camera's file gives, defocus included.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    tuple of tuple
        Pairs (place, coefficients [m]) by rising place from 0, the center, to 1, the corner; the
        place is None for a wavefront of the whole field.
    """
    moved = camera.optics.defocus + geometry.focus_shift
    shift = zernike.defocus(moved, geometry.working_f_number)
    places = camera.optics.zernike.terms or ((None, ()),)
    return tuple(
        (place, zernike.combine(terms, shift))
        for place, terms in sorted(places, key=lambda item: item[0] or 0.0)
    )


def focus_table(camera: Camera) -> WavelengthTable | None:
    """Return the shift of the image plane by wavelength.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    WavelengthTable or None
        Shift [m] over wavelength; None where it is 0 at all wavelengths.
    """
    table = camera.optics.focus_shift
    return table if table is not None and any(shift for _, shift in table.points) else None


def describe_focus(table: WavelengthTable) -> str:
    """Return a clause with the numbers of a shift by wavelength.

    Parameters
    ----------
    table : WavelengthTable
        Shift of the image plane [m] over wavelength.

    Returns
    -------
    str
        Clause with the lowest and the highest shift.
    """
    shifts = [1e6 * shift for _, shift in table.points]
    return f"focus shifts by {min(shifts):.3g} to {max(shifts):.3g} um over the wavelengths"


def uniform_wavefront(camera: Camera, geometry: Geometry) -> Terms | None:
    """Return the wavefront that is the same everywhere.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    Terms or None
        Coefficients by Noll index [m]; None where the wavefront changes over the field or turns
        with the azimuth.
    """
    (place, terms), *others = wavefronts(camera, geometry)
    same = all(other == terms for _, other in others)
    return terms if same and (place is None or zernike.is_symmetric(terms)) else None


@dataclass(frozen=True)
class UniformBlur(AberrationBlur):
    """A wavefront that is the same everywhere."""

    lens: Lens
    terms: Terms
    focus: WavelengthTable | None = None
    """Shift of the image plane by wavelength [m]; None of one that is the same at all."""

    def at(self, wavelength: float) -> Self:
        """Return the blur at one wavelength, where its focus shifts.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Self
            The blur with this wavelength's defocus in its terms.
        """
        assert self.focus is not None
        return self._shifted(float(self.focus.at(wavelength)))

    def _shifted(self, shift: float) -> Self:
        moved = zernike.defocus(shift, self.lens.working_f_number)
        return replace(self, terms=zernike.combine(self.terms, moved), focus=None)

    @property
    def extremes(self) -> tuple[Self, ...]:
        """What it is where its focus shifts most; itself where it does not."""
        if self.focus is None:
            return (self,)
        shifts = [shift for _, shift in self.focus.points]
        return self._shifted(min(shifts)), self._shifted(max(shifts))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        found = self.lens.describe(self.terms)
        return found if self.focus is None else f"{found}; {describe_focus(self.focus)}"

    @cached_property
    def reach(self) -> float:
        """How far from its place the blur throws almost all of the light, diffraction aside [m]."""
        return max(self.lens.reach(blur.terms) for blur in self.extremes)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Frequency [cycles/m]; inf without diffraction.
        """
        return self.lens.cutoff(wavelength)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|): no ray comes to lie further [m].

        The phases that are averaged are those of points of the pupil 2 lambda N f radii apart, and
        at most 2 pi f times 2 N times the steepest slope of the wavefront.
        """
        if self.focus is not None:
            own = [self.lens.farthest_ray(self.at(float(w)).terms) for w in wavelengths]
            return np.array(own)
        return np.full(len(wavelengths), self.lens.farthest_ray(self.terms))


@dataclass(frozen=True)
class SymmetricBlur(UniformBlur, RadialTransfer):
    """A wavefront that is symmetric about the axis, the same everywhere."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> SymmetricBlur | None:
        """Return the blur of a wavefront that is symmetric everywhere, else None."""
        terms, focus = uniform_wavefront(camera, geometry), focus_table(camera)
        if terms is None or not (terms or focus) or not zernike.is_symmetric(terms):
            return None
        return cls(Lens.from_camera(camera, geometry), terms, focus)

    @property
    def spot(self) -> RaySpot | None:
        """The disc of rays of defocus alone; None of waves, and of other wavefronts."""
        terms = zernike.combine(self.terms)
        if self.lens.diffracts or self.focus is not None or [i for i, _ in terms] != [DEFOCUS]:
            return None
        return RaySpot(ray_blur.blur_radius(terms, self.lens.working_f_number), 0)

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        if self.focus is not None:
            return self.at(wavelength).otf(frequency, wavelength)
        if not self.lens.diffracts:
            return ray_blur.otf_symmetric(frequency, self.lens.working_f_number, self.terms)
        return aberration.otf_ratio_symmetric(
            frequency, wavelength, self.lens.working_f_number, self.terms
        )

    def spectral_otf(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer at every wavelength (J,) [m]: (J, *shape of `frequency`)."""
        if self.focus is not None or not self.lens.diffracts:
            return super().spectral_otf(frequency, wavelengths)
        return aberration.otf_ratio_symmetric(
            frequency, wavelengths, self.lens.working_f_number, self.terms
        )

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        losses = []
        for blur in self.extremes:
            otf = blur.otf(np.linspace(0, _highest(blur.lens, blur.terms), 257), GREEN)
            losses.append(float(np.abs(1 - otf).max()))
        return max(losses) * float(signal.full_signal)


@dataclass(frozen=True)
class DirectedBlur(UniformBlur, PlaneTransfer):
    """Any wavefront, the same everywhere, turned about the axis by an angle [rad]."""

    angle: float = 0.0

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> DirectedBlur | None:
        """Return the blur of a uniform wavefront that has a direction, else None."""
        terms = uniform_wavefront(camera, geometry)
        if not terms or zernike.is_symmetric(terms):
            return None
        return cls(Lens.from_camera(camera, geometry), terms, focus_table(camera))

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n)."""
        if self.focus is not None:
            return self.at(wavelength).otf_plane(fx, fy, wavelength)
        if not self.lens.diffracts:
            return self._rays(fx, fy)
        # Turned frequencies rather than a turned wavefront: one grid serves all angles.
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        x, y = fx[None, :], fy[:, None]
        return aberration.otf_ratio(
            cos * x + sin * y, cos * y - sin * x, wavelength, self.lens.working_f_number, self.terms
        )

    def _rays(self, fx: Array, fy: Array) -> Array:
        def compute() -> Array:
            turned = zernike.rotate(self.terms, self.angle)
            return ray_blur.otf(fx, fy, self.lens.working_f_number, turned)

        return self._transfer_cache.get((fx.tobytes(), fy.tobytes()), compute)

    def otf_along(
        self, frequency: Array, across: tuple[float, float], wavelength: float
    ) -> Array | None:
        """Return the transfer (n,) of waves in one direction; None by rays, which need a plane."""
        if self.focus is not None:
            return self.at(wavelength).otf_along(frequency, across, wavelength)
        if not self.lens.diffracts:
            return None
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        x, y = across
        turned = (cos * x + sin * y) * frequency, (cos * y - sin * x) * frequency
        working = self.lens.working_f_number
        return aberration.otf_ratio(*turned, wavelength, working, self.terms)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or counts as zero [cycles/m]."""
        rest, _ = zernike.split_tilt(self.terms)
        if self.lens.diffracts or zernike.is_symmetric(rest):
            return self.lens.cutoff(wavelength)
        if self.focus is not None:
            return min(blur.cutoff(wavelength) for blur in self.extremes)
        return ray_blur.MAX_CYCLES / ray_blur.blur_radius(rest, self.lens.working_f_number)

    def kept_bytes(self, wavelengths: Array, by_harmonics: bool = False) -> int:
        """Return the memory of grids of the pupil, where there are any [bytes]."""
        if self.focus is not None:
            return max(blur.kept_bytes(wavelengths, by_harmonics) for blur in self.extremes)
        few = by_harmonics and aberration.has_few_waves(wavelengths, self.terms)
        if few or not self.lens.diffracts:
            return 0
        return aberration.grid_bytes(wavelengths, self.terms)

    def most_harmonics(self, wavelengths: Array) -> int:
        """Return the number of harmonics, at most; a wavefront of few waves has few."""
        blurs = self.extremes if self.focus is not None else (self,)
        few = self.lens.diffracts and all(
            aberration.has_few_waves(wavelengths, blur.terms) for blur in blurs
        )
        return FEW_HARMONICS if few else super().most_harmonics(wavelengths)

    def largest(self, frequency: Array, wavelength: float) -> Array:
        """Return the largest contrast (n,) in any direction by rays; 1 by waves, which end."""
        if self.lens.diffracts:
            return np.ones(frequency.shape)
        if self.focus is not None:
            return self.at(wavelength).largest(frequency, wavelength)
        return ray_blur.largest(frequency, self.lens.working_f_number, self.terms)

    def harmonics(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer (J, n, m) as harmonics of the direction, for the angle 0."""
        working = self.lens.working_f_number
        if self.focus is not None:
            own = [self.at(float(w)).harmonics(frequency, np.array([w]))[0] for w in wavelengths]
            out = np.zeros((len(own), len(frequency), max(one.shape[1] for one in own)), complex)
            for plane, one in zip(out, own, strict=True):
                plane[:, : one.shape[1]] = one
            return out
        if self.lens.diffracts:
            return aberration.otf_ratio_harmonics(frequency, wavelengths, working, self.terms)
        rays = ray_blur.otf_harmonics(frequency, working, self.terms)
        return np.broadcast_to(rays, (len(wavelengths), *rays.shape))

    @cached_property
    def _transfer_cache(self) -> ByteCache[Array]:
        """The last transfer by rays, which is the same at all wavelengths."""
        return ByteCache(0)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        losses = [largest_loss(e, _highest(e.lens, e.terms)) for e in self.extremes]
        return max(losses) * float(signal.full_signal)


def _highest(lens: Lens, terms: Terms) -> float:
    """Return the frequency up to which the largest loss of contrast is sought [cycles/m]."""
    if lens.diffracts:
        return 0.999 * lens.cutoff(GREEN)
    return 2 / max(ray_blur.blur_radius(terms, lens.working_f_number), 1e-9)


def largest_loss(blur: PlaneTransfer, highest: float) -> float:
    """Return the largest |1 - H| in green light, at every 32nd part of the highest frequency.

    Shorter waves lose up to twice as much, but a signal's rms about its mean is at most half of
    full signal.

    Parameters
    ----------
    blur : PlaneTransfer
        Blur of the lens.
    highest : float
        Highest frequency along either axis [cycles/m].

    Returns
    -------
    float
        Loss without unit.
    """
    f = np.linspace(-highest, highest, 65)
    return float(np.abs(1 - blur.otf_plane(f, f[32:], GREEN)).max())
