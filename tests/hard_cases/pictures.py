"""Hard cases of judging pictures: sums over millions of pixels, the eye's filters."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
from scipy.signal import convolve2d

from vcam_cli.processing import white_balance
from vcam_cli.processing.base import Block, Context
from vcam_cli.quality import cielab, eye, scielab
from vcam_cli.quality.display import Screen, rgb_to_xyz
from vcam_cli.quality.mse import mse, psnr_of_mse

from .hard_case import Case

# --- sums over 100 million values ----------------------------------------------------------------

SIDE = 10_000
ROW = np.random.default_rng(3).random(SIDE, dtype=np.float32)
PICTURE = np.broadcast_to(ROW, (SIDE, SIDE))
"""100 million float32 values in the memory of one row."""
BLACK = np.broadcast_to(np.zeros(1, np.float32), (SIDE, SIDE))


def _added_in_float32(row: np.ndarray) -> float:
    """The total of all rows, value by value, 1000 rows at a time."""
    total = np.float32(0)
    many = np.tile(row, 1000)
    for _ in range(SIDE // 1000):
        total = np.cumsum(np.concatenate([[total], many]), dtype=np.float32)[-1]
    return float(total)


def _mean_exact(power: int) -> mp.mpf:
    return mp.fsum(mp.mpf(value) ** power for value in ROW.tolist()) / SIDE


MEAN_SQUARE = Case(
    "mean squared error of 100 million float32 pixels",
    "a float32 sum no longer grows from 16 million on",
    "sum of one row",
    lambda: [_mean_exact(2)],
    lambda: [mse(PICTURE, BLACK)],
    lambda: [_added_in_float32(ROW**2) / SIDE**2],
    "total += (a - b)^2 in float32",
    1e-13,
    "float64 sums by blocks of 64 rows",
)

GRAY = Context((("Y",),), ("Y",), np.ones(1), 0.0)


def _gray_mean() -> list[float]:
    total, count = white_balance.color_sums(Block(PICTURE[None], 0), GRAY)[:, 0]
    return [total / count]


COLOR_MEAN = Case(
    "gray world's mean of 100 million float32 pixels",
    "a float32 sum no longer grows from 16 million on",
    "sum of one row",
    lambda: [_mean_exact(1)],
    _gray_mean,
    lambda: [_added_in_float32(ROW) / SIDE**2],
    "total += value in float32",
    1e-11,
    "a running sum of rows in float64",
)

ERRORS = (0.0, 5e-324, 1.0)

PEAK = Case(
    "peak signal-to-noise ratio of equal pictures",
    "no error at all, or the smallest there is",
    "exactly inf",
    lambda: [mp.inf, -10 * mp.log10(mp.mpf(5e-324)), 0],
    lambda: [psnr_of_mse(error) for error in ERRORS],
    lambda: [20 * math.log10(1 / math.sqrt(error)) for error in ERRORS],
    "20 log10(1 / sqrt(mse))",
    1e-15,
    "a logarithm",
)

# --- S-CIELAB ------------------------------------------------------------------------------------

SCREEN = Screen(rgb_to_xyz("srgb"), 60.0)
FILTERS: eye.Filters = "zhang-wandell-1996"
FAINT = np.array([1e-12, 1e-9, 1e-6])
BLACKS = (1, 1), (3, 5), (40, 30)


def _black_pairs(difference) -> list[object]:
    out = []
    for shape in BLACKS:
        black = np.zeros((*shape, 3))
        out.append(difference(black, black.copy()))
        out += [difference(black + level, black) for level in FAINT.tolist()]
    return out


def _black_exact() -> list[mp.mpf]:
    out = []
    for rows, columns in BLACKS:
        for level in (0.0, *FAINT.tolist()):
            out += [mp.mpf("903.3") * mp.mpf(level)] * (rows * columns)
    return out


def _roots_of_blurred(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Blurred, then the cube root everywhere: a Gaussian with black beyond the border."""
    at = np.arange(-30, 31)
    spot = np.exp(-(at**2 + at[:, None] ** 2) / 18)

    def seen(picture: np.ndarray) -> np.ndarray:
        y = convolve2d(picture[..., 1], spot / spot.sum(), "same")
        return 116 * np.cbrt(y) - 16

    return np.abs(seen(image) - seen(reference))


BLACK_PICTURES = Case(
    "S-CIELAB of black and almost black pictures",
    "differences of cube roots at 0; a picture may be smaller than the filter",
    "903.3 Y in even light",
    _black_exact,
    lambda: _black_pairs(lambda a, b: scielab.s_cielab_map(a, b, SCREEN, FILTERS)),
    lambda: _black_pairs(_roots_of_blurred),
    "116 (Y/Yn)^(1/3) - 16 of blurred pictures",
    2e-13,
    "a* and b* are differences of 500 x 16/116: 1e-14 each",
    absolute=True,
)

SMALL = np.random.default_rng(8).random((2, 3, 3))
WHITE = np.ones((2, 3, 3))


def _mirrored_exact() -> list[mp.mpf]:
    """S-CIELAB of SMALL from white: every tap on the endlessly mirrored picture, in 50 digits."""
    kernels = eye.kernels(FILTERS, SCREEN.samples_per_degree)
    to_opponent = mp.matrix(eye.OPPONENT[FILTERS]) * mp.matrix(SCREEN.to_xyz.tolist())
    back, white = mp.inverse(mp.matrix(eye.OPPONENT[FILTERS])), SCREEN.white.tolist()
    planes = [
        [[(to_opponent * mp.matrix(pixel))[k] for pixel in row] for row in SMALL.tolist()]
        for k in range(3)
    ]
    blurred = [_blur_exact(plane, kernel) for plane, kernel in zip(planes, kernels, strict=True)]
    out = []
    for i in range(2):
        for j in range(3):
            xyz = back * mp.matrix([plane[i][j] for plane in blurred])
            out.append(_distance_from_white([xyz[k] / mp.mpf(white[k]) for k in range(3)]))
    return out


def _blur_exact(plane: list[list[mp.mpf]], kernel: eye.Kernel) -> list[list[mp.mpf]]:
    rows, columns = len(plane), len(plane[0])
    total = [[mp.mpf(0)] * columns for _ in range(rows)]
    for weight, taps in zip(kernel.weights.tolist(), kernel.taps.tolist(), strict=True):
        down, across = (_folded(taps, count) for count in (rows, columns))
        for i in range(rows):
            for j in range(columns):
                seen = (
                    down[i][m] * across[j][n] * plane[m][n]
                    for m in range(rows)
                    for n in range(columns)
                )
                total[i][j] += mp.mpf(weight) * mp.fsum(seen)
    return total


def _folded(taps: list[float], count: int) -> list[list[mp.mpf]]:
    """[i][n]: what pixel i gets of pixel n, and of all its mirror images."""
    reach = len(taps) // 2
    out = [[mp.mpf(0)] * count for _ in range(count)]
    for i in range(count):
        for k, tap in enumerate(taps):
            place = (i + k - reach) % (2 * count)
            out[i][min(place, 2 * count - 1 - place)] += mp.mpf(tap)
    return out


def _distance_from_white(relative: list[mp.mpf]) -> mp.mpf:
    x, y, z = (mp.cbrt(value) for value in relative)  # all well above the straight part
    return mp.sqrt((116 * (y - 1)) ** 2 + (500 * (x - y)) ** 2 + (200 * (y - z)) ** 2)


def _black_borders() -> np.ndarray:
    """The same kernels with black beyond the border, as `convolve2d` does by default."""
    kernels = eye.kernels(FILTERS, SCREEN.samples_per_degree)
    opponent = np.array(eye.OPPONENT[FILTERS])

    def seen(picture: np.ndarray) -> np.ndarray:
        planes = np.einsum("ij,rcj->irc", opponent @ SCREEN.to_xyz, picture)
        for plane, kernel in zip(planes, kernels, strict=True):
            spot = np.einsum("i,ir,ic->rc", kernel.weights, kernel.taps, kernel.taps)
            reach = kernel.reach
            full = convolve2d(plane, spot)
            plane[...] = full[reach : reach + len(plane), reach : reach + plane.shape[1]]
        xyz = np.einsum("ij,jrc->irc", np.linalg.inv(opponent), planes)
        return cielab.lab(xyz / SCREEN.white[:, None, None])

    return cielab.delta_e(seen(SMALL), seen(WHITE))


SMALLER_THAN_FILTER = Case(
    "S-CIELAB of 2 x 3 pixels, filters of 60 x 60",
    "what lies beyond the border is most of what is seen",
    "tap by tap on mirrors",
    _mirrored_exact,
    lambda: scielab.s_cielab_map(SMALL, WHITE, SCREEN, FILTERS),
    _black_borders,
    "convolution, black beyond the border",
    1e-12,
    "transforms, cube roots and differences of them times 500",
)

CASES = (MEAN_SQUARE, COLOR_MEAN, PEAK, BLACK_PICTURES, SMALLER_THAN_FILTER)
