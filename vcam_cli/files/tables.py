"""CSV tables: metrics.csv. Numbers have the shortest form that reads back exactly."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from vcam_cli.files.atomic import write_text

METRIC_COLUMNS = ("metric", "value", "unit")

Cell = str | int | float | np.number


def write_metrics(path: Path | str, rows: Iterable[tuple[str, float, str]]) -> None:
    """Write metrics.csv: a row (metric, value, unit) for each metric, in the given order.

    Raise CannotDo when the file cannot be written.
    """
    write_table(path, METRIC_COLUMNS, rows)


def write_table(path: Path | str, columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> None:
    """Write a CSV table with a header, UTF-8, line feeds, quotes only where needed."""
    write_text(path, table(columns, rows))


def table(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return the CSV text of a table. Raise ValueError for a row of the wrong length."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"a row of {len(row)} cells in a table of {len(columns)} columns")
        writer.writerow([_cell(value) for value in row])
    return text.getvalue()


def _cell(value: Cell) -> str:
    """Return the shortest text that reads back to the same number; inf and nan as in Python."""
    plain = value.item() if isinstance(value, np.number) else value
    return repr(plain) if isinstance(plain, float) else str(plain)
