"""Figures that compare pictures with their perfect images: pictures, iso-lines, distributions.

Each needs frames of its own, of all repeats and seeds of the study, whose S-CIELAB maps are shared
by the figures of a sweep.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.scene.charts import Csf
from vcam_cli.processing.tone import codes
from vcam_cli.quality import error_map, iso_lines
from vcam_cli.quality.modes import density, density_modes
from vcam_cli.records import dataclass
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import simulate
from vcam_cli.sweeps.plots import Curve, FigureContent, Panel
from vcam_cli.sweeps.study_cameras import FigureCamera, PlannedFigure
from vcam_cli.sweeps.sweep_tables import Row

BIN = 0.01
"""Width of the bins in which values of Delta E are counted."""
QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
STEPS, SHOWN = 600, 0.97
"""About the steps of a drawn density, and the share of the pixels that it shows."""


@dataclass(frozen=True)
class MapAxes:
    """Quantities along columns and rows of a map: places on the sensor, or a chart's variables."""

    labels: tuple[str, str]
    x: Array
    """(columns,) places [mm], or frequencies of the chart's bars [lp/mm]."""
    y: Array
    """(rows,) places downward [mm], or contrasts of the chart, from the top."""
    pitch: float
    """The pitch of the columns [m]."""
    chart: Csf | None
    """The contrast sensitivity chart, if the camera sees one."""

    def panel(self, title: str, **content: Any) -> Panel:
        """Return a panel of the whole map; content: its fields."""
        content |= {"x_limits": _edges(self.x), "y_limits": _edges(self.y)[::-1]}
        return Panel(*self.labels, title=title, is_square=self.chart is None, **content)

    def lines(self, values: Array, level: float) -> list[Array]:
        """Return the lines along which a map is at a level, each (n, 2); of a chart one."""
        if self.chart is None:
            return iso_lines.map_lines(values, self.x, self.y, level)
        is_inside = (self.y >= 0) & (self.y <= self.chart.max_contrast)
        rows = np.where(is_inside, self.y, np.nan)
        contrast = iso_lines.chart_line(values, self.x * 1e3, rows, self.pitch, level)
        return [np.stack([self.x, contrast], axis=1)[self.x >= 0]]


def _edges(centers: Array) -> tuple[float, float]:
    """Return the first edge and the last of cells with these centers."""
    step = (centers[-1] - centers[0]) / max(1, len(centers) - 1)
    return float(centers[0] - step / 2), float(centers[-1] + step / 2)


def _axes(camera: Camera, x: Array, y: Array) -> MapAxes:
    """Return the axes of maps with columns at x and rows at y, downward [m]."""
    chart, pitch = camera.scene.source, float(np.ptp(x)) / max(1, len(x) - 1)
    if not isinstance(chart, Csf) or not chart.max_frequency or not pitch:
        return MapAxes(("x [mm]", "y, downward [mm]"), x * 1e3, y * 1e3, pitch, None)
    g = geometry(camera)
    width = g.scene_width_on_sensor or g.sensor_width
    height = width * g.sensor_height / g.sensor_width
    frequency = chart.max_frequency * (x / width + 0.5) / 1e3
    contrast = chart.max_contrast * (0.5 - y / height)
    return MapAxes(("spatial frequency [lp/mm]", "contrast"), frequency, contrast, pitch, chart)


@dataclass(frozen=True)
class ErrorMaps:
    """The frames of a camera against their perfect images."""

    delta_e: Array
    """(rows, columns) S-CIELAB of the first frame."""
    worst_delta_e: Array
    """(rows, columns) the largest S-CIELAB of the repeats, each the mean of its seeds."""
    ideal: Array
    """(rows, columns, 1 or 3) sRGB codes of the perfect image of the first frame."""
    image: Array
    """(rows, columns, 1 or 3) sRGB codes of the camera's image."""
    counts: Array
    """(n,) pixels of all frames whose Delta E lies in a bin of `BIN`, from 0."""
    mean: float
    """The mean Delta E of all pixels of all frames."""
    axes: MapAxes


class MapCache:
    """The error maps of a sweep's figures, computed where a figure first needs them."""

    def __init__(self, seeds: int) -> None:
        """Keep nothing yet; seeds: the number of frame seeds of the study."""
        self._seeds, self._shared = seeds, Shared()
        self._maps: dict[str, ErrorMaps] = {}

    def maps(self, camera: FigureCamera) -> ErrorMaps:
        """Return the maps of a camera; VcamError or MemoryError where they cannot be computed."""
        key = camera.camera.model_dump_json()
        if key not in self._maps:
            self._maps[key] = self._compute(camera)
        return self._maps[key]

    def _compute(self, camera: FigureCamera) -> ErrorMaps:
        first, *others = (simulate(frame, shared=self._shared) for frame in camera.frames)
        frames = np.stack([np.asarray(r.s_cielab, np.float32) for r in (first, *others)])
        repeats = frames.reshape(-1, self._seeds, *frames.shape[1:])
        layout = first.frame.layout
        return ErrorMaps(
            frames[0],
            repeats.mean(axis=1, dtype=float).max(axis=0),
            codes(first.ideal, "srgb", 8),
            codes(first.linear, "srgb", 8),
            np.bincount((np.maximum(frames, 0) / BIN).astype(int).ravel()),
            float(frames.mean(dtype=float)),
            _axes(camera.camera, np.asarray(layout.picture_x), np.asarray(layout.picture_y)),
        )


def pictures(planned: PlannedFigure, cache: MapCache) -> FigureContent:
    """Return for each camera the perfect image, its own, lines of equal Delta E, and the map."""
    rows, panels = list[Row](), list[Panel]()
    for camera in planned.cameras:
        maps = cache.maps(camera)
        panel = maps.axes.panel
        name = f", {planned.label(camera)}" if len(planned.cameras) > 1 else ""
        panels.append(panel("perfect image" + name, image=maps.ideal))
        panels.append(panel("camera's image" + name, image=maps.image))
        if planned.figure.levels:
            points, curves = _lines(planned, camera, maps)
            panels.append(panel("lines of equal ΔE" + name, curves=tuple(curves)))
            rows += points
        scale = error_map.scale_limit(maps.delta_e)
        panels.append(panel("S-CIELAB ΔE" + name, image=maps.delta_e, scale=scale))
    columns = (*planned.head, "level", "part", *maps.axes.labels)
    in_row = 2 if len(panels) == 4 else len(panels) // len(planned.cameras)
    return FigureContent(columns, rows, tuple(panels), in_row)


def iso_line_figure(planned: PlannedFigure, cache: MapCache) -> FigureContent:
    """Return the lines of equal Delta E of several cameras in one panel."""
    rows, curves = list[Row](), list[Curve]()
    for camera in planned.cameras:
        maps = cache.maps(camera)
        points, lines = _lines(planned, camera, maps)
        rows, curves = rows + points, curves + lines
    panel = replace(maps.axes.panel("", curves=tuple(curves)), y_limits=None)
    columns = (*planned.head, "level", "part", *maps.axes.labels)
    return FigureContent(columns, rows, (panel,))


def _lines(
    planned: PlannedFigure, camera: FigureCamera, maps: ErrorMaps
) -> tuple[list[Row], list[Curve]]:
    """Return the points of a camera's lines, and the lines, told apart by color and dashes."""
    rows, curves = list[Row](), list[Curve]()
    number, levels = planned.cameras.index(camera), sorted(planned.figure.levels)
    by_level = planned.figure.show == "pictures" or len(planned.cameras) == 1
    for kind, level in enumerate(levels):
        style = (kind, 0) if by_level else (number, kind)
        name = [] if by_level else [planned.label(camera)]
        name += [f"ΔE {level:g}"] if by_level or len(levels) > 1 else []
        for part, line in enumerate(maps.axes.lines(maps.worst_delta_e, level)):
            text = ", ".join(name) if part == 0 else ""
            curves.append(Curve(text, line[:, 0], line[:, 1], *style))
            known = line[np.isfinite(line).all(axis=1)]
            rows += [(camera.case, camera.cell, level, part, float(x), float(y)) for x, y in known]
    return rows, curves


def distribution(planned: PlannedFigure, cache: MapCache) -> FigureContent:
    """Return the distribution of Delta E over the pixels: density, quantiles, mean, modes."""
    rows, curves, marks = list[Row](), list[Curve](), list[tuple[float, int]]()
    every = [cache.maps(camera) for camera in planned.cameras]
    shown = max(int(np.searchsorted(_cumulative_shares(maps)[1:], SHOWN)) + 2 for maps in every)
    step = max(1, shown // STEPS)
    for number, (camera, maps) in enumerate(zip(planned.cameras, every, strict=True)):
        modes = density_modes(maps.counts, BIN, float(maps.delta_e.size))
        y = density(maps.counts, BIN, modes.bandwidth)[:shown:step]
        x = (np.arange(len(y)) * step + 0.5) * BIN
        edges, count = np.arange(len(maps.counts) + 1) * BIN, len(modes.locations)
        table: list[Row] = [
            ("mean", "", maps.mean),
            *(
                ("quantile", q, float(np.interp(q, _cumulative_shares(maps), edges)))
                for q in QUANTILES
            ),
            ("standard deviation", "", modes.spread),
            ("modes", "", float(count)),
            *(("mode", i, place) for i, place in enumerate(modes.locations, start=1)),
            ("bandwidth", "", modes.bandwidth),
            ("bandwidth of one mode", "", modes.critical_bandwidth),
            *(("density", float(f"{at:.6g}"), float(v)) for at, v in zip(x, y, strict=True)),
        ]
        rows += [(camera.case, camera.cell, *row) for row in table]
        summary = f"mean {maps.mean:.2f}, {count} mode" + "s" * (count != 1)
        curves.append(Curve(f"{planned.label(camera)}: {summary}", x, y, number))
        marks.append((maps.mean, number))
    panel = Panel(
        "S-CIELAB ΔE of a pixel; dotted: mean", "density", tuple(curves), marks=tuple(marks),
        x_limits=(0.0, shown * BIN), y_limits=(0, None),
    )  # fmt: skip
    return FigureContent((*planned.head, "what", "at", "value"), rows, (panel,))


def _cumulative_shares(maps: ErrorMaps) -> Array:
    """Return the share of pixels below every edge of a bin."""
    return np.concatenate([[0.0], np.cumsum(maps.counts) / maps.counts.sum()])
