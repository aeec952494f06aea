"""A picture without the distortion of its lens: pixels are taken from where it imaged them."""

from typing import Final

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.processing.base import Block, Correction, mirrored_index
from vcam_cli.records import dataclass

ORDER: Final = 3
"""Of the splines between pixels."""


@dataclass(frozen=True)
class Undistort:
    """The step; see `base.Operation`."""

    correction: Correction
    rows: int
    """Rows of the picture."""

    @property
    def halo(self) -> int:
        """Rows that it needs above and below."""
        return self.correction.halo

    def process_block(self, block: Block) -> Block:
        """Return the block after the step, less its halo."""
        from scipy.ndimage import map_coordinates

        halo, first, count = self.halo, block.first_row, block.planes.shape[1]
        inside = mirrored_index(np.arange(first, first + count), self.rows) - first
        planes = block.planes[:, inside]  # steps before know nothing of what is beyond the border
        rows, columns = self.correction.sources(first + halo, first + count - halo)
        at = np.array([rows - first, columns])
        done = [map_coordinates(plane, at, order=ORDER, mode="mirror") for plane in planes]
        return Block(np.array(done, dtype=np.float32), first + halo)

    def process_colors(self, values: Array) -> Array:
        """Return colors as they are: the ideal image is drawn without distortion."""
        return values
