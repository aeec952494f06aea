"""Cameras that look at charts with sharp or ever finer content, and at images finer than a pixel.

The plain camera of tests/making.py under 550 nm, on arrays small enough for an exact truth.

    camera = CAMERAS["siemens-star-3"]
    model = camera.load(folder, "standard")              # the validated camera file
    truth = camera.truth(model)                          # (rows, columns) [electrons]
    periodic_cameras.error_of_mean(model, truth)         # rms over full signal, of the engine
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import chart_truth
import making
import numpy as np
from periodic_cameras import PATTERNS, TOLERANCES, radiance_for, setup
from reference_cameras import leaves, lines, write_picture

from vcam_cli.camera.camera import Camera

SIZES = ((3, 4), (1, 1), (8, 8), (12, 16), (5, 7), (20, 24), (2, 3), (13, 11), (16, 12))
CHARTS: dict[str, tuple[dict[str, Any], ...]] = {
    "siemens-star": (
        {"spokes": 36}, {"spokes": 8, "contrast": 0.7}, {"spokes": 72}, {"spokes": 200},
        {"spokes": 3}, {"spokes": 1000}, {"spokes": 17}, {"spokes": 400},
    ),
    "step-wedge": (
        {"steps": 20}, {"steps": 2}, {"steps": 48, "density_range": 1}, {"steps": 1000},
        {"steps": 32, "density_range": 0.3}, {"steps": 101, "density_range": 4}, {"steps": 24},
        {"steps": 7, "density_range": 3},
    ),
    "csf": (
        {"max_frequency": "120 lp/mm"}, {"max_frequency": "400 lp/mm", "phase": "90 deg"},
        {"max_frequency": "250 lp/mm"}, {"max_frequency": "30 lp/mm", "max_contrast": 0.5},
        {"max_frequency": "2000 lp/mm"}, {"max_frequency": "500 lp/mm", "phase": "40 deg"},
    ),
    "slanted-edge": (
        {}, {"angle": "0 deg", "contrast": 1.0}, {"angle": "45 deg"}, {"angle": "-3 deg"},
        {"angle": "90 deg"}, {"angle": "2 deg", "contrast": 0.9}, {"angle": "170 deg"},
    ),
    "eye-chart": ({}, {"rows": 1}, {"rows": 20}, {"rows": 4}, {"rows": 12}),
    "colorchecker": ({},) * 7,
    "hdr-patches": (
        {}, {"patches": 2, "dynamic_range": 10}, {"patches": 100, "lamp": 2.0},
        {"dynamic_range": 1e6, "lamp": 1000}, {"patches": 400, "dynamic_range": 100}, {},
    ),
    "dead-leaves": ({"seed": 4},) * 3,
    "image": (
        {"checks": 0.5}, {"checks": 1 / 3}, {"checks": 1.0}, {"checks": 0.25}, {"checks": 0.5},
        {"checks": 2.0}, {"checks": None}, {"checks": None}, {"checks": 0.5}, {"checks": 1 / 3},
    ),
}  # fmt: skip
"""What each chart is asked for; of an image the side of its checks over the pitch, None: leaves. A
new chart comes last: its place is part of the seed of its cameras."""


@dataclass(frozen=True)
class ChartCamera:
    """A camera before a chart, or before an image that just covers the array."""

    name: str
    changes: dict[str, Any]
    checks: float | None = None

    @property
    def chart(self) -> str:
        return str(self.changes["scene.source"]["chart"])

    def load(self, folder: Path, accuracy: str) -> Camera:
        """The camera as a user's file gives it, every effect on `auto`."""
        changes = {**self.changes, "effects": "auto", "accuracy": accuracy}
        if self.chart == "image":
            file = str(write_picture(folder, self.samples[:, :, None].astype(np.float32)))
            changes["scene.source"] = {"kind": "image", "file": file, "model": "reflectance"}
        return making.camera(folder, changes)

    def truth(self, camera: Camera) -> np.ndarray:
        """Mean electrons of every pixel before saturation; a tenth of the finest tolerance, at
        most, is left of their error."""
        found = self.exact_mean(camera)
        assert found.error <= min(TOLERANCES.values()) / 10, found.error
        return found.mean

    def exact_mean(self, camera: Camera) -> chart_truth.Truth:
        """The same, and what is left of its error."""
        numbers = setup(camera, lines(550))
        if self.chart == "image":
            return chart_truth.image_truth(numbers, self.samples)
        return chart_truth.truth(camera, numbers)

    @cached_property
    def samples(self) -> np.ndarray:
        """Of the image: checks of 0 and 1, or disks of gray, three samples to two pixels."""
        rows, columns = self.changes["array.rows"], self.changes["array.columns"]
        if self.checks is None:
            found = leaves(math.ceil(1.5 * rows), math.ceil(1.5 * columns), 1, seed=columns)
            return found[:, :, 0].astype(float)
        counts = (max(1, round(count / self.checks)) for count in (rows, columns))
        return (np.indices(tuple(counts)).sum(axis=0) % 2).astype(float)


def random_camera(chart: str, number: int, draw: int | None = None) -> ChartCamera:
    """A camera drawn at random; every number gives another, always the same.

    `draw` begins other draws than those of CAMERAS.
    """
    kind = tuple(CHARTS).index(chart) if draw is None else draw
    rng = np.random.default_rng((29, kind, number))

    def between(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    width, fill = between(1e-6, 10e-6), 1.0 if number % 4 == 3 else between(0.05, 1)
    size = SIZES[(number + kind) % len(SIZES)]
    # the lens's finest waves within the array: what a truth costs
    sharpest = max(0.7, math.hypot(*size) * width / (40 * 550e-9))
    source = dict(CHARTS[chart][number])
    checks = source.pop("checks", None)
    f_number = between(sharpest, max(width * checks / 550e-9 if checks else 32.0, sharpest))
    if chart == "image":  # samples are squares: as many as have the array's sides
        size = 2 * size[0], 2 * size[1]
    changes = {
        "scene.source": {"kind": "chart", "chart": chart, **source},
        "scene.radiance": radiance_for(between(1e3, 5e4), width, f_number, fill),
        "optics.f_number": f_number,
        "pixel.width": f"{width * 1e6:.12g} um",
        "pixel.photodetector.fill_factor": fill,
        "pixel.readout.full_well": "10 Me",
        "pixel.readout.conversion_gain": "0.2 uV/e",
        "array.rows": size[0],
        "array.columns": size[1],
        "array.pattern": PATTERNS[(number + kind) % len(PATTERNS)],
    }
    name = f"{chart}-{number}" if draw is None else f"{chart}-{number}-{draw}"
    return ChartCamera(name, changes, checks)


HARD = ((3, 7), (3, 15), (3, 25), (3, 43), (3, 37), (2, 43), (4, 51), (4, 42), (4, 33))
"""Numbers and draws of arrays of few pixels before hdr-patches: a pixel that sees all of a chart,
or lies beside a lamp. Cells chosen from crops broke the promise on them, by up to 8.8 T."""

CAMERAS = {
    each.name: each
    for chart in CHARTS
    for each in (random_camera(chart, number) for number in range(len(CHARTS[chart])))
} | {each.name: each for each in (random_camera("hdr-patches", *hard) for hard in HARD)}
_QUICK_ENDS = ("1", "7", "51")
QUICK = {
    name
    for name, each in CAMERAS.items()
    if (name.split("-")[-1] in _QUICK_ENDS and each.chart != "dead-leaves")
    or name == "colorchecker-5"
}
"""Names of those that every run of the tests judges."""
