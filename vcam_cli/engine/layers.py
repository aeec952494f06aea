"""The light on the sensor, before it is brought to pixels: what it passes, what it is made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.geometry import Geometry
from vcam_cli.effects.base import Effect, FieldTransfer, SeparableTransfer, Zone
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import Transfer


@dataclass(frozen=True)
class Layer:
    """A share of the light on the sensor; all layers together are the signal."""

    values: Callable[[int, slice], NDArray]
    """From a color and array rows to its signal there, (rows, columns) [electrons / s]."""
    weight: Callable[[NDArray, NDArray], NDArray] | None = None
    """A factor at the positions x (columns,), y (rows,) [m]: (rows, columns). Of each color there
    is one layer at most without."""
    colors: range | None = None
    """Those that are in it; None for all."""

    def of(self, count: int) -> range:
        """Which of so many colors are in it."""
        return range(count) if self.colors is None else self.colors


Layers = Iterator[Layer]
"""One is made when the one before is done with: each may take much memory."""


@dataclass(frozen=True)
class Optics:
    """What the light passes between scene and electrons."""

    transfer: Transfer
    """Of the scene's components."""
    geometry: Geometry
    settings: Settings
    mosaic: Mosaic
    effects: tuple[Effect, ...]
    workers: int
    ceiling: float = np.inf
    """Rate at which a pixel fills up, as far as it is known; brighter ones all look alike [e/s]."""

    @property
    def separable(self) -> list[SeparableTransfer]:
        return [e for e in self.effects if isinstance(e, SeparableTransfer)]

    @property
    def field(self) -> FieldTransfer | None:
        """The blur that changes over the field, where there is one."""
        return next((e for e in self.effects if isinstance(e, FieldTransfer)), None)

    @cached_property
    def zones(self) -> tuple[Zone, ...]:
        """The zones of that blur; none where there is none."""
        return () if self.field is None else self.field.zones(self.settings.field_zones)


@dataclass(frozen=True)
class Followed:
    """How far a scene's spectrum was followed, and what was in it."""

    oversampling: float = 0.0
    """Pixel Nyquist frequencies; 0 where the scene is known in closed form."""
    lost: float = 0.0
    """Estimated rms of the signal beyond [electrons / s]"""
    samples: int = 0
    """Samples of one plane of the scene that were transformed; 0 where its spectrum is known."""
    painted: bool = False
    """Whether they had to be painted first, as those of a chart."""
    looked: int = 0
    """Terms of one plane's spectrum that were looked at, to see what is in it."""
    terms: int = 0
    """Terms of one plane's spectrum that were filtered; 0 where there was no need to."""
    planes: int = 0
    """Planes that were transformed."""
    changes: dict[str, float] = dataclasses.field(default_factory=dict)
    """Transfer -> rms change of the signal by leaving it out [electrons / s]"""
    modes: int = 0
    """Filters beside the first that the change of the blur over the field took."""
    passes: int = 1
    """How often the spectrum was filtered: once for each parity of every filter."""
    table_values: int = 0
    """Values of transfer functions of fx and fy that were computed for the tables."""
    held: int = 0
    """Samples of all planes that were in memory together."""
    peak: float = 0.0
    """Bound on the signal before blur: a ceiling above it changes nothing [electrons / s]"""
    by_color: bool = False
    """Whether the layers have one color each."""
    memory: int = 0
    """That this takes at most [bytes]."""
