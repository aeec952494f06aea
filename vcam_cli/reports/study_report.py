"""Reports of studies: the tables and the plots that a study wrote, on one page."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import PurePath

from vcam_cli.files import atomic
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports import page, pictures
from vcam_cli.reports.page import Page, Part, Picture, Section, Table

REPORT = "report.html"
MOST_ROWS = 400
"""Rows of a table that are shown; the file has them all."""
FOLDED_ROWS = 24
"""Rows above which a table is folded at first."""


def write(
    folder: OutputFolder,
    title: str,
    about: str,
    facts: Sequence[Part],
    captions: Mapping[str, str],
) -> None:
    """Write report.html of the tables and plots that are new in a folder; see `study_html`."""
    html = study_html(title, about, facts, folder.written(".csv", ".png"), captions)
    atomic.write_bytes(folder.new(REPORT), html)


def study_html(
    title: str,
    about: str,
    facts: Sequence[Part],
    contents: Mapping[str, bytes],
    captions: Mapping[str, str] | None = None,
) -> bytes:
    """Return the report of a study as HTML.

    Parameters
    ----------
    title, about : str
        Title, and a sentence below it.
    facts : sequence of parts
        What the study came to.
    contents : mapping
        Name of a file -> its bytes. CSV files are shown as tables, PNG files as pictures.
    captions : mapping, optional
        Name of a file -> what it shows.
    """
    said = captions or {}
    tables = [
        _table(name, data, said.get(name, ""))
        for name, data in contents.items()
        if name.endswith(".csv")
    ]
    plots = [
        _plot(name, data, said.get(name, ""), name.removesuffix(".png") + ".csv" in contents)
        for name, data in contents.items()
        if name.endswith(".png")
    ]
    short = [table for table in tables if not table.folded]
    long = [table for table in tables if table.folded]
    sections = [
        Section("Findings", [*facts, *short]),
        Section("Plots", plots, is_large=True),
        Section("Tables", long),
    ]
    return page.html(Page(title, about, sections)).encode()


def _table(name: str, data: bytes, note: str) -> Table:
    """Return the table of a CSV file, without the columns in which nothing stands."""
    head, *rows = csv.reader(io.StringIO(data.decode("utf-8")))
    used = [i for i in range(len(head)) if any(row[i] for row in rows)] or range(len(head))
    head = [head[i] for i in used]
    shown = [[_short(row[i]) for i in used] for row in rows[:MOST_ROWS]]
    if len(rows) > MOST_ROWS:
        note = f"{note} The first {MOST_ROWS} of {len(rows)} rows; the file has all.".strip()
    return Table(name, head, shown, note, len(rows) > FOLDED_ROWS, page.number_columns(shown))


def _short(cell: str) -> str:
    """Return a number with six digits at most, and any other text as it is."""
    try:
        return f"{float(cell):.6g}" if "." in cell or "e" in cell else cell
    except ValueError:
        return cell


def _plot(name: str, data: bytes, note: str, has_table: bool) -> Picture:
    about = PurePath(name).stem.replace("_", " ").replace("-", " ")
    alt = f"Plot: {note or about}"
    if has_table:
        alt += f"; its numbers are in {name.removesuffix('.png')}.csv below"
    return Picture(name, pictures.png(data), alt, note)
