"""Black level: the mean dark signal and the offset of the converter are taken off every pixel.

Values below black stay negative, so that noise keeps its mean of zero; the tone curve clips them.
"""

import numpy as np

from vcam_cli.processing.base import Block
from vcam_cli.records import dataclass


def subtracted_level(value: str | float, black_dn: float) -> float:
    """Return the level that the step takes off.

    Parameters
    ----------
    value : {"subtract", "none"} or float
        Value of the step, a number in [DN].
    black_dn : float
        Mean dark signal and offset [DN].

    Returns
    -------
    float
        `black_dn` for "subtract", 0 for "none", or the number given [DN].
    """
    if value == "subtract":
        return black_dn
    return 0.0 if value == "none" else float(value)


@dataclass(frozen=True)
class BlackLevel:
    """Subtracts a level."""

    level: float
    """Level that is taken off [DN]."""
    mosaic: tuple[tuple[float, ...], ...] = ()
    """What more is taken off the pixels of a mosaic's block [DN]; () where all are alike."""
    colors: tuple[float, ...] = ()
    """The same of each color, of pixels that have all of them [DN]."""
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        """Return the block less the level."""
        np.subtract(block.planes, np.float32(self.level), out=block.planes)
        if not self.mosaic:
            return block
        if len(block.planes) > 1:
            block.planes[...] -= np.array(self.colors, np.float32)[:, None, None]
            return block
        # Mirrored rows keep their place in a block of two rows.
        down, across = len(self.mosaic), len(self.mosaic[0])
        for row in range(down):
            for column in range(across):
                first = (row - block.first_row) % down
                part = block.planes[:, first::down, column::across]
                part -= np.float32(self.mosaic[row][column])
        return block

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values less the level."""
        return values - self.level
