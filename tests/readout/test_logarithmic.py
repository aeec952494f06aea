"""A logarithmic ADC from end to end: its codes, its black and white, and the picture behind it."""

import math

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate

LOG = {"adc": {"bits": 12, "kind": "logarithmic", "offset": "64 DN"}}
LINEAR = {"adc": {"bits": 12, "offset": "64 DN"}}
DAY = {
    "scene.source": {"kind": "chart", "chart": "colorchecker"},
    "scene.illuminant": "D65",
    "array.pattern": "bayer-rggb",
    "optics.transmittance": "ir-cut-650",
    "scene.radiance": "0.3 W/(sr m2)",
    "pixel.photodetector.dark_current": "20 ke/s",
    "processing": [
        {"black_level": "subtract"},
        {"demosaic": "bilinear"},
        {"white_balance": "gray-world"},
    ],
    "quality": ["mse"],
    "accuracy": "standard",
}
WELL = 1e5
SPAN = 4095 - 64


def code(electrons: float) -> float:
    """As it is defined, with the reference at a thousandth of full scale, which is the well."""
    return 64 + SPAN * math.log(1 + 1000 * electrons / WELL) / math.log(1001)


def test_codes_follow_from_electrons(tmp_path):
    changes = DAY | LOG | {"pixel.readout.read_noise": "300 e"}
    result = simulate(camera(tmp_path, changes))
    assert result.electrons.min() < 0, "noise below zero is part of this"
    # below -100 electrons the logarithm has no value, and the code is 0
    exact = [0 if e <= -100 else min(max(code(e), 0), 4095) for e in result.electrons.ravel()]
    assert np.abs(result.dn.ravel() - exact).max() <= 0.5 + 2e-3  # float32
    assert np.issubdtype(result.dn.dtype, np.unsignedinteger)
    np.testing.assert_allclose(result.volts, result.electrons * 20e-6, rtol=1e-6)


def test_black_and_white_are_codes(tmp_path):
    """What raw.exr says of its black level is what a dark pixel's code is."""
    dark = {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0}}
    result = simulate(camera(tmp_path, DAY | LOG | dark | {"effects": QUIET}))
    assert result.frame.black_dn == pytest.approx(code(20e3 * 0.01), rel=1e-12)
    assert np.all(result.dn == round(result.frame.black_dn))
    white = simulate(camera(tmp_path, DAY | LOG))
    electrons = (white.frame.white_rate + 20e3) * 0.01
    np.testing.assert_allclose(white.frame.white_dn, [code(e) for e in electrons], rtol=1e-9)


def test_the_picture_is_that_of_a_linear_adc(tmp_path):
    """Noise-free and finely coded, the curve is gone from the picture, the ideal, the metrics."""
    fine = {"effects": QUIET}
    straight = simulate(camera(tmp_path, DAY | fine | {"adc": LINEAR["adc"] | {"bits": 22}}))
    bent = simulate(camera(tmp_path, DAY | fine | {"adc": LOG["adc"] | {"bits": 22}}))
    # half a step of the linear one is 0.012 electrons of some 500 of white, times a gain of 1.3
    np.testing.assert_allclose(bent.linear, straight.linear, atol=1e-4)
    np.testing.assert_allclose(bent.ideal, straight.ideal, atol=1e-4)
    found, expected = dict(bent.metrics), straight.metrics
    of_the_steps = {
        "picture_snr_db",
        "gray_snr_db",
        "quantized_dynamic_range_db",
    }  # finer where it is dark
    for name in expected.keys() - of_the_steps:
        assert found[name] == pytest.approx(expected[name], rel=1e-3)
    assert all(found[name] > expected[name] for name in of_the_steps)
    assert not np.array_equal(bent.dn, straight.dn)


def test_without_any_step_it_is_linear_light_too(tmp_path):
    """A uniform gray of 18 %: 0.18 of white, plus the black that nobody took off."""
    gray = {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0.18}}
    changes = LOG | gray | {"scene.radiance": radiance_for(80_000), "effects": QUIET}
    linear = simulate(camera(tmp_path, changes)).linear
    offset = 64 / SPAN * WELL  # of the linear ADC, in electrons
    expected = (0.18 * 80_000 + offset) / (80_000 + offset)
    # half a step there is 14 400 x ln(1001) / 4031 / 2 = 12 electrons of 80 000
    np.testing.assert_allclose(linear, expected, atol=2e-4)


def test_a_black_level_in_numbers_is_a_code_of_this_adc(tmp_path):
    """The code of black given by hand does what `subtract` does."""
    result = simulate(camera(tmp_path, DAY | LOG | {"effects": QUIET}))
    steps = [{"black_level": result.frame.black_dn}, *DAY["processing"][1:]]
    again = simulate(camera(tmp_path, DAY | LOG | {"effects": QUIET, "processing": steps}))
    np.testing.assert_allclose(again.linear, result.linear, atol=1e-6)


def test_few_bits_see_the_shadows(tmp_path):
    """What it is for: eight bits, a hundredth of white; linear steps are 390 electrons."""
    gray = {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0.01}}
    step = {"processing": [{"black_level": "subtract"}]}
    common = gray | step | {"scene.radiance": radiance_for(90_000), "effects": QUIET}
    errors = [
        abs(float(simulate(camera(tmp_path, common | {"adc": adc})).linear[0, 0, 0]) / 0.01 - 1)
        for adc in ({"bits": 8}, {"bits": 8, "kind": "logarithmic"})
    ]
    # half a step: 195 of 900 electrons; (900 + 100) ln(1001) / 255 / 2 = 14 of 900
    assert errors[1] < 0.017 < errors[0] < 0.22
