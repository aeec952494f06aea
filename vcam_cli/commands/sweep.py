"""`vcam sweep`: metrics of a camera over varied parameters."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress
from vcam_cli.interrupts import INTERRUPTED, restore_interrupt

if TYPE_CHECKING:
    from vcam_cli.sweeps.sweep_result import CaseOptimum, ExpectationResult, SweepResult

MOST_MESSAGES = 12
"""The number of messages about points that are shown at most."""
MOST_ROWS = 24
"""The number of rows of results that are shown at most."""


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
Strict = Annotated[
    bool,
    typer.Option("--strict", help="Exit with 4 where the study's own `expect` is not met."),
]


def sweep(
    study: options.Study,
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
    device: options.Device = "cpu",
    wants_report: options.Report = False,
    formats: options.Formats = None,
    expect: options.Expect = None,
    strict: Strict = False,
) -> None:
    """Run a sweep study; print its results, write points.csv, optimum.csv and plots.

    Finished points are kept: an interrupted sweep continues when it is started again.

    \b
    Example:
      vcam sweep exposure-and-noise
      vcam sweep study.yaml --workers 4 -o out/study
    """
    from vcam_cli.camera.expectations import MISSED
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
                    expect or (),
                    device,
                )
        except KeyboardInterrupt as error:
            options.say("interrupted; finished points are kept, and the same command continues")
            raise typer.Exit(INTERRUPTED) from error
    if len(messages) > MOST_MESSAGES:
        options.say(f"and {len(messages) - MOST_MESSAGES} more", quiet)
    say_missing("points.csv", "points", len(result.ids), result.missing)
    if as_json:
        print(to_json(result.summary()), end="")
    elif not quiet:
        print_report(result)
    missed = [*result.missed]
    if strict and not result.missing:
        missed += [f"missed: {sentence}" for sentence in result.missed_expectations]
    for sentence in missed:
        options.say(sentence)
    raise typer.Exit(result.exit_code or (MISSED if missed else 0))


def say_missing(table: str, rows: str, total: int, missing: int) -> None:
    """Report an incomplete table, with --quiet too: a later step may use it."""
    if missing:
        there = total - missing
        options.say(f"{table} has {there} of {total} {rows} so far; other shares compute the rest")


def print_report(result: "SweepResult") -> None:
    """Print the table of results where it is short, the optima, and `closing_lines`."""
    means = [] if result.missing else result.mean_rows
    if 0 < len(means) <= MOST_ROWS or not result.optima:
        options.print_table(*results_table(means[:MOST_ROWS]))
        if len(means) > MOST_ROWS:
            print(f"and {len(means) - MOST_ROWS} rows more: points.csv")
        if len(result.points) > len(means):
            print("means over seeds and repeats")
        print()
    if result.optima:
        options.print_table(*optimum_table(result.optima))
        print()
    print("\n".join(closing_lines(result)))


Table = tuple[list[str], list[list[str]]]
"""Headings, those of numbers with ">", and rows."""


def results_table(means: "Sequence[Mapping[str, object]]") -> Table:
    """Return the metrics at what is varied; the case where there are several."""
    from vcam_cli.sweeps.labeled_table import cell_text

    names = list(means[0]) if means else []
    if len({row["case"] for row in means}) == 1:
        names.remove("case")
    words = {name for name in names if any(isinstance(row[name], str) for row in means)}
    heads = [name if name in words else f">{name}" for name in names]
    return heads, [[cell_text(row[name]) for name in names] for row in means]


def optimum_table(optima: "Sequence[CaseOptimum]") -> Table:
    """Return the best value of each parameter in each case, with a remark."""
    from vcam_cli.sweeps.labeled_table import cell_text

    rows = []
    for best in optima:
        said = f"best at {best.end:g}, the {best.edge} end of its range" if best.edge else ""
        if best.is_beyond_points:
            said = f"{said}; the fit reaches {best.fitted:.6g} between points".removeprefix("; ")
        rows.append([*map(cell_text, best.row), said])
    heads = ["case", "parameter", "unit", ">best", ">low", ">high", "metric", ">value", ""]
    return heads, rows


def closing_lines(result: "SweepResult") -> list[str]:
    """Return the number of points, what failed or is missing, the expectations and the folder."""
    total = len(result.ids)
    there = total - result.missing
    lines = [f"{there} of {total} points, {result.computed} computed in {result.seconds:.1f} s"]
    if result.failed:
        lines.append(f"{result.failed} failed: see the column error of points.csv")
    if not result.missing:
        lines += _expectations_text(result.expectations)
    lines.append(f"{result.name}: {result.out}/")
    return lines


def _expectations_text(verdicts: Sequence["ExpectationResult"]) -> Iterator[str]:
    """Return how many expectations are met, and those that are not."""
    if not verdicts:
        return
    every = [v.basis for v in verdicts]
    met = [v.basis for v in verdicts if v.verdict == "inside"]
    shares = (f"{met.count(b)} of {every.count(b)} {b}" for b in sorted(set(every), reverse=True))
    yield f"expected.csv: {len(met)} of {len(every)} expectations are met: {', '.join(shares)}"
    yield from (f"  {v.verdict}: {v.summary}" for v in verdicts if v.verdict != "inside")
