"""Bands of rows of cells: what is painted at once, so that temporary arrays stay small."""

from collections.abc import Callable

from vcam_cli.parallel import each, pieces

CELLS = 1 << 18
"""Cells that are painted at once. With twice as many, two threads that paint leaves took 20 MB
more, and no frame less processor time."""


def bands_of_rows(rows: int, columns: int) -> list[slice]:
    """Return the bands of rows that are painted at once.

    They do not depend on the number of workers.

    Parameters
    ----------
    rows, columns : int
        Cells of the grid along y and x.

    Returns
    -------
    list of slice
        Rows of each band, from the top.
    """
    return pieces(rows, max(1, CELLS // columns))


def paint_by_bands(paint: Callable[[slice], None], rows: int, columns: int, workers: int) -> None:
    """Call `paint` on bands of rows.

    Parameters
    ----------
    paint : callable
        What paints a slice of rows.
    rows, columns : int
        Cells of the grid along y and x.
    workers : int
        Number of threads.
    """
    each(paint, bands_of_rows(rows, columns), workers)
