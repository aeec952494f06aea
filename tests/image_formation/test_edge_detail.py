"""The detail of even light between edges: in closed form, and against frames."""

import dataclasses
import math

import numpy as np
import pytest
from making import camera
from test_scene_detail import BLURS, SIZE, change, chart, detail_of, estimate

from vcam_cli.image_formation.estimates import edge_detail, scene_detail
from vcam_cli.scenes.base import Rectangles
from vcam_cli.simulation.simulate import prepare

PIXELS = edge_detail.PixelLattice(pitch=(4e-6, 4e-6), size=(1280e-6, 960e-6), cutoff=900e3)
WHOLE = {"pixel.photodetector.fill_factor": 1}
"""Pixels that are sensitive all over."""


def changed_by_gaussian(edges: edge_detail.EdgePower, s: float) -> float:
    """Mean square of what a Gaussian of standard deviation s changes."""
    lost = 1 - np.exp(-2 * np.square(np.pi * s * np.hypot(edges.fx, edges.fy[:, None])))
    return float((edges.power * np.square(lost)).sum() + edges.beyond)


@pytest.fixture
def anywhere(monkeypatch):
    """Edges count as those that lie everywhere on the pixels."""
    monkeypatch.setattr(edge_detail.PixelLattice, "in_step", lambda *_: 1.0)


def test_a_blurred_edge_changes_by_what_the_error_function_says(anywhere):
    """Steps of 3 and -1, and across them of 2, behind a Gaussian of standard deviation s.

    The square of the change of a step of 1, over all places across it, is s (sqrt(2) - 1) /
    sqrt(pi): that of 1 - Phi(x / s), twice.
    """
    x, y = np.array([0.0, 4.0, 7.0, 10.0]), np.array([0.0, 2.0, 5.0])
    light = np.array([[[1.0, 4.0, 3.0], [3.0, 6.0, 5.0]]])
    s = 0.05
    edges = edge_detail.rectangles_power(Rectangles(x, y, light), PIXELS, 1 / s, 1 / s)
    found = changed_by_gaussian(edges, s)
    squares = (3**2 + 1) * 5.0 + 2**2 * 10.0
    area = 50.0
    # Frequencies are a fifth of e apart, and the highest is 32 / s.
    assert found == pytest.approx(
        squares / area * s * (math.sqrt(2) - 1) / math.sqrt(math.pi), rel=0.02
    )


def test_what_is_beside_the_array_or_too_narrow_is_not_taken(tmp_path, monkeypatch):
    path, _, _ = detail_of(tmp_path, monkeypatch, SIZE | chart("step-wedge", steps=10))
    scene = prepare(camera(tmp_path, SIZE | chart("step-wedge", steps=10)), 1)[0].scene
    level = path.transfer.level[:, 0]
    size = path.geometry.sensor_width, path.geometry.sensor_height
    found = edge_detail.isolated_edges(scene, level, size, 0.0)
    assert np.ptp(found.x) == pytest.approx(size[0])
    assert np.ptp(found.y) == pytest.approx(size[1])
    assert found.values.shape == (1, len(found.y) - 1, len(found.x) - 1)
    assert len(np.unique(found.values)) == 10
    wide = float(np.diff(found.x).min())
    assert edge_detail.isolated_edges(scene, level, size, 1.01 * wide) is None
    assert edge_detail.isolated_edges(scene, level, size, 0.99 * wide) is not None


@pytest.mark.parametrize("name", BLURS)
@pytest.mark.parametrize(
    ("f_number", "source"),
    [
        (2.8, chart("colorchecker")),
        (1.4, chart("step-wedge", steps=14)),
        (1.4, chart("step-wedge", steps=3)),
        (2.8, chart("step-wedge", steps=3)),
        (5.6, chart("step-wedge", steps=11)),
        (2.8, chart("step-wedge") | {"pixel.width": "2.25 um", **WHOLE}),
        (5.6, chart("step-wedge", steps=5) | WHOLE),
        (1.4, chart("step-wedge", steps=5) | WHOLE),
    ],
)
def test_the_estimate_of_rectangles_is_a_bound(f_number, source, name, tmp_path, monkeypatch):
    """Against two frames, whose full signal is that of their brightest pixel.

    Edges of the wedges all lie alike to the pixels, where a blur may change more than elsewhere;
    those of the patches lie anywhere.
    """
    changes = SIZE | source | {"optics.f_number": f_number}
    _, detail, functions = detail_of(tmp_path, monkeypatch, changes)
    assert np.count_nonzero(detail.power[1:, 1:]) == 0  # as of edges, not of tiles
    [effect] = [e for e in functions if e.name == name]
    estimate = scene_detail.change_by_omission(detail, functions, [effect]) / detail.brightest
    assert change(tmp_path, changes, name) <= estimate


@pytest.mark.parametrize("name", BLURS)
def test_the_estimate_of_patches(name, tmp_path, monkeypatch, anywhere):
    """Their edges lie anywhere; against two frames, as above."""
    changes = SIZE | chart("colorchecker") | {"optics.f_number": 2.8}
    found = estimate(tmp_path, monkeypatch, changes, name)
    assert found == pytest.approx(change(tmp_path, changes, name), rel=0.06)


def test_edges_are_told_by_how_alike_they_lie():
    """The Poisson kernel of a peak P is 1 + 2 sum q^m cos; of its even waves alone as written."""
    peak = 2.6 * math.sqrt(4e-6 * 900e3)
    q = (peak - 1) / (peak + 1)
    for places, expected in (
        (np.arange(6) + 0.3, peak),
        (np.arange(6) / 2, (1 + q**2) / (1 - q**2)),
        (np.arange(100) / 100, 1),
    ):
        found = PIXELS.in_step(places * 4e-6, np.ones(len(places)), 4e-6)
        assert found == pytest.approx(expected, rel=1e-4)
    assert PIXELS.in_step(np.arange(6) * 1e-6, np.zeros(6), 4e-6) == 1
    sharp = dataclasses.replace(PIXELS, cutoff=math.inf)
    assert sharp.in_step(np.zeros(2), np.ones(2), 4e-6) == 1 + 2 * edge_detail.HARMONICS
    coarse = dataclasses.replace(PIXELS, cutoff=1e3)
    assert coarse.in_step(np.zeros(2), np.ones(2), 4e-6) == pytest.approx(2.6)


@pytest.mark.parametrize("angle", [0.0, 5.0, -30.0, 45.0, 80.0, 90.0])
def test_a_straight_edge_changes_by_what_the_error_function_says(angle, anywhere):
    """Of height 3, from side to side of a wide array; as above."""
    width, height = PIXELS.size
    across = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    s = 1e-3 * height
    edges = edge_detail.straight_edge_power(across, np.array([4.0, 1.0]), PIXELS, 1 / s, 1 / s)
    ways = [
        way / abs(part)
        for way, part in zip((height, width), across, strict=True)
        if abs(part) > 1e-9
    ]
    true = 9 * min(ways) / (width * height)
    true *= s * (math.sqrt(2) - 1) / math.sqrt(math.pi)
    assert changed_by_gaussian(edges, s) == pytest.approx(true, rel=0.02)
    assert edges.brightest == 4


@pytest.mark.parametrize("name", BLURS)
@pytest.mark.parametrize("fill_factor", [0.5, 1.0])
@pytest.mark.parametrize("angle", ["0 deg", "5 deg", "-30 deg", "45 deg", "63.434949 deg"])
def test_the_estimate_of_a_straight_edge(angle, fill_factor, name, tmp_path, monkeypatch):
    """Against two frames: the truth of edges that pass the pixels everywhere, else a bound."""
    changes = SIZE | chart("slanted-edge", angle=angle, contrast=0.8)
    changes |= {"pixel.photodetector.fill_factor": fill_factor, "optics.f_number": 2.8}
    _, detail, functions = detail_of(tmp_path, monkeypatch, changes)
    [effect] = [e for e in functions if e.name == name]
    estimate = scene_detail.change_by_omission(detail, functions, [effect]) / detail.brightest
    true = change(tmp_path, changes, name)
    if angle in ("5 deg", "-30 deg"):
        assert estimate == pytest.approx(true, rel=0.06)
    else:  # the pixels of every line, of every second or of every fifth lie alike
        assert true <= estimate
