"""What a scene is to the camera: a few spatial parts B_k(x, y), each with one spectrum S_k.

Spectral radiance on the sensor plane: L(x, y, wavelength) = sum_k B_k(x, y) S_k(wavelength)
[W/(sr m2 m)], with x to the right, y down, in meters on the sensor from the array's center, and
upright: magnification's two reversals are left out, the top of the scene is row 0.

Why three kinds of scene: sinusoids (`waves.py`) and charts that repeat (`HarmonicScene`) are known
in closed form and stay exact, all else is samples.
`SampledScene.planes(mix)` paints as many mixtures of 25 spectra as the camera needs.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import DTypeLike

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.records import dataclass
from vcam_cli.scenes.bands import bands_of_rows, paint_by_bands
from vcam_cli.scenes.blur_change import BlurLoss, ChangeBounds, profile_bounds, rectangle_bounds
from vcam_cli.scenes.cells import Spans, cell_edges, edges_within, extremes_within
from vcam_cli.scenes.closed_form import LightDisc, Products, Profile, Rectangles
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height, rectangle_energy
from vcam_cli.scenes.waves import WaveScene
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True)
class View:
    """The rectangle of the sensor plane a scene must fill, centered on the array's center.

    rows, columns: pixels; pitch_x, pitch_y: [m]; oversampling: chart samples per pixel pitch;
    margin: pixels that a chart goes on beyond the array on every side;
    scene_width: [m] on the sensor when the scene's extent has a width, None when the scene covers
    the array; dtype of planes; cell_error: what means over a chart's cells may err, rms of white;
    covered: [m] width and height that a scene covers where a lens distorts, None for the array's;
    seen: pitches of what photodetectors see over those of pixels, along x and y. A chart is a whole
    number of the former long: its waves fold onto the pixels', which takes a quarter of the time.
    """

    rows: int
    columns: int
    pitch_x: float
    pitch_y: float
    oversampling: int = 1
    margin: int = 0
    scene_width: float | None = None
    dtype: DTypeLike = np.float64
    cell_error: float = 0.0
    covered: tuple[float, float] | None = None
    seen: tuple[float, float] = (1.0, 1.0)

    @property
    def width(self) -> float:
        """Width of the array [m]."""
        return self.columns * self.pitch_x

    @property
    def height(self) -> float:
        """Height of the array [m]."""
        return self.rows * self.pitch_y

    @property
    def size(self) -> tuple[float, float]:
        """Width and height that a scene covers [m]."""
        return self.covered or (self.width, self.height)

    @property
    def frame(self) -> "Frame":
        """Where a chart's picture lies: what the array sees, or `scene_width` in its aspect."""
        if self.scene_width is None:
            return Frame(*self.size)
        return Frame(self.scene_width, self.scene_width * self.height / self.width)

    @property
    def shape(self) -> tuple[int, int]:
        """Cells of a chart (ny, nx): array and margin, `oversampling` a pixel pitch."""
        rows, columns = self.rows + 2 * self.margin, self.columns + 2 * self.margin
        return rows * self.oversampling, columns * self.oversampling


@dataclass(frozen=True)
class Frame:
    """A rectangle centered on the array's center: width and height [m]."""

    width: float
    height: float


@runtime_checkable
class Harmonics(Protocol):
    """A pattern that repeats along x and y, symmetric about the array's center along both."""

    @property
    def period(self) -> tuple[float, float]:
        """Period along x and y [m]."""

    def amplitudes(self, count_x: int, count_y: int) -> Array:
        """Return the amplitudes of the cosine series.

        Parameters
        ----------
        count_x, count_y : int
            Terms along x and y.

        Returns
        -------
        Array
            Amplitudes (count_y, count_x), relative to the perfect white. Entry (l, k) is that of
            cos(2 pi k x / p_x) cos(2 pi l y / p_y).
        """


@dataclass(frozen=True)
class HarmonicScene:
    """A chart that repeats without end: its cosine series is known, and no cell samples it.

    Where the lens passes too many of its harmonics, `chart` is sampled as any other.
    """

    spectra: tuple[Spectrum, ...]
    harmonics: Harmonics
    white: Spectrum
    chart: "ChartScene"

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k at points.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, m, n), in the unit of `mix`.
        """
        return self.chart.values_at(x, y, mix)

    def change_bounds(
        self, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float, allowed: float
    ) -> ChangeBounds:
        """Return that no bound is known: a lens that ends the series saves more than it costs.

        Parameters
        ----------
        losses : sequence of BlurLoss
            The blurs, all of one light.
        geometry : Geometry
            Geometry of the array.
        ceiling : float
            Rate that fills a pixel [e/s].
        allowed : float
            Change over full signal that matters.

        Returns
        -------
        ChangeBounds
            inf for each blur.
        """
        return ChangeBounds(0.0, [math.inf] * len(losses))


@dataclass(frozen=True)
class SampledScene(ABC):
    """A grid of samples centered on the array's center.

    samples = "squares": an image, every sample a uniform square of light, mirrored at the border;
    "averages": averages of a continuous chart over the cells. `shape` (ny, nx); pitches [m].
    `spectra` [W/(sr m2 m)] are such that B = 1 is `white`, the perfect white's radiance.
    """

    spectra: tuple[Spectrum, ...]
    white: Spectrum
    shape: tuple[int, int]
    pitch_x: float
    pitch_y: float
    samples: Literal["squares", "averages"]
    dtype: DTypeLike

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of the grid [m]."""
        return self.pitch_x * self.shape[1], self.pitch_y * self.shape[0]

    @abstractmethod
    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return sum_k mix[r, k] B_k on the grid.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components.
        workers : int, optional
            Number of threads; the result does not depend on it.

        Returns
        -------
        Array
            Planes (R, ny, nx) in the view's type.
        """

    @abstractmethod
    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k at points.

        Parameters
        ----------
        x : Array
            Positions (n,) right of the array's center, rising [m].
        y : Array
            Positions (m,) below it, rising [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, m, n).
        """

    @property
    @abstractmethod
    def brightest(self) -> float:
        """Brightest light of a component, relative to what the perfect white has of it."""

    def rectangles(self, mix: Array) -> Rectangles | None:
        """Return the whole grid's area as even rectangles; None where it is not made of them.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Rectangles or None
            The rectangles; None where the light is not made of them.
        """
        return None

    def change_bounds(
        self, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float, allowed: float
    ) -> ChangeBounds:
        """Return bounds on what blurs change of the mean signal.

        Parameters
        ----------
        losses : sequence of BlurLoss
            The blurs, all of one light.
        geometry : Geometry
            Geometry of the array.
        ceiling : float
            Rate that fills a pixel [e/s].
        allowed : float
            Change over full signal that matters: larger ones need not differ from inf.

        Returns
        -------
        ChangeBounds
            The bounds.
        """
        return ChangeBounds(0.0, [math.inf] * len(losses))


SPARSE = 8_000_000
"""Memory of SciPy's sparse matrices, and of what they import [bytes]."""


@dataclass(frozen=True)
class PaintedCells:
    """Cells of a chart that are painted at once, among those of a grid."""

    shape: tuple[int, int]
    """Rows and columns."""
    pitch: float
    """Longer side of a cell [m]."""
    extent: tuple[float, float]
    """Width and height of the grid [m]."""
    values: int
    """Memory of all planes of a cell [bytes]."""

    @property
    def count(self) -> int:
        """Number of cells that are painted at once."""
        return math.prod(self.shape)

    @property
    def in_grid(self) -> float:
        """Number of cells of the grid, about."""
        return math.prod(self.extent) / self.pitch**2


class Chart(ABC):
    """A picture on the whole plane; positions in meters from the array's center, rising.

    It goes on beyond its frame, where the array sees it through the margin. `mix` is (R, K),
    and its dtype is that of the result.
    """

    edge_seconds: ClassVar[float] = 0.0
    """Core seconds to find the edges that a frame sees, whatever its cells; see `cost_model`."""
    undivided: ClassVar[float] = math.inf
    """Largest width of cells that are painted as they are; wider ones are painted in parts [m]."""

    painted: "ClassVar[Chart | None]" = None
    """Chart that this one is painted from, on the same cells; None of one that stands alone."""

    @property
    def brightest(self) -> float:
        """Brightest light, relative to the perfect white."""
        return 1.0

    @property
    def darkest(self) -> float:
        """Bound below its light at all wavelengths, over white; 0 where none is known."""
        return 0.0

    def highest_frequency(self, half_width: float) -> float:
        """Return the frequency beyond which a chart has no detail; inf where edges are sharp.

        Parameters
        ----------
        half_width : float
            Distance from the center within which detail counts [m].

        Returns
        -------
        float
            Frequency [cycles/m].
        """
        return math.inf

    @abstractmethod
    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells between edges into an array.

        Parameters
        ----------
        x_edges : Array
            Edges (nx + 1,) of the cells along x, rising [m].
        y_edges : Array
            Edges (ny + 1,) of the cells along y, rising [m].
        mix : Array
            Mixtures (R, K) of the parts; their type is that of the result.
        out : Array
            Array (R, ny, nx) that is written.
        """

    @abstractmethod
    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points.

        Parameters
        ----------
        x, y : Array
            Places along the rows and columns [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, len(y), len(x)), in the unit of `mix`.
        """

    @property
    def sources(self) -> tuple[Array, ...]:
        """Arrays that it is painted from, files aside, which charts may share."""
        return self.painted.sources if self.painted else ()

    def painting_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of temporary arrays of a thread that paints cells, beside their values.

        Parameters
        ----------
        cells : PaintedCells
            The cells that are painted at once.

        Returns
        -------
        int
            Memory [bytes].
        """
        return self.painted.painting_bytes(cells) if self.painted else 0

    def kept_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of what is kept, or shared by threads, once cells are painted.

        Parameters
        ----------
        cells : PaintedCells
            The cells that are painted at once.

        Returns
        -------
        int
            Memory [bytes].
        """
        return self.painted.kept_bytes(cells) if self.painted else 0

    def box_averages(
        self, x: Array, y: Array, size: tuple[float, float], mix: Array
    ) -> Array | None:
        """Return the averages over boxes, if a chart knows them other than by cells with edges.

        Parameters
        ----------
        x, y : Array
            Centers of the boxes along the rows and columns, rising [m].
        size : tuple of float
            Width and height of the boxes, which may overlap [m].
        mix : Array
            Mixtures (R, K) of the parts; their type is that of the result.

        Returns
        -------
        Array or None
            Averages (R, len(y), len(x)), in the unit of `mix`; None where `paint` serves.
        """
        return None

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> "Chart":
        """Return a chart that looks the same on these cells, if one is faster there.

        Parameters
        ----------
        x_edges, y_edges : Array
            Rising edges of the cells [m].

        Returns
        -------
        Chart
            That chart, or this one.
        """
        return self

    def edges(self) -> tuple[Array, Array] | None:
        """Return where the light of a chart of even rectangles may change, x and y rising [m].

        It is None for all others: the light must be the same all over between neighboring edges,
        its `discs` aside.
        """
        return None

    def even_values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values of even rectangles at points, without discs.

        Parameters
        ----------
        x, y : Array
            Places along the rows and columns [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, len(y), len(x)), in the unit of `mix`.
        """
        return self.values(x, y, mix)

    def value_ends(self, x: Spans, y: Spans, mix: Array) -> tuple[Array, Array] | None:
        """Return the least and the largest value in rectangles, of a chart that knows them.

        Parameters
        ----------
        x, y : Spans
            Where the rectangles begin and where they end, (n,) along x and (m,) along y [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        low, high : Array
            Values (R, m, n), in the unit of `mix`; None where the chart does not know them.
        """
        edges = self.edges()
        if edges is None or self.discs(np.zeros((1, mix.shape[1]))):
            return None
        inside = [_between(e, *spans) for e, spans in zip(edges, (x, y), strict=True)]
        values = self.even_values(inside[0][0], inside[1][0], mix)
        return extremes_within(values, inside[1][1], inside[0][1])

    def discs(self, mix: Array) -> tuple[LightDisc, ...]:
        """Return the discs that lie on a chart of even rectangles, if it has any.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        tuple of LightDisc
            The discs; () where there are none.
        """
        return ()

    separates: ClassVar[bool] = False
    """Whether its light is a sum of few products of functions of x and y: `products`."""

    def products(self, x_edges: Array, y_edges: Array, mix: Array) -> Products:
        """Return the light as such a sum, averaged over cells between edges [m].

        Parameters
        ----------
        x_edges, y_edges : Array
            Rising edges of the cells [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Products
            Functions of y and of x whose products add up to the light.

        Raises
        ------
        ValueError
            If the chart is no such sum.
        """
        raise ValueError(f"{type(self).__name__} is no sum of products")

    def profile(self) -> Profile | None:
        """Return the light of a gray chart of parallel straight edges without end; else None."""
        return None

    def sample_borders(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return where light that is even between lines along x and y may change, within cells.

        Parameters
        ----------
        x_edges, y_edges : Array
            Edges of the cells, rising [m].

        Returns
        -------
        x, y : Array
            Places along x and along y [m]; none of a chart of other light.
        """
        return np.empty(0), np.empty(0)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return how much edge the chart has, at most.

        Parameters
        ----------
        region : Region
            Where edges count.
        level : Array
            Light (K,) of each component where it is 1, in any unit.
        ceiling : float
            Light that fills a pixel, in the same unit: edges between brighter ones do not count.

        Returns
        -------
        EdgeEnergy
            Sums of squared heights times lengths, over the region's area.
        """
        edges = self.edges()
        if edges is None:
            raise ValueError(f"{type(self).__name__} does not define the length of its edges")
        x, y = (
            np.concatenate([[c - size], np.sort(e[np.abs(e - c) < size]), [c + size]])
            for e, c, size in zip(edges, region.center, region.size, strict=True)
        )
        middle_x, middle_y = ((e[1:] + e[:-1]) / 2 for e in (x, y))
        mix = np.asarray(level, float)[None]
        light = self.even_values(middle_x, middle_y, mix)[0]
        energy = rectangle_energy(x, y, light, region, ceiling)
        for disc in self.discs(mix):
            around = self.even_values(np.array([disc.x]), np.array([disc.y]), mix)[0, 0]
            height = float(counted_height(around, around + disc.height, ceiling)[0])
            energy += EdgeEnergy(oblique=2 * math.pi * disc.radius * height / region.area)
        return energy

    def averages(self, x_edges: Array, y_edges: Array, mix: Array) -> Array:
        """Return the averages over cells.

        Parameters
        ----------
        x_edges, y_edges : Array
            Rising edges of the cells [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Averages (R, len(y_edges) - 1, len(x_edges) - 1), in the unit and float type of `mix`.
        """
        out = np.empty((len(mix), len(y_edges) - 1, len(x_edges) - 1), mix.dtype)
        self.paint(x_edges, y_edges, mix, out)
        return out


@dataclass(frozen=True)
class ChartScene(SampledScene):
    """A chart as cell averages over the view (array and margin), painted in bands of rows."""

    chart: Chart
    center: tuple[float, float] = (0.0, 0.0)
    """Of the cells, x and y from the array's center [m]."""

    def with_cells(self, shape: tuple[int, int]) -> "ChartScene":
        """Return the same part of the chart on another grid of cells.

        Parameters
        ----------
        shape : tuple of int
            Cells (ny, nx).

        Returns
        -------
        ChartScene
            The scene.
        """
        ny, nx = shape
        width, height = self.extent
        return replace(self, shape=shape, pitch_x=width / nx, pitch_y=height / ny)

    def crop(self, center: tuple[float, float], width: float, height: float) -> "ChartScene":
        """Return a rectangle of the chart as a single cell.

        Parameters
        ----------
        center : tuple of float
            Its center (x, y) [m].
        width, height : float
            Its sides [m].

        Returns
        -------
        ChartScene
            The scene.
        """
        return replace(self, shape=(1, 1), pitch_x=width, pitch_y=height, center=center)

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return the averages over the cells, painted in bands of rows."""
        out = np.empty((len(mix), *self.shape), self.dtype)
        paint = self.painter(mix)
        paint_by_bands(lambda rows: paint(rows, out[:, rows]), *self.shape, workers)
        return out

    def painter(self, mix: Array) -> Callable[[slice, Array], None]:
        """Return what writes the averages over the cells of some rows.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        callable
            Takes a slice of rows, and the array (R, rows, nx) to write into.
        """
        ny, nx = self.shape
        x_edges = self.center[0] + cell_edges(nx, self.pitch_x)
        y_edges = self.center[1] + cell_edges(ny, self.pitch_y)
        mix = np.asarray(mix, self.dtype)
        chart = self.chart.crop_to_cells(x_edges, y_edges)

        def paint(rows: slice, out: Array) -> None:
            chart.paint(x_edges, y_edges[rows.start : rows.stop + 1], mix, out)

        return paint

    @property
    def brightest(self) -> float:
        """Brightest light of the chart, relative to the perfect white."""
        return self.chart.brightest

    def discs(self, mix: Array) -> tuple[LightDisc, ...]:
        """Return the chart's discs that may touch the grid's area.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        tuple of LightDisc
            The discs.
        """
        return tuple(disc for disc in self.chart.discs(mix) if disc.touches(*self.extent))

    def rectangles(self, mix: Array) -> Rectangles | None:
        """Return the grid's area as even rectangles, of a chart that is made of them.

        Its discs are not in them; those that touch the area must lie within it.
        """
        edges = self.chart.edges()
        if edges is None or not self.has_rectangles:
            return None
        x, y = (edges_within(e, size / 2) for e, size in zip(edges, self.extent, strict=True))
        middle_x, middle_y = ((e[1:] + e[:-1]) / 2 for e in (x, y))
        values = self.chart.even_values(middle_x, middle_y, np.asarray(mix, float))
        return Rectangles(x, y, values)

    @cached_property
    def has_rectangles(self) -> bool:
        """Whether it is made of even `rectangles`, and of discs within its area."""
        discs = self.discs(np.zeros((1, len(self.spectra))))
        within = all(disc.lies_within(*self.extent) for disc in discs)
        return within and self.chart.edges() is not None

    @cached_property
    def component_rectangles(self) -> Rectangles | None:
        """Its `rectangles` in each component by itself."""
        return self.rectangles(np.eye(len(self.spectra)))

    @property
    def is_painted(self) -> bool:
        """Whether it has no closed form."""
        return not self.chart.separates and not self.has_rectangles

    def change_bounds(
        self, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float, allowed: float
    ) -> ChangeBounds:
        """Return bounds for charts of straight edges; no bound is known of others."""
        components = len(losses[0].weights)
        profile = self.chart.profile()
        if profile is not None:
            return profile_bounds(profile, losses, geometry, ceiling)
        found = self.component_rectangles
        if found is None or self.discs(np.eye(components)):
            return super().change_bounds(losses, geometry, ceiling, allowed)
        return rectangle_bounds(found.x, found.y, found.values, losses, geometry, ceiling)

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the chart's values at points: (R, m, n)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        out = np.empty((len(mix), len(y), len(x)), self.dtype)
        mix = np.asarray(mix, self.dtype)
        for rows in bands_of_rows(len(y), len(x)):
            out[:, rows] = self.chart.values(x, y[rows], mix)
        return out


def _between(edges: Array, first: Array, last: Array) -> tuple[Array, Spans]:
    """Return a place between any two edges, before and behind all, and which spans have some."""
    edges, every = np.unique(edges), np.concatenate([edges, first, last])
    size = float(np.ptp(every))
    every = np.concatenate([[every.min() - size], edges, [every.max() + size]])
    middle = (every[1:] + every[:-1]) / 2
    return middle, (np.searchsorted(edges, first, "right"), np.searchsorted(edges, last, "left"))


Scene = WaveScene | HarmonicScene | SampledScene
"""Whatever stands before the lens."""
