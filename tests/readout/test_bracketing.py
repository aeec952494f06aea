"""Brackets: exposures of their own, and the photocurrent that they make together."""

import math

import numpy as np
import pytest
from making import camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import read_exr

SIZE = {"array.rows": 200, "array.columns": 200, "effects": "all"}
PIXEL = SIZE | {
    "pixel.readout": {"full_well": "20 ke", "read_noise": "4 e"},
    "adc": {"bits": 14},
    "exposure": {"bracket": ["10 ms", "1 ms", "0.1 ms"]},
}


def bracket(folder, electrons: float, **changes):
    """A bracket of even light, of so many electrons in 10 ms."""
    return simulate(camera(folder, PIXEL | {"scene.radiance": radiance_for(electrons)} | changes))


def test_each_exposure_is_the_frame_of_its_time(tmp_path) -> None:
    """Noise of their own, the pattern of the sensor: nothing but that is common to two of them."""
    fpn = {"pixel.fpn": {"offset_pixel": "30 e"}}
    result = bracket(tmp_path, 2000, **fpn)
    single = simulate(
        camera(
            tmp_path,
            PIXEL | fpn | {"scene.radiance": radiance_for(2000), "exposure": {"time": "10 ms"}},
        )
    )
    assert result.times == (0.01, 0.001, 0.0001)
    np.testing.assert_array_equal(result.samples_dn[0], single.dn)
    np.testing.assert_array_equal(result.dn, single.dn)
    long, short, _ = result.samples_electrons.reshape(3, -1)
    error = 5 * math.sqrt(2900 * 1120 / long.size)
    assert np.cov(long, short)[0, 1] == pytest.approx(900, abs=error)
    assert short.mean() == pytest.approx(200, abs=5 * math.sqrt(1116 / long.size))


@pytest.mark.parametrize("rule", ["snr", "switch"])
@pytest.mark.parametrize(
    "electrons",
    long_except(
        [300, 20_000, 20_400, 199_000, 1e6],
        [300, 19_500, 20_000, 20_400, 1e5, 199_000, 202_000, 1e6],
    ),
)
def test_merged_mean_is_unbiased_through_the_switches(rule, electrons, tmp_path) -> None:
    """Within five standard errors, 0.25 % or less, of 40 000 pixels, clipping included."""
    exposure = PIXEL["exposure"] | {"merge": rule}
    found = bracket(tmp_path, electrons, exposure=exposure).photocurrent
    error = 5 * float(found.std()) / math.sqrt(found.size)
    assert found.mean(dtype=float) == pytest.approx(electrons / 0.01, abs=error)
    assert error < 2.5e-3 * electrons / 0.01


def test_merged_noise_is_the_least(tmp_path) -> None:
    """Inverse variances add: t_i^2 / (i t_i + r^2) over the exposures that do not saturate."""
    light, r2 = 3000 / 0.01, 16 + (20_000 / (2**14 - 1)) ** 2 / 12
    found = bracket(tmp_path, 3000).photocurrent
    best = 1 / sum(t**2 / (light * t + r2) for t in (0.01, 0.001, 0.0001))
    assert found.var(dtype=float) == pytest.approx(best, rel=5 * math.sqrt(2 / found.size))


def test_what_moves_moves_on_between_exposures(tmp_path) -> None:
    """An edge that runs 1 m/s is 1 ms later, by half of both exposures: v (t1 + t2) / 2."""
    motion = {"x": "0.5 m/s"}
    source = {"kind": "chart", "chart": "slanted-edge", "angle": "0 deg", "motion": motion}
    scene = {"scene.source": source, "exposure": {"bracket": ["2 ms", "2 ms"]}, "effects": "auto"}
    quiet = {"pixel.readout.read_noise": "0 e", "effects": {"shot_noise": "off"}}
    result = simulate(camera(tmp_path, PIXEL | scene | quiet | {"accuracy": "reference"}))
    first, second = (sample.mean(axis=0) for sample in result.samples_electrons)
    high, low = max(first.max(), 1), first.min()
    shift = float(np.abs(second - first).sum() / (high - low)) * result.frame.geometry.pitch_x
    expected = 0.5 * 2e-3 * abs(result.frame.geometry.scene_scale)
    assert shift == pytest.approx(expected, rel=0.02)


def test_a_ccd_takes_brackets_and_hdr_is_written(tmp_path) -> None:
    result = bracket(tmp_path, 3000, **{"pixel.architecture": "ccd"})
    result.save(tmp_path / "out")
    files = {path.name for path in (tmp_path / "out" / "captures").iterdir()}
    assert files == {"raw_001.exr", "raw_002.exr", "raw_003.exr"}
    channels, said = read_exr(tmp_path / "out" / "hdr.exr")
    np.testing.assert_array_equal(channels["photocurrent"], result.photocurrent)
    assert said["vcam:merge"] == "snr"
    metrics = result.metrics
    assert metrics["hdr_dynamic_range_db"] - metrics["dynamic_range_db"] == pytest.approx(40)


@pytest.mark.parametrize(
    ("given", "path"),
    [
        ({"bracket": ["10 ms"]}, r"exposure\.bracket"),
        ({"bracket": ["10 ms", "1 ms"], "time": "3 ms"}, "exposure"),
        ({"time": "10 ms", "merge": "switch"}, r"exposure\.merge"),
    ],
)
def test_contradictions_are_refused(given, path: str, tmp_path) -> None:
    with pytest.raises(BadInput, match=path):
        camera(tmp_path, PIXEL | {"exposure": given})
