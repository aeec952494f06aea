"""Distortion against OpenCV itself, where it is installed: places, and a calibration of a frame."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for
from moving_waves import IMAGE, PITCH

from vcam_cli import simulate
from vcam_cli.physics.distortion import BrownConrady, Fisheye

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed")
NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4")
"""In OpenCV's order."""
ROWS, COLUMNS, SPACING = 120, 160, 10
"""Of the frame, and of the points on it [pixels]."""


def test_places_are_those_of_opencv():
    """Coefficients of any size in a field of 35 degrees: 1e-9 pixels of 1000."""
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-0.5, 0.5, (2, 50))
    points = np.stack([x, y, np.ones(50)], axis=1)[:, None]
    zero = np.zeros(3)
    for _ in range(20):
        values = rng.normal(0, 0.05, 12)
        found = BrownConrady(**dict(zip(NAMES, values, strict=True))).distort(x, y)
        truth = cv2.projectPoints(points, zero, zero, np.eye(3), values)[0][:, 0]
        np.testing.assert_allclose(np.transpose(found), truth, atol=1e-12)
        found = Fisheye(*values[:4]).distort(x, y)
        truth = cv2.fisheye.projectPoints(points, zero, zero, np.eye(3), values[:4])[0][:, 0]
        np.testing.assert_allclose(np.transpose(found), truth, atol=1e-12)


def test_a_calibration_finds_the_coefficients_of_a_frame(tmp_path):
    """From the centers of a rendered grid, seen straight on by a lens of known focal length."""
    k1, k2 = -4.0, 60.0
    chart = {"kind": "chart", "chart": "point-grid", "spacing": "50 um", "diameter": "21.206 um"}
    frame = simulate(
        camera(
            tmp_path,
            {
                "scene.source": chart,
                "scene.radiance": radiance_for(20000),
                "array.rows": ROWS,
                "array.columns": COLUMNS,
                "optics.diffraction": False,
                "optics.distortion": {"k1": k1, "k2": k2},
                "pixel.photodetector.fill_factor": 1.0,
                "accuracy": "standard",
                "effects": QUIET | {"quantization": "off"},
            },
        )
    ).mean_electrons.astype(float)
    focal = IMAGE / PITCH
    center = np.array([(COLUMNS - 1) / 2, (ROWS - 1) / 2])
    lens = BrownConrady(k1=k1, k2=k2)
    ideal, seen = [], []
    for x in range(-70, 71, SPACING):
        for y in range(-50, 51, SPACING):
            near = np.ravel(lens.distort(np.array([x / focal]), np.array([y / focal]))) * focal
            left, top = np.rint(near + center).astype(int) - 4
            part = frame[top : top + 9, left : left + 9]
            rows, columns = np.mgrid[top : top + 9, left : left + 9]
            seen.append([(part * columns).sum() / part.sum(), (part * rows).sum() / part.sum()])
            ideal.append([x / focal, y / focal, 1.0])
    matrix = np.array([[focal, 0, center[0]], [0, focal, center[1]], [0, 0, 1.0]])
    plane = (np.array(ideal, np.float32) - [0, 0, 1]).astype(np.float32)
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_FOCAL_LENGTH
    flags |= cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
    rms, _, found, _, _ = cv2.calibrateCamera(
        [plane], [np.array(seen, np.float32)], (COLUMNS, ROWS), matrix, None, flags=flags
    )
    assert rms < 0.01
    # Centers that err by 0.003 pixels, as they do, leave about 0.02 of k1 and 2 of k2.
    assert found.ravel()[0] == pytest.approx(k1, abs=0.06)
    assert found.ravel()[1] == pytest.approx(k2, abs=6)
