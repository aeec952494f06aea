"""Write the scenes of high dynamic range in configs/scenes: hdr-scene.png and dark-room.png.

Run `.venv/bin/python scripts/make_hdr_scenes.py`. Both are drawn by the formulas below, 256 x 256,
each pixel the mean of 8 x 8 samples; they are no photographs. Codes are linear in light.

hdr-scene: a room seen from within, 12 bits (codes 1 to 4095): a window, a lamp, a ColorChecker on
the wall, a shelf in the dark. dark-room: an eye chart in the light of a bare bulb above it.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.files.images.png import write_png
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.eye_chart import eye_chart
from vcam_cli.spectra import colorchecker

SCENES = Path(__file__).resolve().parent.parent / "configs" / "scenes"
SIZE, FINE = 256, 8
Floats = NDArray[np.float64]


def grid() -> tuple[Floats, Floats]:
    """Return x to the right and y down, 0 to 1, of the samples."""
    at = (np.arange(SIZE * FINE) + 0.5) / (SIZE * FINE)
    return at[None, :], at[:, None]


def mean(fine: Floats) -> Floats:
    """Return the mean of the samples in every pixel."""
    return fine.reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3))


def box(x: Floats, y: Floats, left: float, top: float, right: float, bottom: float) -> Array:
    """Return where samples lie in a rectangle."""
    return (x >= left) & (x < right) & (y >= top) & (y < bottom)


def smooth(random: np.random.Generator, cells: int) -> Floats:
    """Noise of one scale, 0 to 1, without corners."""
    values = random.random((cells + 1, cells + 1))
    at = grid()[0][0] * cells
    low = np.minimum(at.astype(int), cells - 1)
    part = (at - low) ** 2 * (3 - 2 * (at - low))
    rows = values[:, low] * (1 - part) + values[:, low + 1] * part
    return rows[low] * (1 - part)[:, None] + rows[low + 1] * part[:, None]


def clouds(random: np.random.Generator) -> Floats:
    """Noise of many scales, 0 to 1."""
    sums = sum(smooth(random, 3 * 2**k) / 1.7**k for k in range(6))
    return (sums - sums.min()) / np.ptp(sums)


def hdr_scene() -> Floats:
    """Light, 1 = the brightest."""
    random = np.random.default_rng(4)
    x, y = grid()
    light = _walls(x, y, random)
    light = _shelf(x, y, light, random)
    light = _card(x, y, light)
    light = _window(x, y, light, random)
    return _lamp(x, y, light)


def _walls(x: Floats, y: Floats, random: np.random.Generator) -> Floats:
    """Wall and floor in the light of window and lamp."""
    plaster = 0.9 + 0.2 * clouds(random)
    falling = 1 / (1 + 14 * ((x - 0.2) ** 2 + (y - 0.3) ** 2)) ** 2
    glow = 0.05 / (1 + 60 * ((x - 0.86) ** 2 + (y - 0.22) ** 2))
    board = np.floor(9 * (x - 0.5) / (y - 0.5) + 40).astype(int) % 12
    floor = 0.3 + 0.4 * random.random(12)[board]
    return (0.4 * falling + glow) * np.where(y < 0.8, plaster, floor)


def _shelf(x: Floats, y: Floats, light: Floats, random: np.random.Generator) -> Floats:
    """Books in the dark below the lamp: down to a thousandth of the wall."""
    inside = box(x, y, 0.64, 0.44, 0.97, 0.86)
    row = np.minimum(((y - 0.44) / 0.14).astype(int), 2)
    edges = np.cumsum(random.uniform(0.012, 0.03, (3, 40)), axis=1) + 0.65
    covers = random.uniform(0.1, 1.0, (3, 41))
    tall = random.uniform(0.55, 0.9, (3, 41))
    below = 0.44 + 0.14 * (row + 1) - y
    out = light.copy()
    for number in range(3):
        book = np.searchsorted(edges[number], x[0])
        shown = (below < 0.14 * tall[number][book]) & (below > 0.012) & (x < 0.96) & (x > 0.65)
        shade = 0.02 * 0.3**number
        value = np.where(shown, covers[number][book], 0.12) * shade
        out = np.where(inside & (row == number), value, out)
    return out


def _card(x: Floats, y: Floats, light: Floats) -> Floats:
    """Add a ColorChecker, tilted to the window, its patches by their reflectance in the green."""
    left, top, pitch = 0.16, 0.53, 0.068
    patches = [float(s.evaluate(550e-9)) for _, s in colorchecker()]
    column, row = ((x - left) / pitch), ((y - top) / pitch)
    on_card = box(column, row, -0.12, -0.12, 6.0, 4.0)
    number = np.clip(row.astype(int), 0, 3) * 6 + np.clip(column.astype(int), 0, 5)
    filled = (column % 1 < 0.88) & (row % 1 < 0.88) & (column >= 0) & (row >= 0)
    value = np.where(filled, np.array(patches)[number], 0.03)
    return np.where(on_card, 2.5 * value * light, light)


def _window(x: Floats, y: Floats, light: Floats, random: np.random.Generator) -> Floats:
    """Sky and trees behind a cross of bars."""
    sky = 0.78 + 0.2 * clouds(random) ** 2
    trees = 0.06 + 0.1 * clouds(random)
    outside = np.where(y > 0.33 + 0.06 * smooth(random, 16), trees, sky)
    panes = (np.abs(x - 0.25) > 0.008) & (np.abs(y - 0.25) > 0.008)
    light = np.where(box(x, y, 0.07, 0.06, 0.43, 0.44), 0.02, light)
    return np.where(box(x, y, 0.09, 0.08, 0.41, 0.42) & panes, outside, light)


def _lamp(x: Floats, y: Floats, light: Floats) -> Floats:
    """Add a bulb under a shade that light comes through."""
    half = 0.06 + 0.05 * (y - 0.14) / 0.12
    shade = box(x, y, 0, 0.14, 1, 0.26) & (np.abs(x - 0.82) < half)
    light = np.where(shade, 0.12 + 0.2 * np.exp(-(((x - 0.82) / 0.05) ** 2)), light)
    light = np.where(box(x, y, 0.813, 0.26, 0.827, 0.44), 0.006, light)
    return np.where((x - 0.82) ** 2 + (y - 0.265) ** 2 < 0.017**2, 1.0, light)


def dark_room() -> Floats:
    """Light, 1 = the bulb."""
    x, y = grid()
    bulb_x, bulb_y, before = 0.5, 0.1, 0.5  # the bulb hangs before the wall
    away = (x - bulb_x) ** 2 + (y - bulb_y) ** 2 + before**2
    lit = before**3 / away**1.5
    frame = Frame(0.5, 0.62)
    edges = np.arange(SIZE * FINE + 1) / (SIZE * FINE)
    paper = np.empty((1, SIZE * FINE, SIZE * FINE))
    eye_chart(7, frame).paint(edges - 0.5, edges - 0.58, np.ones((1, 1)), paper)
    on_paper = box(x, y, 0.2, 0.23, 0.8, 0.93)
    light = 0.5 * lit * np.where(on_paper, paper[0], 0.05)
    return np.where((x - bulb_x) ** 2 + (y - bulb_y) ** 2 < 0.018**2, 1.0, light)


def codes(light: Floats, bits: int) -> NDArray[np.uint16]:
    """Linear codes from 1 on, the brightest the highest."""
    highest = 2**bits - 1
    scaled = light / light.max() * highest
    return np.clip(np.rint(scaled), 1, highest).astype(np.uint16)


def everything() -> dict[str, NDArray[np.uint16]]:
    """File name -> codes."""
    return {
        "hdr-scene.png": codes(mean(hdr_scene()), 12),
        "dark-room.png": codes(mean(dark_room()), 16),
    }


if __name__ == "__main__":
    for name, picture in everything().items():
        write_png(SCENES / name, picture)
        print(SCENES / name)
    sys.exit()
