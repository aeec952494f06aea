"""What an effect is.

The camera file says what exists; an effect is what one of these things does to the light. Its
kind says in mathematics what it does, and so where in the order it acts (`order.py`):

    Transfer   multiplies the spectrum of the image, H(f, wavelength)      no unit
    Gain       multiplies the signal, pixel by pixel                       no unit
    VeilingGlare spreads part of the light over the whole sensor             no unit
    Charge     adds electrons                                              electrons
    Transport  moves charge to later pixels on its way out                 no unit
    NoiseSource adds randomness, of known variance                          electrons
    Limit      clamps                                                      electrons
    Quantizer  turns electrons into digital numbers                        electrons -> DN

Each effect lives in a file of its own and knows: whether a camera has it (`from_camera`), what it
contributes (so that the plan can leave it out), what it costs, how it acts, where it comes from.
Adding an effect is adding a file, and its class to the tuple in `order.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.array import Binning
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry


@dataclass(frozen=True)
class SignalLevels:
    """What is known of the signal before a frame is computed; bounds refer to it."""

    full_signal: float
    """Largest noise-free mean signal on the array, at most the full well [electrons]."""
    time: float
    """Exposure time [s]."""
    dark: float = 0.0
    """Mean dark signal of a pixel [electrons]."""
    binning: Binning | None = None
    """How such pixels are read as one."""


def switched_off(camera: Camera, name: str) -> bool:
    """Whether the file leaves this effect out, whatever else it says."""
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
    removable: ClassVar[bool] = True
    """Whether the plan may leave it out (a user always may)."""
    in_lens: ClassVar[bool] = False
    """Whether it acts on the light before that reaches the sensor."""

    @classmethod
    @abstractmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Effect | None:
        """Return the effect with this camera's numbers, or None where the camera has none."""

    @abstractmethod
    def describe(self) -> str:
        """Return what the effect does in this camera: a short clause with numbers and units."""

    def mean_error(self, outlook: SignalLevels) -> float:
        """Return the largest rms change of the mean signal by leaving it out [electrons]."""
        return 0.0


class Blur(ABC):
    """A transfer function of the spatial frequency and the wavelength, in one place of the field.

    Three kinds differ in what they depend on: `RadialTransfer`, `PlaneTransfer`; and
    `SeparableTransfer`, the same at all wavelengths.
    """

    @abstractmethod
    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""

    @property
    def reach(self) -> float:
        """How far from its place it throws almost all of the light, diffraction aside [m].

        Its transfer function is smooth over frequencies much smaller than the inverse of this.
        """
        return 0.0


class RadialTransfer(Effect, Blur):
    """A transfer function that depends on the length of the spatial frequency only."""

    @abstractmethod
    def otf(self, frequency: NDArray, wavelength: float) -> NDArray:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]; 1 at frequency 0."""


class PlaneTransfer(Effect, Blur):
    """A transfer function of both components of the spatial frequency.

    Complex where it is not symmetric about a point: H(-f) = conj(H(f)), with the sign of
    integral h(x, y) exp(-2 pi i (fx x + fy y)) dx dy, x to the right and y down.
    """

    @property
    def model(self) -> tuple[PlaneTransfer, int, bool]:
        """A blur that this one is made of, so that what many have in common is computed once.

        With it come the quarter turns from x to y by which it is turned, and whether y is mirrored
        before.
        """
        return self, 0, False

    @abstractmethod
    def otf_plane(self, fx: NDArray, fy: NDArray, wavelength: float) -> NDArray:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n).

        It is 1 at frequency 0.
        """


@dataclass(frozen=True)
class Zone:
    """A blur, and how much of it there is in every place of the sensor."""

    blur: RadialTransfer | PlaneTransfer
    weight: Callable[[NDArray, NDArray], NDArray]
    """At the positions x (columns,), y (rows,) [m]: (rows, columns)."""


class FieldTransfer(Effect):
    """A transfer function that changes slowly over the field: a sum of few, weighted by place."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """How far from its place the blur throws almost all of the light, diffraction aside [m]."""

    @abstractmethod
    def zones(self, count: int) -> tuple[Zone, ...]:
        """Return blurs whose weights sum to 1 in every place.

        `count` is the number of places from center to corner; there are more where that is known
        not to be enough.
        """


class SeparableTransfer(Effect):
    """A transfer function that is a product of one along x and one along y."""

    @abstractmethod
    def along_x(self, frequency: NDArray) -> NDArray:
        """Return the transfer along x at `frequency` [cycles/m]."""

    @abstractmethod
    def along_y(self, frequency: NDArray) -> NDArray:
        """Return the transfer along y at `frequency` [cycles/m]."""


class Gain(Effect):
    """A factor on the photo signal that varies slowly over the array."""

    @abstractmethod
    def gain(self, x: NDArray, y: NDArray) -> NDArray:
        """Return the factor at the positions x (columns,), y (rows,) [m]: (rows, columns).

        Its shape is (1, 1) where it is the same everywhere.
        """

    @property
    def on_axis(self) -> float:
        """The factor at the center of the sensor, where white is judged."""
        return float(self.gain(np.zeros(1), np.zeros(1))[0, 0])


class VeilingGlare(Effect):
    """Light that goes astray on its way to the sensor and lies evenly over it."""

    fraction: float
    """Of the light of each color, averaged over the array."""


class Charge(Effect):
    """Electrons that are not light."""

    @abstractmethod
    def rate(self) -> float:
        """Return the mean electrons that a pixel collects per second [e/s]."""


class Transport(Effect):
    """Charge that arrives late: every electron by its own chance, so means are enough."""

    @abstractmethod
    def transport(self, signal: NDArray) -> NDArray:
        """Return what arrives of a mean signal (rows, columns), in its unit and float type."""


@dataclass(frozen=True)
class Site:
    """Where a draw happens: a block of rows, and its random streams."""

    rows: int
    columns: int
    stream: Callable[[str], np.random.Generator]
    """Generator of a named stream for this block of rows."""
    line_stream: Callable[[str], np.random.Generator]
    """Generator of a named stream shared by all blocks, for draws per column."""
    dtype: type
    dark: float = 0.0
    """Mean dark signal of a pixel [electrons]."""
    columns_drawn: dict[str, NDArray] = field(default_factory=dict)
    """Draws per column that are at hand."""

    def normal(self, name: str) -> NDArray:
        """Return one standard normal number a pixel, (rows, columns)."""
        return self.stream(name).standard_normal((self.rows, self.columns), dtype=self.dtype)

    def normal_columns(self, name: str) -> NDArray:
        """Return one standard normal number a column, the same for every block, (columns,)."""
        if name not in self.columns_drawn:
            drawn = self.line_stream(name).standard_normal(self.columns, dtype=self.dtype)
            drawn.setflags(write=False)
            self.columns_drawn[name] = drawn
        return self.columns_drawn[name]

    def normal_rows(self, name: str) -> NDArray:
        """Return one standard normal number a row, the same for every column, (rows, 1)."""
        return self.stream(name).standard_normal((self.rows, 1), dtype=self.dtype)


class NoiseSource(Effect):
    """A random contribution; whoever adds it also states its variance."""

    scope: ClassVar[str]
    """'frame': new in every frame; 'sensor': stays with the sensor."""
    in_samples: ClassVar[Literal["new", "same", "accumulates"]] = "new"
    """In several samples of one integration: drawn anew in each, the same in all, or drawn anew
    for the charge of each step, which adds up."""
    of_readout: ClassVar[bool] = False
    """Whether it comes from what reads the pixels, and not from the pixels."""

    def split(self) -> tuple[Self | None, Self | None, Self | None]:
        """Return the parts of each pixel by itself, of each column, and of each row."""
        return self, None, None

    def before_shot(self, mean: NDArray, site: Site) -> NDArray:
        """Return the block's mean signal as this source changes it [electrons].

        It may reuse the array.
        """
        return mean

    @abstractmethod
    def apply(self, electrons: NDArray, site: Site) -> NDArray:
        """Return the block with this noise in it [electrons].

        It may reuse the array.
        """

    @abstractmethod
    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared].

        Parameters
        ----------
        mean : float
            Mean signal of the pixel [electrons].
        dark : float, optional
            How much of the mean signal is dark signal [electrons].
        """


class Limit(Effect):
    """A clamp."""

    removable = False

    @abstractmethod
    def apply(self, electrons: NDArray) -> NDArray:
        """Return the clamped block, which may reuse the array."""


class Quantizer(Effect):
    """Conversion to digital numbers."""

    removable = False
    bits: int

    @abstractmethod
    def apply(self, electrons: NDArray) -> NDArray:
        """Return the digital numbers of `electrons`, whole and of the same float type [DN]."""

    @abstractmethod
    def line(self, electrons: NDArray) -> NDArray:
        """Return the same relation before rounding and clipping [DN]."""

    def rounding(self, level: float, variance: float) -> float:
        """Return the largest mean square of the rounding error at a level [electrons squared].

        Of noise wider than half a step it is q^2 / 12; of less it depends on where between two
        codes the signal lies, and is q^2 / 4 at most: q^2 / 12 + (q / pi)^2 sum_k exp(-2 (pi k
        sigma / q)^2) / k^2, where cosines of the place are set to 1.

        Parameters
        ----------
        level : float
            Mean signal [electrons].
        variance : float
            Variance of the noise in the signal [electrons squared].

        References
        ----------
        B. Widrow and I. Kollar, Quantization Noise, 2008, section 5.3.
        """
        ends = np.array([level, level + max(1.0, 1e-3 * level)])
        below, above = self.line(ends)
        step = (ends[1] - ends[0]) / float(above - below)
        k = np.arange(1, 30)
        dithered = np.exp(-2 * (np.pi * k) ** 2 * variance / step**2) / k**2
        return float(step**2 / 12 + (step / np.pi) ** 2 * dithered.sum())

    def linear(self, dn: NDArray) -> NDArray:
        """Return what a linear ADC of the same offset and full scale has for these codes [DN].

        It is a straight line of electrons whatever the curve is, in the same float type.
        """
        return dn
