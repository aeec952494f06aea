"""Writes docs/thesis.md: every figure, table and equation of the thesis, and vcam's answer.

It runs the studies whose tables it needs, each into its own folder out/STUDY, and the checks;
keeps their numbers in docs/thesis_runs.json (`thesis_runs`); draws the figures (`thesis_figures`);
and makes the page of the kept numbers alone. With the word `page` it makes the page anew and runs
nothing. Sweeps keep their finished points: run again, they take seconds while the code is the same.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import thesis_figures
import thesis_pixels
import thesis_runs
import yaml
from thesis_runs import Runs

ROOT = Path(__file__).parent.parent
ROWS = Path(__file__).parent / "thesis_rows.yaml"
PAGE = ROOT / "docs/thesis.md"
KINDS = (
    "expect", "cell", "check", "derived", "axis", "held_by", "told", "missing", "not", "drawing"
)  # fmt: skip
MEASURED = ("expect", "cell", "check", "derived", "axis")
"""Kinds with a number of a run."""
VERDICTS = {
    "reproduced": "predicted, within the printed value or the resolution of the printed axis",
    "calibrated": "within it, with a parameter fitted to this result",
    "chosen": "within it, with a choice that the thesis leaves open",
    "contradicts": "outside; [the study](studies/pixel-size.md) gives known reasons",
    "holds": "an equation: vcam's number equals the result by hand",
    "tested": "an equation, a method or a claim: a test compares it with something independent",
    "missing": "named by the thesis and not in vcam",
    "not simulated": "data that the thesis does not print",
    "drawing": "a drawing or photograph; its content has rows of its own, or is named",
}
RESULTS = ("reproduced", "chosen", "calibrated", "contradicts")
HEAD = """# The thesis, row by row

<!-- Written by `make thesis` from docs/thesis_runs.json, to which a test holds it. -->

Every figure, table and equation of T. Chen, *Digital Camera System Simulator and Applications*, PhD
thesis, Stanford University, 2003, with the command or test for it. Separate pages have [its figures
over its own axes](thesis-figures.md) and [its tables 2.1 to 2.4](thesis-structures.md).
"""


@dataclass(frozen=True)
class Row:
    """A figure, table or equation, and where vcam's number comes from."""

    given: dict[str, Any]
    study: dict[str, Any] = field(default_factory=dict)
    """The expectation of a study, as its file has it."""

    @property
    def kind(self) -> str:
        """Which of `KINDS` it has."""
        return next(k for k in KINDS if k in self.given)

    @property
    def source(self) -> str:
        """The command or test."""
        given, sweep = self.given, f"`vcam sweep {thesis_runs.SWEEP}`"
        if self.kind == "cell":
            return f"`vcam schedule {given['cell']['file'].partition('/')[0]}`"
        if self.kind == "check":
            return f"`scripts/thesis_checks.py`: {given['check'].replace('_', ' ')}"
        if self.kind == "held_by":
            return f"`{given['held_by']}`"
        return sweep if self.kind in MEASURED else str(given.get("by", ""))

    def value(self, runs: Runs) -> float | tuple[float, float] | None:
        """Return the number of a run; None for a row without one, or where a study found none."""
        given = self.given
        if self.kind == "expect":
            found: float | None = runs[thesis_runs.SWEEP]["expected"][given["expect"].split("/")[1]]
            return found
        if self.kind == "cell":
            return _cell(runs, **given["cell"])
        if self.kind == "check":
            return float(runs["checks"]["numbers"][given["check"]])
        if self.kind == "derived":
            curves = partial(thesis_runs.curve, runs)
            return thesis_runs.rounded(thesis_pixels.DERIVED[given["derived"]](curves))
        if self.kind == "axis":
            every = [thesis_runs.curve(runs, case)[1].mean(axis=0) for case in given["axis"]]
            return min(float(y.min()) for y in every), max(float(y.max()) for y in every)
        return None

    @property
    def band(self) -> tuple[float, float]:
        """Between which numbers the thesis puts it, in the unit of its study."""
        given = self.study["between"] if self.kind == "expect" else self.given["between"]
        low, high = (_number(end) for end in given)
        return low, high

    @property
    def basis(self) -> str:
        """How the answer came about: predicted, calibrated or chosen."""
        if self.kind == "expect":
            return next((b for b in ("calibrated", "chosen") if b in self.study), "predicted")
        return str(self.given.get("basis", "predicted"))

    @property
    def setting(self) -> str:
        """What was calibrated or chosen."""
        return str(self.study.get(self.basis) or self.given.get("setting", ""))

    def verdict(self, value: float | tuple[float, float] | None) -> str:
        """Return the verdict on a number, or on a row without one."""
        plain = {"held_by": "tested", "not": "not simulated"}
        if self.kind not in MEASURED:
            return str(self.given.get("verdict") or plain.get(self.kind, self.kind))
        low, high = self.band
        ends = value if isinstance(value, tuple) else (math.nan if value is None else value,)
        if not all(low <= end <= high for end in ends):
            return "contradicts"
        if self.given.get("of") == "equation":
            return "holds"
        return "reproduced" if self.basis == "predicted" else self.basis

    def line(self, runs: Runs) -> str:
        """Return its line of the table."""
        value = self.value(runs)
        verdict = self.verdict(value)
        if verdict in ("calibrated", "chosen"):
            verdict = f"{verdict}: {self.setting}"
        cells = (self.given["item"], self.given["what"], self._thesis(), self._said(value),
                 verdict, self.source)  # fmt: skip
        return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"

    def _thesis(self) -> str:
        if "thesis" in self.given or self.kind != "expect":
            return str(self.given.get("thesis", ""))
        low, high = self.study["between"]
        if _number(low) == -math.inf:
            return f"at most {high}"
        return f"at least {low}" if _number(high) == math.inf else f"{low} to {high}"

    def _said(self, value: float | tuple[float, float] | None) -> str:
        if self.kind not in MEASURED:
            return str(self.given.get("says") or self.given[self.kind])
        if value is None:
            return "no optimum inside the range"
        if isinstance(value, tuple):
            return "{:.3g} to {:.3g}".format(*value)
        if self.kind == "expect":
            unit = _unit(self.study["between"])
            said = f"{value:.4g} {unit}".rstrip()
            return f"{said}; {self.given['also']}" if "also" in self.given else said
        return str(self.given["says"]).format(value)


@cache
def rows() -> tuple[Row, ...]:
    """Return all rows in the order of the thesis."""
    found = []
    for given in yaml.safe_load(ROWS.read_text("utf-8")):
        study: dict[str, Any] = {}
        if "expect" in given:
            name, _, item = given["expect"].partition("/")
            study = _expectations(name)[item]
        found.append(Row(given, study))
    return tuple(found)


@cache
def _expectations(study: str) -> dict[str, Any]:
    """Return what a shipped study expects, by name."""
    text = (ROOT / f"configs/studies/{study}.yaml").read_text("utf-8")
    found: dict[str, Any] = yaml.safe_load(text)["expect"]
    return found


def page(runs: Runs) -> str:
    """Return the page of the runs as they are kept."""
    every = rows()
    lines = [row.line(runs) for row in every]
    found = [row.verdict(row.value(runs)) for row in every]
    parts = (HEAD, _words(), _counts(found), _ages(runs), _optima(runs))
    head = (
        "| item | what | thesis | vcam | verdict | command or test |\n|---|---|---|---|---|---|\n"
    )
    return "".join(f"{part}\n" for part in parts) + head + "\n".join(lines) + "\n"


def _words() -> str:
    lines = [f"| {verdict} | {says} |\n" for verdict, says in VERDICTS.items()]
    return "| verdict | meaning |\n|---|---|\n" + "".join(lines)


def _counts(found: list[str]) -> str:
    """Return how many rows there are of a kind: results, equations and methods apart."""
    results = [verdict for verdict in found if verdict in RESULTS]
    shares = ", ".join(f"{results.count(v)} {v}" for v in RESULTS)
    others = ", ".join(
        f"{found.count(v)} {v}" for v in VERDICTS if v not in (*RESULTS, "holds", "tested")
    )
    return (
        f"{len(found)} rows. Results of the thesis, {len(results)}: {shares}. Equations by hand:"
        f" {found.count('holds')} hold. Equations, methods and claims that a test holds:"
        f" {found.count('tested')}. Else: {others}.\n"
    )


def _ages(runs: Runs) -> str:
    """Return how old each number is."""
    lines = ["| run | of | at commit | seconds |\n|---|---|---|---|\n"]
    for run in runs.values():
        commit = f"`{run['commit']}`" + (", with changes" if run["changed"] else "")
        lines.append(f"| `{run['command']}` | {run['date']} | {commit} | {run['seconds']} |\n")
    about = "Every number below is of one of these runs, kept in `docs/thesis_runs.json`.\n\n"
    return about + "".join(lines)


OPTIMA = {
    "nominal": ("0.35 um", "6.5 um"),
    "dark-x10": ("ten times the dark current", "about 10 um"),
    "luminance-div10": ("a tenth of the light", "about 10 um"),
    "dark-div10": ("a tenth of the dark current", "5.7 um"),
    "luminance-x10": ("ten times the light", "5.5 um"),
    "cmos-0.25um": ("0.25 um", "above 4.64 um"),
    "cmos-0.18um": ("0.18 um", "3.5 um"),
    "cmos-0.18um-microlens": ("0.18 um with microlenses", "3.2 um"),
    "vignetting": ("behind 8 mm f/2 with pixel vignetting", "8 um"),
    "fitted-edge": ("0.35 um, edge fitted to 6.5 um", "6.5 um"),
    "fitted-edge-luminance-x10": ("ten times the light, that edge", "5.5 um"),
}
"""Case of the sweep -> what it is, and the thesis's optimum."""


def _optima(runs: Runs) -> str:
    """Return the table of optima with their intervals, sought again in the kept curves."""
    from vcam_cli.sweeps.optimum import find_optimum

    lines = ["| optimum | thesis | vcam | interval |\n|---|---|---|---|\n"]
    for case, (what, thesis) in OPTIMA.items():
        best = find_optimum(*thesis_runs.curve(runs, case), "min")
        said, interval = f"{best.place:.2f} um", f"{best.low:.2f} to {best.high:.2f}"
        if best.edge:
            said, interval = "none", f"best at {best.place:.2f} um, the {best.edge} end"
        lines.append(f"| {what} | {thesis} | {said} | {interval} |\n")
    return "".join(lines)


def _cell(
    runs: Runs, file: str, where: Mapping[str, Any], column: str,
    over: Mapping[str, Any] | None = None, db: bool = False,
) -> float:  # fmt: skip
    """Return a cell of a table, or its ratio to that of another row, in dB if requested."""
    numbers = runs[file.partition("/")[0]]["numbers"]
    value = float(numbers[thesis_runs.cell_key(file, where, column)])
    if over:
        value /= float(numbers[thesis_runs.cell_key(file, over, column)])
    return 10 * math.log10(value) if db else value


def _number(given: object) -> float:
    """Return the number of "6.35 um", as it stands; of "4 %" 0.04."""
    if isinstance(given, (int, float)):
        return float(given)
    number, _, unit = str(given).partition(" ")
    return float(number) / (100 if unit == "%" else 1)


def _unit(between: list[object]) -> str:
    """Return the unit of a band."""
    units = [str(end).partition(" ")[2] for end in between if isinstance(end, str)]
    return units[0] if units and units[0] != "%" else ""


def main() -> None:
    """Keep the numbers of the runs and write the page."""
    given = [row.given for row in rows()]
    if "page" not in sys.argv[1:]:
        for kind, study in thesis_runs.studies(given):
            thesis_runs.run(kind, study)
        thesis_runs.write(thesis_runs.collect(given))
        thesis_figures.draw(thesis_runs.read())
    runs = thesis_runs.read()
    PAGE.write_text(page(runs), encoding="utf-8")
    found = [row.verdict(row.value(runs)) for row in rows()]
    wrong = found.count("contradicts")
    print(f"wrote {PAGE.relative_to(ROOT)}: {len(found)} rows, {wrong} contradict")


if __name__ == "__main__":
    main()
