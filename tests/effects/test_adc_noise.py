"""Noise of the ADC behind the gain, and noise of the readout that depends on the gain."""

import math

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli import simulate
from vcam_cli.characterization.bench import prepare_bench
from vcam_cli.effects.noise.adc_noise import AdcNoise
from vcam_cli.effects.noise.quantization import LogarithmicQuantization
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.errors import BadInput
from vcam_cli.progress import Stages
from vcam_cli.readout.nondestructive_samples import variances
from vcam_cli.simulation.figures import saturated_pixels

DARK = {
    "scene.radiance": "0 W/(sr m2)",
    "array.rows": 200,
    "array.columns": 200,
    "pixel.readout.read_noise": "2 e",
    "adc": {"bits": 14, "gain": "0.4 DN/e", "offset": "200 DN", "noise": "2 DN"},
}
TABLE = {"pixel.readout.read_noise": {"table": {1: "5 e", 16: "1.5 e"}}}


@pytest.mark.parametrize(
    ("gain", "variance"), [(1, 4.7233), (4, 14.3233), (16, 167.9233)], ids=["1", "4", "16"]
)
def test_variance_of_a_dark_frame(gain: float, variance: float, tmp_path) -> None:
    """(K g)^2 2^2 + 2^2 + 1/12 for K = 0.4 DN/e; of 40 000 normal numbers to sqrt(2 / n)."""
    assert variance == pytest.approx((0.4 * gain * 2) ** 2 + 4 + 1 / 12, abs=1e-4)
    frame = simulate(camera(tmp_path, DARK | {"exposure.gain": gain})).frame
    dn = frame.dn.astype(float)
    assert dn.var() == pytest.approx(variance, rel=5 * math.sqrt(2 / dn.size))
    assert dn.mean() == pytest.approx(200, abs=5 * math.sqrt(variance / dn.size))
    stated = sum(e.variance(0.0) for e in frame.plan.active if e.name.endswith("_noise"))
    assert stated * (0.4 * gain) ** 2 + 1 / 12 == pytest.approx(variance, abs=1e-4)


def test_switched_off_it_leaves_the_other_noise(tmp_path) -> None:
    off = simulate(camera(tmp_path, DARK | {"effects": {"adc_noise": "off"}})).dn.astype(float)
    assert off.var() == pytest.approx(0.64 + 1 / 12, rel=5 * math.sqrt(2 / off.size))


def test_a_logarithmic_adc_has_the_same_codes_of_noise(tmp_path) -> None:
    """Codes move by what is drawn wherever on the curve, down to where it has no value."""
    adc = LogarithmicQuantization(offset=100, bend=50.0, full=1e5, bits=14)
    electrons = np.array([-49.0, -10.0, 0.0, 300.0, 9e4])
    codes = np.array([3.0, -7.0, 40.0, 0.5, -300.0])
    moved = adc.moved(electrons.copy(), codes.copy())
    np.testing.assert_allclose(adc.response(moved) - adc.response(electrons), codes, atol=1e-9)
    assert adc.moved(np.array([-60.0]), np.array([5.0]))[0] == -60


def test_the_curve_of_a_pixel_does_not_bend_it(tmp_path) -> None:
    """Behind a transfer curve, too, noise of the ADC is as many codes in bright light as none."""
    curve = {
        "follower": {"table": {0.0: 0.0, 1.0: 0.9, 2.0: 1.0, 3.0: 2.0}},
        "reset_voltage": "3 V",
    }
    made = {"pixel.readout.transfer_curve": curve, "adc": {"bits": 14, "noise": "5 DN"}}
    frame = simulate(camera(tmp_path, DARK | made | {"pixel.readout.read_noise": "0 e"})).frame
    adc, electrons = frame.chain.adc, np.array([0.0, 2e4, 7e4])
    moved = adc.moved(electrons.copy(), np.full(3, 11.0))
    np.testing.assert_allclose(adc.response(moved) - adc.response(electrons), 11, rtol=1e-6)


def test_full_pixels_count_as_saturated(tmp_path) -> None:
    """Noise behind the well spreads their codes; few lie below what counts as full (3 sigma)."""
    full = DARK | {"scene.radiance": radiance_for(3e5), "adc.gain": "0.1 DN/e", "effects": "all"}
    frame = simulate(camera(tmp_path, full)).frame
    assert frame.dn.std() > 1.9
    assert saturated_pixels(frame).mean() > 0.99


@pytest.mark.parametrize(
    ("gain", "noise"), [(0.5, 5), (1, 5), (4, math.sqrt(7.5)), (16, 1.5), (20, 1.5)]
)
def test_read_noise_by_gain(gain: float, noise: float, tmp_path) -> None:
    """In the middle of the logarithm of the gain: the geometric mean of both."""
    result = simulate(camera(tmp_path, DARK | TABLE | {"exposure.gain": gain}))
    [found] = [e for e in result.frame.plan.active if isinstance(e, ReadNoise)]
    assert found.electrons == pytest.approx(noise, rel=1e-12)
    told = [note for note in result.notes if "pixel.readout.read_noise" in note]
    assert len(told) == (not 1 <= gain <= 16)


def test_read_noise_by_gain_is_written_as_it_was_read(tmp_path) -> None:
    made = camera(tmp_path, DARK | TABLE)
    written = made.model_dump(mode="json")["pixel"]["readout"]["read_noise"]
    assert written == {"table": {"1.0": "5 e", "16.0": "1.5 e"}}
    assert made.with_({"pixel.readout.read_noise": written}) == made


@pytest.mark.parametrize(
    "given",
    [
        {"table": {1: "5 e"}},
        {"table": {1: "5 e", 16: "0 e"}},
        {"table": {0: "5 e", 16: "1 e"}},
        {"table": {"one": "5 e", 16: "1 e"}},
        {"table": {1: "5 e", "1.0": "1 e"}},
        {"tables": {1: "5 e", 16: "1 e"}},
        {"table": 3},
    ],
)
def test_a_bad_table_is_refused_at_its_place(given, tmp_path) -> None:
    with pytest.raises(BadInput, match=r"pixel\.readout\.read_noise"):
        camera(tmp_path, {"pixel.readout.read_noise": given})


def test_more_noise_than_codes_is_refused(tmp_path) -> None:
    with pytest.raises(BadInput, match=r"adc\.noise"):
        camera(tmp_path, {"adc.noise": "5000 DN"})


def test_automatic_gain_changes_the_noise_of_the_pixel(tmp_path) -> None:
    """An exposure that raises its gain reads with the noise, and the offset, of that gain."""
    auto = {"exposure": {"auto": {"max": "1 ms", "max_gain": 16}}, "adc.offset": "auto"}
    made = camera(tmp_path, DARK | TABLE | auto | {"scene.radiance": radiance_for(100, 1e-3)})
    frame = simulate(made).frame
    assert frame.camera.exposure_gain == 16
    [noise] = [e for e in frame.plan.active if isinstance(e, AdcNoise)]
    assert noise.variance(0.0) == pytest.approx((2 / (0.4 * 16)) ** 2)
    assert frame.electrical.offset == math.ceil(4 * math.hypot(1.5 * 0.4 * 16, 2))


def test_the_bench_of_characterize_measures_it(tmp_path) -> None:
    """The difference of two dark frames has twice the variance that the bench states."""
    bench = prepare_bench(camera(tmp_path, DARK), 1, Stages())
    stated = bench.noise_floor * 0.4**2 + 1 / 12
    assert stated == pytest.approx(0.64 + 4 + 1 / 12)
    found = (bench.flat_frame(0.0, 1) - bench.flat_frame(0.0, 2)).var() / 2
    assert found == pytest.approx(stated, rel=5 * math.sqrt(2 / 512**2))


def test_every_sample_of_an_integration_has_its_own(tmp_path) -> None:
    """Samples of a dark integration are independent, and pixels stay full whatever it draws."""
    times = {"exposure": {"captures": ["1 ms", "2 ms", "4 ms"]}}
    frame = simulate(camera(tmp_path, DARK | times)).frame
    assert frame.samples_dn is not None
    read, common = variances(frame.chain)
    assert (read * 0.16, common) == (pytest.approx(0.64 + 4 + 1 / 12), 0)
    found = np.cov(frame.samples_dn.reshape(3, -1).astype(float))
    error = 5 * math.sqrt(2 / frame.dn.size) * read * 0.16
    np.testing.assert_allclose(found, read * 0.16 * np.eye(3), rtol=0, atol=error)


@pytest.mark.parametrize(("kind", "share"), [("voltage", 1.0), ("digital", 0.25)])
def test_binned_pixels_have_it_once_for_each_conversion(kind: str, share: float, tmp_path) -> None:
    """Joined voltages are converted once, added codes each by itself: 2^2 of a sum of four."""
    binning = {"array.binning": {"rows": 2, "columns": 2, "kind": kind}}
    quiet = {"pixel.readout.read_noise": "0 e", "adc.offset": "300 DN"}
    dn = simulate(camera(tmp_path, DARK | binning | quiet)).dn.astype(float)
    codes = 4 if kind == "digital" else 1
    expected = (4 * share + share / 12) * codes**2
    assert dn.var() == pytest.approx(expected, rel=5 * math.sqrt(2 / dn.size))
