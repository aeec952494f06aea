"""Colors that are filtered at once, or one by one where all of them would take much memory."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import NDArray

from vcam_cli.camera.geometry import Geometry
from vcam_cli.engine import memory
from vcam_cli.engine.coefficients import HELD, Coefficients, Passing
from vcam_cli.engine.room import Room
from vcam_cli.engine.sampling import Filter, Series


def together(filter: Filter, coefficients: Coefficients, geometry: Geometry) -> list[range]:
    """Colors that are filtered together.

    One by one where what is folded is much, and more than twice the signal: it takes a little
    longer. Not of planes that pass, which would be painted again for each.
    """
    count = filter.tables.values.shape[1]
    width = coefficients.dtype.itemsize
    signal = count * geometry.rows * geometry.columns * width
    if isinstance(coefficients, Passing) or filter.takes(width) <= max(HELD, 2 * signal):
        return [range(count)]
    return [range(color, color + 1) for color in range(count)]


def of_color(series: Series, first: int, color: int, rows: slice) -> NDArray:
    """The signal of a color in some rows; first: the color that is the series's first."""
    return series(color - first, rows)


def needed(
    looked: Filter,
    chosen: Filter,
    colors: list[range],
    coefficients: Coefficients,
    held: int,
    modes: int,
    room: Room,
    geometry: Geometry,
    workers: int,
) -> int:
    """Peak memory of the linear part [bytes].

    looked: the filter with which rows of the spectrum were looked at; chosen: the one for the
    picture, whose colors are filtered in such turns; held: samples of all planes in memory
    together; modes: filters beside it; room: of the tables.
    """
    width = coefficients.dtype.itemsize
    more = modes or len(colors) > 1
    signal = geometry.rows * geometry.columns * width if more else 0
    some = replace(chosen, tables=chosen.tables.of(colors[0]), frugal=len(colors) > 1)
    passing = isinstance(coefficients, Passing)
    return max(
        memory.of_looking(looked, held, width, room),
        memory.of_filtering(some, held, width, room, passing, workers, signal),
    )
