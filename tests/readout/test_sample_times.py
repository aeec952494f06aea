"""`captures: {schedule: optimal, ...}`: the camera finds the times that suit its scene."""

import json
from itertools import combinations

import numpy as np
import pytest
from making import camera, radiance_for
from typer.testing import CliRunner

from vcam_cli import simulate
from vcam_cli.commands.main import app
from vcam_cli.readout import sample_times
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Sensor

WEDGE = {
    "scene.source": {"kind": "chart", "chart": "step-wedge", "steps": 8, "density_range": 2},
    "scene.radiance": radiance_for(50e3),
    "pixel.photodetector.dark_current": "2 ke/s",
    "pixel.readout": {"conversion_gain": "20 uV/e", "full_well": "20 ke", "read_noise": "5 e"},
    "effects": {"diffraction": "off"},
    "accuracy": "standard",
}
"""Bars from 5 Me/s down to 50 ke/s; the brightest fills its well in 4 ms."""


def asked(count: int = 4, longest: str = "100 ms", **more) -> dict:
    chosen = {"schedule": "optimal", "count": count, "max": longest}
    return WEDGE | {"exposure": {"captures": chosen, **more}}


def snr(rate, times, well, dark, noise):
    """Mean SNR with the last sample before saturation, written out pixel by pixel (eq 4.1)."""
    total = 0.0
    for i in rate:
        open_ = [t for t in times if (i + dark) * t <= well * (1 + 1e-9)]
        if open_:
            t = max(open_)
            total += (i * t) ** 2 / ((i + dark) * t + noise**2)
    return total / len(rate)


def test_no_other_times_are_better(tmp_path):
    """Against every choice of three of 60 times beside the first, by the rates of the frame.

    Those of the schedule lie at brightest pixels of bins of a tenth of a percent.
    """
    frame = simulate(camera(tmp_path, asked(count=3))).frame
    rate = frame.rate.astype(float).ravel()
    rate = np.quantile(rate, (np.arange(200) + 0.5) / 200, method="nearest")  # of few steps
    times = frame.times
    e = frame.electrical
    pixel = Sensor(e.full_well, 2000.0, np.sqrt(25 + e.electrons_per_dn**2 / 12), max_time=0.1)
    pdf = Pdf.levels(frame.rate.astype(float).ravel(), np.ones(frame.rate.size))
    found = expected_snr(pdf, times, pixel)
    assert found == pytest.approx(snr(rate, times, 20e3, 2e3, pixel.read), rel=0.02)
    grid = np.geomspace(times[0], 0.1, 60)
    others = max(expected_snr(pdf, [times[0], *two], pixel) for two in combinations(grid, 2))
    assert found >= others * (1 - 2e-3)


def test_the_first_sample_just_does_not_fill_the_brightest_pixel(tmp_path):
    result = simulate(camera(tmp_path, asked()))
    brightest = float(result.frame.rate.max()) + 2000
    assert result.times[0] == pytest.approx(20e3 / brightest, rel=1e-6)
    assert result.times[-1] <= 0.1
    assert np.all(np.diff(result.times) > 0)
    assert len(result.times) == 4 == len(result.samples_dn)
    assert result.exposure_time == result.times[-1]


def test_the_same_samples_as_with_these_times_in_the_file(tmp_path):
    """Nothing else in the chain knows who chose the times."""
    chosen = simulate(camera(tmp_path, asked(estimator="weighted")))
    listed = {"captures": [f"{t!r} s" for t in chosen.times], "estimator": "weighted"}
    given = simulate(camera(tmp_path, WEDGE | {"exposure": listed}))
    assert given.times == chosen.times
    for name in ("samples_dn", "samples_electrons", "render"):
        assert getattr(given, name).tobytes() == getattr(chosen, name).tobytes()
    assert given.metrics == chosen.metrics


def test_the_photocurrent_is_found(tmp_path):
    """All bars within six sigma of shot, dark and read noise in the longest unsaturated sample."""
    result = simulate(camera(tmp_path, asked()))
    rate = result.frame.rate.astype(float)
    times = np.array(result.times)
    still = (rate + 2000) * times[:, None, None] + 6 * np.sqrt(20e3) < 20e3
    last = np.where(still.any(0), (still * times[:, None, None]).max(0), times[0])
    noise = np.sqrt((rate + 2000) / last + (5 / last) ** 2)
    assert np.all(np.abs(result.photocurrent - rate) < 6 * noise + 1e-3 * rate)


@pytest.mark.parametrize("changes", [{"array.pattern": "bayer-rggb"}, {"array.pattern": "stacked"}])
def test_arrays_of_colors_are_scheduled_too(changes, tmp_path):
    lit = {"scene.illuminant": "D65", "processing": []} | changes
    if changes["array.pattern"] == "stacked":
        lit["array.filters"] = {"R": 0.3, "G": 0.5, "B": 0.2}
    result = simulate(camera(tmp_path, asked() | lit))
    assert len(result.times) == 4
    assert np.isfinite(result.photocurrent).all()
    assert (float(result.frame.rate.max()) + 2000) * result.times[0] <= 20e3 * (1 + 1e-6)


def test_even_light_needs_one_sample(tmp_path):
    flat = {"scene.source": {"kind": "chart", "chart": "uniform"}}
    made = camera(tmp_path, asked() | flat | {"effects": {"diffraction": "off", "off_axis": "off"}})
    result = simulate(made)
    assert len(result.times) == 1
    (note,) = [n for n in result.notes if "best times" in n]
    assert "3 more of the 4 would gain nothing" in note


def test_darkness_is_sampled_once_as_long_as_it_may(tmp_path):
    black = {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0}}
    result = simulate(camera(tmp_path, asked() | black))
    assert result.times == (0.1,)
    full = asked(longest="100 s") | black
    assert simulate(camera(tmp_path, full)).times == pytest.approx((10.0,))  # 20 ke of 2 ke/s


def test_a_longest_time_that_fills_nothing_is_the_only_one(tmp_path):
    assert simulate(camera(tmp_path, asked(longest="1 ms"))).times == (0.001,)


def test_the_schedule_counts_what_the_plan_leaves_out(tmp_path):
    """It is made for the camera as described, whatever accuracy is asked for."""
    times = {
        simulate(camera(tmp_path, asked() | {"accuracy": a})).times for a in ("draft", "standard")
    }
    first, second = times if len(times) == 2 else (*times, *times)
    np.testing.assert_allclose(first, second, rtol=0.02)


def test_readout_and_reset_noise_count(tmp_path):
    noise = {"pixel.readout.reset_noise": "30 e", "effects": "all"}
    made = camera(tmp_path, asked() | noise)
    frame = simulate(made).frame
    effects = frame.plan.active
    pixel = sample_times.sensor(frame.chain.with_effects(effects), 0.1)
    step = frame.electrical.electrons_per_dn
    assert pixel.read == pytest.approx(np.sqrt(25 + step**2 / 12))
    assert (pixel.reset, pixel.dark, pixel.max_time) == (30.0, 2000.0, 0.1)
    assert pixel.well == frame.electrical.saturation


def test_a_run_says_the_times(tmp_path):
    made = camera(tmp_path, asked())
    out = tmp_path / "out"
    line = ["run", str(made.origin), "-o", str(out), "--json"]
    result = CliRunner().invoke(app, line, prog_name="vcam")
    assert result.exit_code == 0, result.output
    run = json.loads((out / "run.json").read_text("utf-8"))
    assert run["camera"]["exposure"]["captures"]["schedule"] == "optimal"
    times = [sample["time"] for sample in run["captures"]]
    assert times == list(simulate(made).times)
    (note,) = [n for n in run["notes"] if "best times" in n]
    assert f"{1000 * times[1]:.4g}" in note
    assert (out / "hdr.exr").exists()
    assert (out / "captures" / "raw_004.exr").exists()


def test_a_plan_says_the_times(tmp_path):
    made = camera(tmp_path, asked())
    shown = CliRunner().invoke(app, ["plan", str(made.origin)], prog_name="vcam")
    assert shown.exit_code == 0, shown.output
    assert "4 samples" in shown.stdout
    assert "best times for this scene" in shown.stderr
    told = CliRunner().invoke(app, ["plan", str(made.origin), "--json", "-q"], prog_name="vcam")
    plan = json.loads(told.stdout)
    assert plan["captures"] == list(simulate(made).times)
    assert plan["memory_bytes"] > 0
