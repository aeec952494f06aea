"""What a blur changes of straight edges, against a fine integral at every pixel."""

from dataclasses import replace

import numpy as np
import pytest
from making import camera, long_except
from optical_paths import PITCH, aperture, of_camera, on_chart, path, rms, sensor

from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates.edge_changes import exact_changes
from vcam_cli.image_formation.field_dependence import field_along
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.simulation.simulate import prepare


@pytest.mark.parametrize(("f_number", "angle"), [(2.0, 0.6), (22.0, 0.1), (8.0, 0.0)])
def test_the_change_of_an_edge_is_that_of_its_edge_spread_function(f_number, angle):
    """At the distance d: the integral of (1 - H) times the aperture, times sin(2 pi f d) / pi f.

    Of all pixels, however far from the edge, and of all frequencies: what the estimate leaves out
    is less than a hundredth, of the light and of the change.
    """
    g, lens = sensor(24, 32), Diffraction(f_number, 0.0)
    seen = path(g, lens, aperture(g))
    scene = on_chart(seen, SlantedEdge(angle, 0.6))
    profile = scene.chart.profile()
    across, (height,) = profile.across, np.diff(profile.levels)
    x, y = pixel_centers(g)
    distance = (across[0] * x + across[1] * y[:, None] - profile.places[0]).ravel()
    f = (np.arange(10_000) + 0.5) * (50 / PITCH / 10_000)
    pixel = np.sinc(f * PITCH * across[0]) * np.sinc(f * PITCH * across[1])
    parts = (1 - lens.otf_along(f, across, 550e-9)) * pixel / (np.pi * f) * (f[1] - f[0])
    change = [height * parts @ np.sin(2 * np.pi * f * d) for d in distance]
    found = exact_changes(seen, scene, [lens])[lens]
    assert found == pytest.approx(rms(change), rel=6e-3)


# --- a blur that changes over the field -------------------------------------------------------

SMALL = {"array.rows": 48, "array.columns": 64, "pixel.width": "4 um", "optics.f_number": 2.8}
LENSES = {
    "coma": [{"field": 0, 8: "0 nm"}, {"field": 1, 8: "120 nm"}],
    "astigmatism": [{"field": 0, 6: "0 nm"}, {"field": 1, 6: "120 nm"}],
    "spherical": [{"field": 0, 11: "20 nm"}, {"field": 1, 11: "90 nm"}],
    "defocus": [{"field": 0, 4: "100 nm"}, {"field": 0.6, 4: "0 nm"}, {"field": 1, 4: "-80 nm"}],
}
EDGES = [
    {"chart": "step-wedge"},
    {"chart": "slanted-edge"},
    {"chart": "slanted-edge", "angle": "0 deg"},
    {"chart": "slanted-edge", "angle": "90 deg"},
    {"chart": "slanted-edge", "angle": "-60 deg"},
]
FRAME = 1e-4
"""Rms error of the two frames together, over full signal; of random errors squares add."""


def over_field(tmp_path, lens: str, chart: dict):
    """A path through a lens over the field, its scene, and what the camera's file says."""
    source = {"scene.source": {"kind": "chart", **chart}}
    changes = SMALL | {"optics.zernike": LENSES[lens]} | source
    return *of_camera(camera(tmp_path, changes)), changes


@pytest.mark.parametrize("lens", long_except(["spherical"], LENSES))
@pytest.mark.parametrize(
    "chart", long_except(EDGES[:2], EDGES), ids=lambda c: f"{c['chart']} {c.get('angle', '')}"
)
def test_a_blur_over_the_field_changes_edges_by_at_most_its_sum(lens, chart, tmp_path):
    """The frame with it less that without it, in which diffraction hides part of the change."""
    seen, scene, changes = over_field(tmp_path, lens, chart)
    with_it, without = (
        prepare(camera(tmp_path, changes | {"effects": effects}), 1)[0].rate
        for effects in ("all", {"aberration": "off"})
    )
    full = with_it.max()
    change = rms(with_it, without) / full
    found = exact_changes(seen, scene, [seen.field])[seen.field] / full
    assert change <= np.hypot(found, FRAME)
    assert found <= 1.6 * change + FRAME


@pytest.mark.parametrize("lens", LENSES)
def test_what_is_added_at_a_ring_is_its_blur_turned_with_the_azimuth(lens, tmp_path):
    """Below the cut-off of the one wavelength, on the way to a corner of the array."""
    seen, _, _ = over_field(tmp_path, lens, EDGES[1])
    (wavelength,) = seen.transfer.wavelengths
    across, azimuth = (0.28, -0.96), np.arctan2(48, 64)
    ring = seen.field_rings[-2]
    frequency = np.linspace(0, 0.95 * ring.blur.cutoff(wavelength), 90)
    changes, weights = field_along(
        seen.transfer, seen.field_rings, seen.geometry, frequency, across
    )
    place = ring.weight.place * seen.field.half_diagonal
    x, y = (np.array([place * a]) for a in (np.cos(azimuth), np.sin(azimuth)))
    found = np.tensordot(weights.at(x, y)[:, 0], changes, axes=1)
    turned = replace(ring.blur, angle=azimuth) if hasattr(ring.blur, "angle") else ring.blur
    wanted = turned.otf_along(frequency, across, wavelength) - 1
    level = seen.transfer.level[0, 0]
    assert np.abs(wanted).max() > 0.4
    np.testing.assert_allclose(found[0] / level, wanted, atol=0.01)


def test_before_rectangles_no_sum_of_a_blur_over_the_field_is_known(tmp_path):
    seen, scene, _ = over_field(tmp_path, "coma", {"chart": "colorchecker"})
    assert exact_changes(seen, scene, [seen.field]) == {}
