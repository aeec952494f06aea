"""Cells of charts: how fine they are, and that their measured error is the true one."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from optical_paths import PITCH, Gaussian, aperture, on_chart, path, rms, sensor, signal

from vcam_cli import load
from vcam_cli.accuracy import ablation
from vcam_cli.accuracy.knobs import with_accuracy
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates import cell_search, chart_cells
from vcam_cli.image_formation.estimates.bandwidth import highest_passed
from vcam_cli.image_formation.estimates.chart_cells import cell_grid, cells_per_pixel
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.scenes.base import Chart, ChartScene, Frame
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
    "chirp": Csf(FRAME, 0.45 / PITCH, 0.5, 0.9, 0.0),
}
"""Charts that are painted cell by cell, of one component."""
LENSES = {"f/2": (Diffraction(2.0, 0.0),), "f/5.6": (Diffraction(5.6, 0.0),)}


def before(lens: str, tolerance: float = 0.005):
    g = sensor(ROWS, COLUMNS, (0.8, 0.7))
    knobs = replace(STANDARD, tolerance=tolerance)
    return path(g, *LENSES[lens], aperture(g), knobs=knobs)


def converged(optical_path, scene) -> np.ndarray:
    """The signal on cells twice as fine as a measurement's reference, of another factor."""
    finest = 2.31 * chart_cells.BEYOND_CUTOFF * highest_passed(optical_path, scene)
    knobs = replace(optical_path.settings, oversampling=finest)
    return signal(replace(optical_path, settings=knobs), scene)


def on_cells(optical_path, scene, cells: float) -> np.ndarray:
    return signal(
        replace(optical_path, settings=replace(optical_path.settings, oversampling=cells)), scene
    )


@pytest.fixture
def measured(monkeypatch):
    """Makes the cells be measured however few there are."""
    monkeypatch.setattr(chart_cells, "CHEAP", 0)


@pytest.mark.parametrize("tolerance", [0.02, 0.005])
@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("name", CHARTS)
def test_the_measured_error_is_of_the_size_of_the_true_one(name, lens, tolerance, measured):
    """The whole chart on the cells that are chosen, against much finer ones.

    Crops are a part of the picture, some of them the busiest: they tell more than the truth where
    most of a chart is quiet. Less only of an edge that runs through the corners of a crop's cells,
    and not of the whole chart's.
    """
    optical_path = before(lens, tolerance)
    scene = on_chart(optical_path, CHARTS[name])
    highest = highest_passed(optical_path, scene)
    cells, error, _ = cells_per_pixel(optical_path, scene, highest)
    exact = converged(optical_path, scene)
    true = rms(on_cells(optical_path, scene, cells), exact)
    assert true < tolerance * exact.max()
    assert true < (7 if name == "diagonal edge" else 1.5) * error
    budget = chart_cells.CELLS_SHARE * tolerance
    assert error <= budget * exact.max() * 1.1
    assert cells >= 1.0


@pytest.mark.long
@pytest.mark.parametrize("lens", LENSES)
def test_the_error_of_dead_leaves_is_of_the_size_of_the_true_one(lens, measured):
    optical_path = before(lens)
    spectra = 12
    weights = np.full((spectra, 1, 1), 1.0)
    optical_path = replace(optical_path, transfer=replace(optical_path.transfer, weights=weights))
    scene = on_chart(optical_path, dead_leaves(4, FRAME))
    scene = replace(scene, spectra=scene.spectra * spectra)
    cells, error, _ = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    exact = converged(optical_path, scene)
    true = rms(on_cells(optical_path, scene, cells), exact)
    assert true < optical_path.settings.tolerance * exact.max()
    assert error / 4 < true < 1.5 * error


def test_cells_are_finer_where_less_may_be_lost(measured):
    found = []
    for tolerance in (0.05, 0.01, 0.002):
        optical_path = before("f/2", tolerance)
        scene = on_chart(optical_path, CHARTS["star"], margin=10)
        found.append(cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))[0])
    assert found == sorted(found)
    assert found[0] < found[-1]


def test_a_blurred_chart_needs_few(measured):
    g = sensor(ROWS, COLUMNS, (0.8, 0.7))
    wide = path(g, Diffraction(2.0, 0.0), Gaussian(4 * PITCH), aperture(g))
    scene = on_chart(wide, CHARTS["star"], margin=10)
    assert cells_per_pixel(wide, scene, highest_passed(wide, scene))[0] <= 1.5


def test_small_charts_are_painted_as_finely_as_the_lens_asks():
    optical_path = before("f/5.6")
    scene = on_chart(optical_path, CHARTS["star"], margin=10)
    highest = highest_passed(optical_path, scene)
    cells, error, _ = cells_per_pixel(optical_path, scene, highest)
    assert cells >= chart_cells.BEYOND_CUTOFF * highest
    assert error == 0
    exact = on_cells(optical_path, scene, 1.37 * cells)
    assert rms(on_cells(optical_path, scene, cells), exact) < 0.3 * 0.005 * exact.max()


def test_a_user_may_say_how_fine():
    optical_path = before("f/2")
    optical_path = replace(optical_path, settings=replace(optical_path.settings, oversampling=3))
    assert cells_per_pixel(optical_path, on_chart(optical_path, CHARTS["star"]), 5.0) == (3, 0.0, 0)


def test_there_are_no_more_than_memory_allows(measured, monkeypatch):
    optical_path = before("f/2", 1e-4)
    scene = on_chart(optical_path, CHARTS["star"], margin=10)
    monkeypatch.setattr(chart_cells, "MOST", 4 * (ROWS + 20) * (COLUMNS + 20))
    cells, error, _ = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    assert cells == pytest.approx(2.0, abs=0.1)
    assert error > 1e-4


def test_detail_beyond_saturation_does_not_count(measured):
    """A signal that fills every pixel twice over is the same on any cells."""
    optical_path = replace(before("f/2"), ceiling=1e-3)
    scene = on_chart(optical_path, SlantedEdge(0.1, 0.5), margin=10)
    cells, error, _ = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    assert chart_cells.OVEREXPOSED <= cells < chart_cells.OVEREXPOSED + 0.5
    assert error == 0


def test_overexposed_charts_keep_the_cells_that_they_need(measured, monkeypatch):
    """Also where fewer would spare a large image."""
    monkeypatch.setattr(cell_search, "CHEAP", 0)
    optical_path = replace(before("f/2"), ceiling=1e-3)
    scene = on_chart(optical_path, SlantedEdge(0.1, 0.5), margin=10)
    cells = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))[0]
    assert cells >= chart_cells.OVEREXPOSED


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


# --- crops ---------------------------------------------------------------------------------------


def crops(scene: ChartScene, g, cells: float = 4.0) -> list[ChartScene]:
    return chart_cells._crops(path(g), scene, cells, np.ones(len(scene.spectra)))[0]


def test_crops_have_the_center_and_lie_within_the_array():
    g = sensor(200, 300)
    found = crops(on_chart(path(g), CHARTS["star"], margin=20), g)
    assert found[0].center == (0, 0)
    assert len(found) == 1 + 2 * chart_cells.FEW
    for crop in found:
        assert abs(crop.center[0]) + crop.pitch_x / 2 <= g.sensor_width / 2 * (1 + 1e-12)
        assert abs(crop.center[1]) + crop.pitch_y / 2 <= g.sensor_height / 2 * (1 + 1e-12)


class Unpainted(Chart):
    """A chart of which values at points are all that is asked for."""

    def paint(self, x_edges, y_edges, mix, out):
        raise AssertionError("painted")


@pytest.mark.parametrize("place", [(-0.31, 0.22), (0.4, -0.4), (0.05, 0.47)])
def test_crops_have_the_busiest_part(place):
    """A patch of fine checks on an otherwise even chart: a tenth of the array's width."""
    g = sensor(200, 300)
    x0, y0 = place[0] * g.sensor_width, place[1] * g.sensor_height
    half = 0.05 * g.sensor_width

    @dataclass(frozen=True)
    class Patch(Unpainted):
        def values(self, x, y, mix):
            near = np.outer(np.abs(y - y0) < half, np.abs(x - x0) < half)
            checks = np.add.outer(y // (3.1 * PITCH), x // (3.1 * PITCH)) % 2
            return np.multiply.outer(mix[:, 0], 0.5 + 0.5 * near * (checks - 0.5))

    found = crops(on_chart(path(g), Patch(), margin=20), g)
    assert any(overlaps(crop, x0, y0, half) for crop in found)


def overlaps(crop: ChartScene, x0: float, y0: float, half: float) -> bool:
    apart = abs(crop.center[0] - x0), abs(crop.center[1] - y0)
    return apart[0] < half + crop.pitch_x / 2 and apart[1] < half + crop.pitch_y / 2


@pytest.mark.parametrize("period", [1.0, 2.0, 200 / 16, 300 / 192])
def test_what_repeats_is_not_mistaken_for_even(period):
    """Stripes whose period the points' mean step is a multiple of: their steps are uneven."""
    g = sensor(200, 300)

    @dataclass(frozen=True)
    class Stripes(Unpainted):
        def values(self, x, y, mix):
            left = x < 0  # to the right of the center nothing repeats
            bright = np.where(left, (x / (period * PITCH)) % 1 < 0.5, 0.5)
            return np.multiply.outer(mix[:, 0], np.broadcast_to(bright, (len(y), len(x))))

    found, _ = chart_cells._busiest(path(g), on_chart(path(g), Stripes(), margin=20), np.ones(1))
    assert (found[:, 0] < 0).all()


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (24, 24)])
def test_crops_of_small_arrays(shape, measured):
    g = sensor(*shape)
    optical_path = path(g, Diffraction(2.0, 0.0), aperture(g))
    scene = on_chart(optical_path, CHARTS["star"], margin=4)
    cells, *_ = cells_per_pixel(optical_path, scene, highest_passed(optical_path, scene))
    assert cells >= 1


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
