"""A plan of a large array takes the light of few places, and decides on light as a run does."""

import numpy as np
import pytest

from vcam_cli import load, plan
from vcam_cli.effects.base import of_kind
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.light_plan import KINDS
from vcam_cli.simulation import coarse_light
from vcam_cli.solve.solved import solve

SIZE = ("array.rows=120", "array.columns=160")
CAMERAS = {
    "edge": ("slanted-edge-f8", ()),
    "leaves": ("still-life", ()),
    "mean": ("starter", ("exposure={auto: {max: 1 s, method: mean, target: 0.2}}",)),
    "brightest": ("starter", ("exposure={auto: {max: 1 s, method: percentile, target: 0.9}}",)),
    "binned": ("12mp-bayer", ("array.binning={rows: 2, columns: 2, kind: charge}",)),
    "stacked": ("x3-stacked", ()),
    "samples": ("starter", ("exposure={captures: {schedule: optimal, count: 4, max: 100 ms}}",)),
    "rolling": (
        "street",
        ("exposure={auto: {max: 4 ms}, shutter: {rolling: {line_time: 10 us}}}",),
    ),
}


@pytest.fixture(autouse=True)
def _few_places(monkeypatch):
    """Small arrays count as large: 120 x 160 pixels have 1200 places of 4 x 4."""
    monkeypatch.setattr(coarse_light, "PLACES", 1200)
    monkeypatch.setattr(coarse_light, "FEWEST", 4800)


def camera(name):
    shipped, sets = CAMERAS[name]
    return load(shipped, [*SIZE, *sets])


@pytest.mark.parametrize("name", CAMERAS)
def test_light_is_decided_as_in_a_run(name):
    """By bounds on the whole array: no sample, and no other bound, decides what is left out."""
    estimated, exact = plan(camera(name)), plan(camera(name), details=True)
    assert estimated.ready.estimated_places > 0 == exact.ready.estimated_places
    on_light = {e.name for e in of_kind(exact.ready.solved.effects.enabled, *KINDS)}
    states = [
        {e["name"]: e["state"] for e in found.effects if e["name"] in on_light}
        for found in (estimated, exact)
    ]
    assert states[0] == states[1]
    # Means over 16 pixels: their mean is that of the pixels but for the light that blurs move
    # across the border, percentiles and brightest detail are smoothed.
    assert estimated.ready.exposure_time == pytest.approx(exact.ready.exposure_time, rel=0.1)
    assert estimated.geometry["rows"] == exact.geometry["rows"]


@pytest.mark.parametrize("name", ["edge", "leaves", "stacked"])
def test_mean_light_is_that_of_the_pixels(name):
    rates = [plan(camera(name), details=whole).ready.rate for whole in (False, True)]
    means = [rate.mean(axis=(-2, -1), dtype=float) for rate in rates]
    # The optics blur 2 of 120 rows across the border, of light that differs by a tenth there.
    np.testing.assert_allclose(*means, rtol=5e-3)


def test_no_image_of_all_pixels_is_formed(monkeypatch):
    formed, real = [], photon_rate.photo_rate

    def counted(path, *args, **more):
        formed.append(path.geometry.rows * path.geometry.columns)
        return real(path, *args, **more)

    monkeypatch.setattr(photon_rate, "photo_rate", counted)
    moving = "scene.source.motion={x: 2 m/s}"
    plan(load("street", [*SIZE, "exposure={auto: {max: 4 ms}}", moving]))
    assert formed
    assert max(formed) <= 2 * coarse_light.PLACES


@pytest.mark.parametrize(
    ("rows", "columns", "sets"),
    [
        (120, 160, ()),
        (6000, 2, ()),
        (2, 6000, ()),
        (5001, 3, ()),
        (240, 320, ("array.binning={rows: 2, columns: 2, kind: digital}",)),
    ],
)
def test_coarse_lattice_covers_the_sensor_in_whole_blocks(rows, columns, sets):
    solved = solve(load("12mp-bayer", [f"array.rows={rows}", f"array.columns={columns}", *sets]))
    coarse = coarse_light.coarse_camera(solved)
    g, fine = coarse.layout.lattice, solved.layout.lattice
    assert g.rows * g.columns < fine.rows * fine.columns
    assert g.rows * g.pitch_y == pytest.approx(fine.sensor_height)
    assert g.columns * g.pitch_x == pytest.approx(fine.sensor_width)
    block = (4, 4) if sets else (2, 2)
    assert (g.rows % block[0], g.columns % block[1]) == (0, 0)
    assert coarse.layout.is_scattered == solved.layout.is_scattered


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("starter", ("array.rows=40", "array.columns=60")),
        ("cfa-honeycomb", SIZE),
        ("table-top", SIZE),
        ("kai-02170", SIZE),
    ],
)
def test_other_arrays_are_planned_by_all_their_light(name, sets):
    """Small ones, pixels off rows and columns, layers that cover each other, moved charge."""
    assert coarse_light.coarse_camera(solve(load(name, sets))) is None
