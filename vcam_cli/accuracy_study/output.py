"""What `vcam accuracy` leaves in its folder: its table, plot, record and report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vcam_cli.accuracy_study.plots import Curve, Pair, pareto
from vcam_cli.accuracy_study.setting_errors import FLOOR
from vcam_cli.accuracy_study.study import COLUMNS, Study
from vcam_cli.camera.camera import Camera
from vcam_cli.files import tables
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports.page import Facts
from vcam_cli.simulation.output.study_files import write_study

TOTAL = ("preset", "tolerance", "auto", "all", "file", "combined")
"""The rows whose error is that of all knobs together."""


def write(
    found: Study,
    camera: Camera,
    folder: OutputFolder,
    report: bool = False,
    formats: Sequence[str] = (),
) -> None:
    """Write all files of a study; report: report.html, too; formats: of plots beside PNG."""
    tables.write_table(folder.new("accuracy.csv"), COLUMNS, (point.row for point in found.points))
    drawn = {"accuracy.png": lambda path: pareto(path, *pareto_arguments(found))}
    page = report_arguments(found) if report else None
    record = found.report() | {"camera": camera.model_dump(mode="json")}
    write_study(folder, drawn, formats, page, record)


def pareto_arguments(found: Study) -> tuple[Any, ...]:
    """Return the arguments of `plots.pareto`: title, presets, curves, tolerance, panels, all on."""

    def points(*knobs: str) -> tuple[tuple[float, float, str], ...]:
        return tuple((p.seconds, p.rms_error, p.setting) for p in found.points if p.knob in knobs)

    curves = [
        Curve(knob.replace("_", " "), points(knob))
        for knob in dict.fromkeys(p.knob for p in found.points if not p.effect)
        if knob not in TOTAL and knob != "shot_noise"  # which changes no mean
    ]
    panels = []
    for label, wanted in (("of full signal", False), ("of the variance", True)):
        pairs = [
            Pair(e.name, e.predicted, e.measured)
            for e in found.effects
            if e.unit.endswith("variance") == wanted and (e.measured or e.predicted)
        ]
        if pairs:
            panels.append((f"change if skipped, {label}", pairs))
    tolerance = found.camera.accuracy.tolerance
    title = f"{found.camera.name}: accuracy and time"
    return title, points("preset", "tolerance"), curves, tolerance, panels, points("all")


def report_arguments(found: Study) -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    facts = [
        ("recommended", found.recommendation.sentence.replace("`", "")),
        *(("tolerance missed", text.replace("`", "")) for text in found.recommendation.missed),
        ("reference", convergence(found)),
    ]
    facts += [(f"{knob} does not apply", why) for knob, why in found.absent.items()]
    if found.device != "cpu":
        facts.append(("device", computed_on(found)))
    captions = {
        "accuracy.csv": "Errors of the mean raw frame against the reference, relative to full"
        " signal; of a setting with all others converged.",
        "accuracy.png": "Error over seconds of every preset and setting; the plan's estimate of"
        " each effect over its measured effect",
    }
    about = "Error of the mean raw frame against a converged reference, and the time in seconds."
    title = f"{found.camera.name}: accuracy and time"
    return {
        "title": title,
        "about": about,
        "facts": [Facts("In short", facts)],
        "captions": captions,
    }


def computed_on(found: Study) -> str:
    """Return what was computed where."""
    return (
        f"presets, tolerances and times: {found.device}; reference and errors of single knobs: cpu"
    )


def convergence(found: Study) -> str:
    """Return how accurate the reference is against which errors are measured."""
    reference = found.reference
    shown = [p for p in found.points if not p.effect]
    unsure = sorted({p.knob for p in shown if not p.is_certain})
    text = (
        f"full signal: {reference.full_signal:.6g} electrons; estimated error of the reference:"
        f" {100 * reference.lost:.1g} % of it"
    )
    if unsure:
        return (
            f"{text}; <: upper bound, since the reference is not ten times better"
            f" ({', '.join(unsure)})"
        )
    return (
        f"{text}; each knob was refined until the change was a tenth of its least error, or below"
        f" {100 * FLOOR:.0e} % (rounding)"
    )
