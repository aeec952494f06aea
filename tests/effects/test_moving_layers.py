"""Layers that move: each by itself, in focus or not."""

import numpy as np
import pytest
from making import camera
from moving_waves import PITCH, SCALE, STILL, TIME

from vcam_cli import simulate

BAR = 24
"""Width of a dark bar before an even wall [pixels]."""


def bar(folder, path: float) -> np.ndarray:
    """Mean signal along a row behind a bar that goes so many pixels in the exposure."""
    speed = path * PITCH / SCALE / TIME
    near = {
        "source": {"kind": "chart", "chart": "dark"},
        "distance": "1 m",
        "width": f"{BAR * PITCH / SCALE!r} m",
        "motion": {"x": f"{speed!r} m/s"},
    }
    wall = {"source": {"kind": "chart", "chart": "uniform"}, "distance": "1 m"}
    source = {"kind": "layers", "layers": [near, wall]}
    sharp = {"scene.source": source, "optics.diffraction": False, "array.rows": 24}
    return simulate(camera(folder, STILL | sharp)).mean_electrons[12]


def spread(signal: np.ndarray) -> float:
    """Variance of the place of the left edge [pixels squared]."""
    steps = -np.diff(signal[:32].astype(float))
    at = np.arange(len(steps))
    mean = np.sum(steps * at) / steps.sum()
    return float(np.sum(steps * (at - mean) ** 2) / steps.sum())


def test_layers_in_focus_that_move_are_blurred_by_their_own_path(tmp_path):
    """An edge that goes evenly by L has L^2 / 12 more spread, and hides as much whatever L is.

    Cells on which layers are put one before the other blur an edge by up to one of them, 1 / 12 of
    a squared pixel, differently for each path: 2 %.
    """
    short, long = bar(tmp_path, 4.0), bar(tmp_path, 9.0)
    assert spread(long) - spread(short) == pytest.approx((9**2 - 4**2) / 12, rel=0.02)
    hidden = [float((1 - signal / signal.max()).sum()) for signal in (short, long)]
    assert hidden[1] == pytest.approx(hidden[0], rel=2e-3)
