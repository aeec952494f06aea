"""Tiles of a frame, all of them or some, and what of the frame each stands for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.image_formation.estimates.chosen_places import chosen_places
from vcam_cli.image_formation.layers.edge_tiles import Tile

MOST = 16
"""Tiles of a sample."""
ANYWHERE = 0.3
"""Share of them whose places do not depend on what may be found there."""


@dataclass(frozen=True)
class TileSample:
    """Tiles of a frame, and how many each stands for."""

    tiles: list[Tile]
    weights: NDArray
    """Tiles that each stands for."""
    pixels: int
    """Pixels of the frame."""
    drawn: int = 0
    """Tiles that were drawn, of which these are some; 0 where nothing was left to chance."""

    def part(self, indices: Sequence[int]) -> TileSample:
        """Return some of them, outside which the frame has nothing."""
        tiles = [self.tiles[index] for index in indices]
        return replace(self, tiles=tiles, weights=self.weights[list(indices)])

    @property
    def share(self) -> float:
        """Part of the frame's pixels that they stand for."""
        sizes = [(rows.stop - rows.start) * (cols.stop - cols.start) for rows, cols in self.tiles]
        return float(self.weights @ np.array(sizes, float)) / self.pixels

    def rms(self, light: Sequence[NDArray]) -> float:
        """Return the rms over the frame of light on the tiles, in the color where it is most.

        Parameters
        ----------
        light : sequence of NDArray
            Light (C, h, w) on every tile, in any unit.

        Returns
        -------
        float
            Rms, in the same unit.
        """
        return math.sqrt(float(self._squares(light).sum(axis=0).max(initial=0.0)))

    def chance_error(self, light: Sequence[NDArray]) -> float:
        """Return the standard error of the same mean square, relative to it; 0 of all tiles."""
        squares = self._squares(light).max(axis=1, initial=0.0)
        if not (self.drawn and squares.any()):
            return 0.0
        spread = self.drawn * float(np.square(squares).sum()) / float(squares.sum()) ** 2 - 1
        return math.sqrt(max(spread, 0.0) / self.drawn)

    def _squares(self, light: Sequence[NDArray]) -> NDArray:
        """Return the parts of the tiles (n, C) in the mean square over the frame."""
        sums = [np.square(part).sum(axis=(1, 2), dtype=float) for part in light]
        return np.reshape(sums, (len(sums), -1)) * self.weights[:, None] / self.pixels


def all_tiles(tiles: list[Tile], pixels: int) -> TileSample:
    """Return all tiles of a frame of so many pixels."""
    return TileSample(tiles, np.ones(len(tiles)), pixels)


def telling_tiles(tiles: list[Tile], contrast: NDArray) -> TileSample:
    """Return all tiles where they are few; else some, the more likely the more contrast they have.

    Parameters
    ----------
    tiles : list of Tile
        The tiles.
    contrast : NDArray
        What may be found in each of the frame's pixels (rows, columns), in any unit.

    Returns
    -------
    TileSample
        The tiles, and what each stands for.
    """
    if len(tiles) <= MOST:
        return all_tiles(tiles, contrast.size)
    expected = np.array([np.square(contrast[tile]).sum(dtype=float) for tile in tiles])
    places, shares = chosen_places(expected, MOST, ANYWHERE, np.random.default_rng(0))
    return TileSample(
        [tiles[place] for place in places], shares * len(tiles), contrast.size, drawn=MOST
    )
