"""The notebooks of the documentation, run and turned into pages.

They lie in `docs/notebooks` without outputs, for Jupyter to open. Here the code of every cell is
run as Jupyter runs it, which needs none of the packages of Jupyter.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent.parent / "docs" / "notebooks"
DOTS_PER_INCH = 110


@dataclass
class Cell:
    """A cell, and what came of it."""

    kind: str
    """code or markdown."""
    text: str
    printed: str = ""
    """What it printed, and the value of an expression at its end."""
    figures: list[bytes] = field(default_factory=list)
    """What it drew, as PNG."""


def cells(path: Path) -> list[Cell]:
    """Return the cells of a notebook, not run."""
    found = json.loads(path.read_text("utf-8"))["cells"]
    return [Cell(each["cell_type"], "".join(each["source"])) for each in found]


def run(path: Path, instead: Mapping[str, str] | None = None) -> tuple[list[Cell], dict[str, Any]]:
    """Return the cells of a notebook, run in an empty folder, and the variables at their end.

    `instead` replaces texts of its code. Each must occur once.
    """
    import matplotlib

    matplotlib.use("agg")
    found, names, here = cells(path), {"__name__": "__main__"}, Path.cwd()
    for text, other in (instead or {}).items():
        (cell,) = (cell for cell in found if cell.kind == "code" and text in cell.text)
        cell.text = cell.text.replace(text, other)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for cell in found:
                if cell.kind == "code":
                    _run(cell, names)
        finally:
            os.chdir(here)
    return found, names


def _run(cell: Cell, names: dict[str, Any]) -> None:
    import matplotlib.pyplot as plt

    body = ast.parse(cell.text).body
    is_shown = isinstance(body[-1], ast.Expr) and not cell.text.rstrip().endswith(";")
    last = body.pop() if is_shown else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(ast.Module(body, []), "<cell>", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
            if value is not None:
                print(repr(value))
    cell.printed = printed.getvalue()
    for number in plt.get_fignums():
        drawn = io.BytesIO()
        plt.figure(number).savefig(drawn, dpi=DOTS_PER_INCH, bbox_inches="tight")
        cell.figures.append(drawn.getvalue())
    plt.close("all")


def page(path: Path) -> tuple[str, dict[str, bytes]]:
    """Return a notebook that was run as a page in Markdown, and its figures by their names."""
    figures: dict[str, bytes] = {}
    return "\n\n".join(_lines(path, figures)), figures


def _lines(path: Path, figures: dict[str, bytes]) -> Iterator[str]:
    for number, cell in enumerate(run(path)[0]):
        if cell.kind == "markdown":
            yield cell.text
            if number == 0:
                yield f"[This page is a notebook]({path.name}): open it in Jupyter, and change it."
            continue
        yield f"```python\n{cell.text}\n```"
        if cell.printed:
            yield f"```text\n{cell.printed.rstrip()}\n```"
        for drawn in cell.figures:
            name = f"{path.stem}-{len(figures) + 1}.png"
            figures[name] = drawn
            yield f"![What this cell draws]({name})"
