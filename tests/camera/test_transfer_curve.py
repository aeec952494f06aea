"""The readout's transfer curve: its shape, what of it reaches the codes, what is refused."""

import numpy as np
import pytest
from making import CHARGE, QUIET, camera, radiance_for

from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.simulation.simulate import simulate
from vcam_cli.solve.idle_keys import idle_keys

CURVE = "pixel.readout.transfer_curve"
FOLLOWER = {"threshold": "0.3 V", "overdrive": "0.1 V"}
READOUT = {"conversion_gain": "20 uV/e", "voltage_swing": "1 V"}


def bent(folder, curve, **more):
    readout = READOUT | {"transfer_curve": curve}
    return camera(folder, {"pixel.readout": readout} | more)


def output(gate, threshold=0.4, gamma=0.5, phi=0.7):
    """The follower's output by fixed-point steps, which shrink by more than half each."""
    v = np.zeros_like(gate)
    for _ in range(200):
        v = gate - threshold - gamma * (np.sqrt(phi + v) - np.sqrt(phi))
    return v


def test_the_output_falls_as_the_charge_says(tmp_path):
    e = electrical(bent(tmp_path, {"follower": FOLLOWER, "reset_voltage": "1.8 V"}))
    electrons = np.linspace(0, 50_000, 17)
    expected = output(np.array(1.8)) - output(1.8 - electrons * 20e-6)
    # lines between 1025 points: an eighth of the squared step times a curvature below 1 / V
    assert e.curve.volts_of(electrons) == pytest.approx(expected, abs=2e-7)
    assert e.full_scale == pytest.approx(expected[-1], rel=1e-9), "auto: the ADC is full with it"


def test_the_capacitance_of_the_junction_rises_as_it_discharges(tmp_path):
    """Charges from a sum of small steps of C(V), with the technology's numbers written out."""
    process = {
        "from": "cmos-0.18um",
        "capacitance": {"follower_gate": "1 fF", "sidewall": "0 fF/um"},
    }
    detector = {"width": "4 um", "height": "4 um", "capacitance": "junction"}
    made = camera(
        tmp_path,
        {
            "pixel.technology": process,
            "pixel.photodetector": detector | {"quantum_efficiency": 0.5},
            "pixel.readout": {"transfer_curve": {"capacitance": "junction"}},
        },
    )
    e = electrical(made)
    edges = np.linspace(1.65 - 1.12, 1.65, 20_001)
    middle = (edges[1:] + edges[:-1]) / 2
    capacitance = 16 * 0.9925e-15 * (1 + middle / 0.727) ** -0.357 + 1e-15
    charge = np.cumsum((capacitance * np.diff(edges))[::-1]) / CHARGE
    assert e.full_well == pytest.approx(charge[-1], rel=1e-6)
    half = charge[9999]
    assert e.curve.volts_of(half) == pytest.approx(0.56, rel=1e-6)
    assert half < e.full_well / 2, "the second half of the swing takes more charge"


def test_a_measured_table_is_followed_in_frames(tmp_path):
    """Codes of even light, without noise: offset 0, 12 bits, the table's own straight lines."""
    table = {0.5: 0.1, 1.0: 0.5, 1.5: 0.8}
    curve = {"follower": {"table": table}, "reset_voltage": "1.5 V"}
    made = bent(tmp_path, curve, **{"scene.radiance": radiance_for(30_000), "effects": QUIET})
    result = simulate(made)
    electrons = float(result.mean_electrons.mean())
    fall = electrons * 20e-6
    expected = 0.8 - np.interp(1.5 - fall, list(table), list(table.values()))
    assert np.unique(result.dn) == pytest.approx(4095 * expected / 0.7, abs=0.51)
    with_volts = made.with_({"output.raw": ["volts"]})
    assert simulate(with_volts).volts.mean() == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("corrected", [True, False])
def test_a_picture_is_bent_unless_the_processing_knows_the_curve(corrected, tmp_path):
    curve = {"follower": FOLLOWER, "reset_voltage": "1.5 V", "corrected": corrected}
    changes = {
        "scene.source": {"kind": "chart", "chart": "step-wedge", "steps": 8},
        "scene.radiance": radiance_for(45_000),
        "effects": QUIET,
        "optics.diffraction": False,
        "adc.bits": 16,
        "processing": [{"black_level": "subtract"}],
        "quality": ["mse"],
    }
    result = simulate(bent(tmp_path, curve, **changes))
    middle = slice(20, 28), slice(27, 29)  # a bar of density 6/7: no edge near
    error = float(np.abs(result.linear - result.ideal)[middle].max())
    # 16 bits: half a code is 1e-5 of white
    assert error < 3e-5 if corrected else error > 5e-4


def test_a_constant_gain_cancels_and_the_user_is_told(tmp_path):
    made = bent(tmp_path, {"follower": {"gain": 0.8}})
    plain = simulate(camera(tmp_path, {"pixel.readout": READOUT}))
    assert (simulate(made).dn == plain.dn).all()
    assert f"{CURVE}.follower.gain" in dict(idle_keys(made))
    volts = made.with_({"output.raw": ["volts"]})
    assert not dict(idle_keys(volts))


def test_what_acts_is_not_called_idle(tmp_path):
    made = bent(tmp_path, {"follower": FOLLOWER, "reset_voltage": "1.8 V", "corrected": True})
    assert not dict(idle_keys(made))
    line = bent(tmp_path, {"reset_voltage": "1.8 V", "corrected": True})
    assert set(dict(idle_keys(line))) == {f"{CURVE}.reset_voltage", f"{CURVE}.corrected"}


@pytest.mark.parametrize(
    ("curve", "more", "path", "words"),
    [
        ({"follower": FOLLOWER, "reset_voltage": "1.2 V"}, {}, "follower.threshold", "0.4 V"),
        ({"follower": FOLLOWER}, {}, "reset_voltage", "reset_voltage"),
        ({"follower": FOLLOWER, "reset_voltage": "0.9 V"}, {}, "reset_voltage", "forward"),
        ({"follower": {"gain": 0.8, "threshold": "1 V"}}, {}, "follower.threshold", "both"),
        ({"follower": {"table": {0.8: 0.1, 1.5: 0.2}}, "reset_voltage": "1.5 V"}, {},
         "follower", "0.5 V"),
        ({"follower": {"table": {0.4: 0.3, 1.5: 0.2}}, "reset_voltage": "1.5 V"}, {},
         "follower", "does not rise"),
        ({"follower": FOLLOWER, "reset_voltage": "1.8 V"}, {"adc": {"kind": "logarithmic"}},
         "", "logarithmic"),
        ({"follower": {"gain": 0.8}}, {"pixel.architecture": "pps"}, "follower", "passive"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(curve, more, path, words, tmp_path):
    with pytest.raises(BadInput) as caught:
        bent(tmp_path, curve, **more)
    problems = list(caught.value.problems)
    where = tuple(part for part in f"{CURVE}.{path}".split(".") if part)
    if words == "reset_voltage":
        where = tuple(f"pixel.technology.{path}".split("."))
        assert any(words in p.message for p in problems), problems
        return
    assert any(p.path == where and words in p.message for p in problems), problems
    assert all(p.remedy for p in problems)


def test_beyond_its_ends_the_curve_is_straight(tmp_path):
    curve = electrical(bent(tmp_path, {"follower": FOLLOWER, "reset_voltage": "1.8 V"})).curve
    for start, step in ((0.0, -1e3), (curve.electrons[-1], 1e15)):
        near, far = curve.volts_of(np.array([start, start + step]))
        slope = np.diff(curve.volts_of(np.array([start, start + 1e-3 * np.sign(step)])))[0]
        assert (far - near) / step == pytest.approx(slope / (1e-3 * np.sign(step)), rel=1e-5)
        assert float(curve.electrons_of(far)) == pytest.approx(start + step, rel=1e-9)


def test_a_file_of_the_curve_is_read(tmp_path):
    (tmp_path / "curve.csv").write_text("input_v,output_v\n0.4,0.05\n1.0,0.5\n1.6,0.9\n")
    curve = {"follower": {"file": "curve.csv"}, "reset_voltage": "1.5 V"}
    e = electrical(bent(tmp_path, curve))
    assert e.curve.volts[-1] == pytest.approx(0.5 + 0.5 * 0.4 / 0.6 - (0.05 + 0.1 * 0.75), rel=1e-9)
