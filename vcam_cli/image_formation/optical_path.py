"""What the light passes between scene and electrons, and what it is on the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.devices.processor import PROCESSOR, Processor
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import FieldTransfer, SeparableTransfer, Zone
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.records import dataclass

USED_SHARE = 0.95
"""Part of the tolerance that all errors of the mean signal may use together."""


@dataclass(frozen=True)
class LayerOptics:
    """What acts on the light of one layer of a scene."""

    effects: tuple[Effect, ...]
    radius: float
    """Of a point's blur by defocus; positive where the layer is nearer than what is in focus [m]"""

    def without_effects(self, names: Collection[str]) -> LayerOptics:
        """Return the same without some effects.

        Parameters
        ----------
        names : collection of str
            Names of these effects.

        Returns
        -------
        LayerOptics
            The layer's optics.
        """
        return replace(self, effects=tuple(e for e in self.effects if e.name not in names))

    def part_of_exposure(self, start: float, stop: float) -> LayerOptics:
        """Return the same during a part of the exposure.

        Parameters
        ----------
        start, stop : float
            Times since a line's exposure began [s].

        Returns
        -------
        LayerOptics
            The layer's optics.
        """
        return replace(self, effects=tuple(e.part_of_exposure(start, stop) for e in self.effects))


@dataclass(frozen=True)
class OpticalPath:
    """Lens, pixels and settings through which a scene is seen."""

    transfer: Transfer
    """Of the scene's components."""
    geometry: Geometry
    settings: Settings
    mosaic: Mosaic
    effects: tuple[Effect, ...]
    workers: int
    ceiling: float = np.inf
    """Rate that fills a pixel by the end of the exposure, inf where unknown; brighter ones all
    look alike [e/s]."""
    full: float = np.inf
    """Signal to which errors are relative: the largest on the array, at most the ceiling; inf
    where unknown [e/s]."""
    fullness: float = 0.0
    """Light of the darkest place of the scene over the light that fills a pixel whatever its noise,
    by white on the axis; 0 where it is not known."""
    optional: tuple[Effect, ...] = ()
    """Effects that may be left out where the scene does not call for them."""
    omitted_share: float = 0.0
    """Bound on the rms change by effects that are left out, relative to full signal."""
    layers: tuple[LayerOptics, ...] = ()
    """What acts on each layer of a scene, the nearest first; () where it is seen as flat."""
    has_opacity: bool = False
    """Whether it is that of a layer, half of whose colors are its opacity."""
    device: Processor = PROCESSOR
    """Where sampled scenes are transformed, filtered and evaluated at the pixels."""
    is_mosaic: bool = False
    """Whether each place needs its pixel's color alone: layers are then composed in that color."""
    is_explained: bool = True
    """Whether the report says what each transfer function changes: 3 % of a frame of 64 x 64
    pixels of a data set, which needs no plan."""

    def with_effects(self, kept: Sequence[Effect]) -> OpticalPath:
        """Return the path with some of its effects alone.

        Parameters
        ----------
        kept : sequence of Effect
            These effects.

        Returns
        -------
        OpticalPath
            The path.
        """
        gone = {effect.name for effect in self.effects} - {effect.name for effect in kept}
        return replace(
            self,
            transfer=self.transfer.with_effects(kept),
            effects=tuple(kept),
            optional=(),
            layers=tuple(layer.without_effects(gone) for layer in self.layers),
        )

    @property
    def planes(self) -> int:
        """Planes of layers: 1 where each place needs its own color alone, else one per color."""
        return 1 if self.is_mosaic else len(self.mosaic.colors)

    @property
    def scatter(self) -> float:
        """Factor by which a mean square over the pixels may lie above that of all places.

        Two standard errors of the squares of normal numbers.
        """
        return 1 + 2 * math.sqrt(2 / (self.geometry.rows * self.geometry.columns))

    @property
    def usable_error(self) -> float:
        """Error that the light may have over all places, rms, relative to full signal.

        Effects that are left out err below the frequencies that are lost: their squares add. Few
        pixels may lose more than all places do on average.
        """
        used = USED_SHARE * self.settings.tolerance
        return math.sqrt(max(used**2 - self.omitted_share**2, 0.0) / self.scatter)

    @property
    def judged_weights(self) -> Array:
        """Spectral weights (K, J) by which detail is judged: those of the color with most light.

        Of a layer they are those of all colors together: a black one has detail in its opacity.
        """
        weights = self.transfer.weights
        if self.has_opacity:
            return np.asarray(weights.mean(axis=1))
        return np.asarray(weights[:, int(self.transfer.level.sum(axis=0).argmax())])

    @property
    def separable(self) -> tuple[SeparableTransfer, ...]:
        """Transfer functions that are products of one along x and one along y."""
        return of_kind(self.effects, SeparableTransfer)

    @property
    def drift(self) -> tuple[float, float]:
        """Displacement of the image per length down the sensor, along x and y."""
        drifts = [motion.drift for motion in of_kind(self.effects, ImageMotion)]
        return sum(x for x, _ in drifts), sum(y for _, y in drifts)

    @property
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the array's middle, along x and y [m]."""
        moved = [motion.displacement for motion in of_kind(self.effects, ImageMotion)]
        return sum(x for x, _ in moved), sum(y for _, y in moved)

    def seen_along(self, direction: tuple[float, float]) -> tuple[Array, float]:
        """Return the part of the columns in what pixels see along a direction, and the rows' slope.

        A pixel at (x, y) sees the place of the image whose product with the direction is the part
        of its column and the slope times y.

        Parameters
        ----------
        direction : tuple of float
            Factors (a, b) of places to the right and downwards.

        Returns
        -------
        columns : Array
            Parts (columns,): a times lengths, and what is the same for all pixels.
        slope : float
            Factor of y, where photodetectors collect light: b, less where the image drifts.
        """
        g, (a, b) = self.geometry, direction
        x, _ = pixel_centers(g, detector=True)
        (drift_x, drift_y), (moved_x, moved_y) = self.drift, self.displacement
        skew = b * drift_y + a * drift_x
        # Rows are read one after the other, wherever in its pixel a photodetector is.
        return a * (x - moved_x) - b * moved_y + skew * g.collecting_y, b - skew

    @property
    def is_displaced(self) -> bool:
        """Whether photodetectors see the image at other places than their own."""
        return any((*self.drift, *self.displacement))

    @property
    def travel(self) -> float:
        """How far motion takes light from its place [m]."""
        return sum((motion.travel for motion in of_kind(self.effects, ImageMotion)), 0.0)

    @property
    def averages_over_box(self) -> bool:
        """Whether pixels average evenly over one rectangle, or are points."""
        return not self.separable or [e.box is not None for e in self.separable] == [True]

    @property
    def averaged_width(self) -> float:
        """Smaller side of the area that pixels average over [m]; 0 where they are points."""
        return max((min(e.box) for e in self.separable if e.box is not None), default=0.0)

    @property
    def field(self) -> FieldTransfer | None:
        """The blur that changes over the field, where there is one."""
        found = of_kind(self.effects, FieldTransfer)
        if len(found) > 1:
            raise ValueError("one blur at most may change over the field")
        return found[0] if found else None

    @cached_property
    def field_rings(self) -> tuple[Zone, ...]:
        """Places of that blur on the half-axis to the right; () without such a blur."""
        return () if self.field is None else self.field.rings(self.settings.field_zones)

    @cached_property
    def zones(self) -> tuple[Zone, ...]:
        """Its zones, turned with the azimuth; () without such a blur."""
        return () if self.field is None else self.field.zones(self.settings.field_zones)


@dataclass(frozen=True)
class Layer:
    """A part of the light on the sensor; all layers together are the signal.

    An image has one. A blur that changes over the field makes it one for each zone, or adds one for
    each mode; their weights are the layers'. Each ring of a far field adds twice as many.
    """

    values: Callable[[int, slice], Array]
    """From a color and array rows to its signal there, (rows, columns) [electrons / s]."""
    weight: Callable[[Array, Array], Array] | None = None
    """A factor at the positions x (columns,), y (rows,) [m]: (rows, columns); None for 1."""

    def from_color(self, first: int) -> Layer:
        """Return the layer with another one as its first color."""
        if not first:
            return self
        return replace(self, values=lambda color, rows: self.values(first + color, rows))

    def scaled(self, scales: Array) -> Layer:
        """Return the layer over a scale (C,) of each color."""
        return replace(self, values=lambda color, rows: self.values(color, rows) / scales[color])

    def fill(
        self, tile: Array, mosaic: Mosaic, rows: slice, first: tuple[int, int] = (0, 0)
    ) -> None:
        """Put the signal of rows where it belongs: every color in its plane, or in its pixels.

        Parameters
        ----------
        tile : Array
            What is filled, (C, rows, columns), or (1, rows, columns) with each pixel in its own
            color; places without a pixel are left alone [e/s].
        mosaic : Mosaic
            Colors of the pixels.
        rows : slice
            Rows of the layer.
        first : tuple of int, optional
            Row and column of the array where the layer begins.
        """
        if len(tile) > 1:
            for color, plane in enumerate(tile):
                plane[:] = self.values(color, rows)
            return
        period = len(mosaic.block)
        for phase in range(min(period, tile.shape[1])):
            row = rows.start + phase
            for color, places in mosaic.row_colors(first[0] + row, first[1]):
                found = self.values(color, slice(row, rows.stop, period))
                for columns in places:
                    tile[0, phase::period, columns] = found[:, columns]

    def add(
        self,
        out: Array,
        mosaic: Mosaic,
        rows: slice,
        place: tuple[Array, Array],
        first: tuple[int, int] = (0, 0),
        is_alone: bool = False,
    ) -> None:
        """Add the signal of rows, times its weight.

        Parameters are those of `fill`, and:

        Parameters
        ----------
        place : tuple of Array
            Positions x (columns,) and y (rows,) of these rows [m].
        is_alone : bool, optional
            Whether nothing was added before.
        """
        if is_alone and self.weight is None:
            self.fill(out, mosaic, rows, first)
            return
        tile = np.zeros_like(out)
        self.fill(tile, mosaic, rows, first)
        if self.weight is not None:
            tile *= self.weight(*place)
        out += tile


Layers = Iterator[Layer]
"""One is made when the one before is done with: each may take much memory."""


@dataclass(frozen=True)
class DepthReport:
    """How the layers of a scene were put one before the other."""

    cells: int
    """Cells along each side of a pixel on which rays meet the layers where they are finest; 0 where
    all rays of each pixel see the same."""
    rays: int
    """Rays of each pixel there."""
    error: float
    """Predicted rms error of both and of the layers' own images, relative to full signal."""
    left_out: float = 0.0
    """Bound on what of it layers hide of each other from some rays alone where that was not summed,
    likewise."""
    ray_values: int = 0
    """Values of layers that rays looked up."""


@dataclass(frozen=True)
class CutReport:
    """How a picture with depth was cut into layers, and what it hides."""

    layers: int
    error: float
    """Predicted rms error of the cuts and of the cells of rays, relative to full signal."""
    cell: float
    """Side of the cells on which layers were composed ray by ray [m]; 0 where that changes none."""
    hidden_rms: float
    """Estimated rms error of what was guessed of the hidden background, relative to full signal."""
    hidden_most: float
    """Estimate of the largest error in a pixel, likewise."""
    ray_values: int = 0
    """Values that were moved to where a ray sees them."""


@dataclass(frozen=True)
class SpectrumReport:
    """How a scene was sampled and filtered, and what each transfer function does to it."""

    oversampling: float = 0.0
    """Highest frequency [pixel Nyquist]; 0 where the scene is known in closed form."""
    lost_rms: float = 0.0
    """Estimated rms of the signal that a chart's cells and the end of the spectrum leave out and 32
    bits round; the error of margin, mixtures and tables is not in it [electrons / s]."""
    cells: int = 0
    """Samples of one plane of the scene that were transformed; 0 where its spectrum is known."""
    cells_per_pixel: float = 0.0
    """Cells of a painted chart per pixel pitch; 0 where there are none."""
    waves: int = 0
    """Waves that it is the sum of, beside even light, each evaluated at all pixels."""
    edges: int = 0
    """Parallel edges that it lies between, evaluated by distance."""
    times: int = 1
    """How often it was formed: again where it is much darker than assumed."""
    is_averaged: bool = False
    """Whether it was averaged over the photodetectors, as no blur needs its spectrum."""
    is_painted: bool = False
    """Whether they had to be painted, as those of a chart."""
    edge_seconds: float = 0.0
    """What a painted chart costs beside its cells: see `Chart`."""
    far_parts: int = 0
    """Rectangles of the far field, each with a spectrum of its own."""
    far_cells: int = 0
    """Samples of one plane in all of them."""
    far_filters: int = 0
    """Times that one of their spectra was filtered."""
    terms: int = 0
    """Terms of one plane's spectrum that were filtered; 0 where there was no need to."""
    planes: int = 0
    """Mixtures of the scene's components that were transformed."""
    changes: dict[str, float] = field(default_factory=dict)
    """Transfer function -> rms change of the signal by leaving it out [electrons / s]."""
    filters: int = 0
    """Times that the spectrum was filtered: for each parity, and for each mode of the field."""
    has_field: bool = False
    """Whether a blur changes over the field."""
    field_seconds: float = 0.0
    """Core seconds of what that blur is looked up in [s]."""
    is_sheared: bool = False
    """Whether each row sees the image at another place, as a rolling shutter in motion does."""
    sub_exposures: int = 0
    """Instants whose mean an exposure is; 0 where it is no such mean."""
    sub_exposure_error: float = 0.0
    """Estimated rms error by them and by the places at which the still image is known, relative to
    full signal."""
    fine_pixels: int = 0
    """Those places; 0 where there is no need for them."""
    places_per_pixel: int = 0
    """How many of them lie along each side of a pixel."""
    warped_cells: int = 0
    """Cells that were painted where a warp sees them."""
    table_values: int = 0
    """Values of transfer functions of fx and fy that were computed."""
    peak: float = 0.0
    """Bound on the signal before blur: a ceiling above it changes nothing [electrons / s]."""
    memory: int = 0
    """Estimated memory [bytes]."""
    device: str = "cpu"
    """Where samples were transformed, filtered and evaluated; all else is the processor's."""
    depth: DepthReport | None = None
    """How layers were put one before the other; None of a flat scene."""
    cut: CutReport | None = None
    """How a picture with depth was cut into layers; None of other scenes."""
    parts: tuple[tuple[Geometry, int, SpectrumReport], ...] = ()
    """Of each layer: its cells as if they were pixels, colors of light and opacity, its report."""

    @property
    def computed_on(self) -> str:
        """Device that transformed, filtered and evaluated samples of the scene, or of a layer."""
        every = [self.device, *(own.computed_on for *_, own in self.parts)]
        return next((device for device in every if device != "cpu"), "cpu")
