"""What a report is made of, and its HTML.

A page is a list of sections, a section a list of parts: pictures, tables, facts, texts. It is one
file that needs nothing else: pictures, styles and the script for zooming are in it, and a policy in
its head forbids it to load anything. Without scripts nothing is missing but the zoom.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field
from pathlib import Path
from typing import ClassVar

from vcam_cli.files import atomic
from vcam_cli.records import dataclass

MARK = '<meta name="generator" content="vcam">'
"""By this a file is known for a report."""


@dataclass(frozen=True)
class Scale:
    """The colors of a map, as a bar beside it."""

    low: str
    high: str
    colors: tuple[str, ...]
    """Codes of sRGB from the lower to the upper end, evenly spaced, as "0072b2"."""


@dataclass(frozen=True)
class Picture:
    """A picture with its caption."""

    kind: ClassVar[str] = "picture"
    title: str
    source: str
    """The picture itself, as a URL of the scheme `data`."""
    alt: str
    """What it shows, for those who cannot see it."""
    note: str = ""
    scale: Scale | None = None
    group: str = ""
    """Pictures of one group show the same place and are zoomed together; "" for no zoom."""
    far: str = ""
    """Its replacement until it is zoomed: cells of a mosaic averaged, which would beat with the
    screen's pixels; "" for the picture itself."""


@dataclass(frozen=True)
class Table:
    """A table with a line of headings."""

    kind: ClassVar[str] = "table"
    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    folded: bool = False
    """Whether it is folded at first."""
    numbers: frozenset[int] = frozenset()
    """Indices of the columns of numbers, which end at one line."""
    marked: frozenset[int] = frozenset()
    """Indices of rows that stand out."""


@dataclass(frozen=True)
class Facts:
    """Names and values."""

    kind: ClassVar[str] = "facts"
    title: str
    rows: Sequence[tuple[str, str]]


def note_facts(notes: Sequence[str]) -> list[Facts]:
    """Return the card of a study's notes; none where there are none."""
    return [Facts("Notes", [("", note) for note in notes])] if notes else []


@dataclass(frozen=True)
class Text:
    """A text as it was written, such as a file."""

    kind: ClassVar[str] = "text"
    title: str
    text: str


Part = Picture | Table | Facts | Text


@dataclass(frozen=True)
class Section:
    """A part of a page with a heading."""

    title: str
    parts: Sequence[Part]
    about: str = ""
    is_large: bool = False
    """Whether pictures are shown large, two beside each other at most."""

    @property
    def anchor(self) -> str:
        """The name by which links find it."""
        return "-".join(word for word in self.title.lower().split() if word.isalnum())

    @property
    def runs(self) -> list[list[Part]]:
        """The parts, neighbors of one kind together."""
        runs: list[list[Part]] = []
        for part in self.parts:
            if not runs or runs[-1][0].kind != part.kind:
                runs.append([])
            runs[-1].append(part)
        return runs


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    about: str
    """A sentence or two below the title."""
    sections: Sequence[Section]
    notes: Sequence[str] = field(default=())
    """What a reader should know first."""

    @property
    def filled(self) -> list[Section]:
        """The sections that have something in them."""
        return [section for section in self.sections if section.parts]


def html(page: Page) -> str:
    """Return a page as HTML; the same text for the same page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("vcam_cli.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(page=page, mark=MARK)


def is_report(path: Path) -> bool:
    """Tell whether a file is a report of vcam. Raise OSError where it cannot be read."""
    with open(path, "rb") as file:
        return MARK.encode() in file.read(1024)


def write(path: Path | str, page: Page) -> None:
    """Write a page as an HTML file, whole or not at all. Raise CannotDo."""
    atomic.write_text(path, html(page))


def number_columns(rows: Iterable[Sequence[object]]) -> frozenset[int]:
    """Return the indices of the columns that hold nothing but numbers and gaps."""
    columns = list(zip(*rows, strict=True))
    return frozenset(
        i for i, cells in enumerate(columns) if any(cells) and all(map(_is_number, cells))
    )


def _is_number(cell: object) -> bool:
    text = str(cell).strip().rstrip(" %")
    if text in ("", "-"):
        return True
    try:
        float(text.lstrip("<"))
    except ValueError:
        return False
    return True
