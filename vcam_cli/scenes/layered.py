"""Layers of a scene, each with its light and its opacity, the nearest first.

What a layer sends where it covers a part a of a place is a times its own light, and it lets the
part 1 - a of the light behind it pass. Behind a lens both are blurred according to the layer's
distance, by image formation; `flat` is the scene as a pinhole sees it.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import pieces
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, ChartScene, Frame, PaintedCells, Scene, View
from vcam_cli.scenes.cells import Spans, means_of_parts, window_extremes
from vcam_cli.scenes.closed_form import Profile
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, total_energy
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.scenes.picture_chart import Inside, PictureChart
from vcam_cli.scenes.warped import SmoothMap, WarpedChart
from vcam_cli.spectra import Spectrum

PARTS = 4
"""Parts along each side of a pixel or of a larger cell, in which layers are
composited. The size of cells within pixels is chosen by their error, which includes this one."""
MOST_BORDERS = 16
"""Borders of samples in a cell that divide it, at most, in the mean: then their light and opacity
vary together by a sixteenth of their value, in one of this number of squared samples."""
AROUND = 6.0
"""Widths of a cell from which a cell sees nothing of a layer: splines leave 2e-6 of it there."""
MOST_PARTS = 1 << 20
"""Parts of cells, about, that are held at once."""
SAME = 1e-6
"""Part of a cell below which two places are one."""
EVEN = 1e-5
"""Variance within a cell below which opacity is even there: twice the rounding of its square."""


@dataclass(frozen=True, eq=False)
class MaskedChart(Chart):
    """A chart times its opacity, and, as the last component, its opacity."""

    light: Chart
    """Of K components."""
    opacity: PictureChart
    """0 where there is nothing."""

    edge_seconds = property(lambda self: self.light.edge_seconds)
    undivided = property(lambda self: self.light.undivided)
    painted = property(lambda self: self.light)

    @property
    def brightest(self) -> float:
        """Brightest light, relative to the perfect white."""
        return self.light.brightest

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells: exact, since samples of opacity divide them."""
        out[:] = 0
        (columns, across, x), (rows, down, y) = self.opacity.inside(x_edges, y_edges)
        if not len(across) or not len(down):
            return
        covered = out[:, rows, columns]
        if self.opacity.is_even:
            self._paint_light(x, y, mix, covered)
            covered *= self.opacity.picture[0, 0].astype(mix.dtype)
        else:
            self._paint_divided(x, y, mix, covered)
        rim_y, rim_x = (np.flatnonzero(part != 1) for part in (down, across))
        covered[:, rim_y] *= down[rim_y, None]
        covered[..., rim_x] *= across[rim_x]

    def _paint_light(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the light of cells that the layer covers as if its opacity were 1."""
        lit = np.flatnonzero(mix[:, :-1].any(axis=1))  # opacity alone has no light to paint
        count = lit[-1] + 1 if len(lit) else 0
        if count:
            self.light.paint(x_edges, y_edges, mix[:count, :-1], out[:count])
        out[count:] = 0
        for plane in np.flatnonzero(mix[:, -1]):
            out[plane] += mix[plane, -1]

    def _paint_divided(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over cells within the frame, divided by the samples of opacity."""
        borders = self.opacity.sample_borders(x_edges, y_edges)
        x, y = (_with_borders(*both) for both in zip((x_edges, y_edges), borders, strict=True))
        middle, first = (x[1:] + x[:-1]) / 2, np.searchsorted(y, y_edges)
        rows = out.shape[1]
        few = max(1, rows * MOST_PARTS // ((len(x) - 1) * (len(y) - 1)))
        for some in pieces(rows, few):
            here = y[first[some.start] : first[some.stop] + 1]
            seen = np.empty((len(mix), len(here) - 1, len(x) - 1), mix.dtype)
            self._paint_light(x, here, mix, seen)
            between = (here[1:] + here[:-1]) / 2
            seen *= self.opacity.values(middle, between, np.ones((1, 1), mix.dtype))
            out[:, some] = means_of_parts(seen, (here, x), (_edges(y_edges, some), x_edges))

    def sample_borders(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return where light or opacity may change within cells."""
        own = self.opacity.sample_borders(x_edges, y_edges)
        (_, across, x), (_, down, y) = self.opacity.inside(x_edges, y_edges)
        if not len(across) or not len(down):
            return own
        both = self.light.sample_borders(x, y), own
        x, y = (np.concatenate(places) for places in zip(*both, strict=True))
        return x, y

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        light = self.light.values(x, y, mix[:, :-1]) + mix[:, -1, None, None]
        return light * self.opacity.values(x, y, np.ones((1, 1), mix.dtype))

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the light's edges, and of the opacity's before the brightest."""
        own = self.light.edge_energy(region, level[:-1], ceiling)
        bright = float(abs(level[-1]))
        if isinstance(self.light, PictureChart) and not self.light.mirrored:
            if not bright:
                return own  # its border is among its own edges
            own, bright = own.scaled(2), math.sqrt(2) * bright  # (a + b)^2 <= 2 (a^2 + b^2)
        else:
            bright += self.light.brightest * float(np.abs(level[:-1]).max(initial=0.0))
        return own + self.opacity.edge_energy(region, np.ones(1), math.inf).scaled(bright**2)

    def edges(self) -> tuple[Array, Array] | None:
        """Return where light or opacity may change, if both are made of even rectangles."""
        light, opacity = self.light.edges(), self.opacity.edges()
        if light is None or opacity is None:
            return None
        x, y = (np.union1d(*both) for both in zip(light, opacity, strict=True))
        return x, y

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> "MaskedChart":
        """Return the same with light that may be faster on these cells."""
        (_, across, x), (_, down, y) = self.opacity.inside(x_edges, y_edges)
        if len(across) and len(down):
            return replace(self, light=self.light.crop_to_cells(x, y))
        return self


@dataclass(frozen=True, eq=False)
class LayerChart(Chart):
    """A layer's light times its opacity, and, as the last component, its opacity, in its place."""

    layer: "MaskedChart | PictureChart | WarpedLayer"
    """The same around the origin."""
    center: tuple[float, float] = (0.0, 0.0)
    """Of the layer, right and down [m]."""

    edge_seconds = property(lambda self: self.layer.edge_seconds)
    undivided = property(lambda self: self.layer.undivided)
    painted = property(lambda self: self.layer)

    @property
    def brightest(self) -> float:
        """Brightest light, relative to the perfect white; opacity is as bright as white."""
        return max(self.layer.brightest, 1.0)

    @property
    def even_opacity(self) -> "LayerChart | None":
        """Its opacity alone, in closed form, where it is the same all over its frame; else None."""
        layer = self.layer
        if isinstance(layer, MaskedChart) and layer.opacity.edges() is not None:
            return replace(self, layer=layer.opacity)
        return None

    @property
    def covers_frame(self) -> bool:
        """Whether nothing is seen behind it, all over its frame."""
        layer = self.layer
        if not isinstance(layer, MaskedChart) or not layer.opacity.is_even:
            return False
        return bool(layer.opacity.picture[0, 0, 0] == 1)

    def light_ends(self, x: Spans, y: Spans, mix: Array) -> tuple[Array, Array] | None:
        """Return the least and the largest light in rectangles, as if all were opaque.

        Parameters are those of `Chart.value_ends`, mixtures of the light alone.
        """
        if not isinstance(self.layer, MaskedChart):
            return None
        center_x, center_y = self.center
        own = (x[0] - center_x, x[1] - center_x), (y[0] - center_y, y[1] - center_y)
        return self.layer.light.value_ends(*own, mix)

    def opacity_extremes(
        self, x_edges: Array, y_edges: Array, size: tuple[int, int]
    ) -> tuple[Array, Array]:
        """Return bounds on the least and the largest opacity in windows of cells.

        Parameters
        ----------
        x_edges, y_edges : Array
            Edges of the cells (n + 1,) and (m + 1,), rising [m].
        size : tuple of int
            Rows and columns (k, l) of the windows.

        Returns
        -------
        low, high : Array
            Bounds (m - k + 1, n - l + 1).
        """
        layer = self.layer
        if not (isinstance(layer, MaskedChart) and layer.opacity.is_even):
            low, high = self.opacity_ends(x_edges, y_edges)
            low, high = (
                window_extremes(pick, plane, size)
                for pick, plane in ((np.minimum, low), (np.maximum, high))
            )
            return low, high
        columns, rows = layer.opacity.inside(x_edges - self.center[0], y_edges - self.center[1])
        along = [
            _extreme_shares(part, len(edges) - 1, count)
            for part, edges, count in zip((rows, columns), (y_edges, x_edges), size, strict=True)
        ]
        (full_y, lit_y), (full_x, lit_x) = along
        value = layer.opacity.picture[0, 0, 0]
        return value * np.outer(full_y, full_x), value * np.outer(lit_y, lit_x)

    def opacity_ends(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return bounds on the least and the largest opacity in cells (rows, columns)."""
        x, y = x_edges - self.center[0], y_edges - self.center[1]
        if isinstance(self.layer, WarpedLayer):
            return self.layer.opacity_ends(x, y)
        if isinstance(self.layer, MaskedChart):
            cover = self.layer.opacity
        else:
            cover = self.layer.channel(-1)
        one = np.ones((1, 1), cover.picture.dtype)
        mean, square = (chart.averages(x, y, one)[0] for chart in (cover, cover.squared))
        uneven = square - np.square(mean) > EVEN
        return np.where(uneven, 0, mean), np.where(uneven, cover.picture.max(), mean)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells."""
        self.layer.paint(x_edges - self.center[0], y_edges - self.center[1], mix, out)

    def kept_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of what is kept, a copy of a picture with its opacity among it."""
        copied = self.layer.picture.nbytes if isinstance(self.layer, PictureChart) else 0
        return int(copied + self.layer.kept_bytes(cells))

    def sample_borders(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return where the layer may change within cells, in its place."""
        x, y = self.layer.sample_borders(x_edges - self.center[0], y_edges - self.center[1])
        return x + self.center[0], y + self.center[1]

    def edges(self) -> tuple[Array, Array] | None:
        """Return where the light of a layer of even rectangles may change."""
        inner = self.layer.edges()
        if inner is None:
            return None
        return inner[0] + self.center[0], inner[1] + self.center[1]

    def profile(self) -> Profile | None:
        """Return the light of parallel straight edges that covers all, in its place; else None."""
        layer = self.layer
        if not (self.covers_frame and isinstance(layer, MaskedChart) and layer.opacity.mirrored):
            return None
        found = layer.light.profile()
        if found is None:
            return None
        moved = np.dot(found.across, self.center)
        return replace(found, places=found.places + moved)

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> "LayerChart":
        """Return the same layer as a chart that may be faster on these cells."""
        if not isinstance(self.layer, MaskedChart):
            return self
        x, y = x_edges - self.center[0], y_edges - self.center[1]
        return replace(self, layer=self.layer.crop_to_cells(x, y))

    def box_averages(
        self, x: Array, y: Array, size: tuple[float, float], mix: Array
    ) -> Array | None:
        """Return the averages over boxes, where the layer knows them."""
        return self.layer.box_averages(x - self.center[0], y - self.center[1], size, mix)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the layer in its place."""
        return self.layer.edge_energy(region.moved(*self.center), level, ceiling)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        return self.layer.values(x - self.center[0], y - self.center[1], mix)


@dataclass(frozen=True, eq=False)
class WarpedLayer(WarpedChart):
    """A layer in its place, seen through a map.

    Cells that look beside its rectangle see nothing: that is known without painting them. A
    frame of the shipped table top takes 4.3 s of processor time in place of 6.7.
    """

    chart: LayerChart
    frame: Frame | None = None
    """Rectangle that it lies in, about its center; None where it fills the frame."""

    def _tile(self, places: tuple[Array, Array], size: tuple[float, float], mix: Array) -> Array:
        if self.frame is not None:
            seen = self.sees.on_grid(*places)
            beyond = AROUND * self.sees.scales[1] * max(size)
            lengths = self.frame.width, self.frame.height
            for at, center, length in zip(seen, self.chart.center, lengths, strict=True):
                half = length / 2 + beyond
                if at.min() > center + half or at.max() < center - half:
                    return np.zeros((len(mix), *at.shape), mix.dtype)
        return super()._tile(places, size, mix)

    def opacity_ends(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return bounds on the least and the largest opacity in cells (rows, columns).

        They are those of all flat cells that a cell may see: about the one where its center looks,
        up to half its diagonal at the largest scale away, and one more.
        """
        pitches = [float(edges[-1] - edges[0]) / (len(edges) - 1) for edges in (x_edges, y_edges)]
        centers = ((edges[1:] + edges[:-1]) / 2 for edges in (x_edges, y_edges))
        seen, pitch = self.sees.on_grid(*centers), min(pitches)
        far = math.ceil(self.sees.scales[1] * math.hypot(*pitches) / 2 / pitch) + 1
        edges, index = [], []
        for at in seen:
            first = float(at.min()) - (far + 1) * pitch
            count = math.ceil((float(at.max()) - first) / pitch) + far + 1
            edges.append(first + pitch * np.arange(count + 1))
            index.append(((at - first) / pitch).astype(int) - far)
        size = 2 * far + 1, 2 * far + 1
        low, high = (
            window_extremes(pick, plane, size)[index[1], index[0]]
            for pick, plane in zip(
                (np.minimum, np.maximum), self.chart.opacity_ends(*edges), strict=True
            )
        )
        return low, high


@dataclass(frozen=True)
class LayerPart:
    """One layer on the sensor plane, enlarged as the lens images it."""

    chart: LayerChart
    size: Frame | None
    """Of the rectangle it lies in; None where it fills the frame."""
    components: slice
    """Those of the scene's components that are its light."""
    brightest: float
    """Its brightest light, relative to the perfect white."""


@dataclass(frozen=True)
class FlatLayers(Chart):
    """Layers as a pinhole sees them: nearer ones before those behind, all sharp."""

    parts: tuple[LayerPart, ...]
    pitch: float
    """Of the pixels, along the shorter of their sides [m]."""

    @property
    def brightest(self) -> float:
        """Brightest light of all layers, relative to the perfect white."""
        return max(part.chart.brightest for part in self.parts)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells.

        They are exact of pictures, whose samples divide pixels; of other light as if two edges
        never met in a part of a cell.
        """
        edges = (x_edges, y_edges)
        if not any(self._are_pixels(np.diff(e)) for e in edges):
            out[:] = self._compose(mix, lambda part, m: part.chart.averages(x_edges, y_edges, m))
            return
        borders = zip(*(p.chart.sample_borders(x_edges, y_edges) for p in self.parts), strict=True)
        x, y = (_divided(e, np.concatenate(b)) for e, b in zip(edges, borders, strict=True))
        found = self._compose(mix, lambda part, m: part.chart.averages(x, y, m))
        out[:] = means_of_parts(found, (y, x), (y_edges, x_edges))

    def _are_pixels(self, widths: Array) -> bool:
        """Return whether cells are pixels, or collecting areas with gaps between them."""
        return bool(widths.max() > self.pitch * (1 - 1e-9) or np.ptp(widths) > 1e-6 * widths.max())

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of all layers: an edge may have the brightest light behind it."""
        brightest = self.brightest * float(np.abs(level).max())
        levels = (np.append(level[part.components], brightest) for part in self.parts)
        return total_energy(
            part.chart.edge_energy(region, own, ceiling)
            for part, own in zip(self.parts, levels, strict=True)
        )

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points; layers are looked up within their rectangles alone."""

        def look(part: LayerPart, weights: Array) -> Array:
            if part.size is None:
                return part.chart.values(x, y, weights)
            ends = zip((x, y), part.chart.center, (part.size.width, part.size.height), strict=True)
            columns, rows = (np.flatnonzero(np.abs(at - c) <= size / 2) for at, c, size in ends)
            found: Array = np.zeros((len(weights), len(y), len(x)), weights.dtype)
            if len(columns) and len(rows):  # charts know no empty places
                found[:, rows[:, None], columns] = part.chart.values(x[columns], y[rows], weights)
            return found

        return self._compose(mix, look)

    def _compose(self, mix: Array, look: Callable[[LayerPart, Array], Array]) -> Array:
        total, clear = np.zeros(1, mix.dtype), np.ones(1, mix.dtype)
        for part in self.parts:
            own = mix[:, part.components]
            weights = np.zeros((len(mix) + 1, own.shape[1] + 1), mix.dtype)
            weights[:-1, :-1], weights[-1, -1] = own, 1
            found = look(part, weights)
            total = total + clear * found[:-1]
            clear = clear * (1 - found[-1])
        return total


def _extreme_shares(inside: Inside, count: int, width: int) -> tuple[Array, Array]:
    """Return where all cells of a window lie in a frame, and where one reaches into it: 0 or 1.

    inside, count: the cells along an axis that reach into it, and the number of all.
    width: cells of a window.
    """
    cells, cover, _ = inside
    full, lit = np.zeros((1, count), np.float32), np.zeros((1, count), np.float32)
    full[0, cells], lit[0, cells] = cover == 1, 1
    size = 1, width
    return window_extremes(np.minimum, full, size)[0], window_extremes(np.maximum, lit, size)[0]


def _edges(edges: Array, cells: slice) -> Array:
    """Return the edges of some of the cells."""
    return edges[cells.start : cells.stop + 1]


def _divided(edges: Array, borders: Array) -> Array:
    """Return the edges of cells, those between the parts of each, and borders within them."""
    steps = np.arange(PARTS) / PARTS
    parts = edges[:-1, None] + np.diff(edges)[:, None] * steps
    parts = np.append(parts.ravel(), edges[-1])
    if len(borders) > MOST_BORDERS * len(edges):
        return parts
    return _with_borders(parts, borders)


def _with_borders(parts: Array, borders: Array) -> Array:
    """Return the edges of parts, and borders within them."""
    if not len(borders):
        return parts
    near = SAME * float(np.diff(parts).min())  # what differs by rounding is one place
    borders = np.unique(borders)
    after = np.clip(np.searchsorted(parts, borders), 1, len(parts) - 1)
    clear = np.minimum(borders - parts[after - 1], parts[after] - borders) > near
    clear &= np.diff(borders, prepend=-np.inf) > near
    return np.sort(np.append(parts, borders[clear]))


@dataclass(frozen=True)
class LayeredScene:
    """Layers before the lens.

    Its components are the light of all layers, one after the other, and last white, by which
    opacity is measured; the picture has none of it.
    """

    parts: tuple[LayerPart, ...]
    flat: ChartScene
    """The layers as a pinhole sees them."""

    @property
    def brightest(self) -> float:
        """Brightest light of all layers, relative to the perfect white; 1 without layers."""
        return max(part.brightest for part in self.parts) or 1.0

    @property
    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiances of the components [W/(sr m2 m)]."""
        return self.flat.spectra

    @property
    def white(self) -> Spectrum:
        """Spectral radiance of the perfect white [W/(sr m2 m)]."""
        return self.flat.white

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k of the picture at points.

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
        return self.flat.values_at(x, y, mix)

    def warped(
        self,
        sees: SmoothMap,
        widest: float = math.inf,
        sharp: float = math.inf,
        alike: float = math.inf,
    ) -> "LayeredScene":
        """Return the layers as a lens shows them that distorts, each before its blur.

        Parameters
        ----------
        sees : SmoothMap
            Where places of the sensor look.
        widest, sharp, alike : float, optional
            As those of a `WarpedChart` [m, m, m2].

        Returns
        -------
        LayeredScene
            The layers. Their sizes are not known: a distorted rectangle has other borders.
        """
        how = sees, widest, sharp, alike
        parts = (
            replace(
                part, chart=LayerChart(WarpedLayer(part.chart, *how, frame=part.size)), size=None
            )
            for part in self.parts
        )
        flat = replace(self.flat, chart=WarpedChart(self.flat.chart, *how))
        return LayeredScene(tuple(parts), flat)

    def nearest_at(self, x: Array, y: Array) -> Array:
        """Return the number of the nearest layer that covers half of a point or more.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].

        Returns
        -------
        Array
            Numbers (m, n), 0 for the nearest layer.
        """
        found = np.full((len(y), len(x)), len(self.parts) - 1)
        for number in reversed(range(len(self.parts) - 1)):
            part = self.parts[number]
            opacity = np.zeros((1, part.components.stop - part.components.start + 1))
            opacity[0, -1] = 1
            found[part.chart.values(x, y, opacity)[0] >= 0.5] = number
        return found


AnyScene = Scene | LayeredScene | DepthScene
"""Whatever stands before the lens, flat or not."""


@dataclass(frozen=True)
class Layer:
    """What one layer is made of."""

    chart: MaskedChart | PictureChart
    """Light times opacity, and opacity as the last component, around the origin."""
    spectra: tuple[Spectrum, ...]
    """Of the light."""
    center: tuple[float, float]
    size: Frame | None
    brightest: float
    """Brightest light, relative to the perfect white."""


def layered_scene(layers: list[Layer], white: Spectrum, view: View) -> LayeredScene:
    """Return layers as a scene.

    Parameters
    ----------
    layers : list of Layer
        The layers, nearest first.
    white : Spectrum
        Spectral radiance of the perfect white [W/(sr m2 m)].
    view : View
        Rectangle that the picture of all has to fill.

    Returns
    -------
    LayeredScene
        The scene.
    """
    parts, spectra = list[LayerPart](), list[Spectrum]()
    for layer in layers:
        chart = LayerChart(layer.chart, layer.center)
        components = slice(len(spectra), len(spectra) + len(layer.spectra))
        parts.append(LayerPart(chart, layer.size, components, layer.brightest))
        spectra += layer.spectra
    pitch = min(view.pitch_x, view.pitch_y)
    flat = chart_scene(FlatLayers(tuple(parts), pitch), (*spectra, white), white, view)
    return LayeredScene(tuple(parts), flat)
