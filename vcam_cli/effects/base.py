"""What an effect is.

The camera file says what exists; an effect is what one of these things does to the light. Its
kind says in mathematics what it does, and so where in the order it acts (`order.py`):

    Transfer   multiplies the spectrum of the image, H(f, wavelength)      no unit
    Gain       multiplies the signal, pixel by pixel                       no unit
    Veil       spreads part of the light over the whole sensor             no unit
    Charge     adds electrons                                              electrons
    Transport  moves charge to later pixels on its way out                 no unit
    Draw       adds randomness, of known variance                          electrons
    Limit      clamps                                                      electrons
    Code       turns electrons into digital numbers                        electrons -> DN

Each effect lives in a file of its own and knows: whether a camera has it (`of`), what it
contributes (so that the plan can leave it out), what it costs, how it acts, where it comes from.
Adding an effect is adding a file, and its class to the tuple in `order.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.array import Binning
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry


@dataclass(frozen=True)
class Outlook:
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
    def of(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """The effect with this camera's numbers, or None where the camera does not have it."""

    @abstractmethod
    def describe(self) -> str:
        """What it does in this camera: a short clause with numbers and units."""

    def mean_error(self, outlook: Outlook) -> float:
        """Largest rms change of the mean signal by leaving it out [electrons]."""
        return 0.0


class Blur(ABC):
    """A transfer function of the spatial frequency and the wavelength, in one place of the field.

    Three kinds differ in what they depend on: `RadialTransfer`, `PlaneTransfer`; and
    `SeparableTransfer`, the same at all wavelengths.
    """

    @abstractmethod
    def cutoff(self, wavelength: float) -> float:
        """Frequency from which on it is zero [cycles/m]; inf where there is none."""


class RadialTransfer(Effect, Blur):
    """A transfer function that depends on the length of the spatial frequency only."""

    @abstractmethod
    def otf(self, frequency: NDArray, wavelength: float) -> NDArray:
        """Transfer at `frequency` [cycles/m] and `wavelength` [m]; 1 at frequency 0."""


class PlaneTransfer(Effect, Blur):
    """A transfer function of both components of the spatial frequency.

    Complex where it is not symmetric about a point: H(-f) = conj(H(f)), with the sign of
    integral h(x, y) exp(-2 pi i (fx x + fy y)) dx dy, x to the right and y down.
    """

    @property
    @abstractmethod
    def reach(self) -> float:
        """How far from its place it throws almost all of the light [m]."""

    @property
    def model(self) -> tuple[PlaneTransfer, int, bool]:
        """A blur that this one is made of: it, by how many quarter turns from x to y it is turned,
        and whether y is mirrored before. What many have in common is computed once."""
        return self, 0, False

    def keeps(self, wavelengths: NDArray) -> dict[Hashable, int]:
        """Tables that stay in memory for transfers at wavelengths (n,) [m]: what each is for, which
        blurs may have in common, and its bytes."""
        return {}

    @abstractmethod
    def otf_plane(self, fx: NDArray, fy: NDArray, wavelength: float) -> NDArray:
        """Transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n); 1 at 0."""


@dataclass(frozen=True)
class Zone:
    """A blur, and how much of it there is in every place of the sensor."""

    blur: RadialTransfer | PlaneTransfer
    weight: Callable[[NDArray, NDArray], NDArray]
    """At the positions x (columns,), y (rows,) [m]: (rows, columns)."""


class FieldTransfer(Effect):
    """A transfer function that changes slowly over the field: a sum of few, weighted by place."""

    @abstractmethod
    def zones(self, count: int) -> tuple[Zone, ...]:
        """Blurs whose weights sum to 1 in every place; `count` places from center to corner, or
        more where that is known not to be enough."""


class SeparableTransfer(Effect):
    """A transfer function that is a product of one along x and one along y."""

    @abstractmethod
    def along_x(self, frequency: NDArray) -> NDArray:
        """Transfer along x at `frequency` [cycles/m]."""

    @abstractmethod
    def along_y(self, frequency: NDArray) -> NDArray:
        """Transfer along y at `frequency` [cycles/m]."""


class Gain(Effect):
    """A factor on the photo signal that varies slowly over the array."""

    @abstractmethod
    def gain(self, x: NDArray, y: NDArray) -> NDArray:
        """Factor at the positions x (columns,), y (rows,) [m]: (rows, columns).

        (1, 1) where it is the same everywhere.
        """

    @property
    def on_axis(self) -> float:
        """The factor at the center of the sensor, where white is judged."""
        return float(self.gain(np.zeros(1), np.zeros(1))[0, 0])


class Veil(Effect):
    """Light that goes astray on its way to the sensor and lies evenly over it."""

    fraction: float
    """Of the light of each color, averaged over the array."""


class Charge(Effect):
    """Electrons that are not light."""

    @abstractmethod
    def rate(self) -> float:
        """Mean electrons a pixel collects per second [e/s]."""


class Transport(Effect):
    """Charge that arrives late: every electron by its own chance, so means are enough."""

    @abstractmethod
    def moved(self, signal: NDArray) -> NDArray:
        """What arrives of a mean signal (rows, columns), in its unit and float type."""


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
        """One standard normal a pixel, (rows, columns)."""
        return self.stream(name).standard_normal((self.rows, self.columns), dtype=self.dtype)

    def normal_columns(self, name: str) -> NDArray:
        """One standard normal a column, the same for every block, (columns,)."""
        if name not in self.columns_drawn:
            drawn = self.line_stream(name).standard_normal(self.columns, dtype=self.dtype)
            drawn.setflags(write=False)
            self.columns_drawn[name] = drawn
        return self.columns_drawn[name]

    def normal_rows(self, name: str) -> NDArray:
        """One standard normal a row, the same for every column, (rows, 1)."""
        return self.stream(name).standard_normal((self.rows, 1), dtype=self.dtype)


class Draw(Effect):
    """A random contribution. Whoever adds it also states its variance."""

    scope: ClassVar[str]
    """'frame': new in every frame; 'sensor': stays with the sensor."""
    in_samples: ClassVar[Literal["new", "same", "accumulates"]] = "new"
    """In several samples of one integration: drawn anew in each, the same in all, or drawn anew
    for the charge of each step, which adds up."""
    of_readout: ClassVar[bool] = False
    """Whether it comes from what reads the pixels, and not from the pixels."""

    def split(self) -> tuple[Self | None, Self | None, Self | None]:
        """What of it every pixel has to itself, what a column's pixels share, what a row's."""
        return self, None, None

    def before_shot(self, mean: NDArray, site: Site) -> NDArray:
        """The block's mean signal as this draw changes it [electrons]; may reuse the array."""
        return mean

    @abstractmethod
    def apply(self, electrons: NDArray, site: Site) -> NDArray:
        """The block with this draw in it [electrons]; may reuse the array handed in."""

    @abstractmethod
    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Variance it adds to a pixel [electrons squared].

        mean: its mean signal; dark: how much of that is dark signal [electrons].
        """


class Limit(Effect):
    """A clamp."""

    removable = False

    @abstractmethod
    def apply(self, electrons: NDArray) -> NDArray:
        """The clamped block; may reuse the array handed in."""


class Code(Effect):
    """Conversion to digital numbers."""

    removable = False
    bits: int

    @abstractmethod
    def apply(self, electrons: NDArray) -> NDArray:
        """Integer-valued digital numbers [DN] of `electrons`, same float type."""

    @abstractmethod
    def line(self, electrons: NDArray) -> NDArray:
        """The same relation before rounding and clipping [DN]."""

    def rounding(self, level: float, variance: float) -> float:
        """Largest mean square of the rounding error at a signal `level` [electrons squared].

        variance: of the noise in the signal. Of noise wider than half a step it is q^2 / 12; of
        less it depends on where between two codes the signal lies, and is q^2 / 4 at most:
        q^2 / 12 + (q / pi)^2 sum_k exp(-2 (pi k sigma / q)^2) / k^2, where cosines of the place
        are set to 1. Widrow and Kollar, Quantization Noise, 2008, section 5.3.
        """
        ends = np.array([level, level + max(1.0, 1e-3 * level)])
        below, above = self.line(ends)
        step = (ends[1] - ends[0]) / float(above - below)
        k = np.arange(1, 30)
        dithered = np.exp(-2 * (np.pi * k) ** 2 * variance / step**2) / k**2
        return float(step**2 / 12 + (step / np.pi) ** 2 * dithered.sum())

    def linear(self, dn: NDArray) -> NDArray:
        """What a linear ADC of the same offset and full scale has for these codes [DN].

        Same float type. A straight line of electrons whatever the curve is.
        """
        return dn
