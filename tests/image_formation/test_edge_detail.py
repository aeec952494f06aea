"""The detail of rectangles, from their edges: in closed form, and against frames."""

import math

import numpy as np
import pytest
from making import camera
from test_scene_detail import BLURS, SIZE, change, chart, detail_of

from vcam_cli.image_formation.estimates import edge_detail, scene_detail
from vcam_cli.scenes.base import Rectangles
from vcam_cli.simulation.simulate import prepare


def test_a_blurred_edge_changes_by_what_the_error_function_says():
    """Steps of 3 and -1, and across them of 2, behind a Gaussian of standard deviation s.

    The square of the change of a step of 1, over all places across it, is s (sqrt(2) - 1) /
    sqrt(pi): that of 1 - Phi(x / s), twice.
    """
    x, y = np.array([0.0, 4.0, 7.0, 10.0]), np.array([0.0, 2.0, 5.0])
    light = np.array([[[1.0, 4.0, 3.0], [3.0, 6.0, 5.0]]])
    s = 0.05
    f, power, beyond = edge_detail.edge_power(Rectangles(x, y, light), 1 / s, 1 / s)
    radius = np.hypot(f, f[:, None])
    lost = 1 - np.exp(-2 * np.square(np.pi * s * radius))
    found = (power * np.square(lost)).sum() + beyond
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
    true = change(tmp_path, changes, name)
    assert true <= estimate
    if source["scene.source"]["chart"] == "colorchecker":
        by_chance = 1 + scene_detail.CONFIDENCE * detail.error
        assert estimate / math.sqrt(by_chance) == pytest.approx(true, rel=0.06)
