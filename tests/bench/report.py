"""The figures as a table for people; the same as JSON is for programs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

FORMATS = {
    "wall": "9.3f",
    "cpu": "9.3f",
    "before": "9.3f",
    "ratio": "9.3f",
    "share": "9.2%",
    "gigabytes": "9.2f",
}
"""The columns that a row may have, and how their figures are written."""
WIDTH = 46
"""Characters before the first column."""


def lines(found: dict[str, Any]) -> Iterator[str]:
    """The table: what was measured, by the wall clock and by processor time."""
    unit, rows, columns = found["r_compute"], *found["size"]
    yield f"{rows} x {columns} pixels, {found['processors']} processors"
    yield f"R_compute = 1 ({unit['wall']:.3g} s here, {unit['cpu']:.3g} s of processors)"
    yield f"{'':<{WIDTH}}{'wall':>9}{'cpu':>9}{'before':>9}"
    for title, section in found["sections"].items():
        yield title
        for name, row in section.items():
            yield _row(name, row)


def _row(name: str, row: dict[str, float]) -> str:
    figures = "".join(format(row[key], style) for key, style in FORMATS.items() if key in row)
    asked = f"  asked: at most {row['at_most']:g}" if "at_most" in row else ""
    return f"  {name:<{WIDTH - 2}}{figures}{asked}"
