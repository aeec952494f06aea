"""Charts of even rectangles: their spectrum in closed form, without painting them."""

import mpmath
import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli.engine import coefficients, sampling
from vcam_cli.engine.painted import Known
from vcam_cli.engine.transfer import Tables
from vcam_cli.scenes.base import Frame, Framed, Rectangles, View, chart_scene
from vcam_cli.scenes.colorchecker import ColorChecker, largest, reflectances
from vcam_cli.scenes.slanted_edge import SlantedEdge
from vcam_cli.scenes.step_wedge import step_wedge
from vcam_cli.studies.simulate import prepare

MIX = np.random.default_rng(1).uniform(-1, 1, (3, 25))
WEDGE = {"kind": "chart", "chart": "step-wedge", "steps": 5}
CARD = {"kind": "chart", "chart": "colorchecker"}


def scene(chart="colorchecker", oversampling=4, scene_width=None, margin=5):
    view = View(31, 40, 4e-6, 3e-6, oversampling, margin, scene_width, np.float64)
    spectra = reflectances()
    charts = {
        "colorchecker": ColorChecker(largest(view.frame)),
        "step wedge": step_wedge(7, 2.0, view.frame),
        "slanted edge": SlantedEdge(0.1, 0.6),
    }
    return chart_scene(charts[chart], spectra, spectra[0], view)


@pytest.mark.parametrize("chart", ["colorchecker", "step wedge"])
@pytest.mark.parametrize("scene_width", [None, 71.3e-6, 1e-7, 1.0])
def test_rectangles_have_the_light_of_the_cells(chart, scene_width):
    """Averaged over the cells, by overlaps worked out here."""
    painted = scene(chart, scene_width=scene_width)
    found = painted.rectangles(MIX)
    ny, nx = painted.shape
    down, across = (
        covers(edges, (np.arange(n + 1) - n / 2) * pitch)
        for edges, n, pitch in ((found.y, ny, painted.pitch_y), (found.x, nx, painted.pitch_x))
    )
    averages = np.einsum("yd,rde,xe->ryx", down, found.values, across)
    np.testing.assert_allclose(averages, painted.planes(MIX), atol=2e-13)


def covers(edges, cells):
    """The part of each cell that lies between each pair of edges: (cells, runs)."""
    low = np.maximum.outer(cells[:-1], edges[:-1])
    high = np.minimum.outer(cells[1:], edges[1:])
    return np.maximum(high - low, 0) / np.diff(cells)[:, None]


def test_others_are_painted():
    assert scene("slanted edge").rectangles(MIX) is None and not scene("slanted edge").is_known
    assert Framed(SlantedEdge(0.1, 0.6), Frame(1e-5, 1e-5)).edges() is None


def test_terms_against_integrals():
    """c_k = 2N/S times the integral of cos(pi k x / S) over a run, times sinc(k / 2N)."""
    cells, edges = 9, np.array([-1.0, -0.3, 0.25, 2.0])
    found = coefficients.terms_of_runs(edges, cells, 40)
    with mpmath.workdps(30):
        for k in (0, 1, 2, 9, 17, 39):
            for run in range(3):
                a, b = (mpmath.mpf(edges[run + i]) + 1 for i in (0, 1))
                part = mpmath.quad(lambda x, k=k: mpmath.cos(mpmath.pi * k * x / 3), [a, b])
                expected = 2 * cells * part / 3 * mpmath.sincpi(mpmath.mpf(k) / (2 * cells))
                # the sines of angles up to 40 pi are good to 40 pi times the rounding unit
                assert found[k, run] == pytest.approx(float(expected), abs=2e-14 * cells)


@pytest.mark.parametrize("dtype, within", [(np.float64, 1e-13), (np.float32, 1e-6)])
def test_spectrum_is_that_of_cells_but_for_what_they_fold(dtype, within):
    """Edges that lie on the borders of fine cells: a sum over the frequencies that these fold."""
    rng, shape, terms = np.random.default_rng(4), (12, 10), (8, 9)
    values = rng.random((2, 3, 2))
    known = Rectangles(np.array([-5.0, 1, 5]), np.array([-6.0, -2, 3, 6]), values)
    found = np.asarray(coefficients.of_rectangles(known, shape, terms, dtype))
    assert found.dtype == dtype and found.shape == (2, *terms)
    fine = 2**13  # cells of the fine painting for each of the coarse: folded parts fall as 1 / f
    one = [np.repeat(np.eye(n), np.diff(e) * fine, axis=1) for n, e in runs(known)]
    exact = []
    for runs_of_one, n, count in zip(one, shape, terms, strict=True):
        k = np.arange(count)
        small = sampling.spectrum(runs_of_one[:, None, :].copy(), 1)[:, 0, :count] / fine
        exact.append(small / 2 * np.sinc(k / (2 * n)) / np.sinc(k / (2 * n * fine)))
    expected = np.einsum("dy,rde,ex->ryx", exact[0], values, exact[1])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=max(within, 1e-7) * scale, rtol=0)


def runs(known):
    return (len(known.y) - 1, known.y.astype(int)), (len(known.x) - 1, known.x.astype(int))


def test_first_terms_are_those_of_the_whole_spectrum():
    plane = np.random.default_rng(2).random((2, 60, 50))
    whole = sampling.spectrum(plane.copy(), 1)
    np.testing.assert_array_equal(sampling.spectrum(plane.copy(), 2, (33, 21)), whole[:, :33, :21])


def test_the_brightest_is_that_of_the_rectangles():
    chart = scene()
    tables = Tables(MIX, np.random.default_rng(3).uniform(0, 1, (3, 2, 8)), 1.0, 0.0)
    light = Known(chart.rectangles(MIX), chart.shape, np.float32)
    painted = np.einsum("rc,ryx->cyx", tables.values[:, :, 0], chart.planes(MIX))
    assert light.peak(tables) == pytest.approx(painted.max(), rel=1e-12)
    assert light.brightest(tables) >= light.peak(tables)
    assert light.doubled().dtype == np.float64


def rate(folder, source, **accuracy):
    tree = {
        "scene.radiance": radiance_for(2000), "scene.source": source,
        "array.rows": 20, "array.columns": 24, "accuracy": {"preset": "reference", **accuracy},
    }  # fmt: skip
    found, _ = prepare(camera(folder, tree), 1)
    return found


@pytest.mark.parametrize("source", [WEDGE, CARD], ids=["step wedge", "colorchecker"])
def test_finer_and_finer_cells_come_to_it(source, tmp_path, monkeypatch):
    """More or less quickly, as the edges happen to lie within the cells."""
    exact = rate(tmp_path, source, oversampling=64)
    assert exact.spectrum.lost == 0
    monkeypatch.setattr("vcam_cli.scenes.base.ChartScene.rectangles", lambda *_: None)
    errors = []
    for cells in (6, 24, 64):
        painted = rate(tmp_path, source, oversampling=cells)
        errors.append(np.sqrt(np.mean((painted.rate - exact.rate) ** 2)) / exact.rate.max())
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 3 and errors[2] < errors[1] / 3, errors


@pytest.mark.parametrize("source", [WEDGE, CARD], ids=["step wedge", "colorchecker"])
@pytest.mark.parametrize("kept", [2, 4])
def test_what_is_lost_is_foretold(source, kept, tmp_path):
    """By Parseval's theorem over the scene, from some rows of the spectrum: not over the pixels."""
    exact, found = (
        rate(tmp_path, source, oversampling=64),
        rate(tmp_path, source, oversampling=kept),
    )
    lost = np.sqrt(np.mean((found.rate - exact.rate) ** 2))
    assert 0.5 < found.spectrum.lost / lost < 3, (found.spectrum.lost, lost)
