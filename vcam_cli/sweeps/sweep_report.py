"""report.html of a sweep: its optima, expectations, plots and points on one page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from vcam_cli.reports.page import Facts, Part, Table, number_columns
from vcam_cli.reports.study_report import FOLDED_ROWS, REPORT, study_html
from vcam_cli.sweeps.labeled_table import cell_text
from vcam_cli.sweeps.sweep_result import SweepResult

CAPTIONS = {
    "points.csv": "Every point with its metrics, and with its error where it failed.",
    "timings.csv": "The seconds that each point took.",
    "optimum.csv": "The best values, with intervals over repeats and seeds (low to high).",
    "expected.csv": "Expectations, their sources, and the results.",
}


def report_file(result: SweepResult, contents: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the report by its name; contents: tables and plots of the sweep by their names."""
    facts = [("points", str(len(result.ids))), ("failed", str(result.failed))]
    if result.missing:
        facts.append(("left to other shares", str(result.missing)))
    for best in result.optima:
        case, parameter, unit, optimum, low, high, metric, value = best.row
        interval = f" ({low} to {high})" if low != "" else ""
        end = f", best at {best.end:g}, the {best.edge} end of its range" if best.edge else ""
        said = f"{parameter} {optimum}{interval} {unit}".rstrip()
        facts.append((f"best of {case}", f"{said}, {metric} {value}{end}"))
    facts += [(f"no figure {name}", why) for name, why in result.unmade.items()]
    captions = {name: _caption(name) for name in contents}
    about = "A sweep: metrics of a camera over its parameters."
    shown: list[Part] = [Facts("In short", facts), *_results(result)]
    return {REPORT: study_html(f"{result.name}: a sweep", about, shown, contents, captions)}


def _results(result: SweepResult) -> Iterator[Part]:
    """Yield the table of means over seeds and repeats, where it is short and says more."""
    means = result.mean_rows
    if not 0 < len(means) <= FOLDED_ROWS or len(means) == len(result.points):
        return
    rows = [[cell_text(cell) for cell in row.values()] for row in means]
    note = "Means over seeds and repeats."
    yield Table("Results", list(means[0]), rows, note, numbers=number_columns(rows))


def _caption(name: str) -> str:
    stem = name.removesuffix(".png")
    return CAPTIONS.get(name) or (f"{stem} of every case" if name != stem else "")
