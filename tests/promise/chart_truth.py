"""Charts of sharp outlines and chirps: what a camera sees of them, each without sampling its cells.

Every truth is a Fourier series on a period that is larger than the chart's part that counts. It is
doubled until the pixels stay, and what the last doubling changed is kept: a truth tells how good it
is. Chart definitions are those of the user's guide; letters, leaves and the places of patches come
from the scenes themselves, since they are data. Monochromatic light.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import edge_truth
import leaves_truth
import numpy as np
from fourier import Series, cutoff, mean_electrons, picture, working_f_number
from outlines import arcs, circle, merge, rectangles, series, sides
from reference import Setup
from reference_collect import Squares
from reference_scenes import color_chart
from scipy.special import erfc

from vcam_cli.camera.camera import Camera
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.eye_chart import INK, PAPER, eye_chart
from vcam_cli.scenes.charts.hdr_patches import hdr_patches

GOAL = 5e-6
"""Of full signal: what may be left, a fortieth of the finest tolerance."""
MOST_HARMONICS = 800
"""Below the cut-off along an axis: bounds time and memory."""


@dataclass(frozen=True)
class Truth:
    """Mean electrons of every pixel, and how good they are."""

    mean: np.ndarray
    error: float
    """Largest that is left of it, over the largest signal; 0: rounding."""


def truth(camera: Camera, setup: Setup) -> Truth:
    """What the camera's chart makes of its pixels."""
    source = camera.scene.source
    match source.chart:
        case "step-wedge":
            return Truth(edge_truth.step_wedge(setup, source.steps, source.density_range), 0.0)
        case "slanted-edge":
            return Truth(edge_truth.slanted_edge(setup, source.angle, source.contrast), 0.0)
        case "dead-leaves":
            return Truth(mean_electrons(setup, leaves_truth.dead_leaves(setup, source.seed)), 0.0)
    picture = PICTURES[source.chart]
    return converge(lambda extent: mean_electrons(setup, picture(camera, setup, extent)), setup)


def image_truth(setup: Setup, samples: np.ndarray) -> Truth:
    """A gray image (h, w) that just covers the array: squares of light, mirrored at its borders."""
    rows, columns = samples.shape
    squares = Squares(samples[None], setup.size[0] / columns, setup.size[1] / rows)
    return Truth(mean_electrons(setup, *picture(setup, squares)), 0.0)


def converge(mean: Callable[[float], np.ndarray], setup: Setup) -> Truth:
    """The truth for an extent, the period over the array's diagonal, doubled until it converges.

    The copies of a picture that repeats are seen across the margin by what the lens spreads so
    far, which falls as the distance's third power: of what a doubling changes, a seventh is left.
    """
    extent, last = 1.25, mean(1.25)
    while True:
        extent *= 2
        here = mean(extent)
        left = float(abs(here - last).max() / here.max()) / 7
        if left <= GOAL or 2 * extent * diagonal(setup) * cutoff(setup) > MOST_HARMONICS:
            return Truth(here, left)
        last = here


def diagonal(setup: Setup) -> float:
    """Of the array, and at least some spreads of the lens [m]."""
    ring = float(setup.wavelength.max()) * working_f_number(setup)
    return math.hypot(*setup.size) + 4 * ring


# --- charts --------------------------------------------------------------------------------------


def siemens_star(camera: Camera, setup: Setup, extent: float) -> Series:
    """Bright spokes within a circle of which the rest is dark, around it the mean of both.

    What lies beyond the circle is seen as its mean: at a distance r from the center, the part of
    (r / R)^spokes is missing of what the lens spreads as far as the circle.
    """
    source, finest = camera.scene.source, cutoff(setup)
    radius = min(0.5 + 3 * extent / source.spokes, 0.4 * extent) * diagonal(setup)
    middle = 2 * math.pi * np.arange(source.spokes) / source.spokes
    half = math.pi / (2 * source.spokes)
    first, last = middle - half, middle + half
    rim = radius * np.stack([np.cos([first, last]), np.sin([first, last])], axis=-1)
    center, contrast = np.zeros_like(rim[0]), np.full(source.spokes, source.contrast)
    parts = [
        circle(0.0, 0.0, radius, -source.contrast / 2, finest),
        arcs(center, np.full(len(middle), radius), first, last, contrast, finest),
        sides(center, rim[0], -contrast, finest),
        sides(center, rim[1], contrast, finest),
    ]
    return series(merge(parts, 0.5), extent * diagonal(setup), finest)


def letters(camera: Camera, setup: Setup, extent: float) -> Series:
    """The eye chart's letters on its paper."""
    found = eye_chart(camera.scene.source.rows, Frame(*setup.size)).letters
    start, stop = np.stack([found.x0, found.y0], 1), np.stack([found.x1, found.y1], 1)
    ink = sides(start, stop, np.full(len(start), INK - PAPER), cutoff(setup))
    return series(merge([ink], PAPER), extent * diagonal(setup), cutoff(setup))


def colorchecker(camera: Camera, setup: Setup, extent: float) -> Series:
    """Surround, card and patches, each with what it adds to the one below."""
    parts, reflectance = color_chart(camera)
    light = reflectance(setup.wavelength[:1])[:, 0]
    edges = np.array([[p.left, p.right, p.top, p.bottom] for p in parts[1:]])
    picture = rectangles(edges, light[1:], cutoff(setup))
    return series(merge([picture], light[0]), extent * diagonal(setup), cutoff(setup))


def patches(camera: Camera, setup: Setup, extent: float) -> Series:
    """Squares and a lamp on black cloth."""
    source = camera.scene.source
    chart = hdr_patches(source.patches, source.dynamic_range, source.lamp, Frame(*setup.size))
    row, place = np.nonzero(chart.levels)
    left, top = chart.left[place], chart.top[row]
    edges = np.stack([left, left + chart.side, top, top + chart.side], axis=1)
    light = chart.levels[row, place] - chart.cloth
    parts = [
        rectangles(edges, light, cutoff(setup)),
        circle(0.0, chart.lamp_y, chart.radius, chart.lamp - chart.cloth, cutoff(setup)),
    ]
    return series(merge(parts, chart.cloth), extent * diagonal(setup), cutoff(setup))


def csf(camera: Camera, setup: Setup, extent: float) -> Series:
    """Mean (1 + c(y) cos(pi F s^2 / W + phase)), s from the left edge, c from 0 up to the top.

    The chirp fades where the lens passes none of it, or far beyond the array: both times slowly,
    so that nothing of it is left but waves that stay where they are. c is kept as it is above.
    """
    source, (wide, high), finest = camera.scene.source, setup.size, cutoff(setup)
    beyond = 0.2 * extent * diagonal(setup)
    rate = source.max_frequency / wide
    unresolved = (1.2 * finest + 3 * math.sqrt(rate)) / rate  # from there on nothing passes
    end = min(wide + 2 * beyond, 2 * unresolved)
    whole = 2 * max(end - wide / 2, end + wide / 2, high / 2 + 2 * beyond) * 1.1
    most = math.floor(whole * finest)
    fx, fy = np.arange(most + 1) / whole, np.arange(-most, most + 1) / whole
    step = 1 / (3 * (rate * end + 2 * finest))
    s = np.arange(-math.ceil(end / step), math.ceil(end / step) + 1) * step
    chirp = step * np.cos(math.pi * rate * s**2 + source.phase)
    chirp *= _fade(abs(s), wide + beyond, wide + 2 * beyond) * _fade(
        abs(s), unresolved, 2 * unresolved
    )
    across = np.exp(-2j * math.pi * np.outer(s - wide / 2, fx)).T @ chirp
    y, weight = _panels(np.array([-high / 2 - 2 * beyond, -high / 2, high / 2]), 4 * finest)
    contrast = source.max_contrast * np.clip(0.5 - y / high, 0, 1) * weight
    contrast *= _fade(-y, high / 2 + beyond, high / 2 + 2 * beyond)
    down = np.exp(-2j * math.pi * np.outer(fy, y)) @ contrast
    found = np.outer(down, across) * np.where(fx > 0, 2.0, 1.0) * (source.mean / whole**2)
    found[most, 0] += source.mean
    return Series(fx, fy, found)


PICTURES: dict[str, Callable[[Any, Setup, float], Series]] = {
    "siemens-star": siemens_star,
    "eye-chart": letters,
    "colorchecker": colorchecker,
    "hdr-patches": patches,
    "csf": csf,
}


def _fade(at: np.ndarray, start: float, stop: float) -> np.ndarray:
    """1 up to start, 0 from stop on."""
    return erfc(7 * ((at - start) / (stop - start) - 0.5)) / 2


def _panels(edges: np.ndarray, per_meter: float) -> tuple[np.ndarray, np.ndarray]:
    """Gauss's points and weights between edges, panels of at most 1 / per_meter."""
    ends = [
        np.linspace(low, high, math.ceil((high - low) * per_meter) + 1)
        for low, high in pairwise(edges)
    ]
    node, weight = np.polynomial.legendre.leggauss(8)
    low, high = (np.concatenate([e[part] for e in ends]) for part in (slice(-1), slice(1, None)))
    half = (high - low)[:, None] / 2
    return (low[:, None] + half * (node + 1)).ravel(), (half * weight).ravel()
