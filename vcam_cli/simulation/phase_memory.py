"""How far halves of pixels are compared, and the memory that their files take."""

from __future__ import annotations

from vcam_cli.quality.disparity import needed_bytes
from vcam_cli.solve.solved import Solved

MOST = 24
"""Largest disparity that is looked for, over the sum of a block's colors [blocks]."""
WRITTEN = 16
"""What writing the codes of a pixel's halves takes: both in 32 bits, and a copy [bytes]."""


def compared_block(solved: Solved) -> tuple[int, int]:
    """Return the pixels whose sum is compared: a block of the mosaic, or one masked pixel.

    Parameters
    ----------
    solved : Solved
        Camera whose pixels have two halves.

    Returns
    -------
    rows, columns : int
        Pixels along y and x.
    """
    phase, block = solved.pixel.phase_detection, solved.layout.raw_mosaic.block
    is_masked = phase is not None and phase.masked is not None
    return (1, 1) if is_masked else (len(block), len(block[0]))


def written_bytes(solved: Solved) -> int:
    """Return the memory that writing both files takes, one beside the other.

    Parameters
    ----------
    solved : Solved
        Camera whose pixels have two halves.

    Returns
    -------
    int
        Bytes, at least those traced.
    """
    rows, columns = solved.geometry.rows, solved.geometry.columns
    phase, (height, width) = solved.pixel.phase_detection, compared_block(solved)
    if phase is not None and phase.masked is not None:  # on either side
        down, along = phase.masked.period
        rows, columns = -(-rows // down), -(-columns // along)
    return WRITTEN * rows * columns + needed_bytes(rows // height, columns // width, MOST)
