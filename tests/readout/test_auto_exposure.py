"""Exposure time: given, or chosen so that white or a percentile reaches its share of the well."""

import numpy as np
import pytest
from making import GONE, QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.readout.auto_exposure import percentile

WELL = 100_000  # of the plain camera
QUIETLY = {"effects": QUIET, "scene.radiance": radiance_for(5000, time=0.01)}
RATE = 5000 / 0.01  # electrons a second of its white


def auto(**keys) -> dict:
    return QUIETLY | {"exposure.time": GONE, "exposure.auto": {"max": "10 s"} | keys}


def run(folder, changes):
    return simulate(camera(folder, changes))


def test_a_given_time_is_taken_as_it_is(tmp_path):
    result = run(tmp_path, QUIETLY | {"exposure.time": "1/60 s"})
    assert result.exposure_time == 1 / 60
    np.testing.assert_allclose(result.mean_electrons, RATE / 60, rtol=1e-12)


@pytest.mark.parametrize("target", [0.9, 0.25, 1])
def test_white_reaches_the_target(target, tmp_path):
    """White itself, whatever the scene reflects: 18 % of it here."""
    result = run(tmp_path, auto(target=target) | {"scene.source.reflectance": 0.18})
    assert result.exposure_time == pytest.approx(target * WELL / RATE, rel=1e-9)
    np.testing.assert_allclose(result.mean_electrons, 0.18 * target * WELL, rtol=1e-9)


def test_default_is_nine_tenths_of_the_well_for_white(tmp_path):
    result = run(tmp_path, auto())
    np.testing.assert_allclose(result.mean_electrons, 0.9 * WELL, rtol=1e-9)


@pytest.mark.parametrize("percent", [50, 90, 99.9, 100, 0])
def test_percentile_reaches_the_target(percent, tmp_path):
    """That share of the pixels is at or below the target, to a pixel of the 3072."""
    chart = {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"}
    changes = auto(method="percentile", percentile=percent, target=0.5) | {"scene.source": chart}
    mean = run(tmp_path, changes).mean_electrons
    at_most = np.mean(mean <= 0.5 * WELL * (1 + 1e-9))
    assert at_most == pytest.approx(percent / 100, abs=1.01 / mean.size)
    assert np.abs(mean - 0.5 * WELL).min() < 1e-6 * WELL


@pytest.mark.parametrize("method", ["white", "percentile"])
def test_dark_current_takes_its_share_of_the_well(method, tmp_path):
    dark = {"pixel.photodetector.dark_current": "200 ke/s"}
    result = run(tmp_path, auto(method=method) | dark)
    np.testing.assert_allclose(result.mean_electrons, 0.9 * WELL, rtol=1e-9)
    assert result.exposure_time == pytest.approx(0.9 * WELL / (RATE + 2e5), rel=1e-9)


@pytest.mark.parametrize(
    ("limits", "time"),
    [({"max": "100 ms"}, 0.1), ({"max": "10 s", "min": "2 s"}, 2.0), ({"max": "10 s"}, 0.18)],
)
@pytest.mark.parametrize("method", ["white", "percentile"])
def test_the_time_stays_within_its_limits(method, limits, time, tmp_path):
    """White would take 180 ms."""
    result = run(tmp_path, auto(method=method, **limits))
    assert result.exposure_time == pytest.approx(time, rel=1e-9)


def test_the_adc_may_be_full_before_the_well(tmp_path):
    """4095 codes of a fifth of a DN per electron: full at 20 475 electrons."""
    result = run(tmp_path, auto(target=1) | {"adc.gain": "0.2 DN/e"})
    np.testing.assert_allclose(result.mean_electrons, 4095 / 0.2, rtol=1e-9)
    assert np.all(result.dn == 4095)


def test_white_is_that_of_the_brightest_color(tmp_path):
    """Under daylight no color of a white sheet is over the target, and one of them is on it."""
    day = {
        "scene.illuminant": "D65",
        "array.pattern": "bayer-rggb",
        "optics.transmittance": "ir-cut-650",
    }
    mean = run(tmp_path, auto() | day).mean_electrons
    colors = [mean[0, 0], mean[0, 1], mean[1, 0], mean[1, 1]]
    assert max(colors) == pytest.approx(0.9 * WELL, rel=1e-9)
    assert min(colors) < 0.8 * WELL


def test_no_light_at_all_takes_the_longest_time(tmp_path):
    changes = auto(method="percentile") | {"scene.source.reflectance": 0}
    result = run(tmp_path, changes)
    assert result.exposure_time == 10
    assert not result.mean_electrons.any()


def test_percentile_is_a_value_of_the_picture():
    values = np.random.default_rng(1).permutation(1000.0 * np.arange(200)).reshape(10, 20)
    assert percentile(values, 100) == 199_000
    assert percentile(values, 50) == 99_000
    assert percentile(values, 0) == 0
    assert percentile(values, 99.5) == 198_000


@pytest.mark.parametrize("target", [0.18, 1])
def test_the_mean_reaches_the_target(target, tmp_path):
    """The mean over all pixels, bright ones beyond the well as they are."""
    chart = {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"}
    changes = auto(method="mean", target=target) | {"scene.source": chart}
    mean = run(tmp_path, changes).mean_electrons
    assert mean.mean() == pytest.approx(target * WELL, rel=1e-12)
    assert mean.max() > 1.2 * mean.mean()


def test_the_mean_is_that_of_the_mosaic(tmp_path):
    """Twice as many green pixels as red ones or blue ones count twice; the dark counts too."""
    day = {
        "scene.illuminant": "D65",
        "array.pattern": "bayer-rggb",
        "pixel.photodetector.dark_current": "50 ke/s",
    }
    mean = run(tmp_path, auto(method="mean", target=0.3) | day).mean_electrons
    colors = [mean[0, 0], mean[0, 1], mean[1, 0], mean[1, 1]]
    assert np.mean(colors) == pytest.approx(0.3 * WELL, rel=1e-9)
    assert max(colors) > 1.1 * min(colors)


def test_the_mean_keeps_the_limits(tmp_path):
    assert run(tmp_path, auto(method="mean", max="100 ms")).exposure_time == 0.1
