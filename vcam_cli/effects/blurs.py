"""Kinds of effects that blur: transfer functions of the spatial frequency.

Transfer functions multiply, so their order does not matter. Of a point spread function h, which
sums to 1, H(f) = integral h(x) exp(-2 pi i f x) dx has H(0) = 1 and no magnitude above 1.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import ClassVar

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect
from vcam_cli.effects.warps import Magnification
from vcam_cli.physics import pupil_harmonics
from vcam_cli.physics.ray_spot import RaySpot
from vcam_cli.records import dataclass

INTERPOLATION = 28_000_000
"""Memory of SciPy's interpolation and of all that it imports [bytes]."""

PLACES = 3
"""Places of the field over which the contrast of a blur that changes over it is averaged."""
SPREAD_RANGE, SPREAD_STEPS = (1e2, 1e8), 96
"""Frequencies at which the spread of a blur is sought [cycles/m]: no blur of a camera is wider than
a sensor or counts when it is narrower than a wave of light."""


class Blur(Effect):
    """A transfer function of the spatial frequency and the wavelength, in one place of the field.

    Two kinds differ in what they depend on: `RadialTransfer` and `PlaneTransfer`. Its transfer
    function is smooth over frequencies much smaller than the inverse of its `reach`.
    """

    @abstractmethod
    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Frequency [cycles/m]; inf where there is no such frequency.
        """

    def cutoff_along(self, across: tuple[float, float], wavelength: float) -> float:
        """Return the frequency from which the transfer of waves in one direction is zero.

        Parameters
        ----------
        across : tuple of float
            Unit vector (x, y) along which the waves change.
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Frequency [cycles/m]; inf where there is no such frequency.
        """
        return self.cutoff(wavelength)

    def axis_cutoff(self, wavelength: float) -> float:
        """Return the frequency along x, and along y, from which the transfer is zero.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Frequency [cycles/m]; inf where there is no such frequency.
        """
        return self.cutoff(wavelength)

    @abstractmethod
    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of frequencies. It is 1 at frequency 0.

        Parameters
        ----------
        fx, fy : Array
            Frequencies (n,) along x and (m,) along y [cycles/m].
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array
            Transfer (m, n) without unit, complex where the blur is not symmetric.
        """

    def smooth_otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer as `otf_plane` does, but continued smoothly beyond `axis_cutoff`.

        Tables are interpolated, which a jump does not allow; the axes of a spectrum end there.

        Parameters
        ----------
        fx, fy : Array
            Frequencies (n,) along x and (m,) along y [cycles/m].
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array
            Transfer (m, n) without unit, complex where the blur is not symmetric.
        """
        return self.otf_plane(fx, fy, wavelength)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) at wavelengths (J,) [m]; inf: none known.

        A blur without one is never left out.
        """
        return np.full(len(wavelengths), np.inf)

    def largest(self, frequency: Array, wavelength: float) -> Array:
        """Return a bound on the contrast of waves in any direction.

        Parameters
        ----------
        frequency : Array
            Spatial frequencies (n,) [cycles/m].
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array
            Bound (n,) without unit; 1 where no lower bound is known.
        """
        return np.ones(frequency.shape)

    def line_tail(self, distance: Array) -> Array:
        """Return a bound on the part of a line's light that falls beyond the reach, to one side.

        Of a `RadialTransfer` it follows from the transfer (`bandwidth.line_spread_tail`) instead.

        Parameters
        ----------
        distance : Array
            Distances (n,) from the line less `reach`, rising [m].

        Returns
        -------
        Array
            Parts (n,), falling; 0 where the reach is that of all light, diffraction aside.
        """
        return np.zeros(len(distance))

    def kept_bytes(self, wavelengths: Array, by_harmonics: bool = False) -> int:
        """Return the memory that its transfer takes beside tables.

        Parameters
        ----------
        wavelengths : Array
            Wavelengths (J,) [m].
        by_harmonics : bool, optional
            Whether only the harmonics of the direction are needed, not planes.

        Returns
        -------
        int
            Memory [bytes].
        """
        return 0

    def otf_along(
        self, frequency: Array, across: tuple[float, float], wavelength: float
    ) -> Array | None:
        """Return the transfer of waves in one direction, or None where it is not known by itself.

        Parameters
        ----------
        frequency : Array
            Spatial frequencies (n,) [cycles/m].
        across : tuple of float
            Unit vector (x, y) along which the waves change.
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array or None
            Transfer (n,), complex where the blur is not symmetric.
        """
        return None

    def spectral_otf_along(
        self, frequency: Array, across: tuple[float, float], wavelengths: Array
    ) -> Array | None:
        """Return the transfer of `otf_along` at every wavelength.

        Parameters
        ----------
        frequency, across
            As those of `otf_along`.
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array or None
            Transfer (J, n), or None where it is not known by itself.
        """
        rows = [self.otf_along(frequency, across, float(w)) for w in wavelengths]
        return None if any(row is None for row in rows) else np.array(rows)

    def row_transfer(self, frequency: Array, wavelength: float) -> Array:
        """Return the contrast (n,) that it leaves of waves along a row."""
        contrast: Array = np.abs(self.otf_plane(frequency, np.zeros(1), wavelength)[0])
        return contrast


class RadialTransfer(Blur):
    """A transfer function that depends on the length of the spatial frequency only."""

    is_even = True

    @abstractmethod
    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at spatial frequencies.

        Parameters
        ----------
        frequency : Array
            Lengths of the frequencies, of any shape [cycles/m].
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array
            Transfer without unit, in the shape of `frequency`; 1 at frequency 0.
        """

    def spectral_otf(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer at every wavelength.

        Parameters
        ----------
        frequency : Array
            Lengths of the frequencies, of any shape [cycles/m].
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array
            Transfer (J, *shape of `frequency`) without unit.
        """
        return np.array([self.otf(frequency, float(w)) for w in wavelengths])

    @property
    def spot(self) -> RaySpot | None:
        """The spot to which rays blur a point, where images behind it are elementary."""
        return None

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        return self.otf(np.hypot(fx[None, :], fy[:, None]), wavelength)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) at wavelengths (J,) [m]."""
        return np.array(_radial_spread(self, tuple(wavelengths.tolist())))

    def largest(self, frequency: Array, wavelength: float) -> Array:
        """Return the contrast (n,), which is that of all directions."""
        return np.abs(self.otf(frequency, wavelength))

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction, which is that of all."""
        return self.otf(np.abs(frequency), wavelength)

    def spectral_otf_along(
        self, frequency: Array, across: tuple[float, float], wavelengths: Array
    ) -> Array:
        """Return the transfer (J, n) at every wavelength (J,) [m], which is that of all."""
        return self.spectral_otf(np.abs(frequency), wavelengths)


@lru_cache(maxsize=64)
def _radial_spread(blur: RadialTransfer, wavelengths: tuple[float, ...]) -> tuple[float, ...]:
    """Return the largest loss over 2 pi f, at frequencies apart by a factor.

    That factor bounds it between them, as losses grow until nothing is left.
    """
    frequency = np.geomspace(*SPREAD_RANGE, SPREAD_STEPS)
    factor = frequency[1] / frequency[0]
    otf = blur.spectral_otf(frequency, np.array(wavelengths))
    return tuple((factor * np.abs(1 - otf) / (2 * np.pi * frequency)).max(axis=1).tolist())


class PlaneTransfer(Blur):
    """A transfer function of both components of the spatial frequency.

    Complex where it is not symmetric about a point: H(-f) = conj(H(f)), with the sign of
    integral h(x, y) exp(-2 pi i (fx x + fy y)) dx dy, x to the right and y down.
    """

    library_bytes: ClassVar[int] = 0
    """Memory of libraries that are loaded for it alone."""

    def most_harmonics(self, wavelengths: Array) -> int:
        """Return the number of `harmonics` at wavelengths (J,) [m], at most."""
        return pupil_harmonics.MOST

    def harmonics(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer as harmonics of the direction; `pupil_harmonics` defines them.

        Blurs of a `FieldTransfer` have them: they are turned with the azimuth.

        Parameters
        ----------
        frequency : Array
            Frequencies (n,) in even steps from 0 [cycles/m].
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array
            Complex harmonics A_m (J, n, m) without unit.

        Raises
        ------
        TypeError
            For a blur that has no harmonics.
        """
        raise TypeError(f"{type(self).__name__} has no harmonics of the direction")


class GeometricTransfer(PlaneTransfer):
    """A transfer function of both components that is elementary and the same at every wavelength.

    It is computed at each frequency of a spectrum, and needs no table.
    """

    is_symmetric = False
    """Whether the blur is symmetric about a point, so that its transfer is real."""

    def cutoff(self, wavelength: float) -> float:
        """Return inf: no frequency from which the transfer is zero [cycles/m]."""
        return np.inf


@dataclass(frozen=True)
class Zone:
    """A blur, and how much of it there is in every place of the sensor."""

    blur: Blur
    weight: Callable[[Array, Array], Array]
    """At the positions x (columns,), y (rows,) [m]: (rows, columns)."""


class FieldTransfer(Effect):
    """A transfer function that changes slowly over the field: a sum of few, weighted by place.

    The lens is symmetric about its axis: what it does on the half-axis from the center to the right
    it does elsewhere turned with the azimuth. A camera has at most one of the kind.
    """

    @abstractmethod
    def rings(self, count: int) -> tuple[Zone, ...]:
        """Return blurs on that half-axis, whose weights sum to 1 in every place.

        All are `RadialTransfer`, or all are `PlaneTransfer`.

        Parameters
        ----------
        count : int
            Number of places from center to corner; a field that needs more has more.

        Returns
        -------
        tuple of Zone
            Blurs with their weights over the field.
        """

    def zones(self, count: int) -> tuple[Zone, ...]:
        """Return blurs that are turned already, whose weights sum to 1 in every place.

        Parameters
        ----------
        count : int
            Number of places from center to corner, as in `rings`.

        Returns
        -------
        tuple of Zone
            Blurs with their weights over the field.
        """
        return self.rings(count)

    def place_error(self, count: int) -> float:
        """Return what the transfer errs by between places, where there are fewer than needed.

        Parameters
        ----------
        count : int
            Number of places from center to corner, as in `rings`.

        Returns
        -------
        float
            Bound on the error of a transfer function; 0 where there are as many as needed.
        """
        return 0.0

    @property
    def table_seconds(self) -> float:
        """Core seconds of what its transfers are looked up in, made once."""
        return 0.0

    def magnifying(self, warps: Sequence[Magnification]) -> FieldTransfer | None:
        """Return the blur with magnifications by wavelength in it, which then need no warps.

        Parameters
        ----------
        warps : sequence of Magnification
            These magnifications.

        Returns
        -------
        FieldTransfer or None
            The blur; None where it does not know them, or images by color are the plainer way.
        """
        return None

    @property
    def is_uniform(self) -> bool:
        """No: it blurs places of the field each by itself."""
        return False

    def row_transfer(self, frequency: Array, wavelength: float) -> Array:
        """Return the contrast (n,) that it leaves of waves along a row, rms over some zones."""
        zones = self.zones(PLACES)
        some = [zone.blur for zone in zones[:: max(1, len(zones) // PLACES)]]
        contrast: Array = np.sqrt(
            np.mean([blur.row_transfer(frequency, wavelength) ** 2 for blur in some], 0)
        )
        return contrast


class SeparableTransfer(Effect):
    """A transfer function that is a product of one along x and one along y."""

    @property
    def box(self) -> tuple[float, float] | None:
        """Width and height of the area that it averages over evenly [m]; None for another shape."""
        return None

    def row_transfer(self, frequency: Array, wavelength: float) -> Array:
        """Return the contrast (n,) that it leaves of waves along a row."""
        return np.abs(self.along_x(frequency))

    @abstractmethod
    def along_x(self, frequency: Array) -> Array:
        """Return the transfer along x.

        Parameters
        ----------
        frequency : Array
            Frequencies along x (n,) [cycles/m].

        Returns
        -------
        Array
            Transfer (n,) without unit.
        """

    @abstractmethod
    def along_y(self, frequency: Array) -> Array:
        """Return the transfer along y.

        Parameters
        ----------
        frequency : Array
            Frequencies along y (n,) [cycles/m].

        Returns
        -------
        Array
            Transfer (n,) without unit.
        """
