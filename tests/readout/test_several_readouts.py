"""Two gains of one charge, a split pixel: shared and own noise, the merge against closed forms.

The pixel is that of Solhusvik et al., IISW 2019, as quoted in isetcam: 22 ke read with 3.05 e and
0.83 e at 4.08 times the gain, beside a photodiode of 1 % of the light that holds 7.9 ke.
"""

import math

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli import simulate
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import read_exr
from vcam_cli.readout import several_readouts

READ = {"low": 3.05, "high": 0.83, "small": 0.83}
GAIN = 200 / 49
TWO = {"gains": [1, GAIN], "read_noise": {"table": {1: "3.05 e", GAIN: "0.83 e"}}}
SMALL = {"small": {"sensitivity": "1 %", "full_well": "7900 e", "read_noise": "0.83 e"}}
PIXEL = {
    "pixel.readout": {"full_well": "22 ke", **TWO, **SMALL},
    "adc": {"bits": 12},
    "array.rows": 64,
    "array.columns": 64,
    "effects": "all",
    "scene.radiance": radiance_for(1000),
}
FINE = {"adc": {"bits": 16}}
"""An ADC whose rounding is 0.03 e at most in each gain: closed forms know none."""


def chain_of(folder, **changes):
    return simulate(camera(folder, PIXEL | changes)).frame.chain


def frame_of(chain, means, rows: int, seed: int = 3):
    """A frame whose columns have these means [e], in one second without dark current."""
    rate = np.tile(np.asarray(means, float), (rows, 1))
    seeds = {"sensor": 1, "frame": seed}
    return several_readouts.capture(rate, 1.0, chain, seeds, 2)


def test_gains_share_the_charge_and_photodiodes_the_light(tmp_path) -> None:
    """Covariances of the readouts [e^2]: shot noise of one charge, nothing between photodiodes."""
    chain = chain_of(tmp_path, **FINE)
    found = frame_of(chain, [2000.0] * 256, 256)
    branches = {branch.name: branch.circuit for branch in chain.branches}
    electrons = {
        name: (found.readouts[name] - e.offset) * e.electrons_per_dn for name, e in branches.items()
    }
    low, high, small = (electrons[branch.name].ravel() for branch in chain.branches)
    error = 5 * 2000 * math.sqrt(2 / low.size)
    assert np.cov(low, high)[0, 1] == pytest.approx(2000, abs=error)
    assert np.var(low - high) == pytest.approx(
        READ["low"] ** 2 + READ["high"] ** 2, rel=5 * math.sqrt(2 / low.size)
    )
    assert np.cov(low, small)[0, 1] == pytest.approx(0, abs=5 * math.sqrt(2000 * 21 / low.size))
    assert small.mean() == pytest.approx(20, abs=5 * math.sqrt(21 / low.size))


@pytest.mark.parametrize("rule", ["snr", "switch"])
def test_snr_over_light_has_the_dips_of_the_closed_form(rule: str, tmp_path) -> None:
    """S / sqrt(S + r^2) of each readout below its saturation, k S / sqrt(k S + r^2) of the small.

    `switch` within 1 %; `snr` is never worse, and as good as all readouts together can be.
    """
    readout = PIXEL["pixel.readout"] | {"merge": rule}
    chain = chain_of(tmp_path, **FINE | {"pixel.readout": readout})
    top = 22_000 / GAIN

    def noise(signal: float) -> float:
        return math.sqrt(chain.noise(signal).total)

    large = [(10.0, "high"), (0.97 * top, "high"), (1.01 * top, "low"), (21_000.0, "low")]
    for signal, name in large:
        alone = math.sqrt(signal + READ[name] ** 2)
        if rule == "switch":
            assert noise(signal) == pytest.approx(alone, rel=0.01)
        else:
            best = 1 / sum(1 / READ[n] ** 2 for n in {name, "low"})
            of_large, of_small = signal + best, (0.01 * signal + READ["small"] ** 2) * 1e4
            least = 1 / math.sqrt(1 / of_large + 1 / of_small)
            assert noise(signal) == pytest.approx(least, rel=0.001)
            assert noise(signal) <= alone
    for signal in (22_100.0, 1e5, 7e5):
        small = math.sqrt(0.01 * signal + READ["small"] ** 2) / 0.01
        assert noise(signal) == pytest.approx(small, rel=0.01)
    dip = 20 * math.log10(22_100 / noise(22_100) / (21_000 / noise(21_000)))
    assert dip == pytest.approx(23.4106 - 43.4224, abs=0.25)  # 5 % of light apart: 0.2 dB


def test_dynamic_range_is_that_of_the_closed_form(tmp_path) -> None:
    """20 log10(7900 / 0.01 / 0.83) = 119.57 dB of switched readouts, within 1 %."""
    readout = PIXEL["pixel.readout"] | {"merge": "switch"}
    metrics = simulate(camera(tmp_path, PIXEL | FINE | {"pixel.readout": readout})).metrics
    assert metrics["dynamic_range_db"] == pytest.approx(119.571, rel=1e-4)
    assert metrics["quantized_dynamic_range_db"] == pytest.approx(119.571, rel=0.01)
    assert metrics["well_capacity"] == pytest.approx(790_000)


@pytest.mark.parametrize("rule", ["snr", "switch"])
def test_merged_mean_is_unbiased_through_the_switches(rule: str, tmp_path) -> None:
    """0.1 % at all signals, noise and clipping included, and noise as the chain states it."""
    readout = PIXEL["pixel.readout"] | {"merge": rule}
    chain = chain_of(tmp_path, **{"pixel.readout": readout})
    top = 22_000 / GAIN
    means = [500, 0.97 * top, 0.99 * top, top, 1.01 * top, 20e3, 21.8e3, 22e3, 22.2e3, 1e5, 7e5]
    rows = 60_000
    found = chain.to_electrons(frame_of(chain, means, rows).dn.astype(float))
    for mean, column in zip(means, found.T, strict=True):
        error = 5 * column.std() / math.sqrt(rows)
        assert column.mean() == pytest.approx(mean, abs=min(error, 1e-3 * mean) + 0.01)
        if not 21.5e3 < mean < 22.5e3 and not 0.98 < mean / top < 1.02:
            stated = chain.noise(mean).total
            assert column.var() == pytest.approx(stated, rel=5 * math.sqrt(2 / rows) + 0.003)


def test_the_first_gain_is_read_as_if_it_were_alone(tmp_path) -> None:
    """Byte by byte: the frame of the same camera without further readouts."""
    alone = {"full_well": "22 ke", "read_noise": "3.05 e"}
    single = simulate(camera(tmp_path, PIXEL | {"pixel.readout": alone}))
    several = simulate(camera(tmp_path, PIXEL))
    assert single.frame.readouts_dn == {}
    np.testing.assert_array_equal(several.frame.readouts_dn["gain1"], single.dn)


def test_a_pixel_is_saturated_where_all_its_readouts_are(tmp_path) -> None:
    chain = chain_of(tmp_path)
    found = frame_of(chain, [3e4, 7e5, 9e5], 200).dn
    assert np.all(found[:, :2] < chain.saturated_dn)
    assert np.all(found[:, 2] >= chain.saturated_dn)


@pytest.mark.parametrize("effects", ["all", {"dark_current": "off"}])
@pytest.mark.parametrize("large", [0, 1000])
def test_small_photodiode_has_its_own_dark_signal(large, effects, tmp_path) -> None:
    """The merge subtracts it, and adds that of the large one: white stays where it was."""
    small = SMALL["small"] | {"dark_current": "400 e/s"}
    dark = {
        "pixel.readout": PIXEL["pixel.readout"] | {"small": small},
        "pixel.photodetector.dark_current": f"{large} e/s",
        "exposure.time": "1 s",
        "scene.radiance": radiance_for(300_000, 1.0),
        "effects": effects,
    }
    frame = simulate(camera(tmp_path, PIXEL | dark)).frame
    merged = frame.chain.to_electrons(frame.dn.astype(float))
    error = 5 * merged.std() / 64
    assert merged.mean() == pytest.approx(float(frame.mean_electrons.mean()), abs=error)


def test_dark_signals_beyond_any_pixel_are_refused_in_both_photodiodes(tmp_path) -> None:
    current = "1e39 Me/s"
    small = {**PIXEL["pixel.readout"], "small": {**SMALL["small"], "dark_current": current}}
    for change in ({"pixel.photodetector.dark_current": current}, {"pixel.readout": small}):
        with pytest.raises(BadInput, match=r"would make .* electrons"):
            chain_of(tmp_path, **change)


def test_channels_of_the_raw_frame(tmp_path) -> None:
    result = simulate(camera(tmp_path, PIXEL))
    result.save(tmp_path / "out")
    channels, said = read_exr(tmp_path / "out" / "raw.exr")
    assert said["vcam:sensitivity.small"] == pytest.approx(0.01)
    assert {"dn", "dn.gain1", f"dn.gain{GAIN:g}", "dn.small", "electrons"} <= set(channels)
    np.testing.assert_array_equal(channels["dn"], result.dn)


def test_results_do_not_depend_on_the_number_of_workers(tmp_path) -> None:
    made = camera(tmp_path, PIXEL | {"array.rows": 150})
    one, four = (simulate(made, workers=workers) for workers in (1, 4))
    assert one.dn.tobytes() == four.dn.tobytes()


@pytest.mark.parametrize(
    "changes",
    [
        {"array.binning": {"rows": 2, "columns": 2}},
        {"adc": {"bits": 12, "kind": "logarithmic"}},
        {"exposure": {"captures": ["1 ms", "2 ms"]}},
        {"pixel.architecture": "ccd"},
        {"array.pattern": "stacked"},
        {"pixel.crosstalk": {"interpixel_capacitance": "0.5 %"}},
        {"adc": {"bits": 24}},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_is_not_simulated_together_is_refused(changes, tmp_path) -> None:
    with pytest.raises(BadInput, match=r"pixel\.readout\.gains|several readouts of one exposure"):
        simulate(camera(tmp_path, PIXEL | changes))


def test_two_gains_have_one_saturation_in_every_float_type(tmp_path) -> None:
    """A fixed pattern is that of the charge: the same in both gains."""
    fpn = {"pixel.fpn": {"gain_pixel": "3 %"}, "pixel.readout": {"full_well": "22 ke", **TWO}}
    chain = chain_of(tmp_path, **fpn, **FINE)
    found = frame_of(chain, [3000.0] * 200, 200)
    low, high = (found.readouts[b.name] * b.circuit.electrons_per_dn for b in chain.branches)
    assert np.std(low) == pytest.approx(math.hypot(90, math.sqrt(3009)), rel=0.03)
    assert np.std(low - high) == pytest.approx(math.hypot(3.05, 0.83), rel=0.02)
