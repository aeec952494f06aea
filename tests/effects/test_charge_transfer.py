"""Charge transfer against a register that is clocked stage by stage, in code of its own."""

import math

import imageio.v3 as imageio
import numpy as np
import pytest
from making import QUIET, camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel.charge_transfer import ChargeTransfer

RNG = np.random.default_rng(4)


def clocked(packets: np.ndarray, inefficiency: float, phases: int) -> np.ndarray:
    """What leaves a register of `phases` stages a packet, packets (count, lanes), the first first.

    From the far end to the exit every stage is passed by the packets that began before it, one
    after the other; each leaves its share behind, and the next takes that along.
    """
    packets = packets.astype(float)
    for stage in range(len(packets) * phases, 0, -1):
        left = np.zeros(packets.shape[1])
        for k in range(math.ceil(stage / phases) - 1, len(packets)):
            whole = packets[k] + left
            left = inefficiency * whole
            packets[k] = whole - left
    return packets


def electrons_one_by_one(row: np.ndarray, inefficiency: float, phases: int) -> np.ndarray:
    """Where each of many electrons arrives, every one failing by its own chance."""
    out = np.zeros(len(row))
    for k, count in enumerate(row.astype(int)):
        late = RNG.negative_binomial((k + 1) * phases, 1 - inefficiency, count)
        np.add.at(out, k + late[k + late < len(row)], 1)
    return out


CASES = [(1e-5, 3), (1e-3, 1), (1e-3, 3), (0.02, 2), (0.3, 3), (0.9, 8)]


@pytest.mark.parametrize(
    ("inefficiency", "phases", "dtype"),
    long_except(
        [(*case, np.float32 if case == CASES[-1] else np.float64) for case in CASES],
        [(*case, dtype) for case in CASES for dtype in (np.float64, np.float32)],
        several=True,
    ),
)
def test_is_the_register_clocked_stage_by_stage(inefficiency, phases, dtype):
    """More rows than are computed at once. 64 bits: what is left out, 1e-9, in both directions;
    32 bits: sums of some tens of numbers rounded to 6e-8."""
    tolerance = 2e-9 if dtype == np.float64 else 1e-6
    signal = RNG.random((150, 21)).astype(dtype)
    effect = ChargeTransfer(inefficiency, phases, *signal.shape)
    found = effect.transport(signal)
    expected = clocked(clocked(signal, inefficiency, phases).T, inefficiency, phases).T
    assert found.dtype == dtype
    assert found.shape == signal.shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


def test_nothing_handed_in_is_changed():
    signal = np.ones((9, 7))
    ChargeTransfer(0.1, 3, 9, 7).transport(signal)
    assert np.all(signal == 1)


def test_a_single_packet_arrives_late_by_a_negative_binomial():
    """In a far corner: n successes of a chance 1 - e, and k failures before, down and along."""
    signal = np.zeros((60, 50))
    signal[39, 29] = 1.0
    found = ChargeTransfer(2e-3, 3, 60, 50).transport(signal)

    def late(n: int, k: int) -> float:
        return math.comb(n + k - 1, k) * 2e-3**k * (1 - 2e-3) ** n

    for down, along in ((0, 0), (1, 0), (0, 1), (2, 3), (5, 4)):
        expected = late(120, down) * late(90, along)
        assert found[39 + down, 29 + along] == pytest.approx(expected, rel=1e-9)
    assert not found[:39].any()
    assert not found[:, :29].any()


@pytest.mark.parametrize("inefficiency", [1e-5, 1e-3, 0.1])
def test_charge_is_conserved_but_for_what_comes_after_the_picture(inefficiency):
    """With enough dark rows and columns behind, all of it arrives; without, it is less."""
    signal = np.zeros((90, 90))
    signal[:8, :8] = RNG.random((8, 8))
    effect = ChargeTransfer(inefficiency, 3, 90, 90)
    assert effect.transport(signal).sum() == pytest.approx(signal.sum(), rel=1e-8)
    full = np.ones((30, 30))
    kept = ChargeTransfer(inefficiency, 3, 30, 30).transport(full)
    assert kept.sum() < full.sum()
    assert np.all(kept <= 1 + 1e-12)
    assert np.all(kept > 0)


@pytest.mark.parametrize("frequency", [1 / 32, 1 / 8, 1 / 4, 1 / 2])
@pytest.mark.parametrize("inefficiency", [1e-5, 1e-4])
def test_modulation_is_the_formula(frequency, inefficiency):
    """exp(-n e (1 - cos 2 pi f p)) of a wave near n transfers, f p cycles a pixel.

    Of the formula's next term, and of the change of n over the wave: both are n e^2 or less.
    """
    phases, at, width = 3, 3000, 64
    k = np.arange(at + width)
    wave = (1 + np.cos(2 * np.pi * frequency * k))[:, None]
    found = ChargeTransfer(inefficiency, phases, len(k), 1).transport(wave)[at:, 0]
    # the one column is passed in three transfers, which only take from it
    found = found / (1 - inefficiency) ** phases

    def modulation(row):
        wave = np.exp(-2j * np.pi * frequency * k[at:])
        scale = 1 if frequency == 1 / 2 else 2
        return abs((row * wave).mean()) * scale

    n = phases * (at + width / 2)
    expected = math.exp(-n * inefficiency * (1 - math.cos(2 * math.pi * frequency)))
    assert modulation(found) == pytest.approx(expected, rel=phases * width * inefficiency)


def test_electrons_that_are_late_one_by_one_are_poisson_of_the_moved_mean():
    """Why means are enough: counts of a row of Poisson packets, 4000 times.

    Mean and variance are those of a Poisson number to five standard errors, sqrt(m / n) and
    m sqrt((2 + 1 / m) / n), and neighbors are not correlated: 5 / sqrt(n).
    """
    mean = np.array([40.0, 2, 90, 5, 60, 0, 25])
    taken = np.array([electrons_one_by_one(RNG.poisson(mean), 0.05, 3) for _ in range(4000)])
    expected = ChargeTransfer(0.05, 3, 7, 1).transport(mean[:, None])[:, 0] / 0.95**3
    n = len(taken)
    np.testing.assert_array_less(abs(taken.mean(0) - expected), 5 * np.sqrt(expected / n))
    error = 5 * expected * np.sqrt((2 + 1 / expected) / n)
    np.testing.assert_array_less(abs(taken.var(0) - expected), error)
    correlation = np.corrcoef(taken.T)[np.triu_indices(7, 1)]
    assert np.abs(correlation).max() < 5 / math.sqrt(n)


def test_bound_of_its_change():
    """No picture changes by more, rms; a checkered one by half of it, for half of it is bright."""
    effect = ChargeTransfer(1e-3, 3, 40, 60)
    bound = effect.mean_error(SignalLevels(full_signal=1.0, time=1.0))

    def change(signal: np.ndarray) -> float:
        return math.sqrt(np.mean((effect.transport(signal) - signal) ** 2))

    assert change(np.ones((40, 60))) <= bound
    assert change(RNG.random((40, 60))) <= bound
    assert 0.4 * bound < change(np.indices((40, 60)).sum(0) % 2.0) <= bound


SPOT = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "scene.radiance": radiance_for(2000),
    "pixel.architecture": "ccd",
    "pixel.photodetector.dark_current": "20 ke/s",
    "effects": QUIET,
    "pixel.readout.charge_transfer": {"inefficiency": 0},
}
ON_LIGHT = ("dark_current", "diffraction", "pixel_aperture")
TRANSFER = {"pixel.readout.charge_transfer": {"inefficiency": 1e-3, "phases": 2}}


def test_a_camera_moves_light_and_dark_together(tmp_path):
    still = simulate(camera(tmp_path, SPOT)).mean_electrons
    moved = simulate(camera(tmp_path, SPOT | TRANSFER)).mean_electrons
    expected = clocked(clocked(still, 1e-3, 2).T, 1e-3, 2).T
    np.testing.assert_allclose(moved, expected, atol=1e-5)  # 2200 electrons, 2e-9 of them


def test_a_ccd_that_does_not_say_has_the_usual_inefficiency(tmp_path):
    made = camera(tmp_path, {"pixel.architecture": "ccd"})
    assert made.pixel.readout.charge_transfer is not None
    assert made.pixel.readout.charge_transfer.inefficiency == 3e-5
    assert camera(tmp_path).pixel.readout.charge_transfer is None


def test_automatic_exposure_sees_what_is_read(tmp_path):
    """The mean of the picture that arrives, dark signal included, is at its target."""
    auto = {"exposure": {"auto": {"max": "1 s", "method": "mean", "target": 0.02}}}
    result = simulate(camera(tmp_path, SPOT | TRANSFER | auto))
    assert result.mean_electrons.mean() == pytest.approx(0.02 * 100e3, rel=1e-9)


def test_the_plan_says_what_it_changes(tmp_path):
    on = simulate(camera(tmp_path, SPOT | TRANSFER))
    off = simulate(camera(tmp_path, SPOT))
    change = math.sqrt(np.mean((on.mean_electrons - off.mean_electrons) ** 2))
    [decision] = [d for d in on.frame.plan.decisions if d.name == "charge_transfer"]
    full = on.mean_electrons.max()
    assert decision.contribution == pytest.approx(change / full, rel=1e-6)
    assert decision.unit == "of full signal"
    assert "transfers" in decision.reason


@pytest.mark.parametrize("over", long_except([3], [3, 1e4]))
def test_no_more_than_the_well_travels(over, tmp_path):
    """Light far beyond a well of 20 ke leaves behind what a full well leaves, and no more."""
    bright = {"scene.radiance": radiance_for(over * 20e3), "pixel.readout.full_well": "20 ke"}
    # All pixels are full, so that the plan of the still camera would skip what acts on light.
    bright |= {"effects": QUIET | dict.fromkeys(ON_LIGHT, "on")}
    still = simulate(camera(tmp_path, SPOT | bright)).mean_electrons
    moved = simulate(camera(tmp_path, SPOT | bright | TRANSFER)).mean_electrons
    held = np.minimum(still, 20e3)
    expected = clocked(clocked(held, 1e-3, 2).T, 1e-3, 2).T
    assert (still > 20e3).any()
    # 32-bit sums of what is beyond the well: 1e-7 of the brightest
    np.testing.assert_allclose(moved - (still - held), expected, atol=1e-6 * still.max() + 1e-4)


def test_what_a_lamp_leaves_behind_is_a_full_wells_share(tmp_path):
    """Beside an edge of 10^4 x the well only electrons trail: at most the well x all transfers."""
    lamp = {"scene.radiance": radiance_for(1e4 * 20e3), "pixel.readout.full_well": "20 ke"}
    scene = {"scene.source": {"kind": "chart", "chart": "slanted-edge", "contrast": 1.0},
             "pixel.photodetector.dark_current": "0 e/s", "optics.diffraction": False}  # fmt: skip
    moved = simulate(camera(tmp_path, SPOT | lamp | scene | TRANSFER)).mean_electrons
    dark = simulate(camera(tmp_path, SPOT | lamp | scene)).mean_electrons == 0
    assert dark.any()
    transfers = 2 * (48 + 64)
    assert moved[dark].max() <= 20e3 * 1e-3 * transfers


@pytest.mark.parametrize("noise", ["off", "on"])
@pytest.mark.parametrize("over", [3, 300])
def test_a_lone_full_pixel_is_read_without_what_it_defers(over, noise, tmp_path):
    """10,000 (1 - 1e-4)^102 = 9,898.5 electrons after 102 transfers, and no shot noise of its own.

    Full pixels that stand together read what packets before them left behind, too.
    """
    row, column, well = 30, 19, 10e3
    assert 2 * (row + 1 + column + 1) == 102
    picture = np.zeros((48, 64), np.uint8)
    picture[row, column] = 255
    picture[2:7, 40:48] = 255
    imageio.imwrite(tmp_path / "star.png", picture)
    made = SPOT | {
        "scene.source": {"kind": "image", "file": "star.png", "encoding": "linear"},
        "scene.illuminant": {"monochromatic": "550 nm"},
        "scene.radiance": radiance_for(over * well),
        "pixel.photodetector.dark_current": "0 e/s",
        "pixel.readout.full_well": f"{well} e",
        "optics.diffraction": False,
        "effects": QUIET | {"shot_noise": noise},
    }
    transfer = {"pixel.readout.charge_transfer": {"inefficiency": 1e-4, "phases": 2}}
    still = simulate(camera(tmp_path, made)).mean_electrons.astype(float)
    result = simulate(camera(tmp_path, made | transfer))
    full = still >= well
    assert full[row, column]
    expected = clocked(clocked(np.minimum(still, well), 1e-4, 2).T, 1e-4, 2).T
    assert result.electrons[row, column] == pytest.approx(expected[row, column], abs=0.01)
    assert expected[row, column] == pytest.approx(well * (1 - 1e-4) ** 102, abs=2)
    np.testing.assert_allclose(result.electrons[full], expected[full], atol=0.01)
    allowed = 6 * np.sqrt(expected + 1) if noise == "on" else 0.01
    assert np.all(abs(result.electrons - expected) <= allowed)
    assert result.metrics["saturated_fraction"] == pytest.approx(full.mean())
    clean = result.frame.chain.to_dn(expected)
    np.testing.assert_allclose(result.clean_dn, clean, atol=0.01)


def test_full_pixels_amid_full_ones_are_read_as_saturated(tmp_path):
    """A field far beyond the wells loses next to nothing: what each defers the next has left it."""
    bright = {
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "scene.radiance": radiance_for(10 * 20e3),
        "pixel.readout.full_well": "20 ke",
        "adc.bits": 16,
    }
    frame = simulate(camera(tmp_path, SPOT | bright | TRANSFER)).frame
    full = clocked(clocked(np.full((48, 64), 20e3), 1e-3, 2).T, 1e-3, 2).T
    np.testing.assert_allclose(frame.electrons, full, rtol=1e-6)
    assert np.all(frame.dn >= frame.chain.saturated_dn)
    assert frame.chain.saturated_dn > 0.99 * 65535


def test_joined_full_pixels_are_read_without_what_they_defer(tmp_path):
    """A field of wells that are full, 2 x 2 joined by a node that holds no more than one."""
    joined = {
        "scene.radiance": radiance_for(10 * 20e3),
        "pixel.readout.full_well": "20 ke",
        "array.binning": {"rows": 2, "columns": 2, "kind": "charge"},
    }
    result = simulate(camera(tmp_path, SPOT | joined | TRANSFER))
    assert result.electrons.shape == (24, 32)
    assert result.electrons.max() == 20e3


def test_without_a_limit_all_charge_travels(tmp_path):
    bright = {"scene.radiance": radiance_for(60e3), "pixel.readout.full_well": "20 ke"}
    bright |= {"effects": QUIET | {"saturation": "off", "dark_current": "on"}}
    still = simulate(camera(tmp_path, SPOT | bright)).mean_electrons
    moved = simulate(camera(tmp_path, SPOT | bright | TRANSFER)).mean_electrons
    expected = clocked(clocked(still, 1e-3, 2).T, 1e-3, 2).T
    np.testing.assert_allclose(moved, expected, rtol=1e-6)
