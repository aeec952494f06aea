"""Companding: codes of fewer bits, and the way back."""

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.noise.companding import CompandedQuantization
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import read_exr

KNEES = ((1023, 1023), (4095, 1535), (65535, 4095))
ADC = CompandedQuantization(Quantization(0.0, 1.0, 16), KNEES)
CAMERA = {
    "pixel.readout": {"full_well": "65535 e", "read_noise": "3 e"},
    "adc": {"bits": 16, "offset": "64 DN", "companding": {"knees": [list(k) for k in KNEES]}},
    "array.rows": 128,
    "array.columns": 128,
    "effects": "all",
}


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_round_trip_within_one_code(dtype) -> None:
    """Every code of the ADC: off by at most half a step of its segment, 0, 3 and 12 DN."""
    codes = np.arange(65536, dtype=dtype)
    back = ADC.linear(ADC.apply(codes.copy()))
    width = np.where(codes <= 1023, 1.0, np.where(codes <= 4095, 6.0, 61440 / 2560))
    assert np.all(np.abs(back - codes) <= width / 2)
    np.testing.assert_array_equal(back[:1024], codes[:1024])
    assert np.all(np.diff(ADC.apply(codes.copy())) >= 0)


def test_every_written_code_comes_back_as_itself() -> None:
    written = np.arange(4096.0)
    np.testing.assert_array_equal(ADC.apply(np.rint(ADC.linear(written))), written)
    np.testing.assert_allclose(ADC.response(ADC.linear(written)), written, atol=1e-9)


@pytest.mark.parametrize(("electrons", "step"), [(500, 1), (3000, 6), (30_000, 24)])
def test_rounding_is_that_of_the_segment(electrons: float, step: int, tmp_path) -> None:
    """Variance of what is read back: signal + 3^2 + step^2 / 12 [DN^2], an electron a code."""
    made = camera(tmp_path, CAMERA | {"scene.radiance": radiance_for(electrons)})
    frame = simulate(made).frame
    k = frame.chain.system_gain
    stated = frame.chain.noise(float(electrons))
    assert stated.rounding == pytest.approx((step / k) ** 2 / 12, rel=0.01)
    found = frame.chain.to_electrons(frame.dn.astype(float)).var()
    assert found == pytest.approx(stated.total, rel=5 * np.sqrt(2 / frame.dn.size))
    expected = electrons + 9 + (step / k) ** 2 / 12
    assert stated.total == pytest.approx(expected, rel=1e-3)


def test_the_picture_is_that_of_the_linear_codes(tmp_path) -> None:
    """Decompanding takes the place of the black level: the render changes by rounding alone."""
    lit = {"scene.radiance": radiance_for(20_000), "processing": [{"black_level": "subtract"}]}
    companded = simulate(camera(tmp_path, CAMERA | lit))
    plain = {"adc": {"bits": 16, "offset": "64 DN"}}
    linear = simulate(camera(tmp_path, CAMERA | lit | plain))
    assert companded.dn.max() <= 4095 < linear.dn.max()
    np.testing.assert_allclose(companded.processed.linear, linear.processed.linear, atol=13 / 20e3)
    names = ("dynamic_range_db", "well_capacity", "base_iso")
    for name in names:
        assert companded.metrics[name] == pytest.approx(linear.metrics[name])
    assert companded.metrics["picture_snr_db"] == pytest.approx(
        linear.metrics["picture_snr_db"], abs=0.05
    )


def test_merged_codes_of_two_gains_are_companded(tmp_path) -> None:
    """15 bits of two gains in 12: white, black and saturation are those of the merged codes."""
    readout = {"full_well": "20 ke", "gains": [1, 8], "read_noise": "2 e"}
    knees = [[1023, 1023], [32767, 4095]]
    adc = {"bits": 12, "companding": {"knees": knees}}
    changes = {"pixel.readout": readout, "adc": adc, "scene.radiance": radiance_for(15_000)}
    frame = simulate(camera(tmp_path, CAMERA | changes)).frame
    assert frame.dn.max() < 4095
    assert set(frame.readouts_dn) == {"gain1", "gain8"}
    mean = frame.chain.to_electrons(frame.dn.astype(float)).mean()
    assert mean == pytest.approx(15_000, rel=5e-4)


def test_the_file_says_how_to_come_back(tmp_path) -> None:
    result = simulate(camera(tmp_path, CAMERA | {"scene.radiance": radiance_for(20_000)}))
    result.save(tmp_path / "out")
    _, said = read_exr(tmp_path / "out" / "raw.exr")
    assert said["vcam:companding"] == "0:0,1023:1023,4095:1535,65535:4095"
    assert said["vcam:whiteLevel"] == 4095


@pytest.mark.parametrize(
    ("adc", "message"),
    [
        ({"knees": [[1023, 1023], [4095, 2000]]}, "the last knee is at code 4095"),
        ({"knees": [[1023, 1023], [1000, 2000]]}, "must rise"),
        ({"knees": [[0, 0], [65535, 2000]]}, "must rise"),
        ({"knees": []}, "list of knees"),
        ({"knees": [[1023]]}, "pair of codes"),
    ],
)
def test_bad_knees_are_refused(adc, message: str, tmp_path) -> None:
    changes = {"adc": {"bits": 16, "companding": adc}}
    with pytest.raises(BadInput, match=message):
        simulate(camera(tmp_path, CAMERA | changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"array.binning": {"rows": 2, "columns": 2, "kind": "digital"}},
        {"adc": CAMERA["adc"] | {"kind": "logarithmic"}},
    ],
)
def test_what_is_not_simulated_together_is_refused(changes, tmp_path) -> None:
    with pytest.raises(BadInput, match="companding is not simulated with"):
        simulate(camera(tmp_path, CAMERA | changes))
