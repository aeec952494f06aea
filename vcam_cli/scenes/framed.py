"""Charts on a view's cells, whole or as a picture in a frame."""

from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, ChartScene, Frame, View
from vcam_cli.scenes.cells import clip_cells, edges_within
from vcam_cli.scenes.closed_form import LightDisc, Products
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height
from vcam_cli.spectra import Spectrum


def chart_scene(
    chart: Chart, spectra: tuple[Spectrum, ...], white: Spectrum, view: View
) -> ChartScene:
    """Return the chart on the view's cells, black outside the frame where it has a width.

    Parameters
    ----------
    chart : Chart
        The chart.
    spectra : tuple of Spectrum
        Radiance of each of its parts [W/(sr m2 m)].
    white : Spectrum
        Radiance of the perfect white [W/(sr m2 m)].
    view : View
        The array, and the size of the scene.

    Returns
    -------
    ChartScene
        The scene.
    """
    if view.scene_width is not None:
        chart = Framed(chart, view.frame)
    return ChartScene(
        spectra=spectra,
        white=white,
        shape=view.shape,
        pitch_x=view.seen[0] * view.pitch_x / view.oversampling,
        pitch_y=view.seen[1] * view.pitch_y / view.oversampling,
        samples="averages",
        dtype=view.dtype,
        chart=chart,
    )


@dataclass(frozen=True)
class Framed(Chart):
    """A chart seen through a frame: black outside, cells on the frame's edge area-sampled."""

    chart: Chart
    frame: Frame
    edge_seconds = property(lambda self: self.chart.edge_seconds)
    painted = property(lambda self: self.chart)
    undivided = property(lambda self: self.chart.undivided)

    @property
    def brightest(self) -> float:
        """Brightest light of the chart, in the frame or not."""
        return self.chart.brightest

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells, those on the frame's edge by area."""
        out[:] = 0
        columns, cover_x, inside_x = clip_cells(x_edges, self.frame.width / 2)
        rows, cover_y, inside_y = clip_cells(y_edges, self.frame.height / 2)
        if len(cover_x) and len(cover_y):
            picture = self.chart.averages(inside_x, inside_y, mix)
            picture *= np.outer(cover_y, cover_x).astype(mix.dtype)
            out[:, rows, columns] = picture

    separates = property(lambda self: self.chart.separates)

    def products(self, x_edges: Array, y_edges: Array, mix: Array) -> Products:
        """Return the chart's products, 0 outside the frame."""
        columns, cover_x, inside_x = clip_cells(x_edges, self.frame.width / 2)
        rows, cover_y, inside_y = clip_cells(y_edges, self.frame.height / 2)
        own = self.chart.products(inside_x, inside_y, mix)
        terms = own.down.shape[1]
        down = np.zeros((len(y_edges) - 1, terms))
        along = np.zeros((len(mix), terms, len(x_edges) - 1))
        down[rows], along[..., columns] = own.down * cover_y[:, None], own.along * cover_x
        return Products(down, along)

    def even_values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values without discs at points: 0 outside the frame."""
        inside = np.outer(abs(y) <= self.frame.height / 2, abs(x) <= self.frame.width / 2)
        return self.chart.even_values(x, y, mix) * inside

    def discs(self, mix: Array) -> tuple[LightDisc, ...]:
        """Return the chart's discs."""
        return self.chart.discs(mix)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the chart and of the frame's border, as bright as the chart is."""
        bright = self.chart.brightest * float(np.abs(level).max())
        border = 2 * (self.frame.width + self.frame.height)
        height = float(counted_height(np.zeros(1), np.full(1, bright), ceiling)[0])
        own = self.chart.edge_energy(region, level, ceiling)
        return own + EdgeEnergy(aligned=height * border / region.area)

    def edges(self) -> tuple[Array, Array] | None:
        """Return where the light may change, the frame's own edges included."""
        inner, size = self.chart.edges(), (self.frame.width, self.frame.height)
        discs = self.chart.discs(np.zeros((1, 1)))
        if inner is None or not all(disc.lies_within(*size) for disc in discs):
            return None
        sides = (self.frame.width / 2, self.frame.height / 2)
        x, y = (edges_within(e, half) for e, half in zip(inner, sides, strict=True))
        return x, y

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> "Framed":
        """Return the same frame around a chart that may be faster on these cells."""
        _, _, inside_x = clip_cells(x_edges, self.frame.width / 2)
        _, _, inside_y = clip_cells(y_edges, self.frame.height / 2)
        if len(inside_x) and len(inside_y):
            return replace(self, chart=self.chart.crop_to_cells(inside_x, inside_y))
        return self

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points: 0 outside the frame."""
        inside = np.outer(abs(y) <= self.frame.height / 2, abs(x) <= self.frame.width / 2)
        return self.chart.values(x, y, mix) * inside
