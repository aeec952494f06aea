"""Variances of pixels, rows and columns from numbers of NumPy's own, of known variances."""

import math

import numpy as np
import pytest

from vcam_cli.fitting.pattern import pattern
from vcam_cli.verification.stack_statistics import Estimate, stack_statistics

N, ROWS, COLUMNS = 8, 120, 100
PIXEL, ROW, COLUMN, OFFSET, OFFSET_COLUMN = 3.0, 1.5, 2.0, 5.0, 2.5


def drawn(seed: int) -> np.ndarray:
    """Frames of one sensor with all kinds of noise, and light that drifts."""
    rng = np.random.default_rng(seed)
    fixed = OFFSET * rng.standard_normal((ROWS, COLUMNS))
    fixed += OFFSET_COLUMN * rng.standard_normal(COLUMNS)
    frames = 500 + fixed + PIXEL * rng.standard_normal((N, ROWS, COLUMNS))
    frames += ROW * rng.standard_normal((N, ROWS, 1)) + COLUMN * rng.standard_normal(
        (N, 1, COLUMNS)
    )
    return frames + np.linspace(-20, 20, N)[:, None, None]


@pytest.fixture(scope="module")
def everything():
    """The statistics of forty sensors, of which some pixels do not work."""
    good = np.random.default_rng(9).random((ROWS, COLUMNS)) > 0.004
    out = []
    for seed in range(40):
        frames = drawn(seed)
        frames[:, ~good] = 4095
        told = stack_statistics(frames, good)
        out.append((told, pattern(told, good)))
    return out


@pytest.mark.parametrize(
    ("name", "known"),
    [("pixel", PIXEL**2), ("row", ROW**2), ("column", COLUMN**2), ("excess", 0.0)],
)
def test_temporal_noise_is_found_without_bias_and_with_its_error(everything, name, known):
    """Of forty sensors: the mean to five of its errors, the errors to five of theirs.

    0.4 % of the mean: pixels that do not work are few, and lines with them are a bit noisier.
    """
    found = [getattr(told, name) for told, _ in everything]
    _check(found, known, 0.004 * known)


@pytest.mark.parametrize(
    ("name", "known"), [("pixel", OFFSET**2), ("column", OFFSET_COLUMN**2), ("row", 0.0)]
)
def test_pattern_is_found_without_bias_and_with_its_error(everything, name, known):
    _check([getattr(told, name) for _, told in everything], known, 0.004 * known)


def _check(found: list[Estimate], known: float, slack: float) -> None:
    values = np.array([each.value for each in found])
    errors = np.array([each.error for each in found])
    reach = 5 * errors.mean() / math.sqrt(len(values))
    assert values.mean() == pytest.approx(known, abs=reach + slack)
    assert values.std(ddof=1) / errors.mean() == pytest.approx(1, abs=5 / math.sqrt(2 * 39))


def test_rows_that_resemble_their_neighbors():
    rng = np.random.default_rng(4)
    rows = np.empty((30, 400))
    rows[:, 0] = rng.standard_normal(30)
    for k in range(1, 400):
        rows[:, k] = 0.7 * rows[:, k - 1] + math.sqrt(1 - 0.49) * rng.standard_normal(30)
    frames = 2 * rows[:, :, None] + rng.standard_normal((30, 400, 60))
    told = stack_statistics(frames, np.ones((400, 60), bool))
    assert told.row_correlation.value == pytest.approx(0.7, abs=5 * math.sqrt(3 / (30 * 400)))


def test_kurtosis_of_a_short_stack_is_that_of_the_noise():
    """Residuals of three frames are nearer to normal than the noise: Laplace's has 3."""
    frames = np.random.default_rng(2).laplace(size=(3, 1000, 700))
    told = stack_statistics(frames, np.ones((1000, 700), bool))
    assert told.excess.value == pytest.approx(3, abs=0.1)


def test_pattern_of_two_noisy_frames_has_the_error_of_what_is_taken_out():
    """Noise of which half is left, nine times the pattern's variance: its own error is most."""
    found = []
    good = np.ones((ROWS, COLUMNS), bool)
    for seed in range(60):
        rng = np.random.default_rng([2, seed])
        frames = 500 + rng.standard_normal((ROWS, COLUMNS))
        frames = frames + 3 * math.sqrt(2) * rng.standard_normal((2, ROWS, COLUMNS))
        found.append(pattern(stack_statistics(frames, good), good).pixel)
    values, errors = (np.array([getattr(each, name) for each in found])
                      for name in ("value", "error"))  # fmt: skip
    assert values.mean() == pytest.approx(1, abs=5 * errors.mean() / math.sqrt(60))
    known = math.sqrt(2 * (10**2 + 9**2) / (ROWS * COLUMNS))
    assert errors.mean() == pytest.approx(known, rel=0.05)
    assert values.std(ddof=1) / known == pytest.approx(1, abs=5 / math.sqrt(2 * 59))
