"""Noise that quantization masks: no interval leaves the truth out."""

import math

import numpy as np
import pytest
from bare_sensor import BareSensor, bench, fitted
from making import long_except

from vcam_cli.quality import rounding

EIGHT_BITS = {"bits": 8, "black": (5.0,), "dark_current": 20.0, "dsnu": 3.0}
HIDDEN = [
    BareSensor(gain=0.0251, well=9e3, read_noise=6.0, **EIGHT_BITS),
    BareSensor(gain=0.05, well=4500, read_noise=4.0, **EIGHT_BITS),
    BareSensor(gain=0.25, read_noise=1.0, dark_current=20, dsnu=3),
    BareSensor(gain=0.25, read_noise=1.6, dark_current=20, dsnu=3),
]


@pytest.mark.parametrize("deviation", [0.0, 0.1, 0.2, 0.35, 0.5, 0.8])
def test_bounds_hold_at_any_mean(deviation):
    """Rounded normal numbers, drawn: their deviation and mean are within the bounds."""
    rng = np.random.default_rng(3)
    noise = deviation * rng.standard_normal(200_000)
    for mean in np.linspace(0, 1, 9):
        codes = np.rint(mean + noise)
        variance = float(codes.var())
        error = math.sqrt(2 / noise.size) * max(variance, 1e-3)
        low, high = rounding.deviations(variance, error)
        reach = 5 * error / max(2 * deviation, 0.1)
        assert low - reach <= deviation <= high + reach
        assert abs(codes.mean() - mean) <= rounding.mean_error(deviation) + 5e-3


def test_the_limit_is_that_of_the_standard():
    """Eq 54 of EMVA 1288 release 4.0: 0.40 DN below a variance of 0.24 DN^2."""
    low, high = rounding.deviations(0.0)
    assert low == 0
    assert high == pytest.approx(0.40, abs=0.005)


@pytest.mark.parametrize("sensor", long_except([HIDDEN[0], HIDDEN[3]], HIDDEN))
def test_intervals_hold_what_is_under_half_a_code(sensor, tmp_path):
    found = fitted(bench(sensor, tmp_path, side=96), tmp_path)
    named = {p.name: p for p in found.parameters}
    for name in ("read_noise", "offset_pixel", "dark_current", "black_level"):
        p = named[name]
        assert p.low <= sensor.truth[name] <= p.high, name
    if sensor.read_noise * sensor.gain < 0.35:
        limit = math.sqrt(0.24 - 1 / 12) / found.value("system_gain")
        assert named["read_noise"].value == pytest.approx(limit, rel=1e-6)
        assert "eq 54" in named["read_noise"].method
        assert "quantization masks the read noise" in " ".join(found.notes)
    gain = named["system_gain"]
    assert abs(gain.value - sensor.gain) < 5 / 1.645 * (gain.high - gain.value)


def test_noise_above_a_code_has_no_wider_interval(tmp_path):
    """Read noise of 1.5 DN: the interval is that of a chi-squared number and of the gain."""
    found = fitted(bench(BareSensor(), tmp_path, side=96), tmp_path)
    p = next(p for p in found.parameters if p.name == "read_noise")
    assert p.low <= 6 <= p.high
    assert p.high - p.low < 0.05 * p.value
    assert not any("rounding" in note for note in found.notes)
