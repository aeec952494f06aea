"""What is cheap when repeated: loops, sweeps of small frames, commands that form no frame.

Each figure stands beside what it is compared with, and beside the same before these costs were
looked at (October 2026, the same ratios on two busy processors).
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import yaml

from vcam_cli import load, simulate, sweep
from vcam_cli.camera.camera import Camera
from vcam_cli.datasets import dataset_file
from vcam_cli.datasets.dataset import dataset
from vcam_cli.files.images.png import write_png
from vcam_cli.files.spectral.exr import write_spectral
from vcam_cli.progress import Silent
from vcam_cli.simulation.shared import RECENT, Shared
from vcam_cli.sweeps import sweep_file, sweep_points
from vcam_cli.sweeps.execution import Execution

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
SHIPPED = "eev-44-82", "12mp-bayer", "cfa-bayer", "csf-color-0.35um", "double-gauss", "fisheye"
"""Cameras of transport, comparisons, leaves, colorimetry and lenses that distort."""
IMPORTS = "numpy", "pydantic", "typer"
BANDS = np.linspace(400e-9, 700e-9, 31)
COMMANDS = {
    "vcam list": (("list",), 3.4),
    "vcam explain optics.f_number": (("explain", "optics.f_number"), 6.4),
    "vcam validate starter": (("validate", "starter"), 5.0),
}
"""Command -> its arguments, and its processor time over bare imports before."""


def repeated(
    repeats: int, count: int = 12, points: int = 200, frames: int = 400
) -> dict[str, dict[str, Row]]:
    """Small frames of data sets, loops over single frames, a sweep over its loop, commands."""
    return {
        f"a data set of {frames} frames, four a scene, over NumPy's noise of as many": {
            f"{size} x {size} pixels": _small_frames(repeats, size, max(4, number))
            | {"before": before}
            for size, number, before in ((64, frames, 100.0), (512, frames // 16, 5.2))
        },
        f"loops of {count}, over as many frames alone": _loops(repeats, count),
        f"a sweep of {points} frames of 32 x 32 pixels, over a loop": _small_sweep(repeats, points),
        f"commands over the imports of {', '.join(IMPORTS)}": _commands(repeats),
        "forecast of memory over the peak of `vcam run`": _forecasts(),
        "memory of a Dask scheduler, at the end over after a tenth of the points": {
            f"a sweep of {10 * points} points": {"ratio": scheduler_growth(10 * points)}
        },
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

        def made() -> Cost:
            shared = Shared()

            def work() -> None:
                for n in range(points):
                    each = camera.with_({noise: f"{1 + n / points} e"})
                    simulate(each, 1, shared=shared).metrics["snr_db"]

            return run_cost(work)

        one, other, making = take_turns(repeats, swept, looped, made)

        point = _traced(lambda: sweep_points.grid(sweep_file.read(study)).points) / points
    alone = _traced(lambda: [load("starter", SMALL) for _ in range(10)]) / 10
    return {
        "points": one.ratio(other) | {"before": 2.0},
        "points, over a loop that makes its cameras": one.ratio(making),
        "memory of a point, over a camera": {"ratio": point / alone, "before": 1.0},
    }


def _traced(make: Callable[[], object]) -> int:
    """Memory of what is made and kept, after it was made once before [bytes]."""
    make()
    tracemalloc.start()
    made = make()
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del made
    return size


def _small_frames(repeats: int, size: int, frames: int) -> Row:
    """Noisy and clean frames of photographs, written and packed, over the noise of a mean."""
    random = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(4):
            coarse = random.integers(0, 256, (40, 40, 3), np.uint8)
            write_png(folder / f"{number}.png", coarse.repeat(20, axis=0).repeat(20, axis=1))
        study = folder / "study.yaml"
        study.write_text(
            "kind: dataset\nname: small\ncamera: starter\n"
            "scenes: {files: '*.png', frames_each: 4}\n"
            "vary: {exposure.time: {log_uniform: [1 ms, 20 ms]}, exposure.gain: {choice: [1, 4]}}\n"
            f"frames: {frames}\nsize: {{rows: {size}, columns: {size}}}\n"
        )

        def made() -> Cost:
            file = dataset_file.read(study)
            return run_cost(lambda: dataset(file, folder / "out", Execution(workers=1, fresh=True)))

        mean = random.uniform(100, 2000, (size, size))

        def noise() -> None:
            for _ in range(frames):
                charge = random.poisson(mean) + 5 * random.standard_normal(mean.shape, np.float32)
                charge += 2 * random.standard_normal(mean.shape, np.float32)
                np.clip(np.rint(charge / 20 + 64), 0, 1023).astype(np.uint16)

        one, other = take_turns(repeats, made, lambda: run_cost(noise))
    return one.ratio(other)


def _forecasts() -> dict[str, Row]:
    random = np.random.default_rng(2)
    with tempfile.TemporaryDirectory() as name:
        folder, rows, columns = Path(name), 2000, 3000
        write_png(folder / "photo.png", random.integers(0, 256, (rows, columns, 3), np.uint8))
        cube = random.random((800, 1000, 31), np.float32)
        planes = np.moveaxis(cube, 2, 0)
        write_spectral(folder / "cube.exr", BANDS, planes, cube.shape[:2], "W.m^-2.sr^-1")
        sources = {
            "a photograph of 6 megapixels": f"{{kind: image, file: {folder}/photo.png}}",
            "a cube of 31 bands, EXR": f"{{kind: hyperspectral, file: {folder}/cube.exr}}",
        }
        size = f"array.rows={rows}", f"array.columns={columns}", "quality=[]"
        wavelengths = "scene.wavelengths={start: 400 nm, stop: 700 nm}"
        charts = "siemens-star", "dead-leaves", "colorchecker", "slanted-edge", "eye-chart"
        sources |= {f"the chart {chart}": f"{{chart: {chart}}}" for chart in charts}
        out = folder / "out"
        found = {"layers of `table-top`": {"ratio": forecast_ratio("table-top", size, out)}}
        for name in SHIPPED:
            found[f"`{name}`"] = {"ratio": forecast_ratio(name, (), out)}
        for what, source in sources.items():
            camera, sets = "starter", (*size, f"scene.source={source}")
            if "cube" in what:  # it has light of its own
                camera = str(_without_lamp(folder / "camera.yaml"))
                sets = (*sets, wavelengths, "scene.luminance=100 cd/m2")
            found[what] = {"ratio": forecast_ratio(camera, sets, out)}
    return found


def _without_lamp(file: Path) -> Path:
    command = [sys.executable, "-m", "vcam_cli.commands.main", "list", "cameras", "starter"]
    tree = yaml.safe_load(subprocess.run(command, check=True, capture_output=True).stdout)
    del tree["scene"]["illuminant"]
    file.write_text(yaml.safe_dump(tree))
    return file


def forecast_ratio(camera: str, sets: Sequence[str], out: Path) -> float:
    """Forecast of memory over the peak of a process that runs a camera."""
    options = [word for each in sets for word in ("--set", each)]
    command = [sys.executable, "-m", "vcam_cli.commands.main", "run", camera, "-o", str(out)]
    subprocess.run([*command, "-q", *options], check=True, stdout=subprocess.DEVNULL)
    record = json.loads((out / "run.json").read_text())
    return record["plan"]["memory_bytes"] / record["peak_memory_bytes"]


def scheduler_growth(points: int) -> float:
    """Memory of a Dask scheduler at the end of a sweep over that after a tenth of its points.

    1 without Dask, and where processes do not show their memory.
    """
    if find_spec("distributed") is None or not Path("/proc/self/statm").exists():
        return 1.0
    module = [sys.executable, "-m", "distributed.cli.dask_"]
    with tempfile.TemporaryDirectory() as name, socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        folder, address = Path(name), f"tcp://127.0.0.1:{port}"
        here = ("--no-dashboard", "--host", "127.0.0.1")
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": name}
        start = [*module[:2], f"{module[2]}scheduler", *here, "--port", str(port)]
        scheduler = subprocess.Popen(start, **quiet)
        start = [*module[:2], f"{module[2]}worker", address, "--no-nanny", "--nthreads", "1"]
        worker = subprocess.Popen([*start, "--no-dashboard"], **quiet)
        held: list[int] = []

        class Watch(Silent):
            def step(self, done: float, total: float) -> None:
                if not held and done * 10 >= total:
                    held.append(_resident(scheduler.pid))

        study = folder / "study.yaml"
        values = f"{{start: 1 e, stop: 2 e, count: {points}}}"
        study.write_text(
            "kind: sweep\nname: small\ncamera: starter\nmetrics: [snr_db]\n"
            f"vary:\n  pixel.readout.read_noise: {values}\n"
        )
        try:
            time.sleep(5)  # the scheduler starts
            sweep(study, folder / "out", SMALL[:2], scheduler=address, watch=Watch())
            return _resident(scheduler.pid) / held[0]
        finally:
            for process in (worker, scheduler):
                process.kill()
                process.wait()


def _resident(process: int) -> int:
    """Resident memory of a process [pages]."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1])


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
