"""Tables as CSV text: `#` comments, one header line, numbers in rows."""

import io
import math
import stat
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np

from vcam_cli.spectra.spectrum import Floats

MAX_ROWS = 200_000
MAX_BYTES = 1 << 26
"""Largest file that is read; a million rows have some 30 MB."""
MAX_LINE_LENGTH = 10_000
_TEXT_BYTES = bytes({9, 10, 12, 13, *range(32, 127), *range(160, 256)})
"""Bytes of a text in Latin-1."""
MAX_COLUMNS = 8
"""Columns of a table with as many rows as are read; a shorter one may have more."""


def read_table(
    path: str | PathLike[str], most: int = MAX_ROWS
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header's names of a CSV file, and of every row its line number and cells.

    Parameters
    ----------
    path : str or path
        The file.
    most : int
        Largest number of rows.

    Returns
    -------
    header : list of str
        Names of the columns.
    cells : list of (int, list of str)
        Line number and cells of every row.

    Raises
    ------
    ValueError
        Not text, too large, no header, a row of another length, more than `most` rows or twice as
        many lines; the message names the file and the line.
    OSError
        The file cannot be read.
    """
    file = Path(path)
    return _cells(file, read_lines(file, 2 * most), most)


def read_lines(file: Path, most: int) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text file that say something, with their numbers.

    One by one, as a list of all that a file can hold would take a hundred times its bytes.
    Comments begin with `#`. What is not UTF-8 is taken as Latin-1, as instruments write it.

    Parameters
    ----------
    file : Path
        The file.
    most : int
        Largest number of lines.

    Raises
    ------
    ValueError
        Not text, too large, too long a line, or more than `most` of them.
    OSError
        The file cannot be read.
    """
    if not stat.S_ISREG(file.stat().st_mode):  # a pipe would keep us waiting
        raise ValueError(f"{file}: is not a regular file")
    with file.open("rb") as source:
        data = source.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"{file}: is larger than {MAX_BYTES >> 20} MB")
    text = io.TextIOWrapper(io.BytesIO(data), _encoding(file, data))
    for n, line in enumerate(iter(lambda: text.readline(MAX_LINE_LENGTH + 1), ""), 1):
        if len(line) > MAX_LINE_LENGTH:
            raise ValueError(f"{file}:{n}: is longer than {MAX_LINE_LENGTH} characters")
        if n > most:
            raise ValueError(f"{file}: has more than {most} lines")
        line = line.strip()
        if line and not line.startswith("#"):
            yield n, line


def _encoding(file: Path, data: bytes) -> str:
    """Return the encoding of a text; ValueError for other data."""
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError:
        if data.translate(None, _TEXT_BYTES):
            raise ValueError(f"{file}: is not a text file") from None
        return "latin-1"
    return "utf-8-sig"


def _cells(
    file: Path, lines: Iterator[tuple[int, str]], most: int
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header, and line number and cells of every row."""
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
        if rows > most or rows * len(header) > MAX_COLUMNS * most:
            raise ValueError(f"{file}: has more than {rows - 1} rows; no more are read")
    return header, cells


def read_rows(path: str | PathLike[str]) -> tuple[list[str], Floats]:
    """Return the header's names and the numbers of a CSV file.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    header : list of str
        Names of the columns.
    rows : ndarray
        Numbers (rows, columns).

    Raises
    ------
    ValueError
        As `read_table`, or something is no finite number.
    OSError
        The file cannot be read.
    """
    header, cells = read_table(path)
    numbers = [parse_numbers(Path(path), n, row) for n, row in cells]
    return header, np.array(numbers, dtype=np.float64).reshape(len(numbers), len(header))


def parse_numbers(file: Path, line: int, cells: list[str]) -> list[float]:
    """Return some cells of a line as numbers.

    Parameters
    ----------
    file : Path
        File of the line, for messages.
    line : int
        Number of the line.
    cells : list of str
        Text of the cells.

    Returns
    -------
    list of float
        One number a cell.

    Raises
    ------
    ValueError
        Something is no finite number.
    """
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        shown = ",".join(cells)
        raise ValueError(f"{file}:{line}: {shown!r} is not a row of numbers") from None
    if not all(map(math.isfinite, values)):
        shown = ",".join(cells)
        raise ValueError(f"{file}:{line}: {shown!r} holds a value that is not finite")
    return values
