"""Noise of pixels, columns and rows: where it is the same, where it is not, and how strong."""

import math
from functools import partial

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.signal_chain import Site
from vcam_cli.rng import stream


def noise(folder, readout: dict, **changes) -> np.ndarray:
    """Of one frame of 150 rows, three blocks of them, and 200 columns [electrons]."""
    numbers = {f"pixel.readout.{name}": value for name, value in readout.items()}
    size = {"array.rows": 150, "array.columns": 200, "scene.radiance": radiance_for(500)}
    states = {"effects": QUIET | {"read_noise": "on"}}
    result = simulate(camera(folder, numbers | size | states | changes))
    return result.electrons - result.mean_electrons


def test_column_noise_runs_down_the_whole_frame(tmp_path):
    found = noise(tmp_path, {"column_noise": "3 e"})
    np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), atol=1e-9)
    assert len(np.unique(found[0].round(9))) == 200


def test_row_noise_runs_along_the_whole_frame(tmp_path):
    """Every row has its own, in all three blocks of rows."""
    found = noise(tmp_path, {"row_noise": "3 e"})
    np.testing.assert_allclose(found, np.broadcast_to(found[:, :1], found.shape), atol=1e-9)
    assert len(np.unique(found[:, 0].round(9))) == 150


@pytest.mark.parametrize("name", ["column_noise", "row_noise"])
def test_lines_are_new_in_every_frame(name, tmp_path):
    first = noise(tmp_path, {name: "3 e"})
    assert np.array_equal(first, noise(tmp_path, {name: "3 e"}, **{"seed.sensor": 9}))
    other = noise(tmp_path, {name: "3 e"}, **{"seed.frame": 9})
    correlation = np.corrcoef(first.ravel(), other.ravel())[0, 1]
    assert abs(correlation) < 5 / math.sqrt(150)  # as many independent numbers as lines, at least


def test_strengths(tmp_path):
    """Standard deviations of 150 to 200 lines, to five standard errors, 1 / sqrt(2 n)."""
    both = noise(tmp_path, {"read_noise": "2 e", "column_noise": "30 e", "row_noise": "50 e"})
    columns, rows = both.mean(0), both.mean(1)
    assert columns.std() == pytest.approx(30, rel=5 / math.sqrt(2 * 200))
    assert rows.std() == pytest.approx(50, rel=5 / math.sqrt(2 * 150))
    rest = both - columns - rows[:, None] + both.mean()
    assert rest.std() == pytest.approx(2, rel=5 / math.sqrt(2 * rest.size) + 1 / 150 + 1 / 200)


def test_parts_are_independent_and_add_up(tmp_path):
    """Each is what it is alone; 1e-9 is rounding of numbers near 500."""
    parts = {"read_noise": "2 e", "column_noise": "3 e", "row_noise": "5 e"}
    alone = [noise(tmp_path, {name: value}) for name, value in parts.items()]
    np.testing.assert_allclose(noise(tmp_path, parts), sum(alone), atol=1e-9)
    assert ReadNoise(2.0, 3.0, 5.0).variance(123.0) == 38


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_noise_of_pixels_has_the_stream_it_always_had(dtype):
    """The numbers of the stream `read_noise` of a block, times the noise, and nothing else."""
    site = Site(64, 30, partial(stream, 7, block=2), partial(stream, 7), dtype)
    found = ReadNoise(3.0).apply(np.zeros((64, 30), dtype), site)
    expected = stream(7, "read_noise", block=2).standard_normal((64, 30), dtype=dtype) * dtype(3)
    assert found.tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    ("readout", "said"),
    [
        ({"read_noise": "6 e"}, "6 e rms per pixel"),
        ({"read_noise": "6 e", "row_noise": "2 e"}, "6 e rms per pixel, 2 e per row"),
        ({"column_noise": "2 e"}, "0 e rms per pixel, 2 e per column"),
    ],
)
def test_says_what_there_is(readout, said, tmp_path):
    made = camera(tmp_path, {f"pixel.readout.{name}": value for name, value in readout.items()})
    assert ReadNoise.from_camera(made, None).describe() == said


def test_dynamic_range_has_all_noise_in_the_dark(tmp_path):
    """Eq 3.1 with the variance of pixel, column and row: 100 ke over 7 e."""
    readout = {"read_noise": "2 e", "column_noise": "3 e", "row_noise": "6 e"}
    numbers = {f"pixel.readout.{name}": value for name, value in readout.items()}
    metrics = dict(simulate(camera(tmp_path, numbers)).metrics)
    assert metrics["dynamic_range_db"] == pytest.approx(20 * math.log10(100e3 / 7), rel=1e-9)
