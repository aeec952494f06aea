"""Sharp edges through lenses that distort, against means of half-planes that share no code.

Each fine square of the sensor is covered by a spoke of a star as far as the straight edge through
it says. Transforms of their grid blur it by the closed form of the lens and by the photodetector.
"""

import math

import numpy as np
import pytest
from making import QUIET, camera
from scipy import fft, ndimage

from vcam_cli import simulate
from vcam_cli.scenes import warped
from vcam_cli.scenes.charts.sinusoid import WaveChart
from vcam_cli.scenes.warped import WarpedChart, smooth_map
from vcam_cli.scenes.waves import Wave

ROWS, COLUMNS, PITCH, FILL = 60, 80, 5e-6, 0.81
FINE, BEYOND, SPOKES = 12, 10, 24
UNRESOLVED = 16
"""Pixels around the star's center that are not judged: fine squares there see many spokes."""
STAR = {
    "scene.source": {"kind": "chart", "chart": "siemens-star", "spokes": SPOKES},
    "effects": QUIET | {"quantization": "off"},
    "array": {"rows": ROWS, "columns": COLUMNS, "pattern": "monochrome"},
    "pixel.photodetector.fill_factor": FILL,
}
K1 = -20.0
LENSES = {
    "barrel": ({"optics.distortion": {"k1": K1}}, 5e-3),
    "fisheye": ({"optics.projection": "equidistant", "optics.focal_length": "0.3 mm"}, 0.3e-3),
}


def unbent(name: str, x: np.ndarray, y: np.ndarray, image: float) -> tuple[np.ndarray, np.ndarray]:
    """Where places look in the image of a pinhole."""
    seen = np.hypot(x, y) / image
    if name == "fisheye":
        ideal = np.tan(np.minimum(seen, 1.4))
    else:
        ideal = seen.copy()
        for _ in range(40):
            ideal = ideal - (ideal + K1 * ideal**3 - seen) / (1 + 3 * K1 * ideal**2)
    scale = ideal / np.maximum(seen, 1e-12)
    return x * scale, y * scale


def covered(name: str, image: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parts (m, n) of fine squares that bright spokes cover, and the squares' centers [m]."""
    x, y = (
        ((np.arange(n * FINE) + 0.5) / FINE - n / 2) * PITCH
        for n in (COLUMNS + 2 * BEYOND, ROWS + 2 * BEYOND)
    )
    u, v = unbent(name, *np.meshgrid(x, y), image)
    inside = np.cos(SPOKES * np.arctan2(v, u)) * np.hypot(u, v)
    steps = np.sort(np.abs(np.gradient(inside)), axis=0)
    low, high = steps[0], np.maximum(steps[1], 1e-30)
    away, ends, flat = np.abs(inside), (high + low) / 2, (high - low) / 2
    corner = np.square(ends - away) / (2 * high * np.maximum(low, 1e-30))
    beyond = np.where(away >= ends, 0, np.where(away >= flat, corner, 0.5 - away / high))
    return np.where(inside > 0, 1 - beyond, beyond), x, y


def truth(name: str, focal: float) -> np.ndarray:
    image = focal / (1 - focal)
    light, x, y = covered(name, image)
    fx, fy = np.fft.rfftfreq(len(x), PITCH / FINE), np.fft.fftfreq(len(y), PITCH / FINE)[:, None]
    side = PITCH * math.sqrt(FILL)
    nu = np.minimum(np.hypot(fx, fy) * 550e-9 * 4 / (1 - focal), 1)
    lens = 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu * nu))
    half = np.exp(1j * np.pi * (fx + fy) * PITCH / FINE)  # to the borders between squares
    blurred = fft.irfft2(
        fft.rfft2(light) * lens * np.sinc(fx * side) * np.sinc(fy * side) * half, s=light.shape
    )
    rows, columns = ((np.arange(n) + BEYOND) * FINE + FINE // 2 - 1 for n in (ROWS, COLUMNS))
    return blurred[np.ix_(rows, columns)]


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("fisheye", 5e-3),
        *(pytest.param("barrel", tolerance, marks=pytest.mark.long) for tolerance in (5e-3, 5e-4)),
    ],
)
def test_spokes_through_a_lens_keep_the_tolerance(name, tolerance, tmp_path):
    """With a tight tolerance far light counts, which rings of cells around the array hold."""
    lens, focal = LENSES[name]
    found = simulate(camera(tmp_path, STAR | lens | {"accuracy": tolerance})).mean_electrons
    expected = truth(name, focal)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    judged = np.hypot(y - (ROWS - 1) / 2, x - (COLUMNS - 1) / 2) > UNRESOLVED
    seen, expected = found[judged].astype(float), expected[judged]
    scale = float(seen @ expected / (expected @ expected))  # of the level alone
    # The truth itself errs by 1e-4: with 16 squares along a pixel it is another by that much.
    assert np.sqrt(np.mean((seen / scale - expected) ** 2)) < tolerance + 1e-4


FREQUENCY = np.array([0.2, 0.13])
"""Of a wave on the sensor [cycles per cell]."""


@pytest.mark.parametrize("turn", [0.0, 30.0, 45.0])
@pytest.mark.parametrize("stretch", [1.0, 1.02, 1.5, 2.5, 3.0, 3.5])
def test_cells_see_the_mean_of_a_wave(stretch, turn):
    """Of what a stretched cell sees of a wave the mean is known: on the sensor it is no other."""
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    along, across = np.array([cos, sin]), np.array([-sin, cos])
    bend = stretch * np.outer(along, along) + np.outer(across, across)
    fx, fy = np.linalg.solve(bend.T, FREQUENCY).tolist()
    sees = smooth_map(lambda x, y: tuple(np.tensordot(bend, [x, y], 1)), (9.0, 9.0))
    assert sees is not None
    edges = np.linspace(-8, 8, 17)
    middle = (edges[1:] + edges[:-1]) / 2
    phase = 2 * np.pi * (FREQUENCY[0] * middle + FREQUENCY[1] * middle[:, None])
    expected = np.cos(phase) * np.sinc(FREQUENCY).prod()
    wave = WaveChart((Wave((1.0,), fx, fy),))
    error = {}
    for alike in (0.0, 1e-9, math.inf):  # four squares, two where they do, one
        chart = WarpedChart(wave, sees, alike=alike)
        error[alike] = np.abs(chart.averages(edges, edges, np.ones((1, 1)))[0] - expected).max()
    angular = 2 * np.pi * float(np.hypot(*FREQUENCY))
    spline = 2e-4
    """Of squares half a side apart, along both axes."""
    elongation = stretch**2 - 1
    assert max(error[0.0], error[1e-9]) < elongation * angular**4 / 720 + spline
    # One square has the mean of both second moments: each misses half of their difference.
    assert error[math.inf] < angular**2 * elongation / 48 + spline


@pytest.mark.parametrize("planes", [1, 3])
def test_squares_are_interpolated_as_scipy_does(planes):
    """Also where light is taken as even: a spline sees nothing of edges ten cells away."""
    rng = np.random.default_rng(5)
    cells = rng.random((planes, 3, 2)).repeat(80, axis=1).repeat(125, axis=2)
    row, column = (rng.uniform(BEYOND, n - 2 - BEYOND, (60, 70)) for n in cells.shape[1:])
    squares = sum(cells[:, i : i + 239, k : k + 249] for i in (0, 1) for k in (0, 1)) / 4
    expected = [ndimage.map_coordinates(s, (row, column), mode="mirror") for s in squares]
    spline = warped._spline_across(warped._spline_down(cells))
    found = warped._interpolated(spline, row.ravel(), column.ravel())
    np.testing.assert_allclose(found.reshape(np.shape(expected)), expected, atol=1e-12)
    light, varies = warped._even_light(cells, row, column, 0.7)
    np.testing.assert_allclose(light[:, ~varies], np.array(expected)[:, ~varies], atol=1e-5)
    assert 0.2 < varies.mean() < 0.9


def test_boxes_may_leave_gaps_and_overlap():
    """Collecting areas are as wide as they are, whatever their distance."""
    sees = smooth_map(lambda x, y: (1.01 * x, 1.01 * y), (9.0, 9.0))
    assert sees is not None
    chart = WarpedChart(WaveChart((Wave((1.0,), 0.15),)), sees)
    x = np.arange(-5.0, 5.5)
    for width in (0.2, 1.7):
        found = chart.box_averages(x, x, (width, 0.5), np.ones((1, 1)))[0]
        frequency = 0.15 * 1.01
        expected = np.cos(2 * np.pi * frequency * x) * np.sinc(frequency * width)
        # Splines between squares of 1.7 err by 1e-3 of so fine a wave.
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=2e-3)
