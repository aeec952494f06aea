"""`vcam schedule`: the capture times of a pixel that is read several times."""

import math
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.arrays import Array
    from vcam_cli.capture_schedules.fewest_captures import FewestCaptures
    from vcam_cli.capture_schedules.schedule_result import ScheduleResult

MOST_TIMES = 10
"""The number of captures whose times are shown."""

Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        autocompletion=options.complete_study_setting,
        help='Override a key of the study, as in --set sensor.read_noise="5 e". Repeatable.',
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="N", min=0, help="Seed of random starts and of simulated noise."
    ),
]


def schedule(
    study: options.Study,
    out: options.Out = None,
    set_: Set = None,
    seed: Seed = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
    report: options.Report = False,
    formats: options.Formats = None,
) -> None:
    """Find the best times to read a pixel several times, and the gain over reading it once.

    Write schedule.csv (the capture times), summary.csv (their gain, and its certified distance from
    the best), plots and study.json.

    \b
    Example:
      vcam schedule captures
      vcam schedule study.yaml --set "counts=[4, 8]" -o out/study
    """
    from vcam_cli.capture_schedules.study import schedule as run
    from vcam_cli.files.report import to_json

    def tell(message: str) -> None:
        options.say(message, quiet)

    with Progress(quiet) as progress:
        result = run(
            study,
            out,
            list(set_ or ()),
            seed or 0,
            accuracy,
            workers,
            progress,
            tell,
            report,
            formats or (),
        )
    if as_json:
        print(to_json(result.summary()), end="")
    elif not quiet:
        print_report(result)


def print_report(result: "ScheduleResult") -> None:
    """Print the tables, and where the files are."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    width = None if sys.stdout.isatty() else 120
    console = Console(width=width, soft_wrap=True, highlight=False)
    style = box.SIMPLE_HEAD if console.is_terminal else None
    table = Table(box=style, pad_edge=False)
    for i, name in enumerate(SUMMARY):
        table.add_column(name, justify="left" if i == 0 else "right", no_wrap=True)
    for row in summary(result):
        table.add_row(*row)
    console.print(table)
    for line in schedule_lines(result):
        console.print(line)
    for target in result.targets:
        console.print(target_sentence(target, result.task.reachable_gain))
    console.print(f"{result.study.model.name}: {result.out}/")


SUMMARY = ("method", "captures", "gain", "upper bound", "gap", "vs optimal", "used", "seconds")


def summary(result: "ScheduleResult") -> list[tuple[str, ...]]:
    """Return the rows of the first table."""
    best = {row["count"]: row["gain"] for row in result.summary_rows if row["method"] == "optimal"}
    return [
        (
            row["method"],
            str(row["count"]),
            f"{row['gain']:.6g}",
            f"{row['upper_bound']:.6g}",
            "-" if row["gap"] is None else f"{row['gap']:.1e}",
            _relative_gain(row["gain"], best.get(row["count"])),
            str(row["used"]),
            f"{row['seconds']:.2g}",
        )
        for row in result.summary_rows
    ]


def _relative_gain(gain: float, best: float | None) -> str:
    """Return a gain relative to the optimal schedule's; only weighted samples exceed that."""
    if best is None or not gain > 0:
        return "-"
    difference = 10 * math.log10(gain / best)
    return "0.00 dB" if abs(difference) < 0.005 else f"{difference:+.2f} dB"


def schedule_lines(result: "ScheduleResult") -> list[str]:
    """Return the best schedules, a line each; other methods only where there are no better ones."""
    plain, methods = result.study.model.sensor is None, result.study.model.methods
    best = [m for m in methods if m in ("optimal", "weighted")] or methods[:1]
    width = max(len(str(one.count)) for one in result.found)
    lines = []
    for method in best:
        lines.append(f"{method} capture times, {'t_k / t_1' if plain else 'in ms'}:")
        for one in result.found:
            if one.method == method:
                shown = "  ".join(_times_text(one.schedule.times, plain))
                lines.append(f"  {one.count:{width}}: {shown}")
    return lines


def _times_text(times: "Array", plain: bool) -> list[str]:
    """Return capture times as text, those in the middle left out where they are many."""
    shown = [f"{v:.4f}" for v in times / times[0]] if plain else [f"{v:.5g}" for v in times * 1e3]
    return shown if len(shown) <= MOST_TIMES else [*shown[: MOST_TIMES - 2], "...", shown[-1]]


def target_sentence(target: "FewestCaptures", bound: float) -> str:
    """Return a sentence about the captures that a gain takes."""
    gain = f"a gain of {target.target:g}"
    if not target.possible:
        return f"{gain} is out of reach: no number of captures gains more than {bound:.6g}"
    if target.count is None:
        return f"{gain} needs more captures than were tried; the largest gain {target.gain:.6g}"
    captures = "1 capture" if target.count == 1 else f"{target.count} captures"
    return f"{gain} takes {captures}, which gain {target.gain:.6g}"
