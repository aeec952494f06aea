"""What an effect is.

The camera file says what exists; an effect is what one of these things does to the light. Its
kind says in mathematics what it does, and so where in the order it acts (`order.py`):

    Blur               multiplies the spectrum of the image, H(f, wavelength)   no unit
    FieldTransfer      does so by another blur in every place of the field      no unit
    SeparableTransfer  does so by a product, H_x(fx) H_y(fy)                    no unit
    Warp               looks elsewhere in the image, by place, wavelength and   no unit
                       time
    ImageMotion        is a warp by time; where nothing else warps it may be    no unit
                       one of these blurs, and displace what every row sees
    Gain               multiplies the signal, pixel by pixel                    no unit
    VeilingGlare       spreads part of the light over the whole sensor          no unit
    TemporalGain       multiplies the signal by the light of each line's time   no unit
    NeighborSharing    gives part of a pixel's signal to its neighbors          no unit
    Overflow           moves charge that wells do not hold                      electrons
    Charge             adds electrons                                           electrons
    Transport          moves charge to later pixels on its way out              no unit
    NoiseSource        adds randomness, of known variance                       electrons
    Limit              clamps                                                   electrons
    Quantizer          turns electrons into digital numbers                     electrons -> DN

The last three are in `signal_chain.py`, all others here. Each effect lives in a file of its own and
knows: whether a camera has it (`from_camera`), what it contributes (so that the plan can leave it
out), what it costs, how it acts, where it comes from. Adding an effect is adding a file, and its
class to the tuple in `order.py`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal, TypeVar

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.image_motion import ExposedMotion
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.camera.sensor.crosstalk import Kernel, Kernels

Kind = TypeVar("Kind", bound="Effect")
PLACES = 3
"""Places of the field over which the contrast of a blur that changes over it is averaged."""
SPREAD_RANGE, SPREAD_STEPS = (1e2, 1e8), 96
"""Frequencies at which the spread of a blur is sought [cycles/m]: no blur of a camera is wider than
a sensor or counts when it is narrower than a wave of light."""


def of_kind(effects: Iterable[Effect], *kinds: type[Kind]) -> tuple[Kind, ...]:
    """Return the effects of one kind, or of several, in their order.

    Parameters
    ----------
    effects : iterable of Effect
        Effects in their order.
    *kinds : type of Kind
        Classes; an effect of any of them is returned.

    Returns
    -------
    tuple of Kind
        The effects that are instances of a kind.
    """
    return tuple(effect for effect in effects if isinstance(effect, kinds))


@dataclass(frozen=True)
class SignalLevels:
    """Levels of the signal before a frame is computed; bounds refer to them."""

    full_signal: float
    """Largest noise-free mean signal on the array, at most the full well [electrons]."""
    time: float
    """Exposure time [s]."""
    dark: float = 0.0
    """Mean dark signal of a pixel [electrons]."""
    binning: Binning | None = None
    """How such pixels are read as one."""
    levels: tuple[float, ...] = ()
    """Noise-free signals of the scene at which variances are weighed, dark signal included
    [electrons]; () where only full signal is known."""
    extreme: float = math.inf
    """Largest signal that noise makes of the brightest pixel, in front of all clamps
    [electrons]."""

    @property
    def weighed(self) -> tuple[float, ...]:
        """Signals at which variances are weighed [electrons]."""
        return self.levels or (self.full_signal,)

    @property
    def conversions(self) -> int:
        """How many conversions of the ADC make one pixel of the raw frame."""
        return 1 if self.binning is None else self.binning.conversions


def switched_off(camera: Camera, name: str) -> bool:
    """Return whether the file leaves this effect out, whatever else it says.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    name : str
        Name of the effect.

    Returns
    -------
    bool
        True where `effects` in the file has `NAME: off`.
    """
    return isinstance(camera.effects, dict) and camera.effects.get(name) == "off"


class Effect(ABC):
    """One thing that a camera does to the light."""

    name: ClassVar[str]
    """Its name in the camera file's `effects`."""
    reference: ClassVar[str]
    """Equation and paper."""
    absent: ClassVar[str]
    """Why a camera does not have it: a sentence."""
    seconds_per_pixel: ClassVar[float] = 0.0
    """Cost on one core of 2020s hardware, for the plan's estimate."""
    acts_on_light: ClassVar[bool] = True
    """Whether the mean light on the lattice may depend on whether it runs."""
    keys_behind_light: ClassVar[tuple[str, ...]] = ()
    """Dotted keys of the camera file that only change what it does behind the light: cameras that
    differ in them share their light."""
    removable: ClassVar[bool] = True
    """Whether the plan may leave it out (a user always may)."""
    origin: ClassVar[Literal["lens", "pixel", "readout"]] = "pixel"
    """The part of the camera that it comes from."""

    @classmethod
    @abstractmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Effect | None:
        """Return the effect with this camera's numbers, or None where the camera has none.

        Parameters
        ----------
        camera : Camera
            Camera as its file describes it.
        geometry : Geometry
            Geometry of the array.

        Returns
        -------
        Effect or None
            The effect; None where the camera has none.

        Raises
        ------
        BadInput
            Where the file contradicts itself in what the effect needs.
        """

    @abstractmethod
    def describe(self) -> str:
        """Return what the effect does in this camera: a short clause with numbers and units."""

    @property
    def reach(self) -> float:
        """How far from its place it throws almost all of the light, diffraction aside [m]."""
        return 0.0

    def mean_error(self, signal: SignalLevels) -> float | None:
        """Return the largest rms change of the mean signal that leaving it out makes.

        Parameters
        ----------
        signal : SignalLevels
            Signal that is known before the frame is computed.

        Returns
        -------
        float or None
            Error [electrons]; None where its bound is unknown before the light is computed.
        """
        return None

    def contribution(
        self, signal: SignalLevels, others: Sequence[Effect]
    ) -> tuple[float | None, str]:
        """Return the largest share that leaving it out changes, and what it is a share of.

        Parameters
        ----------
        signal : SignalLevels
            Levels of the signal.
        others : sequence of Effect
            Effects that are wanted beside this one.

        Returns
        -------
        share : float or None
            Share without unit; None where no bound is known before the light is.
        unit : str
            Quantity that the share refers to, with its preposition; empty without a share.
        """
        error = self.mean_error(signal)
        return (None, "") if error is None else (error / signal.full_signal, "of full signal")

    largest_loss: ClassVar[float] = 2.0
    """Bound on |1 - H(f)|: 1 where its transfer is never negative."""
    is_even: ClassVar[bool] = False
    """Whether its blur is symmetric along x and along y."""

    @property
    def is_uniform(self) -> bool:
        """Whether `spread` bounds it as a blur that is the same in all places."""
        return True

    def spread(self, wavelengths: Array) -> Array | None:
        """Return how far it displaces light in the mean, at most.

        A point of light that comes to lie at distances r with the weights h takes from a wave
        |1 - H(f)| <= integral h |1 - exp(-2 pi i f r)| <= 2 pi |f| (mean of r).

        Parameters
        ----------
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array or None
            Bound (J,) on |1 - H(f)| / (2 pi |f|) at every frequency and place of the field [m];
            None where it blurs nothing.
        """
        return None

    def row_transfer(self, frequency: Array, wavelength: float) -> Array | None:
        """Return the contrast that it leaves of waves along a row, in the mean over the field.

        Parameters
        ----------
        frequency : Array
            Spatial frequencies (n,) [cycles/m].
        wavelength : float
            Wavelength [m].

        Returns
        -------
        Array or None
            Contrast (n,) without unit; None where it blurs nothing.
        """
        return None

    def part_of_exposure(self, start: float, stop: float) -> Effect:
        """Return the effect as it acts during a part of the exposure.

        Parameters
        ----------
        start, stop : float
            Times after a line's exposure begins [s].

        Returns
        -------
        Effect
            The same kind of effect; the effect itself where it does not depend on time.
        """
        return self

    def seen_by_turned(self, angle: float) -> Effect:
        """Return the effect as a turned scene meets it.

        Parameters
        ----------
        angle : float
            Angle of the scene, clockwise [rad].

        Returns
        -------
        Effect
            The turned effect; the effect itself where its direction has no influence.
        """
        return self

    def parts_in_pixels(self) -> tuple[Effect, ...]:
        """Return the parts of it that act in the pixels, before their voltages are joined."""
        return (self,)

    def parts_in_readout(self) -> tuple[Effect, ...]:
        """Return the parts of it that act on the joined voltages of pixels."""
        return ()


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


class Warp(Effect):
    """Where in the unwarped image lies what a place of the sensor sees.

    The warps of a camera are composed once, before colors are summed over the wavelengths, in
    their order from the scene to the sensor (`image_formation.warps`). Irradiance keeps: an image
    that is stretched is as bright as before.
    """

    origin = "lens"

    @abstractmethod
    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the unwarped image the places x, y look at a time.

        Parameters
        ----------
        x, y : Array
            Places right of the axis and below it, of shapes that broadcast [m].
        wavelength : float
            Wavelength [m].
        time : Array or float
            Time, of a shape that broadcasts with theirs [s].

        Returns
        -------
        tuple of Array
            Places in the unwarped image [m]; NaN for those that see nothing.
        """

    @abstractmethod
    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the unwarped image are seen: the inverse of `places`.

        Parameters
        ----------
        x, y : Array
            Places in the unwarped image right of the axis and below it, of shapes that broadcast
            [m].
        wavelength : float
            Wavelength [m].
        time : Array or float
            Time, of a shape that broadcasts with theirs [s].

        Returns
        -------
        tuple of Array
            Places on the sensor [m].
        """

    @property
    def changes_with_time(self) -> bool:
        """Whether it is another one at other times."""
        return False

    @property
    @abstractmethod
    def travel(self) -> float:
        """How far from its place light comes to lie [m]."""

    def mean_error(self, signal: SignalLevels) -> float:
        """Return the most that leaving it out can change, light in place of dark [electrons]."""
        return float(signal.full_signal)


class StillWarp(Warp):
    """A warp that is the same at all times: it warps the scene, before all blurs."""

    largest_loss = 2.0 * math.sqrt(2)

    @property
    def travel(self) -> float:
        """No motion: what it displaces is displaced in the scene."""
        return 0.0

    @property
    def knots(self) -> tuple[float, ...]:
        """Wavelengths between which it is straight [m]; none of one that is the same at all."""
        return ()

    @abstractmethod
    def displacements(self, wavelengths: Array) -> Array:
        """Return the largest distance by which it displaces the image on the sensor.

        Displacements from the unwarped image to the sensor and back both count.

        Parameters
        ----------
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array
            Distances (J,) [m].
        """

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) for what it changes [m].

        Of an image split at a frequency in two parts, the lower one changes by its gradient times
        the displacement at most, and the upper one by twice itself; the squares of both add to no
        more than twice their sum.
        """
        return math.sqrt(2) * self.displacements(wavelengths)


class Magnification(StillWarp):
    """A still warp that magnifies about the axis, by a factor of the wavelength."""

    @abstractmethod
    def factor(self, wavelength: float) -> float:
        """Return the magnification at a wavelength.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Factor without unit.
        """

    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the unwarped image the places x, y look [m]."""
        return x / self.factor(wavelength), y / self.factor(wavelength)

    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the unwarped image are seen [m]."""
        return x * self.factor(wavelength), y * self.factor(wavelength)


class ImageMotion(Warp):
    """Motion of the image: a blur, and a displacement of what rows see at their own times."""

    exposed: ExposedMotion
    """The motion, and when lines see it."""

    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the still image the places x, y look at a time [m]."""
        return self.exposed.trajectory.still_places(x, y, np.asarray(time))

    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the still image are at a time [m]."""
        return self.exposed.trajectory.moved_places(x, y, np.asarray(time))

    @property
    @abstractmethod
    def drift(self) -> tuple[float, float]:
        """Displacement of the image per length down the sensor, along x and y."""

    @property
    @abstractmethod
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the array's middle, along x and y [m]."""

    @property
    def changes_with_time(self) -> bool:
        """Yes."""
        return True

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|): no light moves further [m]."""
        return np.full(len(wavelengths), self.travel)

    @property
    def is_uniform(self) -> bool:
        """Whether all rows see the image in the same place."""
        return not any(self.drift)


class Gain(Effect):
    """A factor on the photo signal that varies slowly over the array."""

    @abstractmethod
    def gain(self, x: Array, y: Array) -> Array:
        """Return the factor on the signal of pixels.

        Parameters
        ----------
        x, y : Array
            Positions (columns,) and (rows,) of the pixels [m].

        Returns
        -------
        Array
            Factor (rows, columns) without unit; (1, 1) where it is the same everywhere.
        """

    @property
    def on_axis(self) -> float:
        """The factor at the center of the sensor, where white is judged."""
        return float(self.gain(np.zeros(1), np.zeros(1))[0, 0])


class VeilingGlare(Effect):
    """Light that goes astray on its way to the sensor and lies evenly over it."""

    fraction: float
    """Of the light of each color, averaged over the array."""


class TemporalGain(Effect):
    """A factor on the photo signal that depends on when a line is exposed."""

    @abstractmethod
    def gain(self, x: Array, y: Array, start: float, stop: float) -> Array:
        """Return the mean factor during a part of the exposure. Its mean over all times is 1.

        Parameters
        ----------
        x, y : Array
            Positions (columns,) and (rows,) of the pixels [m].
        start, stop : float
            Times after a line's exposure begins [s].

        Returns
        -------
        Array
            Factor (rows or 1, columns or 1) without unit; 1 where it is the same along that axis.
        """


class NeighborSharing(Effect):
    """Shares of a pixel's signal that its neighbors get: before it is counted, and after."""

    acts_on_light = False
    before: tuple[Kernels, ...]
    """Of light and charge before it is counted, one after the other: electrons stay independent."""
    after: Kernel | None
    """Of the charge that is counted: neighbors show the same noise."""
    largest_share: float
    """Largest share of a pixel's signal that it gives away."""


class Overflow(Effect):
    """What becomes of charge that wells do not hold."""

    acts_on_light = False

    @abstractmethod
    def settled(self, charge: Array) -> Array:
        """Return charges after their excess has found room.

        Parameters
        ----------
        charge : Array
            Charges (rows, columns) [electrons].

        Returns
        -------
        Array
            Charges (rows, columns) [electrons].
        """


class Charge(Effect):
    """Electrons that are not light."""

    acts_on_light = False

    @abstractmethod
    def rate(self) -> float:
        """Return the mean electrons that a pixel collects per second [e/s]."""


class Transport(Effect):
    """Charge that arrives late: every electron by its own chance, so means are enough."""

    @abstractmethod
    def transport(self, signal: Array) -> Array:
        """Return the signal that arrives at the output, in the unit and float type of the signal.

        Parameters
        ----------
        signal : Array
            Mean signal (rows, columns).

        Returns
        -------
        Array
            Signal (rows, columns).
        """

    @abstractmethod
    def timely_share(self, rows: int, columns: int) -> Array:
        """Return the share of a pixel's own charge that does not arrive late.

        Parameters
        ----------
        rows, columns : int
            Pixels of the array.

        Returns
        -------
        Array
            Share (rows, columns) without unit.
        """
