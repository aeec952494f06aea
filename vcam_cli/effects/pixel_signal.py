"""Kinds of effects on the mean signal of pixels, and on charge that moves between them.

What the draws of noise, the clamps and the ADC make of it is in `signal_chain.py`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.camera.sensor.crosstalk import Kernel, Kernels
from vcam_cli.effects.base import Effect


class Gain(Effect):
    """A factor on the photo signal that varies slowly over the array, in each color."""

    is_neutral: ClassVar[bool] = False
    """Whether all colors have the same factor."""

    @abstractmethod
    def of_color(self, color: str) -> NeutralGain:
        """Return the gain of one color.

        Parameters
        ----------
        color : str
            Name of the color in the mosaic.

        Returns
        -------
        NeutralGain
            Its gain; the gain itself where all colors have the same.
        """

    @property
    def on_axis(self) -> float:
        """The factor at the center of the sensor, where white is judged: 1 by color."""
        return 1.0


class NeutralGain(Gain):
    """A gain that is the same in all colors."""

    is_neutral = True

    def of_color(self, color: str) -> Self:
        """Return the gain itself."""
        return self

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


class ColumnSpread(Effect):
    """Light that is caught by charge on its way along the column, whatever wells hold."""

    acts_on_light = False
    share: float
    """Share of the light on a column."""

    @abstractmethod
    def spread(self, light: Array) -> Array:
        """Return the light with part of it spread over its column.

        Parameters
        ----------
        light : Array
            Mean rates (..., rows, columns) [e/s].

        Returns
        -------
        Array
            Rates in the shape and float type of the light [e/s].
        """

    @abstractmethod
    def color_matrix(self, mosaic: Mosaic, planes: bool) -> Array:
        """Return what even light of several colors becomes.

        Parameters
        ----------
        mosaic : Mosaic
            Colors of the pixels, C in all.
        planes : bool
            Whether every pixel has every color.

        Returns
        -------
        Array
            Share (C, C) of the light of each color in the signal of each.
        """


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


class Retention(Effect):
    """Charge that is read one frame later."""

    acts_on_light = False
    share: float
    """Share of a pixel's charge."""


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
