"""`vcam dataset`: labeled frames for learning and testing."""

from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress
from vcam_cli.commands.sweep import Fresh, Processes, Scheduler, Shard, say_missing, share_numbers
from vcam_cli.interrupts import INTERRUPTED, restore_interrupt

if TYPE_CHECKING:
    from vcam_cli.datasets.dataset import DatasetResult

Seed = Annotated[
    int | None,
    typer.Option(
        "--seed",
        metavar="N",
        min=0,
        help="Seed of all draws: scenes, crops, parameters and frame seeds; the sensor's fixed "
        "pattern stays.",
    ),
]


def dataset(
    study: options.Study,
    out: options.Out = None,
    set_: options.Set = None,
    seed: Seed = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: Processes = None,
    scheduler: Scheduler = None,
    shard: Shard = None,
    fresh: Fresh = False,
    device: options.Device = "cpu",
) -> None:
    """Write frames of a camera with random parameters, and their labels.

    Write shards of raw codes with and without noise, manifest.csv with the drawn parameters, the
    noise model's numbers and hashes, and dataset.json. Finished frames are kept: an interrupted
    data set continues when it is started again.

    \b
    Example:
      vcam dataset noise-pairs
      vcam dataset pairs.yaml --workers 4 -o out/pairs
    """
    from vcam_cli import face
    from vcam_cli.files.report import to_json

    with Progress(quiet, log="frames") as progress:
        try:
            with restore_interrupt():
                found = face.dataset(
                    study,
                    out,
                    set_ or (),
                    seed,
                    accuracy,
                    workers,
                    scheduler,
                    share_numbers(shard),
                    fresh,
                    progress,
                    lambda message: options.say(message, quiet),
                    device,
                )
        except KeyboardInterrupt as error:
            options.say("interrupted; finished frames are kept, and the same command continues")
            raise typer.Exit(INTERRUPTED) from error
    say_missing("manifest.csv", "frames", found.frames, found.missing)
    if as_json:
        print(to_json(found.summary()), end="")
    elif not quiet:
        print(report(found))
    raise typer.Exit(found.exit_code)


def report(found: "DatasetResult") -> str:
    """Return the report of a data set: numbers of frames and shards, and the folder."""
    lines = [f"{found.frames} frames, {found.computed} computed in {found.seconds:.1f} s"]
    if found.failed:
        lines.append(f"{found.failed} failed: see the column error of manifest.csv")
    lines.append(f"{found.name}: {found.out}/, {found.shards} shards, manifest.csv")
    return "\n".join(lines)
