"""From a spectrum to the pixels: the stretched and folded computation against dense sums."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import aperture, of_picture, path, sensor

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation import filtering
from vcam_cli.image_formation.box_average import box_averages
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates.bandwidth import axes
from vcam_cli.image_formation.filtering import Filter, chebyshev
from vcam_cli.image_formation.scene_spectrum import transform_planes
from vcam_cli.image_formation.strategies import PERIODS, SMOOTH
from vcam_cli.image_formation.transfer_tables import Tables, TableSize, tabulate
from vcam_cli.physics.diffraction import otf_circular


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


def filter_of(x, y, table, along_x=None, along_y=None):
    """A filter as the engine makes it, of blurs without a phase."""
    along = [np.ones(a.terms) if f is None else f for a, f in ((x, along_x), (y, along_y))]
    return Filter(x, y, table, *along, cubic_range=table.top / SMOOTH)


def dense(planes, x, y, table, along_x, along_y):
    """sum over kx, ky of every term's cosine at every photodetector; no folding, no FFT."""
    f = np.hypot(x.frequencies[None, :], y.frequencies[:, None])
    grid = np.linspace(0, table.top, table.radial.shape[-1])

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
    for c in range(table.radial.shape[1]):
        total = 0
        for r, plane in enumerate(planes):
            h = np.interp(f, grid, table.radial[r, c], right=0.0) * along_x * along_y[:, None]
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
    x, y = GRIDS[grid]
    planes = np.random.default_rng(2).random((2, y.samples, x.samples))
    table = tables(2, 3, top=1.6)
    along_x, along_y = np.sinc(x.frequencies * 0.6), np.sinc(y.frequencies * 0.8)
    expected = dense(planes, x, y, table, along_x, along_y)
    spectrum = transform_planes(planes.astype(dtype), workers=1)
    series = filter_of(x, y, table, along_x, along_y).apply(spectrum, workers=1)
    got = np.array([series.signal(color, slice(None)) for color in range(3)])
    assert got.dtype == dtype
    np.testing.assert_allclose(got, expected, atol=tolerance)


LARGE = {
    "folded": (Axis(300, 1.0, 300, 1.0, 0.5, True, 0.8), Axis(340, 1.0, 340, 1.0, 0.5, True, 0.8)),
    "off center": (
        Axis(300, 1.0, 260, 1.0, 20.8, True, 0.8),
        Axis(340, 1.0, 330, 1.0, 5.3, True, 0.8),
    ),
    "chirp": (Axis(300, 1.0, 240, 1.1, 3.3, True, 0.8), Axis(340, 1.0, 290, 1.13, 1.4, True, 0.8)),
}


def every_row(monkeypatch):
    """Makes every row of a spectrum have its own transfer function."""
    monkeypatch.setattr(filtering, "SHORTEST", 1 << 30)


@pytest.mark.parametrize("grid", LARGE)
@pytest.mark.parametrize("lens", ["diffraction", "gaussian"])
def test_stretches_of_rows_are_those_of_every_row(grid, lens, monkeypatch):
    """The cubic through Chebyshev's nodes errs by less than 1e-4 of a term; most do by much less.

    Hundreds of rows, noise, so that all terms count alike: their errors add up as their squares.
    """
    x, y = LARGE[grid]
    f = np.linspace(0, 1.14, 8001)  # as far as the corner of the spectrum
    values = {
        "diffraction": otf_circular(f, 1.0, 1.1),
        "gaussian": np.exp(-2 * (np.pi * 0.7 * f) ** 2),
    }[lens]
    filter = filter_of(x, y, Tables(np.eye(1), values[None, None], f[-1], 0.0))
    plane = np.random.default_rng(0).standard_normal((1, y.samples, x.samples))
    spectrum = transform_planes(plane.copy(), 1)
    stretched = filter.apply(spectrum, 1).signal(0, slice(None))
    every_row(monkeypatch)
    rows = replace(filter).apply(spectrum, 1).signal(0, slice(None))
    assert 0 < np.abs(stretched - rows).max() < 1e-4
    expected = dense(plane, x, y, filter.tables, filter.along_x, filter.along_y)[0]
    np.testing.assert_allclose(rows, expected, atol=1e-9)


def test_stretches_cover_every_row_once():
    x, y = LARGE["folded"]
    filter = filter_of(x, y, tables(1, 1, 1.6))
    for first, count, step in ((0, 0, 1), (0, 1, 1), (0, 340, 1), (400, 128, 1), (127, 128, -1)):
        terms = first + step * np.arange(count)
        parts = [terms[s] for s in filter._stretches(terms)]
        np.testing.assert_array_equal(np.concatenate([[], *parts]), terms)
        assert all(len(part) <= filtering.LONGEST for part in parts)
        for part in parts:
            lowest, highest = part.min(), part.max()
            assert len(part) < filtering.SHORTEST or highest <= filtering.GROWTH * lowest + 1


def test_a_stretch_is_short_enough_for_the_cusp_of_an_otf():
    """At low frequencies an OTF loses a x |f|: along a line beside the origin a rounded cusp."""
    at = np.linspace(1, filtering.GROWTH, 101)
    nodes, weights = chebyshev(at)
    for beside in np.geomspace(1e-3, 10, 60):
        lost = np.hypot(beside, at)
        assert np.abs(weights @ np.hypot(beside, nodes) - lost).max() <= 2e-5 * lost.max()


def test_a_part_of_a_table_is_a_cubic_up_to_the_cut_off_of_a_lens():
    """Of full contrast, along lines at any distance from the origin; worst at the cut-off."""
    for low in np.linspace(0.02, 1.2, 120):
        at = np.linspace(low, low + min(low * (filtering.GROWTH - 1), 1 / SMOOTH), 41)
        nodes, weights = chebyshev(at)
        for beside in (0.0, 0.02, 0.1, 0.3, 0.6, 0.9):
            line, few = (otf_circular(np.hypot(beside, y), 1.0, 1.0) for y in (at, nodes))
            assert np.abs(weights @ few - line).max() <= 5e-4


def test_a_part_of_a_period_is_a_cubic():
    """The error of a cubic through Chebyshev's nodes: (pi / 8)^4 / 192 of a wave."""
    at = np.linspace(0, 1 / PERIODS, 101)
    nodes, weights = chebyshev(at)
    for phase in np.linspace(0, 1, 17):
        few, wave = (np.cos(2 * np.pi * (t + phase)) for t in (nodes, at))
        assert np.abs(weights @ few - wave).max() <= 1.3e-4


@pytest.mark.parametrize("ends", [(3.0, 7.0), (7.0, 3.0)])
def test_cubics_are_exact_through_chebyshevs_nodes(ends):
    at = np.linspace(*ends, 21)
    nodes, weights = chebyshev(at)
    assert len(nodes) == filtering.NODES
    assert (np.abs(nodes - 5) < 2).all()

    def cubic(f):
        return 2 - f + 0.3 * f**2 - 0.05 * f**3

    np.testing.assert_allclose(weights @ cubic(nodes), cubic(at), rtol=1e-12)


def test_same_bytes_for_any_number_of_workers():
    rng = np.random.default_rng(3)
    x = Axis(150, 1.1, 160, 1.0, 0.5, True, 1.0)
    y = Axis(140, 1.1, 150, 1.0, 0.5, True, 1.0)
    planes = rng.random((2, y.samples, x.samples)).astype(np.float32)
    frames = []
    for workers in (1, 2, 5):
        spectrum = transform_planes(planes.copy(), workers)
        series = filter_of(x, y, tables(2, 3, 1.2)).apply(spectrum, workers)
        frames.append(series.parts[False].tobytes())
    assert frames[0] == frames[1] == frames[2]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_filter_that_is_used_again_gives_the_same(dtype):
    """Its pieces are kept from the first picture to the next ones, of either type."""
    x, y = GRIDS["fine chart"]
    table, random = tables(2, 3, 0.8), np.random.default_rng(4)
    kept = filter_of(x, y, table)
    for _ in range(3):
        planes = random.random((2, y.samples, x.samples)).astype(dtype)
        found, alone = (
            some.apply(transform_planes(planes.copy(), 1), 1).signal(1, slice(None))
            for some in (kept, filter_of(x, y, table))
        )
        assert found.tobytes() == alone.tobytes()
    assert kept._kept


def test_uniform_light_stays_uniform():
    x, y = GRIDS["odd ratio"]
    spectrum = transform_planes(np.full((1, y.samples, x.samples), 0.7), 1)
    got = filter_of(x, y, tables(1, 1, 1.6)).apply(spectrum, 1).signal(0, slice(None))
    np.testing.assert_allclose(got, 0.7, atol=1e-12)


def test_filter_approaches_boxes_as_the_bandwidth_grows():
    """Without optical blur the spectrum's way and the exact one meet, as 1 / bandwidth."""
    errors = []
    g = sensor(18, 24, fill=(0.7, 0.7), pitch=(1.0, 1.0))
    plane = np.random.default_rng(5).random((15, 20))
    scene = of_picture(plane, 1.2)
    optical_path = path(g, aperture(g))
    for bandwidth in (4.0, 40.0):
        x, y = axes(optical_path, scene, bandwidth)
        flat = Tables(np.eye(1), np.ones((1, 1, 2)), 1e3, 0.0)
        spectrum = transform_planes(plane[None].copy(), 1)
        filter = filter_of(x, y, flat, np.sinc(x.frequencies * 0.7), np.sinc(y.frequencies * 0.7))
        got = filter.apply(spectrum, 1).signal(0, slice(None))
        exact = box_averages(scene, np.ones((1, 1)), g, (x, y), 1)[0]
        errors.append(np.abs(got - exact).max())
    assert errors[0] < 0.06
    assert errors[1] < errors[0] / 5


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.21, -0.13), (0.0, 0.3)])
def test_photodetectors_off_their_pixels_centers_see_the_place_where_they_are(shift):
    """Against a Fourier sum at each photodetector's own place, through a real lens."""
    g = sensor(20, 26, fill=(0.5, 0.4), shift=shift)
    lens = Diffraction(4.0, 0.0)
    plane = np.random.default_rng(6).random((30, 39))
    scene = of_picture(plane, g.pitch_x * 26 / 39)
    optical_path = path(g, lens, aperture(g))
    x, y = axes(optical_path, scene, 2.0)
    assert x.virtual_pixels is not None
    assert bool(x.shift) == bool(shift[0])
    table = tabulate(
        optical_path.transfer, TableSize(lens.cutoff(550e-9), 1 << 14, 0.0, 8), (np.eye(1), 0)
    )
    along = [np.sinc(x.frequencies * 0.5 * g.pitch_x), np.sinc(y.frequencies * 0.4 * g.pitch_y)]
    filter = filter_of(x, y, table, *along)
    got = filter.apply(transform_planes(plane[None].copy(), 1), 1).signal(0, slice(None))
    np.testing.assert_allclose(got, dense([plane], x, y, table, *along)[0], atol=1e-9)


def test_a_chirp_gives_what_folding_gives():
    """Where both serve: pixels that fit the scene's length, and ones that do not by so little that
    their places differ by 3e-7 pixels."""
    x, y = LARGE["off center"]
    plane = np.random.default_rng(7).random((1, y.samples, x.samples))
    spectrum = transform_planes(plane.copy(), 1)
    folded, chirped = (
        filter_of(*(replace(a, pixel_pitch=scale) for a in (x, y)), tables(1, 2, 1.2))
        for scale in (1.0, 1 + 1e-9)
    )
    assert folded.x.virtual_pixels == 300
    assert chirped.x.virtual_pixels is None
    for color in (0, 1):
        one, two = (f.apply(spectrum, 1).signal(color, slice(None)) for f in (folded, chirped))
        np.testing.assert_allclose(two, one, atol=1e-5)


def test_terms_are_those_that_the_tables_reach():
    x, y = LARGE["folded"]
    filter = filter_of(x, y, tables(1, 1, 0.3))
    radius = np.hypot(x.frequencies, y.frequencies[:, None])
    assert filter.terms == int((radius <= 0.3 * (1 + 1e-12)).sum())


def test_several_colors_and_planes_are_summed_alike():
    """A picture of three planes in three colors, against each plane and color by itself."""
    x, y = GRIDS["odd ratio"]
    planes = np.random.default_rng(8).random((3, y.samples, x.samples))
    table = tables(3, 3, 1.6)
    together = filter_of(x, y, table).apply(transform_planes(planes.copy(), 1), 1)
    for color in range(3):
        alone = 0
        for plane in range(3):
            part = replace(
                table, mix=np.eye(1), radial=table.radial[plane : plane + 1, color : color + 1]
            )
            spectrum = transform_planes(planes[plane : plane + 1].copy(), 1)
            alone = alone + filter_of(x, y, part).apply(spectrum, 1).signal(0, slice(None))
        np.testing.assert_allclose(together.signal(color, slice(None)), alone, atol=1e-12)
