"""The photon transfer on frames drawn with numpy: known gain, noise, efficiency and range."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.quality.photon_transfer import (
    Series,
    dark_signal,
    electrons_of_variance,
    linearity,
    pair_statistics,
    photon_transfer,
    sensitivity_threshold,
)

GAIN, DARK_NOISE, EFFICIENCY, WELL, OFFSET, SIDE = 0.37, 7.0, 0.62, 12000, 50, 300
PIXELS = SIDE * SIDE


def drawn(rng, electrons, gain=GAIN, noise=DARK_NOISE, fixed=0.0, offset=OFFSET):
    """A frame of so many mean electrons: Poisson, normal noise, a well, whole numbers."""
    charge = rng.poisson(electrons, (SIDE, SIDE)) + rng.normal(0, noise, (SIDE, SIDE)) + fixed
    return np.rint(np.minimum(charge, WELL) * gain + offset)


def measured(gain=GAIN, noise=DARK_NOISE, levels=None, fixed=0.0, offset=OFFSET):
    rng = np.random.default_rng(11)
    if levels is None:
        levels = WELL * np.concatenate([np.arange(1, 45) / 50, np.linspace(0.9, 1.06, 33)])
    told = [
        pair_statistics(*(drawn(rng, level, gain, noise, fixed, offset) for _ in "ab"))
        for level in (0, *levels)
    ]
    mean, variance = np.array(told).T
    return Series(levels / EFFICIENCY, mean[1:], variance[1:], mean[0], variance[0])


@pytest.fixture(scope="module")
def found():
    return photon_transfer(measured())


def test_gain(found):
    """Variances are good to sqrt(2 / pixels); a line through 0 weighs them by their signals."""
    x = found.series.signal[found.series.signal < 0.7 * WELL * GAIN]
    error = math.sqrt(2 / PIXELS) * math.sqrt(np.sum(x**4)) / np.sum(x**2)
    assert found.gain == pytest.approx(GAIN, rel=5 * error)


def test_efficiency_and_dark_noise(found):
    """As good as the gain, 0.1 %, and the dark's variance, sqrt(2 / pixels) / 2 = 0.24 %."""
    assert found.quantum_efficiency == pytest.approx(EFFICIENCY, rel=0.006)
    assert found.dark_noise == pytest.approx(DARK_NOISE, rel=0.015)


def test_saturation_is_where_the_variance_is_largest(found):
    """Some two standard deviations (1 %) of light below the well; levels lie 0.5 % apart."""
    assert found.saturation_capacity == pytest.approx(WELL - 2 * math.sqrt(WELL), rel=0.015)
    assert found.snr_max == math.sqrt(found.saturation_capacity)


def test_range_and_threshold(found):
    least = DARK_NOISE**2 + 1 / 12 / GAIN**2
    least = math.sqrt(least + 0.25) + 0.5
    assert found.threshold_electrons == pytest.approx(least, rel=0.015)
    assert found.threshold_photons == pytest.approx(least / EFFICIENCY, rel=0.02)
    expected = (WELL - 2 * math.sqrt(WELL)) / least
    assert found.dynamic_range == pytest.approx(expected, rel=0.03)


def test_signal_to_noise_is_that_of_the_model(found):
    """Eq 20 against eq 21: a level's noise is good to sqrt(1 / (2 pixels)) = 0.24 %."""
    inside = found.series.photons < 0.85 * found.saturation_photons

    def model(photons):  # 1/12: variance of rounding
        e = found.quantum_efficiency * photons
        return e / np.sqrt(found.dark_noise**2 + 1 / 12 / found.gain**2 + e)

    assert np.abs(found.series.snr[inside] / model(found.series.photons[inside]) - 1).max() < 0.02
    assert model(found.threshold_photons) == pytest.approx(1, rel=1e-12)
    e = 0.25 * WELL
    assert found.measured_snr(e) == pytest.approx(e / math.sqrt(e + DARK_NOISE**2), rel=0.015)


def test_pairs_know_no_fixed_pattern():
    pattern = np.random.default_rng(2).normal(0, 300, (SIDE, SIDE))
    flat, patterned = (
        measured(levels=np.array([4000.0]), fixed=f, offset=999) for f in (0, pattern)
    )
    assert patterned.variance[0] == pytest.approx(flat.variance[0], rel=5 * math.sqrt(4 / PIXELS))


def test_a_pair_by_hand():
    mean, variance = pair_statistics([[1, 2], [3, 4]], [[2, 2], [3, 9]])
    assert mean == (10 + 16) / 8
    assert variance == pytest.approx(((1 + 0 + 0 + 25) / 4 - (6 / 4) ** 2) / 2)
    assert pair_statistics([[5]], [[7]]) == (6, 0)  # one pixel: all of it may be the lamp's


@pytest.mark.parametrize("frames", [([[1, 2]], [[1], [2]]), ([], [])])
def test_no_pair(frames):
    with pytest.raises(ValueError, match="two frames of one shape"):
        pair_statistics(*frames)


def test_without_noise_in_the_dark_the_gain_holds_on_a_coarse_adc():
    """Dark frames all of one number: their variance of 0 is no floor of the others'.

    A free intercept makes the slope twice as uncertain as a line through 0: 5 x 0.25 %.
    """
    found = photon_transfer(measured(gain=0.02, noise=0.0))
    assert found.series.dark_variance == 0
    assert found.gain == pytest.approx(0.02, rel=0.0125)
    assert found.dark_noise == pytest.approx(0.40 / found.gain, rel=0.02)


@given(st.floats(0.24, 1e6), st.floats(1e-3, 1e3))
def test_dark_noise_undoes_gain_and_rounding(variance, gain):
    noise = electrons_of_variance(variance, gain)
    assert (noise * gain) ** 2 + 1 / 12 == pytest.approx(variance, rel=1e-12)


@given(st.floats(0, 1e8))
def test_at_the_threshold_signal_equals_noise(variance):
    e = sensitivity_threshold(variance)
    assert e / math.sqrt(variance + e) == pytest.approx(1, rel=1e-9)


def series(mean, variance=None, photons=None):
    mean = np.asarray(mean, float)
    variance = mean.copy() if variance is None else np.asarray(variance, float)
    return Series(np.arange(1.0, len(mean) + 1) if photons is None else photons, mean, variance,
                  0.0, 1.0)  # fmt: skip


def test_a_straight_line_has_no_error():
    found = linearity(series(np.arange(1, 101) * 3.0))
    assert found.error == pytest.approx(0, abs=1e-12)
    assert (found.slope, found.offset) == pytest.approx((3, 0), abs=1e-9)


def test_error_of_a_bent_response():
    """Against the weighted normal equations, written out (section 6 of the standard)."""
    x = np.arange(1, 101.0)
    y = x * (1 - 1e-3 * x)
    found = linearity(series(y))
    use = (y >= 0.05 * y.max()) & (y <= 0.95 * y.max())
    x, y = x[use], y[use]
    w = 1 / y**2
    normal = np.array([[np.sum(w * x * x), np.sum(w * x)], [np.sum(w * x), np.sum(w)]])
    slope, offset = np.linalg.solve(normal, [np.sum(w * x * y), np.sum(w * y)])
    off = (y - slope * x - offset) / (slope * x + offset)
    assert found.error == pytest.approx(np.abs(off).mean(), rel=1e-8)
    assert (found.min_deviation, found.max_deviation) == pytest.approx(
        (off.min(), off.max()), rel=1e-8
    )


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (series([1, 2]), "too few"),
        (series([10, 8, 6, 4, 2]), "too few"),
        (series(np.zeros(9)), "too few"),
        (series([1, 1, 1, 500]), "do not rise"),
    ],
)
def test_what_is_no_photon_transfer(bad, words):
    with pytest.raises(ValueError, match=words):
        photon_transfer(bad)


def test_linearity_needs_levels():
    with pytest.raises(ValueError, match="too few"):
        linearity(series([1, 1000, 1001]))


def test_snr_outside_the_levels(found):
    with pytest.raises(ValueError, match="no frames"):
        found.measured_snr(10 * WELL)


def test_dark_signal():
    times = np.array([0, 1, 2, 5])
    found = dark_signal(times, 40 + 3 * times)
    assert (found.current, found.offset) == pytest.approx((3, 40))
    with pytest.raises(ValueError, match="three"):
        dark_signal([1, 1, 2], [3, 3, 4])
