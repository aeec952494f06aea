"""Highlights: where a color is saturated, it is not known, only that it was at least so bright.

After white balance the colors saturate at different levels, and the matrix of color correction
would turn clipped white into magenta. A saturated color is therefore raised to the brightest of
its pixel's colors: clipped highlights become white, and a lamp whose brightest color alone is
clipped keeps its color. Between 95 and 100 % of saturation it is raised in part, so that nothing
jumps; below, nothing changes.

Why raised and not clipped to the lowest: that would darken all of a picture that is overexposed.
"""

from collections.abc import Sequence

import numpy as np

from vcam_cli.processing.base import Block, Shading, mirrored_index
from vcam_cli.records import dataclass

KNEE = 0.95
"""Share of saturation above which a color is raised."""


@dataclass(frozen=True)
class Highlights:
    """Raises saturated colors to the brightest of their pixel, in full color."""

    ceilings: tuple[float, ...]
    """Signal at which each color saturates, black being 0."""
    colors: tuple[str, ...]
    """Their names."""
    shading: Shading | None
    """What has raised the light off the axis, and the levels of saturation with it; or None."""
    rows: int
    """Rows of the picture."""
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        """Return the block with its saturated colors raised."""
        planes = block.planes
        knees = [KNEE * ceiling if ceiling > 0 else np.inf for ceiling in self.ceilings]
        levels = self._levels(block)
        reached = [level.max() > knee for level, knee in zip(levels, knees, strict=True)]
        if not any(reached):
            return block
        brightest = planes.max(axis=0)
        listed = zip(planes, levels, self.ceilings, knees, reached, strict=True)
        for plane, level, ceiling, knee, high in listed:
            if high:
                share = (level - np.float32(knee)) * np.float32(1 / (ceiling - knee))
                plane += np.clip(share, 0, 1, out=share) * (brightest - plane)
        return block

    def _levels(self, block: Block) -> Sequence[np.ndarray]:
        """Return the planes as bright as the sensor has seen them."""
        if self.shading is None:
            return list(block.planes)
        first, count = block.first_row, block.planes.shape[1]
        rows = mirrored_index(np.arange(first, first + count), self.rows)
        raised = (self.shading.correction(color, rows, slice(None)) for color in self.colors)
        return [plane / factor for plane, factor in zip(block.planes, raised, strict=True)]

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values as they are: the ideal camera does not saturate."""
        return values
