"""Which color each pixel sees."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.array import Block
from vcam_cli.records import dataclass

NONE = "."
"""A place of a block where there is no pixel."""
BLOCKS: dict[str, tuple[tuple[str, ...], ...]] = {
    "monochrome": (("Y",),),
    "bayer-rggb": (("R", "G"), ("G", "B")),
    "bayer-grbg": (("G", "R"), ("B", "G")),
    "bayer-gbrg": (("G", "B"), ("R", "G")),
    "bayer-bggr": (("B", "G"), ("G", "R")),
    "quad-bayer": (("R", "R", "G", "G"),) * 2 + (("G", "G", "B", "B"),) * 2,
    "rgbw": tuple(tuple(row) for row in ("WBWG", "BWGW", "WGWR", "GWRW")),
    "honeycomb": tuple(tuple(row) for row in ("R.B.", ".G.G", "B.R.", ".G.G")),
}
"""The block of colors that repeats over the array, from its upper-left corner. RGBW: every second
pixel is clear, J. Compton and J. Hamilton, US patent 8139130 B2, 2012, figure 5. Honeycomb: a
Bayer mosaic turned by 45 degrees, on a lattice with twice its columns."""


@dataclass(frozen=True)
class Mosaic:
    """A block of colors that repeats over the array."""

    block: tuple[tuple[str, ...], ...]

    @cached_property
    def colors(self) -> tuple[str, ...]:
        """Colors in the order of channels: R, G, B first, others by first appearance."""
        return channel_order(c for row in self.block for c in row if c != NONE)

    @cached_property
    def is_full(self) -> bool:
        """Whether there is a pixel at every place."""
        return all(name != NONE for row in self.block for name in row)

    def row_colors(self, row: int, first: int = 0) -> Iterator[tuple[int, list[slice]]]:
        """Yield every color of an array row: its index, and its columns, from the first one on."""
        line = self.block[row % len(self.block)]
        for color in dict.fromkeys(name for name in line if name != NONE):
            at = [(n - first) % len(line) for n, name in enumerate(line) if name == color]
            yield self.colors.index(color), [slice(offset, None, len(line)) for offset in at]

    def color_at(self, rows: Array, columns: Array) -> Array:
        """Return the indices (m, n) of the colors at rows (m,) and columns (n,); -1: no pixel."""
        index = {name: number for number, name in enumerate(self.colors)}
        block = np.array([[index.get(name, -1) for name in line] for line in self.block])
        found: Array = block[np.ix_(rows % block.shape[0], columns % block.shape[1])]
        return found


def channel_order(colors: Iterable[str]) -> tuple[str, ...]:
    """Return colors in the order of channels: R, G, B first, others by first appearance."""
    distinct = list(dict.fromkeys(colors))
    return tuple(sorted(distinct, key=lambda c: ("RGB".find(c) % 4, distinct.index(c))))


def mosaic(camera: CameraModel) -> Mosaic:
    """Return the camera's mosaic."""
    pattern = camera.array.pattern
    return Mosaic(pattern.block if isinstance(pattern, Block) else BLOCKS[str(pattern)])
