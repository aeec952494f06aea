"""phase.exr, what the left and right halves of pixels read; disparity.png, how far they differ."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.images.exr import ExrWriter
from vcam_cli.files.images.png import write_png
from vcam_cli.quality.disparity import disparity
from vcam_cli.quality.error_map import false_color
from vcam_cli.simulation.frame import Frame
from vcam_cli.simulation.output import raw_file
from vcam_cli.simulation.phase_memory import MOST, compared_block


def write_phase(path: Path, frame: Frame, config_hash: str) -> None:
    """Write phase.exr, channels left and right [DN].

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    assert frame.phase_dn is not None
    left, right = frame.phase_dn
    columns = min(left.shape[1], right.shape[1])  # of masked pixels one side may have one more
    said = raw_file.attributes(frame, config_hash) | {"vcam:unit.left": "DN"}
    said |= {"vcam:unit.right": "DN"}
    with ExrWriter(path, (len(left), columns), ("left", "right"), said) as exr:
        sides = {"left": left[:, :columns], "right": right[:, :columns]}
        exr.write_rows(0, {name: codes.astype(np.float32) for name, codes in sides.items()})


def frame_disparity(frame: Frame) -> Array:
    """Return the disparity between the halves of a frame's pixels.

    Colors of a block are summed first, so that it has one value a block (rows / P, columns / Q).

    Parameters
    ----------
    frame : Frame
        Frame of pixels with two halves.

    Returns
    -------
    Array
        Position in the left image less that in the right [pixels]; NaN where nothing tells it.
    """
    assert frame.phase_dn is not None
    phase = frame.solved.pixel.phase_detection
    height, width = compared_block(frame.solved)
    apart = width if phase is None or phase.masked is None else 2 * phase.masked.period[1]
    left, right = (_summed(codes, height, width) for codes in frame.phase_dn)
    columns = min(left.shape[1], right.shape[1])  # of masked pixels one side may have one more
    left, right = left[:, :columns], right[:, :columns]
    count, black = height * width, frame.black_dn
    light = np.maximum((left + right) / (2 * count) - black, 0)
    variance = 2 * count * frame.chain.variance_dn(float(light.mean()) / frame.chain.system_gain)
    found = disparity(left, right, MOST, variance)
    if phase is not None and phase.masked is not None:  # right pixels lie half a step beside left
        found = found - 0.5
    return np.asarray(found * apart)


def _summed(codes: Array, height: int, width: int) -> Array:
    """Return the sums of blocks of codes, as floats."""
    rows, columns = (n - n % size for n, size in zip(codes.shape, (height, width), strict=True))
    whole = codes[:rows, :columns].astype(float)
    blocks = whole.reshape(rows // height, height, columns // width, width)
    return np.asarray(blocks.sum(axis=(1, 3)))


def write_disparity(path: Path, frame: Frame) -> None:
    """Write disparity.png: far black, near light; gray where the disparity is unknown.

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    found = frame_disparity(frame)
    known = found[np.isfinite(found)]
    low, high = np.percentile(known, (1, 99)) if known.size else (0.0, 1.0)
    span = max(high - low, math.ulp(1.0))
    picture = false_color(np.clip(found - low, 0, span), span)
    picture[~np.isfinite(found)] = 128
    text = f"disparity of left and right: black {low:.3g} px, light yellow {high:.3g} px, gray none"
    write_png(path, picture, text)
