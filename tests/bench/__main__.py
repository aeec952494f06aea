"""Speed, as ratios that mean the same on every machine.

    python -m tests.bench [--json FILE] [--quick]

The yardstick is R_compute: what no camera simulator can do without. For a 12-megapixel Bayer
frame: one real FFT of the scene, one back for each of three colors, and one standard normal per
pixel for each of five noise sources. Figures are medians of repeated runs in one process.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import scipy.fft

from vcam_cli import load, simulate
from vcam_cli.engine.parallel import available_workers
from vcam_cli.files.png import write_png
from vcam_cli.scenes.base import View
from vcam_cli.scenes.build import build

ROWS, COLUMNS = 3000, 4000
SOURCES = 5


def timed(work, repeats: int) -> float:
    """Median seconds of `work`, after one run to warm up."""
    work()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def yardstick(rows: int, columns: int, repeats: int) -> float:
    """R_compute [s]: transforms on all processors, draws from one generator."""
    workers = available_workers()
    scene = np.random.default_rng(0).random((rows, columns), dtype=np.float32)
    spectrum = scipy.fft.rfft2(scene, workers=workers)
    generator = np.random.Generator(np.random.Philox(0))

    def work() -> None:
        scipy.fft.rfft2(scene, workers=workers)
        for _ in range(3):
            scipy.fft.irfft2(spectrum, s=scene.shape, workers=workers)
        for _ in range(SOURCES):
            generator.standard_normal((rows, columns), dtype=np.float32)

    return timed(work, repeats)


@contextmanager
def picture(rows: int, columns: int) -> Iterator[Path]:
    """A picture file of dead leaves of that size, with three channels."""
    with tempfile.TemporaryDirectory() as folder:
        view = View(rows, columns, 1e-6, 1e-6, dtype=np.float32)
        scene = build(load("still-life").scene, view, None)
        mix = np.random.default_rng(0).dirichlet(np.ones(len(scene.spectra)), 3)
        path = Path(folder) / "leaves.png"
        planes = np.clip(scene.planes(mix) * 4 * 65535, 0, 65535).astype(np.uint16)
        write_png(path, np.ascontiguousarray(np.moveaxis(planes, 0, 2)))
        write_png(path.with_name("gray.png"), np.ascontiguousarray(planes[1]))
        yield path


def camera(scene: str, file: Path, rows: int, columns: int, *sets: str):
    """The 12-megapixel camera looking at a picture (gray or laser) or at a chart."""
    sources = {
        "gray": f"{{kind: image, file: {file.with_name('gray.png')}, model: reflectance}}",
        "laser": f"{{kind: image, file: {file}, model: laser}}",
    }
    size = [f"array.rows={rows}", f"array.columns={columns}", "quality=[]"]
    text = Path(file.with_name("camera.yaml"))
    if scene in sources:
        text.write_text(
            "name: bench\n"
            f"scene: {{source: {sources[scene]}, luminance: 200 cd/m2}}\n"
            "optics: {use: f2.8-normal, focal_length: 8 mm}\n"
            "pixel: {use: aps-4um, width: 2 um}\n"
            "array: 12mp-bayer\n"
            "exposure: {auto: {max: 100 ms}}\n"
            "adc: {bits: 10, offset: 16 DN}\n"
            "effects: all\n"
        )
        return load(text, sets=[*size, *sets])
    return load("12mp-bayer", sets=[*size, *sets])


def frame(model, repeats: int) -> tuple[float, dict[str, float]]:
    """Median seconds of a simulation up to the render, reading and writing aside; its stages."""
    stages: list[dict[str, float]] = []

    def work() -> None:
        result = simulate(model)
        result.render  # noqa: B018
        stages.append({k: v for k, v in result.stages.seconds.items() if k != "read"})

    timed(work, repeats)
    middle = {k: statistics.median(s[k] for s in stages[1:]) for k in stages[-1]}
    return sum(middle.values()), middle


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="one repeat, fewer sizes")
    options = parser.parse_args()
    repeats = 1 if options.quick else 5
    unit = yardstick(ROWS, COLUMNS, repeats)
    figures: dict[str, float] = {}
    with picture(ROWS, COLUMNS) as file:
        whole, stages = frame(camera("gray", file, ROWS, COLUMNS), repeats)
        figures["12 MP Bayer, noise on, gray picture"] = whole / unit
        figures |= {f"  of it: {name}": seconds / unit for name, seconds in stages.items()}
        for scene in ("laser", "chart"):
            seconds, _ = frame(camera(scene, file, ROWS, COLUMNS), repeats)
            figures[f"the same, {scene}"] = seconds / unit
        step = "accuracy.wavelength_step="
        few, _ = frame(camera("gray", file, ROWS, COLUMNS, step + "10 nm"), repeats)
        many, _ = frame(camera("gray", file, ROWS, COLUMNS, step + "1 nm"), repeats)
        figures["401 wavelengths over 41"] = many / few
    with picture(ROWS // 6, COLUMNS // 6) as file:
        small, _ = frame(camera("gray", file, ROWS // 6, COLUMNS // 6), repeats)
        figures["time per pixel, 12 MP over 0.33 MP"] = whole / small / 36
    print(f"R_compute = 1 ({unit:.3g} s here, {available_workers()} processors)")
    for name, ratio in figures.items():
        print(f"{name:<40} {ratio:6.2f}")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump({"r_compute_seconds": unit, "ratios": figures}, file, indent=1)


if __name__ == "__main__":
    main()
