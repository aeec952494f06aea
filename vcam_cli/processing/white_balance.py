"""White balance: one gain for each color.

Gray world [1]: the average of a scene is assumed gray, so each color is multiplied until all
means are equal.

Illuminant: the light is known here, so the color of a perfect white is known; each color is
multiplied until white is gray. What the other methods estimate, and the best they can reach.
`bright_block` has a third method.

Why every pixel counts in gray world, saturated ones too: that is the classical definition, and
the means of the picture that comes out are then equal exactly. Dropping the saturated pixels of
one color would bias its mean against the others, whose pixels at that place would stay in.

References
----------
.. [1] G. Buchsbaum, "A spatial processor model for object colour perception", Journal of the
   Franklin Institute 310(1), 1-26, 1980, doi:10.1016/0016-0032(80)90058-7.
"""

import numpy as np

from vcam_cli.processing.base import Block, Context, Pattern
from vcam_cli.records import dataclass

BLACK_FRAME_SHARE = 1e-4
"""Share of white below which all means are those of a black frame."""
MIN_COLOR_SHARE = 1e-3
"""Share of the brightest color below which a color holds nothing to balance."""


def gray_world_gains(means: np.ndarray, white: float) -> np.ndarray:
    """Return gains that make the color means equal; 1 for the color with the largest mean [1].

    A black frame gets gains of 1, and so does a color that sees (next to) nothing, as under
    monochromatic light: its gain would only amplify noise.

    Parameters
    ----------
    means : ndarray
        Mean of each color above black (C,).
    white : float
        Largest signal of a perfect white, in the same unit.

    Returns
    -------
    ndarray
        Gains (C,) [dimensionless].
    """
    means = np.asarray(means, dtype=np.float64)
    largest = means.max()
    gains = np.ones(means.shape)
    if largest <= BLACK_FRAME_SHARE * max(white, 0.0):
        return gains
    seen = means > MIN_COLOR_SHARE * largest
    gains[seen] = largest / means[seen]
    return gains


def illuminant_gains(white: np.ndarray) -> np.ndarray:
    """Return gains that make a perfect white gray.

    Parameters
    ----------
    white : ndarray
        Signal of a perfect white in each color above black (C,).

    Returns
    -------
    ndarray
        Gains (C,) [dimensionless].
    """
    return gray_world_gains(white, float(np.max(white)))


def color_sums(block: Block, context: Context) -> np.ndarray:
    """Return the sum of each color over a block, and the number of its pixels.

    Parameters
    ----------
    block : Block
        Rows of a mosaic, which counts each color at its own pixels, or of full color.
    context : Context
        Pattern and colors of the camera.

    Returns
    -------
    ndarray
        Sums and numbers (2, C), float64.
    """
    planes = block.planes
    if planes.shape[0] == len(context.colors):
        size = float(planes[0].size)
        return np.array([[plane.sum(dtype=np.float64), size] for plane in planes]).T
    sums = np.zeros((2, len(context.colors)))
    for i, names in enumerate(context.pattern):
        rows = planes[0, _phase(i, block, context.pattern) :: len(context.pattern)]
        column_sums = rows.sum(axis=0, dtype=np.float64)
        for j, name in enumerate(names):
            part = column_sums[j :: len(names)]
            sums[:, context.colors.index(name)] += part.sum(), part.size * rows.shape[0]
    return sums


def _phase(row: int, block: Block, pattern: Pattern) -> int:
    """Return the first row of a block that has the colors of a row of the pattern."""
    return (row - block.first_row) % len(pattern)


@dataclass(frozen=True)
class Gains:
    """Multiplies every color by its gain, in a mosaic as well as in full color."""

    gains: tuple[float, ...]
    """Gain of each color (C,)."""
    context: Context
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        """Return the block times the gains."""
        planes, context = block.planes, self.context
        if planes.shape[0] == len(context.colors):
            for plane, gain in zip(planes, self.gains, strict=True):
                np.multiply(plane, np.float32(gain), out=plane)
            return block
        gain_of = dict(zip(context.colors, self.gains, strict=True))
        for i, names in enumerate(context.pattern):
            rows = planes[0, _phase(i, block, context.pattern) :: len(context.pattern)]
            one_row = np.array([gain_of[name] for name in names], np.float32)
            np.multiply(rows, np.resize(one_row, planes.shape[2]), out=rows)
        return block

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values times the gains."""
        gains = np.asarray(self.gains, dtype=values.dtype)
        balanced: np.ndarray = values * gains.reshape(-1, *(1,) * (values.ndim - 1))
        return balanced
