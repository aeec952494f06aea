"""Linear light from the codes of an ADC that is not linear: before all other steps.

It is no step of the user's: whatever `processing` says, its steps mean linear light.
"""

from collections.abc import Callable

import numpy as np

from vcam_cli.processing.base import Block
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Linearize:
    """Takes codes of the ADC to codes of a linear one."""

    curve: Callable[[np.ndarray], np.ndarray]
    """Function from codes to the codes of a linear ADC [DN]."""
    frame_is_linear: bool = False
    """Whether the frame has been through it; only full-color values are still codes."""
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        """Return the block in linear light."""
        return block if self.frame_is_linear else Block(self.curve(block.planes), block.first_row)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values in linear light."""
        return self.curve(values)
