"""Depth of field against rays that are traced through a thin lens."""

import math

import numpy as np
import pytest

from vcam_cli.physics.depth_of_field import blur_diameter, depth_of_field, hyperfocal_distance

LENSES = [(50e-3, 2.8, 30e-6), (4e-3, 1.8, 1.4e-6), (200e-3, 16, 5e-6)]


def traced_blur(distance: float, focus: float, focal: float, number: float) -> float:
    """Spread on the sensor of two rays through opposite edges of the aperture."""

    def image(d):
        return focal if math.isinf(d) else d * focal / (d - focal)

    edge, sensor, sharp = focal / number / 2, image(focus), image(distance)
    # The ray from the edge crosses the axis where the point is sharp.
    return 2 * abs(edge + (0 - edge) / sharp * sensor)


@pytest.mark.parametrize(("focal", "number"), [lens[:2] for lens in LENSES])
@pytest.mark.parametrize("focus", [0.5, 2.0, 40.0, math.inf])
def test_blur_is_that_of_rays(focal, number, focus):
    distances = np.array([0.3, 0.5, 1.0, 7.0, 1e4, math.inf])
    found = blur_diameter(distances, focus, focal, number)
    traced = [traced_blur(d, focus, focal, number) for d in distances]
    np.testing.assert_allclose(found, traced, rtol=1e-9, atol=1e-16)


@pytest.mark.parametrize(("focal", "number", "circle"), LENSES)
@pytest.mark.parametrize("focus", [0.5, 2.0, 40.0])
def test_its_ends_are_blurred_by_the_circle(focal, number, circle, focus):
    near, far = depth_of_field(focus, focal, number, circle)
    assert near < focus < far
    assert traced_blur(near, focus, focal, number) == pytest.approx(circle, rel=1e-9)
    if math.isfinite(far):
        assert traced_blur(far, focus, focal, number) == pytest.approx(circle, rel=1e-9)
    else:
        assert traced_blur(math.inf, focus, focal, number) <= circle * (1 + 1e-9)


@pytest.mark.parametrize(("focal", "number", "circle"), LENSES)
def test_hyperfocal_distance_is_the_nearest_focus_that_reaches_infinity(focal, number, circle):
    focus = hyperfocal_distance(focal, number, circle)
    assert math.isinf(depth_of_field(focus, focal, number, circle)[1])
    assert math.isfinite(depth_of_field(focus * 0.999, focal, number, circle)[1])
    assert depth_of_field(focus, focal, number, circle)[0] == pytest.approx(focus / 2, rel=1e-9)
