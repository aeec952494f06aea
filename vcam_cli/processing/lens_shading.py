"""Even light made even again: each color times what lens and pixels keep of it off the axis.

The factor is that of the simulated effects themselves, so that nothing but noise is left; it
raises the noise of the corners, and the stray light there, by as much as their light.
"""

from typing import Final

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.processing.base import Block, Context, Shading, mirrored_index
from vcam_cli.records import dataclass

WHOLE: Final = slice(None)


@dataclass(frozen=True)
class EvenLight:
    """The step; see `base.Operation`."""

    shading: Shading
    context: Context
    rows: int
    """Rows of the picture."""
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        """Return the block times the factors of its colors."""
        planes, colors, pattern = block.planes, self.context.colors, self.context.pattern
        first = block.first_row
        rows = mirrored_index(np.arange(first, first + planes.shape[1]), self.rows)
        if len(planes) == len(colors):
            for plane, color in zip(planes, colors, strict=True):
                plane *= self.shading.correction(color, rows, WHOLE)
            return block
        for i, names in enumerate(pattern):
            here = np.flatnonzero(rows % len(pattern) == i)
            for j, color in enumerate(names):
                columns = slice(j, None, len(names))
                planes[0, here, columns] *= self.shading.correction(color, rows[here], columns)
        return block

    def process_colors(self, values: Array) -> Array:
        """Return colors as they are: the ideal image and white on the axis have no falloff."""
        return values
