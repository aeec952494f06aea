"""The closed forms beside the measurement, against sums and draws."""

import math

import numpy as np
import pytest

from vcam_cli.characterization.closed_form import clipped_variance, saturation_capacity


def test_variance_of_a_clipped_normal():
    """Against a sum over its density; without a limit it is the plain variance."""
    z = np.linspace(-9, 9, 200001)
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) * (z[1] - z[0])
    for mean in (80.0, 95.0, 100.0, 130.0):
        x = np.minimum(mean + 10 * z, 100.0)
        expected = density @ x**2 - (density @ x) ** 2
        assert float(clipped_variance(mean, 10.0, 100.0)) == pytest.approx(expected, rel=1e-6)
    assert float(clipped_variance(5.0, 10.0, 1e6)) == pytest.approx(100)


def test_saturation_point_of_drawn_frames():
    """The largest variance of pairs of half a million draws, unequal wells included: to 0.5 %."""
    rng = np.random.default_rng(4)
    pixel = rng.standard_normal(1 << 19)
    levels = np.linspace(8500, 10000, 61)
    variance = []
    for level in levels:
        mean = level * (1 + 0.01 * pixel)
        frames = mean + np.sqrt(mean + 25) * rng.standard_normal((2, pixel.size))
        variance.append(np.mean(np.diff(np.minimum(frames, 10000), axis=0) ** 2) / 2)
    found = saturation_capacity(10000, 0, 25, lambda m: (0.01 * m) ** 2)
    best = np.polyfit(levels, variance, 6)
    assert found == pytest.approx(levels[np.argmax(np.polyval(best, levels))], rel=0.005)
