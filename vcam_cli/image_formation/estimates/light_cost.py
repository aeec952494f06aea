"""What the light at the pixels costs in time: as it was computed, or would be by other effects.

Core seconds of the machine that the constants were measured on; `cost_model` says how fast another
one is.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import astuple, field, replace
from functools import cached_property

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import (
    Blur,
    FieldTransfer,
    GeometricTransfer,
    PlaneTransfer,
    SeparableTransfer,
)
from vcam_cli.effects.warps import Magnification, StillWarp, Warp
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.estimates.bandwidth import FREQUENCY_SHARE, highest_passed, reach
from vcam_cli.image_formation.estimates.chart_cells import (
    SURE,
    CellError,
    cell_grid,
    cells_per_pixel,
)
from vcam_cli.image_formation.far_field import far_parts, near_field
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene, HarmonicScene, SampledScene
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.waves import WaveScene

FIXED = 0.6e-3
"""What does not depend on the size of a frame's light [s]."""
SPECTRUM = 11e-3
"""The same where it has a spectrum: tables of the transfer function, edges of a chart [s]."""
FAR_PART = 1.7e-3
"""The same of each ring of a far field [s]."""
SAMPLE = 4.3e-9
"""Transforming one sample of one plane of the scene [s]."""
PAINT = 1.8e-9
"""Painting one sample of one plane of a chart, its edges aside [s]."""
TERM = 1.15e-9
"""Filtering one term of the spectrum for one plane and color [s]."""
EVALUATE = 7.5e-9
"""One pixel of one color from its spectrum [s]."""
FAR = 41e-9
"""The same from the spectrum of a part of the far field, whose cells and pixels have no common grid
[s]."""
OTF = 25e-9
"""One value of a round transfer function at one wavelength [s]."""
PUPIL = 0.05
"""Transforms of the pupil of one wavefront at all wavelengths [s]."""
TABLE = 1e-6
"""One value of a transfer function of fx and fy, its part of the pupil's transforms too [s]."""
AVERAGE = 3.5e-9
"""One pixel of one color as the mean of a chart over its photodetector [s]."""
AVERAGE_SAMPLED = 25e-9
"""More for one of a picture, and one sample of it [s]."""
PAINT_PIXEL = 12e-9
"""One pixel painted as the exact mean of a chart [s]."""
LEVEL = 0.5e-9
"""One pixel of one color of even light [s]."""
WAVE = 5e-9
"""More for each wave [s]."""
FIELD_OF_LEVEL = 1.6e-3
"""What a blur over the field takes of even light, which it does not change: its places [s]."""
EDGES, EDGE = 3.5e-3, 0.2e-3
"""What does not depend on the number of pixels of light between parallel edges, and more for each
edge [s]."""
BESIDE = 5e-9
"""One pixel of one color beside parallel edges, however many [s]."""
SPLINE = 40e-9
"""One value of the still image behind sub-exposures into coefficients of splines [s]."""
LOOK = 110e-9
"""One pixel of one color at one instant of its exposure [s]."""
PROBED = 4
"""Instants on all of the array that as much work as their choice would be."""
OCCLUDE = 30e-9
"""One pixel of light or opacity put before what is behind [s]."""
RAY = 12e-9
"""One value of a cell's light or cover moved to where a ray sees it, and composed [s]."""
LOOK_UP = 3e-9
"""One value of a layer that a ray looks up, painted and composed [s]."""

WARPED = 0.18e-6
"""One cell looked up where a warp sees it, painted and averaged, of all planes. As measured, 0.12
before a ColorChecker to 0.16 before `table-top` and 0.25 before a photograph [s]."""

DIRECTED = 4
"""Cost of a transfer function of fx and fy along a line over that of a round one."""
ENTRIES = 2560
"""Frequencies at which a round transfer function is known, for its tables and to judge them."""
PLANES = 4
"""Mixtures that replace a scene's spectra, at most, as often as not."""
PARITIES, MODES, MODES_OF_EDGES = 4, 4, 2
"""Filters of a blur with a direction, and of one that changes over the field, about: few parallel
edges need fewer modes."""
FIELD = 0.035
"""Finding the modes of a blur over the field up to the Nyquist frequency of the pixels, and by its
square up to another [s]."""
SHEARED = 1.3
"""Cost of pixels whose rows see the scene at other places over that of others."""
ENTRIES_OF_PLANE = 150
"""Entries along an axis of a table over fx and fy, about."""
WARPED_CELLS, COLOR_GROUPS = 6, 4
"""Cells of a warped chart per pixel, and wavelengths at which a warp by color is followed, as often
as not."""
BEYOND = 1.15
"""Where the spectrum of a chart ends over where that of edges anywhere would, as often as not; that
of parallel edges ends there."""
FIRST = 0.65
"""Cost of light that is formed once more, being darker than assumed, over that of its last image:
the brighter light may err by more, which takes fewer terms and modes (0.62 to 0.73)."""
HIGHEST = 2.0
"""Highest frequency of a picture that is filtered, as often as not [pixel Nyquist]."""
WAVES = WaveScene | HarmonicScene
"""Scenes of few waves, whose frequencies are known."""


@dataclass(frozen=True)
class FilterWork:
    """What a device computes of an image in place of the processor, as counts."""

    samples: float = 0.0
    """Samples of all planes that are transformed."""
    terms: float = 0.0
    """Terms that are filtered, by plane and color."""
    values: float = 0.0
    """Pixels that are evaluated, by color and filter."""
    looks: float = 0.0
    """Places of a moving image that are looked up, by color and instant."""

    @property
    def seconds(self) -> float:
        """Time that they take the processor [core seconds]."""
        filtered = SAMPLE * self.samples + TERM * self.terms + EVALUATE * self.values
        return filtered + LOOK * self.looks

    def __add__(self, other: FilterWork) -> FilterWork:
        """Return the sum of the work on two images."""
        mine, others = astuple(self), astuple(other)
        return FilterWork(*(a + b for a, b in zip(mine, others, strict=True)))


def filter_work(geometry: Geometry, colors: int, report: SpectrumReport) -> FilterWork:
    """Return what a device would compute of an image as it was formed, layers included.

    Parameters
    ----------
    geometry, colors, report
        As those of `image_seconds`.
    """
    flat = _flat_work(geometry, colors, report)
    return sum((filter_work(*part) for part in report.parts), flat)


def _flat_work(geometry: Geometry, colors: int, report: SpectrumReport) -> FilterWork:
    values = geometry.rows * geometry.columns * colors
    looks = _looks(values, colors, report)
    if report.is_averaged or not report.terms:
        return FilterWork(looks=looks)
    return FilterWork(
        samples=report.cells * report.planes,
        terms=report.terms * report.planes * colors * report.filters,
        values=report.filters * values * (SHEARED if report.is_sheared else 1),
        looks=looks,
    )


def _looks(values: int, colors: int, report: SpectrumReport) -> float:
    """Return the places looked up at all instants of an exposure; a mosaic needs half of them."""
    if not report.sub_exposures:
        return 0.0
    return values * (0.5 if colors > 1 else 1.0) * (report.sub_exposures + PROBED)


def image_seconds(geometry: Geometry, colors: int, report: SpectrumReport) -> float:
    """Return the core seconds of an image as it was formed, that of layers included.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    colors : int
        Number of colors.
    report : SpectrumReport
        How it was formed.

    Returns
    -------
    float
        Seconds.
    """
    rays = RAY * report.cut.ray_values if report.cut else 0.0
    rays += LOOK_UP * report.depth.ray_values if report.depth else 0.0
    once = (
        rays
        + _flat_seconds(geometry, colors, report)
        + sum(
            _flat_seconds(cells, planes, own) + OCCLUDE * cells.rows * cells.columns * planes
            for cells, planes, own in report.parts
        )
    )
    return once * (1 + FIRST * (report.times - 1))


def _flat_seconds(geometry: Geometry, colors: int, report: SpectrumReport) -> float:
    values = geometry.rows * geometry.columns * colors
    work = _flat_work(geometry, colors, report).seconds
    always = FIXED + _spline_seconds(colors, report) + report.edge_seconds + work
    if report.is_averaged:
        painted = PAINT_PIXEL * geometry.rows * geometry.columns if report.is_painted else 0.0
        sampled = AVERAGE_SAMPLED * (values + report.cells) if report.cells else 0.0
        return always + AVERAGE * values + painted + sampled
    if not report.terms:
        edges = EDGES + EDGE * report.edges + BESIDE * values if report.edges else 0.0
        level = LEVEL * values + FIELD_OF_LEVEL * report.has_field
        return always + level + WAVE * report.waves * values + edges
    cells_of_part = report.far_cells / max(1, report.far_parts)
    return (
        always
        + SPECTRUM
        + FAR_PART * report.far_parts
        + PAINT * report.is_painted * report.cells * report.planes
        + FAR * report.far_filters * values
        + FIELD * report.oversampling**2 * report.has_field
        + report.field_seconds
        + (SAMPLE + PAINT) * report.far_cells * report.planes
        + TERM * colors * report.far_filters * report.planes * cells_of_part
        + TABLE * report.table_values
        + PUPIL * bool(report.table_values)
        + WARPED * report.warped_cells
    )


def _spline_seconds(colors: int, report: SpectrumReport) -> float:
    """Return the core seconds of the still image behind sub-exposures."""
    return (EVALUATE + SPLINE) * report.fine_pixels * colors if report.sub_exposures else 0.0


@dataclass(frozen=True)
class LightCost:
    """What light through some of a path's effects costs, before it is computed."""

    path: OpticalPath
    """Lens, pixels and settings."""
    scene: AnyScene
    """The scene, flat."""
    _images: dict[tuple[str, ...], tuple[float, bool]] = field(default_factory=dict)
    """Names of effects that blur -> seconds of the image that they make, and whether it has a
    spectrum, of those requested before."""

    @cached_property
    def _blurs(self) -> tuple[Effect, ...]:
        """Effects on which the time of the image depends.

        Waves need their transfer at their own frequencies alone, no table of it.
        """
        tabulated = () if isinstance(self.scene, WAVES) else (Blur, SeparableTransfer)
        return of_kind(self.path.effects, FieldTransfer, Warp, *tabulated)

    def saved(self, omitted: Collection[Effect]) -> float:
        """Return the time that leaving out some effects saves.

        Parameters
        ----------
        omitted : collection of Effect
            These effects.

        Returns
        -------
        float
            Time [core seconds].
        """
        pixels = self.path.geometry.rows * self.path.geometry.columns
        gains = sum(effect.pixel_seconds for effect in omitted) * pixels
        names = {effect.name for effect in omitted}
        kept = tuple(blur for blur in self._blurs if blur.name not in names)
        if len(kept) == len(self._blurs):  # the image is the same, whatever it takes
            return gains
        return gains + self._image(self._blurs)[0] - self._image(kept)[0]

    @property
    def of_all(self) -> float:
        """Time of the image with every effect, if it has a spectrum; else 0 [core seconds]."""
        seconds, has_spectrum = self._image(self._blurs)
        return seconds if has_spectrum else 0.0

    def _image(self, blurs: tuple[Effect, ...]) -> tuple[float, bool]:
        names = tuple(blur.name for blur in blurs)
        if names not in self._images:
            self._images[names] = self._image_seconds(blurs)
        return self._images[names]

    def _image_seconds(self, blurs: Sequence[Effect]) -> tuple[float, bool]:
        every = of_kind(blurs, Blur)  # tables of a blur over the field are in `FIELD`
        computed = of_kind(every, GeometricTransfer)
        tabulated = [blur for blur in every if blur not in computed]
        lines = len(tabulated) + (DIRECTED - 1) * len(of_kind(tabulated, PlaneTransfer))
        otfs = lines * OTF * ENTRIES * len(self.path.transfer.wavelengths)
        still, g = of_kind(blurs, StillWarp), self.path.geometry
        report = expected_report(self.path, self.scene, blurs)
        seconds = otfs + image_seconds(g, len(self.path.mosaic.colors), report)
        if len(still) > len(of_kind(still, Magnification)):
            seconds += WARPED * WARPED_CELLS * g.rows * g.columns
        seconds *= COLOR_GROUPS if any(warp.knots for warp in still) else 1
        return seconds, report.terms > 0


def expected_report(
    path: OpticalPath, scene: AnyScene, effects: Sequence[Effect], with_memory: bool = False
) -> SpectrumReport:
    """Return how a scene would be sampled and filtered.

    The spectrum of a chart ends where its edges let it, that of a picture where the lens does.

    Parameters
    ----------
    path, scene, effects
        As those of `LightCost`.
    with_memory : bool, optional
        Whether the memory of a sampled scene is estimated, too: a tenth of the time of a plan.
    """
    scene = scene.flat if isinstance(scene, LayeredScene | DepthScene) else scene
    if path.transfer.is_dark:
        return SpectrumReport()
    if isinstance(scene, WAVES):
        waves = scene.waves_that_vary if isinstance(scene, WaveScene) else 1
        has_field = bool(of_kind(effects, FieldTransfer))
        return SpectrumReport(waves=waves, has_field=has_field)
    profile = scene.chart.profile() if isinstance(scene, ChartScene) else None
    if profile and of_kind(effects, Blur) and not of_kind(effects, FieldTransfer):
        return SpectrumReport(edges=len(profile.places))
    path = path.with_effects(effects)
    if not path.transfer.effects and not path.field and path.averages_over_box:
        return _averaged(path, scene)
    if profile and not path.field:
        return SpectrumReport(edges=len(profile.places))
    planes = min(PLANES, len(path.transfer.weights))
    beyond = 1.0 if profile else BEYOND
    found = _sampled(path, scene, planes, beyond, with_memory)
    directed = bool(path.transfer.plane_blurs)
    modes = MODES_OF_EDGES if profile else MODES
    filters = modes if path.field else PARITIES if directed else 1
    return replace(
        found,
        planes=planes,
        filters=filters,
        far_filters=filters * found.far_filters,
        table_values=ENTRIES_OF_PLANE**2 * planes * bool(path.transfer.tabulated_blurs),
        has_field=path.field is not None,
        field_seconds=path.field.table_seconds if path.field else 0.0,
        is_sheared=any(path.drift),
    )


def _averaged(path: OpticalPath, scene: SampledScene) -> SpectrumReport:
    """Return the report of means over the photodetectors."""
    samples = 0 if isinstance(scene, ChartScene) else math.prod(scene.shape)
    planes = len(path.transfer.level.T)
    found = SpectrumReport(
        is_averaged=True,
        cells=samples,
        memory=memory_model.box_average_bytes(samples, planes, path.geometry, path.settings),
    )
    if not isinstance(scene, ChartScene) or not scene.is_painted:
        return found
    return replace(found, is_painted=True, edge_seconds=scene.chart.edge_seconds)


def _sampled(
    path: OpticalPath, scene: SampledScene, planes: int, beyond: float, with_memory: bool
) -> SpectrumReport:
    """Return the cells of a scene, the predicted terms of its spectrum and their memory."""
    g = path.geometry
    pixels = g.rows * g.columns
    if not isinstance(scene, ChartScene):
        end = min(highest_passed(path, scene), HIGHEST)
        cells, terms = math.prod(scene.shape), round(pixels * end**2)
        needed = memory_model.image_bytes(path, scene, end, planes, ()) if with_memory else 0
        return SpectrumReport(oversampling=end, cells=cells, terms=terms, memory=needed)
    widest = reach(path) + path.travel
    near = near_field(path, scene, widest)
    rings = far_parts(path, near, scene, widest)
    highest, cells = highest_passed(path, near), 0
    error = FREQUENCY_SHARE * path.settings.tolerance * path.full
    # Where a blur over the field is least, the image ends next to where it would without it, and
    # its cells are 2 % coarser; tables of its contrast would take longer than all of the plan.
    sharp = path.with_effects([e for e in path.effects if e is not path.field])
    of_cells = CellError.of_chart(sharp, near, highest)
    end = beyond * 2 * max(g.pitch_x, g.pitch_y) * of_cells.end(error / SURE)
    if scene.is_painted:
        highest = cells_per_pixel(sharp, near, highest, of_cells).per_pixel
        near = near.with_cells(cell_grid(near, g, highest))
        cells = math.prod(near.shape)
    highest = min(end, highest)
    needed = memory_model.image_bytes(path, near, highest, planes, rings) if with_memory else 0
    return SpectrumReport(
        oversampling=highest,
        cells=cells,
        terms=round(pixels * highest**2),
        memory=needed,
        is_painted=scene.is_painted,
        edge_seconds=scene.chart.edge_seconds if scene.is_painted else 0.0,
        far_parts=len(rings),
        far_cells=sum(math.prod(part.scene.shape) for part in rings),
        far_filters=len(rings),
    )
