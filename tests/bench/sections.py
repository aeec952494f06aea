"""The parts of the benchmark: each gives sections of rows, every row a ratio of one process."""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import load, simulate, sweep
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.study import without_effect
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.config import shipped
from vcam_cli.errors import CannotDo
from vcam_cli.floats import rms
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.shot_noise import optimal_schedules
from vcam_cli.simulation.shared import Shared

from . import plain
from .cameras import BUSY, LAYERED, PLAIN, Studio, studio
from .measure import (
    Cost,
    Frames,
    frames,
    median_cost,
    median_yardstick,
    peak_memory,
    start_cost,
    take_turns,
    yardstick,
)

Row = dict[str, float]
"""Figures by column (`report.FORMATS`), and under `at_most` what is asked of the first."""
Section = dict[str, Row]
"""Rows by name."""

CAPTURES = range(1, 21)
PIXELS_A_TURN = 2e6
"""Pixels that the small frames of one turn have together, about."""
MOST_A_TURN = 8
"""Frames of one turn, at most."""
PAINTED_OVER_PHOTOGRAPH = 2.0
"""What a painted chart may cost over a photograph of its size."""
PAINTED_MEMORY = 1.3
"""What a painted chart of 12 megapixels may take of memory [GB]."""
LAYERS_OVER_FLAT = 4.0
"""What a scene of eight layers may cost over a flat frame, of them or of one of them."""
LENS_OVER_WAVEFRONT = 3.0
"""What a frame through a traced lens may cost over one with one wavefront and its distortion."""
LENS_SCENES = {
    "photograph": "{kind: image, file: %s}",
    "ColorChecker": "{kind: chart, chart: colorchecker}",
    "slanted edge": "{kind: chart, chart: slanted-edge}",
    "leaves": "{kind: chart, chart: dead-leaves}",
}
"""Scenes before the lens; the photograph is the street that ships."""
START_UP = 0.3
"""What `vcam run` may take beyond the bare imports [s]."""
IMPORTS = ("numpy", "scipy.fft", "pydantic", "OpenImageIO", "typer")
"""Libraries without which no frame is simulated and written."""
VARIED = {
    "exposure time": ("exposure.time", "10 ms", "50 ms"),
    "f-number": ("optics.f_number", "2.8", "8"),
}
"""Light is brought to the pixels once for all exposure times, and anew for every f-number."""


def frames_a_turn(pixels: float) -> int:
    """The number of frames of so many pixels that make one turn."""
    return round(min(max(PIXELS_A_TURN / pixels, 1), MOST_A_TURN))


def over_yardstick(camera: Camera, repeats: int) -> tuple[Row, Frames]:
    """A camera's frames over R_compute of its own size and components, and these frames."""
    g = geometry(camera)
    taken, units = Frames(camera).take(warm=True, repeats=0), []
    for _ in range(repeats):
        units.append(yardstick(g.rows, g.columns, frames_a_turn(g.rows * g.columns)))
        taken.take()
    unit = median_yardstick(units).compute(taken.components)
    return taken.cost.ratio(unit), taken


def against_yardstick(place: Studio, repeats: int, scenes: Sequence[str]) -> dict[str, Section]:
    """A camera before several scenes over R_compute, and the stages' shares of the gray one."""
    rows, shares = {}, {}
    for scene in ("gray", *scenes):
        ratio, taken = over_yardstick(place.camera(scene), repeats)
        more = f", {taken.components} components" if taken.components > 1 else " picture"
        rows[f"{scene}{more}"] = ratio
        if scene == "gray":
            shares = {name: {"share": share} for name, share in taken.shares.items()}
    return {"frame over R_compute": rows, "shares of the frame of a gray picture": shares}


def shipped_cameras(names: Sequence[str], repeats: int) -> dict[str, Section]:
    """Every shipped camera's frame over R_compute of its own size and components."""
    rows = {}
    for name in names:
        camera = load(name)
        g = geometry(camera)
        rows[f"{name}, {g.rows * g.columns / 1e6:.2g} MP"] = over_yardstick(camera, repeats)[0]
    return {"frame time over R_compute, shipped cameras": rows}


def painted_chart(place: Studio, repeats: int) -> dict[str, Section]:
    """The camera `12mp-bayer` before its painted chart and before a photograph of that size."""
    extended = {
        "name": "painted",
        "extends": str(shipped.find("cameras", "12mp-bayer")),
        "array": {"rows": place.rows, "columns": place.columns},
        **place.always,
    }
    photograph = {"source": {"kind": "image", "file": "leaves.png", "model": "mallett"}}
    chart_file = place.write(extended, "painted.yaml")
    photograph_file = place.write({**extended, "scene": photograph}, "photograph.yaml")
    chart, picture = (Frames(load(path)) for path in (chart_file, photograph_file))
    for taken in (chart, picture):
        taken.take(repeats=0, warm=True)
    for _ in range(repeats):
        chart.take()
        picture.take()
    ratio = {**chart.cost.ratio(picture.cost), "at_most": PAINTED_OVER_PHOTOGRAPH}
    memory = {
        "chart, peak memory [GB]": {
            "gigabytes": peak_memory(str(chart_file)) / 1e9,
            "at_most": PAINTED_MEMORY,
        },
        "photograph, peak memory [GB]": {"gigabytes": peak_memory(str(photograph_file)) / 1e9},
    }
    return {"a painted chart beside a photograph": {"chart over photograph": ratio, **memory}}


def layers(place: Studio, repeats: int, kinds: Sequence[str] = ()) -> dict[str, Section]:
    """Eight layers over the same seen flat, and over the last of them alone; frames take turns."""
    same: Section = {}
    alone: Section = {}
    for kind, accuracy in product(kinds or LAYERED, ("standard", "0.2 %")):
        cameras = place.layered(kind, accuracy)
        one, deep = (Frames(camera).take(0, warm=True) for camera in cameras)
        flat = Frames(ablation.with_effects(deep.camera, "auto", "depth")).take(0, warm=True)
        for _ in range(repeats):
            for taken in (one, flat, deep):
                taken.take()
        name = f"{kind}, {accuracy}"
        same[name] = {**deep.cost.ratio(flat.cost), "at_most": LAYERS_OVER_FLAT}
        alone[name] = {**deep.cost.ratio(one.cost), "at_most": LAYERS_OVER_FLAT}
    return {
        "eight layers over the same without depth": same,
        "eight layers over the last of them alone": alone,
    }


def traced_lens(place: Studio, repeats: int, scenes: Sequence[str] = ()) -> dict[str, Section]:
    """The shipped double Gauss over one wavefront with its distortion; frames take turns."""
    found: Section = {}
    street = shipped.find("scenes", "street").with_suffix(".png")
    for name in scenes or LENS_SCENES:
        source = LENS_SCENES[name].replace("%s", str(street))
        traced, plain_lens = (Frames(camera) for camera in place.lenses(source))
        for taken in (traced, plain_lens):
            taken.take(0, warm=True)
        for _ in range(repeats):
            for taken in (traced, plain_lens):
                taken.take()
        ratio = traced.cost.ratio(plain_lens.cost)
        found[name] = {**ratio, "at_most": LENS_OVER_WAVEFRONT}
    return {"the double Gauss over one wavefront with its distortion": found}


def against_plain(
    place: Studio, repeats: int, scenes: Sequence[str] = ("gray", "color"), count: int = 31
) -> dict[str, Section]:
    """The plain pipeline over vcam's frame, its render left out; and how far the two are apart.

    The last: rms of the difference of their mean rates over the largest rate. Most of it are the
    fine details that a picture sampled once a pixel does not have. No warming up for the plain one:
    it has nothing to warm.
    """
    rows: Section = {}
    apart = math.nan
    for scene in scenes:
        camera = place.camera(scene, processing=[])
        given, ours = plain.setup(camera, count)
        theirs = median_cost(lambda given=given: plain.frame(given), repeats, warm=False)
        rows[scene] = theirs.ratio(frames(camera, repeats).cost)
        apart = rms(plain.rate(given) - ours) / float(ours.max())
    rows["mean signals differ by, rms"] = {"share": apart}
    return {f"plain NumPy, {count} wavelengths, over the frame": rows}


def per_effect(
    place: Studio, repeats: int, names: Sequence[str] = (), base: dict[str, Any] = BUSY
) -> dict[str, Section]:
    """The frame with everything on over the same without one effect, at a fixed exposure time.

    names: some of the effects, by default all.
    """
    free = place.camera("gray", base)
    camera = ablation.with_exposure_time(free, simulate(free).exposure_time)
    chosen = names or ablation.wanted_effects(camera)
    camera = ablation.with_effects(camera, "all")
    whole = Frames(camera).take(0, warm=True)
    others = {}
    for name in chosen:
        try:
            others[name] = Frames(without_effect(camera, name)).take(0, warm=True)
        except CannotDo as refused:  # aberrations without diffraction have no end in frequency
            print(f"without {name}: {refused}", file=sys.stderr)
    for _ in range(repeats):
        whole.take()
        for other in others.values():
            other.take()
    rows = {name: whole.cost.ratio(other.cost) for name, other in others.items()}
    return {"frame over the same without": rows}


def growth(
    sizes: Sequence[tuple[int, int]], repeats: int, always: dict[str, Any]
) -> dict[str, Section]:
    """How time grows with pixels: time ~ pixels ** exponent. 1 is proportional.

    The exponent of a line through all sizes, the time a pixel takes at each size over that at the
    largest, and the exponents between neighbors. Sizes take turns, small ones more than one at a
    time. All pictures are the middle of the largest: the more detail, the further up spectra are
    followed.
    """
    pixels = np.array([float(rows * columns) for rows, columns in sizes])
    with ExitStack() as studios:
        taken = []
        for rows, columns in sizes:
            place = studios.enter_context(studio(rows, columns, always, of=sizes[-1]))
            taken.append(Frames(place.camera("gray")).take(0, warm=True))
        for _ in range(repeats):
            for one, count in zip(taken, pixels, strict=True):
                one.take(frames_a_turn(count))
    return {"growth with pixels": growth_rows(pixels, [one.cost for one in taken])}


def growth_rows(pixels: np.ndarray, costs: Sequence[Cost]) -> Section:
    """The rows of `growth`, from rising numbers of pixels and what frames of so many cost."""
    seconds = {clock: np.array([getattr(c, clock) for c in costs]) for clock in ("wall", "cpu")}

    def row(figure: Callable[[np.ndarray], float]) -> Row:
        return {clock: float(figure(values)) for clock, values in seconds.items()}

    logs, mega = np.log(pixels), pixels / 1e6
    rows = {"exponent": row(lambda s: np.polyfit(logs, np.log(s), 1)[0])}
    for i, size in enumerate(mega[:-1]):
        name = f"a pixel at {size:.3g} MP over {mega[-1]:.3g} MP"
        rows[name] = row(lambda s, i=i: s[i] / s[-1] * pixels[-1] / pixels[i])
    for i, (low, high) in enumerate(pairwise(mega)):
        name = f"exponent from {low:.3g} to {high:.3g} MP"
        rows[name] = row(lambda s, i=i: np.log(s[i + 1] / s[i]) / (logs[i + 1] - logs[i]))
    return rows


def wavelengths(place: Studio, repeats: int) -> dict[str, Section]:
    """Frames of 301 wavelengths over those of 31, and the exponent that follows from it."""
    few, many = (
        Frames(place.camera("gray", accuracy={"wavelength_step": step})).take(0, warm=True)
        for step in ("10 nm", "1 nm")
    )
    for _ in range(repeats):
        few.take()
        many.take()
    ratio = many.cost.ratio(few.cost)
    exponent = {clock: math.log(r) / math.log(301 / 31) for clock, r in ratio.items()}
    return {"wavelengths": {"301 over 31": ratio, "exponent": exponent}}


def sweeps(
    place: Studio, repeats: int, points: int = 20, varied: Sequence[str] = ()
) -> dict[str, Section]:
    """A sweep of so many points over one frame with its metric; 1 / points of it is one point's.

    Processes are started, and tables and plots written, on the sweep's account. Wall clock only:
    the work is in other processes.
    """
    quality = {"quality": ["psnr"], "exposure": {"time": "20 ms"}}
    tree = place.tree("gray", PLAIN, **quality)
    path = place.write(tree, "swept.yaml")
    camera = load(path)
    single = median_cost(lambda: simulate(camera, shared=Shared()).metrics, repeats)
    rows = {}
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
        rows[f"{name}, {points} points"] = {"wall": seconds / single.wall}
    return {"sweep over one frame": rows}


def _swept(study: Path, out: Path, points: int) -> float:
    """Seconds of a sweep from nothing. Raises RuntimeError where a point of it fails."""
    done = sweep(study, out=out)
    if done.failed or done.computed != points:
        raise RuntimeError(f"{done.failed} points of the sweep failed, {done.computed} computed")
    return done.seconds


def schedules(unit: Cost, repeats: int, levels: int = 65_536) -> dict[str, Section]:
    """Best schedules of 1 to 20 captures of a scene of so many levels, over R_compute."""
    rng = np.random.default_rng(0)
    values = np.sort(np.exp(rng.uniform(0, np.log(1e6), levels)))
    scene = Pdf.levels(values, rng.random(levels) + 1e-3)
    cost = median_cost(lambda: optimal_schedules(scene, CAPTURES), repeats)
    row = {f"{levels} levels, 1 to {CAPTURES[-1]} captures": cost.ratio(unit)}
    return {"schedules over R_compute at 12 megapixels": row}


def command(repeats: int, rows: int = 432, columns: int = 600) -> dict[str, Section]:
    """`vcam run` of a small frame from start to end beside the bare imports of its libraries [s].

    Seconds, not ratios: what a user waits for. All as it is installed: compiled once, which the
    first start does, which is not counted.
    """
    size = [f"--set=array.rows={rows}", f"--set=array.columns={columns}"]
    with tempfile.TemporaryDirectory() as folder:
        run = ["-m", "vcam_cli.commands.main", "run", "starter", "-q", "-o", f"{folder}/out", *size]
        imports = ["-c", f"import {', '.join(IMPORTS)}"]
        whole, bare = take_turns(
            repeats, lambda: start_cost(run, folder), lambda: start_cost(imports, folder)
        )
    beyond = {"wall": whole.wall - bare.wall, "cpu": whole.cpu - bare.cpu, "at_most": START_UP}
    return {
        f"whole command, {rows} x {columns} pixels": {
            "vcam run [s]": {"wall": whole.wall, "cpu": whole.cpu},
            "bare imports [s]": {"wall": bare.wall, "cpu": bare.cpu},
            "vcam run beyond the bare imports [s]": beyond,
        }
    }
