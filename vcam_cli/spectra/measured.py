"""Spectra as instruments write them: CSV, semicolons, tabs or spaces; decimal points or commas.

A file is comments and lines of an instrument's own, a header or none, and rows of numbers. The
first column whose name speaks of wavelengths, or else the first, is the wavelength; the others are
values, chosen by their names. Rows may rise or fall. Without a name the size decides:
light has wavelengths of hundreds of nanometers, or around one micrometer.
"""

import re
from os import PathLike
from pathlib import Path

import numpy as np

from vcam_cli.records import dataclass
from vcam_cli.spectra.spectrum import Floats, Outside, Table
from vcam_cli.spectra.text import MAX_ROWS, parse_numbers, read_lines

NANOMETERS, MICROMETERS = "nm", "um"
_NM_RANGE, _UM_RANGE = (100.0, 1e5), (0.1, 30.0)
"""Wavelengths of light in either unit; where they overlap, in nothing."""
_UNIT = re.compile(
    r"(?<![a-z])(nm|um|µm|μm|nanomet(?:er|re)s?|micromet(?:er|re)s?|microns?)(?![a-z])"
)
_WAVELENGTH = re.compile(
    r"(?<![a-z])(wave ?-?_?length|wavelen|wl|lambda|λ)(?![a-z])|^ *\(?(nm|um)\)? *$"
)
_PERCENT = re.compile(r"%|percent")
_PER_WATT = re.compile(r"per[ _-]?watt")
MAX_NUMBERS = 1 << 22
"""Numbers of a file of many columns: a thousand spectra at a thousand wavelengths, and more."""
PREAMBLE = 1000
"""Most lines that an instrument may write above its numbers."""


@dataclass(frozen=True)
class _Sheet:
    """The numbers of a file, and the names above its columns."""

    names: tuple[str, ...]
    rows: Floats
    """Numbers (rows, columns)."""


def read_spectrum(
    path: str | PathLike[str],
    outside: Outside = "error",
    column: str | None = None,
    unit: str | None = None,
) -> Table:
    """Return a spectrum from a file of measured values.

    Parameters
    ----------
    path : str or path
        The file: wavelengths, rising or falling; values not negative, dimensionless (or relative,
        for a lamp). A column whose name says percent is divided by 100.
    outside : {"error", "zero", "hold"}
        What holds beyond the first and last wavelength.
    column : str, optional
        Name of the column of values, or its number, counted from 1; needed where there are several.
    unit : {"nm", "um"}, optional
        Unit of the wavelengths; by default what the header says, or else their size.

    Returns
    -------
    Table
        The spectrum, with wavelengths in m.

    Raises
    ------
    ValueError
        The file does not hold that; the message names file and line.
    OSError
        The file cannot be read.
    """
    return read_sensitivity(path, outside, column, unit)[0]


def read_sensitivity(
    path: str | PathLike[str],
    outside: Outside = "error",
    column: str | None = None,
    unit: str | None = None,
) -> tuple[Table, bool]:
    """Return a spectrum, and whether the name of its column says that it is one per watt.

    Parameters, and what is raised, are those of `read_spectrum`.
    """
    file = Path(path)
    sheet = _read_sheet(file)
    of_wavelength = _wavelength_column(sheet.names)
    of_value = _value_column(file, sheet.names, of_wavelength, column)
    unit = unit or _wavelength_unit(file, sheet.names[of_wavelength], sheet.rows[:, of_wavelength])
    wavelength, value = sheet.rows[:, of_wavelength], sheet.rows[:, of_value]
    name = sheet.names[of_value].lower()
    if _PERCENT.search(name):
        value = value / 100
    if (value < 0).any():
        first = int(np.argmax(value < 0))
        raise ValueError(
            f"{file}: {value[first]:g} at {wavelength[first]:g} {unit}; a value must not be "
            "negative"
        )
    if (wavelength <= 0).any():
        raise ValueError(f"{file}: a wavelength must be positive")
    if len(wavelength) > 1 and (np.diff(wavelength) < 0).all():
        wavelength, value = wavelength[::-1], value[::-1]
    try:
        table = Table(_in_meters(wavelength, unit), value, outside)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    return table, bool(_PER_WATT.search(name))


def column_names(path: str | PathLike[str]) -> tuple[str, ...]:
    """Return the names of a file's columns of values. Raises as `read_spectrum`."""
    names = _read_sheet(Path(path)).names
    of_wavelength = _wavelength_column(names)
    return tuple(bare_name(name) for i, name in enumerate(names) if i != of_wavelength)


def bare_name(name: str) -> str:
    """Return the name of a column without a unit in brackets."""
    return re.sub(r"\s*[\[(].*?[\])]\s*", "", name).strip() or name.strip()


def _in_meters(wavelength: Floats, unit: str) -> Floats:
    """Return wavelengths in m, those in nm exactly as a division gives them."""
    return wavelength / 1e9 if unit == NANOMETERS else wavelength / 1e6


def _read_sheet(file: Path) -> _Sheet:
    """Return names and numbers of a file."""
    above: list[tuple[int, str]] = []
    rows: list[list[float]] = []
    form: _Form | None = None
    names: tuple[str, ...] | None = None
    for n, line in read_lines(file, 2 * MAX_ROWS):
        if form is None:
            form = _form_of_numbers(line)
            if form is None:
                above.append((n, line))
                if len(above) > PREAMBLE:
                    raise ValueError(f"{file}: has no row of numbers in its first {n} lines")
                continue
            names = _names(above[-1][1], form) if above else None
        cells = form.split(line)
        if rows and len(cells) != len(rows[0]):
            raise ValueError(f"{file}:{n}: has {len(cells)} columns; above it are {len(rows[0])}")
        if names and len(cells) != len(names):
            raise ValueError(f"{file}:{n}: has {len(cells)} columns; the header has {len(names)}")
        rows.append(parse_numbers(file, n, cells))
        if len(rows) > MAX_ROWS:
            raise ValueError(f"{file}: has more than {MAX_ROWS} rows; no more are read")
        if len(rows) * len(cells) > MAX_NUMBERS:
            raise ValueError(f"{file}: has more than {MAX_NUMBERS} numbers; no more are read")
    if not rows:
        raise _without_numbers(file, above)
    if len(rows[0]) < 2:
        raise ValueError(f"{file}: has one column; it needs wavelengths and values")
    return _Sheet(names or tuple(str(i + 1) for i in range(len(rows[0]))), np.array(rows))


def _without_numbers(file: Path, lines: list[tuple[int, str]]) -> ValueError:
    if not lines:
        return ValueError(f"{file}: is empty; it needs rows of wavelength and value")
    if len(lines) == 1:
        return ValueError(f"{file}: has no rows of numbers below its header")
    number, text = lines[1]
    return ValueError(f"{file}:{number}: {text[:60]!r} is not a row of numbers")


@dataclass(frozen=True)
class _Form:
    """How the cells of a line are separated."""

    mark: str | None
    """What stands between two cells; None for any number of spaces."""

    def split(self, line: str) -> list[str]:
        """Return the cells, with decimal points, of a line of numbers."""
        cells = self.cells(line)
        if self.mark == ",":
            return cells
        return [cell.replace(",", ".") if cell.count(",") == 1 else cell for cell in cells]

    def cells(self, line: str) -> list[str]:
        """Return the cells; a mark at the end of a line begins no further one."""
        cells = line.split(self.mark)
        return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells


_FORMS = (_Form(";"), _Form("\t"), _Form(","), _Form(None))


def _form_of_numbers(line: str) -> _Form | None:
    """Return how the cells of a row of numbers are separated; None for another line."""
    for form in _FORMS:
        fits = form.mark is None or form.mark in line
        if fits and all(_is_number(cell) for cell in form.split(line)):
            return form
    return None


def _names(line: str, form: _Form) -> tuple[str, ...] | None:
    """Return the names of a header; None for another line, of a single cell."""
    forms = [form] if form.mark else list(_FORMS[:3])
    for each in forms:
        names = tuple(name.strip().strip('"') for name in each.cells(line))
        if len(names) > 1:
            return names
    names = tuple(line.split())
    return names if form.mark is None and len(names) > 1 else None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _wavelength_column(names: tuple[str, ...]) -> int:
    """Return the first column whose name speaks of wavelengths, or else the first."""
    return next((i for i, name in enumerate(names) if _WAVELENGTH.search(_plain(name))), 0)


def _plain(name: str) -> str:
    return name.lower().replace("_", " ")


def _value_column(
    file: Path, names: tuple[str, ...], of_wavelength: int, column: str | None
) -> int:
    others = [i for i in range(len(names)) if i != of_wavelength]
    listed = ", ".join(bare_name(names[i]) for i in others)
    if column is None:
        if len(others) == 1:
            return others[0]
        raise ValueError(
            f"{file}: has {len(others)} columns of values ({listed}); write which, "
            f"for example column: {bare_name(names[others[0]])}"
        )
    asked = column.strip().lower()
    for i in others:
        if asked in (names[i].lower(), bare_name(names[i]).lower(), str(i + 1)):
            return i
    raise ValueError(f"{file}: has no column {column!r}; there are {listed}")


def _wavelength_unit(file: Path, name: str, wavelength: Floats) -> str:
    """Return the unit that a header names, or else the one that the size of the numbers tells."""
    if found := _UNIT.search(_plain(name)):
        return NANOMETERS if found[1].startswith("n") else MICROMETERS
    low, high = float(wavelength.min()), float(wavelength.max())
    if low > 0:
        for unit, (least, most) in ((NANOMETERS, _NM_RANGE), (MICROMETERS, _UM_RANGE)):
            if least <= low and high <= most:
                return unit
        raise ValueError(
            f"{file}: wavelengths from {low:g} to {high:g} are in neither nm nor um as light has "
            "them; write unit: nm, or unit: um"
        )
    return NANOMETERS
