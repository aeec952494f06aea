"""Columns of numbers that are drawn here: edges, slow parts, planes of a mosaic."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from making import long_except

from vcam_cli.fitting import conditions, sensor
from vcam_cli.fitting.pattern import pattern
from vcam_cli.verification.stack_statistics import Estimate, stack_statistics

PIXEL, COLUMN, NOISE, FRAMES = 5.0, 2.5, 3.0, 4


def column_variances(rows, columns, slow=0.0, edge=0, count=60):
    """The patterns of so many sensors: slow rms of a half cosine, so many bright edge columns."""
    good, out = np.ones((rows, columns), bool), []
    for seed in range(count):
        rng = np.random.default_rng([11, rows, columns, edge, seed])
        fixed = PIXEL * rng.standard_normal((rows, columns)) + COLUMN * rng.standard_normal(columns)
        fixed += slow * math.sqrt(2) * np.cos(np.pi * (np.arange(columns) + 0.5) / columns)
        fixed[:, :edge] += np.linspace(60, 30, edge)
        frames = 500 + fixed + NOISE * rng.standard_normal((FRAMES, rows, columns))
        out.append(pattern(stack_statistics(frames, good), good))
    return out


@pytest.mark.parametrize(
    ("slow", "edge", "columns"),
    long_except(
        [(6.0, 0, 48), (6.0, 10, 200)],
        [(0.0, 0, 48), (6.0, 0, 48), (0.0, 10, 200), (6.0, 10, 200)],
        several=True,
    ),
)
def test_the_spread_of_columns_knows_no_slow_part_and_no_edge(slow, edge, columns):
    """Without bias: to five standard errors, of columns that are alike; the error is its own."""
    found = column_variances(48, columns, slow, edge)
    values = np.array([p.column.value for p in found])
    errors = np.array([p.column.error for p in found])
    reach = 5 * errors.mean() / math.sqrt(len(found))
    assert values.mean() == pytest.approx(COLUMN**2, abs=reach)
    # Aliens that are not found would make it many times as large, and a slow part whose cosines
    # are not counted in the divisor 9 % smaller.
    assert reach < 0.16 * COLUMN**2
    assert values.std() / errors.mean() == pytest.approx(1, abs=5 / math.sqrt(2 * len(found)))
    assert [p.alien for p in found] == [tuple(range(edge))] * len(found)
    if slow:
        assert np.mean([p.slow.value for p in found]) == pytest.approx(slow**2, rel=0.02)


def test_dead_pixels_are_told_by_the_light_of_their_color():
    """Red sees 4 % of green's light, which no dead pixel is told by; blue sees half."""
    mosaic = SimpleNamespace(pattern="bayer-rggb")
    dark, lit = np.full((20, 20), 60.0), np.full((20, 20), 60.0 + 2000)
    lit[::2, ::2], lit[1::2, 1::2] = 60.0 + 80, 60.0 + 1000
    lit[3, 4], lit[5, 5], lit[2, 2] = 60, 61, 60
    stacks = [
        (SimpleNamespace(exposure=0.01, is_dark=True), dark),
        (SimpleNamespace(exposure=0.01, is_dark=False), lit),
    ]
    found = conditions._defects(stacks, 4095, mosaic)
    assert [tuple(place) for place in np.argwhere(found.dead)] == [(3, 4), (5, 5)]
    assert found.judged.sum() == 300
    assert not found.hot.any()
    assert found.good.sum() == 398


def test_columns_unlike_the_others_are_named():
    seen = SimpleNamespace(alien=(0, 1, 2, 7, 30, 31), largest=-12.34)
    stack = SimpleNamespace(label="flat", patterns={"Y": seen})
    [note] = conditions.alien_columns([(stack, "Y")])
    assert note.startswith(
        "flat: columns 0 to 2, 7, 30 to 31 are unlike the others, by up to -12.3"
    )
    seen.alien = ()
    assert conditions.alien_columns([(stack, "Y")]) == []


def test_planes_of_a_mosaic_share_the_noise_of_their_lines():
    """Four planes of a frame that was drawn whole: the error is the scatter of such frames."""
    rng, found = np.random.default_rng(12), []
    good = np.ones((24, 24), bool)
    for _ in range(150):
        frames = 3 * rng.standard_normal((5, 48, 48)) + 2 * rng.standard_normal((5, 1, 48))
        planes = [stack_statistics(frames[:, i::2, j::2], good) for i in (0, 1) for j in (0, 1)]
        whole = conditions.Condition(None, "", {"Y": tuple(planes)}, {}, 0, {})
        found.append(whole.lines("column"))
    values = np.array([each.value for each in found])
    errors = np.array([each.error for each in found])
    assert values.mean() == pytest.approx(4, abs=5 * values.std() / math.sqrt(len(found)))
    assert values.std() / errors.mean() == pytest.approx(1, abs=5 / math.sqrt(2 * len(found)))


def test_dark_current_makes_no_tails():
    """Poisson numbers of 1.5 electrons beside 2 of read noise, 0.5 DN each: none are left."""
    rng = np.random.default_rng(13)
    electrons = rng.poisson(1.5, (16, 200, 200)) + 2 * rng.standard_normal((16, 200, 200))
    told = stack_statistics(100 + 0.5 * electrons, np.ones((200, 200), bool))
    dark = conditions.Condition(SimpleNamespace(exposure=1e-3), "", {"Y": (told,)}, {}, 0, {})
    line = sensor.Dark(Estimate(100, 0.1), Estimate(0.5 * 1.5 / 1e-3, 1))
    found = sensor.readout_excess(dark, line, Estimate(0.5, 0.001))
    assert told.excess.value > 5 * told.excess.error
    assert abs(found.value) < 5 * found.error
