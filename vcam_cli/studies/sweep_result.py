"""What a sweep found: made of its outcomes, or read back from the folder of a finished one."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from vcam_cli.files.tables import Cell
from vcam_cli.studies.provenance import versions
from vcam_cli.studies.study_file import StudyFile

Row = dict[str, Any]
OPTIMUM = ("case", "parameter", "unit", "optimum", "low", "high", "metric", "value")
_MAY_BE_UNKNOWN = ("optimum", "low", "high", "value")


@dataclass(frozen=True)
class Found:
    """The optimum of a parameter in a case, its numbers rounded, nan where unknown."""

    case: str
    parameter: str
    unit: str
    optimum: float | str
    low: float
    high: float
    metric: str
    value: float
    edge: str

    @property
    def row(self) -> tuple[Cell, ...]:
        """As in optimum.csv; what is not known is empty."""
        numbers = map(_known, (self.optimum, self.low, self.high))
        head = (self.case, self.parameter, self.unit)
        return (*head, *numbers, self.metric, _known(self.value))


def _known(value: float | str) -> Cell:
    return value if isinstance(value, str) or math.isfinite(value) else ""


@dataclass(frozen=True)
class Verdict:
    """What became of an expectation."""

    name: str
    word: str
    """inside | missed | unknown, where points are missing."""
    said: str
    """For a person."""
    calibrated: str
    """The parameter that was set so that it comes out, where one was."""
    row: tuple[Cell, ...]
    """As in expected.csv."""


@dataclass(frozen=True)
class SweepResult:
    """What a sweep found."""

    name: str
    out: Path
    ids: tuple[str, ...]
    """Hashes of the points, in the study's order; "" of those whose camera is refused."""
    points: list[Row]
    """The rows of points.csv, with the names of its columns."""
    missing: int
    """Points of which nothing is known yet: those of other shares."""
    refused: tuple[str, ...]
    """What is wrong with cameras of the study."""
    all_refused: bool
    """Whether every point was, before it ran or then."""
    optima: tuple[Found, ...]
    verdicts: tuple[Verdict, ...]
    """Of what the study expected."""
    computed: int = 0
    """Points computed now; the others were there."""
    seconds: float = 0.0
    unmade: dict[str, str] = field(default_factory=dict)
    """Figures that could not be made, and why."""

    @property
    def failed(self) -> int:
        """Rows with an error."""
        return sum(1 for row in self.points if row["error"])

    @property
    def exit_code(self) -> int:
        """0; 4 where some points or figures failed, 2 where every point was refused."""
        return 2 if self.all_refused else 4 if self.failed or self.unmade else 0

    def summary(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "name": self.name,
            "out": str(self.out),
            "points": len(self.ids),
            "computed": self.computed,
            "failed": self.failed,
            "missing": self.missing,
            "optimum": [_plain(f) for f in self.optima],
            "missed": [v.name for v in self.verdicts if v.word == "missed"],
            "seconds": self.seconds,
            "unmade": self.unmade,
        }

    def record(self) -> dict[str, Any]:
        """What study.json says of it."""
        return {
            "name": self.name,
            "points": list(self.ids),
            "failed": self.failed,
            "missing": self.missing,
            "refused": list(self.refused),
            "unmade": self.unmade,
            "all_refused": self.all_refused,
            "optimum": [_plain(f) for f in self.optima],
            "expected": [asdict(v) for v in self.verdicts],
            "versions": versions(),
        }


def read(record: dict[str, Any], out: Path, study: StudyFile) -> SweepResult:
    """The result of a finished sweep, from its study.json and its points.csv.

    Raises ValueError, KeyError or TypeError for a record that is not as it had been written.
    """
    return SweepResult(
        name=study.model.name,
        out=out,
        ids=tuple(record["points"]),
        points=list(_rows(out / "points.csv", _numbers(study))),
        missing=0,
        refused=tuple(record["refused"]),
        all_refused=record["all_refused"],
        optima=tuple(_found(row) for row in record["optimum"]),
        verdicts=tuple(Verdict(**(row | {"row": tuple(row["row"])})) for row in record["expected"]),
    )


def _rows(path: Path, numbers: dict[str, type]) -> Iterator[Row]:
    """The rows of points.csv, numbers as numbers."""
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield {
                name: numbers[name](cell) if cell and name in numbers else cell
                for name, cell in row.items()
            }


def _numbers(study: StudyFile) -> dict[str, type]:
    """Columns of points.csv that hold numbers -> their type."""
    parameters = list(study.repeated().values())
    for case in (None, *study.model.cases):
        parameters += study.varied(case).values()
    own = {p.column: float for p in parameters if isinstance(p.cells[0], float)}
    return {**own, **dict.fromkeys(study.model.metrics, float), "seed": int}


def _plain(found: Found) -> dict[str, Any]:
    """An optimum with what is not known as null."""
    row = dict(zip(OPTIMUM, found.row, strict=True))
    known = {k: None if v == "" and k in _MAY_BE_UNKNOWN else v for k, v in row.items()}
    return known | {"edge": found.edge}


def _found(plain: dict[str, Any]) -> Found:
    known: dict[str, Any] = {k: math.nan if v is None else v for k, v in plain.items()}
    return Found(**known)
