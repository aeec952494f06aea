"""How a frame was exposed, as its metrics, `run.json` and the summary say it; the tone of a render.

The camera is `making.PLAIN` in even light: its signal is known from the light, in closed form.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from making import GONE, QUIET, camera, radiance_for, tree
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.simulation.figures import exposure_report

WELL, READ, DARK = 100_000, 12.0, 20_000.0  # the plain camera's well; noise and e/s of the tests
RATE = 2e6
"""Electrons a second of the white."""
NOISY = {
    "scene.radiance": radiance_for(RATE * 0.01),
    "pixel.readout.read_noise": f"{READ} e",
    "pixel.photodetector.dark_current": f"{DARK} e/s",
    "adc.offset": "100 DN",
    "array.rows": 160,
    "array.columns": 250,
}


@pytest.mark.parametrize("gain", [1, 8])
@pytest.mark.parametrize("time", ["50 us", "500 us", "4 ms"])
def test_picture_snr_against_exposure(time: str, gain: float, tmp_path) -> None:
    """i t / sqrt((i + i_dc) t + read^2 + q^2 / 12), told and measured on two frames.

    The rounding of codes much finer than the noise; 5 standard errors of mean and variance.
    """
    changes = NOISY | {"exposure.time": time, "exposure.gain": gain}
    frames = [simulate(camera(tmp_path, changes | {"seed.frame": seed})) for seed in (1, 2)]
    seconds = frames[0].exposure_time
    step = WELL / gain / (4095 - 100)
    variance = (RATE + DARK) * seconds + READ**2 + step**2 / 12
    expected = RATE * seconds / math.sqrt(variance)
    told = 10 ** (frames[0].metrics["picture_snr_db"] / 20)
    # Noise rounded in coarse steps is not q^2 / 12 sharp: the first term of Widrow's series.
    dithered = math.exp(-2 * (math.pi / step) ** 2 * (variance - step**2 / 12))
    uneven = dithered * (step / math.pi) ** 2 / variance
    assert told == pytest.approx(expected, rel=1e-6 + uneven)
    one, two = (step * (f.dn.astype(float) - 100) for f in frames)
    count = one.size
    noise = (one - two).var() / 2
    signal = (one + two).mean() / 2 - DARK * seconds
    error = math.sqrt(variance / (2 * count)) / (RATE * seconds)  # of the mean, relative
    error += math.sqrt((2 + 1 / variance) / count) / 2  # of the standard deviation
    assert abs(signal / math.sqrt(noise) / expected - 1) < 5 * error


def test_saturated_pixels_do_not_count_in_the_picture_snr(tmp_path) -> None:
    """Half of an edge's pixels are full: the SNR is that of the others."""
    step = {"kind": "chart", "chart": "step-wedge", "steps": 2, "density_range": 1.0}
    changes = {"scene.source": step, "optics.diffraction": False}
    changes |= {"scene.radiance": radiance_for(5 * WELL), "array.columns": 64}
    result = simulate(camera(tmp_path, changes))
    mean = result.mean_electrons
    assert 0.4 < (mean > WELL).mean() < 0.6
    low = float(mean[mean < WELL].mean())
    expected = 20 * math.log10(low / math.sqrt(low + (WELL / 4095) ** 2 / 12))
    assert result.metrics["picture_snr_db"] == pytest.approx(expected, abs=1e-3)
    full = simulate(camera(tmp_path, {"scene.radiance": radiance_for(5 * WELL)}))
    assert full.metrics["picture_snr_db"] == -math.inf
    assert simulate(camera(tmp_path, {"scene.radiance": "0 W/(sr m2)"})).metrics[
        "picture_snr_db"
    ] == -math.inf  # fmt: skip


@pytest.mark.parametrize("binning", ["charge", "voltage", "digital"])
def test_picture_snr_of_binned_pixels(binning: str, tmp_path) -> None:
    """Four pixels together: twice the SNR of shot noise, whatever is joined."""
    alone = NOISY | {"pixel.readout.read_noise": "0 e", "exposure.time": "4 ms", "adc.bits": 16}
    joined = alone | {"array.binning": {"rows": 2, "columns": 2, "kind": binning}}
    four, one = (simulate(camera(tmp_path, c)).metrics["picture_snr_db"] for c in (joined, alone))
    assert four - one == pytest.approx(20 * math.log10(2), abs=1e-3)


@pytest.mark.parametrize(
    ("gain", "bits", "most"), [(1, 12, WELL), (8, 12, WELL / 8), (1, 8, WELL), (0.5, 12, WELL)]
)
def test_dynamic_range_with_and_without_the_adc(gain, bits, most, tmp_path) -> None:
    """Eq 3.1 up to the end of well or codes, over read noise and q^2 / 12 (noise > q / 2)."""
    read = 300.0
    keys = {"exposure.gain": gain, "adc.bits": bits, "adc.offset": "0 DN"}
    found = simulate(camera(tmp_path, keys | {"pixel.readout.read_noise": f"{read} e"})).metrics
    assert found["dynamic_range_db"] == pytest.approx(20 * math.log10(WELL / read))
    step = WELL / gain / (2**bits - 1)
    expected = 20 * math.log10(most / math.sqrt(read**2 + step**2 / 12))
    assert found["quantized_dynamic_range_db"] == pytest.approx(expected, abs=1e-3)


def quiet(electrons: float, **changes) -> dict:
    """A noiseless camera of which white makes so many electrons."""
    return {"effects": QUIET, "adc.offset": "0 DN", "scene.radiance": radiance_for(electrons)} | (
        changes
    )


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
@pytest.mark.parametrize("share", [0.1, 0.39, 1.0, 4.0])
def test_digital_gain_brings_white_to_one(share: float, kind: str, tmp_path) -> None:
    changes = quiet(share * WELL) | {"adc": {"bits": 16, "kind": kind, "offset": "0 DN"}}
    result = simulate(camera(tmp_path, changes))
    assert result.metrics["digital_gain"] == pytest.approx(1 / share, rel=2e-3)  # a step of the log
    raw = np.minimum(share, 1.0)
    assert result.linear == pytest.approx(raw * result.metrics["digital_gain"], rel=2e-3)


def test_raw_peak_and_clipped_fractions(tmp_path) -> None:
    """Without noise, defects and offset, in codes: of the brightest pixel, by color."""
    wedge = {"kind": "chart", "chart": "step-wedge", "steps": 4, "density_range": 0.9}
    made = camera(tmp_path, quiet(0.6 * WELL) | {"scene.source": wedge, "adc.offset": "400 DN"})
    report = exposure_report(simulate(made).frame)
    assert report.raw_peak == pytest.approx(0.6, abs=1e-3)
    assert report.clipped == {"Y": 0.0}
    changes = {"array.pattern": "bayer-rggb", "scene.illuminant": "A", "exposure.time": "50 ms"}
    result = simulate(camera(tmp_path, quiet(WELL) | {"scene.source": wedge} | changes))
    report = exposure_report(result.frame)
    for number, color in enumerate("RGB"):
        full = result.electrons[result.color == number] >= WELL
        assert report.clipped[color] == pytest.approx(full.mean(), abs=1e-12)
    assert report.raw_peak == 1 > report.clipped["R"] > 0 == report.clipped["B"]


def tone(**keys) -> dict:
    return {"processing": [{"black_level": "subtract"}, {"tone": keys}, {"gamma": 1}]}


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_tone_with_the_sensors_white_shows_the_raw(share: float, tmp_path) -> None:
    """A tenth of saturation is a tenth of the render, where the scene's white would be all of it.

    Metrics know nothing of it. 8-bit codes: half of one is 0.002.
    """
    plain = simulate(camera(tmp_path, quiet(share * WELL)))
    result = simulate(camera(tmp_path, quiet(share * WELL) | tone(white="sensor")))
    assert np.all(plain.render == 255)
    assert result.render / 255 == pytest.approx(share, abs=0.002)
    assert np.array_equal(result.linear, plain.linear)
    assert result.metrics["digital_gain"] == 1
    brighter = simulate(
        camera(tmp_path, quiet(share * WELL) | tone(white="sensor", exposure="1 EV"))
    )
    assert brighter.render / 255 == pytest.approx(2 * share, abs=0.002)
    assert brighter.metrics["digital_gain"] == 2


def test_tone_with_black_in_the_picture(tmp_path) -> None:
    """Without black level the offset is part of the light: the last code is still white."""
    keys = {"processing": [{"tone": {"white": "sensor"}}, {"gamma": 1}], "adc.offset": "400 DN"}
    half = simulate(camera(tmp_path, quiet(0.5 * WELL) | keys))
    assert half.render / 255 == pytest.approx(half.dn / 4095, abs=0.002)


def test_the_filmic_curve_rolls_off(tmp_path) -> None:
    """Its published values: 0.8038 of white, 0.0309 + ... of less; two stops over white, not 1."""
    values = []
    for stops in (-20, -2, 0, 2):
        keys = tone(exposure=f"{stops} EV", curve="filmic")
        values.append(simulate(camera(tmp_path, quiet(0.5 * WELL) | keys)).render.flat[0] / 255)
    x = np.array([2.0**-20, 0.25, 1, 4])
    expected = (2.51 * x**2 + 0.03 * x) / (2.43 * x**2 + 0.59 * x + 0.14)
    assert values == pytest.approx(expected, abs=0.002)
    assert values[2] == pytest.approx(0.8038, abs=0.002)


@pytest.mark.parametrize(
    "steps",
    [
        [{"gamma": 2.2}, {"tone": {}}],
        [{"tone": {}}, {"black_level": "subtract"}],
        [{"tone": {"white": "brightest"}}],
        [{"tone": {"exposure": 1}}],
        [{"tone": "filmic"}],
    ],
)
def test_a_tone_that_cannot_work_is_refused(steps, tmp_path) -> None:
    with pytest.raises(BadInput, match="processing"):
        camera(tmp_path, {"processing": steps})


def test_a_run_says_how_it_was_exposed(tmp_path) -> None:
    """In words, and in `run.json`: 33 ms are not enough for a peak of 90 %."""
    changes = {"exposure.time": GONE, "exposure.auto": {"max": "33 ms"}}
    changes |= quiet(0.39 * WELL / 3.3)
    (tmp_path / "made.yaml").write_text(json.dumps(tree(changes)))
    out = tmp_path / "out"
    command = ["run", str(tmp_path / "made.yaml"), "-o", str(out)]
    done = CliRunner().invoke(app, command, prog_name="vcam")
    assert done.exit_code == 0, done.output
    assert "exposure     33 ms at gain 1, ISO " in done.stdout
    assert "automatic, stopped at its longest time\n" in done.stdout
    assert "raw          peak 39 % of full scale; clipped Y 0 %\n" in done.stdout
    said = json.loads(Path(out / "run.json").read_text())["exposure"]
    iso = said.pop("iso")
    assert iso == pytest.approx(json.loads((out / "run.json").read_text())["metrics"]["base_iso"])
    assert said == {
        "time": 0.033,
        "gain": 1.0,
        "automatic": True,
        "stopped_by": "longest time",
        "raw_peak": pytest.approx(0.39, abs=1e-6),
        "clipped": {"Y": 0.0},
    }


def test_every_shipped_mosaic_tells_its_colors() -> None:
    """Of a honeycomb and of stacked pixels, too: shares of the color's own pixels."""
    for name in ("cfa-honeycomb", "x3-stacked", "cfa-rgbw"):
        chart = "scene.source={kind: chart, chart: colorchecker}"
        sets = [chart, "exposure={time: 400 ms}", "array.rows=40", "array.columns=60"]
        frame = simulate(load(name, sets)).frame
        report = exposure_report(frame)
        assert set(report.clipped) == set(frame.mosaic.colors)
        assert 0 < max(report.clipped.values()) <= 1


def notes(folder: Path, changes: dict, word: str) -> list[str]:
    return [n for n in simulate(camera(folder, changes)).notes if word in n]


@pytest.mark.parametrize("key", ["exposure.gain", "exposure.iso"])
@pytest.mark.parametrize("share", [0.19, 0.5, 0.999, 1.0, 2.0])
def test_a_gain_that_leaves_codes_unused_is_told(key: str, share: float, tmp_path) -> None:
    """Behind a gain below 1 the well is full at that part of full scale; from 1 on all act."""
    base = simulate(camera(tmp_path)).metrics["base_iso"]
    found = notes(tmp_path, {key: share if key == "exposure.gain" else share * base}, "full scale")
    assert len(found) == (share < 1)
    assert all(f"pixels are full at {100 * share:.3g} %" in note for note in found)
    assert all(("below the base ISO" in note) == (key == "exposure.iso") for note in found)


def test_a_low_gain_before_an_adc_that_is_full_first_is_not_told(tmp_path) -> None:
    """At gain 1 its codes end at half the well: half the gain reaches all of it."""
    steep = {"adc.gain": f"{2 * 4095 / WELL!r} DN/e", "adc.offset": "0 DN"}
    assert not notes(tmp_path, steep | {"exposure.gain": 0.5}, "full scale")
    assert notes(tmp_path, steep | {"exposure.gain": 0.25}, "full scale")


@pytest.mark.parametrize("architecture", ["aps-3t", "ccd"])
def test_where_charge_beyond_the_well_goes_is_told(architecture: str, tmp_path) -> None:
    """In closed form: light of 3.5 wells leaves 2.5 of them; of one well nothing."""
    kind = {"pixel.architecture": architecture}
    bright = kind | {"scene.radiance": radiance_for(3.5 * WELL)}
    [note] = notes(tmp_path, bright, "excess charge")
    assert "2.5 times the capacity of all wells, is discarded" in note
    assert "blooming" in note
    assert ("smear" in note) == (architecture == "ccd")
    assert not notes(tmp_path, kind | {"scene.radiance": radiance_for(WELL)}, "excess charge")


@pytest.mark.parametrize("wells", [2.0, 9.9e4, 1.02e5, 3e6])
def test_light_too_bright_for_the_promise_is_told(wells: float, tmp_path) -> None:
    """In closed form: beyond a hundred thousand wells the note gives how often a well is filled."""
    found = notes(tmp_path, {"scene.radiance": radiance_for(wells * WELL)}, "than the tolerance")
    assert len(found) == (wells > 1e5)
    assert all(f"would fill a pixel {wells:.0f} times" in note for note in found)
