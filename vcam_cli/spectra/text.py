"""Reading tables of spectra from CSV text: `#` comments, one header line, numbers in rows."""

import io
import math
import stat
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np

from vcam_cli.spectra.spectrum import Floats, Outside, Table

HEADER = ("wavelength_nm", "value")
MOST_ROWS = 200_000
MOST_BYTES = 1 << 26
"""Of a file: a million rows have some 30 MB."""
LONGEST_LINE = 10_000
MOST_COLUMNS = 8
"""Of a table with as many rows as are read; a shorter one may have more."""


def read_table(
    path: str | PathLike[str], most: int = MOST_ROWS
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header's names of a CSV file, and of every row its line number and cells.

    Raises ValueError that names the file and the line: not text, too large, no header, a row of
    another length, more than `most` rows or twice as many lines. OSError as `open` raises it.
    """
    file = Path(path)
    if not stat.S_ISREG(file.stat().st_mode):  # a pipe would keep us waiting
        raise ValueError(f"{file}: is not a regular file")
    with file.open("rb") as source:
        data = source.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"{file}: is larger than {MOST_BYTES >> 20} MB")
    try:
        return _cells(file, _lines(file, data, 2 * most), most)
    except UnicodeDecodeError:
        raise ValueError(f"{file}: is not a text file") from None


def _lines(file: Path, data: bytes, most: int) -> Iterator[tuple[int, str]]:
    """The lines that say something, with their numbers.

    One by one, as a list of all that a file can hold would take a hundred times its bytes.
    """
    text = io.TextIOWrapper(io.BytesIO(data), "utf-8-sig")
    for n, line in enumerate(iter(lambda: text.readline(LONGEST_LINE + 1), ""), 1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"{file}:{n}: is longer than {LONGEST_LINE} characters")
        if n > most:
            raise ValueError(f"{file}: has more than {most} lines")
        line = line.strip()
        if line and not line.startswith("#"):
            yield n, line


def _cells(
    file: Path, lines: Iterator[tuple[int, str]], most: int
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    _, first = next(lines, (0, ""))
    if not first:
        raise ValueError(f"{file}: is empty; it needs a header and rows of numbers")
    header = [name.strip() for name in first.split(",")]
    cells: list[tuple[int, list[str]]] = []
    for n, line in lines:
        row = line.split(",")
        if len(row) != len(header):
            raise ValueError(f"{file}:{n}: has {len(row)} columns; the header has {len(header)}")
        cells.append((n, row))
        rows = len(cells) + 1  # the header is one
        if rows > most or rows * len(header) > MOST_COLUMNS * most:
            raise ValueError(f"{file}: has more than {rows - 1} rows; no more are read")
    return header, cells


def read_rows(path: str | PathLike[str]) -> tuple[list[str], Floats]:
    """The header's names and the numbers (rows, columns) of a CSV file.

    Raises ValueError as `read_table`, and for something that is no finite number.
    """
    header, cells = read_table(path)
    numbers = [numbers_of(Path(path), n, row) for n, row in cells]
    return header, np.array(numbers, dtype=np.float64).reshape(len(numbers), len(header))


def numbers_of(file: Path, line: int, cells: list[str]) -> list[float]:
    """Some cells of a line as numbers. Raises ValueError for what is no finite number."""
    shown = ",".join(cells)
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        raise ValueError(f"{file}:{line}: {shown!r} is not a row of numbers") from None
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"{file}:{line}: {shown!r} holds a value that is not finite")
    return values


def read_csv(path: str | PathLike[str], outside: Outside = "error") -> Table:
    """A spectrum from a CSV file with the columns wavelength_nm,value.

    Wavelengths in nm, rising; values not negative, dimensionless (or relative, for a lamp).
    Raises ValueError that names file and line for anything else, OSError where it cannot be read.
    """
    header, rows = read_rows(path)
    if tuple(header) != HEADER:
        raise ValueError(
            f"{path}: the header is {','.join(header)!r}; it must be 'wavelength_nm,value'"
        )
    if len(rows) == 0:
        raise ValueError(f"{path}: has no rows below its header")
    if (rows[:, 1] < 0).any():
        wavelength, value = rows[rows[:, 1] < 0][0]
        raise ValueError(f"{path}: {value:g} at {wavelength:g} nm; a value must not be negative")
    if (rows[:, 0] <= 0).any():
        raise ValueError(f"{path}: a wavelength must be positive")
    try:
        return Table(rows[:, 0] / 1e9, rows[:, 1], outside)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
