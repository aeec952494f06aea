"""Bands of rows of cells: what is painted at once, so that temporary arrays stay small."""

from collections.abc import Callable

from vcam_cli.parallel import each, pieces

CELLS = 1 << 19
"""Cells that are painted at once."""


def bands_of_rows(rows: int, columns: int) -> list[slice]:
    """Return the bands of so many rows, which do not depend on the number of workers."""
    return pieces(rows, max(1, CELLS // columns))


def paint_by_bands(paint: Callable[[slice], None], rows: int, columns: int, workers: int) -> None:
    """Call `paint` on bands of rows."""
    each(paint, bands_of_rows(rows, columns), workers)
