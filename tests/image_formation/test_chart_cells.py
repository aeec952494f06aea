"""Cells of charts: how fine they are, and that their error is at most the one that is told."""

import math
from dataclasses import replace

import numpy as np
import pytest
from optical_paths import PITCH, Gaussian, aperture, on_chart, path, rms, sensor, signal

from vcam_cli import load
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.knobs import with_accuracy
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates import chart_cells
from vcam_cli.image_formation.estimates.bandwidth import highest_passed
from vcam_cli.image_formation.estimates.chart_cells import cell_grid, cells_per_pixel
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.csf import Csf
from vcam_cli.scenes.charts.dead_leaves import dead_leaves
from vcam_cli.scenes.charts.siemens_star import SiemensStar
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.simulation.simulate import prepare

ROWS, COLUMNS = 60, 80
FRAME = Frame(COLUMNS * PITCH, ROWS * PITCH)
CHARTS = {
    "slanted edge": SlantedEdge(0.1, 1.0),
    "diagonal edge": SlantedEdge(math.pi / 4, 1.0),
    "star": SiemensStar(24, 1.0),
    "star with an upright line": SiemensStar(3, 1.0),
    "chirp": Csf(FRAME, 0.45 / PITCH, 0.5, 0.9, 0.0),
}
"""Charts that are painted cell by cell, of one component."""
LENSES = {"f/2": (Diffraction(2.0, 0.0),), "f/5.6": (Diffraction(5.6, 0.0),)}


def before(lens: str, tolerance: float = 0.005):
    g = sensor(ROWS, COLUMNS, (0.8, 0.7))
    knobs = replace(STANDARD, tolerance=tolerance)
    return path(g, *LENSES[lens], aperture(g), knobs=knobs)


def converged(optical_path, scene, cells: float = 0.0) -> np.ndarray:
    """The signal on cells twice as fine as the lens's last frequency asks, or as some cells are."""
    least = max(1.5 * highest_passed(optical_path, scene), cells)
    return on_cells(optical_path, scene, 2.31 * least)


def on_cells(optical_path, scene, cells: float) -> np.ndarray:
    return signal(
        replace(optical_path, settings=replace(optical_path.settings, oversampling=cells)), scene
    )


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 5e-4])
@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("name", CHARTS)
def test_the_error_is_at_most_the_one_that_is_told(name, lens, tolerance):
    """The chart on the cells that are chosen, against much finer ones."""
    optical_path = before(lens, tolerance)
    scene = on_chart(optical_path, CHARTS[name])
    cells, error = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    exact = converged(optical_path, scene, cells)
    assert rms(on_cells(optical_path, scene, cells), exact) <= error
    assert error <= chart_cells.CELLS_SHARE * tolerance * optical_path.full
    assert cells >= chart_cells.LEAST


@pytest.mark.parametrize("shape", [(3, 50), (24, 24), (1, 200), (200, 2)])
@pytest.mark.parametrize("name", ["slanted edge", "star"])
def test_small_arrays_get_what_they_need(name, shape):
    g = sensor(*shape)
    knobs = replace(STANDARD, tolerance=5e-4)
    optical_path = path(g, Diffraction(2.0, 0.0), aperture(g), knobs=knobs)
    scene = on_chart(optical_path, CHARTS[name])
    cells, _ = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    exact = converged(optical_path, scene)
    assert rms(on_cells(optical_path, scene, cells), exact) <= 5e-4 * optical_path.full


@pytest.mark.long
@pytest.mark.parametrize("lens", LENSES)
def test_the_error_of_dead_leaves_is_at_most_the_one_that_is_told(lens):
    optical_path = before(lens)
    spectra = 12
    weights = np.full((spectra, 1, 1), 1.0)
    optical_path = replace(optical_path, transfer=replace(optical_path.transfer, weights=weights))
    scene = on_chart(optical_path, dead_leaves(4, FRAME))
    scene = replace(scene, spectra=scene.spectra * spectra)
    cells, error = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    exact = converged(optical_path, scene)
    true = rms(on_cells(optical_path, scene, cells), exact)
    assert error / 4 < true < error


def test_cells_are_finer_where_less_may_be_lost():
    found = []
    for tolerance in (0.05, 0.01, 0.002):
        optical_path = before("f/2", tolerance)
        scene = on_chart(optical_path, CHARTS["star"], margin=10)
        found.append(cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))[0])
    assert found == sorted(found)
    assert found[0] < found[-1]


def test_a_blurred_chart_needs_few():
    g = sensor(ROWS, COLUMNS, (0.8, 0.7))
    wide = path(g, Diffraction(2.0, 0.0), Gaussian(4 * PITCH), aperture(g))
    scene = on_chart(wide, CHARTS["star"], margin=10)
    assert cells_per_pixel(wide, scene, highest_passed(wide, scene))[0] <= 1.5


def test_an_even_chart_needs_fewest():
    optical_path = before("f/2")
    scene = on_chart(optical_path, SlantedEdge(0.1, 0.0), margin=10)
    cells, error = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    assert (cells, error) == (chart_cells.LEAST, 0.0)


def test_a_user_may_say_how_fine():
    optical_path = before("f/2")
    optical_path = replace(optical_path, settings=replace(optical_path.settings, oversampling=3))
    assert cells_per_pixel(optical_path, on_chart(optical_path, CHARTS["star"]), 5.0) == (3, 0.0)


def test_detail_beyond_saturation_does_not_count():
    """A signal that fills every pixel twice over is the same on any cells."""
    optical_path = replace(before("f/2"), ceiling=1e-3)
    scene = on_chart(optical_path, SlantedEdge(0.1, 0.5), margin=10)
    cells, error = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    assert (cells, error) == (chart_cells.LEAST, 0.0)


@pytest.mark.parametrize("per_pixel", [1.0, 1.37, 2.5, 7.3])
@pytest.mark.parametrize("shape", [(60, 80), (61, 97), (1, 3)])
def test_there_are_never_fewer_than_asked(per_pixel, shape):
    """Along each axis, and hardly more: so many that transforms are fast."""
    g = sensor(*shape, pitch=(PITCH, 1.7 * PITCH))
    scene = on_chart(path(g), CHARTS["star"], margin=5)
    found = cell_grid(scene, g, per_pixel)
    for cells, count in zip(found, shape, strict=True):
        least = per_pixel * (count + 10)
        assert least - 1e-6 <= cells <= 1.12 * least + 12
        for factor in (2, 3, 5):
            while cells % factor == 0:
                cells //= factor
        assert cells == 1


def test_whole_numbers_of_cells_are_kept():
    g = sensor(60, 80)
    scene = on_chart(path(g), CHARTS["star"], margin=10)
    assert cell_grid(scene, g, 3.0) == (240, 300)


@pytest.mark.parametrize(
    ("chart", "rows", "columns"),
    [
        ("hdr-patches", 48, 64),
        ("hdr-patches", 72, 96),
        pytest.param("dead-leaves", 48, 64, marks=pytest.mark.long),
    ],
)
def test_light_far_beyond_the_well_does_not_ring_into_dark_pixels(chart, rows, columns):
    """White fills a pixel thousands of times over; where it does not, no light of it may show."""
    size = [f"array.rows={rows}", f"array.columns={columns}"]
    source = f"scene.source={{kind: chart, chart: {chart}}}"
    camera = load("low-light", [*size, source, "scene.luminance=20000 cd/m2", "accuracy=standard"])
    fine = {"preset": "standard", "oversampling": 17}
    truth, found = (
        ablation.mean_raw(prepare(each, 1)[0]) for each in (with_accuracy(camera, **fine), camera)
    )
    assert rms(found - truth) <= 0.005 * truth.max()


def test_cells_that_a_chart_would_paint_in_parts_are_finer():
    """Where in parts they would take longer than as many as are painted as they are."""
    optical_path = before("f/2")
    leaves = dead_leaves(4, FRAME)
    scene = on_chart(optical_path, leaves)
    finer = PITCH / leaves.undivided
    for part, is_finer in ((0.26, False), (0.49, True), (0.6, False), (0.9, True), (1.1, False)):
        found = chart_cells._with_undivided(optical_path, scene, part * finer)
        assert found == pytest.approx(finer if is_finer else part * finer)
    edge = on_chart(optical_path, CHARTS["slanted edge"])
    assert chart_cells._with_undivided(optical_path, edge, 1.3) == 1.3
