"""The truths of the accuracy promise against slower ones that share nothing with them.

The engine has no part in this: what it is judged by is itself judged here.
"""

import dataclasses
import math

import chart_cameras
import edge_truth
import lattice_truth
import numpy as np
import outlines
import periodic_cameras
import pytest
from fourier import Series, cutoff, mean_electrons
from reference import electrons_per_light, one_minus_m
from reference_collect import Collector, centers
from reference_scenes import DATA, column
from scipy.special import j1

from vcam_cli.scenes.base import View
from vcam_cli.scenes.build import build
from vcam_cli.scenes.charts.dead_leaves import PIGMENTS


def setup_of(folder, name):
    """The camera of a name as numbers, and what it is."""
    camera = periodic_cameras.CAMERAS[name]
    model = camera.load(folder, "reference")
    return camera.setup(model), camera, model


def test_lattice_against_spatial_sums(tmp_path):
    """The light that photodetectors collect when moved by every displacement of the Airy pattern.

    Discs painted on squares of 1/300 of their spacing; displacements on circles, the share of each
    circle from 2 J1(z)^2 / z; what goes further than 60 rings finds the lattice's mean.
    """
    spacing, diameter, pitch = 3e-6, 2e-6, 2e-6
    camera = periodic_cameras.plain_camera("one", pitch, 2.0, (3, 6), spacing, diameter)
    detector = {"width": "1.2 um", "height": "0.8 um", "x": "0.5 um", "y": "1.1 um"}
    changes = {"pixel.photodetector": {**detector, "quantum_efficiency": 0.5}}
    camera = dataclasses.replace(camera, changes={**camera.changes, **changes})
    model = camera.load(tmp_path, "reference")
    setup = camera.setup(model)
    truth = camera.truth(model)
    slow = _by_displacements(setup, spacing, diameter)
    assert np.ptp(truth) > 0.2 * truth.max()
    assert np.abs(truth - slow).max() <= 1e-4 * truth.max()


def _by_displacements(setup, spacing, diameter):
    side = spacing / 300
    at = centers(900, side)  # the period in the middle, and one on every side
    u, v = np.meshgrid(*2 * [at - spacing * np.rint(at / spacing)])
    # a straight edge's part of a square, nearly
    light = np.clip(0.5 + (diameter / 2 - np.hypot(u, v)) / side, 0.0, 1.0)
    collector = Collector(light, "", -450 * side, -450 * side, side, side)
    left, top, width, height = setup.aperture
    x, y = setup.centers
    ring = setup.wavelength[0] * setup.f_number * one_minus_m(setup.focal_length, setup.distance)
    node, weight = np.polynomial.legendre.leggauss(4)
    edges = np.arange(0, 60, 0.25)
    found, tail = np.zeros(x.shape), 1.0
    for radius, dr in zip(
        (edges[:, None] + (node + 1) / 8).ravel(), np.tile(weight / 8, len(edges)), strict=True
    ):
        angle = 2 * np.pi * (np.arange(96) + radius) / 96
        dx, dy = (ring * radius * turn(angle) for turn in (np.cos, np.sin))
        dx, dy = (
            place[..., None] + off - move for place, off, move in ((x, left, dx), (y, top, dy))
        )
        dx, dy = (at - spacing * np.rint(at / spacing) for at in (dx, dy))
        share = 2 * j1(np.pi * radius) ** 2 / radius * dr
        found += share * collector.at(dx, dy, width, height).mean(axis=-1)
        tail -= share
    found += tail * light.mean() * width * height
    return electrons_per_light(setup)[0, setup.color, 0] * found


@pytest.mark.parametrize("name", ["random-17", "random-26"])
def test_lattice_by_another_quadrature_of_wavelengths(name, tmp_path):
    """A plain sum of one wavelength every tenth of a nanometer for Gauss's three."""
    setup, camera, model = setup_of(tmp_path, name)
    edges = np.linspace(380e-9, 780e-9, 4001)
    middle, step = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    sums = dataclasses.replace(
        setup,
        wavelength=middle,
        weight=np.full(len(middle), step),
        radiance=np.atleast_2d(np.interp(middle, setup.wavelength, setup.radiance[0])),
        response=np.array([np.interp(middle, setup.wavelength, r) for r in setup.response]),
    )
    grid = model.scene.source
    slow = lattice_truth.mean_signal(sums, grid.spacing, grid.diameter)
    truth = camera.truth(model)
    assert np.abs(slow - truth).max() <= 1e-5 * truth.max()


def test_lattice_beyond_the_cutoff_is_even_light(tmp_path):
    """The mean of the lattice, pi d^2 / 4 p^2, on every pixel, by equations 2.18 and 2.23."""
    camera = periodic_cameras.plain_camera("fine", 4e-6, 16, (2, 3), 5e-6, 4e-6)
    model = camera.load(tmp_path, "reference")
    white = 10e3  # what the radiance is chosen for
    assert camera.truth(model) == pytest.approx(white * math.pi * 16 / 100, rel=1e-5)


def test_cameras_are_drawn_as_widely_as_promised():
    """Pitches, fill factors, apertures, sizes and patterns from end to end."""
    found = [camera.changes for camera in periodic_cameras.CAMERAS.values()]
    assert len(found) >= 200

    def ends(key, unit=""):
        values = [float(str(each[key]).removesuffix(unit)) for each in found]
        return min(values), max(values)

    assert ends("pixel.width", "um") == pytest.approx((1.0, 10.0), rel=0.06)
    low, high = ends("optics.f_number")
    assert low < 0.75
    assert high > 40
    assert {(each["array.rows"], each["array.columns"]) for each in found} >= {(1, 1), (64, 80)}
    assert {each.get("array.pattern", "monochrome")[:5] for each in found} == {"monoc", "bayer"}
    factors = [each.get("pixel.photodetector", {}).get("fill_factor", 0.5) for each in found]
    assert min(factors) < 0.02
    assert max(factors) == 1.0


# --- outlines, chirps and edges ------------------------------------------------------------------


def test_outlines_of_a_disc_have_its_known_spectrum():
    """A lattice again: the disc's rim for its Bessel function."""
    spacing, diameter, highest = 3e-6, 2.3e-6, 4e6
    rim = outlines.circle(0.0, 0.0, diameter / 2, 1.0, highest)
    known = lattice_truth.point_grid(spacing, diameter, highest)
    found = outlines.series(rim, spacing, highest)
    inside = np.hypot.outer(known.fy, known.fx) <= highest
    assert np.array_equal(found.fx, known.fx)
    assert np.array_equal(found.fy, known.fy)
    assert np.abs(found.coefficients - known.coefficients)[inside].max() <= 1e-9


def test_outlines_of_a_rectangle_have_its_known_spectrum():
    """Products of sincs, turned by the place of its middle."""
    edges, period, highest = np.array([[-1e-6, 2e-6, 0.5e-6, 1.2e-6]]), 7e-6, 2e6
    found = outlines.series(outlines.rectangles(edges, np.array([0.8]), highest), period, highest)
    fx, fy = np.meshgrid(found.fx, found.fy)
    waves = np.exp(-2j * np.pi * (fx * 0.5e-6 + fy * 0.85e-6))
    known = 0.8 * 3e-6 * 0.7e-6 / period**2 * np.sinc(fx * 3e-6) * np.sinc(fy * 0.7e-6) * waves
    known = known * np.where(fx > 0, 2, 1)
    inside = np.hypot(fx, fy) <= highest
    assert np.abs(found.coefficients - known)[inside].max() <= 1e-10


def test_edges_against_outlines(tmp_path):
    """A slanted edge through a picture of thirty arrays, for the integral along its normal.

    Gray lies around it: what the dark half spreads too little, the bright one spreads too much.
    """
    camera = chart_cameras.CAMERAS["slanted-edge-1"].load(tmp_path, "reference")
    setup = periodic_cameras.setup(camera, chart_cameras.lines(550))
    period = 40 * max(setup.size)
    angle, reach = math.radians(7.0), 0.4 * period
    lean = reach * math.tan(angle)
    start = np.array([[-reach, -reach], [lean, -reach], [reach, -reach]])
    stop = np.array([[-reach, reach], [-lean, reach], [reach, reach]])
    bright = outlines.sides(start, stop, np.array([-0.45, 0.9, -0.45]), cutoff(setup))
    bright = dataclasses.replace(bright, ground=0.5)
    slow = mean_electrons(setup, outlines.series(bright, period, cutoff(setup)))
    truth = edge_truth.slanted_edge(setup, angle, 0.9)
    assert np.abs(slow - truth).max() <= 1e-4 * truth.max()


SAMPLED = ("csf-0", "slanted-edge-5", "eye-chart-1", "step-wedge-1")
MORE_SAMPLED = (
    "siemens-star-2",
    "siemens-star-4",
    "csf-2",
    "hdr-patches-2",
    "colorchecker-2",
    "dead-leaves-1",
)


@pytest.mark.parametrize("name", SAMPLED)
def test_charts_against_points_of_them(name, tmp_path):
    _compare_with_points(name, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("name", MORE_SAMPLED)
def test_more_charts_against_points_of_them(name, tmp_path):
    _compare_with_points(name, tmp_path)


def _compare_with_points(name, folder):
    """The charts' own values at a great many points, on a window of three arrays and more.

    Upright edges lie where the next points are, which calls for more of them.
    """
    each = chart_cameras.CAMERAS[name]
    camera = each.load(folder, "reference")
    setup = periodic_cameras.setup(camera, chart_cameras.lines(550))
    truth = each.truth(camera)
    points = 6000 if each.chart in ("hdr-patches", "colorchecker") else 2400
    slow = mean_electrons(setup, _sampled(camera, setup, points))
    assert np.sqrt(np.mean((slow - truth) ** 2)) <= 2e-3 * truth.max()


def _sampled(camera, setup, points):
    """The Fourier series of points x points values, evenly over three times the longer side."""
    rows, columns = setup.color.shape
    scene = build(camera.scene, View(rows, columns, setup.pitch_x, setup.pitch_y), None)
    period = 3 * max(setup.size) + 6 * setup.wavelength[0] * setup.f_number
    at = ((np.arange(points) + 0.37) / points - 0.5) * period
    light = scene.values_at(at, at, _reflectances(camera, setup))[0]
    most = math.floor(period * cutoff(setup))
    f = np.arange(-most, most + 1) / period
    wave = np.exp(-2j * np.pi * np.outer(f, at)) / points
    found = wave @ light @ wave[most:].T
    return Series(f[most:], f, found * np.where(f[most:] > 0, 2, 1))


def _reflectances(camera, setup):
    """Of the chart's parts at the only wavelength: (1, K)."""
    names = {
        "colorchecker": None,
        "dead-leaves": list(PIGMENTS),
    }.get(camera.scene.source.chart, [])
    table = DATA / "colorchecker.csv"
    if names is None:
        lines = table.read_text(encoding="utf-8").splitlines()
        header = next(line for line in lines if not line.startswith("#"))
        names = [name.strip('"') for name in header.split(",")[1:]]
        known = [column(table, name)(setup.wavelength)[0] for name in names]
        return np.array([[*known, 1.0]])
    return np.array([[column(table, name)(setup.wavelength)[0] for name in names] or [1.0]])


def test_image_against_overlaps_of_its_squares(tmp_path):
    """At f/0.7 the lens spreads less than a sample: nearly the part of each on a photodetector."""
    camera = chart_cameras.CAMERAS["image-7"]
    wide = dataclasses.replace(camera, changes={**camera.changes, "pixel.width": "20 um"})
    wide.changes["optics.f_number"] = 0.7
    model = wide.load(tmp_path, "reference")
    setup = periodic_cameras.setup(model, chart_cameras.lines(550))
    truth = wide.truth(model)
    rows, columns = wide.samples.shape
    side = setup.size[0] / columns
    more = 2
    padded = np.pad(wide.samples, more, mode="symmetric")
    place = -(columns / 2 + more) * side, -(rows / 2 + more) * side
    squares = Collector(padded, "", *place, side, side)
    x, y, width, height = setup.aperture
    light = squares.at(setup.centers[0] + x, setup.centers[1] + y, width, height)
    slow = electrons_per_light(setup)[0, setup.color, 0] * light
    assert np.sqrt(np.mean((slow - truth) ** 2)) <= 5e-3 * truth.max()


@pytest.mark.long
def test_truths_are_ten_times_as_good_as_what_they_judge(tmp_path):
    """And no light is negative; leaves are left out, of which a series has all."""
    for camera in chart_cameras.CAMERAS.values():
        if camera.chart != "dead-leaves":
            found = camera.exact_mean(camera.load(tmp_path, "reference"))
            assert found.error <= 2e-5, camera.name
            assert found.mean.min() >= 0, camera.name
