"""Lag of charge from frame to frame: closed forms of a flash, of saturation and of noise."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.errors import BadInput
from vcam_cli.progress import observer
from vcam_cli.simulation.sequence import frames

SHARE = 0.1
EXACT = {"accuracy": {"preset": "reference", "float_width": 64}}
DARK = {"scene.radiance": "0 W/(sr m2)"}


def shot(folder, electrons, before=None, seed=1, **changes):
    """An even field of so many electrons, behind a frame before it."""
    light = DARK if electrons == 0 else {"scene.radiance": radiance_for(electrons)}
    base = {"pixel.lag": f"{100 * SHARE} %", "effects": QUIET | {"lag": "on"}, "seed.frame": seed}
    return simulate(camera(folder, base | EXACT | light | changes), before=before)


def test_a_flash_decays_and_all_of_its_charge_is_read(tmp_path):
    """r_k = (1 - l) l^k s; the sum over all frames is s, of 12 frames 1 - l^12 of it."""
    last = shot(tmp_path, 0)
    read = []
    for electrons in (1000, *(0,) * 11):
        last = shot(tmp_path, electrons, last)
        read.append(last.mean_electrons)
    flash = shot(tmp_path, 1000).mean_electrons
    for k, found in enumerate(read):
        np.testing.assert_allclose(found, (1 - SHARE) * SHARE**k * flash, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sum(read), flash * (1 - SHARE**12), rtol=1e-9)


def test_constant_light_reads_as_a_single_frame(tmp_path):
    first = shot(tmp_path, 700)
    second = shot(tmp_path, 700, first)
    np.testing.assert_allclose(second.mean_electrons, first.mean_electrons, rtol=1e-12)
    assert second.dn.tobytes() == shot(tmp_path, 700).dn.tobytes()


def test_of_a_full_pixel_its_well_lags(tmp_path):
    bright = shot(tmp_path, 3e6)
    well = bright.frame.electrical.full_well
    after = shot(tmp_path, 0, bright)
    np.testing.assert_allclose(after.mean_electrons, SHARE * well, rtol=1e-9)


def test_dark_charge_lags_too(tmp_path):
    """Behind a hot exposure of 10 times the time: the dark current's electrons, by hand."""
    sensor = {"pixel.photodetector.dark_current": "20 ke/s"}
    on = {"effects": QUIET | {"lag": "on", "dark_current": "on"}}
    long = shot(tmp_path, 0, **sensor, **on, **{"exposure.time": "100 ms"})
    short = shot(tmp_path, 0, long, **sensor, **on, **{"exposure.time": "10 ms"})
    np.testing.assert_allclose(short.mean_electrons, 0.9 * 200 + 0.1 * 2000, rtol=1e-9)


def test_noise_is_that_of_light_and_new_in_every_frame(tmp_path):
    """Electrons that lag are others than those that were read: variance = mean, and the
    correlation of successive frames is 0; 5 standard errors, sqrt(2 / n) and 1 / sqrt(n)."""
    on = {"effects": QUIET | {"lag": "on", "shot_noise": "on"}, "pixel.lag": "40 %"}
    first = shot(tmp_path, 2000, **on)
    second = shot(tmp_path, 500, first, seed=2, **on)
    mean = 0.6 * 500 + 0.4 * 2000
    found = second.electrons
    n = found.size
    assert found.mean() == pytest.approx(mean, abs=5 * np.sqrt(mean / n))
    assert found.var() == pytest.approx(mean, rel=5 * np.sqrt(2 / n))
    r = np.corrcoef(first.electrons.ravel(), found.ravel())[0, 1]
    assert abs(r) < 5 / np.sqrt(n)


def test_a_sequence_lags_from_frame_to_frame(tmp_path):
    """Every frame of a moving scene against its own light and the read charge of the last."""
    bars = {"kind": "chart", "chart": "sinusoid", "frequency": "30 lp/mm", "contrast": 1}
    moving = {"scene.source": bars | {"mean": 0.5, "motion": {"x": "0.3 m/s"}}}
    lit = {"scene.radiance": radiance_for(800)}
    made = camera(
        tmp_path,
        {"pixel.lag": "25 %", "effects": QUIET | {"lag": "on"}} | EXACT | moving | lit,
    )
    read = None
    for each, result in frames(made, 4, 25, 1, observer(None)):
        own = simulate(each).mean_electrons
        expected = own if read is None else 0.75 * own + 0.25 * read
        np.testing.assert_allclose(result.mean_electrons, expected, rtol=1e-9)
        read = result.mean_electrons
    assert np.abs(own - read).max() > 20


def test_a_single_frame_says_that_it_does_not_lag(tmp_path):
    changes = {"pixel.lag": "5 %"}
    with_lag, without = (
        simulate(camera(tmp_path, given)) for given in (changes, {"pixel.lag": "0 %"})
    )
    assert any("pixel.lag changes nothing here" in note for note in with_lag.remarks)
    assert with_lag.dn.tobytes() == without.dn.tobytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"exposure": {"captures": ["1 ms", "2 ms"]}}, "several captures"),
        ({"exposure": {"bracket": ["1 ms", "2 ms"]}}, "a bracket"),
        ({"pixel.readout.gains": [1, 4]}, "several readouts"),
        ({"pixel.phase_detection": "dual"}, "phase detection"),
    ],
)
def test_refuses_what_is_not_simulated(changes, message, tmp_path):
    with pytest.raises(BadInput, match=message):
        camera(tmp_path, {"pixel.lag": "5 %"} | changes)
