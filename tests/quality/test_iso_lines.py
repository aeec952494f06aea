"""Lines of equal difference: running means, envelopes, and where a level is reached."""

import numpy as np
import pytest

from vcam_cli.quality import iso_lines


def test_running_means_are_integrals_over_their_windows():
    """Against the mean of the map drawn a hundred times finer."""
    rng = np.random.default_rng(1)
    values, widths = rng.random((3, 20)), rng.uniform(1, 7, 20)
    found = iso_lines.moving_average(values, widths, 1)
    fine = np.repeat(values, 1000, axis=1)
    for column in range(20):
        half = min(widths[column] / 2, column + 0.5, 20 - column - 0.5)
        low, high = (round(1000 * (column + 0.5 + s * half)) for s in (-1, 1))
        # The ends of the window are rounded to a thousandth of a pixel.
        expected = fine[:, low:high].mean(axis=1)
        np.testing.assert_allclose(found[:, column], expected, atol=2e-3)


def test_what_rises_steadily_stays_as_it_is():
    slope = np.add.outer(np.linspace(0, 3, 17), np.linspace(1, 2, 23))
    np.testing.assert_allclose(iso_lines.moving_average(slope, 6.3, 4.4), slope, rtol=1e-12)


def test_the_envelope_of_bars_is_their_crest():
    x = np.arange(200)
    bars = 2 + np.cos(2 * np.pi * x / 10)[None, :] * np.array([[1.0], [0.5]])
    found = iso_lines.envelope(bars, np.full(200, 10.0))
    np.testing.assert_allclose(found, np.broadcast_to([[3.0], [2.5]], found.shape), atol=1e-12)


def test_windows_are_a_period_within_limits():
    widths = iso_lines.averaging_widths(np.array([0.0, 1e3, 10e3, 1e6]), 10e-6, 240)
    np.testing.assert_allclose(widths, [20, 20, 10, 7.5])


def test_heights_are_where_the_level_is_first_reached():
    scale = np.linspace(0, 1, 101)
    columns = np.stack([4 * scale, 0 * scale, 5 + scale, 8 * scale * (1 - scale)], axis=1)
    found = iso_lines.level_heights(columns, scale, 1.5)
    assert found[0] == pytest.approx(0.375, abs=1e-12)
    assert np.isnan(found[1])
    assert found[2] == 0
    assert found[3] == pytest.approx(0.25, abs=1e-4)  # straight between rows of a parabola


def test_contours_of_a_cone_are_circles():
    x, y = np.linspace(-2, 2, 81), np.linspace(-1, 1, 41)
    (circle,) = iso_lines.contours(np.hypot(x, y[:, None]), x, y, 0.7)
    np.testing.assert_allclose(np.hypot(*circle.T), 0.7, atol=1e-3)
    assert iso_lines.contours(np.zeros((4, 4)), x[:4], y[:4], 1.0) == []
