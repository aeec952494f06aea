"""The shape of heavy tails by differences of frames, of frames that NumPy has drawn."""

import numpy as np
import pytest
from bare_sensor import BareSensor, bench, fitted

from vcam_cli.fitting.noise_shape import difference_counts, tail_shape


def told(shape, number, side=128, **changes):
    sensor = BareSensor(gain=0.6, well=6e3, read_noise=2.0, shape=shape, dsnu=3, **changes)
    rng = np.random.default_rng([5, number])
    frames = sensor.frames(number, (side, side), 1e-3, 0, 8, rng)
    counts = difference_counts(frames, np.ones((side, side), bool))
    return tail_shape(counts, 0.0, sensor.dark_current * 1e-3, sensor.gain)


@pytest.mark.parametrize(("shape", "current"), [(-0.16, 300.0), (-0.05, 3000.0), (0.05, 0.0)])
def test_the_shape_is_that_of_the_readout_alone(shape, current):
    """Rounding and the dark current's Poisson noise taken out: to five standard errors."""
    found = told(shape, 1, dark_current=current)
    assert abs(found.value - shape) < 5 * found.error
    assert 0.002 < found.error < 0.02


def test_a_fit_tells_heavy_tails(tmp_path):
    """Shape -0.12, 2 e, 0.6 DN/e: the interval is wider than that of normal noise."""
    sensor = BareSensor(gain=0.6, well=6e3, read_noise=2.0, shape=-0.12, dsnu=3)
    found = fitted(bench(sensor, tmp_path, side=96), tmp_path)
    p = next(p for p in found.parameters if p.name == "read_noise_shape")
    assert abs(p.value + 0.12) < 5 / 1.645 * (p.high - p.low) / 2
    assert "jackknife" in p.method


@pytest.mark.long
@pytest.mark.parametrize("shape", [-0.12, -0.05])
def test_intervals_of_the_shape_hold_the_truth(shape):
    """Of thirty 90 % intervals 23 or more hold; the mean is right to three of its errors."""
    found = [told(shape, number + 10) for number in range(30)]
    held = [abs(each.value - shape) <= 1.645 * each.error for each in found]
    values = np.array([each.value for each in found])
    assert sum(held) >= 23
    assert abs(values.mean() - shape) < 3 * values.std() / np.sqrt(30)
