"""What is special to each effect. What all of them hold is in test_battery.py.

Means are computed in 64 bits, so they are held to rounding unless a tolerance says why not; noise
to five standard errors of the sample.
"""

import math

import numpy as np
import pytest
from making import BOLTZMANN, CHARGE, GONE, QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.quantization import LogarithmicQuantization, Quantization
from vcam_cli.effects.noise.reset_noise import ResetNoise
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.off_axis import OffAxis
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.pixel.saturation import Saturation

QUIETLY = {"effects": QUIET}


def mean_of(folder, **changes) -> np.ndarray:
    return simulate(camera(folder, QUIETLY | changes)).mean_electrons


def grating(frequency: str, **more) -> dict:
    wave = {"kind": "chart", "chart": "sinusoid", "contrast": 1, "mean": 0.5}
    return {"scene.source": wave | {"frequency": frequency} | more}


# --- diffraction ---------------------------------------------------------------------------------


def test_diffraction_at_half_its_cutoff():
    """(2 / pi) (acos(1/2) - sqrt(3) / 4) = 0.3910; the cutoff is 1 / (lambda N (1 - m))."""
    lens = Diffraction(f_number=4.0, magnification=-0.25)
    cutoff = 1 / (550e-9 * 4 * 1.25)
    assert lens.cutoff(550e-9) == pytest.approx(cutoff, rel=1e-12)
    half = lens.otf(np.array([cutoff / 2]), 550e-9)[0]
    assert half == pytest.approx(2 / math.pi * (math.pi / 3 - math.sqrt(3) / 4), rel=1e-12)


def test_diffraction_removes_what_is_beyond_its_cutoff(tmp_path):
    """f/8 at 550 nm cuts off at 226 lp/mm: 250 lp/mm leaves plain gray, without the lens it folds.

    A small photodetector, so that its own blur leaves something to see.
    """
    fine = grating("250 lp/mm") | {"optics.f_number": 8, "pixel.photodetector.fill_factor": 0.04}
    blurred = mean_of(tmp_path, **fine)
    np.testing.assert_allclose(blurred, blurred.mean(), rtol=1e-12)
    sharp = mean_of(tmp_path, **fine, **{"optics.diffraction": False})
    assert np.ptp(sharp) > 0.5 * sharp.mean()


# --- pixel aperture ------------------------------------------------------------------------------


def test_aperture_is_blind_to_its_own_width(tmp_path):
    """A photodetector 4 um wide averages waves of 4 um away, and not those of 4 um the other way.

    Pixels of 5 um sample 250 lp/mm as 50 lp/mm, which is what then is left of it.
    """
    sizes = {
        "pixel.photodetector.fill_factor": GONE,
        "pixel.photodetector.width": "4 um",
        "pixel.photodetector.height": "2 um",
        "optics.diffraction": False,
    }
    across = mean_of(tmp_path, **grating("250 lp/mm"), **sizes)
    np.testing.assert_allclose(across, across.mean(), rtol=1e-10)
    down = mean_of(tmp_path, **grating("250 lp/mm", orientation="90 deg"), **sizes)
    # phases of 250 lp/mm at multiples of 5 um are 90 degrees apart, 45 of them at the center
    modulation = np.ptp(down) / 2 / down.mean()
    assert modulation == pytest.approx(np.sinc(250e3 * 2e-6) * math.sqrt(0.5), rel=1e-9)


def test_a_photodetector_off_center_sees_the_wave_elsewhere(tmp_path):
    """Moved 1 um to the right and 0.5 um down, it sees what lies there: the phase, not the blur."""
    moved = {
        "pixel.photodetector.fill_factor": GONE,
        "pixel.photodetector.width": "2 um",
        "pixel.photodetector.height": "2 um",
        "pixel.photodetector.x": "2.5 um",
        "pixel.photodetector.y": "2 um",
    }
    centered = moved | {"pixel.photodetector.x": "1.5 um", "pixel.photodetector.y": "1.5 um"}
    found = mean_of(tmp_path, **grating("40 lp/mm"), **moved)
    shift = f"{360 * 40e3 * 1e-6} deg"
    expected = mean_of(tmp_path, **grating("40 lp/mm", phase=shift), **centered)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_aperture_has_the_size_of_the_photodetector(tmp_path):
    made = camera(tmp_path, {"pixel.height": "4 um", "pixel.photodetector.fill_factor": 0.25})
    assert PixelAperture.from_camera(made, geometry(made)) == PixelAperture(2.5e-6, 2e-6)


# --- off-axis ------------------------------------------------------------------------------------


def lens(model: str, tan2_cone: float, reach: float = 1e-3, distance: float = 1e-3) -> OffAxis:
    return OffAxis(model, tan2_cone, distance, half_width=reach, half_height=0.0)


def printed(a: float, b: np.ndarray) -> np.ndarray:
    """Eq 2.22 over its value on the axis, as printed, with a = tan^2 theta, b = tan^2 phi."""
    a, b = np.longdouble(a), np.asarray(b, np.longdouble)

    def disk(b):
        return 1 - (1 - a + b) / np.sqrt(b**2 + 2 * b * (1 - a) + (1 + a) ** 2)

    return np.asarray(disk(b) / disk(np.longdouble(0)), float)


@pytest.mark.parametrize("f_number", [1.2, 4.0, 16.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_off_axis_exact_over_the_whole_field(f_number, dtype):
    """Out to 60 degrees. 64 bits: the printed form loses 1e-13 of its own; 32 bits: a polynomial
    good to 1e-7, evaluated at positions rounded to 6e-8, or the exact form rounded at the end."""
    effect = lens("exact", 1 / (2 * f_number) ** 2, reach=math.tan(math.radians(60)) * 1e-3)
    x = np.linspace(-effect.corner, effect.corner, 101, dtype=dtype)
    gain = effect.gain(x, np.zeros(1, dtype))[0]
    expected = printed(effect.tan2_cone, (x.astype(float) / 1e-3) ** 2)
    np.testing.assert_allclose(gain, expected, atol=1e-12 if dtype == np.float64 else 5e-7)
    assert np.array_equal(gain, effect.gain(-x, np.zeros(1, dtype))[0])


def test_off_axis_is_cos4_for_a_small_pupil_and_more_for_a_wide_one():
    x = np.linspace(0, 1e-3, 11)
    cos4 = lens("cos4", 1e-6).gain(x, np.zeros(1))[0]
    np.testing.assert_allclose(cos4, np.cos(np.arctan(x / 1e-3)) ** 4, rtol=1e-12)
    # the next term is of the order of tan^2 theta
    np.testing.assert_allclose(lens("exact", 1e-6).gain(x, np.zeros(1))[0], cos4, rtol=3e-6)
    wide = lens("exact", 1 / 2.4**2).gain(x[1:], np.zeros(1))[0]
    assert np.all(np.abs(wide / cos4[1:] - 1) > 1e-5)


def test_off_axis_goes_with_the_distance_from_the_axis():
    effect = lens("exact", 0.02)
    gain = effect.gain(np.array([0.0, 3e-4, 5e-4]), np.array([0.0, 4e-4]))
    assert gain[1, 1] == pytest.approx(gain[0, 2], rel=1e-12)  # 3, 4, 5
    assert np.array_equal(gain, effect.gain(np.array([0.0, -3e-4, -5e-4]), np.array([0.0, -4e-4])))


@pytest.mark.parametrize("half_angle", [10, 45, 80])
def test_off_axis_bound_holds_for_wide_lenses(half_angle, tmp_path):
    """Leaving the falloff out changes a white scene's rms by at most what the effect says.

    And not by much less, for this is the scene it is the bound of.
    """
    tangent = math.tan(math.radians(half_angle))
    diagonal = 5e-6 * math.hypot(48, 64)
    wide = {
        "optics": {"f_number": 2, "focal_length": f"{diagonal / 2 / tangent!r} m"},
        "scene.distance": "infinity",
    }
    made = camera(tmp_path, QUIETLY | wide | {"optics.off_axis": "exact"})
    falling = simulate(made).mean_electrons
    level = mean_of(tmp_path, **wide, **{"optics.off_axis": "none"})
    change = float(np.sqrt(np.mean((falling - level) ** 2)))
    bound = OffAxis.from_camera(made, geometry(made)).mean_error(
        SignalLevels(float(level.max()), 0.01)
    )
    assert 0.99 * bound <= change <= bound


# --- dark current --------------------------------------------------------------------------------


def dark_electrons(folder, **detector) -> float:
    keys = {f"pixel.photodetector.{name}": value for name, value in detector.items()}
    changes = keys | {"scene.source.reflectance": 0, "exposure.time": "1 s"}
    mean = mean_of(folder, **changes)
    assert np.ptp(mean) == 0
    return float(mean[0, 0])


def test_dark_current_from_a_density(tmp_path):
    """1 nA/cm2 = 1e-5 A/m2 over half of 25 um2, divided by q: 780 electrons a second."""
    expected = 1e-5 * 12.5e-12 / CHARGE
    found = dark_electrons(tmp_path, dark_current_density="1 nA/cm2")
    assert found == pytest.approx(expected, rel=1e-12)
    assert found == pytest.approx(780.2, rel=1e-4)
    scaled = dark_electrons(tmp_path, dark_current_density="1 nA/cm2", dark_current_scale=10)
    assert scaled == pytest.approx(10 * expected, rel=1e-12)


def test_dark_current_of_the_pixel_is_taken_as_it_is(tmp_path):
    assert dark_electrons(tmp_path, dark_current="12 e/s", fill_factor=0.1) == 12
    assert dark_electrons(tmp_path, dark_current="12 e/s", dark_current_scale=0.5) == 6
    assert dark_electrons(tmp_path, dark_current="12 e/s", dark_current_scale=0) == 0


@pytest.mark.parametrize(("temperature", "factor"), [("300 K", 1), ("316 K", 4), ("292 K", 0.5)])
def test_dark_current_doubles_every_eight_kelvin(temperature, factor, tmp_path):
    density = {"value": "1 nA/cm2", "temperature": "300 K", "doubling": "8 K"}
    changes = {
        "pixel.photodetector.dark_current_density": density,
        "pixel.temperature": temperature,
        "scene.source.reflectance": 0,
        "exposure.time": "1 s",
    }
    found = float(mean_of(tmp_path, **changes)[0, 0])
    assert found == pytest.approx(factor * 1e-5 * 12.5e-12 / CHARGE, rel=1e-9)


def test_dark_current_makes_shot_noise(tmp_path):
    """Without any light the variance is the number of dark electrons: 400 in 3072 pixels."""
    dark = {
        "scene.source.reflectance": 0,
        "pixel.photodetector.dark_current": "40 ke/s",
    }
    found = simulate(camera(tmp_path, dark)).electrons
    n = found.size
    assert found.mean() == pytest.approx(400, abs=5 * math.sqrt(400 / n))
    assert found.var() == pytest.approx(400, rel=5 * math.sqrt((2 + 1 / 400) / n))


# --- shot noise ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "skewness"), [("exact", 1 / math.sqrt(25)), ("gaussian", 0)])
def test_shot_noise_is_poisson_or_as_asked_gaussian(model, skewness, tmp_path):
    """Poisson counts are whole and skewed by 1 / sqrt(m); the standard error of a skewness is
    sqrt(6 / n) for normal numbers, hardly more for these."""
    changes = {
        "scene.radiance": radiance_for(25),
        "array.rows": 200,
        "array.columns": 500,
        "accuracy": {"preset": "reference", "shot_noise": model},
    }
    found = simulate(camera(tmp_path, changes)).electrons
    whole = np.array_equal(found, np.rint(found))
    assert whole == (model == "exact")
    third = np.mean((found - found.mean()) ** 3) / found.std() ** 3
    assert third == pytest.approx(skewness, abs=6 * math.sqrt(6 / found.size))


def test_shot_noise_is_new_in_every_pixel(tmp_path):
    """Neighbors, and pixels 64 rows apart (the next block of rows), are not correlated."""
    changes = {"scene.radiance": radiance_for(2500), "array.rows": 256}
    noise = simulate(camera(tmp_path, changes)).electrons - 2500
    for shift in ((0, 1), (1, 0), (64, 0), (128, 0)):
        other = np.roll(noise, shift, (0, 1))
        correlation = float(np.mean(noise * other) / noise.var())
        assert abs(correlation) < 5 / math.sqrt(noise.size)


# --- fixed pattern -------------------------------------------------------------------------------


def fixed_only(folder, electrons: float, **fpn) -> np.ndarray:
    """Deviation from the mean by fixed-pattern noise alone [electrons]."""
    changes = {
        "pixel.fpn": fpn,
        "scene.radiance": radiance_for(electrons),
        "array.rows": 150,
        "effects": QUIET | {"fpn": "on"},
    }
    result = simulate(camera(folder, changes))
    return result.electrons - result.mean_electrons


def test_column_offsets_run_down_the_whole_array(tmp_path):
    """The same in all three blocks of rows, and not in two columns."""
    noise = fixed_only(tmp_path, 500, offset_column="3 e")
    assert np.array_equal(noise, np.broadcast_to(noise[0], noise.shape))
    assert len(np.unique(noise[0])) == 64


def test_pixel_offsets_differ_between_blocks(tmp_path):
    noise = fixed_only(tmp_path, 500, offset_pixel="3 e")
    assert not np.any(noise[:22] == noise[64:86])
    assert not np.any(noise[:22] == noise[128:])


def test_offsets_do_not_depend_on_the_light_and_gains_go_with_it(tmp_path):
    offsets = {"offset_pixel": "3 e", "offset_column": "2 e"}
    gains = {"gain_pixel": "1 %", "gain_column": "2 %"}
    dim, bright = (fixed_only(tmp_path, e, **offsets) for e in (100, 10_000))
    np.testing.assert_allclose(dim, bright, atol=1e-9)  # rounding of numbers near 10 000
    dim, bright = (fixed_only(tmp_path, e, **gains) for e in (100, 10_000))
    np.testing.assert_allclose(100 * dim, bright, atol=1e-9)


def test_the_four_parts_have_patterns_of_their_own(tmp_path):
    """Equal strengths, but no two patterns alike: correlations of independent numbers."""
    pixel = fixed_only(tmp_path, 100, offset_pixel="1 e"), fixed_only(tmp_path, 100, prnu="1 %")
    column = (
        fixed_only(tmp_path, 100, offset_column="1 e")[0],
        fixed_only(tmp_path, 100, gain_column="1 %")[0],
    )
    for a, b in (pixel, column):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 5 / math.sqrt(a.size)


def test_variance_of_the_fixed_pattern_adds_up():
    effect = FixedPattern(3.0, 4.0, 0.01, 0.02)
    assert effect.variance(0) == 25
    assert effect.variance(1000) == pytest.approx(25 + 1e6 * (1e-4 + 4e-4))


# --- reset noise ---------------------------------------------------------------------------------


def reset(folder, **changes) -> ResetNoise:
    made = camera(folder, changes)
    return ResetNoise.from_camera(made, geometry(made))


def test_reset_noise_of_five_femtofarads(tmp_path):
    """sqrt(k T C) / q with 5 fF at 300 K is 28.4 electrons, and goes with sqrt(T C)."""
    ktc = {
        "pixel.readout": {"voltage_swing": "1 V", "reset_noise": "ktc"},
        "pixel.photodetector.capacitance": "5 fF",
    }
    expected = math.sqrt(BOLTZMANN * 300 * 5e-15) / CHARGE
    assert expected == pytest.approx(28.4, abs=0.05)
    assert reset(tmp_path, **ktc).electrons == pytest.approx(expected, rel=1e-12)
    cold = reset(tmp_path, **ktc, **{"pixel.temperature": "75 K"})
    assert cold.electrons == pytest.approx(expected / 2, rel=1e-12)


def test_reset_noise_of_the_capacitance_behind_a_conversion_gain(tmp_path):
    """20 uV/e is q / C with C = 8 fF."""
    found = reset(tmp_path, **{"pixel.readout.reset_noise": "ktc"}).electrons
    expected = math.sqrt(BOLTZMANN * 300 * CHARGE / 20e-6) / CHARGE
    assert found == pytest.approx(expected, rel=1e-12)


def test_reset_noise_given_or_none(tmp_path):
    assert reset(tmp_path, **{"pixel.readout.reset_noise": "12 e"}) == ResetNoise(12.0)
    assert reset(tmp_path, **{"pixel.readout.reset_noise": "none"}) is None


# --- read noise ----------------------------------------------------------------------------------


@pytest.mark.parametrize("electrons", [0.0, 5000.0])
def test_read_noise_does_not_depend_on_the_signal(electrons, tmp_path):
    changes = {
        "pixel.readout.read_noise": "9 e",
        "effects": QUIET | {"read_noise": "on"},
        "scene.radiance": radiance_for(5000),
        "scene.source.reflectance": electrons / 5000,
    }
    found = simulate(camera(tmp_path, changes)).electrons
    assert found.mean() == pytest.approx(electrons, abs=5 * 9 / math.sqrt(found.size))
    assert found.std() == pytest.approx(9, rel=5 / math.sqrt(2 * found.size))


# --- saturation ----------------------------------------------------------------------------------


def test_saturation_clips_above_and_never_below():
    well = Saturation(1000.0)
    found = well.apply(np.array([-5.0, 0.0, 999.5, 1000.0, 1e9]))
    assert found.tolist() == [-5, 0, 999.5, 1000, 1000]


def test_noise_does_not_lift_a_full_well(tmp_path):
    """Read noise comes before the clip: nothing exceeds the well, however noisy."""
    changes = {
        "scene.radiance": radiance_for(99_900),
        "pixel.readout.read_noise": "500 e",
    }
    found = simulate(camera(tmp_path, changes)).electrons
    assert found.max() == 100_000
    assert 0.3 < np.mean(found == 100_000) < 0.6


# --- quantization --------------------------------------------------------------------------------


def test_quantization_rounds_to_the_nearest_code_and_clips():
    adc = Quantization(offset=10.0, electrons_per_dn=4.0, bits=8)
    electrons = np.array([-1e6, -40.0, 0.0, 1.9, 2.1, 400.0, 980.0, 1e6])
    assert adc.apply(electrons).tolist() == [0, 0, 10, 10, 11, 110, 255, 255]
    assert adc.response(electrons)[1] == 0


def test_quantization_switched_off_still_writes_codes(tmp_path):
    """What a file calls raw holds codes, whatever `effects` says."""
    changes = {"scene.radiance": radiance_for(900)}
    on = simulate(camera(tmp_path, changes))
    off = simulate(camera(tmp_path, changes | {"effects": {"quantization": "off"}}))
    assert np.issubdtype(off.dn.dtype, np.integer)
    assert np.array_equal(on.dn, off.dn)


BEND, FULL = 50.0, 20_000.0  # electrons


def by_hand(electrons: float, offset: float, bits: int) -> float:
    """The logarithmic code, as it is defined, before rounding and clipping."""
    span = 2**bits - 1 - offset
    return offset + span * math.log(1 + electrons / BEND) / math.log(1 + FULL / BEND)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("offset", "bits"), [(0.0, 8), (64.0, 12), (3.5, 10)])
def test_a_logarithmic_code_is_the_formula(offset, bits, dtype):
    """Noise below zero included; float32 may round a half the other way, not more."""
    adc = LogarithmicQuantization(offset, BEND, FULL, bits)
    electrons = np.array([-49.0, -20.0, -0.3, 0.0, 0.3, 7.0, 50.0, 1234.5, 2e4, 3e4], dtype)
    exact = np.array([by_hand(float(e), offset, bits) for e in electrons])
    np.testing.assert_allclose(adc.response(electrons.copy()), exact, rtol=2e-6, atol=2e-3)
    codes = adc.apply(electrons.copy())
    assert codes.dtype == dtype
    assert np.abs(codes - np.clip(exact, 0, 2**bits - 1)).max() <= 0.5 + 2e-3
    assert codes[-2] == codes[-1] == 2**bits - 1
    assert codes[3] == np.rint(offset)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_logarithm_of_nothing_is_code_zero(dtype):
    """From -bend on the formula has no value; no warning, whatever the offset."""
    adc = LogarithmicQuantization(254.0, BEND, FULL, 8)
    assert adc.apply(np.array([-50.0, -51.0, -1e9], dtype)).tolist() == [0, 0, 0]
    assert adc.apply(np.array([1e12, 1e30], dtype)).tolist() == [255, 255]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_logarithmic_codes_are_made_linear_again(dtype):
    """The numbers of a linear ADC of the same offset and full scale."""
    adc, straight = (
        LogarithmicQuantization(16.0, BEND, FULL, 12),
        Quantization(16.0, FULL / (4095 - 16), 12),
    )
    electrons = np.array([-40.0, 0.0, 1.0, 300.0, 2e4, 5e4], dtype)
    back = adc.linear(adc.response(electrons))
    assert back.dtype == dtype
    np.testing.assert_allclose(back, straight.response(electrons), rtol=5e-6, atol=1e-4)
    codes = np.array([0.0, 16.0, 4095.0], dtype)
    assert np.array_equal(straight.linear(codes), codes)


def test_a_bend_far_above_full_scale_is_a_linear_adc():
    """ln(1 + x) is x for small x: here to 1e-6 of it."""
    bent = LogarithmicQuantization(10.0, 1e12, 1020.0, 8)
    straight = Quantization(10.0, 1020 / 245, 8)
    electrons = np.linspace(-30.0, 1100, 500)
    np.testing.assert_allclose(bent.response(electrons), straight.response(electrons), rtol=1e-6)


def test_which_adc_the_camera_has(tmp_path):
    """Full scale is the well; the bend is a thousandth of it, or where the file says."""
    adc = {"bits": 12, "kind": "logarithmic", "offset": "8 DN"}
    found = Quantization.from_camera(made := camera(tmp_path, {"adc": adc}), geometry(made))
    assert isinstance(found, LogarithmicQuantization)
    assert (found.offset, found.bits) == (8, 12)
    assert found.full == pytest.approx(1e5, rel=1e-12)
    assert found.bend == pytest.approx(100, rel=1e-12)
    changes = {"adc": adc | {"reference": "4 mV", "full_scale": "1 V"}}
    found = Quantization.from_camera(made := camera(tmp_path, changes), geometry(made))
    assert found.full == pytest.approx(1 / 20e-6, rel=1e-12)
    assert found.bend == pytest.approx(4e-3 / 20e-6, rel=1e-12)
    assert "4096 codes" in found.describe()
    assert "e per step" in found.describe()
