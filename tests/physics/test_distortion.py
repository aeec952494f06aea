"""Where lenses image directions: against OpenCV's numbers, closed forms and the way back.

The places are those of cv2.projectPoints and cv2.fisheye.distortPoints of opencv-python-headless
5.0.0, less the principal point and over the focal lengths; the coefficients are made up.
"""

import math

import numpy as np
import pytest

from vcam_cli.physics.distortion import (
    PROJECTIONS,
    BrownConrady,
    Chain,
    DistortionTable,
    Fisheye,
    Projection,
)

PINHOLE = (
    (
        BrownConrady(k1=-0.36, k2=0.16, k3=-0.035),
        (8 / 15, -0.45, 0.457918517567501, -0.386368749197579),
    ),
    (BrownConrady(k1=-0.2, k2=0.32, k3=-0.11), (0.4, 0.45, 0.3857240703125, 0.433939579101563)),
    (BrownConrady(p1=0.004, p2=-0.0025), (8 / 15, -0.45, 0.528773749999999, -0.445232222222015)),
    (
        BrownConrady(8.2, 3.9, 0.0001, -0.0002, 0.14, 8.55, 6.1, 0.86),
        (8 / 15, -0.45, 0.471448897733419, -0.397818484892199),
    ),
    (
        BrownConrady(
            0.46, -0.26, 0.0007, -0.0005, 0.05, 0.62, -0.18, 0.04, 0.002, -0.0008, -0.0015, 0.0006
        ),
        (0.4, 0.45, 0.377908505561869, 0.424442459381926),
    ),
)  # fmt: skip
FISHEYE = (
    (Fisheye(-0.09, 0.018, -0.004, 0.0005), (0.267949192431123, 0.0, 0.260206277859707, 0.0)),
    (
        Fisheye(-0.0416667, 0.000520833, -3.1e-6),
        (-0.737277336810124, -0.67559020761566, -0.564287630856582, -0.517074347266633),
    ),
    (Fisheye(-0.0416667, 0.000520833, -3.1e-6), (0.0, 5.67128181961771, 0.0, 1.285574912757998)),
)
PIXELS = 2e-12
"""Digits of the numbers above, over a focal length of 1000 pixels: 1e-9 of a pixel."""
X, Y = np.meshgrid(np.linspace(-0.8, 0.8, 9), np.linspace(-0.6, 0.6, 7))


def off_axis(mapping):
    """Its points but the axis."""
    away = np.hypot(X, Y) > 0
    return mapping.distort(X[away], Y[away]), (X[away], Y[away])


@pytest.mark.parametrize(("mapping", "point"), [*PINHOLE, *FISHEYE])
def test_places_are_those_of_opencv(mapping, point):
    x, y, u, v = (np.array([value]) for value in point)
    np.testing.assert_allclose(np.ravel(mapping.distort(x, y)), [u[0], v[0]], atol=PIXELS)
    # On the way back errors grow with the secant of the angle, squared.
    near = PIXELS * (1 + float(x[0] ** 2 + y[0] ** 2)) * 2
    np.testing.assert_allclose(np.ravel(mapping.undistort(u, v)), [x[0], y[0]], atol=near)


@pytest.mark.parametrize(
    "mapping",
    [
        *(mapping for mapping, _ in PINHOLE),
        *(Projection(name) for name in PROJECTIONS),
        DistortionTable((0.0, 0.3, 0.6, 1.2), (0.0, -0.02, -0.05, -0.03)),
        Chain((Projection("equidistant"), BrownConrady(k1=0.02, p1=1e-3))),
    ],
)
def test_the_way_back_leads_back(mapping):
    (u, v), (x, y) = off_axis(mapping)
    back = mapping.undistort(u, v)
    np.testing.assert_allclose(back, (x, y), atol=1e-12)


def test_projections_are_their_formulas():
    """At 60 degrees; 2 f sin(theta/2) keeps areas, 2 f tan(theta/2) angles."""
    t = np.array([math.pi / 3])
    heights = {
        "rectilinear": math.sqrt(3),
        "equidistant": math.pi / 3,
        "equisolid": 1.0,
        "stereographic": 2 / math.sqrt(3),
        "orthographic": math.sqrt(3) / 2,
    }
    for name, height in heights.items():
        assert Projection(name).height(t)[0] == pytest.approx(height, rel=1e-14)


def test_beyond_a_fold_nothing_is_seen():
    """x (1 - x^2) rises to x = 0.577, where it is 0.385."""
    mapping = BrownConrady(k1=-1.0)
    inside, _ = mapping.undistort(np.array([0.384]), np.zeros(1))
    beyond, _ = mapping.undistort(np.array([0.386]), np.zeros(1))
    assert 0 < inside[0] < 1 / math.sqrt(3)
    assert np.isnan(beyond[0])
    # a direction further out is imaged within, and is not what is seen there
    assert mapping.distort(np.array([0.8]), np.zeros(1))[0][0] == pytest.approx(0.288)
    assert mapping.undistort(np.array([0.288]), np.zeros(1))[0][0] < 1 / math.sqrt(3)


def test_a_table_is_straight_between_its_heights():
    """Real heights 0.45 of 0.3 and 0.6: the mean of both, over the real one."""
    table = DistortionTable((0.3, 0.6), (-0.02, -0.06))
    x, _ = table.undistort(np.array([0.45, 0.1, 2.0]), np.zeros(3))
    np.testing.assert_allclose(x, [0.45 / 0.96, 0.1 / 0.98, 2.0 / 0.94], rtol=1e-14)
    assert table.is_monotonic
    assert not DistortionTable((0.0, 0.5, 0.6), (0.0, 0.0, 0.5)).is_monotonic
