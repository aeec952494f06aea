"""Figures of pictures and their differences: each a table, and what draws it."""

from __future__ import annotations

from functools import partial

import numpy as np

from vcam_cli.camera.study_figures import Distribution, Iso, Picture
from vcam_cli.files.figure_plots import (
    Comparison,
    Curve,
    Panel,
    draw_comparison,
    draw_panels,
)
from vcam_cli.files.tables import Cell
from vcam_cli.quality.modes import density, modes
from vcam_cli.studies import figure_maps
from vcam_cli.studies.figure_curves import Made, Row, called, head, header, points_of
from vcam_cli.studies.figure_maps import BIN, Maps, Store
from vcam_cli.studies.figures import Planned

SHARES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are told."""
DRAWN, SHOWN = 600, 0.97
"""Steps of a drawn density, about, and how much of all pixels it shows: tails are long."""


def picture(planned: Planned, store: Store) -> Made:
    """Perfect image, camera's image, map of Delta E, lines of equal Delta E."""
    figure, view = planned.figure, planned.views[0]
    assert isinstance(figure, Picture)
    maps = store.maps(view)
    rows, curves = list[Row](), list[Curve]()
    for number, level in enumerate(figure.levels):
        for part, line in enumerate(figure_maps.lines(view.camera, maps, level)):
            name = f"{level:g}" if part == 0 else ""
            curves.append(Curve(name, line[:, 0], line[:, 1], number))
            rows += [(level, part, *point) for point in points_of(line)]
    where = figure_maps.area(view.camera, maps)
    found = Comparison(where, _gray(maps.ideal), _gray(maps.image), maps.delta_e, tuple(curves))
    columns = ("level", "part", where.x_label, where.y_label)
    draw = partial(draw_comparison, title=planned.title, found=found)
    return Made(columns, rows, lambda path: draw(path))


def _gray(codes: np.ndarray) -> np.ndarray:
    return codes[:, :, 0] if codes.shape[2] == 1 else codes


def iso(planned: Planned, store: Store) -> Made:
    """The line of one Delta E for several cameras."""
    figure = planned.figure
    assert isinstance(figure, Iso)
    rows, curves = list[Row](), list[Curve]()
    area = None
    for number, view in enumerate(planned.views):
        maps = store.maps(view)
        area = figure_maps.area(view.camera, maps)
        for part, line in enumerate(figure_maps.lines(view.camera, maps, figure.level)):
            name = called(planned, view) if part == 0 else ""
            curves.append(Curve(name, line[:, 0], line[:, 1], number))
            first = (*head(planned, view), figure.level, part)
            rows += [(*first, *point) for point in points_of(line)]
    assert area is not None
    panel = Panel(area.x_label, area.y_label, tuple(curves), ends=(area.left, area.right))
    columns = (*header(planned), "level", "part", area.x_label, area.y_label)
    draw = partial(draw_panels, title=planned.title, panels=[panel])
    return Made(columns, rows, lambda path: draw(path))


def distribution(planned: Planned, store: Store) -> Made:
    """How Delta E is distributed: density, quantiles, mean, modes."""
    assert isinstance(planned.figure, Distribution)
    rows, curves, marks = list[Row](), list[Curve](), list[tuple[float, int]]()
    last = max(_end(store.maps(view)) for view in planned.views)
    for number, view in enumerate(planned.views):
        maps = store.maps(view)
        told, x, y = _told(maps, last)
        rows += [(*head(planned, view), *row) for row in told]
        count = next(int(value) for what, _, value in told if what == "modes")
        name = f"{called(planned, view)}: mean {maps.mean:.2f}, {count} mode" + "s" * (count != 1)
        curves.append(Curve(name, x, y, number))
        marks.append((maps.mean, number))
    panel = Panel(
        "S-CIELAB ΔE of a pixel", "density", tuple(curves), from_zero=True, ends=(0.0, last * BIN),
        marks=tuple(marks),
    )  # fmt: skip
    columns = (*header(planned), "what", "at", "value")
    draw = partial(draw_panels, title=planned.title, panels=[panel])
    return Made(columns, rows, lambda path: draw(path))


def _end(maps: Maps) -> int:
    """Bins that show most of the pixels."""
    return int(np.searchsorted(np.cumsum(maps.counts), SHOWN * maps.counts.sum())) + 2


def _told(maps: Maps, last: int) -> tuple[list[tuple[str, Cell, float]], np.ndarray, np.ndarray]:
    """Rows (what, at, value), and the density up to a bin: places and values."""
    found = modes(maps.counts, BIN, float(maps.delta_e.size))
    below = np.concatenate([[0.0], np.cumsum(maps.counts) / maps.counts.sum()])
    edges = np.arange(len(below)) * BIN
    told: list[tuple[str, Cell, float]] = [("mean", "", maps.mean)]
    told += [("quantile", share, float(np.interp(share, below, edges))) for share in SHARES]
    told += [
        ("standard deviation", "", found.spread),
        ("modes", "", float(len(found.places))),
        *(("mode", i + 1, place) for i, place in enumerate(found.places)),
        ("bandwidth", "", found.bandwidth),
        ("bandwidth of one mode", "", found.critical_bandwidth),
    ]
    step = max(1, last // DRAWN)
    y = density(maps.counts, BIN, found.bandwidth)[:last:step]
    x = (np.arange(len(y)) * step + 0.5) * BIN
    told += [("density", float(f"{at:.6g}"), float(value)) for at, value in zip(x, y, strict=True)]
    return told, x, y
