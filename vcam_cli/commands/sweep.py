"""`vcam sweep`: metrics of a camera over varied parameters."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress
from vcam_cli.interrupts import INTERRUPTED, restore_interrupt

if TYPE_CHECKING:
    from vcam_cli.sweeps.sweep_result import ExpectationResult, SweepResult

MOST_MESSAGES = 12
"""The number of messages about points that are shown at most."""


def _shard(value: str | None) -> str | None:
    """Check that a share, if given, is written as 2/8, the second of eight."""
    if value is None:
        return None
    number, _, count = value.partition("/")
    whole = all(part.isascii() and part.isdigit() for part in (number, count))
    if not whole or not 1 <= int(number) <= int(count):
        message = f"{value!r} is not a share such as 2/8, the second of eight"
        raise typer.BadParameter(message)
    return value


def share_numbers(shard: str | None) -> tuple[int, int] | None:
    """Return the share's number and how many there are, of a word that `_shard` has checked."""
    if shard is None:
        return None
    number, count = shard.split("/")
    return int(number), int(count)


Study = Annotated[
    str,
    typer.Argument(
        metavar="STUDY",
        help="A study file, or the name of a shipped study (see `vcam list studies`).",
        autocompletion=options.complete_study,
        show_default=False,
    ),
]
Processes = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        min=1,
        callback=options.few_workers,
        help="Processes; default all cores. Results do not change.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Compute on this Dask scheduler."),
]
Shard = Annotated[
    str | None,
    typer.Option(
        "--shard",
        metavar="I/N",
        callback=_shard,
        help="Only the I-th of N shares; shares written to one --out add up.",
    ),
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Compute finished points again.")]


def sweep(
    study: Study,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: Processes = None,
    scheduler: Scheduler = None,
    shard: Shard = None,
    fresh: Fresh = False,
    wants_report: options.Report = False,
    formats: options.Formats = None,
) -> None:
    """Run a sweep study and write points.csv, optimum.csv and a plot of every metric.

    Finished points are kept: a sweep that was stopped goes on when it is started again.

    \b
    Example:
      vcam sweep exposure-and-noise
      vcam sweep study.yaml --workers 4 -o out/study
    """
    from vcam_cli.files.report import to_json
    from vcam_cli.sweeps.sweep import sweep as run

    messages: list[str] = []

    def tell(message: str) -> None:
        messages.append(message)
        if len(messages) <= MOST_MESSAGES:
            options.say(message, quiet)

    with Progress(quiet, log="sweep") as progress:
        try:
            with restore_interrupt():
                result = run(
                    study,
                    out,
                    options.overrides(set_, seed, accuracy),
                    workers,
                    scheduler,
                    share_numbers(shard),
                    fresh,
                    progress,
                    tell,
                    wants_report,
                    formats or (),
                )
        except KeyboardInterrupt as error:
            options.say("interrupted; finished points are kept, the same command goes on with them")
            raise typer.Exit(INTERRUPTED) from error
    if len(messages) > MOST_MESSAGES:
        options.say(f"and {len(messages) - MOST_MESSAGES} more", quiet)
    if as_json:
        print(to_json(result.summary()), end="")
    elif not quiet:
        print(report(result))
    raise typer.Exit(result.exit_code)


def report(result: "SweepResult") -> str:
    """Return the report of a sweep: optima, number of points, expectations and folder."""
    lines = []
    for f in result.optima:
        case, parameter, unit, best, low, high, metric, value = f.row
        interval = f" ({low} to {high})" if low != "" else ""
        lines.append(f"{case}: best {parameter} {best}{interval} {unit}".rstrip())
        lines[-1] += f", {metric} {value}"
        if f.is_beyond_points:
            lines.append(f"  of the best point; between the points the fit reaches {f.fitted:.6g}")
        if f.edge:
            end = "low" if f.edge == "low" else "high"
            lines.append(f"  at the {end} end of its range: the optimum may lie beyond")
    total = len(result.ids)
    there = total - result.missing
    lines.append(f"{there} of {total} points, {result.computed} computed in {result.seconds:.1f} s")
    if result.failed:
        lines.append(f"{result.failed} failed: see the column error of points.csv")
    if result.missing:
        lines.append(f"{result.missing} are left to other shares")
    else:
        lines += _expectations_text(result.expectations)
    lines.append(f"{result.name}: {result.out}/")
    return "\n".join(lines)


def _expectations_text(verdicts: Sequence["ExpectationResult"]) -> Iterator[str]:
    """Return how many expectations are met, and those that are not."""
    if not verdicts:
        return
    every = [v.basis for v in verdicts]
    met = [v.basis for v in verdicts if v.verdict == "inside"]
    shares = (f"{met.count(b)} of {every.count(b)} {b}" for b in sorted(set(every), reverse=True))
    yield f"expected.csv: {len(met)} of {len(every)} expectations are met: {', '.join(shares)}"
    yield from (f"  {v.verdict}: {v.summary}" for v in verdicts if v.verdict != "inside")
