"""A lens that changes over the field, against the transfer of every pixel's own wavefront."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import PITCH, aperture, light, of_picture, path, rms, sensor, signal

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.field_blur import FieldBlur
from vcam_cli.effects.optics.low_pass import LowPassAlongAxes, ObliqueLowPass
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens
from vcam_cli.image_formation.settings import DRAFT, REFERENCE, STANDARD

WAVELENGTHS = (480e-9, 620e-9)
LENS = Lens(4.0, True)
GROWING = ((0.0, ((4, 60e-9),)), (0.5, ((6, 60e-9), (8, 40e-9))), (1.0, ((4, -60e-9), (8, 90e-9))))
WITHOUT_SYMMETRY = ((0.0, ((11, 30e-9),)), (1.0, ((5, 50e-9), (7, 60e-9), (10, -30e-9))))
STEEP = ((0.0, ()), (1.0, ((8, 260e-9), (4, 200e-9))))
"""From 8 waves a pupil radius on a grid of the pupil is computed."""


def by_own_wavefronts(
    picture: np.ndarray, g, field: FieldBlur, lens: Diffraction, copies=((0.0, 0.0),)
) -> np.ndarray:
    """Pixels (rows, columns) of a mirrored picture: a Fourier series for each of them.

    Their light is the mean over `copies` of the image, displaced along x and y [m].
    """
    twice = np.concatenate([picture, picture[::-1]])
    twice = np.concatenate([twice, twice[:, ::-1]], axis=1)
    coefficients = np.fft.fft2(twice) / twice.size
    highest = int(lens.cutoff(WAVELENGTHS[0]) * max(twice.shape) * PITCH) + 1
    k = np.arange(-highest, highest + 1)
    fy, fx = (k / (n * PITCH) for n in twice.shape)
    series = coefficients[np.ix_(k % twice.shape[0], k % twice.shape[1])]
    series = series * np.outer(np.sinc(fy * PITCH), np.sinc(fx * PITCH))  # samples are squares
    series = series * np.outer(aperture(g).along_y(fy), aperture(g).along_x(fx))
    moved = [np.exp(-2j * np.pi * (fx * dx + fy[:, None] * dy)) for dx, dy in copies]
    series = series * np.mean(moved, axis=0)
    perfect = {w: lens.otf(np.hypot(fx, fy[:, None]), w) for w in WAVELENGTHS}
    found = np.zeros(picture.shape)
    for row, column in np.ndindex(picture.shape):
        at = (row + 0.5) * PITCH, (column + 0.5) * PITCH
        y, x = at[0] - g.sensor_height / 2, at[1] - g.sensor_width / 2
        terms = field.wavefront(np.hypot(x, y) / field.half_diagonal)
        own = DirectedBlur(field.lens, terms, angle=np.arctan2(y, x))
        total = sum(own.otf_plane(fx, fy, w) * perfect[w] for w in WAVELENGTHS) / len(WAVELENGTHS)
        # the samples' first center lies half a pitch from the edge
        along_y, along_x = (
            np.exp(2j * np.pi * f * (p - PITCH / 2)) for f, p in zip((fy, fx), at, strict=True)
        )
        found[row, column] = (along_y @ (series * total) @ along_x).real
    return found


@pytest.fixture(scope="module")
def truths():
    """A noisy picture of 6 x 8 pixels through each field, and that field."""
    g = sensor(6, 8)
    picture = np.random.default_rng(3).random((6, 8))
    half_diagonal = float(np.hypot(g.sensor_width, g.sensor_height)) / 2
    found = {}
    for name, places in (("even", GROWING), ("uneven", WITHOUT_SYMMETRY), ("steep", STEEP)):
        field = FieldBlur(LENS, places, half_diagonal)
        found[name] = field, by_own_wavefronts(picture, g, field, Diffraction(4.0, 0.0))
    return g, picture, found


@pytest.mark.parametrize("name", ["even", "uneven", "steep"])
@pytest.mark.parametrize(
    "knobs", [DRAFT, STANDARD, REFERENCE], ids=["draft", "standard", "reference"]
)
def test_every_pixel_has_its_own_wavefront(knobs, name, truths):
    g, picture, fields = truths
    field, expected = fields[name]
    tolerance = {DRAFT: 0.02, STANDARD: 0.005, REFERENCE: 0.0005}[knobs]
    knobs = replace(knobs, tolerance=tolerance)
    effects = Diffraction(4.0, 0.0), field, aperture(g)
    transfer = light(*effects, wavelengths=WAVELENGTHS)
    found = signal(path(g, *effects, transfer=transfer, knobs=knobs), of_picture(picture, PITCH))
    assert rms(found, expected) <= tolerance, rms(found, expected) / tolerance
    assert rms(expected, picture) > 0.05


COPIES = 1.6e-6, 1.1e-6
FAR = 300e-6


@pytest.mark.parametrize(
    ("filter_kind", "plates", "copies"),
    [
        pytest.param(
            ObliqueLowPass, (COPIES,), ((0.8e-6, 0.55e-6), (-0.8e-6, -0.55e-6)), id="oblique"
        ),
        # 10 times the tolerance where their product with the lens was a table
        pytest.param(
            ObliqueLowPass, ((2 * FAR, FAR),), ((FAR, FAR / 2), (-FAR, -FAR / 2)), id="far"
        ),
        pytest.param(
            LowPassAlongAxes,
            ((1.6e-6, 0.0), (0.0, 1.1e-6)),
            ((0.8e-6, 0.55e-6), (-0.8e-6, 0.55e-6), (0.8e-6, -0.55e-6), (-0.8e-6, -0.55e-6)),
            id="both axes",
        ),
    ],
)
def test_a_filter_that_doubles_the_image_acts_beside_a_field(filter_kind, plates, copies):
    """Displaced copies of what every pixel's own wavefront makes."""
    g = sensor(6, 8)
    picture = np.random.default_rng(3).random((6, 8))
    half_diagonal = float(np.hypot(g.sensor_width, g.sensor_height)) / 2
    field, lens = FieldBlur(LENS, GROWING, half_diagonal), Diffraction(4.0, 0.0)
    expected = by_own_wavefronts(picture, g, field, lens, copies)
    effects = lens, field, filter_kind(plates), aperture(g)
    transfer = light(*effects, wavelengths=WAVELENGTHS)
    knobs = replace(REFERENCE, tolerance=0.0005)
    found = signal(path(g, *effects, transfer=transfer, knobs=knobs), of_picture(picture, PITCH))
    assert rms(found, expected) <= 0.0005
    without = by_own_wavefronts(picture, g, field, lens)
    assert rms(expected, without) > 0.01
