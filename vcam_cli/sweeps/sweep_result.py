"""What a sweep found: made of its outcomes, or read back from the folder of a finished sweep.

A finished sweep is read, not made again, if nothing has changed. What is asked, each file that
was read and each that was written are compared by their hashes, as `make` would by their times. A
sweep records what was asked only where another run would find nothing to do: no point or figure
missing, none that might end otherwise tomorrow.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.config.file_names import current_folder
from vcam_cli.errors import CannotDo, Problem, dotted_path, one_line
from vcam_cli.files.points_store import RECORD, SweepFolder
from vcam_cli.files.records import Proofs, read_record, record_check
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.files.spectral.hyperspectral import companions
from vcam_cli.files.tables import Cell
from vcam_cli.records import dataclass
from vcam_cli.simulation.output import provenance
from vcam_cli.sweeps.model import Basis
from vcam_cli.sweeps.sweep_file import StudyFile

Row = dict[str, Any]
FRAMES = {"raw": "raw.exr", "render": "render.png"}
"""Kind of frame that may be kept of a point -> the name of its file."""
OPTIMUM_COLUMNS = ("case", "parameter", "unit", "optimum", "low", "high", "metric", "value")


@dataclass(frozen=True)
class Extras:
    """What is written beside tables and PNG plots."""

    report: bool = False
    """Whether report.html is."""
    formats: tuple[str, ...] = ()
    """Formats of plots beside PNG: "svg", "pdf"."""


@dataclass(frozen=True)
class Outcome:
    """What came of a point."""

    id: str
    metrics: dict[str, float] = field(default_factory=dict)
    error: str = ""
    final: bool = True
    """Whether another try would end alike; a machine may have more memory tomorrow."""
    seconds: float = 0.0
    frames: dict[str, bytes] = field(default_factory=dict)
    """Name of a file -> its bytes."""
    trace: str = ""
    """The traceback of a bug."""

    def content(self) -> dict[str, Any]:
        """Return what is kept of it."""
        names = ("metrics", "error", "final", "seconds")
        return {name: getattr(self, name) for name in names}


def read_outcome(point: str, content: dict[str, Any]) -> Outcome:
    """Return the outcome of a point's record. Raises ValueError for an invalid record."""
    try:
        return Outcome(
            point,
            {str(name): float(value) for name, value in content["metrics"].items()},
            str(content["error"]),
            bool(content["final"]),
            float(content["seconds"]),
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(str(error)) from None


def error_cell(problems: Sequence[Problem]) -> str:
    """Return problems as the column `error` has them: without places, which differ by machine."""
    texts = []
    for p in problems:
        text = ": ".join(part for part in (dotted_path(p.path), p.message) if part)
        texts.append(one_line(f"{text}; {p.remedy}" if p.remedy else text))
    return " | ".join(dict.fromkeys(texts))


@dataclass(frozen=True)
class CaseOptimum:
    """The optimum of a parameter in a case, its numbers rounded, nan where unknown.

    It is None where an end of the range is as good as any place in it.
    """

    case: str
    parameter: str
    unit: str
    optimum: float | str
    low: float
    high: float
    metric: str
    value: float
    """The metric there, or at the end of the range."""
    edge: str
    """low | high: the end of the range that is best, where there is no optimum; else ""."""
    end: float = math.nan
    """That end."""
    fitted: float = math.nan
    """What the fit says at the optimum, where that is not the value."""

    @property
    def is_beyond_points(self) -> bool:
        """Whether the fit is better there than any point is."""
        return not _is_unknown(self.fitted) and self.fitted != self.value

    @property
    def row(self) -> tuple[Cell, ...]:
        """The row of optimum.csv; unknown values are empty."""
        cells = {name: getattr(self, name) for name in OPTIMUM_COLUMNS}
        if self.edge:
            cells["optimum"] = "none"
        return tuple("" if _is_unknown(cell) else cell for cell in cells.values())

    @property
    def mark(self) -> str:
        """Its interval as tables of figures have it, or a note that it has none."""
        if self.edge:
            return f"no optimum: best at the {self.edge} end"
        return "optimum" if _is_unknown(self.low) else f"optimum {self.low:.6g} to {self.high:.6g}"

    @property
    def plain(self) -> dict[str, Any]:
        """The same as JSON; unknown values are null."""
        return {k: None if _is_unknown(value) else value for k, value in asdict(self).items()}


def _is_unknown(value: object) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


@dataclass(frozen=True)
class ExpectationResult:
    """What became of an expectation."""

    name: str
    verdict: str
    """inside | missed | unknown, where points are missing."""
    summary: str
    """A sentence for a person."""
    basis: Basis
    """Whether the number is predicted, calibrated or chosen."""
    row: tuple[Cell, ...]
    """The row of expected.csv."""


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
    """Number of points not computed yet: those of other shares."""
    refused: tuple[str, ...]
    """What is wrong with cameras of the study."""
    all_refused: bool
    """Whether every point was, before it ran or then."""
    optima: tuple[CaseOptimum, ...]
    expectations: tuple[ExpectationResult, ...]
    averaged: tuple[str, ...] = ()
    """Columns of what is averaged over beside the seed: repeats."""
    computed: int = 0
    """Number of points computed now; the others were there."""
    seconds: float = 0.0
    missed: tuple[str, ...] = ()
    """A sentence for each limit of `expect` that was not kept."""
    unmade: dict[str, str] = field(default_factory=dict)
    """Figures that could not be made, and why."""

    @property
    def rows(self) -> list[Row]:
        """The rows of points.csv, None where a cell is empty: what pandas and polars read."""
        return [{k: None if v == "" else v for k, v in row.items()} for row in self.points]

    @property
    def mean_rows(self) -> list[Row]:
        """Metrics for each case and value of what is varied, means over repeats and seeds."""
        from vcam_cli.sweeps.labeled_table import mean_rows

        return mean_rows(self.points, self.averaged)

    @property
    def optimum_rows(self) -> list[Row]:
        """The rows of optimum.csv, None where a cell is empty."""
        return [{k: o.plain[k] for k in OPTIMUM_COLUMNS} for o in self.optima]

    def to_xarray(self) -> Any:
        """Return metrics over all parameters as an `xarray.Dataset`: see `labeled_table`."""
        from vcam_cli.sweeps.labeled_table import sweep_dataset

        return sweep_dataset(self.points)

    def __repr__(self) -> str:
        """Return a line: name, points, those that failed."""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"<SweepResult {self.name}: {len(self.points)} points{failed}>"

    @property
    def failed(self) -> int:
        """Number of rows with an error."""
        return sum(1 for row in self.points if row["error"])

    @property
    def exit_code(self) -> int:
        """0; 4 where some points or figures failed, 2 where every point was refused."""
        return 2 if self.all_refused else 4 if self.failed or self.unmade else 0

    @property
    def missed_expectations(self) -> tuple[str, ...]:
        """A sentence for each expectation of the study itself that is not met."""
        return tuple(e.summary for e in self.expectations if e.verdict != "inside")

    def summary(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        return {
            "name": self.name,
            "out": str(self.out),
            "points": len(self.ids),
            "computed": self.computed,
            "failed": self.failed,
            "missing": self.missing,
            "optimum": [optimum.plain for optimum in self.optima],
            "missed": [item.name for item in self.expectations if item.verdict == "missed"],
            "limits_missed": list(self.missed),
            "seconds": self.seconds,
            "unmade": self.unmade,
        }

    def record(self) -> dict[str, Any]:
        """Return what study.json says of it."""
        return {
            "name": self.name,
            "points": list(self.ids),
            "failed": self.failed,
            "missing": self.missing,
            "refused": list(self.refused),
            "unmade": self.unmade,
            "all_refused": self.all_refused,
            "optimum": [optimum.plain for optimum in self.optima],
            "expected": [asdict(item) for item in self.expectations],
            "versions": provenance.versions(),
        }


def request_hash(study: StudyFile, sets: Sequence[str], extras: Extras, device: str = "cpu") -> str:
    """Return the hash of what is asked, but for the contents of the files that it names.

    sets: overrides "PATH=VALUE" laid over every camera; device: where noise is drawn. Raises
    BadInput for another text.
    """
    folder = current_folder()
    over = cameras.overlay(sets, folder)
    bases = [[case.name, _files_named(case.base)] for case in study.cases()]
    words = [_files_named(base) for base in study.word_values(over)]
    places = [str(study.file), str(folder) if sets else ""]
    versions = provenance.versions() | {"matplotlib": version("matplotlib")}
    asked = [study.tree.plain(), over.plain(), bases, words, places, versions, asdict(extras)]
    return hash_text(to_json(asked if device == "cpu" else [*asked, device]))


def _files_named(base: Document[Camera]) -> list[Any]:
    """Return what files say that names lead to, and which there are, with those beside them."""
    beside = [companion for path in base.inputs for companion in companions(path)]
    return [base.tree.plain(), [str(path) for path in (*base.inputs, *beside)]]


def finished_result(out: Path, study: StudyFile, request: str) -> SweepResult | None:
    """Return what a finished sweep found; None where something of it has changed."""
    try:
        record = read_record(out / RECORD)
        if record is None or record["asked"] != request or record["check"] != record_check(record):
            return None
        written = Proofs(out, record)
        if not _are_same(record["hashes"]) or not all(map(written.holds, record["files"])):
            return None
        if not _are_kept(out, record, study):
            return None
        return _read_record(record, out, study)
    except (KeyError, TypeError, ValueError, AttributeError):  # not as vcam writes it
        return None


def _are_same(hashes: Mapping[str | Path, str]) -> bool:
    try:
        return all(hash_file(path) == digest for path, digest in hashes.items())
    except CannotDo:
        return False


def _are_kept(out: Path, record: dict[str, Any], study: StudyFile) -> bool:
    """Return whether all points are there and whole."""
    folder, frames = SweepFolder(out), tuple(FRAMES[what] for what in study.model.keep)
    return all(folder.read(point, frames) is not None for point in record["points"] if point)


def _read_record(record: dict[str, Any], out: Path, study: StudyFile) -> SweepResult:
    """Return the result of a finished sweep, from its study.json and its points.csv."""
    return SweepResult(
        name=study.model.name,
        out=out,
        ids=tuple(record["points"]),
        points=list(_rows(out / "points.csv", _column_types(study))),
        averaged=tuple(p.column for p in study.averaged_parameters().values()),
        missing=0,
        refused=tuple(record["refused"]),
        all_refused=record["all_refused"],
        optima=tuple(map(_optimum, record["optimum"])),
        expectations=tuple(
            ExpectationResult(**(row | {"row": tuple(row["row"])})) for row in record["expected"]
        ),
    )


def _optimum(plain: dict[str, Any]) -> CaseOptimum:
    known: dict[str, Any] = {k: math.nan if value is None else value for k, value in plain.items()}
    return CaseOptimum(**known)


def _rows(path: Path, types: dict[str, type]) -> Iterator[Row]:
    """Yield the rows of points.csv, numbers as numbers."""
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield {
                name: types[name](cell) if cell and name in types else cell
                for name, cell in row.items()
            }


def _column_types(study: StudyFile) -> dict[str, type]:
    """Return the columns of points.csv that hold numbers -> their type."""
    parameters = list(study.averaged_parameters().values())
    for case in (None, *study.model.cases):
        parameters += study.case_parameters(case).values()
    own = {p.column: float for p in parameters if isinstance(p.cells[0], float)}
    return {**own, **dict.fromkeys(study.model.metrics, float), "seed": int}
