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
import time

import numpy as np
import scipy.fft

from vcam_cli import load, simulate
from vcam_cli.engine.parallel import available_workers

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


def camera(rows: int = ROWS, columns: int = COLUMNS, *sets: str):
    return load("12mp-bayer", sets=[f"array.rows={rows}", f"array.columns={columns}", *sets])


def frame(rows: int, columns: int, repeats: int, *sets: str) -> tuple[float, dict[str, float]]:
    """Median seconds of a whole simulation without quality metrics and files; its stages."""
    model = camera(rows, columns, "quality=[]", *sets)
    stages: list[dict[str, float]] = []

    def work() -> None:
        result = simulate(model)
        result.render  # noqa: B018
        stages.append(result.stages.seconds)

    seconds = timed(work, repeats)
    return seconds, {k: statistics.median(s[k] for s in stages) for k in stages[-1]}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="one repeat, fewer sizes")
    options = parser.parse_args()
    repeats = 1 if options.quick else 5
    unit = yardstick(ROWS, COLUMNS, repeats)
    whole, stages = frame(ROWS, COLUMNS, repeats)
    figures = {"12 MP, noise on, to render": whole / unit}
    figures |= {f"  of it: {name}": seconds / unit for name, seconds in stages.items()}
    few, _ = frame(ROWS, COLUMNS, repeats, "accuracy.wavelength_step=10 nm")
    many, _ = frame(ROWS, COLUMNS, repeats, "accuracy.wavelength_step=1 nm")
    figures["1 nm steps over 10 nm steps"] = many / few
    per_pixel = {}
    for rows, columns in ((500, 500), (1500, 2000), (ROWS, COLUMNS)):
        seconds, _ = frame(rows, columns, repeats)
        per_pixel[rows * columns] = seconds / (rows * columns)
    smallest, largest = min(per_pixel), max(per_pixel)
    figures["time per pixel, 12 MP over 0.25 MP"] = per_pixel[largest] / per_pixel[smallest]
    print(f"R_compute = 1 ({unit:.3g} s here, {available_workers()} processors)")
    for name, ratio in figures.items():
        print(f"{name:<40} {ratio:6.2f}")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump({"r_compute_seconds": unit, "ratios": figures}, file, indent=1)


if __name__ == "__main__":
    main()
