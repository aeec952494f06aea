"""Several samples of one integration: their statistics, what stays, what they tell of the light."""

import itertools
import math

import numpy as np
import pytest
from making import GONE, QUIET, camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.noise.reset_noise import ResetNoise
from vcam_cli.effects.noise.shot_noise import ShotNoise
from vcam_cli.effects.pixel.dark_current import DarkCurrent
from vcam_cli.effects.pixel.saturation import Saturation
from vcam_cli.effects.signal_chain import Quantizer
from vcam_cli.errors import BadInput
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.readout import exposure, nondestructive_samples
from vcam_cli.solve.settings import camera_settings

SEEDS = {"sensor": 1, "frame": 1}
TIMES = (1e-3, 4e-3, 9e-3, 30e-3)
TEXTS = [f"{1000 * t:g} ms" for t in TIMES]
FINE = Quantization(0.0, 1.0, 24)
"""An ADC whose steps are electrons."""


def taken(rate, effects, times=TIMES, adc=FINE, shape=(300, 500), workers=2):
    """Samples of even light [e/s], in 64 bits."""
    return nondestructive_samples.samples(
        np.full(shape, float(rate)), times, effects, adc, SEEDS, workers
    )


def model(rate, times, read, reset):
    """The covariance of samples of a pixel [e^2], as in section 4 of the thesis and Liu 2003."""
    return rate * np.minimum.outer(times, times) + read * np.eye(len(times)) + reset


# --- statistics ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate", "dark"), [(2e4, 3e3), (600.0, 100.0), (0.0, 2e3)])
def test_covariance_of_samples(rate, dark):
    """Within five standard errors, sqrt((C_jj C_ll + C_jl^2) / n) of n normal numbers; a Poisson
    number of mean m adds C_jl / n to the square, which is below C^2 / n from m = 1 on."""
    effects = (DarkCurrent(dark), ShotNoise(), ResetNoise(15.0), ReadNoise(20.0))
    electrons, _ = taken(rate, effects)
    flat = electrons.reshape(len(TIMES), -1)
    n = flat.shape[1]
    expected = model(rate + dark, TIMES, 400.0, 225.0)
    found = np.cov(flat)
    diagonal = np.diag(expected)
    error = np.sqrt((np.outer(diagonal, diagonal) + expected**2 + expected) / n)
    assert np.all(np.abs(found - expected) < 5 * error)
    mean = (rate + dark) * np.array(TIMES)
    assert np.all(np.abs(flat.mean(1) - mean) < 5 * np.sqrt(diagonal / n))


def test_steps_of_charge_are_independent_poisson_numbers():
    electrons, _ = taken(2e3, (ShotNoise(),))
    steps = np.diff(electrons.reshape(4, -1), axis=0, prepend=0)
    assert np.array_equal(steps, np.rint(steps))
    assert steps.min() >= 0
    n = steps.shape[1]
    for step, mean in zip(steps, 2e3 * np.diff(TIMES, prepend=0), strict=True):
        # variance of the variance of a Poisson number: (m + 2 m^2) / n
        assert step.var() == pytest.approx(mean, abs=5 * math.sqrt((mean + 2 * mean**2) / n))
    between = np.corrcoef(steps)[np.triu_indices(4, 1)]
    assert np.abs(between).max() < 5 / math.sqrt(n)


def test_noise_of_columns_and_rows_is_new_in_each_sample():
    electrons, _ = taken(0.0, (ReadNoise(0.0, column=3.0, row=2.0),), shape=(200, 5000))
    column, row = electrons[:, 0] - electrons[:, :1, 0], electrons[:, :, 0] - electrons[:, :1, 0]
    assert np.allclose(electrons - electrons[:, :1, :1], column[:, None] + row[:, :, None])
    for lines, count in ((column, 5000), (row, 200)):
        between = np.corrcoef(lines)[np.triu_indices(4, 1)]
        assert np.abs(between).max() < 5 / math.sqrt(count)
    assert column.std(axis=1) == pytest.approx(3, rel=5 / math.sqrt(2 * 5000))


def test_fixed_pattern_and_reset_noise_are_the_same_in_all_samples():
    """Offsets, gains and dark currents are straight lines in time, up to rounding."""
    pattern = FixedPattern(3.0, 2.0, 0.01, 0.02, dark=0.3)
    electrons, _ = taken(1e5, (DarkCurrent(5e3), pattern, ResetNoise(10.0)))
    t = np.array(TIMES)
    slope = (electrons[3] - electrons[0]) / (t[3] - t[0])
    line = electrons[0] + slope * (t - t[0])[:, None, None]
    np.testing.assert_allclose(electrons, line, atol=1e-9)
    start = electrons[0] - slope * t[0]
    # offsets and reset noise; 500 columns only
    assert start.std() == pytest.approx(math.sqrt(9 + 4 + 100), rel=0.05)
    assert slope.std() / 1.05e5 > 0.02


# --- bytes ---------------------------------------------------------------------------------------

NOISY = {
    "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"},
    "scene.radiance": radiance_for(3000),
    "array.rows": 150,
    "array.columns": 70,
    "accuracy": "standard",
    "pixel.photodetector.dark_current": "5 ke/s",
    "pixel.readout": {
        "conversion_gain": "20 uV/e",
        "full_well": "4 ke",
        "read_noise": "5 e",
        "column_noise": "2 e",
        "row_noise": "2 e",
        "reset_noise": "ktc",
    },
    "pixel.fpn": {"dsnu": "2 e", "offset_column": "1 e", "prnu": "1 %", "dark": "5 %"},
    "pixel.defects": {"hot": 0.01, "dead": 0.01},
}


def several(*times: str, estimator: str = "lsbs") -> dict:
    return {"exposure": {"captures": list(times), "estimator": estimator}}


def test_same_bytes_for_any_number_of_workers(tmp_path):
    made = camera(tmp_path, NOISY | several(*TEXTS, estimator="weighted"))
    results = [simulate(made, workers=n) for n in (1, 2, 5)]
    for name in ("samples_electrons", "samples_dn", "photocurrent", "render"):
        assert len({getattr(r, name).tobytes() for r in results}) == 1
    assert results[0].samples_dn.shape == (4, 150, 70)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_sample_does_not_depend_on_those_that_follow(dtype, tmp_path):
    """Of the same light, byte by byte; and the first one is the frame of a single exposure."""
    frame = simulate(camera(tmp_path, NOISY | several(*TEXTS))).frame
    effects = tuple(e for e in frame.plan.active if not isinstance(e, Quantizer))
    rate = frame.rate.astype(dtype)
    long, codes = nondestructive_samples.samples(rate, TIMES, effects, frame.chain.adc, SEEDS, 1)
    assert long.dtype == dtype
    for count in (1, 2, 3):
        short, dn = nondestructive_samples.samples(
            rate, TIMES[:count], effects, frame.chain.adc, SEEDS, 1
        )
        assert short.tobytes() == long[:count].tobytes()
        assert dn.tobytes() == codes[:count].tobytes()
    single, dn = exposure.capture(rate, TIMES[0], effects, frame.chain.adc, SEEDS, 1)
    assert single.tobytes() == long[0].tobytes()
    assert dn.tobytes() == codes[0].tobytes()


def test_one_sample_is_the_frame_of_a_single_exposure(tmp_path):
    single = simulate(camera(tmp_path, NOISY | {"exposure": {"time": TEXTS[1]}}))
    one = simulate(camera(tmp_path, NOISY | several(TEXTS[1])))
    assert one.samples_electrons[0].tobytes() == single.electrons.tobytes()
    assert one.dn.tobytes() == one.samples_dn[0].tobytes() == single.dn.tobytes()
    assert one.exposure_time == single.exposure_time
    assert single.samples_dn is None
    assert single.photocurrent is None
    assert single.times == ()


def test_the_raw_frame_is_the_last_sample(tmp_path):
    result = simulate(camera(tmp_path, NOISY | several(*TEXTS)))
    assert result.exposure_time == TIMES[-1]
    assert result.times == TIMES
    assert np.array_equal(result.dn, result.samples_dn[-1])
    assert np.array_equal(result.electrons, result.samples_electrons[-1])
    second = result.frame.sample(1)
    assert second.exposure_time == TIMES[1]
    assert second.times == ()
    assert np.array_equal(second.dn, result.samples_dn[1])
    assert second.black_dn < result.frame.black_dn


@pytest.mark.parametrize("coarse", [False, True])
def test_stacked_pixels_are_sampled_layer_by_layer(coarse):
    rate = np.stack([np.full((70, 40), level) for level in (1e4, 2e4, 3e4)])
    effects = (ShotNoise(), ResetNoise(5.0), ReadNoise(3.0), FixedPattern(4.0, 1.0, 0.01, 0.01))
    electrons, dn = nondestructive_samples.samples(
        rate, TIMES, effects, FINE, SEEDS, 2, coarse_normals=coarse
    )
    assert electrons.shape == dn.shape == (4, 3, 70, 40)
    alone, codes = exposure.capture(rate, TIMES[0], effects, FINE, SEEDS, 1, coarse_normals=coarse)
    assert np.array_equal(electrons[0], alone)
    assert np.array_equal(dn[0], codes)
    noise = (electrons - electrons.mean(axis=(2, 3), keepdims=True)).reshape(4, 3, -1)
    assert abs(np.corrcoef(noise[3])[0, 1]) < 5 / math.sqrt(70 * 40)


# --- saturation ----------------------------------------------------------------------------------


def test_a_full_well_stays_full():
    """Where noise of the readout lifts a pixel to its well, later samples are not below it."""
    rate = np.linspace(0, 5e6, 64 * 400).reshape(64, 400)
    effects = (ShotNoise(), ReadNoise(300.0), Saturation(4000.0))
    times = tuple(np.linspace(1e-3, 12e-3, 12))
    electrons, dn = nondestructive_samples.samples(rate, times, effects, FINE, SEEDS, 1)
    full = electrons == 4000
    assert electrons.max() == 4000
    assert dn.max() == 4000
    assert np.array_equal(full, np.logical_or.accumulate(full))
    assert set(full.sum(axis=0).ravel().tolist()) == set(range(13)), "they fill in every sample"
    # Without memory, noise takes pixels back below the well.
    alone = np.stack([
        exposure.capture(rate, t, effects, FINE, SEEDS | {"frame": k}, 1)[0] >= 4000
        for k, t in enumerate(times)
    ])  # fmt: skip
    assert (np.logical_or.accumulate(alone) & ~alone).sum() > 50


def test_hot_and_dead_pixels_are_so_in_every_sample(tmp_path):
    changes = {
        "scene.radiance": radiance_for(5000),
        "pixel.defects": {"hot": 0.02, "dead": 0.03},
        "pixel.readout.read_noise": "5 e",
        "pixel.photodetector.dark_current": "10 ke/s",
        "array": {"rows": 150, "columns": 300, "pattern": "monochrome"},
    }
    result = simulate(camera(tmp_path, changes | several(*TEXTS)))
    hot, dead = result.electrons == 100e3, result.electrons < 100
    n = hot.size
    for found, share in ((hot, 0.02), (dead, 0.03)):
        assert found.sum() == pytest.approx(share * n, abs=5 * math.sqrt(share * n))
    assert np.all(result.samples_electrons[:, hot] == 100e3)
    assert np.abs(result.samples_electrons[:, dead]).max() < 5 * 6
    # what the codes of a full well say of a hot pixel, nothing but the dark rate of a dead one
    assert result.photocurrent[hot] == pytest.approx(100e3 / 1e-3 - 10e3, rel=1e-3)
    assert result.photocurrent[dead] == pytest.approx(-10e3, abs=6 * 6 / 30e-3)
    working = result.photocurrent[~hot & ~dead]
    assert working.mean() == pytest.approx(5e5, rel=1e-3)
    assert dict(result.metrics)["hdr_saturated_fraction"] == hot.mean()


# --- the photocurrent ----------------------------------------------------------------------------

FLAT = {
    "array": {"rows": 300, "columns": 400, "pattern": "monochrome"},
    "adc": {"bits": 14, "offset": "200 DN"},
    "pixel.photodetector.dark_current": "20 ke/s",
    "pixel.readout.read_noise": "40 e",
    "pixel.readout.reset_noise": "30 e",
}
PIXELS = 300 * 400
STEP = 100e3 / (2**14 - 1 - 200)
"""Electrons in a step of the ADC."""


@pytest.mark.parametrize("level", [300, 10e3])
def test_variance_of_the_weighted_estimate(level, tmp_path):
    """Within 3 % of 1 / (t' C^-1 t); the standard error of a variance is 0.4 % here. And without
    bias: five standard errors of the mean."""
    lit = FLAT | {"scene.radiance": radiance_for(level)}  # in the plain camera's 10 ms
    result = simulate(camera(tmp_path, lit | several(*TEXTS, estimator="weighted")))
    rate, t = 100 * level, np.array(TIMES)
    matrix = model(rate + 20e3, TIMES, 40**2 + STEP**2 / 12, 30**2)
    expected = 1 / (t @ np.linalg.solve(matrix, t))
    found = result.photocurrent.astype(np.float64)
    assert found.var() == pytest.approx(expected, rel=0.03)
    # Weights come from the estimate itself: each pixel is off by less than 1e-3 of its noise.
    assert found.mean() == pytest.approx(rate, abs=5 * math.sqrt(expected / PIXELS))
    last = simulate(camera(tmp_path, lit | several(*TEXTS))).photocurrent.astype(np.float64)
    assert last.var() == pytest.approx(matrix[-1, -1] / t[-1] ** 2, rel=0.03)
    assert last.mean() == pytest.approx(rate, abs=5 * math.sqrt(last.var() / PIXELS))
    assert found.var() < last.var()


@pytest.mark.parametrize("estimator", ["lsbs", "weighted"])
@pytest.mark.parametrize(
    ("full", "adc"),
    long_except(
        [(0, "linear"), (1, "logarithmic"), (2, "linear"), (3, "logarithmic")],
        itertools.product(range(4), ["linear", "logarithmic"]),
        several=True,
    ),
)
def test_light_is_measured_up_to_the_first_sample(estimator, adc, full, tmp_path):
    """In the last sample that is not full there are 60 % of the well: no pixel is near its end."""
    rate = 60e3 / TIMES[3 - full]
    changes = FLAT | {"scene.radiance": radiance_for(rate / 100), "adc.kind": adc}
    changes |= several(*TEXTS, estimator=estimator)
    result = simulate(camera(tmp_path, changes))
    assert np.all(result.samples_electrons[: 4 - full] < 100e3)
    assert np.all(result.samples_electrons[4 - full :] == 100e3)
    found = result.photocurrent.astype(np.float64)
    error = math.sqrt(found.var() / PIXELS)
    assert found.mean() == pytest.approx(rate, abs=5 * error + 1e-6 * rate)
    assert found.std() < 0.01 * rate


def test_all_pixels_full_in_the_first_sample(tmp_path):
    """A lower bound, and nothing that is not a number."""
    bright = FLAT | {"scene.radiance": radiance_for(1e7)}
    for estimator in ("lsbs", "weighted"):
        result = simulate(camera(tmp_path, bright | several(*TEXTS, estimator=estimator)))
        # the code of a full well, rounded
        assert result.photocurrent == pytest.approx(100e3 / 1e-3 - 20e3, rel=1e-4)
        metrics = dict(result.metrics)
        assert metrics["saturated_fraction"] == metrics["hdr_saturated_fraction"] == 1
        assert np.isfinite(result.linear).all()


def test_the_end_of_the_adc_counts_as_full(tmp_path):
    """An ADC that ends at a tenth of the well: its highest code is no measurement."""
    changes = {"scene.radiance": radiance_for(30e3), "adc": {"bits": 12, "full_scale": "0.2 V"}}
    result = simulate(camera(tmp_path, changes | several(*TEXTS)))
    # 3, 12, 27 and 90 ke of 10 ke
    assert np.all(result.samples_dn[1:] == 4095)
    assert result.photocurrent.mean() == pytest.approx(3e6, rel=0.01)


def test_darkness_with_a_lamp(tmp_path):
    """Nothing but a lamp five decades brighter than the patches, and the black cloth beside it."""
    chart = {"kind": "chart", "chart": "hdr-patches", "patches": 2, "dynamic_range": 2, "lamp": 1e5}
    changes = {
        "scene.source": chart,
        "scene.radiance": radiance_for(0.2),
        "effects": {"diffraction": "off"},
        "accuracy": "standard",
        "pixel.readout.read_noise": "10 e",
        "adc": {"bits": 14, "offset": "20 DN"},
    }
    result = simulate(camera(tmp_path, changes | several("0.1 ms", *TEXTS, estimator="weighted")))
    rate = result.frame.rate.astype(np.float64)
    lamp = rate > 0.5 * rate.max()
    assert 10 < lamp.sum() < rate.size / 10
    assert rate[lamp].mean() > 1e6
    assert not (result.samples_dn[0] >= 2**14 - 1).any()
    noise = np.sqrt(rate / 1e-4 + 10**2 / 1e-8)  # at least that of the first sample
    assert np.all(np.abs(result.photocurrent - rate)[lamp] < 6 * noise[lamp])
    # In the dark, read noise over the longest time, and the steps of the ADC
    dark = rate < 100
    assert dark.sum() > 0.9 * rate.size
    assert np.abs(result.photocurrent - rate)[dark].max() < 5 * 12 / TIMES[-1]


@pytest.mark.parametrize("reflectance", [0.2, 1.0])
def test_the_picture_shows_the_photocurrent_and_white_is_1(reflectance, tmp_path):
    """Though white fills the well 3 times in the last sample."""
    light = {"scene.radiance": radiance_for(100e3), "scene.source.reflectance": reflectance}
    changes = FLAT | light | {"processing": [{"black_level": "subtract"}], "quality": ["mse"]}
    result = simulate(camera(tmp_path, changes | several(*TEXTS)))
    assert result.linear.mean() == pytest.approx(reflectance, rel=1e-3)
    assert result.ideal.mean() == pytest.approx(reflectance, rel=1e-6)
    # the codes of the picture are those of the photocurrent in the last time, offset and dark there
    code = 200 + (result.photocurrent + 20e3) * TIMES[-1] / STEP
    np.testing.assert_allclose(result.frame.picture_dn, code, rtol=1e-5)
    assert result.frame.chain.saturated_dn == 2**14 - 1
    expected = 200 + 100e3 / TIMES[0] * TIMES[-1] / STEP
    assert result.frame.picture_saturated_dn == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("estimator", ["lsbs", "weighted"])
def test_dynamic_range_is_that_of_the_estimate(estimator, tmp_path):
    """The largest photocurrent that does not fill the first sample, over the noise in the dark."""
    result = simulate(camera(tmp_path, FLAT | several(*TEXTS, estimator=estimator)))
    matrix, t = model(20e3, TIMES, 40**2, 30**2), np.array(TIMES)
    variance = matrix[-1, -1] / t[-1] ** 2
    if estimator == "weighted":
        variance = 1 / (t @ np.linalg.solve(matrix, t))
    expected = 20 * math.log10((100e3 / TIMES[0] - 20e3) / math.sqrt(variance))
    metrics = dict(result.metrics)
    assert metrics["hdr_dynamic_range_db"] == pytest.approx(expected, abs=1e-9)
    single = simulate(camera(tmp_path, FLAT | {"exposure": {"time": TEXTS[-1]}}))
    assert "hdr_dynamic_range_db" not in dict(single.metrics)


def test_one_sample_tells_what_a_single_exposure_tells(tmp_path):
    one = simulate(camera(tmp_path, FLAT | several(TEXTS[0], estimator="weighted")))
    e = one.frame.electrical
    said = (one.dn - e.offset) * e.electrons_per_dn / TIMES[0] - 20e3
    np.testing.assert_allclose(one.photocurrent, said, rtol=1e-5, atol=1)
    metrics = dict(one.metrics)
    assert metrics["hdr_dynamic_range_db"] == pytest.approx(metrics["dynamic_range_db"], abs=1e-9)


def test_nothing_is_drawn_where_noise_is_switched_off(tmp_path):
    quiet = simulate(camera(tmp_path, NOISY | several(*TEXTS) | {"effects": QUIET}))
    times = np.array(TIMES, np.float32)[:, None, None]
    mean = np.minimum((quiet.frame.rate + np.float32(5e3)) * times, 4000)
    np.testing.assert_allclose(quiet.samples_electrons, mean, rtol=2e-6)


def test_memory_counts_the_samples(tmp_path):
    made = camera(tmp_path, FLAT | several(*TEXTS))
    frame = simulate(made).frame
    knobs = camera_settings(made)
    for codes in (2, 4):
        more, less = (
            memory_model.frame_bytes(frame.geometry, knobs, 1, False, n, codes=codes)
            for n in (1000, 500)
        )
        used = PIXELS * 500 * (knobs.float_width // 8 + codes)
        assert more - less == pytest.approx(memory_model.SLACK * used, rel=1e-6)
    assert memory_model.frame_bytes(frame.geometry, knobs, 1, False, 4) >= memory_model.frame_bytes(
        frame.geometry, knobs, 1, False
    )


def test_joined_charges_have_samples_as_one_pixel_has(tmp_path):
    """Four photodetectors on one node: four times the light and the dark current."""
    joined = {"rows": 300, "columns": 400, "binning": {"rows": 2, "columns": 2, "kind": "charge"}}
    lit = {"scene.radiance": radiance_for(4e3), "array": {**joined, "pattern": "monochrome"}}
    result = simulate(camera(tmp_path, FLAT | lit | several(*TEXTS, estimator="weighted")))
    assert result.samples_dn.shape == (4, 150, 200)
    rate, t = 4 * 400e3, np.array(TIMES)
    matrix = model(rate + 80e3, TIMES, 40**2 + STEP**2 / 12, 30**2)[:3, :3]  # 50 ke in the last
    variance = 1 / (t[:3] @ np.linalg.solve(matrix, t[:3]))
    found = result.photocurrent.astype(np.float64)
    assert found.mean() == pytest.approx(rate, abs=5 * math.sqrt(variance / found.size))
    assert found.var() < variance


@pytest.mark.parametrize("kind", ["voltage", "digital"])
def test_pixels_that_are_joined_after_they_are_read_are_refused(kind, tmp_path):
    binning = {"array.binning": {"rows": 2, "columns": 2, "kind": kind}}
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, binning | several(*TEXTS))
    (problem,) = caught.value.problems
    assert problem.path == ("exposure", "captures")
    assert "kind: charge" in problem.remedy
    assert kind in problem.message
    alone = {"array.binning": {"rows": 1, "columns": 1, "kind": kind}}
    assert camera(tmp_path, alone | several(*TEXTS)).exposure.samples == TIMES


def test_a_honeycomb_has_samples_too(tmp_path):
    changes = {"array.pattern": "honeycomb", "array.rows": 40, "processing": GONE}
    changes |= {"scene.illuminant": "D65", "scene.radiance": GONE, "scene.luminance": "100 cd/m2"}
    result = simulate(camera(tmp_path, changes | several(*TEXTS)))
    assert result.samples_dn.shape == (4, 40, 64)
    assert result.photocurrent.shape == (40, 64)
    assert result.render.ndim == 3
