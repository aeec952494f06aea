"""Writes docs/thesis.md: every figure, table and equation of the thesis, and vcam's answer.

`make thesis` runs the studies whose tables it needs, each into its own folder out/STUDY, and then
this. Sweeps keep their finished points: run again, they take seconds while the code is the same.
"""

from __future__ import annotations

import csv
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import thesis_checks
import yaml

ROOT = Path(__file__).parent.parent
ROWS = Path(__file__).parent / "thesis_rows.yaml"
PAGE = ROOT / "docs/thesis.md"
VERDICTS = ("reproduced", "calibrated", "chosen", "contradicts", "not simulated", "drawing")
KINDS = ("expect", "cell", "check", "held_by", "told", "not", "drawing")
HEAD = """# The thesis, row by row

<!-- Written by `make thesis` from the runs; tests/test_thesis_page.py holds it to them. -->

Every figure, table and equation of T. Chen, *Digital Camera System Simulator and Applications*, PhD
thesis, Stanford University, 2003, with the command or test that answers it.

| verdict | says |
|---|---|
| reproduced | predicted, within what the thesis prints or its axis shows; or held by a test |
| calibrated | within it, but a number was fitted to this very result |
| chosen | within it, with a reading or number that the thesis leaves open |
| contradicts | outside; [the study](studies/pixel-size.md) says why where that is known |
| not simulated | data that the thesis does not print |
| drawing | a drawing or photograph; what it explains has rows of its own, or is named |

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
    def is_quick(self) -> bool:
        """Whether its number takes moments, or it has none."""
        return self.kind not in ("expect", "cell")

    @property
    def source(self) -> str:
        """The command or test."""
        if self.kind == "held_by":
            return f"`{self.given['held_by']}`"
        if self.kind == "check":
            return f"`scripts/thesis_checks.py`: {self.given['check'].replace('_', ' ')}"
        if self.kind in ("told", "not", "drawing"):
            return str(self.given.get("told", ""))
        whole = self.given.get("expect") or self.given["cell"]["file"]
        study = whole.partition("/")[0]
        return f"`vcam {'sweep' if self.kind == 'expect' else 'schedule'} {study}`"

    def value(self) -> float | str:
        """Return its number, or what is said of it where it has none."""
        if self.kind == "expect":
            return self._expected_value()
        if self.kind == "cell":
            return _cell(**self.given["cell"])
        if self.kind == "check":
            return float(getattr(thesis_checks, self.given["check"])())
        return str(self.given.get("says") or self.given[self.kind])

    def _expected_value(self) -> float:
        study, _, name = self.given["expect"].partition("/")
        rows = _table(f"{study}/expected.csv")
        return float(next(row["found"] for row in rows if row["expectation"] == name))

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

    def verdict(self, value: float | str) -> str:
        """Return the verdict on a number, or on a row without one."""
        if self.kind in ("not", "drawing"):
            return {"not": "not simulated"}.get(self.kind, self.kind)
        if isinstance(value, str):
            return str(self.given.get("verdict", "reproduced"))
        low, high = self.band
        if not low <= value <= high:
            return "contradicts"
        return "reproduced" if self.basis == "predicted" else self.basis

    def line(self, value: float | str) -> str:
        """Return its line of the table, for the number found."""
        verdict = self.verdict(value)
        if verdict in ("calibrated", "chosen"):
            verdict = f"{verdict}: {self.setting}"
        cells = (self.given["item"], self.given["what"], self._thesis(), self._said(value),
                 verdict, self.source)  # fmt: skip
        return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"

    def _thesis(self) -> str:
        if self.kind != "expect":
            return str(self.given.get("thesis", ""))
        low, high = self.study["between"]
        if _number(low) == -math.inf:
            return f"at most {high}"
        return f"at least {low}" if _number(high) == math.inf else f"{low} to {high}"

    def _said(self, value: float | str) -> str:
        if isinstance(value, str):
            return value
        if self.kind == "expect":
            unit = _unit(self.study["between"])
            said = f"{value:.4g} {unit}".rstrip()
            return f"{said}; {self.given['also']}" if "also" in self.given else said
        return str(self.given["says"]).format(value)


def rows() -> list[Row]:
    """Return all rows in the order of the thesis."""
    found = []
    for given in yaml.safe_load(ROWS.read_text("utf-8")):
        study: dict[str, Any] = {}
        if "expect" in given:
            name, _, item = given["expect"].partition("/")
            text = (ROOT / f"configs/studies/{name}.yaml").read_text("utf-8")
            study = yaml.safe_load(text)["expect"][item]
        found.append(Row(given, study))
    return found


def page(values: dict[int, float | str]) -> str:
    """Return the page for the values of the rows, by their numbers."""
    every = rows()
    lines = [row.line(values[k]) for k, row in enumerate(every)]
    found = [row.verdict(values[k]) for k, row in enumerate(every)]
    counted = ", ".join(f"{found.count(v)} {v}" for v in VERDICTS)
    head = (
        "| item | what | thesis | vcam | verdict | command or test |\n|---|---|---|---|---|---|\n"
    )
    return f"{HEAD}{len(every)} rows: {counted}.\n\n{head}" + "\n".join(lines) + "\n"


def _table(name: str) -> list[dict[str, str]]:
    file = ROOT / "out" / name
    if not file.exists():
        sys.exit(f"{file} is missing; run `make thesis`")
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def _cell(
    file: str, where: dict[str, Any], column: str, over: dict[str, Any] | None = None,
    db: bool = False,
) -> float:  # fmt: skip
    """Return a number of a table, or its ratio to that of another row, in dB if asked for."""
    table = _table(file)

    def one(wanted: dict[str, Any]) -> float:
        (row,) = (r for r in table if all(r[k] == str(v) for k, v in wanted.items()))
        return float(row[column])

    value = one(where) / one(over) if over else one(where)
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
    """Work out all numbers and write the page."""
    values = {k: row.value() for k, row in enumerate(rows())}
    PAGE.write_text(page(values), encoding="utf-8")
    contradicted = [row for k, row in enumerate(rows()) if row.verdict(values[k]) == "contradicts"]
    print(f"wrote {PAGE.relative_to(ROOT)}: {len(values)} rows, {len(contradicted)} contradict")


if __name__ == "__main__":
    main()
