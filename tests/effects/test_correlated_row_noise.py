"""Bands of rows: the same along a row, correlated down the array, with a known spectrum."""

import math
from functools import partial

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.effects.noise.correlated_row_noise import CorrelatedRowNoise
from vcam_cli.effects.signal_chain import Site
from vcam_cli.rng import stream


def sequence(correlation: float, rows: int, seed: int = 2) -> np.ndarray:
    site = Site(rows, 1, partial(stream, seed), partial(stream, seed), np.float64)
    return CorrelatedRowNoise(3.0, correlation).apply(np.zeros((rows, 1)), site)[:, 0]


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_correlation_falls_by_powers(correlation):
    """Bartlett: the error of an autocorrelation is at most sqrt((1 + r^2) / (1 - r^2) / n)."""
    n = 400_000
    x = sequence(correlation, n) / 3
    error = 5 * math.sqrt((1 + correlation**2) / (1 - correlation**2) / n)
    for lag in (1, 2, 7):
        assert np.mean(x[lag:] * x[:-lag]) == pytest.approx(correlation**lag, abs=2 * error)


def test_spectrum():
    """Mean periodogram of 2000 arrays in eight bands: each of chi squared numbers."""
    r, rows = 0.8, 256
    x = sequence(r, rows * 2000).reshape(2000, rows)
    power = (np.abs(np.fft.rfft(x * np.hanning(rows))) ** 2).mean(0) / (np.hanning(rows) ** 2).sum()
    f = np.fft.rfftfreq(rows)
    expected = 9 * (1 - r**2) / (1 - 2 * r * np.cos(2 * np.pi * f) + r**2)
    for band in np.array_split(np.arange(4, len(f)), 8):  # a window of 4 bins lies over the first
        assert power[band].sum() == pytest.approx(expected[band].sum(), rel=0.03)


def test_bands_run_through_all_blocks_of_a_frame(tmp_path):
    """Rows of a whole frame are one sequence, whatever the workers and the blocks of 64 rows."""
    given = {
        "array.rows": 150,
        "scene.radiance": radiance_for(500),
        "pixel.readout.correlated_row_noise": {"rms": "3 e", "correlation": 0.999},
        "effects": QUIET | {"correlated_row_noise": "on"},
    }
    made = camera(tmp_path, given)
    found = [simulate(made, workers) for workers in (1, 2)]
    noise = found[0].electrons - found[0].mean_electrons
    np.testing.assert_allclose(noise, np.broadcast_to(noise[:, :1], noise.shape), atol=1e-9)
    assert found[0].dn.tobytes() == found[1].dn.tobytes()
    # steps from row to row are normal of 3 sqrt(2 (1 - r)) = 0.134; between blocks, too
    assert np.abs(np.diff(noise[:, 0])).max() < 5 * 0.134


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_variance_of_rows_added_as_codes(rows):
    """Against the sum over the covariance matrix."""
    lags = np.abs(np.subtract.outer(np.arange(rows), np.arange(rows)))
    joined = Binning(rows=rows, columns=2, kind="digital")
    found = CorrelatedRowNoise(3.0, 0.7).binned_variance(100.0, 0.0, joined)
    assert found == pytest.approx(9 * (0.7**lags).mean(), rel=1e-12)
