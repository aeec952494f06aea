"""`vcam accuracy`: what accuracy costs for this camera."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vcam_cli.commands import options
from vcam_cli.commands.plan_story import TABLE_UNITS
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.accuracy_study.setting_errors import Point
    from vcam_cli.accuracy_study.study import Study

SETTINGS = (
    "knob", "setting", "rms %", "of T", "largest %", "electrons", "S-CIELAB", "seconds", "spread",
)  # fmt: skip
EFFECTS = (
    "effect", "state", "expected %", "measured %", "ratio", "share of", "S-CIELAB", "saves ms",
)  # fmt: skip


def accuracy(
    camera: options.Camera,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    level: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
    device: options.Device = "cpu",
    wants_report: options.Report = False,
    formats: options.Formats = None,
) -> None:
    """Measure error and time of every accuracy preset, setting and effect.

    Errors are those of the mean raw frame against a converged reference. Write accuracy.csv,
    accuracy.png and accuracy.json, and recommend a setting for the camera file.

    \b
    Example:
      vcam accuracy starter
      vcam accuracy camera.yaml -o out/knobs --set optics.f_number=8
      vcam accuracy starter --device gpu
    """
    from vcam_cli import face
    from vcam_cli.simulation.checks import load

    model = load(camera, options.overrides(set_, seed, level))
    path = out or Path("out") / model.name
    with Progress(quiet) as bar:
        found = face.accuracy(model, path, workers, bar, wants_report, formats or (), device)
    options.print_found(found, path, as_json, quiet, print_report)


def print_report(found: "Study", path: Path) -> None:
    """Print the tables and the recommendation."""
    from rich.console import Console

    from vcam_cli.accuracy_study.output import computed_on, convergence

    width = None if sys.stdout.isatty() else 120
    console = Console(width=width, soft_wrap=True, highlight=False)
    title = "error against the converged reference, and its ratio to the tolerance T of the setting"
    _table(console, f"{title}; of a knob: its own error", SETTINGS, settings(found))  # fmt: skip
    _table(console, "each effect skipped: change estimated by the plan, and measured", EFFECTS,
           effects(found))  # fmt: skip
    for knob, why in found.absent.items():
        console.print(f"{knob} does not apply: {why}")
    console.print(convergence(found))
    if found.device != "cpu":
        console.print(computed_on(found))
    for sentence in found.recommendation.missed:
        console.print(f"{sentence}.")
    console.print(f"recommended: {found.recommendation.sentence}")
    console.print(f"{path}/accuracy.csv, accuracy.png, accuracy.json")


def _table(console: Any, title: str, head: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    from rich import box
    from rich.table import Table

    style = box.SIMPLE_HEAD if console.is_terminal else None
    table = Table(title=title, title_justify="left", box=style, pad_edge=False)
    for i, name in enumerate(head):
        text = i < 2 or name == "share of"
        # A setting of several knobs is long: it goes on in the next line, and no number is cut.
        table.add_column(name, justify="left" if text else "right", no_wrap=name != "setting")
    for row in rows:
        table.add_row(*row)
    console.print(table)


def settings(found: "Study") -> list[tuple[str, ...]]:
    """Return the rows of the first table."""

    def rms(point: "Point") -> str:
        if point.is_certain:
            return f"{100 * point.rms_error:.2g}"
        return f"<{100 * (point.rms_error + point.unsure):.2g}"

    return [
        (
            p.knob,
            p.setting,
            rms(p),
            "-" if p.tolerance_spent is None else f"{p.tolerance_spent:.2f}",
            f"{100 * p.max_error:.2g}",
            f"{p.rms_electrons:.2g}",
            _delta_e(p.mean_s_cielab),
            f"{p.seconds:.3f}",
            f"{p.seconds_spread:.3f}",
        )
        for p in found.points
        if not p.effect
    ]


def effects(found: "Study") -> list[tuple[str, ...]]:
    """Return the rows of the second table."""
    delta_e = {p.effect: p.mean_s_cielab for p in found.points if p.effect}
    return [
        (
            e.name,
            e.state,
            "-" if e.predicted is None else f"{100 * e.predicted:.2g}",
            f"{100 * e.measured:.2g}",
            "-" if e.ratio is None else f"{e.ratio:.2f}",
            TABLE_UNITS.get(e.unit, e.unit),
            _delta_e(delta_e[e.name]),
            f"{1000 * e.seconds_saved:.0f}",
        )
        for e in found.effects
    ]


def _delta_e(mean_s_cielab: float | None) -> str:
    return "-" if mean_s_cielab is None else f"{mean_s_cielab:.2g}"
