"""Kinds of effects on the electrons that a pixel has collected: noise, clamps, the ADC."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.physics import noise
from vcam_cli.records import dataclass

if TYPE_CHECKING:
    from vcam_cli.rng import Stream

SIGMAS = 6.0
"""Standard deviations of the noise that count as its extremes."""
_KINDS_OF_VARIANCE = {"frame": "temporal", "sensor": "fixed-pattern"}


@dataclass(frozen=True)
class Site:
    """Where a draw happens: a block of rows, or several, and their random streams."""

    rows: int
    columns: int
    stream: Callable[[str], Stream]
    """Generator of a named stream for this block of rows."""
    line_stream: Callable[[str], np.random.Generator]
    """Generator of a named stream shared by all blocks, for draws per column."""
    dtype: type
    dark: float = 0.0
    """Mean dark signal of a pixel [electrons]."""
    first_row: int = 0
    """Index of the block's first row in the array."""
    array_rows: int | None = None
    """Rows of the whole array; None where it ends with the block."""
    sensor: Callable[[str], Stream] | None = None
    """Generator of a named stream for this block of what stays with the sensor, where that is
    another one than `stream`."""
    coarse_normals: bool = False
    """Whether the normal numbers of pixels are `rng.coarse_normals`."""
    lines_drawn: dict[str, Array] = field(default_factory=dict)
    """Draws per column and per row of the array that are at hand."""

    @property
    def all_rows(self) -> int:
        """Rows of the whole array."""
        return self.first_row + self.rows if self.array_rows is None else self.array_rows

    def sensor_stream(self, name: str) -> Stream:
        """Return the generator of a named stream of this block that stays with the sensor.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Generator or BlockStreams
            Generator; that of the frame where the sensor has none of its own.
        """
        return (self.sensor or self.stream)(name)

    def normal(self, name: str) -> Array:
        """Return one standard normal number a pixel.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Array
            Numbers (rows, columns) without unit.
        """
        if self.coarse_normals:
            from vcam_cli.rng import coarse_normals  # with NumPy's generators, to draw alone

            return coarse_normals(self.stream(name), self.rows, self.columns, self.dtype)
        return self.stream(name).standard_normal((self.rows, self.columns), dtype=self.dtype)

    def poisson(self, name: str, mean: Array) -> Array:
        """Return Poisson numbers.

        Parameters
        ----------
        name : str
            Name of the stream.
        mean : Array
            Means (rows, columns); they may be reused [electrons].

        Returns
        -------
        Array
            Whole numbers (rows, columns) [electrons].
        """
        return noise.poisson_from_normal(mean, self.normal(name))

    def add_normal(self, name: str, electrons: Array, rms: float) -> Array:
        """Return a block plus one normal number a pixel; it reuses the array.

        Parameters
        ----------
        name : str
            Name of the stream.
        electrons : Array
            Block (rows, columns) [electrons].
        rms : float
            Standard deviation [electrons].

        Returns
        -------
        Array
            Block (rows, columns) [electrons].
        """
        z = self.normal(name)
        z *= rms
        electrons += z
        return electrons

    def uniform(self, name: str) -> Array:
        """Return one number between 0 and 1 a pixel (rows, columns), in 64 bits.

        So they are the same whatever the rest is computed in.
        """
        return self.stream(name).random((self.rows, self.columns))

    def sensor_uniform(self, name: str) -> Array:
        """Return the same of a stream that stays with the sensor."""
        return self.sensor_stream(name).random((self.rows, self.columns))

    def exponential(self, name: str) -> Array:
        """Return one standard exponential number a pixel (rows, columns), in 64 bits."""
        return self.stream(name).standard_exponential((self.rows, self.columns))

    def sensor_map(self, name: str, make: Callable[[Site], Array]) -> Array:
        """Return a map (rows, columns) that stays with the sensor, as `make` computes it here.

        Parameters
        ----------
        name : str
            Name of the map.
        make : callable
            Function of a site.
        """
        return make(self)

    @property
    def has_dark(self) -> bool:
        """Whether there is any dark signal."""
        return self.dark > 0

    def normal_columns(self, name: str) -> Array:
        """Return one standard normal number a column, the same for every block.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Array
            Numbers (columns,) without unit, read-only.
        """
        if name not in self.lines_drawn:
            drawn = self.line_stream(name).standard_normal(self.columns, dtype=self.dtype)
            drawn.setflags(write=False)
            self.lines_drawn[name] = drawn
        return self.lines_drawn[name]

    def uniform_columns(self, name: str) -> Array:
        """Return one uniform number a column, the same for every block and float type.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Array
            Numbers (columns,) from 0 to 1, without unit.
        """
        if name not in self.lines_drawn:
            drawn = self.line_stream(name).random(self.columns)
            drawn.setflags(write=False)
            self.lines_drawn[name] = drawn
        return self.lines_drawn[name]

    def uniform_rows(self, name: str) -> Array:
        """Return one uniform number a row, the same for every float type.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Array
            Numbers (rows, 1) from 0 to 1, without unit.
        """
        if name not in self.lines_drawn:
            drawn = self.line_stream(name).random(self.all_rows)
            drawn.setflags(write=False)
            self.lines_drawn[name] = drawn
        return self.lines_drawn[name][self.first_row : self.first_row + self.rows, None]

    def normal_rows(self, name: str) -> Array:
        """Return one standard normal number a row, the same for every column.

        Parameters
        ----------
        name : str
            Name of the stream.

        Returns
        -------
        Array
            Numbers (rows, 1) without unit.
        """
        return self.stream(name).standard_normal((self.rows, 1), dtype=self.dtype)

    def of_all_rows(self, name: str, shape: Callable[[Array], Array]) -> Array:
        """Return the block's part of a sequence over all rows of the array.

        Parameters
        ----------
        name : str
            Name of the stream.
        shape : callable
            Makes the sequence of one standard normal number a row, both (all rows,) in 64 bits.

        Returns
        -------
        Array
            Part (rows, 1) of the sequence, in its unit.
        """
        if name not in self.lines_drawn:
            drawn = shape(self.line_stream(name).standard_normal(self.all_rows))
            drawn.setflags(write=False)
            self.lines_drawn[name] = drawn
        return self.lines_drawn[name][self.first_row : self.first_row + self.rows, None]


class ElectronEffect(Effect):
    """An effect on the collected electrons of a frame, or of one sample of an integration."""

    scope: ClassVar[str] = "frame"
    """'frame': new in every frame; 'sensor': stays with the sensor."""
    sample_draws: ClassVar[Literal["independent", "common", "cumulative"]] = "independent"
    """In several samples of one integration: drawn anew in each, the same in all, or drawn anew
    for the charge of each step, which adds up."""

    in_charge: ClassVar[bool] = False
    """Whether it is noise of the charge itself, in front of what couples sense nodes."""
    behind_well: ClassVar[bool] = False
    """Whether it acts on what full pixels hold at most, behind the clamp."""

    @abstractmethod
    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block after this effect; it may reuse the array.

        Parameters
        ----------
        electrons : Array
            Block (rows, columns) [electrons].
        site : Site
            Block of rows and its random streams.

        Returns
        -------
        Array
            Block (rows, columns) [electrons].
        """


def electron_effects(effects: Iterable[Effect], behind_well: bool) -> tuple[ElectronEffect, ...]:
    """Return the effects on electrons up to the full well, or those behind it.

    Parameters
    ----------
    effects : iterable of Effect
        Effects in their order.
    behind_well : bool
        Whether to return those behind the full well's clamp.

    Returns
    -------
    tuple of ElectronEffect
        The effects, in their order.
    """
    return tuple(e for e in of_kind(effects, ElectronEffect) if e.behind_well == behind_well)


class NoiseSource(ElectronEffect):
    """A random contribution; whoever adds it also states its variance."""

    acts_on_light = False

    parts: ClassVar[tuple[str, ...]] = ()
    """Names of its strengths, where it has several that each take a draw of their own from every
    pixel; one at 0 is not drawn."""

    def without_parts(self, names: Collection[str]) -> Self:
        """Return it with some of its parts at 0.

        Parameters
        ----------
        names : collection of str
            Names of `parts`.

        Returns
        -------
        Self
            The source without them.
        """
        return self

    def split(self) -> tuple[Self | None, Self | None, Self | None]:
        """Return the parts of each pixel by itself, of each column, and of each row."""
        return self, None, None

    def parts_in_pixels(self) -> tuple[Effect, ...]:
        """Return what every pixel has to itself, unless the noise is the readout's."""
        parts = () if self.origin == "readout" else self.split()[:1]
        return tuple(part for part in parts if part is not None)

    def parts_in_readout(self) -> tuple[Effect, ...]:
        """Return the readout's noise as it is; of other noise what columns and rows share."""
        parts = (self,) if self.origin == "readout" else self.split()[1:]
        return tuple(part for part in parts if part is not None)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return 0: noise changes no mean."""
        return 0.0

    @property
    def fills_wells(self) -> bool:
        """Whether it fills some pixels, however little light there is."""
        return False

    def before_shot(self, mean: Array, site: Site) -> Array:
        """Return the block's mean signal as this source changes it; it may reuse the array.

        Parameters
        ----------
        mean : Array
            Mean signal (rows, columns) [electrons].
        site : Site
            Block of rows and its random streams.

        Returns
        -------
        Array
            Mean signal (rows, columns) [electrons].
        """
        return mean

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

    def working_variance(self) -> float:
        """Return the variance in the dark of pixels without defects [electrons squared]."""
        return self.variance(0.0)

    def binned_variance(self, mean: float, dark: float, binning: Binning | None) -> float:
        """Return the variance that it adds to the mean of pixels that are read as one.

        Parameters
        ----------
        mean, dark : float
            Mean signal and mean dark signal of one pixel [electrons].
        binning : Binning or None
            How pixels are read as one. Charges that are joined are one pixel.

        Returns
        -------
        float
            Variance [electrons squared].
        """
        if binning is None or binning.kind == "charge":
            return self.variance(mean, dark)
        own, column, row = (0.0 if p is None else p.variance(mean, dark) for p in self.split())
        if binning.kind == "digital":
            return own / binning.count + column / binning.columns + row / binning.rows
        return (own if self.origin == "readout" else own / binning.count) + column + row

    def contribution(self, signal: SignalLevels, others: Sequence[Effect]) -> tuple[float, str]:
        """Return its largest share of the variance of its scope, at any of the scene's levels."""
        rest = [e for e in noise_sources(others, self.scope) if e.name != self.name]
        total = total_variance([*rest, self], signal)
        share = total_variance([self], signal) / np.maximum(total, 1e-300)
        return float(share.max()), f"of {_KINDS_OF_VARIANCE[self.scope]} variance"


def noise_sources(effects: Iterable[Effect], scope: str) -> tuple[NoiseSource, ...]:
    """Return the noise sources that are new in every 'frame', or that stay with the 'sensor'.

    Parameters
    ----------
    effects : iterable of Effect
        Effects in their order.
    scope : str
        'frame' or 'sensor'.

    Returns
    -------
    tuple of NoiseSource
        The sources, in their order.
    """
    return tuple(source for source in of_kind(effects, NoiseSource) if source.scope == scope)


def total_variance(sources: Iterable[NoiseSource], signal: SignalLevels) -> Array:
    """Return the summed variance of noise sources at each of a scene's levels.

    Parameters
    ----------
    sources : iterable of NoiseSource
        Noise sources.
    signal : SignalLevels
        Signal levels, and how pixels are read as one.

    Returns
    -------
    Array
        Variance (n,) [electrons squared]; of the mean of pixels that are read as one.
    """
    known, total = signal.variances, np.zeros(len(signal.weighed))
    for source in sources:
        if source not in known:
            each = (source.binned_variance(v, signal.dark, signal.binning) for v in signal.weighed)
            known[source] = np.fromiter(each, float, len(total))
        total += known[source]
    return total


def extreme_signal(sources: Sequence[NoiseSource], brightest: float, dark: float) -> float:
    """Return the largest signal that noise makes of the brightest pixel.

    Parameters
    ----------
    sources : sequence of NoiseSource
        Noise that is wanted.
    brightest, dark : float
        Largest mean signal, and the mean dark signal in it [electrons].

    Returns
    -------
    float
        Signal [electrons]; inf where noise fills pixels of its own.
    """
    if any(source.fills_wells for source in sources):
        return math.inf
    variance = sum(source.variance(brightest, dark) for source in sources)
    return brightest + SIGMAS * math.sqrt(variance)


class Limit(ElectronEffect):
    """A clamp."""

    def mean_error(self, signal: SignalLevels) -> float | None:
        """Return 0 where no signal comes near the clamp; elsewhere it is not left out."""
        return 0.0 if signal.extreme < self.ceiling else None

    @property
    def ceiling(self) -> float:
        """The most electrons that it lets through; a pixel that holds them is full."""
        return math.inf

    def parts_in_readout(self) -> tuple[Effect, ...]:
        """Return the clamp itself: what joined voltages hold ends as what pixels hold does."""
        return (self,)

    @abstractmethod
    def apply(self, electrons: Array, site: Site | None = None) -> Array:
        """Return the clamped block, which may reuse the array [electrons]."""


def full_well(effects: Iterable[Effect]) -> float:
    """Return the charge of a full pixel.

    Parameters
    ----------
    effects : iterable of Effect
        Effects in their order.

    Returns
    -------
    float
        Charge [electrons]; inf where no effect limits it.
    """
    return min((limit.ceiling for limit in of_kind(effects, Limit)), default=math.inf)


class Quantizer(Effect):
    """Conversion to digital numbers. A camera has one, switched off or not."""

    removable = False
    origin = "readout"
    bits: int
    on_device: ClassVar[bool] = True
    """Whether `apply` takes arrays of a graphics processor."""

    @property
    def line(self) -> tuple[float, float] | None:
        """Slope [DN/e] and offset [DN] of an ADC that is a line; None for another."""
        return None

    @property
    def highest_code(self) -> int:
        """The highest code that it writes [DN]."""
        return (1 << self.bits) - 1

    @abstractmethod
    def apply(self, electrons: Array) -> Array:
        """Return the codes of a signal.

        Parameters
        ----------
        electrons : Array
            Signal (rows, columns) [electrons].

        Returns
        -------
        Array
            Whole codes (rows, columns) in the float type of the signal [DN].
        """

    @abstractmethod
    def response(self, electrons: Array) -> Array:
        """Return the same relation before rounding and clipping.

        Parameters
        ----------
        electrons : Array
            Signal, of any shape [electrons].

        Returns
        -------
        Array
            Response in the shape of the signal [DN].
        """

    def contribution(self, signal: SignalLevels, others: Sequence[Effect]) -> tuple[float, str]:
        """Return the largest share of its rounding in the temporal variance with it."""
        total = total_variance(noise_sources(others, "frame"), signal)
        n = signal.conversions
        rounding = [
            self.rounding(level, n * noise) / n
            for level, noise in zip(signal.weighed, total, strict=True)
        ]
        share = np.array(rounding) / np.maximum(total + rounding, 1e-300)
        return float(share.max()), "of temporal variance"

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
        step = self.step(level)
        k = np.arange(1, 30)
        dithered = np.exp(-2 * (np.pi * k) ** 2 * variance / step**2) / k**2
        return float(step**2 / 12 + (step / np.pi) ** 2 * dithered.sum())

    def step(self, level: float) -> float:
        """Return the width of a step of the ADC.

        Parameters
        ----------
        level : float
            Mean signal [electrons].

        Returns
        -------
        float
            Width [electrons/DN].
        """
        ends = np.array([level, level + max(1.0, 1e-3 * level)])
        below, above = self.response(ends)
        return float((ends[1] - ends[0]) / float(above - below))

    @abstractmethod
    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs from another one's by given codes.

        It has the float type of `electrons`, and may reuse both arrays.

        Parameters
        ----------
        electrons : Array
            Signal (rows, columns) [electrons].
        codes : Array
            Difference of the responses (rows, columns) [DN].

        Returns
        -------
        Array
            Signal (rows, columns) [electrons].
        """

    def linear(self, dn: Array) -> Array:
        """Return the codes of a linear ADC of the same offset and full scale.

        They are a straight line of electrons whatever the curve is.

        Parameters
        ----------
        dn : Array
            Codes of this ADC, of any shape [DN].

        Returns
        -------
        Array
            Codes in the same shape and float type [DN].
        """
        return dn
