"""`vcam accuracy`: what accuracy costs for this camera."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.studies.accuracy import Study

SHARE_OF = {
    "of full signal": "full signal",
    "of the temporal variance": "temporal var.",
    "of the fixed-pattern variance": "fixed var.",
}
"""Units of the plan, short enough for a table."""


def accuracy(
    camera: options.Camera,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    level: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
) -> None:
    """Shows what accuracy costs: error and seconds of every preset, knob and effect.

    Errors are of the mean raw against a converged reference. Writes accuracy.csv, accuracy.png and
    accuracy.json, and recommends a setting for the camera file.

    \b
    Example:
      vcam accuracy starter
      vcam accuracy camera.yaml -o out/knobs --set optics.f_number=8
    """
    from vcam_cli.files import plots, report, tables
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.studies import accuracy as study
    from vcam_cli.studies import outputs
    from vcam_cli.studies.checks import load

    model = load(camera, options.overrides(set_, seed, level))
    inputs = outputs.inputs(model)
    path = out or Path("out") / model.name
    place = OutputFolder(path, record="accuracy.json", inputs=inputs)
    with place as folder, Progress(quiet) as progress:
        found = study.accuracy(model, workers, progress)
        rows = (point.row for point in found.points)
        tables.write_table(folder.new("accuracy.csv"), study.COLUMNS, rows)
        plots.pareto(folder.new("accuracy.png"), *pictured(found))
        record = found.report() | {"camera": model.model_dump(mode="json")}
        folder.finish(record | {"versions": outputs.versions()})
    if as_json:
        print(report.to_json({"out": str(path), **found.report()}), end="")
    elif not quiet:
        tell(found, path)


def pictured(found: "Study"):
    """What `plots.pareto` takes: title, presets, curves, tolerance, panels."""
    from vcam_cli.files.plots import Curve, Pair

    def points(knob: str):
        return tuple((p.seconds, p.rms_error, p.setting) for p in found.points if p.knob == knob)

    knobs = dict.fromkeys(p.knob for p in found.points if not p.knob.startswith("effect:"))
    curves = [
        Curve(knob.replace("_", " "), points(knob))
        for knob in knobs
        if knob not in ("preset", "file")
    ]
    panels = []
    for label, wanted in (("of full signal", False), ("of the variance", True)):
        pairs = [
            Pair(e.name, e.predicted, e.measured)
            for e in found.effects
            if e.unit.endswith("variance") == wanted and (e.measured or e.predicted)
        ]
        if pairs:
            panels.append((f"change by leaving it out, {label}", pairs))
    tolerance = found.camera.accuracy.tolerance
    return f"{found.camera.name}: error and time", points("preset"), curves, tolerance, panels


def tell(found: "Study", path: Path) -> None:
    """The tables and the recommendation, on stdout."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    width = None if sys.stdout.isatty() else 120
    console = Console(width=width, soft_wrap=True, highlight=False)
    style = box.SIMPLE_HEAD if console.is_terminal else None
    for title, head, rows in (
        ("", ("knob", "setting", "rms error", "largest", "electrons", "seconds", "spread"),
         settings(found)),
        ("what the plan expected of each effect, and what leaving it out did",
         ("effect", "state", "expected", "measured", "ratio", "share of", "saves"), effects(found)),
    ):  # fmt: skip
        table = Table(title=title or None, title_justify="left", box=style, pad_edge=False)
        for i, name in enumerate(head):
            text = i < 2 or name == "share of"
            table.add_column(name, justify="left" if text else "right", no_wrap=True)
        for row in rows:
            table.add_row(*row)
        console.print(table)
    expected = [p for p in found.points if p.knob == "file" and p.predicted is not None]
    if expected:
        p = expected[0]
        console.print(
            f"of the spectrum the plan expected to lose {p.predicted:.2e}; the file as it is"
            f" is off by {p.rms_error:.2e} rms"
        )
    console.print(f"full signal: {found.reference.full_signal:.6g} electrons")
    console.print(f"recommended: {found.recommendation.sentence}")
    console.print(f"{path}/accuracy.csv, accuracy.png, accuracy.json")


def settings(found: "Study") -> list[tuple[str, ...]]:
    """Rows of the first table."""
    return [
        (
            p.knob,
            p.setting,
            f"{p.rms_error:.2e}",
            f"{p.max_error:.2e}",
            f"{p.rms_electrons:.3g}",
            f"{p.seconds:.3g}",
            f"{p.seconds_spread:.2g}",
        )
        for p in found.points
        if not p.knob.startswith("effect:")
    ]


def effects(found: "Study") -> list[tuple[str, ...]]:
    """Rows of the second table."""
    return [
        (
            e.name,
            e.state,
            "-" if e.predicted is None else f"{e.predicted:.2e}",
            f"{e.measured:.2e}",
            "-" if e.ratio is None else f"{e.ratio:.2f}",
            SHARE_OF.get(e.unit, e.unit),
            f"{1000 * e.seconds_saved:.0f} ms",
        )
        for e in found.effects
    ]
