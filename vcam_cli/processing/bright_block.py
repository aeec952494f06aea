"""White balance by bright blocks: gray world, but only of the brightest parts of the picture.

The picture is cut into blocks of 16 x 16 pixels. Blocks in which a pixel is saturated are left
out: there the color of the light is lost. Of the others the brightest hundredth, at least one, is
taken to be white or gray, and each color is multiplied until its means over them are equal.

Why it may beat gray world: a large red wall shifts the mean of the whole picture, but what is
brightest in a picture is most often a white thing or a highlight, both of the light's color. Where
every block holds a saturated pixel, all blocks count, and the method is gray world.

The method is named in Chen 2003, section 2.3.5, as an extension of gray world, without its
details; block size and share are choices made here.
"""

from dataclasses import dataclass

import numpy as np

from vcam_cli.processing.base import Block, Context

SIDE = 16  # pixels; divides the rows that processing works on at a time
SHARE = 0.01  # of the blocks that count


@dataclass(frozen=True)
class Blocks:
    """Blocks of a picture. sums, counts: (C, n) float64, color by color; clean: (n,) bool."""

    sums: np.ndarray
    counts: np.ndarray
    clean: np.ndarray


def measure(block: Block, raw: np.ndarray, context: Context) -> Blocks:
    """The blocks of some rows of the picture.

    block: the rows after the steps before white balance, without a halo, a mosaic or full color;
    raw: (rows, columns) [DN] the same rows of the raw frame, in which saturation shows;
    (C, rows, columns) where a pixel has all its colors, and is saturated where one of them is.
    """
    planes, (rows, columns) = block.planes, raw.shape[-2:]
    full = planes.shape[0] == len(context.colors)
    sums, counts = [], []
    for number, color in enumerate(context.colors):
        here = np.ones((rows, columns)) if full else _sites(color, block, context, columns)
        sums.append(_per_block(here * planes[number if full else 0]))
        counts.append(_per_block(here))
    highest = raw.max(axis=0) if raw.ndim == 3 else raw
    clean = _per_block(highest >= context.saturated_dn) == 0
    return Blocks(np.array(sums), np.array(counts), clean)


def white_means(parts: list[Blocks]) -> np.ndarray:
    """(C,) the means of the colors over the blocks that are taken to be white.

    All parts of one picture, in any order of rows.
    """
    sums = np.concatenate([part.sums for part in parts], axis=1)
    counts = np.concatenate([part.counts for part in parts], axis=1)
    clean = np.concatenate([part.clean for part in parts]) & (counts.min(axis=0) > 0)
    if not clean.any():
        return np.asarray(sums.sum(axis=1) / np.maximum(counts.sum(axis=1), 1))
    brightness = np.where(clean, (sums / np.maximum(counts, 1)).sum(axis=0), -np.inf)
    number = max(1, round(SHARE * np.count_nonzero(clean)))
    brightest = np.argsort(-brightness, kind="stable")[:number]
    return np.asarray(sums[:, brightest].sum(axis=1) / counts[:, brightest].sum(axis=1))


def _sites(color: str, block: Block, context: Context, columns: int) -> np.ndarray:
    """(rows, columns) 1 where a mosaic measures a color, else 0."""
    names = np.array(context.pattern)
    rows = (block.first_row + np.arange(block.planes.shape[1])) % len(names)
    return (names[rows][:, np.arange(columns) % names.shape[1]] == color).astype(float)


def _per_block(values: np.ndarray) -> np.ndarray:
    """Sums over blocks of 16 x 16, smaller ones at the right and lower border: (n,) float64."""
    across = np.add.reduceat(values, np.arange(0, values.shape[1], SIDE), axis=1, dtype=np.float64)
    return np.add.reduceat(across, np.arange(0, values.shape[0], SIDE), axis=0).ravel()
