"""From a quad-Bayer mosaic to a Bayer mosaic of as many pixels.

Six of the sixteen pixels of a quad-Bayer block have the color that a Bayer mosaic has there, and
stay as they are. The others are what guided interpolation (`guided_interpolation.py`) finds of the
color that is wanted, along edges.
"""

import numpy as np

from vcam_cli.processing.base import Block, Pattern, mirrored_index
from vcam_cli.processing.guided_interpolation import GuidedInterpolation
from vcam_cli.records import dataclass

QUAD: Pattern = (("R", "R", "G", "G"),) * 2 + (("G", "G", "B", "B"),) * 2
BAYER: Pattern = (("R", "G"), ("G", "B"))


@dataclass(frozen=True)
class Remosaic:
    """Gives every pixel the color of a Bayer mosaic."""

    interpolation: GuidedInterpolation
    """What finds all colors at every pixel of the quad-Bayer mosaic."""
    colors: tuple[str, ...]
    """Order of the color planes."""
    rows: int
    """Rows of the frame."""

    @property
    def halo(self) -> int:
        """Rows that it needs above and below."""
        return self.interpolation.halo

    def process_block(self, block: Block) -> Block:
        """Return the block as a Bayer mosaic, mirrored beyond the frame as one is."""
        found = self.interpolation.process_block(block)
        rows = found.first_row + np.arange(found.planes.shape[1])
        # A mirrored quad-Bayer mosaic is not one: rows beyond the border come from inside again.
        inside = np.clip(mirrored_index(rows, self.rows) - found.first_row, 0, len(rows) - 1)
        planes = found.planes[:, inside]
        mosaic = np.empty_like(planes[:1])
        for row in range(2):
            for column in range(2):
                at = slice((row - found.first_row) % 2, None, 2), slice(column, None, 2)
                mosaic[0][at] = planes[self.colors.index(BAYER[row][column])][at]
        return Block(mosaic, found.first_row)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values as they are: colors stay what they are."""
        return values
