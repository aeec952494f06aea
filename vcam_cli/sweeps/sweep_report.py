"""report.html of a sweep: its optima, expectations, plots and points on one page."""

from __future__ import annotations

from collections.abc import Mapping

from vcam_cli.reports.page import Facts
from vcam_cli.reports.study_report import REPORT, study_html
from vcam_cli.sweeps.sweep_result import SweepResult

CAPTIONS = {
    "points.csv": "Every point with its metrics, and with its error where it failed.",
    "timings.csv": "The seconds that each point took.",
    "optimum.csv": "The best values. From low to high: what repeats and seeds cannot tell apart.",
    "expected.csv": "What was expected, on what ground, and what was found.",
}


def report_file(result: SweepResult, contents: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the report by its name; contents: tables and plots of the sweep by their names."""
    facts = [("points", str(len(result.ids))), ("failed", str(result.failed))]
    if result.missing:
        facts.append(("left to other shares", str(result.missing)))
    for best in result.optima:
        case, parameter, unit, optimum, low, high, metric, value = best.row
        interval = f" ({low} to {high})" if low != "" else ""
        end = f", at the {best.edge} end of its range" if best.edge else ""
        said = f"{parameter} {optimum}{interval} {unit}".rstrip()
        facts.append((f"best of {case}", f"{said}, {metric} {value}{end}"))
    facts += [(f"no figure {name}", why) for name, why in result.unmade.items()]
    captions = {name: _caption(name) for name in contents}
    about = "A sweep: metrics of a camera over its parameters."
    shown = [Facts("In short", facts)]
    return {REPORT: study_html(f"{result.name}: a sweep", about, shown, contents, captions)}


def _caption(name: str) -> str:
    stem = name.removesuffix(".png")
    return CAPTIONS.get(name) or (f"{stem} of every case" if name != stem else "")
