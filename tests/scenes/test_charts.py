"""Every chart: averages are averages of its point values; and each chart's own geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support import brute, scene, view

from vcam_cli.scenes.base import ChartScene, Frame, HarmonicScene
from vcam_cli.scenes.build import build
from vcam_cli.scenes.cells import cell_edges
from vcam_cli.scenes.charts import csf
from vcam_cli.scenes.charts.slanted_edge import half_plane_cover
from vcam_cli.scenes.waves import WaveScene
from vcam_cli.spectra import illuminant, luminance

CSF = {"kind": "chart", "chart": "csf", "max_frequency": "120 lp/mm", "phase": "40 deg"}
EDGE = {"kind": "chart", "chart": "slanted-edge", "angle": "5 deg", "contrast": 0.8}
CHECKER = {"kind": "chart", "chart": "colorchecker"}
LEAVES = {"kind": "chart", "chart": "dead-leaves", "seed": 3}
BOTH = LEAVES | {"colorchecker": 0.6}
WAVE = {"kind": "chart", "chart": "sinusoid", "frequency": "50 lp/mm", "orientation": "30 deg"}
WEDGE = {"kind": "chart", "chart": "step-wedge", "steps": 7, "density_range": 1.5}
STAR = {"kind": "chart", "chart": "siemens-star", "spokes": 9, "contrast": 0.9}
POINTS = {"kind": "chart", "chart": "point-grid", "spacing": "11 um", "diameter": "5 um"}
LETTERS = {"kind": "chart", "chart": "eye-chart", "rows": 3}
PATCHES = {"kind": "chart", "chart": "hdr-patches", "patches": 7, "lamp": 2, "dynamic_range": 1000}
FLAT = {"kind": "chart", "chart": "uniform", "reflectance": 0.4}

COLORED = CSF | {"modulation": "red-green"}

SMOOTH = [CSF, COLORED, WAVE, FLAT]
DARK = {"kind": "chart", "chart": "dark"}
SHARP = [WEDGE, STAR, POINTS, LETTERS, PATCHES]
WITHOUT_LEAVES = pytest.mark.parametrize(
    "source", [CSF, EDGE, CHECKER, pytest.param(LEAVES, marks=pytest.mark.long), BOTH, *SHARP]
)
"""Quick with leaves around a card, which are the same leaves."""
EDGED = [EDGE, EDGE | {"angle": "-60 deg"}, EDGE | {"angle": "0 deg"}, CHECKER, *SHARP]


def sampled(source, **of_view) -> ChartScene:
    built = build(scene(source), view(**of_view), None)
    built = built.chart if isinstance(built, HarmonicScene) else built
    assert isinstance(built, ChartScene)
    return built


def mix_of(built, planes=2):
    return np.random.default_rng(1).random((planes, len(built.spectra)))


@pytest.mark.parametrize("source", SMOOTH)
def test_averages_of_smooth_charts(source):
    # 64 midpoints a cell err by (pi f w)^2/6/64^2 = 3e-5 of the modulation at f w = 0.4.
    # A width below the array's makes waves, too, a sampled scene, with black around.
    chart = sampled(source, margin=2, scene_width=1e-3 if source is CSF else 33e-6)
    mix = mix_of(chart)
    assert chart.shape == (16, 20)
    inside = np.s_[:, 6:10, 6:14]
    np.testing.assert_allclose(chart.planes(mix)[inside], brute(chart, mix, 64)[inside], atol=3e-5)


@pytest.mark.parametrize("source", EDGED)
@pytest.mark.parametrize("oversampling", [1, 3])
def test_averages_of_charts_with_edges(source, oversampling):
    # Along an edge parallel to the points, n points a cell err by at most half of 1/n, and twice
    # that where a cell holds both edges of a stroke; slanted edges do better.
    chart = sampled(source, margin=1, oversampling=oversampling)
    mix = mix_of(chart)
    points = 120 // oversampling
    error = chart.planes(mix) - brute(chart, mix, points)
    brightest = 2 if source is PATCHES else 1
    assert abs(error).max() < 1.01 / points * brightest * mix.sum(1).max()


@pytest.mark.parametrize("source", [pytest.param(LEAVES, marks=pytest.mark.long), BOTH])
def test_averages_of_dead_leaves(source):
    # Cells of 1/16 of the picture hold dozens of leaves. 64 x 64 points err by about 1e-3 where
    # many edges cross a cell, the painter by a fraction of that.
    chart = sampled(source, margin=1)
    mix = mix_of(chart)
    error = chart.planes(mix) - brute(chart, mix, 64)
    assert np.sqrt((error**2).mean()) < 2e-3
    assert abs(error).max() < 1e-2


@WITHOUT_LEAVES
def test_a_black_frame_around_a_scene_of_its_own_width(source):
    width = 33e-6  # of 48: the frame cuts cells in x and in y
    chart = sampled(source, margin=1, scene_width=width)
    mix = mix_of(chart)
    planes = chart.planes(mix)
    assert not planes[:, :, :3].any()
    assert not planes[:, :2].any()
    np.testing.assert_allclose(planes, brute(chart, mix, 64), atol=0.02)
    # half of column 3 is outside: -25.5 um .. -16.5 um is its frame edge
    assert planes[:, 5:9, 3].max() < 0.6 * mix.sum(1).max()


@WITHOUT_LEAVES
def test_finer_cells_average_to_coarser_ones(source):
    coarse, fine = sampled(source, margin=1), sampled(source, margin=1, oversampling=3)
    mix = mix_of(coarse)
    small = fine.planes(mix).reshape(2, 14, 3, 18, 3).mean((2, 4))
    # Exact but for the places where leaves' edges meet, dozens a cell: seen 2e-3 at most.
    tolerance = 4e-3 if source in (LEAVES, BOTH) else 1e-12
    np.testing.assert_allclose(small, coarse.planes(mix), atol=tolerance)


def test_planes_are_linear_in_the_mix_and_in_the_dtype_of_the_view():
    chart = sampled(BOTH, dtype=np.float32)
    mix = mix_of(chart, 3)
    planes = chart.planes(mix)
    assert planes.dtype == np.float32
    assert chart.values_at(np.zeros(1), np.zeros(1), mix).dtype == np.float32
    # float32 rounding of sums of a few parts
    np.testing.assert_allclose(
        chart.planes(mix[:1] + mix[1:2])[0], planes[0] + planes[1], rtol=1e-5
    )


@pytest.mark.parametrize("source", [COLORED, LEAVES, BOTH, CHECKER, STAR, LETTERS, PATCHES])
def test_planes_of_mixtures_may_be_negative(source):
    # Mixtures that replace many spectra by few have components of either sign.
    chart = sampled(source)
    mix = mix_of(chart)
    both = chart.planes(mix[:1] - 2 * mix[1:])
    one, other = chart.planes(mix)
    np.testing.assert_allclose(both[0], one - 2 * other, atol=1e-12 * mix.sum())


@pytest.mark.long
def test_bands_of_rows_join_seamlessly(monkeypatch):
    chart = sampled(BOTH, margin=1)
    mix = mix_of(chart)
    whole, points = chart.planes(mix), brute(chart, mix, 2)
    monkeypatch.setattr("vcam_cli.scenes.bands.CELLS", 40)
    np.testing.assert_allclose(chart.planes(mix), whole, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(brute(chart, mix, 2), points, rtol=1e-12)


@pytest.mark.parametrize(
    "source", [CSF, EDGE, CHECKER, pytest.param(BOTH, marks=pytest.mark.long), *SHARP]
)
def test_workers_do_not_change_a_byte(source, monkeypatch):
    monkeypatch.setattr("vcam_cli.scenes.bands.CELLS", 100)
    chart = sampled(source, margin=1, oversampling=2, dtype=np.float32)
    mix = mix_of(chart)
    assert chart.planes(mix, workers=3).tobytes() == chart.planes(mix).tobytes()


@pytest.mark.parametrize("source", [LEAVES, pytest.param(BOTH, marks=pytest.mark.long)])
def test_leaves_that_are_left_out_would_not_be_seen(source):
    # Cells fine enough that leaves are looked through first; rounding of sums in another order.
    chart = sampled(source, rows=120, columns=160, oversampling=7, margin=3)
    if source is LEAVES:  # those that are kept for other lenses are found as they are painted
        chart = replace(chart, chart=replace(chart.chart, keep=False))
    mix = mix_of(chart)
    x, y = (cell_edges(n, 3e-6 / 7) for n in chart.shape[::-1])
    seen = chart.chart.crop_to_cells(x, y)
    laid = seen.leaves if source is BOTH else seen
    assert len(laid.leaves.discs) < 20_000  # of 62 000 and their copies
    planes = chart.chart.averages(x, y, mix)
    np.testing.assert_allclose(chart.planes(mix), planes, rtol=1e-12, atol=1e-14)


# ---- waves


def test_a_uniform_field_is_one_wave_of_frequency_zero():
    built = build(scene(FLAT), view(), None)
    assert isinstance(built, WaveScene)
    np.testing.assert_allclose(
        built.values_at(np.arange(3.0), np.arange(2.0), np.array([[2.0]])), 0.8
    )


@pytest.mark.parametrize(
    ("orientation", "direction"),
    [("0 deg", (1, 0)), ("90 deg", (0, -1)), ("30 deg", (math.sqrt(3) / 2, -0.5))],
)
def test_a_sinusoid_runs_along_its_orientation(orientation, direction):
    source = WAVE | {"orientation": orientation, "phase": "20 deg", "mean": 0.4, "contrast": 0.7}
    built = build(scene(source), view(), None)
    x, y = np.linspace(-1e-4, 1e-4, 7), np.linspace(-2e-4, 1e-4, 5)
    along = np.add.outer(direction[1] * y, direction[0] * x)
    expected = 0.4 * (1 + 0.7 * np.cos(2 * np.pi * 50e3 * along + np.radians(20)))
    np.testing.assert_allclose(built.values_at(x, y, np.ones((1, 1)))[0], expected, atol=1e-12)


def test_a_sinusoid_of_phase_zero_has_a_maximum_at_the_center():
    built = build(scene(WAVE), view(), None)
    assert built.values_at(np.zeros(1), np.zeros(1), np.ones((1, 1))) == pytest.approx(0.75)


@pytest.mark.parametrize("source", [WAVE, FLAT])
def test_a_wide_frame_leaves_waves_exact(source):
    assert isinstance(build(scene(source), view(scene_width=48e-6), None), WaveScene)
    assert isinstance(build(scene(source), view(scene_width=48e-6, margin=1), None), ChartScene)


# ---- csf


def test_csf_grows_in_frequency_to_the_right_and_in_contrast_upward():
    chart = sampled(CSF | {"phase": "0 deg", "max_contrast": 0.9, "mean": 0.5})
    width, height = 48e-6, 36e-6
    x = np.linspace(-width / 2, width / 2, 4001)
    top, middle, bottom = chart.values_at(
        x, np.array([-height / 2, 0, height / 2]), np.ones((1, 1))
    )[0]
    assert top[0] == pytest.approx(0.5 * 1.9)
    assert np.ptp(bottom) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(middle - 0.5, (top - 0.5) / 2, atol=1e-12)
    # Phase pi F W = 2 pi F W/2: half the cycles of a constant F.
    phase = np.arccos(np.clip((top - 0.5) / 0.45, -1, 1))
    cycles = np.abs(np.diff(phase)).sum() / (2 * np.pi)
    assert cycles == pytest.approx(120e3 * width / 2, rel=1e-3)


def test_csf_keeps_a_reflectance_beyond_its_frame():
    chart = sampled(CSF, margin=12)
    planes = chart.planes(np.ones((1, 1)))[0]
    assert 0.0 <= planes.min() < planes.max() <= 1.0
    np.testing.assert_allclose(planes[24:], 0.5, atol=1e-12)  # below: no contrast
    np.testing.assert_allclose(planes[:12], planes[:1].repeat(12, 0))  # above: that of the top


def test_csf_of_frequency_zero_is_flat_along_a_row():
    from vcam_cli.scenes.base import Frame
    from vcam_cli.scenes.charts.csf import Csf

    chart = Csf(Frame(1e-3, 1e-3), 0.0, 0.5, 1.0, 0.0)
    edges = np.linspace(-5e-4, 5e-4, 5)
    row = chart.averages(edges, edges, np.ones((1, 1)))[0, 0]
    np.testing.assert_allclose(row, 0.5 * (1 + 0.875), rtol=1e-12)


# ---- slanted edge


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.09, 0.7, math.pi / 2, 2.0])
def test_half_plane_conserves_area(angle):
    # A strip of cells through which the whole border runs: the bright area is half of it, by
    # symmetry about the center.
    edges = np.linspace(-1, 1, 12)
    middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    distance = np.add.outer(math.sin(angle) * middle, math.cos(angle) * middle)
    part = half_plane_cover(
        distance, abs(math.cos(angle)) * width[None], abs(math.sin(angle)) * width[:, None]
    )
    assert part.mean() == pytest.approx(0.5, abs=1e-12)
    assert part.min() >= 0.0
    assert part.max() <= 1.0


def test_half_plane_cuts_a_corner():
    # A border at 45 degrees that leaves a triangle of legs 1/2 of a unit square: 1/8.
    side = np.array(math.sqrt(0.5))
    assert half_plane_cover(-np.array(0.5) * math.sqrt(0.5), side, side) == pytest.approx(0.125)


def test_the_edge_is_dark_on_the_left_and_leans_to_the_right():
    chart = sampled(EDGE | {"angle": "20 deg"})
    planes = chart.planes(np.ones((1, 1)))[0]
    assert planes[6, 0] == pytest.approx(0.1)
    assert planes[6, -1] == pytest.approx(0.9)
    dark = (planes < 0.5).sum(1)
    assert dark[0] > dark[-1]  # the upper end lies to the right
    # moved by tan 20 degrees a row
    assert (dark[0] - dark[-1]) / 11 == pytest.approx(math.tan(math.radians(20)), abs=0.1)


# ---- colorchecker


def test_colorchecker_is_upright_and_keeps_its_aspect():
    for rows, columns in [(120, 300), (300, 120)]:
        chart = sampled(CHECKER, rows=rows, columns=columns)
        planes = chart.planes(np.eye(25))
        patches = planes[:24] >= 1 - 1e-12
        y, x = (np.array([np.argwhere(p).mean(0) for p in patches]) - [rows / 2, columns / 2]).T
        grid_x, grid_y = x.reshape(4, 6), y.reshape(4, 6)
        step = np.diff(grid_x, axis=1)
        np.testing.assert_allclose(step, step[0, 0], atol=1.0)  # rows of six from left to right
        np.testing.assert_allclose(np.diff(grid_y, axis=0), step[0, 0], atol=1.0)  # squares
        card = (planes[24] > 0) & (planes[24] < 0.03 + 1e-12) | patches.any(0)
        high, wide = np.ptp(np.argwhere(card), axis=0) + 1
        assert max(high / rows, wide / columns) > 0.99  # as large as it fits


def test_colorchecker_parts_add_up():
    # Patches, card and surround share every cell: patch + (card or surround) has weight 1.
    chart = sampled(CHECKER)
    planes = chart.planes(np.eye(25))
    flat = planes[24]
    patches = planes[:24].sum(0)
    assert (flat <= 0.08 * (1 - patches) + 1e-12).all()
    assert (flat >= 0.03 * (1 - patches) - 1e-12).all()


def test_a_colorchecker_of_a_height_lies_in_the_middle_of_the_leaves():
    chart = sampled(LEAVES | {"colorchecker": 0.5}, rows=80, columns=90)
    card = chart.planes(np.eye(25)[24:])[0] > 0.0299
    rows, columns = np.argwhere(card).T
    assert (rows.min(), rows.max()) == (20, 59)
    assert columns.min() + columns.max() == 89


# ---- step wedge


def test_wedge_steps_are_equal_in_density_from_white_on_the_left():
    chart = sampled(WEDGE | {"steps": 16, "density_range": 3}, margin=2)
    row = chart.planes(np.ones((1, 1)))[0, 7]
    assert row[2] == pytest.approx(1.0)
    np.testing.assert_allclose(-np.diff(np.log10(row[2:-2])), 3 / 15, rtol=1e-12)
    # the first and the last bar go on
    np.testing.assert_allclose(row[[0, 1, -2, -1]], [1, 1, 1e-3, 1e-3], rtol=1e-12)


def test_wedge_keeps_the_digits_of_dark_bars():
    chart = sampled(WEDGE | {"steps": 7, "density_range": 10})
    row = chart.planes(np.ones((1, 1)))[0, 0]
    assert row[-1] == pytest.approx(1e-10, rel=1e-12)
    # bars of 16/7 cells; cell 13 ends the last but one: 5/7 of it
    assert row[13] == pytest.approx((5 * 10 ** (-10 * 5 / 6) + 2e-10) / 7, rel=1e-12)


# ---- siemens star


def test_star_has_its_spokes_at_any_distance():
    chart = sampled(STAR | {"spokes": 24, "contrast": 0.5})
    for radius in (2e-6, 1e-4):
        angle = (np.arange(960) + 0.5) * 2 * math.pi / 960
        points = [
            float(chart.values_at(np.array([x]), np.array([y]), np.ones((1, 1)))[0, 0, 0])
            for x, y in zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)
        ]
        # 40 points a spoke and gap, half of them bright
        assert sorted(set(points)) == pytest.approx([0.25, 0.75])
        assert np.mean(points) == pytest.approx(0.5)
        assert np.count_nonzero(np.diff([*points, points[0]])) == 48
        assert points[0] == 0.75  # along the row to the right


def test_star_is_gray_where_cells_hold_many_spokes():
    # of an odd number, every bright spoke lies opposite a dark gap
    star = sampled(STAR | {"spokes": 999}, rows=3, columns=3).chart
    edges = np.array([-1e-6, 1e-6])
    assert star.averages(edges, edges, np.ones((1, 1)))[0, 0, 0] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("spokes", [2, 3])
def test_few_spokes_reach_the_corners(spokes):
    chart = sampled(STAR | {"spokes": spokes, "contrast": 1}, margin=3)
    np.testing.assert_allclose(
        chart.planes(np.ones((1, 1))), brute(chart, np.ones((1, 1)), 100), atol=0.006
    )


# ---- point grid


def test_every_point_has_the_light_of_its_disc():
    # 11 um apart on cells of 3 um: 11 x 11 cells hold exactly 9 points
    chart = sampled(POINTS, rows=11, columns=22)
    light = chart.planes(np.ones((1, 1)))[0].sum() * 9e-12
    assert light == pytest.approx(18 * math.pi * 2.5e-6**2, rel=1e-12)


@pytest.mark.parametrize("diameter", ["0.5 um", "11 um"])
def test_points_small_and_touching(diameter):
    chart = sampled(POINTS | {"diameter": diameter}, rows=11, columns=22, oversampling=4)
    light = chart.planes(np.ones((1, 1)))[0]
    assert light.max() <= 1 + 1e-12
    part = math.pi / 4 * (float(diameter.split()[0]) / 11) ** 2
    assert light.mean() == pytest.approx(part, rel=1e-12)
    assert light[light.shape[0] // 2, light.shape[1] // 2] > 0  # one at the center


# ---- eye chart


def test_letters_are_of_one_stroke():
    from vcam_cli.scenes import polygons
    from vcam_cli.scenes.charts import eye_chart

    # Areas in strokes by hand; arcs of 720 chords a turn are 1.3e-5 smaller.
    along = (math.sqrt(1188) - 10) / 16  # of a slanting stroke along the bar of Z, the stem of N
    areas = {
        "H": 13,
        "O": 4 * math.pi,
        "D": 2.5 * 5 + math.pi * 2.5**2 / 2 - 1.5 * 3 - math.pi * 1.5**2 / 2,
        "S": 3 * 2 + 3 * math.pi / 2 * 2,  # three bars of 2, six quarter rings of middle radius 1
        "Z": 10 + 3 * along,
        "N": 10 + 3 * along,
    }
    edges = np.linspace(0, 1, 8)
    for name, area in areas.items():
        cover = polygons.cover(eye_chart.letter(name), edges, edges)
        assert cover.mean() * 25 == pytest.approx(area, rel=3e-5), name
    for name in eye_chart.LETTERS:
        cover = polygons.cover(eye_chart.letter(name), edges, edges)
        assert cover.min() > -1e-12, name
        assert cover.max() < 1 + 1e-12, name
        around = polygons.cover(eye_chart.letter(name), np.linspace(-1, 2, 8), edges)
        assert around.mean() * 3 == pytest.approx(cover.mean(), rel=1e-12), "in its square"
        assert 9 < cover.mean() * 25 < 16, name


def test_eye_chart_has_rows_of_five_that_fit():
    rows, columns = 400, 600
    chart = sampled(LETTERS | {"rows": 6}, rows=rows, columns=columns)
    ink = chart.planes(np.ones((1, 1)))[0] < 0.5
    lines = np.flatnonzero(np.diff(ink.any(1).astype(int), prepend=0, append=0)).reshape(-1, 2)
    heights = np.diff(lines, axis=1).ravel()
    assert len(lines) == 6
    np.testing.assert_allclose(heights / heights[0], 10 ** (-0.1 * np.arange(6)), atol=0.03)
    for top, bottom in lines:
        across = np.diff(ink[top:bottom].any(0).astype(int), prepend=0, append=0)
        starts, stops = np.flatnonzero(across == 1), np.flatnonzero(across == -1)
        assert len(starts) == 5
        assert abs((starts[0] + stops[-1]) / 2 - columns / 2) <= 1
        np.testing.assert_allclose(stops - starts, bottom - top, atol=2)  # squares
    assert max(ink.any(1).sum() / rows, np.ptp(np.flatnonzero(ink.any(0))) / columns) > 0.5
    assert not ink[0].any()
    assert not ink[:, 0].any()


def test_eye_chart_is_upright_and_legible():
    # the middles of 5 x 5 strokes
    from vcam_cli.scenes.charts.eye_chart import letter
    from vcam_cli.scenes.polygons import contains_points

    at = (np.arange(5) + 0.5) / 5
    seen = {
        name: ["".join(".#"[int(p)] for p in row) for row in contains_points(letter(name), at, at)]
        for name in "HZCRD"
    }
    assert seen == {
        "H": ["#...#", "#...#", "#####", "#...#", "#...#"],
        "Z": ["#####", "...#.", "..#..", ".#...", "#####"],
        "C": [".###.", "#...#", "#....", "#...#", ".###."],
        "R": ["#####", "#...#", "#####", "#..#.", "#..##"],
        "D": ["####.", "#...#", "#...#", "#...#", "####."],
    }


# ---- hdr patches


def test_patches_span_the_range_and_the_lamp_is_brighter():
    source = PATCHES | {"patches": 5, "dynamic_range": 1e6, "lamp": 100}
    chart = sampled(source, rows=120, columns=160, dtype=np.float32)
    light = chart.planes(np.ones((1, 1)))[0]
    levels = 1e6 ** (-np.arange(5) / 4)
    for level in (*levels, 100, 0.5e-6):
        # area of cells that are wholly of this level
        assert np.isclose(light, level, rtol=1e-5, atol=0).sum() > 25, level
    assert light.max() == pytest.approx(100, rel=1e-6)
    lit = np.argwhere(light > 50)
    assert lit[:, 0].max() < 0.2 * 120
    assert lit.mean(0)[1] == pytest.approx(79.5)
    disc = math.pi * (0.05 * 120) ** 2  # cells
    assert light[light > 1.001].sum() == pytest.approx(100 * disc, rel=1e-3)


@pytest.mark.parametrize("patches", [2, 3, 24, 35])
def test_patches_are_squares_in_reading_order(patches):
    chart = sampled(PATCHES | {"patches": patches, "lamp": 1e-9}, rows=300, columns=200)
    light = chart.planes(np.ones((1, 1)))[0]
    levels = 1000.0 ** (-np.arange(patches) / (patches - 1))
    places = []
    for level in levels:
        rows, columns = np.argwhere(np.isclose(light, level, rtol=1e-9)).T
        assert abs(np.ptp(rows) - np.ptp(columns)) <= 1
        places.append((rows.mean().round(0), columns.mean()))
    steps = np.diff(places, axis=0)
    assert ((steps[:, 0] > 1) | (steps[:, 1] > 1)).all()
    assert (steps[:, 0] >= -1).all()


def test_cells_that_hold_many_leaves_are_painted_in_parts():
    """A few large cells are the means of the small ones, which are exact."""
    large = sampled(LEAVES, rows=6, columns=8)
    mix = mix_of(large)
    parts = 125  # 1000 cells to the longer side of 8 pixels
    x, y = (cell_edges(n * parts, 3e-6 / parts) for n in large.shape[::-1])
    small = large.chart.averages(x, y, mix)
    shape = (len(mix), large.shape[0], parts, large.shape[1], parts)
    np.testing.assert_allclose(large.planes(mix), small.reshape(shape).mean((2, 4)), rtol=1e-9)


@pytest.mark.parametrize("modulation", ["red-green", "blue-yellow"])
class TestColorsOfTheContrastChart:
    def test_their_sum_is_white_and_their_luminances_are_the_same(self, modulation):
        first, second = csf.modulation_colors(modulation)
        band = 400e-9, 700e-9
        wavelength = np.linspace(*band, 61)
        # The reflectances add up to 1 to 1e-5 where they are tabulated.
        np.testing.assert_allclose(
            first.evaluate(wavelength) + second.evaluate(wavelength), 1, atol=2e-5
        )
        assert first.evaluate(wavelength).min() >= 0
        assert second.evaluate(wavelength).min() >= 0
        lamp = illuminant("D65")
        one, two = (luminance(lamp.multiply(color), *band) for color in (first, second))
        # The shares are those of sRGB's primaries, in four digits, over 380 to 780 nm.
        assert one == pytest.approx(two, rel=2e-3)

    def test_where_one_color_is_brightest_the_other_is_dark(self, modulation):
        frame = Frame(1e-3, 1e-3)
        chart = csf.Csf(frame, 1e4, 0.5, 1.0, 0.0)
        x, y = np.array([-0.5e-3, -0.5e-3 + math.sqrt(1e-3 / 1e4)]), np.array([-0.5e-3])
        of_each = chart.values(x, y, np.eye(2))
        # Contrast 1, phases 0 and pi: all of the first color, then all of the second.
        np.testing.assert_allclose(of_each[:, 0], [[1, 0], [0, 1]], atol=1e-9)
        np.testing.assert_allclose(chart.values(x, -y, np.eye(2)), 0.5)
