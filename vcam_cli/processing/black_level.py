"""Black level: the mean dark signal and the offset of the converter are taken off every pixel.

Values below black stay negative, so that noise keeps its mean of zero; the tone curve clips them.
"""

from dataclasses import dataclass

import numpy as np

from vcam_cli.processing.base import Block


def level(value: str | float, black_dn: float) -> float:
    """The level [DN] to take off: `black_dn` for "subtract", 0 for "none", or the number given."""
    if value == "subtract":
        return black_dn
    return 0.0 if value == "none" else float(value)


@dataclass(frozen=True)
class BlackLevel:
    """Subtracts `level` [DN]."""

    level: float
    halo: int = 0

    def on_block(self, block: Block) -> Block:
        np.subtract(block.planes, np.float32(self.level), out=block.planes)
        return block

    def on_colors(self, values: np.ndarray) -> np.ndarray:
        return values - self.level
