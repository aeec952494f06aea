"""The fast path from planes to pixels against dense sums over every cosine term."""

import numpy as np
import pytest

from vcam_cli.engine import boxes, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.transfer import Tables


def tables(components, colors, top, size=4001):
    """Smooth, different tables that end at zero: what transfer functions look like."""
    f = np.linspace(0, 1, size)
    values = np.array(
        [
            [(1 - f) ** (1 + 0.3 * c) * (1 + 0.5 * r * f) for c in range(colors)]
            for r in range(components)
        ]
    )
    return Tables(np.eye(components), values, top, 0.0)


def dense(planes, x, y, table, along_x, along_y):
    """sum over kx, ky of every term's cosine at every photodetector; no folding, no FFT."""
    f = np.hypot(x.frequencies[None, :], y.frequencies[:, None])
    grid = np.linspace(0, table.top, table.values.shape[-1])

    def cosines(axis):
        k = np.arange(axis.terms)
        n = (np.arange(axis.samples) + 0.5) / axis.samples
        # coefficients of the mirrored staircase (or of what the cell means came from)
        box = np.sinc(k / 2 / axis.samples)
        box = box if axis.squares else 1 / box
        count = np.where(k == 0, 1, 2) / axis.samples
        analysis = np.cos(np.pi * np.outer(k, n)) * (box * count)[:, None]
        at = (axis.first + np.arange(axis.pixels) * axis.pixel_pitch) / axis.length
        return analysis, np.cos(np.pi * np.outer(at, k))

    ax, ex = cosines(x)
    ay, ey = cosines(y)
    out = []
    for c in range(table.values.shape[1]):
        total = 0
        for r, plane in enumerate(planes):
            h = np.interp(f, grid, table.values[r, c], right=0.0) * along_x * along_y[:, None]
            total = total + ey @ ((ay @ plane @ ax.T) * h) @ ex.T
        out.append(total)
    return np.array(out)


GRIDS = {
    "aligned": (Axis(24, 1.0, 24, 1.0, 0.5, True, 1.2), Axis(18, 1.0, 18, 1.0, 0.5, True, 1.2)),
    "coarse picture": (
        Axis(8, 3.0, 24, 1.0, 0.5, True, 1.5),
        Axis(6, 3.0, 18, 1.0, 0.5, True, 1.5),
    ),
    "fine chart": (
        Axis(48, 0.5, 20, 1.0, 2.5, False, 1.0),
        Axis(36, 0.5, 14, 1.0, 2.5, False, 1.0),
    ),
    "odd ratio": (Axis(20, 1.2, 24, 1.0, 0.5, True, 2.0), Axis(16, 1.2, 17, 1.0, 1.1, True, 2.0)),
    "off center": (Axis(24, 1.0, 24, 1.0, 0.7, True, 1.0), Axis(18, 1.0, 18, 1.0, 0.4, True, 1.0)),
}


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-7), (np.float32, 2e-4)])
def test_filter_equals_the_dense_sum(grid, dtype, tolerance):
    # float64: the table is read linearly by both; they differ by rounding at its nodes.
    # float32: the nearest of 4001 entries, 1.25e-4 of full scale at most.
    x, y = GRIDS[grid]
    planes = np.random.default_rng(2).random((2, y.samples, x.samples))
    table = tables(2, 3, top=1.6)
    along_x, along_y = np.sinc(x.frequencies * 0.6), np.sinc(y.frequencies * 0.8)
    expected = dense(planes, x, y, table, along_x, along_y)
    coefficients = sampling.spectrum(planes.astype(dtype), workers=1)
    series = sampling.Filter(x, y, table, along_x, along_y).apply(coefficients, workers=1)
    got = np.array([series(color, slice(None)) for color in range(3)])
    assert got.dtype == dtype
    np.testing.assert_allclose(got, expected, atol=tolerance)


def test_same_bytes_for_any_number_of_workers():
    rng = np.random.default_rng(3)
    x = Axis(150, 1.1, 160, 1.0, 0.5, True, 1.0)
    y = Axis(140, 1.1, 150, 1.0, 0.5, True, 1.0)
    planes = rng.random((2, y.samples, x.samples)).astype(np.float32)
    frames = []
    for workers in (1, 2, 5):
        c = sampling.spectrum(planes.copy(), workers)
        f = sampling.Filter(x, y, tables(2, 3, 1.2), np.ones(x.terms), np.ones(y.terms))
        frames.append(f.apply(c, workers).cosines.tobytes())
    assert frames[0] == frames[1] == frames[2]


def test_uniform_light_stays_uniform():
    x, y = GRIDS["odd ratio"]
    c = sampling.spectrum(np.full((1, y.samples, x.samples), 0.7), 1)
    f = sampling.Filter(x, y, tables(1, 1, 1.6), np.ones(x.terms), np.ones(y.terms))
    got = f.apply(c, 1)(0, slice(None))
    np.testing.assert_allclose(got, 0.7, atol=1e-12)


def test_filter_approaches_boxes_as_the_bandwidth_grows():
    """Without optical blur the spectrum's way and the exact one meet, as 1 / bandwidth."""
    errors = []
    for bandwidth in (2.0, 20.0):
        x = Axis(20, 1.2, 24, 1.0, 0.5, True, bandwidth)
        y = Axis(15, 1.2, 18, 1.0, 0.5, True, bandwidth)
        plane = np.random.default_rng(5).random((15, 20))
        flat = Tables(np.eye(1), np.ones((1, 1, 2)), 1e3, 0.0)
        c = sampling.spectrum(plane[None].copy(), 1)
        f = sampling.Filter(x, y, flat, np.sinc(x.frequencies * 0.7), np.sinc(y.frequencies * 0.7))
        got = f.apply(c, 1)(0, slice(None))
        errors.append(np.abs(got - boxes.of_samples(plane, x, y, 0.7, 0.7)).max())
    assert errors[0] < 0.06
    assert errors[1] < errors[0] / 5
