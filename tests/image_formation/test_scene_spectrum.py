"""Cosine spectra of samples and of even rectangles, against each other and against integrals."""

from itertools import pairwise
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
import scipy.fft
import scipy.special
from making import camera, radiance_for
from optical_paths import rms

from vcam_cli.accuracy_study.knobs import CONVERGED
from vcam_cli.image_formation.closed_spectrum import (
    ProductSpectrum,
    disc_waves,
    product_spectrum,
    rectangle_spectrum,
    terms_of_runs,
)
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import (
    SampledSpectrum,
    pairs,
    transform_painted,
    transform_planes,
)
from vcam_cli.scenes import bands
from vcam_cli.scenes.base import Frame, View
from vcam_cli.scenes.charts.colorchecker import ColorChecker, largest_card, reflectances
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.scenes.charts.step_wedge import step_wedge
from vcam_cli.scenes.closed_form import LightDisc, Rectangles
from vcam_cli.scenes.framed import Framed, chart_scene
from vcam_cli.scenes.layered import LayerChart, MaskedChart
from vcam_cli.scenes.picture_chart import PictureChart
from vcam_cli.simulation.simulate import prepare

MIX = np.random.default_rng(1).uniform(-1, 1, (3, 25))


def scene(chart="colorchecker", oversampling=4, scene_width=None, margin=5):
    view = View(31, 40, 4e-6, 3e-6, oversampling, margin, scene_width, np.float64)
    spectra = reflectances()
    charts = {
        "colorchecker": ColorChecker(largest_card(view.frame)),
        "step wedge": step_wedge(7, 2.0, view.frame),
        "slanted edge": SlantedEdge(0.1, 0.6),
    }
    return chart_scene(charts[chart], spectra, spectra[0], view)


def test_the_table_of_a_disc_is_finer_than_its_waves():
    """Straight lines between entries of 2 J1(z) / z: its curvature is 1/4 at most."""
    axis = Axis(64, 1.0, 64, 1.0, 0.5, False, 0.4)
    on = SimpleNamespace(extent=(64.0, 64.0), center=(0.0, 0.0))
    for radius in (0.3, 3.3, 20.0):
        disc = LightDisc(1.7, -2.9, radius, np.ones(1))
        found = disc_waves(disc, on, (axis, axis))
        f = axis.frequencies
        z = 2 * np.pi * radius * np.hypot(f[:, None], f)
        exact = np.divide(2 * scipy.special.j1(z), z, out=np.ones_like(z), where=z > 0)
        waves = np.outer(found.down, found.along)
        every = slice(None)
        assert np.abs(found.terms(every, every) - exact * waves).max() <= 1e-5 * np.abs(waves).max()


@pytest.mark.parametrize("terms", [64, 300])
def test_edges_of_products_are_folded_by_no_cells(terms):
    """Cells of a function of one variable fold next to nothing of an edge at any place.

    Of an edge, whose term k is 1 / k, F cells fold the terms 2 m F - k and 2 m F + k onto it, each
    (k / 2 m F)^2 of it: of 32 cells a term, all together, at most pi^2 / 3 / 64^2 = 8e-4.
    """
    length, axis = float(terms), Axis(terms, 1.0, terms, 1.0, 0.5, False, 0.5)
    worst = 0.0
    for place in np.random.default_rng(2).uniform(0.2, 0.8, 20) * length:

        def products(y, x, mix, place=place):
            cover = np.clip((place - length / 2 - x[:-1]) / np.diff(x), 0, 1)
            return SimpleNamespace(down=np.ones((len(y) - 1, 1)), along=cover[None, None])

        chart = SimpleNamespace(products=products)
        on = SimpleNamespace(extent=(length, length), center=(0.0, 0.0), chart=chart)
        found = product_spectrum(on, np.ones((1, 1)), (axis, axis), np.float64).along_x[0, 0]
        k = np.arange(1, axis.terms)
        envelope = 2 / np.pi * terms / k * np.sinc(k / (2 * terms))
        error = found[1:] - envelope * np.sin(np.pi * k * place / length)
        worst = max(worst, np.abs(error / envelope).max())
    assert worst <= 8.1e-4


@pytest.mark.parametrize("chart", ["colorchecker", "step wedge"])
@pytest.mark.parametrize("scene_width", [None, 71.3e-6, 1e-7, 1.0])
def test_rectangles_have_the_light_of_the_cells(chart, scene_width):
    """Averaged over the cells, by overlaps worked out here."""
    painted = scene(chart, scene_width=scene_width)
    found = painted.rectangles(MIX)
    np.testing.assert_allclose(overlaps(found, painted), painted.planes(MIX), atol=2e-13)


def overlaps(found, on):
    """Averages of rectangles over the cells of a scene."""
    ny, nx = on.shape
    down, across = (
        covers(edges, (np.arange(n + 1) - n / 2) * pitch)
        for edges, n, pitch in ((found.y, ny, on.pitch_y), (found.x, nx, on.pitch_x))
    )
    return np.einsum("yd,rde,xe->ryx", down, found.values, across)


@pytest.mark.parametrize("mirrored", [False, True])
def test_opaque_layers_of_rectangles_are_rectangles(mirrored):
    """A card on a layer beside the middle, with its opacity: as if it were painted."""
    view = View(31, 40, 4e-6, 3e-6, 12, 5, None, np.float64)
    card = ColorChecker(largest_card(view.frame))
    whole = PictureChart(np.ones((1, 1, 1)), Frame(61.3e-6, 47.7e-6), mirrored)
    layer = LayerChart(MaskedChart(card, whole), (9.1e-6, -5.3e-6))
    spectra = (*reflectances(), reflectances()[0])
    layered = chart_scene(layer, spectra, spectra[0], view)
    mix = np.random.default_rng(2).uniform(0, 1, (2, 26))
    averages = overlaps(layered.rectangles(mix), layered)
    painted = layered.planes(mix)
    np.testing.assert_allclose(painted, averages, atol=1e-12)
    assert painted.max() > 0.5
    other = PictureChart(np.ones((2, 2, 1)), Frame(61.3e-6, 47.7e-6), mirrored)
    assert MaskedChart(card, other).edges() is None


@pytest.mark.parametrize("name", ["0.1 rad", "2 rad", "card"])
def test_values_lie_between_their_ends(name):
    """Against many points of each of some rectangles."""
    card = ColorChecker(largest_card(Frame(80e-6, 50e-6)))
    chart = {"0.1 rad": SlantedEdge(0.1, 0.6), "2 rad": SlantedEdge(2.0, 1.0)}.get(name, card)
    rng = np.random.default_rng(3)
    mix = rng.uniform(0, 1, (2, len(reflectances()) if chart is card else 1))
    x, y = (np.sort(rng.uniform(-30e-6, 30e-6, (2, 20)), axis=0) for _ in range(2))
    low, high = chart.value_ends((x[0], x[1]), (y[0], y[1]), mix)
    parts = np.linspace(0.001, 0.999, 51)
    along = (x[0][:, None] + (x[1] - x[0])[:, None] * parts).ravel()
    down = (y[0][:, None] + (y[1] - y[0])[:, None] * parts).ravel()
    values = chart.values(along, down, mix).reshape(2, 20, 51, 20, 51)
    assert (values.min(axis=(2, 4)) >= low - 1e-12).all()
    assert (values.max(axis=(2, 4)) <= high + 1e-12).all()
    assert np.mean(np.abs(values.min(axis=(2, 4)) - low) < 1e-12) > 0.9
    assert np.mean(np.abs(values.max(axis=(2, 4)) - high) < 1e-12) > 0.9


def test_bars_within_a_cell_choose_the_light_that_is_seen():
    """Light and opacity that both change within cells: the mean of their product, by hand."""
    frame = Frame(4.0, 4.0)
    light = PictureChart(np.array([[1.0, 0, 0, 1], [1.0, 0, 1, 0]])[:, :, None], frame, True)
    bars = PictureChart(np.array([[0.0, 1, 0, 1]])[:, :, None], frame, mirrored=False)
    edges = np.array([-3.0, 0.0, 2.5])
    found = MaskedChart(light, bars).averages(edges, np.array([-2.0, 1.0]), np.eye(2))
    # From -3 to 0: samples 0 (clear) and 1 (dark); from 0 to 2.5: 2 (clear) and 3 (bright above).
    np.testing.assert_allclose(found[0], [[0, 2 / 3 / 2.5]], atol=1e-15)
    np.testing.assert_allclose(found[1], [[1 / 3, 1 / 2.5]], atol=1e-15)


@pytest.mark.parametrize("at_once", [1, 50, 1 << 20])
def test_masks_of_any_fineness_divide_cells_whatever_is_held_at_once(at_once, monkeypatch):
    """Against sums over squares of which light, opacity and cells are all made."""
    monkeypatch.setattr("vcam_cli.scenes.layered.MOST_PARTS", at_once)
    rng, frame = np.random.default_rng(4), Frame(120.0, 60.0)
    light, mask = rng.uniform(0, 1, (4, 3)), rng.uniform(0, 1, (30, 60))
    both = light.repeat(15, 0).repeat(40, 1) * mask.repeat(2, 0).repeat(2, 1)
    expected = np.pad(both, ((15, 15), (0, 0))).reshape(3, 30, 2, 60).mean(axis=(1, 3))
    opacity = PictureChart(mask[:, :, None], frame, mirrored=False)
    chart = MaskedChart(PictureChart(light[:, :, None], frame, mirrored=True), opacity)
    edges = np.array([-60.0, 0.0, 60.0]), np.array([-45.0, -15.0, 15.0, 45.0])
    np.testing.assert_allclose(chart.averages(*edges, np.eye(2))[0], expected, atol=1e-14)


def covers(edges, cells):
    """The part of each cell that lies between each pair of edges: (cells, runs)."""
    low = np.maximum.outer(cells[:-1], edges[:-1])
    high = np.minimum.outer(cells[1:], edges[1:])
    return np.maximum(high - low, 0) / np.diff(cells)[:, None]


def test_others_are_painted():
    assert scene("slanted edge").rectangles(MIX) is None
    assert Framed(SlantedEdge(0.1, 0.6), Frame(1e-5, 1e-5)).edges() is None


def test_terms_against_integrals():
    """c_k = 2N/S times the integral of cos(pi k x / S) over a run, times sinc(k / 2N)."""
    cells, edges = 9, np.array([-1.0, -0.3, 0.25, 2.0])
    found = terms_of_runs(edges, cells, 40)
    with mpmath.workdps(30):
        for k in (0, 1, 2, 9, 17, 39):
            for run in range(3):
                a, b = (mpmath.mpf(edges[run + i]) + 1 for i in (0, 1))
                part = mpmath.quad(lambda x, k=k: mpmath.cos(mpmath.pi * k * x / 3), [a, b])
                expected = 2 * cells * part / 3 * mpmath.sincpi(mpmath.mpf(k) / (2 * cells))
                # the sines of angles up to 40 pi are good to 40 pi times the rounding unit
                assert found[k, run] == pytest.approx(float(expected), abs=2e-14 * cells)


def axis_of(cells: int, terms: int) -> Axis:
    """An axis of so many cells of 1 m, followed for so many terms."""
    axis = Axis(cells, 1.0, cells, 1.0, 0.5, False, (terms - 0.5) / (2 * cells))
    assert axis.terms == terms
    return axis


def runs(known):
    return (len(known.y) - 1, known.y.astype(int)), (len(known.x) - 1, known.x.astype(int))


@pytest.mark.parametrize(("dtype", "within"), [(np.float64, 1e-13), (np.float32, 1e-6)])
def test_spectrum_is_that_of_cells_but_for_what_they_fold(dtype, within):
    """Edges that lie on the borders of fine cells: a sum over the frequencies that these fold."""
    rng, shape, terms = np.random.default_rng(4), (12, 10), (8, 9)
    values = rng.random((2, 3, 2))
    known = Rectangles(np.array([-5.0, 1, 5]), np.array([-6.0, -2, 3, 6]), values)
    axes = [axis_of(cells, count) for cells, count in zip(shape, terms, strict=True)]
    spectrum = rectangle_spectrum(known, shape, axes, dtype)
    found = np.array([spectrum.rows(plane, slice(None)) for plane in range(2)])
    assert found.dtype == spectrum.dtype == dtype
    assert found.shape == (2, *terms)
    fine = 2**13  # cells of the fine painting for each of the coarse: folded parts fall as 1 / f
    one = [np.repeat(np.eye(n), np.diff(e) * fine, axis=1) for n, e in runs(known)]
    exact = []
    for runs_of_one, n, count in zip(one, shape, terms, strict=True):
        k = np.arange(count)
        small = scipy.fft.dct(runs_of_one, type=2, axis=1)[:, :count] / fine
        exact.append(small * np.sinc(k / (2 * n)) / np.sinc(k / (2 * n * fine)))
    expected = np.einsum("dy,rde,ex->ryx", exact[0], values, exact[1])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=max(within, 1e-7) * scale, rtol=0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (130, 1), (37, 50), (200, 140)])
def test_samples_are_transformed_along_both_axes(shape, dtype):
    planes = np.random.default_rng(3).standard_normal((2, *shape))
    expected = np.array([scipy.fft.dctn(plane, type=2) for plane in planes])
    for workers in (1, 3):
        found = transform_planes(planes.astype(dtype), workers)
        assert found.dtype == dtype
        assert len(found) == 2
        tolerance = 1e-12 if dtype == np.float64 else 1e-5
        np.testing.assert_allclose(
            found.coefficients, expected, atol=tolerance * abs(expected).max()
        )


@pytest.mark.parametrize("workers", [1, 3])
def test_charts_are_transformed_band_by_band(workers, monkeypatch):
    """As their whole planes are, of which the first terms are kept."""
    painted = scene("slanted edge")
    whole = transform_planes(painted.planes(MIX), 1).coefficients
    monkeypatch.setattr(bands, "CELLS", 5 * painted.shape[1] + 1)
    assert len(bands.bands_of_rows(*painted.shape)) > 5
    terms = painted.shape[0] - 31, painted.shape[1] - 50
    found, brightest = transform_painted(painted, MIX, terms, np.float64, workers)
    np.testing.assert_allclose(
        found.coefficients, whole[:, : terms[0], : terms[1]], atol=1e-12 * abs(whole).max()
    )
    np.testing.assert_array_equal(brightest, abs(painted.planes(MIX)).max(axis=(1, 2)))


INDICES = (slice(None), slice(30, 8, -1), slice(4, None, 3), np.array([3, 0, 30]))


def both_kinds():
    """The same spectrum of rectangles, as what it is made of and as its numbers."""
    rng = np.random.default_rng(0)
    known = ProductSpectrum(rng.random((31, 7)), rng.random((3, 7, 33)))
    numbers = np.einsum("yd,rdx->ryx", known.along_y, known.along_x)
    return known, SampledSpectrum(numbers)


@pytest.mark.parametrize("index", INDICES, ids=str)
def test_rows_of_both_kinds_agree(index):
    known, sampled = both_kinds()
    assert len(known) == len(sampled) == 3
    for plane in range(3):
        np.testing.assert_allclose(known.rows(plane, index), sampled.rows(plane, index))


def block_sums(first, second, y, x):
    """Sums over blocks of the product of two planes' coefficients."""
    both = first * second
    return [[both[a:b, c:d].sum() for c, d in pairwise(x)] for a, b in pairwise(y)]


def test_products_of_both_kinds_agree():
    """And are the sums over blocks of the product of the coefficients, pair by pair."""
    known, sampled = both_kinds()
    y, x = np.array([0, 1, 5, 22, 31]), np.array([0, 3, 4, 33])
    every = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    assert pairs(3) == every
    planes = sampled.coefficients
    expected = [block_sums(planes[r], planes[s], y, x) for r, s in every]
    for spectrum in (known, sampled):
        for workers in (1, 3):
            found = spectrum.products(y, x, workers)
            assert found.dtype == np.float64
            np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_products_of_few_and_of_many_rows():
    """Blocks of single rows are added up together, large ones in several parts."""
    plane = np.random.default_rng(3).random((1, 900, 5))
    y, x = np.array([*range(20), 50, 90, 200, 600, 900]), np.array([0, 2, 5])
    found = SampledSpectrum(plane).products(y, x, 2)
    np.testing.assert_allclose(found[0], block_sums(plane[0], plane[0], y, x), rtol=1e-12)


def test_products_of_32_bits_are_added_up_in_64():
    rng = np.random.default_rng(5)
    planes = rng.standard_normal((2, 500, 300))
    y, x = np.array([0, 100, 500]), np.array([0, 7, 300])
    exact = SampledSpectrum(planes).products(y, x, 1)
    short = SampledSpectrum(planes.astype(np.float32)).products(y, x, 1)
    np.testing.assert_allclose(short[1], exact[1], atol=3e-7 * exact[0].max())


WEDGE = {"kind": "chart", "chart": "step-wedge", "steps": 5}
CARD = {"kind": "chart", "chart": "colorchecker"}


def rate(folder, source, **accuracy):
    tree = {
        "scene.radiance": radiance_for(2000), "scene.source": source,
        "array.rows": 20, "array.columns": 24,
        "accuracy": {"preset": "reference", **accuracy},
    }  # fmt: skip
    found, _ = prepare(camera(folder, tree), 1)
    return found


@pytest.mark.parametrize("source", [WEDGE, CARD], ids=["step wedge", "colorchecker"])
def test_finer_and_finer_cells_come_to_it(source, tmp_path, monkeypatch):
    """More or less quickly, as the edges happen to lie within the cells."""
    exact = rate(tmp_path, source, oversampling=64)
    assert exact.spectrum.lost_rms < 1e-5 * exact.rate.max()  # rounding of 32 bits
    assert exact.spectrum.cells == 0
    monkeypatch.setattr("vcam_cli.scenes.base.ChartScene.rectangles", lambda *_: None)
    for kind in (ColorChecker, type(step_wedge(2, 1.0, Frame(1.0, 1.0)))):
        monkeypatch.setattr(kind, "edges", lambda *_: None)
        monkeypatch.setattr(kind, "profile", lambda *_: None)
    errors = []
    for cells in (6, 24, 64):
        painted = rate(tmp_path, source, oversampling=cells)
        assert painted.spectrum.cells > 0
        errors.append(rms(painted.rate, exact.rate) / exact.rate.max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 3
    assert errors[2] < max(errors[1] / 3, 0.1 * CONVERGED)  # what both may err


@pytest.mark.parametrize("kept", [2, 4])
def test_what_is_lost_is_estimated(kept, tmp_path):
    """By Parseval's theorem over the scene, as if all of its light fell on the array."""
    exact, found = (
        rate(tmp_path, CARD, oversampling=64),
        rate(tmp_path, CARD, oversampling=kept),
    )
    ratio = found.spectrum.lost_rms / rms(found.rate, exact.rate)
    assert 0.5 < ratio < 3, ratio
