"""Demosaicing: the colors a pixel did not measure, from its neighbors.

Bilinear interpolation of a Bayer mosaic [1]: green at a red or blue pixel is the mean of its four
neighbors; red and blue are the mean of the two nearest in the row or column at a green pixel, of
the four diagonal ones at the opposite color. Measured values are left as they are.

Beyond the border the mosaic is mirrored about its outermost pixels (-1 -> 1), which keeps its
phase: a flat field stays flat up to the corners.

References
----------
.. [1] R. Ramanath et al., "Demosaicking methods for Bayer color arrays", Journal of Electronic
   Imaging 11(3), 2002, section 3.2, doi:10.1117/1.1484495.
"""

import numpy as np

from vcam_cli.processing.base import Block, Pattern, mirrored_index
from vcam_cli.records import dataclass


def is_bayer(pattern: Pattern) -> bool:
    """Return whether a pattern is 2 x 2 of three colors, one of them twice, on a diagonal.

    Parameters
    ----------
    pattern : Pattern
        Repeating block of colors.

    Returns
    -------
    bool
        True for a Bayer mosaic.
    """
    if len(pattern) != 2 or any(len(row) != 2 for row in pattern):
        return False
    (a, b), (c, d) = pattern
    return (a == d or b == c) and len({a, b, c, d}) == 3


def bilinear_rows(mosaic: np.ndarray, pattern: Pattern, colors: tuple[str, ...]) -> np.ndarray:
    """Return all colors of rows whose first and last only serve as neighbors.

    Why whole rows: sums over contiguous rows run in vector instructions, and picking every
    second of them afterwards costs less than computing on every second pixel.

    Parameters
    ----------
    mosaic : ndarray
        Values (rows + 2, columns), float32.
    pattern : Pattern
        Block of 2 x 2 color names that starts at pixel (1, 0), the first row inside.
    colors : tuple of str
        Order of the planes.

    Returns
    -------
    ndarray
        Planes (C, rows, columns), float32.
    """
    wide = np.concatenate((mosaic[..., 1:2], mosaic, mosaic[..., -2:-1]), axis=-1)
    center = mosaic[..., 1:-1, :]
    vertical = wide[..., :-2, :] + wide[..., 2:, :]
    horizontal = wide[..., 1:-1, :-2] + wide[..., 1:-1, 2:]
    diagonal = vertical[..., :-2] + vertical[..., 2:]
    diagonal *= np.float32(0.25)
    vertical = vertical[..., 1:-1]
    cross = vertical + horizontal
    cross *= np.float32(0.25)
    vertical *= np.float32(0.5)
    horizontal *= np.float32(0.5)

    planes: np.ndarray = np.empty_like(center, np.float32, shape=(len(colors), *center.shape))
    plane = dict(zip(colors, planes, strict=True))
    green = pattern[0][0] if pattern[0][0] == pattern[1][1] else pattern[0][1]
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        site = (..., slice(i, None, 2), slice(j, None, 2))
        plane[pattern[i][j]][site] = center[site]
        if pattern[i][j] == green:
            plane[pattern[i][1 - j]][site] = horizontal[site]
            plane[pattern[1 - i][j]][site] = vertical[site]
        else:
            plane[green][site] = cross[site]
            plane[pattern[1 - i][1 - j]][site] = diagonal[site]
    return planes


@dataclass(frozen=True)
class Bilinear:
    """Takes blocks of a Bayer mosaic to full color by bilinear interpolation."""

    pattern: Pattern
    colors: tuple[str, ...]
    halo: int = 1

    def process_block(self, block: Block) -> Block:
        """Return the block in full color."""
        first = block.first_row + 1
        inside = self.pattern if first % 2 == 0 else self.pattern[::-1]
        return Block(bilinear_rows(block.planes[0], inside, self.colors), first)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values as they are: they have all their colors."""
        return values

    def color_sums(self, block: Block, shape: tuple[int, ...]) -> np.ndarray:
        """Return what some rows of the mosaic add to the sums of the full-color picture.

        Why: a mean needs no picture. Interpolation is linear, so a measured value counts as often
        as it is used, with the weights of its uses.

        Parameters
        ----------
        block : Block
            Rows of the mosaic, without a halo.
        shape : tuple of int
            Rows and columns of the mosaic.

        Returns
        -------
        ndarray
            Sum of each color, and number of its pixels (2, C), float64.
        """
        rows = block.first_row + np.arange(block.planes.shape[1])
        down, across = _neighbor_counts(shape[0])[rows], _neighbor_counts(shape[1])
        sums = np.zeros((2, len(self.colors)))
        sums[1] = block.planes[0].size
        twice = [name for row in self.pattern for name in row]
        for i, names in enumerate(self.pattern):
            mine = rows % 2 == i
            measured = block.planes[0][mine]
            for j, name in enumerate(names):
                values, along = measured[:, j::2], across[j::2]
                if twice.count(name) == 2:  # itself, and its share of four neighbors
                    plain, weighted = _row_sums(values, along)
                    found = plain.sum() + (weighted.sum() + plain @ down[mine]) / 4
                else:  # means of two, along both axes one after the other
                    plain, weighted = _row_sums(values, along)
                    found = (plain + weighted / 2) @ (1 + down[mine] / 2)
                sums[0, self.colors.index(name)] += found
        return sums


def _row_sums(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of rows, and of rows times weights."""
    values = values.astype(np.float64)
    return values.sum(axis=1), np.einsum("ij,j->i", values, weights)


def _neighbor_counts(count: int) -> np.ndarray:
    """Return how often each pixel of a line is another's neighbor, mirrored ones too."""
    beside = np.concatenate([mirrored_index(np.arange(count) + d, count) for d in (-1, 1)])
    return np.bincount(beside, minlength=count).astype(float)
