"""ISO speed and gain: what saturates at which light, and the noise that a gain leaves.

Closed forms are written out from the definitions of ISO 12232 and EMVA 1288 and from constants of
nature; of the package only the daylight's table and the eye's response are taken.
"""

import math

import numpy as np
import pytest
from making import GONE, LIGHT, PLANCK, QUIET, camera, radiance_for

from vcam_cli import load, simulate
from vcam_cli.errors import BadInput
from vcam_cli.spectra import cmf, illuminant

WELL, BITS, FILL, EFFICIENCY, WIDTH = 100_000, 12, 0.5, 0.5, 5e-6  # of the plain camera
NOISELESS = {"effects": QUIET, "adc.offset": "0 DN"}
WAVELENGTH = np.arange(380.0, 780.01, 0.05) * 1e-9


def electrons_per_lux_second() -> float:
    """Of the plain camera's pixel in daylight, by sums over a fine grid."""
    light = illuminant("D55").evaluate(WAVELENGTH)
    lux = 683 * np.trapezoid(light * cmf()[1].evaluate(WAVELENGTH), WAVELENGTH)
    photons = np.trapezoid(light * WAVELENGTH / (PLANCK * LIGHT), WAVELENGTH)
    return float(photons / lux * WIDTH**2 * FILL * EFFICIENCY)


def metric(result, name: str) -> float:
    return result.metrics[name]


def test_base_iso_is_78_over_the_exposure_that_saturates(tmp_path) -> None:
    """78 lx s over the exposure that fills the well; 1e-6 is the sum's error over knots."""
    found = metric(simulate(camera(tmp_path)), "base_iso")
    assert found == pytest.approx(78 / (WELL / electrons_per_lux_second()), rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "factor"),
    [
        ({"scene.radiance": "7 W/(sr m2)", "scene.illuminant": "A"}, 1),
        ({"optics.transmittance": 0.5, "optics.f_number": 8}, 1),
        ({"exposure.gain": 4}, 1),
        ({"pixel.readout.gain": 4}, 1),
        ({"pixel.readout.full_well": "50 ke"}, 2),
        ({"adc.gain": f"{2 * 4095 / WELL!r} DN/e"}, 2),  # the ADC is full at half the well
        ({"adc.gain": f"{0.5 * 4095 / WELL!r} DN/e"}, 1),  # the well is full first
        ({"pixel.photodetector.quantum_efficiency": 0.25}, 0.5),
        ({"array.binning": {"rows": 2, "columns": 2, "kind": "charge"}}, 4),
        ({"array.binning": {"rows": 2, "columns": 2, "kind": "digital"}}, 1),
    ],
)
def test_base_iso_is_of_the_sensor(changes, factor, tmp_path) -> None:
    """Scene, lens and gain change nothing; what fills the pixel earlier raises it."""
    plain = metric(simulate(camera(tmp_path)), "base_iso")
    found = metric(simulate(camera(tmp_path, changes)), "base_iso")
    assert found == pytest.approx(factor * plain, rel=1e-6)


@pytest.mark.parametrize("iso", [100, 800, 3200])
def test_an_iso_speed_saturates_at_78_over_it(iso: float, tmp_path) -> None:
    """White of daylight that puts 78 / ISO lx s on the sensor has the last code, and no more."""
    scene = {"scene.illuminant": "D55", "scene.radiance": GONE, "exposure.iso": iso}
    working = 4 * 1.0 / (1.0 - 5e-3)  # f/4 at 1 m
    lux = 78 / iso / 0.01
    luminance = lux / math.pi * (1 + 4 * working**2)

    def codes(share: float) -> np.ndarray:
        level = {"scene.luminance": f"{share * luminance!r} cd/m2"}
        return simulate(camera(tmp_path, NOISELESS | scene | level)).dn

    assert np.all(codes(1 + 2 / 4095) == 4095)
    assert np.all(codes(0.4) == round(0.4 * 4095))
    assert np.all(codes(1 - 2 / 4095) < 4095)


def test_electrons_per_code_fall_with_the_gain(tmp_path) -> None:
    def step(gain: float) -> float:
        made = camera(tmp_path, {"exposure.gain": gain})
        return simulate(made).frame.electrical.electrons_per_dn

    assert step(1) == pytest.approx(WELL / 4095, rel=1e-12)
    assert step(8) == pytest.approx(WELL / 4095 / 8, rel=1e-12)


@pytest.mark.parametrize("key", ["adc.full_scale", "adc.gain"])
def test_gain_acts_behind_a_given_full_scale(key: str, tmp_path) -> None:
    """`full_scale` is in volts at the ADC, `adc.gain` in codes at gain 1."""
    given = {"adc.full_scale": "1 V", "adc.gain": "0.02 DN/e"}[key]
    one = simulate(camera(tmp_path, {key: given})).frame.electrical.electrons_per_dn
    four = simulate(camera(tmp_path, {key: given, "exposure.gain": 4})).frame.electrical
    assert four.electrons_per_dn == pytest.approx(one / 4, rel=1e-12)


def test_gain_acts_before_a_logarithmic_adc(tmp_path) -> None:
    """dn = 4095 ln(1 + g v / v0) / ln(1 + v_full / v0), with v0 a thousandth of full scale."""
    for gain in (1, 4):
        keys = {"adc.kind": "logarithmic", "exposure.gain": gain}
        light = {"scene.radiance": radiance_for(10_000)}
        dn = simulate(camera(tmp_path, NOISELESS | keys | light)).dn
        expected = 4095 * math.log1p(1000 * gain * 0.1) / math.log1p(1000)
        assert np.all(dn == round(expected))


@pytest.mark.parametrize("iso", [200, 800, 3200, 12800])
def test_noise_against_iso(iso: float, tmp_path) -> None:
    """sigma^2 = K^2 (signal + read^2) + 1/12 in codes, within 5 standard errors of a variance.

    The light is that of a tenth of saturation at each speed.
    """
    read, offset = 9.0, 200
    full = 78 / iso * electrons_per_lux_second()
    signal = 0.1 * full
    keys = {
        "exposure.iso": iso,
        "pixel.readout.read_noise": f"{read} e",
        "adc.offset": f"{offset} DN",
        "scene.radiance": radiance_for(signal),
        "array.rows": 200,
        "array.columns": 300,
    }
    dn = simulate(camera(tmp_path, keys)).dn.astype(float)
    gain = (4095 - offset) / full
    variance = gain**2 * (signal + read**2) + 1 / 12
    count = dn.size
    assert abs(dn.mean() - offset - gain * signal) < 5 * math.sqrt(variance / count)
    # Fourth moment of a Poisson number plus a normal one: 3 v^2 + signal, in electrons.
    spread = math.sqrt((2 * variance**2 + gain**4 * signal) / count)
    assert abs(dn.var() - variance) < 5 * spread


def test_automatic_exposure_takes_the_time_first(tmp_path) -> None:
    """It would take 180 ms for white: at most 50 ms, then a gain of 3.6, or of 2 at most."""
    light = {"exposure.time": GONE, "scene.radiance": radiance_for(5000, 0.01)} | NOISELESS

    def frame(**auto):
        return simulate(camera(tmp_path, light | {"exposure.auto": auto})).frame

    free, long = frame(max="1 s", max_gain=16), frame(max="50 ms")
    some, most = frame(max="50 ms", max_gain=16), frame(max="50 ms", max_gain=2)
    settings = [(f.exposure_time, f.camera.exposure_gain, f.exposure_limit) for f in
                (free, long, some, most)]  # fmt: skip
    assert settings == [
        (pytest.approx(0.18), 1, ""),
        (0.05, 1, "longest time"),
        (0.05, pytest.approx(3.6), ""),
        (0.05, 2, "largest gain"),
    ]
    assert np.all(some.dn == round(0.9 * 4095))


def test_compensation_is_in_powers_of_two(tmp_path) -> None:
    light = {"exposure.time": GONE, "scene.radiance": radiance_for(5000, 0.01)} | NOISELESS
    for stops in (-2, 0, 0.1):
        keys = {"exposure.auto": {"max": "1 s"}, "exposure.compensation": f"{stops} EV"}
        assert simulate(camera(tmp_path, light | keys)).exposure_time == pytest.approx(
            0.18 * 2**stops
        )


def test_an_iso_speed_with_automatic_exposure_is_priority_of_iso(tmp_path) -> None:
    light = {"exposure.time": GONE, "scene.radiance": radiance_for(5000, 0.01)} | NOISELESS
    base = metric(simulate(camera(tmp_path)), "base_iso")
    keys = {"exposure.auto": {"max": "1 s"}, "exposure.iso": 4 * base}
    frame = simulate(camera(tmp_path, light | keys)).frame
    assert frame.exposure_time == pytest.approx(0.18 / 4)
    assert frame.camera.exposure_gain == pytest.approx(4)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"exposure.gain": 2, "exposure.iso": 800}, "exposure.iso"),
        ({"exposure.compensation": "1 EV"}, "exposure.compensation"),
        (
            {"exposure.time": GONE, "exposure.gain": 4, "exposure.auto": {"max_gain": 2}},
            "exposure.auto.max_gain",
        ),
        (
            {"exposure.time": GONE, "exposure.iso": 1e6, "exposure.auto": {"max_gain": 2}},
            "exposure.iso",
        ),
        (
            {"pixel.photodetector.quantum_efficiency": 0, "exposure.iso": 800},
            "exposure.iso",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(changes, path, tmp_path) -> None:
    with pytest.raises(BadInput, match=path.replace(".", r"\.")):
        simulate(camera(tmp_path, changes))


def test_a_shipped_camera_at_an_iso_speed() -> None:
    """The frame of a file is that of its camera at base ISO, to the last bit."""
    small = ["array.rows=24", "array.columns=32"]
    plain = simulate(load("still-life", small))
    base = metric(plain, "base_iso")
    again = simulate(load("still-life", [*small, f"exposure.iso={base!r}"]))
    assert np.array_equal(plain.dn, again.dn)
