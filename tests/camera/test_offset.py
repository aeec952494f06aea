"""The automatic offset of an ADC: as few codes as keep four standard deviations of the dark."""

import math

import pytest
from making import BOLTZMANN, CHARGE, GONE, camera, radiance_for

from vcam_cli import load, simulate
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.simulation import checks

WELL, VOLTS = 100_000, 20e-6  # of the plain camera: electrons, and volts of one
AUTO = {"adc.offset": "auto"}
NOISES = {
    "pixel.readout": {
        "conversion_gain": "20 uV/e",
        "full_well": "100 ke",
        "read_noise": "30 e",
        "row_noise": "20 e",
        "column_noise": "10 e",
        "reset_noise": "40 e",
    },
    "pixel.fpn": {"offset_pixel": "25 e", "offset_column": "15 e", "prnu": "5 %", "dark": "9 %"},
}


def offset(folder, changes) -> float:
    return electrical(camera(folder, AUTO | changes)).offset


def fewest(noise: float, codes: int, full: float) -> int:
    """By trying one after the other: steps of full / (codes - offset) electrons."""
    return next(o for o in range(codes) if o * full / (codes - o) >= 4 * noise)


def test_without_noise_there_is_none(tmp_path) -> None:
    """Shot noise is never below zero, and gains do not act in the dark."""
    assert offset(tmp_path, {}) == 0
    assert offset(tmp_path, {"pixel.fpn": {"prnu": "5 %", "dark": "5 %"}}) == 0


@pytest.mark.parametrize("gain", [0.5, 1, 8, 64])
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_it_is_the_fewest_codes(bits: int, gain: float, tmp_path) -> None:
    noise = math.hypot(30, 20, 10, 40, 25, 15)
    found = offset(tmp_path, NOISES | {"adc.bits": bits, "exposure.gain": gain})
    assert found == fewest(noise, 2**bits - 1, WELL / gain)


def test_codes_per_electron_are_what_the_file_says(tmp_path) -> None:
    found = electrical(camera(tmp_path, AUTO | NOISES | {"adc.gain": "0.03 DN/e"}))
    assert found.offset == math.ceil(4 * math.hypot(30, 20, 10, 40, 25, 15) * 0.03)
    assert found.electrons_per_dn == pytest.approx(1 / 0.03)


@pytest.mark.parametrize(
    ("architecture", "noise"),
    [
        ("aps-3t", (30, 20, 10, 40, 25, 15)),
        ("aps-4t", (30, 20, 10, 25, 15)),
        ("dps", (30, 20, 40, 25)),
        ("ccd", (30, 20, 25)),
    ],
)
def test_it_knows_the_architecture(architecture: str, noise, tmp_path) -> None:
    """Correlated sampling removes the noise of the reset; columns alike have none."""
    found = offset(tmp_path, NOISES | {"pixel.architecture": architecture})
    assert found == fewest(math.hypot(*noise), 4095, WELL)


def test_thermal_noise_of_the_reset(tmp_path) -> None:
    """kTC of q / (20 uV/e) at 300 K: 36 electrons."""
    noise = math.sqrt(BOLTZMANN * 300 * CHARGE / VOLTS) / CHARGE
    assert offset(tmp_path, {"pixel.readout.reset_noise": "ktc"}) == fewest(noise, 4095, WELL)


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
def test_nothing_is_clipped_in_the_dark(kind: str, tmp_path) -> None:
    """The mean of a dark frame is black; with no offset it would be 0.4 sigma higher."""
    dark = NOISES | {"scene.radiance": "0 W/(sr m2)", "adc.bits": 14, "adc.kind": kind}
    dark |= {"array.rows": 200, "array.columns": 200, "pixel.fpn": {"offset_pixel": "25 e"}}
    dark["pixel.readout"] = dark["pixel.readout"] | {"column_noise": "0 e", "row_noise": "0 e"}
    dark |= {"adc.reference": "20 mV"} if kind == "logarithmic" else {}
    frame = simulate(camera(tmp_path, dark | AUTO)).frame
    assert (frame.dn == 0).mean() < 1e-3
    electrons = frame.chain.linear(frame.dn.astype(float)) - frame.electrical.offset
    electrons *= frame.electrical.electrons_per_dn
    sigma = math.hypot(30, 40, 25)
    assert abs(electrons.mean()) < 5 * sigma / 200 + 0.01 * sigma  # curve of the log at one step


def test_an_adc_without_room_is_refused(tmp_path) -> None:
    """Where the file is read for a command, and by a simulation in Python."""
    made = camera(tmp_path, NOISES | AUTO | {"adc.bits": 4, "exposure.gain": 1e5})
    with pytest.raises(BadInput, match=r"adc\.offset"):
        simulate(made)
    with pytest.raises(BadInput, match=r"adc\.offset"):
        checks.load(tmp_path / "made.yaml")


def test_telegraph_noise_has_room(tmp_path) -> None:
    """Traps in 60 % of the pixels, steps of 12 e: the mean square is that of the draws."""
    traps = {"pixel.readout.telegraph_noise": {"fraction": "60 %", "amplitude": "12 e"}}
    size = {"scene.radiance": "0 W/(sr m2)", "array.rows": 200, "array.columns": 200}
    fine = {"adc.bits": 16, "pixel.readout.full_well": "20 ke"}
    made = camera(tmp_path, AUTO | traps | size | fine)
    noise = math.sqrt(0.6 * 2 * 12**2 * 0.5 * 0.5)
    assert electrical(made).offset == fewest(noise, 2**16 - 1, 20_000)
    assert (simulate(made).frame.dn == 0).mean() < 5e-3


@pytest.mark.parametrize("pixel", [0, 30, 3000])
@pytest.mark.parametrize("own", [0.5, 20, 300])
@pytest.mark.parametrize("scale", [{}, {"adc.gain": "0.03 DN/e"}])
def test_the_noise_of_the_adc_has_room(scale, own: float, pixel: float, tmp_path) -> None:
    noise = {"pixel.readout.read_noise": f"{pixel} e", "adc.noise": f"{own} DN"}
    found = offset(tmp_path, noise | scale)
    steps = (lambda o: 0.03) if scale else (lambda o: (4095 - o) / WELL)
    assert found == next(o for o in range(4095) if o >= 4 * math.hypot(pixel * steps(o), own))


def test_it_is_written_as_a_word(tmp_path) -> None:
    """Beside a number, which is kept."""
    assert camera(tmp_path, {"adc": GONE}).model_dump(mode="json")["adc"]["offset"] == "auto"
    assert load("still-life").model_dump(mode="json")["adc"]["offset"] == "16 DN"


def _weighted(folder, given: str):
    captures = {"exposure.time": GONE, "exposure.captures": ["1 ms", "2 ms", "4 ms", "8 ms"]}
    faint = captures | {"exposure.estimator": "weighted", "scene.radiance": radiance_for(20, 8e-3)}
    size = {"array.rows": 200, "array.columns": 200, "adc.bits": 14}
    return simulate(
        camera(folder, faint | size | {"pixel.readout.read_noise": "30 e", "adc.offset": given})
    )


def test_weighted_samples_in_faint_light(tmp_path) -> None:
    """With the automatic offset they are right; without one they are wrong, and the run says so."""
    right, wrong = _weighted(tmp_path, "auto"), _weighted(tmp_path, "0 DN")
    truth = 20 / 8e-3
    spread = right.photocurrent.std() / 200
    assert abs(right.photocurrent.mean() - truth) < 5 * spread
    assert abs(wrong.photocurrent.mean() - truth) > 20 * spread
    assert not any("adc.offset" in note for note in right.notes)
    [note] = [note for note in wrong.notes if "adc.offset" in note]
    assert "100 %" in note


def test_an_offset_too_low_is_no_matter_in_bright_light(tmp_path) -> None:
    noisy = {"pixel.readout.read_noise": "30 e", "scene.radiance": radiance_for(5000)}
    assert not any("adc.offset" in n for n in simulate(camera(tmp_path, noisy)).notes)
