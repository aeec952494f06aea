"""What is cheap when repeated: loops, sweeps of small frames, commands that form no frame.

Each figure stands beside what it is compared with, and beside the same before these costs were
looked at (October 2026, the same ratios on two busy processors).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from vcam_cli import load, simulate, sweep
from vcam_cli.camera.camera import Camera
from vcam_cli.simulation.shared import RECENT, Shared

from .measure import Cost, run_cost, start_cost, take_turns

Row = dict[str, float]
LEAVES = (
    "array.rows=128",
    "array.columns=128",
    "scene.source={chart: dead-leaves, seed: 3}",
    "exposure={time: 10 ms}",
    "output.render=none",
)
SMALL = ("array.rows=32", "array.columns=32", "output.render=none")
IMPORTS = "numpy", "pydantic", "typer"
COMMANDS = {
    "vcam list": (("list",), 3.4),
    "vcam explain optics.f_number": (("explain", "optics.f_number"), 6.4),
    "vcam validate starter": (("validate", "starter"), 5.0),
}
"""Command -> its arguments, and its processor time over bare imports before."""


def repeated(repeats: int, count: int = 12, points: int = 200) -> dict[str, dict[str, Row]]:
    """Loops over single frames, a sweep over its loop, commands over the imports of libraries."""
    return {
        f"loops of {count}, over as many frames alone": _loops(repeats, count),
        f"a sweep of {points} frames of 32 x 32 pixels, over a loop": _small_sweep(repeats, points),
        f"commands over the imports of {', '.join(IMPORTS)}": _commands(repeats),
    }


def _loops(repeats: int, count: int) -> dict[str, Row]:
    camera = load("still-life", LEAVES)
    times = [camera.with_({"exposure.time": f"{n} ms"}) for n in range(2, 2 + count)]
    lenses = [camera.with_({"optics.f_number": 2.1 + 0.02 * n}) for n in range(count)]
    return {
        "exposure times": _over_alone(repeats, times) | {"before": 1.0},
        "f-numbers, before leaves": _over_alone(repeats, lenses) | {"before": 1.0},
    }


def _over_alone(repeats: int, cameras: Sequence[Camera]) -> Row:
    """Frames one after the other, over as many of which each is the first of a process."""
    from vcam_cli.scenes import discs

    def loop(forget: bool) -> None:
        for each in cameras:
            if forget:
                discs.forget()
            simulate(each, 1, shared=Shared() if forget else None)

    def together() -> Cost:
        RECENT.clear()
        discs.forget()
        return run_cost(lambda: loop(False))

    kept, alone = take_turns(repeats, together, lambda: run_cost(lambda: loop(True)))
    return kept.ratio(alone)


def _small_sweep(repeats: int, points: int) -> dict[str, Row]:
    noise = "pixel.readout.read_noise"
    camera = load("starter", SMALL)
    cameras = [camera.with_({noise: f"{1 + n / points} e"}) for n in range(points)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.yaml"
        values = f"{{start: 1 e, stop: 2 e, count: {points}}}"
        study.write_text(
            "kind: sweep\nname: small\ncamera: starter\nmetrics: [snr_db]\n"
            f"vary:\n  {noise}: {values}\n"
        )

        def swept() -> Cost:
            def work() -> None:
                sweep(study, folder / "out", SMALL[:2], workers=1, fresh=True)

            return run_cost(work)

        def looped() -> Cost:
            shared = Shared()

            def work() -> None:
                for each in cameras:
                    simulate(each, 1, shared=shared).metrics["snr_db"]

            return run_cost(work)

        one, other = take_turns(repeats, swept, looped)
    return {"points": one.ratio(other) | {"before": 2.0}}


def _commands(repeats: int) -> dict[str, Row]:
    rows = {}
    with tempfile.TemporaryDirectory() as folder:

        def started(*work: str) -> Callable[[], Cost]:
            return lambda: start_cost(work, folder)

        bare = started("-c", f"import {', '.join(IMPORTS)}")
        for name, (arguments, before) in COMMANDS.items():
            whole, imports = take_turns(
                repeats, started("-m", "vcam_cli.commands.main", *arguments), bare
            )
            rows[name] = whole.ratio(imports) | {"before": before}
    return rows
