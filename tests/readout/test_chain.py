"""The readout chain: electrons to codes and back, and the variance at a level."""

import math

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli import simulate

NOISY = {
    "scene.radiance": "0 W/(sr m2)",
    "array.rows": 200,
    "array.columns": 200,
    "pixel.readout.read_noise": "2 e",
    "adc": {"bits": 14, "gain": "0.4 DN/e", "offset": "200 DN", "noise": "2 DN"},
}
CURVES = {
    "linear": {},
    "logarithmic": {"adc": {"bits": 12, "kind": "logarithmic", "offset": "50 DN"}},
    "curved": {
        "adc": {"bits": 12},
        "pixel.readout.transfer_curve": {
            "follower": {"table": {0.0: 0.0, 1.0: 0.9, 2.0: 1.0, 3.0: 2.0}},
            "reset_voltage": "3 V",
            "corrected": True,
        },
    },
    "added": {"array.binning": {"rows": 2, "columns": 2, "kind": "digital"}},
}


@pytest.mark.parametrize(("gain", "variance"), [(1, 4.7233), (4, 14.3233), (16, 167.9233)])
def test_variance_in_the_dark(gain: float, variance: float, tmp_path) -> None:
    """(K g r1)^2 + r2^2 + 1/12: K 0.4 DN/e, 2 e before the gain, 2 DN behind it."""
    chain = simulate(camera(tmp_path, NOISY | {"exposure.gain": gain})).frame.chain
    assert chain.variance_dn(0.0) == pytest.approx(variance, abs=1e-4)
    noise = chain.noise(0.0)
    assert noise.before_gain == pytest.approx(4)
    assert noise.behind_gain == pytest.approx((2 / (0.4 * gain)) ** 2)
    assert noise.rounding == pytest.approx(1 / 12 / (0.4 * gain) ** 2, rel=1e-6)
    assert chain.gain(0.0) == pytest.approx(0.4 * gain) == chain.system_gain


def test_variance_of_noise_that_multiplies(tmp_path) -> None:
    """Beside noise that adds, PRNU grows with the square of the signal, shot noise with it."""
    fpn = {"pixel.fpn": {"offset_pixel": "3 e", "gain_pixel": "2 %"}, "effects": "all"}
    lit = {"scene.radiance": radiance_for(5000), "adc.gain": "0.4 DN/e"}
    frame = simulate(camera(tmp_path, NOISY | fpn | lit)).frame
    mean = float(frame.mean_electrons.mean())
    assert frame.chain.pattern_variance(mean) == pytest.approx(9 + (0.02 * mean) ** 2)
    shot, pattern = frame.chain.noise(mean), frame.chain.pattern_variance(mean)
    total = shot.total + pattern
    assert shot.before_gain == pytest.approx(mean + 4)
    found = frame.dn.astype(float).var() / 0.4**2
    assert found == pytest.approx(total, rel=5 * math.sqrt(2 / frame.dn.size))


@pytest.mark.parametrize("kind", CURVES)
def test_codes_lead_back_to_electrons(kind: str, tmp_path) -> None:
    """The inverse of the curve, for the sum of added codes as well; 1e-6: a table's steps."""
    chain = simulate(camera(tmp_path, {"array.rows": 8, "array.columns": 8} | CURVES[kind]))
    chain = chain.frame.chain
    electrons = np.linspace(0.001, 0.9, 7) * chain.saturation * chain.summed_codes
    back = chain.to_electrons(chain.to_dn(electrons.copy()))
    np.testing.assert_allclose(back, electrons, rtol=1e-6, atol=1e-6 * chain.saturation)


def test_electrons_stay_below_the_well_whatever_the_adc_adds(tmp_path) -> None:
    """Noise of the ADC is in the codes alone: behind the well, and behind `electrons`."""
    full = {"scene.radiance": radiance_for(3e5), "adc.gain": "0.1 DN/e", "effects": "all"}
    frame = simulate(camera(tmp_path, NOISY | full)).frame
    assert frame.electrons.max() == frame.electrical.full_well
    assert frame.dn.std() == pytest.approx(2, rel=0.05)


def test_few_full_pixels_read_less_than_saturation(tmp_path) -> None:
    """Of the ADC's normal noise 1 in 741 is more than 3 standard deviations below its mean."""
    full = {
        "scene.radiance": radiance_for(1e6),
        "pixel.readout": {"full_well": "10 ke", "voltage_swing": "1 V"},
        "adc": {"bits": 12, "offset": "20 DN", "gain": "0.2 DN/e", "noise": "20 DN"},
        "array.rows": 200, "array.columns": 200, "effects": "all",
    }  # fmt: skip
    result = simulate(camera(tmp_path, full))
    below = int(np.sum(result.dn < result.frame.chain.saturated_dn))
    expected = result.dn.size * 0.00135
    assert below == pytest.approx(expected, abs=5 * math.sqrt(expected))
