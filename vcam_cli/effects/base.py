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
    ColumnSpread       spreads part of a column's light over the column         no unit
    Overflow           moves charge that wells do not hold                      electrons
    Charge             adds electrons                                           electrons
    Retention          keeps part of a pixel's charge for the next frame        no unit
    Transport          moves charge to later pixels on its way out              no unit
    NoiseSource        adds randomness, of known variance                       electrons
    Limit              clamps                                                   electrons
    Quantizer          turns electrons into digital numbers                     electrons -> DN

Blurs are in `blurs.py`, warps in `warps.py`, the last three in `signal_chain.py`, all others in
`pixel_signal.py`. Each effect lives in a file of its own and knows: whether a camera has it
(`from_camera`), what it contributes (so that the plan can leave it out), what it costs, how it
acts, where it comes from. Adding an effect is adding a file, and its class to the tuple in
`order.py`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import field
from functools import cache
from typing import ClassVar, Literal, TypeVar, cast

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.records import dataclass

Kind = TypeVar("Kind", bound="Effect")


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
    return tuple(cast(Kind, effect) for effect in effects if _is_of(type(effect), kinds))


@cache
def _is_of(effect: type[Effect], kinds: tuple[type[Effect], ...]) -> bool:
    """Return whether effects of a class are of a kind; a frame asks a hundred times."""
    return issubclass(effect, kinds)


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
    variances: dict[Effect, Array] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """Those of noise sources at the levels, of those requested before: see `total_variance`."""

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
    """Time of one pixel with all that the effect may have [core seconds]; that of effects on
    electrons as scripts/effect_seconds.py measures it."""
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
    def pixel_seconds(self) -> float:
        """Time of one pixel with what this camera's numbers call for [core seconds]."""
        return self.seconds_per_pixel

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

    def seen_by_half_pupil(self) -> tuple[Effect, ...]:
        """Return the effects that replace it in light through one half of the lens."""
        return (self,)

    def parts_in_pixels(self) -> tuple[Effect, ...]:
        """Return the parts of it that act in the pixels, before their voltages are joined."""
        return (self,)

    def parts_in_readout(self) -> tuple[Effect, ...]:
        """Return the parts of it that act on the joined voltages of pixels."""
        return ()
