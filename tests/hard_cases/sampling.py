"""Hard cases of scenes and sampling: charts, edges, pitches without common measure, tiny arrays."""

from __future__ import annotations

import itertools
import math

import mpmath as mp
import numpy as np
import scipy.fft

from vcam_cli.image_formation import box_average
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.csf import Csf
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge

from .hard_case import Case, in_digits
from .small_camera import electrons, simulated

ONE = np.ones((1, 1))

# --- contrast sensitivity chart ------------------------------------------------------------------

PITCH, COLUMNS = 2.0**-18, 4096
CHART_WIDTH = PITCH * COLUMNS
EDGES = (np.arange(COLUMNS + 1) - COLUMNS / 2) * PITCH
SHOWN = np.array([0, 1, 1000, 2047, 4000, 4090, 4094, 4095])
TALL = np.array([-CHART_WIDTH / 2, 0.0])  # the upper half, of mean contrast 3/4


def _csf(name: str, hard: str, nyquists: float) -> Case:
    chart = Csf(Frame(CHART_WIDTH, CHART_WIDTH), nyquists / (2 * PITCH), 0.5, 1.0, 0.25)
    rate = mp.mpf(chart.max_frequency) / mp.mpf(CHART_WIDTH)

    def mean(column: mp.mpf) -> mp.mpf:
        root, pitch = mp.sqrt(2 * rate), mp.mpf(PITCH)
        ends = [root * pitch * (column + side) for side in (1, 0)]
        cosine, sine = (f(ends[0]) - f(ends[1]) for f in (mp.fresnelc, mp.fresnels))
        chirp = (mp.cos(mp.mpf(0.25)) * cosine - mp.sin(mp.mpf(0.25)) * sine) / (root * pitch)
        return (1 + chirp * 3 / 4) / 2

    return Case(
        name,
        hard,
        "Fresnel integrals",
        lambda: in_digits(mean, SHOWN),
        lambda: chart.averages(EDGES, TALL, ONE)[0, 0, SHOWN],
        lambda: chart.values((EDGES[:-1] + EDGES[1:]) / 2, np.array([-CHART_WIDTH / 4]), ONE)[
            0, 0, SHOWN
        ],
        "the chirp at the middle of each pixel",
        1e-12,
        "1e-16 of a phase of up to pi F W, 2e5 at most",
        absolute=True,
    )


CHART_AT_NYQUIST = _csf(
    "CSF chart up to the pixels' Nyquist frequency",
    "a period is two pixels, and changes within one: its mean is 2/pi of its peak",
    1.0,
)
CHART_BEYOND = _csf(
    "CSF chart up to 30 times Nyquist",
    "15 periods in a pixel must leave gray; sampled they alias to full contrast",
    30.0,
)

# --- edges ---------------------------------------------------------------------------------------

TURNS = np.array([0.0, 1e-300, 1e-12, 1e-6, 0.1])
CELLS = np.array([-1.5, -0.5, 0.5, 1.25]) - 0.25  # the middle cell's edge lies in a cell


def _covered(angle: mp.mpf) -> list[mp.mpf]:
    """Part of each unit cell right of the edge: second differences of t^2 / 2, 700 digits."""
    with mp.workdps(700):
        if angle == 0:
            angle = mp.mpf(10) ** -310
        across, down = mp.cos(angle), mp.sin(angle)
        out = []
        for left, right in itertools.pairwise(CELLS.tolist()):
            total = mp.mpf(0)
            for x, sx in ((mp.mpf(right), 1), (mp.mpf(left), -1)):
                for y, sy in ((mp.mpf(0.5), 1), (mp.mpf(-0.5), -1)):
                    total += sx * sy * max(across * x + down * y, 0) ** 2 / 2
            out.append(total / (across * down) / (mp.mpf(right) - mp.mpf(left)))
        return out


def _edges() -> list[np.ndarray]:
    rows = np.array([-0.5, 0.5])
    return [SlantedEdge(turn, 1.0).averages(CELLS, rows, ONE) for turn in TURNS.tolist()]


def _edges_by_differences() -> list[np.ndarray]:
    out = []
    for turn in TURNS.tolist():
        across, down = np.cos(turn), np.sin(turn)
        corner = np.maximum(across * CELLS + down * np.array([[-0.5], [0.5]]), 0) ** 2 / 2
        out.append(np.diff(np.diff(corner, axis=0)) / (across * down) / np.diff(CELLS))
    return out


EDGE = Case(
    "area of pixels at an edge of 0 to 1e-6 rad",
    "sin x cos is 0 or next to nothing, and is divided by",
    "the same form, 700 digits",
    lambda: in_digits(_covered, TURNS),
    _edges,
    _edges_by_differences,
    "differences of max(t, 0)^2 / (2 sin cos)",
    1e-15,
    "some five roundings",
    absolute=True,
)

# --- resampling ----------------------------------------------------------------------------------

SAMPLES, PIXELS, TERM = 10007, 7076, 9973  # two of them prime, the term near the last
ROOT = math.sqrt(2)
COARSE = Axis(SAMPLES, 1.0, PIXELS, ROOT, 0.2, False, 0.5)
ASKED = np.arange(0, PIXELS, 347)
_HALF = math.pi * TERM / (2 * SAMPLES)
WAVE = np.cos(math.pi * TERM * (np.arange(SAMPLES) + 0.5) / SAMPLES) * math.sin(_HALF) / _HALF
"""Means over the samples of cos(pi TERM x / SAMPLES)."""


def _wave_at(pixel: mp.mpf) -> mp.mpf:
    x = mp.mpf(COARSE.first) + pixel * mp.mpf(ROOT)
    return mp.cos(mp.pi * TERM * x / SAMPLES)


def _by_cosines() -> np.ndarray:
    coefficients = scipy.fft.dct(WAVE, type=2)
    terms = COARSE.extend(coefficients, COARSE.terms) * COARSE.weights
    return COARSE.evaluate(COARSE.fold(terms)[None], axis=1)[0, ASKED]


RESAMPLED = Case(
    "resampling, pitches 1 to sqrt 2, 10007 samples",
    "no common measure, prime lengths, and a wave at 0.997 of Nyquist",
    "the wave itself",
    lambda: in_digits(_wave_at, ASKED),
    _by_cosines,
    lambda: np.interp(COARSE.first + ASKED * ROOT - 0.5, np.arange(SAMPLES), WAVE),
    "straight lines between the samples",
    1e-9,
    "phases of pi k^2 / n up to 1e4 in the chirp, 1e-12 of a turn, over 1e4 terms",
    absolute=True,
)

PICTURE = np.random.default_rng(5).random(SAMPLES).astype(np.float32)
FINE = Axis(SAMPLES, 1.0, PIXELS, ROOT, 0.5, True, 0.5)
DETECTOR = 1 / 16


def _boxes_exact(pixel: mp.mpf) -> mp.mpf:
    center = mp.mpf(FINE.first) + pixel * mp.mpf(ROOT)
    low, high = center - mp.mpf(DETECTOR) / 2, center + mp.mpf(DETECTOR) / 2
    total = mp.mpf(0)
    for n in range(max(int(mp.floor(low)), 0), min(int(mp.floor(high)) + 1, SAMPLES)):
        total += (min(high, n + 1) - max(low, n)) * mp.mpf(float(PICTURE[n]))
    return total / mp.mpf(DETECTOR)


def _boxes_by_float32_sums() -> np.ndarray:
    sums = np.concatenate([[0], np.cumsum(PICTURE)])
    center = FINE.first + ASKED * ROOT
    low, high = (
        np.interp(center + s * DETECTOR / 2, np.arange(SAMPLES + 1), sums) for s in (-1, 1)
    )
    return (high - low) / DETECTOR


BOXES = Case(
    "means over photodetectors, from running sums",
    "a box of 1/16 sample is the difference of sums over 10007",
    "overlaps one by one",
    lambda: in_digits(_boxes_exact, ASKED),
    lambda: box_average.square_averages(PICTURE[None].astype(float), FINE, DETECTOR, 1)[0, ASKED],
    _boxes_by_float32_sums,
    "running sums in the picture's float32",
    1e-8,
    "sums of 5000 in float64, 1e-12, over a box of 1/16 of a value of 1e-3 at least",
)

# --- whole cameras of a few pixels ---------------------------------------------------------------

SHAPES = ((1, 1), (1, 7), (13, 1), (31, 37), (97, 101))


def _tiny() -> list[object]:
    return [
        simulated(f"array.rows={rows}", f"array.columns={columns}").mean_electrons
        for rows, columns in SHAPES
    ]


def _zero_padded() -> list[object]:
    """The light, blurred by Fourier transforms as if all beyond the array were black."""
    from scipy.signal import fftconvolve

    at = np.arange(-8, 9)
    spot = np.exp(-(at**2 + at[:, None] ** 2) / 2)
    light = [np.full(shape, float(electrons())) for shape in SHAPES]
    return [
        fftconvolve(even, spot / spot.sum(), "same")[: s[0], : s[1]]
        for even, s in zip(light, SHAPES, strict=True)
    ]


TINY_ARRAYS = Case(
    "whole cameras of 1 x 1, 1 x 7, 31 x 37 ... pixels",
    "arrays smaller than the blur, and of prime sizes, in even light",
    "closed form",
    lambda: [[electrons()] * (rows * columns) for rows, columns in SHAPES],
    _tiny,
    _zero_padded,
    "blur by a transform, black beyond the border",
    1e-12,
    "transforms of even light, and constants of 16 digits",
)

CASES = (
    CHART_AT_NYQUIST, CHART_BEYOND, EDGE, RESAMPLED, BOXES, TINY_ARRAYS,
)  # fmt: skip
