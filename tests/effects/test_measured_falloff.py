"""Relative illumination from a file: straight between its points, relative to the axis."""

import math
from itertools import pairwise

import numpy as np
import pytest
from making import QUIET, camera

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.optics.off_axis import MeasuredFalloff, OffAxis
from vcam_cli.errors import BadInput

ROWS = [(0.0, 2.0), (0.05, 1.9), (0.1, 1.2), (0.2, 0.8), (0.3, 0.0)]
"""Of an array whose corner is 0.2 mm from the axis; values of a lens program's own scale."""


def with_file(folder, text: str, **changes):
    (folder / "lens.csv").write_text(text)
    return camera(folder, {"optics.off_axis": {"file": "lens.csv"}} | changes)


def table(rows=ROWS) -> str:
    lines = [f"{height!r},{value!r}" for height, value in rows]
    return "\n".join(["# a lens", "image_height_mm,value", *lines, ""])


def straight(height: float) -> float:
    """By hand: the line between the points around a height [mm], over the value on the axis."""
    for (h0, v0), (h1, v1) in pairwise(ROWS):
        if h0 <= height <= h1:
            return (v0 + (v1 - v0) * (height - h0) / (h1 - h0)) / ROWS[0][1]
    raise ValueError(height)


def effect_of(folder, rows=ROWS) -> MeasuredFalloff:
    made = with_file(folder, table(rows))
    effect = OffAxis.from_camera(made, geometry(made))
    assert isinstance(effect, MeasuredFalloff)
    return effect


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 2e-5)])
def test_is_straight_between_the_points(dtype, tolerance, tmp_path):
    """32 bits: half an entry of a table of 131072, where the value falls steepest: by 0.35 in
    0.05 of 0.3 mm, 8e-6 of it; and positions rounded to 6e-8."""
    effect = effect_of(tmp_path)
    x = np.linspace(-1.6e-4, 1.6e-4, 41, dtype=dtype)
    y = np.linspace(-1.2e-4, 1.2e-4, 31, dtype=dtype)
    found = effect.gain(x, y)
    assert found.dtype == dtype
    assert found.shape == (31, 41)
    for i, j in ((0, 0), (15, 20), (15, 0), (3, 38), (30, 40), (7, 20)):
        height = 1e3 * math.hypot(float(x[j]), float(y[i]))
        assert found[i, j] == pytest.approx(straight(height), abs=tolerance)


def test_is_one_on_the_axis_and_at_its_points(tmp_path):
    effect = effect_of(tmp_path)
    at = np.array([height * 1e-3 for height, _ in ROWS])
    found = effect.gain(at, np.zeros(1))[0]
    np.testing.assert_allclose(found, [value / 2 for _, value in ROWS], atol=1e-12)


def test_a_camera_has_it(tmp_path):
    """The mean signal of a uniform scene over that without falloff, in every pixel."""
    quiet = {"effects": QUIET}
    measured = simulate(with_file(tmp_path, table(), **quiet)).mean_electrons
    plain = simulate(camera(tmp_path, quiet)).mean_electrons
    for row, column in ((0, 0), (23, 31), (24, 60), (47, 5)):
        height = 5e-3 * math.hypot(row - 23.5, column - 31.5)
        ratio = measured[row, column] / plain[row, column]
        assert ratio == pytest.approx(straight(height), rel=1e-9)


def test_a_value_above_the_axis_is_a_gain_above_one(tmp_path):
    effect = effect_of(tmp_path, [(0, 0.5), (0.3, 0.6)])
    assert effect.gain(np.array([0.15e-3]), np.zeros(1))[0, 0] == pytest.approx(1.1, rel=1e-12)
    assert "13.3 % brighter" in effect.describe()


def test_bound_of_its_change(tmp_path):
    """The rms over all pixels at full signal, to what its points over a quadrant miss."""
    effect = effect_of(tmp_path)
    x, y = (np.arange(64) - 31.5) * 5e-6, (np.arange(48) - 23.5) * 5e-6
    rms = math.sqrt(np.mean((effect.gain(x, y) - 1) ** 2))
    bound = effect.mean_error(SignalLevels(full_signal=10.0, time=1.0))
    assert 10 * rms <= bound <= 10.1 * rms


REFUSED = {
    "before the corner": (table(ROWS[:3]), "0.2 mm from the axis", "add rows up to 0.2 mm"),
    "no axis": (table(ROWS[1:]), "the value on the axis is missing", "rising from 0"),
    "falling": (table([*ROWS[:2], ROWS[1], *ROWS[2:]]), "0.05 mm follows 0.05 mm", "rising"),
    "negative": (table([*ROWS[:-1], (0.3, -0.1)]), "light is not negative", "columns"),
    "dark axis": (table([(0, 0.0), *ROWS[1:]]), "is 0 on the axis", "columns"),
    "not finite": (table([*ROWS[:-1], (0.3, math.nan)]), "not finite", "columns"),
    "another header": (table().replace("_mm", ""), "the header is", "image_height_mm,value"),
    "no rows": ("image_height_mm,value\n", "has no rows", "columns"),
    "nothing": ("", "is empty", "columns"),
    "words": (table() + "0.4,dark\n", "is not a row of numbers", "columns"),
    "a picture": ("\x89PNG\x00", "the header is", "columns"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refuses_what_is_no_falloff(name, tmp_path):
    text, message, remedy = REFUSED[name]
    with pytest.raises(BadInput) as caught:
        with_file(tmp_path, text)
    [problem] = caught.value.problems
    assert problem.path == ("optics", "off_axis", "file")
    assert message in problem.message
    assert remedy in problem.remedy
    assert "made.yaml:" in problem.where


def test_a_corner_met_but_for_rounding_is_reached(tmp_path):
    corner = 1e3 * math.hypot(64 * 5e-6, 48 * 5e-6) / 2
    with_file(tmp_path, table([(0, 1.0), (corner * (1 - 1e-12), 0.5)]))
    with pytest.raises(BadInput):
        with_file(tmp_path, table([(0, 1.0), (corner * 0.999, 0.5)]))


def test_a_file_that_is_gone_is_told(tmp_path):
    with pytest.raises(BadInput, match=r"lens\.csv"):
        camera(tmp_path, {"optics.off_axis": {"file": "lens.csv"}})


@pytest.mark.parametrize(("loss", "stays"), [(0.4, False), (1.5, True)])
def test_it_stays_where_a_corner_loses_more_than_half_the_tolerance(loss, stays, tmp_path):
    """However little that is in the mean: shot noise is promised in the darkest hundredth, too.

    `loss` is that of the corners over the tolerance.
    """
    tolerance, corner = 0.01, 5e-3 * math.hypot(24, 32)
    rows = [(0, 1), (0.9 * corner, 1), (corner, 1 - loss * tolerance)]
    changes = {"accuracy": tolerance, "effects": "auto"}
    found = simulate(with_file(tmp_path, table(rows), **changes))
    every = simulate(with_file(tmp_path, table(rows), **changes | {"effects": "all"}))
    change = found.mean_electrons / every.mean_electrons - 1
    assert np.sqrt(np.mean(change**2)) < 0.3 * tolerance
    assert ("off_axis" in {effect.name for effect in found.frame.plan.active}) == stays
