"""MTF50 of the system from frames of a slanted edge: e-SFR of ISO 12233 (`quality.mtf`)."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.quality.mtf import Lattice, slanted_edge_sfr
from vcam_cli.verification.frames import Stack, color_block
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import Estimate

REACH = 16.0
"""Half the width of the window around the edge [pixels]."""


def mtf50(stack: Stack, measurement: Measurement) -> dict[str, Estimate | None]:
    """Return MTF50 of every color, mean and standard error over the frames [cycles/m].

    The error is None's place where there is one frame only; ValueError where no edge is found.
    """
    assert measurement.pixel is not None
    assert measurement.pixel.width is not None
    pitch_x = measurement.pixel.width
    pitch_y = measurement.pixel.height or pitch_x
    block = color_block(measurement)
    down, across = len(block), len(block[0])
    found: dict[str, Estimate | None] = {}
    for color in dict.fromkeys(name for line in block for name in line):
        places = [(r, c) for r in range(down) for c in range(across) if block[r][c] == color]
        values = []
        for frame in stack.frames.astype(np.float64):
            lattices = [
                Lattice(plane := frame[r::down, c::across],
                        (c + across * np.arange(plane.shape[1])) * pitch_x,
                        (r + down * np.arange(plane.shape[0])) * pitch_y)
                for r, c in places
            ]  # fmt: skip
            pitch = min(pitch_x, pitch_y)
            values.append(slanted_edge_sfr(lattices, pitch, REACH * pitch).mtf50)
        spread = np.std(values, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else 0.0
        whole = math.isfinite(sum(values)) and len(values) > 1
        found[color] = Estimate(float(np.mean(values)), float(spread)) if whole else None
    return found
