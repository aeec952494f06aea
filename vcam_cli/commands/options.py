"""Arguments and options that several commands share, and the output of commands.

Results go to stdout, everything else to stderr; with `--json` stdout carries one JSON document.
"""

import json
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from vcam_cli.camera.expectations import Limit

PRESETS = ("draft", "standard", "reference")


def complete_camera(incomplete: str) -> list[str]:
    """Complete shipped cameras, YAML files and folders, for the shell."""
    return _complete("cameras", incomplete)


def complete_study(incomplete: str) -> list[str]:
    """Complete shipped studies, YAML files and folders, for the shell."""
    return _complete("studies", incomplete)


def complete_measurement(incomplete: str) -> list[str]:
    """Complete shipped measurements, YAML files and folders, for the shell."""
    return _complete("measurements", incomplete)


def _complete(kind: str, incomplete: str) -> list[str]:
    from vcam_cli.config import shipped

    folder = Path(incomplete).parent if incomplete and not incomplete.endswith("/") else incomplete
    found = [n for n in shipped.names(kind) if n.startswith(incomplete)]
    for path in sorted(Path(folder or ".").glob("*")):
        text = str(path) + ("/" if path.is_dir() else "")
        if text.startswith(incomplete) and (path.is_dir() or path.suffix in (".yaml", ".yml")):
            found.append(text)
    return found


def complete_setting(incomplete: str) -> list[str]:
    """Complete the keys of a camera file for `--set PATH=`, for the shell."""
    from vcam_cli.camera.hints import index

    return [f"{key.dotted}=" for key in index() if key.dotted.startswith(incomplete)]


def complete_study_setting(incomplete: str) -> list[str]:
    """Complete the keys of a schedule study for `--set PATH=`, for the shell."""
    from vcam_cli.capture_schedules.model import ScheduleStudy
    from vcam_cli.config.key_index import keys

    found = dict.fromkeys(f"{key.dotted}=" for key in keys(ScheduleStudy))
    return [key for key in found if key.startswith(incomplete)]


def check_accuracy(value: str | None) -> str | None:
    """Check that a value is draft, standard, reference, or a fraction ("0.01", "1 %")."""
    if value is None or value in PRESETS:
        return value
    from vcam_cli.errors import nearest
    from vcam_cli.units import parse_fraction

    try:
        fraction = parse_fraction(value)
    except ValueError:
        near = nearest(value, PRESETS)
        hint = f"; did you mean {near}?" if near else ""
        message = f"{value!r} is neither {', '.join(PRESETS)} nor a fraction such as 0.01{hint}"
        raise typer.BadParameter(message) from None
    if not 0 < fraction < 1:
        raise typer.BadParameter(f"{value!r} is not between 0 and 1; write for example 0.01")
    return value


FILES = {
    ".png",
    ".jpg",
    ".jpeg",
    ".tif",
    ".tiff",
    ".exr",
    ".dng",
    ".csv",
    ".json",
    ".html",
    ".yaml",
}
"""Ends of names that are of files and of no folder."""


def check_folder(value: Path | None) -> Path | None:
    """Refuse the name of a file for a folder, unless there is such a folder."""
    if value is None or value.suffix.lower() not in FILES or value.is_dir():
        return value
    message = (
        f"{value} is the name of a file, and -o names a folder; write -o {value.with_suffix('')}"
    )
    raise typer.BadParameter(message)


Camera = Annotated[
    str,
    typer.Argument(
        metavar="CAMERA.yaml",
        help="A camera file, or the name of a shipped camera (see `vcam list cameras`).",
        autocompletion=complete_camera,
        show_default=False,
    ),
]
Study = Annotated[
    str,
    typer.Argument(
        metavar="STUDY",
        help="A study file, or the name of a shipped study (see `vcam list studies`).",
        autocompletion=complete_study,
        show_default=False,
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--out",
        metavar="DIR",
        callback=check_folder,
        help="Folder to write into; default out/NAME.",
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        autocompletion=complete_setting,
        help='Override a key of the file, as in --set pixel.width="8 um". Repeatable.',
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="N", min=0, help="Frame seed; the sensor's fixed pattern stays."
    ),
]
Accuracy = Annotated[
    str | None,
    typer.Option(
        "--accuracy",
        metavar="LEVEL",
        callback=check_accuracy,
        help="draft, standard, reference, or a tolerance such as 0.01.",
    ),
]
Frames = Annotated[
    int | None,
    typer.Option(
        "--frames",
        metavar="N",
        min=1,
        max=9999,
        help="Number of frames of a sequence; requires --fps.",
    ),
]
FrameRate = Annotated[
    float | None,
    typer.Option(
        "--fps", metavar="F", min=1e-6, max=1e6, help="Frames per second of the sequence."
    ),
]
Expect = Annotated[
    list[str] | None,
    typer.Option(
        "--expect",
        metavar="'METRIC >= VALUE'",
        help="Limit on a metric; exit code 4 if it is missed. Repeatable.",
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print only a machine-readable summary to stdout.")
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No messages but errors.")]
Report = Annotated[
    bool,
    typer.Option("--report", help="Also write report.html: one page with all results."),
]


def check_formats(values: list[str] | None) -> list[str]:
    """Check that values are formats of plots; png, which is always written, adds nothing."""
    known = ("png", "svg", "pdf")
    for value in values or ():
        if value not in known:
            raise typer.BadParameter(f"{value!r} is not one of {', '.join(known)}")
    return [value for value in dict.fromkeys(values or ()) if value != "png"]


Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="FORMAT",
        callback=check_formats,
        autocompletion=lambda: ["svg", "pdf"],
        help="Also write plots as svg or pdf, in addition to PNG. Repeatable.",
    ),
]
MOST_WORKERS_A_CORE = 4
"""Threads or processes, above which more only wait for each other."""


def few_workers(asked: int | None) -> int | None:
    """Return the number of workers used of those requested, and report it."""
    if asked is None:
        return None
    from vcam_cli.parallel import available_workers

    most = MOST_WORKERS_A_CORE * available_workers()
    if asked <= most:
        return asked
    print(f"--workers {asked}: {most} are used, as more would not be faster", file=sys.stderr)
    return most


Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        min=1,
        callback=few_workers,
        help="Threads; default all cores. Results do not change.",
    ),
]


def device_name(name: str) -> str:
    """Return the name of a device; refuse another name."""
    if name not in ("cpu", "gpu"):
        raise typer.BadParameter(f"{name!r} is no device; write cpu or gpu")
    return name


def _device(name: str) -> str:
    """Return the name of a device that is there."""
    if device_name(name) != "cpu":
        from vcam_cli.devices.choice import open_device

        open_device(name)
    return name


Device = Annotated[
    str,
    typer.Option(
        "--device",
        metavar="cpu|gpu",
        callback=_device,
        help="gpu: compute light, noise and readout on a graphics processor (NVIDIA, by CuPy).",
    ),
]


def overrides(
    sets: Sequence[str] | None, seed: int | None = None, accuracy: str | None = None
) -> list[str]:
    """Return `--set`, `--seed` and `--accuracy` as one list of "PATH=VALUE"."""
    found = list(sets or ())
    if seed is not None:
        found.append(f"seed.frame={seed}")
    if accuracy is not None:
        found.append(f"accuracy={accuracy}")
    return found


def say(message: object, quiet: bool = False) -> None:
    """Print a line for the user on stderr."""
    if not quiet:
        print(message, file=sys.stderr, flush=True)


def end_with_expectations(limits: "Sequence[Limit]", missed: Sequence[str], quiet: bool) -> None:
    """Say what is missed of the limits that are expected; exit with 4 where something is."""
    from vcam_cli.camera.expectations import MISSED, notes

    for note in notes(limit.metric for limit in limits):
        say(note, quiet)
    for sentence in missed:
        say(sentence)
    if missed:
        raise typer.Exit(MISSED)


def line_width(most: int = 96) -> int:
    """Return the columns that lines of text may take: no more than a terminal has."""
    if not sys.stdout.isatty():
        return most
    return min(most, shutil.get_terminal_size().columns)


def wrap(text: str) -> list[str]:
    """Return lines of at most 100 characters, and no wider than a terminal."""
    import textwrap

    return textwrap.wrap(text, line_width(100), break_long_words=False)


def open_table(plain_width: int = 120) -> tuple[Any, Any]:
    """Return a console on stdout and an empty table for it, plain where it is no terminal.

    plain_width: columns that lines may take there.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    width = None if sys.stdout.isatty() else plain_width
    console = Console(width=width, soft_wrap=True, highlight=False)
    return console, Table(box=box.SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)


def print_rows(columns: Sequence[str], rows: Sequence[Sequence[str]], plain: str) -> None:
    """Print rows as a table in a terminal, elsewhere as plain text.

    columns: headings, those of numbers beginning with ">"; cells wrap where the terminal is narrow;
    plain: the text that replaces the table.
    """
    if not sys.stdout.isatty():
        print(plain)
        return
    from rich.text import Text

    console, table = open_table()
    for i, name in enumerate(columns):
        right = name.startswith(">")
        table.add_column(
            Text(name.lstrip(">")),
            justify="right" if right else "left",
            no_wrap=right or i == 0,
        )
    for row in rows:
        table.add_row(*map(Text, row))  # names may hold brackets, which are no markup
    console.print(table, soft_wrap=False)


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows as a table, in columns of plain text without a terminal or in a narrow one.

    columns: headings, those of numbers beginning with ">".
    """
    every = [[name.lstrip(">") for name in columns], *rows]
    widths = [max(map(len, cells)) for cells in zip(*every, strict=True)]
    sides = [">" if name.startswith(">") else "<" for name in columns]
    lines = [
        "  ".join(
            f"{cell:{side}{width}}" for cell, side, width in zip(row, sides, widths, strict=True)
        )
        for row in every
    ]
    plain = "\n".join(line.rstrip() for line in lines)
    if sys.stdout.isatty() and sum(widths) + 2 * len(widths) > line_width(sys.maxsize):
        print(plain)
    else:
        print_rows(columns, rows, plain)


def write_json(value: object) -> None:
    """Print one JSON document on stdout."""
    print(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))


def print_found(
    found: Any, path: Path, as_json: bool, quiet: bool, print_report: Callable[[Any, Path], None]
) -> None:
    """Print what a study found: its report as JSON, or for a reader unless it is to be quiet."""
    if as_json:
        from vcam_cli.files.report import to_json

        print(to_json({"out": str(path), **found.report()}), end="")
    elif not quiet:
        print_report(found, path)
