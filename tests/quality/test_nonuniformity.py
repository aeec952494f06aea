"""The fixed pattern of drawn stacks: its size and its rows, columns and pixels."""

import math

import numpy as np
import pytest

from vcam_cli.quality.nonuniformity import (
    RunningStack,
    SpatialVariance,
    dsnu,
    prnu,
    spatial_variance,
)

ROWS, COLUMNS = 220, 260
ROW, COLUMN, PIXEL, NOISE = 2.0, 3.0, 5.0, 20.0


def pattern(rng):
    return (
        rng.normal(0, ROW, (ROWS, 1))
        + rng.normal(0, COLUMN, (1, COLUMNS))
        + rng.normal(0, PIXEL, (ROWS, COLUMNS))
    )


def stacked(fixed, frames, seed=3):
    rng = np.random.default_rng(seed)
    running = RunningStack()
    for _ in range(frames):
        running.add(100 + fixed + rng.normal(0, NOISE, fixed.shape))
    return running.result()


def test_running_statistics_are_those_of_all_frames_at_once():
    frames = np.random.default_rng(1).normal(1e6, 1, (7, 2, 5, 4))
    running = RunningStack()
    for frame in frames:
        running.add(frame)
    found = running.result()
    np.testing.assert_allclose(found.average, frames.mean(axis=0), rtol=1e-14)
    assert found.variance == pytest.approx(frames.var(axis=0, ddof=1).mean(), rel=1e-9)
    assert found.mean == pytest.approx(frames.mean())


def test_one_frame_is_no_stack():
    running = RunningStack()
    running.add(np.ones((3, 3)))
    with pytest.raises(ValueError, match="two frames"):
        running.result()


@pytest.mark.parametrize("frames", [4, 30])
def test_parts_are_recovered_whatever_the_number_of_frames(frames):
    """A variance of n draws is good to sqrt(2 / n); the temporal noise that is left in the mean
    adds its own share to the pixels'."""
    found = spatial_variance(stacked(pattern(np.random.default_rng(5)), frames))
    left = NOISE**2 / frames
    assert found.row == pytest.approx(ROW**2, rel=5 * math.sqrt(2 / ROWS))
    assert found.column == pytest.approx(COLUMN**2, rel=5 * math.sqrt(2 / COLUMNS))
    error = 5 * math.sqrt(2 / ROWS / COLUMNS) * (PIXEL**2 + left)
    assert found.pixel == pytest.approx(PIXEL**2, abs=error)
    assert found.total == pytest.approx(found.row + found.column + found.pixel, rel=1e-3)


def test_no_pattern_is_none():
    """What is left of the temporal noise is subtracted: 5 standard errors of it remain."""
    found = spatial_variance(stacked(np.zeros((ROWS, COLUMNS)), 16))
    error = 5 * math.sqrt(2 / ROWS / COLUMNS) * NOISE**2 / 16
    assert abs(found.total) < error
    assert abs(found.pixel) < error
    assert abs(found.row) < 0.1
    assert abs(found.column) < 0.1


def test_lattices_do_not_mix():
    """Two lattices of different means are two sensors, not one with a pattern."""
    rng = np.random.default_rng(6)
    both = np.stack([pattern(rng), 1000 + pattern(rng)])
    found = spatial_variance(stacked(both, 12))
    assert found.total == pytest.approx(ROW**2 + COLUMN**2 + PIXEL**2, rel=0.4)


def test_two_by_two_has_no_parts():
    found = spatial_variance(stacked(np.array([[0.0, 100], [300, 0]]), 500))
    assert found.total == found.pixel > 0
    assert found.row == found.column == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_a_line_of_pixels_has_no_rows_and_columns(shape):
    with pytest.raises(ValueError, match="no rows and columns"):
        spatial_variance(stacked(np.zeros(shape), 3))


def test_dsnu_and_prnu():
    dark, bright = SpatialVariance(16, 4, 1, 9), SpatialVariance(116, 40, 2, 0)
    d = dsnu(dark, 0.5)
    assert (d.total, d.row, d.column, d.pixel) == (8, 4, 2, 6)
    p = prnu(bright, dark, 200.0)
    assert (p.total, p.row, p.column) == pytest.approx((0.05, 0.03, 0.005))
    assert p.pixel == 0  # below nothing: statistics
