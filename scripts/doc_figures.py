"""Renew figures and numbers of the documentation that depend on the engine's speed and plan.

Run it as `python scripts/doc_figures.py [scenes] [accuracy] [hard-cases] [colors]`; without a word,
all:

- scenes: docs/scenes-everything.png, from `vcam plan everything --scenes all --measure`; minutes;
- accuracy: docs/accuracy-starter.png, from `vcam accuracy starter`;
- hard-cases: the table of README.md, from the cases of `make stability`;
- colors: the table of docs/measured-color.md, from scripts/color_table.py.

Measure on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parent.parent
SIZE = ("--set", "array.rows=240", "--set", "array.columns=320")
SHOWN = {
    "2.22 relative illumination, small apertures": "relative illumination of a small aperture",
    "Zernike polynomial of order 50": "Zernike polynomial of order 50",
    "2.30 quantum efficiency, vanishing absorption": "quantum efficiency, vanishing absorption",
    "Poisson at means of 1e-9 to 1e-16: chance of one": "Poisson numbers, means from 1e-16",
    "codes of a linear ADC at both ends, 16 bits": "codes of a 16-bit ADC at both ends",
    "mean squared error of 100 million float32 pixels": "mean squared error, 100 million pixels",
    "4.1 mean SNR over segments 1e-14 wide": "mean SNR over a segment 1e-14 wide",
}
"""Case of `make stability` -> its words in README.md."""


def scenes(turns: int) -> None:
    """Draw the effects of the shipped camera `everything` before eighteen scenes, with seconds."""
    asked = ("plan", "everything", "--scenes", "all", "--measure", "--turns", str(turns))
    _draw("scenes.png", ROOT / "docs" / "scenes-everything.png", *asked, "--workers", "1")


def accuracy(turns: int) -> None:
    """Draw errors and seconds of the shipped camera `starter`."""
    _draw("accuracy.png", ROOT / "docs" / "accuracy-starter.png", "accuracy", "starter", *SIZE)


def _draw(name: str, target: Path, *command: str) -> None:
    """Run a command of vcam and keep one of its pictures."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        line = [sys.executable, "-m", "vcam_cli.commands.main", *command, "-o", str(out)]
        subprocess.run(line, check=True, cwd=folder)
        shutil.copyfile(out / name, target)


def hard_cases(turns: int, path: Path = ROOT / "README.md") -> None:
    """Write the table of README.md, or of a file like it."""
    _write_between("hard cases", table(), path)


def colors(turns: int, path: Path = ROOT / "docs" / "measured-color.md") -> None:
    """Write the table of docs/measured-color.md, or of a file like it."""
    import color_table

    _write_between("colors", color_table.table(), path)


def _write_between(name: str, text: str, path: Path) -> None:
    """Write a table between its marks."""
    start = f"<!-- {name}: scripts/doc_figures.py writes this table -->\n"
    before, after = re.escape(start), re.escape("<!-- end -->\n")
    page = path.read_text(encoding="utf-8")
    renewed = re.sub(f"({before}).*({after})", rf"\g<1>\n{text}\n\g<2>", page, flags=re.DOTALL)
    path.write_text(renewed, encoding="utf-8")


def table() -> str:
    """Return the table of README.md: some hard cases, with the errors of both forms."""
    sys.path.insert(0, str(ROOT))
    from tests.hard_cases.cases import CASES
    from tests.hard_cases.hard_case import judge

    found = {case.name: case for cases in CASES.values() for case in cases}
    lines = ["| hard case | error of vcam | error of the textbook form |", "|---|---|---|"]
    for name, words in SHOWN.items():
        verdict, unit = judge(found[name]), " (absolute)" if found[name].absolute else ""
        said = verdict.naive_said
        naive = _number(float(said)) if re.match(r"[\d.]", said) else said
        lines.append(f"| {words} | {_number(verdict.ours)}{unit} | {naive} |")
    return "\n".join(lines) + "\n"


def _number(error: float) -> str:
    """Return an error to a digit or two, as text."""
    if error and not 1e-2 <= error < 1e3:
        return f"{error:.0e}".replace("e+", "e")
    return f"{error:.2g}"


FIGURES: dict[str, Callable[[int], None]] = {
    "scenes": scenes,
    "accuracy": accuracy,
    "hard-cases": hard_cases,
    "colors": colors,
}


def main() -> None:
    """Renew the figures that the command line names."""
    parser = argparse.ArgumentParser(description="Renew figures of the documentation.")
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help=f"default all: {[*FIGURES]}")
    parser.add_argument("--turns", type=int, default=5, help="runs that count, of each kind")
    options = parser.parse_args()
    if unknown := set(options.figures) - set(FIGURES):
        parser.error(f"no such figures: {', '.join(unknown)}")
    for name in options.figures or FIGURES:
        FIGURES[name](options.turns)


if __name__ == "__main__":
    main()
