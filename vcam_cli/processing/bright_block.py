"""White balance by bright blocks: gray world, but only of the brightest parts of the picture.

The picture is cut into blocks of 16 x 16 pixels. Blocks in which a pixel is saturated are left
out: there the color of the light is lost. Of the others the brightest hundredth, at least one, is
assumed to be white or gray, and each color is multiplied until its means over them are equal.

Why it may beat gray world: a large red wall shifts the mean of the whole picture, but what is
brightest in a picture is most often a white thing or a highlight, both of the light's color. Where
every block holds a saturated pixel, all blocks count, and the method is gray world.

The method is named in Chen 2003, section 2.3.5, as an extension of gray world, without its
details; block size and share are choices made here.
"""

import numpy as np

from vcam_cli.processing.base import Block, Context
from vcam_cli.records import dataclass

BLOCK_SIDE = 16
"""Side of a block [pixels]; divides the rows that processing works on at a time."""
BRIGHT_SHARE = 0.01
"""Share of the blocks without saturation that counts as white."""


@dataclass(frozen=True)
class Blocks:
    """Sums over blocks of a picture."""

    sums: np.ndarray
    """Sum of each color in each block (C, n), float64."""
    counts: np.ndarray
    """Number of pixels of each color in each block (C, n), float64."""
    clean: np.ndarray
    """Whether no pixel of a block is saturated (n,)."""


def measure(block: Block, raw: np.ndarray, context: Context) -> Blocks:
    """Return the sums over the blocks of some rows of the picture.

    Parameters
    ----------
    block : Block
        The rows after the steps before white balance, without a halo, a mosaic or full color.
    raw : ndarray
        The same rows of the raw frame (rows, columns) [DN], in which saturation shows;
        (C, rows, columns) where a pixel has all its colors, and is saturated where one of them is.
    context : Context
        Pattern, colors and saturation of the camera.

    Returns
    -------
    Blocks
        Sums, counts and saturation.
    """
    planes, (rows, columns) = block.planes, raw.shape[-2:]
    full = planes.shape[0] == len(context.colors)
    sums, counts = [], []
    for number, color in enumerate(context.colors):
        here = np.ones((rows, columns)) if full else _sites(color, block, context, columns)
        sums.append(_block_sums(here * planes[number if full else 0]))
        counts.append(_block_sums(here))
    highest = raw.max(axis=0) if raw.ndim == 3 else raw
    clean = _block_sums(highest >= context.saturated_dn) == 0
    return Blocks(np.array(sums), np.array(counts), clean)


def white_means(parts: list[Blocks]) -> np.ndarray:
    """Return the means of the colors over the blocks that are assumed to be white.

    Parameters
    ----------
    parts : list of Blocks
        All parts of one picture, in any order of rows.

    Returns
    -------
    ndarray
        Mean of each color (C,), in the unit of the blocks.
    """
    sums = np.concatenate([part.sums for part in parts], axis=1)
    counts = np.concatenate([part.counts for part in parts], axis=1)
    clean = np.concatenate([part.clean for part in parts]) & (counts.min(axis=0) > 0)
    if not clean.any():
        return np.asarray(sums.sum(axis=1) / np.maximum(counts.sum(axis=1), 1))
    brightness = np.where(clean, (sums / np.maximum(counts, 1)).sum(axis=0), -np.inf)
    number = max(1, round(BRIGHT_SHARE * np.count_nonzero(clean)))
    brightest = np.argsort(-brightness, kind="stable")[:number]
    return np.asarray(sums[:, brightest].sum(axis=1) / counts[:, brightest].sum(axis=1))


def _sites(color: str, block: Block, context: Context, columns: int) -> np.ndarray:
    """Return 1 where a mosaic measures a color, else 0: (rows, columns)."""
    names = np.array(context.pattern)
    rows = (block.first_row + np.arange(block.planes.shape[1])) % len(names)
    mask: np.ndarray = (names[rows][:, np.arange(columns) % names.shape[1]] == color).astype(float)
    return mask


def _block_sums(values: np.ndarray) -> np.ndarray:
    """Return sums over blocks of 16 x 16, smaller ones at the right and lower border: (n,)."""
    across = np.add.reduceat(
        values, np.arange(0, values.shape[1], BLOCK_SIDE), axis=1, dtype=np.float64
    )
    return np.add.reduceat(across, np.arange(0, values.shape[0], BLOCK_SIDE), axis=0).ravel()
