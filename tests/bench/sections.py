"""The parts of the benchmark: each a mapping of names to ratios, every ratio of one process."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import load, simulate, sweep
from vcam_cli.accuracy import ablation
from vcam_cli.accuracy.study import without
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.shot_noise import optimal_schedules

from . import plain
from .cameras import BUSY, PLAIN, Studio, studio
from .measure import Cost, Frames, frames, middle, timed, yardstick

Ratio = dict[str, float]
CAPTURES = range(1, 21)
IN_TURN = 2e6
"""Pixels that small frames of a turn have together, about."""
VARIED = {
    "exposure time": ("exposure.time", "10 ms", "50 ms"),
    "f-number": ("optics.f_number", "2.8", "8"),
}
"""Light is brought to the pixels once for all exposure times, and anew for every f-number."""


def against_yardstick(
    place: Studio, size: tuple[int, int], repeats: int, scenes: Sequence[str]
) -> tuple[dict[str, Ratio], Frames]:
    """Frames over R_compute of as many components; and those of the gray picture, for stages.

    Each takes turns with the yardstick, since machines are faster at one moment than at another.
    """
    found, kept = {}, []
    for scene in ("gray", *scenes):
        taken, units = Frames(place.camera(scene)).take(0, warm=True), []
        for _ in range(repeats):
            units.append(yardstick(*size, 1))
            taken.take()
        unit = middle(units).of(taken.components)
        more = f", {taken.components} components" if taken.components > 1 else " picture"
        found[f"{scene}{more}"] = taken.cost.over(unit)
        kept.append(taken)
    return found, kept[0]


def against_plain(
    place: Studio, repeats: int, scenes: Sequence[str] = ("gray", "color"), count: int = 31
) -> tuple[dict[str, Ratio], float]:
    """The plain pipeline over vcam's frame, its render left out; and how far the two are apart.

    The last: rms of the difference of their mean rates over the largest rate. Most of it are the
    fine details that a picture sampled once a pixel does not have. No warming up for the plain one:
    it has nothing to warm.
    """
    found = {}
    apart = math.nan
    for scene in scenes:
        camera = place.camera(scene, processing=[])
        given, ours = plain.setup(camera, count)
        theirs = timed(lambda given=given: plain.frame(given), repeats, warm=False)
        found[scene] = theirs.over(frames(camera, repeats).cost)
        apart = ablation.rms(plain.rate(given) - ours) / float(ours.max())
    return found, apart


def per_effect(
    place: Studio, repeats: int, names: Sequence[str] = (), base: dict[str, Any] = BUSY
) -> dict[str, Ratio]:
    """The frame with everything on over the same without one effect, at a fixed exposure time.

    names: some of the effects, default all. Turns are taken, so that a machine that gets slower
    does so for all.
    """
    free = place.camera("gray", base)
    camera = ablation.with_exposure_time(free, simulate(free).exposure_time)
    chosen = names or ablation.wanted_effects(camera)
    camera = ablation.with_effects(camera, "all")
    whole = Frames(camera).take(0, warm=True)
    others = {name: Frames(without(camera, name)) for name in chosen}
    for name in chosen:
        others[name].take(0, warm=True)
    for _ in range(repeats):
        whole.take()
        for other in others.values():
            other.take()
    return {name: whole.cost.over(other.cost) for name, other in others.items()}


def growth(
    sizes: Sequence[tuple[int, int]], repeats: int, always: dict[str, Any]
) -> dict[str, Any]:
    """How time grows with pixels: time ~ pixels ** exponent. 1 is proportional.

    The exponent of a line through all sizes, those between neighbors, and the time a pixel takes
    at each size over that at the largest. Sizes take turns, small ones more than one at a time.
    All pictures are the middle of the largest: the more detail, the further up spectra are
    followed.
    """
    pixels = [float(rows * columns) for rows, columns in sizes]
    with ExitStack() as studios:
        taken = []
        for rows, columns in sizes:
            place = studios.enter_context(studio(rows, columns, always, of=sizes[-1]))
            taken.append(Frames(place.camera("gray")).take(0, warm=True))
        for _ in range(repeats):
            for one, size in zip(taken, pixels, strict=True):
                one.take(round(min(max(IN_TURN / size, 1), 8)))
    costs = [one.cost for one in taken]
    out: dict[str, Any] = {"megapixels": [p / 1e6 for p in pixels]}
    for clock in ("wall", "cpu"):
        seconds = [getattr(cost, clock) for cost in costs]
        logs = np.log(pixels), np.log(seconds)
        out[clock] = {
            "exponent": float(np.polyfit(*logs, 1)[0]),
            "between": (np.diff(logs[1]) / np.diff(logs[0])).tolist(),
            "a_pixel": (np.divide(seconds, pixels) * pixels[-1] / seconds[-1]).tolist(),
        }
    return out


def wavelengths(place: Studio, repeats: int) -> dict[str, Ratio]:
    """Frames of 301 wavelengths over those of 31, and the exponent that follows from it.

    Turns are taken, since the difference is small.
    """
    few, many = (
        Frames(place.camera("gray", accuracy={"wavelength_step": step}))
        for step in ("10 nm", "1 nm")
    )
    for each in (few, many):
        each.take(0, warm=True)
    for _ in range(repeats):
        few.take()
        many.take()
    ratio = many.cost.over(few.cost)
    exponent = {clock: math.log(r) / math.log(301 / 31) for clock, r in ratio.items()}
    return {"301 over 31": ratio, "exponent": exponent}


def sweeps(place: Studio, repeats: int, points: int = 20, varied: Sequence[str] = ()) -> dict:
    """A sweep of so many points over one frame with its metric; 1 / points of it is one point's.

    Processes are started, and tables and plots written, on the sweep's account. Wall clock only:
    the work is in other processes.
    """
    quality = {"quality": ["psnr"], "exposure": {"time": "20 ms"}}
    tree = place.tree("gray", PLAIN, **quality)
    path = place.write(tree, "swept.yaml")
    camera = load(path)
    single = timed(lambda: simulate(camera).metrics, repeats)
    found = {}
    for name in varied or VARIED:
        key, start, stop = VARIED[name]
        study = place.write(
            {
                "kind": "sweep",
                "name": "bench",
                "camera": str(path),
                "vary": {key: {"start": start, "stop": stop, "count": points}},
                "metrics": ["psnr_db"],
            },
            "study.yaml",
        )
        seconds = _swept(study, place.folder / f"sweep {name}", points)
        found[name] = {"wall": seconds / single.wall, "points": points}
    return found


def _swept(study: Path, out: Path, points: int) -> float:
    """Seconds of a sweep from nothing. Raises RuntimeError where a point of it fails."""
    done = sweep(study, out=out)
    if done.failed or done.computed != points:
        raise RuntimeError(f"{done.failed} points of the sweep failed, {done.computed} computed")
    return done.seconds


def schedules(unit: Cost, repeats: int, levels: int = 65_536) -> dict[str, Ratio]:
    """Best schedules of 1 to 20 captures of a scene of so many levels, over R_compute."""
    rng = np.random.default_rng(0)
    values = np.sort(np.exp(rng.uniform(0, np.log(1e6), levels)))
    scene = Pdf.levels(values, rng.random(levels) + 1e-3)
    cost = timed(lambda: optimal_schedules(scene, CAPTURES), repeats)
    return {f"{levels} levels, 1 to {CAPTURES[-1]} captures": cost.over(unit)}


def command(unit: Cost, repeats: int, rows: int = 432, columns: int = 600) -> dict[str, Ratio]:
    """`vcam run` of a small frame from start to end, and what loading takes of it.

    unit: R_compute at 12 megapixels, whatever the size of this frame. As it is installed: compiled
    once, which the first, uncounted run does.
    """
    size = [f"--set=array.rows={rows}", f"--set=array.columns={columns}"]
    with tempfile.TemporaryDirectory() as folder:
        run = ["-m", "vcam_cli.commands.main", "run", "starter", "-q", "-o", f"{folder}/out", *size]
        loading = ["-c", f"import {', '.join(LOADED)}"]
        works = {"vcam run": run, "of it Python and loading": loading}
        return {
            f"{name}, {rows} x {columns}": {"wall": _started(work, folder, repeats) / unit.wall}
            for name, work in works.items()
        }


LOADED = (
    "vcam_cli.commands.main",
    "vcam_cli.commands.run",
    "vcam_cli.simulation.checks",
    "vcam_cli.simulation.outputs",
    "vcam_cli.simulation.simulate",
    "vcam_cli.files.report",
)
"""What `vcam run` loads."""


def _started(work: Sequence[str], folder: str, repeats: int) -> float:
    """Seconds of a Python process: median, by the clock."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    kept["PYTHONPYCACHEPREFIX"] = f"{folder}/compiled"

    def start() -> None:
        subprocess.run([sys.executable, *work], env=kept, check=True)

    return timed(start, repeats).wall
