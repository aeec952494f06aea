"""Scenes of another size on the sensor: as a lens magnifies them by wavelength."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, ChartScene, Harmonics, HarmonicScene, Scene
from vcam_cli.scenes.closed_form import LightDisc, Products, Profile
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.waves import WaveScene


def magnified(scene: Scene, factor: float) -> Scene:
    """Return a scene whose image is larger by a factor, about the array's center.

    All that is known of it in closed form stays so.

    Parameters
    ----------
    scene : Scene
        The scene.
    factor : float
        Factor on all lengths, positive.
    """
    match scene:
        case WaveScene():
            waves = (replace(w, fx=w.fx / factor, fy=w.fy / factor) for w in scene.waves)
            return replace(scene, waves=tuple(waves))
        case HarmonicScene():
            chart = magnified(scene.chart, factor)
            assert isinstance(chart, ChartScene)
            return replace(scene, harmonics=_Magnified(scene.harmonics, factor), chart=chart)
        case ChartScene():
            return replace(scene, chart=MagnifiedChart(scene.chart, factor))
        case ImageScene():
            return replace(scene, pitch_x=scene.pitch_x * factor, pitch_y=scene.pitch_y * factor)
    raise ValueError(f"no magnification of a {type(scene).__name__}")


@dataclass(frozen=True)
class _Magnified:
    """A pattern that repeats, likewise."""

    harmonics: Harmonics
    factor: float

    @property
    def period(self) -> tuple[float, float]:
        """Period along x and y [m]."""
        x, y = self.harmonics.period
        return x * self.factor, y * self.factor

    def amplitudes(self, count_x: int, count_y: int) -> Array:
        """Return the amplitudes of its series, which do not change."""
        return self.harmonics.amplitudes(count_x, count_y)


@dataclass(frozen=True, eq=False)
class MagnifiedChart(Chart):
    """A chart whose lengths are larger by a factor."""

    chart: Chart
    factor: float

    brightest = property(lambda self: self.chart.brightest)
    darkest = property(lambda self: self.chart.darkest)
    edge_seconds = property(lambda self: self.chart.edge_seconds)
    painted = property(lambda self: self.chart)
    undivided = property(lambda self: self.chart.undivided * self.factor)
    separates = property(lambda self: self.chart.separates)

    def highest_frequency(self, half_width: float) -> float:
        """Return the frequency beyond which it has no detail [cycles/m]."""
        return self.chart.highest_frequency(half_width / self.factor) / self.factor

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells between edges into an array."""
        self.chart.paint(x_edges / self.factor, y_edges / self.factor, mix, out)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values (R, len(y), len(x)) at points."""
        return self.chart.values(x / self.factor, y / self.factor, mix)

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> MagnifiedChart:
        """Return a chart that looks the same on these cells, if one is faster there."""
        chart = self.chart.crop_to_cells(x_edges / self.factor, y_edges / self.factor)
        return replace(self, chart=chart)

    def edges(self) -> tuple[Array, Array] | None:
        """Return where the light of even rectangles may change [m]."""
        found = self.chart.edges()
        return None if found is None else (found[0] * self.factor, found[1] * self.factor)

    def even_values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values of even rectangles at points, without discs."""
        return self.chart.even_values(x / self.factor, y / self.factor, mix)

    def discs(self, mix: Array) -> tuple[LightDisc, ...]:
        """Return the discs that lie on it."""
        lengths = ("x", "y", "radius")
        return tuple(
            replace(disc, **{name: getattr(disc, name) * self.factor for name in lengths})
            for disc in self.chart.discs(mix)
        )

    def products(self, x_edges: Array, y_edges: Array, mix: Array) -> Products:
        """Return the light as a sum of products, averaged over cells between edges [m]."""
        return self.chart.products(x_edges / self.factor, y_edges / self.factor, mix)

    def profile(self) -> Profile | None:
        """Return the light of a chart of parallel straight edges; else None."""
        found = self.chart.profile()
        return None if found is None else replace(found, places=found.places * self.factor)

    def sample_borders(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return where light that is even between lines may change, within cells."""
        x, y = self.chart.sample_borders(x_edges / self.factor, y_edges / self.factor)
        return x * self.factor, y * self.factor

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of its edges: lengths over an area."""
        center, size = (np.array(pair) / self.factor for pair in (region.center, region.size))
        own = Region((float(center[0]), float(center[1])), (float(size[0]), float(size[1])))
        return self.chart.edge_energy(own, level, ceiling).scaled(1 / self.factor)
