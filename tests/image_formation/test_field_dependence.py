"""A lens that changes over the field, against the transfer of every pixel's own wavefront."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from making import long_except
from optical_paths import PITCH, aperture, light, of_picture, path, rms, sensor, signal

from vcam_cli import load, simulate
from vcam_cli.effects.optics import field_blur
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.field_blur import FieldBlur
from vcam_cli.effects.optics.low_pass import LowPassAlongAxes, ObliqueLowPass
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens
from vcam_cli.image_formation.settings import DRAFT, REFERENCE, STANDARD
from vcam_cli.simulation.shared import Shared

WAVELENGTHS = (480e-9, 620e-9)
LENS = Lens(4.0, True)
GROWING = ((0.0, ((4, 60e-9),)), (0.5, ((6, 60e-9), (8, 40e-9))), (1.0, ((4, -60e-9), (8, 90e-9))))
WITHOUT_SYMMETRY = ((0.0, ((11, 30e-9),)), (1.0, ((5, 50e-9), (7, 60e-9), (10, -30e-9))))
STEEP = ((0.0, ()), (1.0, ((8, 260e-9), (4, 200e-9))))
"""From 8 waves a pupil radius on a grid of the pupil is computed."""


SENSOR = sensor(4, 6)
PICTURE = np.random.default_rng(3).random((4, 6))
HALF_DIAGONAL = float(np.hypot(SENSOR.sensor_width, SENSOR.sensor_height)) / 2
PERFECT = Diffraction(4.0, 0.0)
HIGHEST = int(PERFECT.cutoff(WAVELENGTHS[0]) * 12 * PITCH) + 1
"""Harmonic of the mirrored picture that the lens still images."""
FX, FY = (np.arange(-HIGHEST, HIGHEST + 1) / (n * PITCH) for n in (12, 8))


def offsets(row: int, column: int) -> tuple[float, float]:
    """How far a pixel lies from the middle of the array, along y and along x [m]."""
    return (
        (row + 0.5) * PITCH - SENSOR.sensor_height / 2,
        (column + 0.5) * PITCH - SENSOR.sensor_width / 2,
    )


@cache
def own_transfers(field: FieldBlur) -> dict[tuple[int, int], np.ndarray]:
    """Transfer (fy, fx) of every pixel's own wavefront, at all wavelengths together."""
    perfect = {w: PERFECT.otf(np.hypot(FX, FY[:, None]), w) for w in WAVELENGTHS}
    found = {}
    for pixel in np.ndindex(PICTURE.shape):
        y, x = offsets(*pixel)
        terms = field.wavefront(np.hypot(x, y) / field.half_diagonal)
        own = DirectedBlur(field.lens, terms, angle=np.arctan2(y, x))
        total = sum(own.otf_plane(FX, FY, w) * perfect[w] for w in WAVELENGTHS)
        found[pixel] = total / len(WAVELENGTHS)
    return found


def by_own_wavefronts(field: FieldBlur, copies=((0.0, 0.0),)) -> np.ndarray:
    """Pixels (rows, columns) of the mirrored picture: a Fourier series for each of them.

    Their light is the mean over `copies` of the image, displaced along x and y [m].
    """
    twice = np.concatenate([PICTURE, PICTURE[::-1]])
    twice = np.concatenate([twice, twice[:, ::-1]], axis=1)
    coefficients = np.fft.fft2(twice) / twice.size
    k = np.arange(-HIGHEST, HIGHEST + 1)
    series = coefficients[np.ix_(k % twice.shape[0], k % twice.shape[1])]
    series = series * np.outer(np.sinc(FY * PITCH), np.sinc(FX * PITCH))  # samples are squares
    series = series * np.outer(aperture(SENSOR).along_y(FY), aperture(SENSOR).along_x(FX))
    moved = [np.exp(-2j * np.pi * (FX * dx + FY[:, None] * dy)) for dx, dy in copies]
    series = series * np.mean(moved, axis=0)
    found = np.zeros(PICTURE.shape)
    for (row, column), total in own_transfers(field).items():
        # the samples' first center lies half a pitch from the edge
        along_y, along_x = (
            np.exp(2j * np.pi * f * n * PITCH) for f, n in ((FY, row), (FX, column))
        )
        found[row, column] = (along_y @ (series * total) @ along_x).real
    return found


PLACES = {"even": GROWING, "uneven": WITHOUT_SYMMETRY, "steep": STEEP}
PRESETS = {"draft": (DRAFT, 0.02), "standard": (STANDARD, 0.005), "reference": (REFERENCE, 0.0005)}


@pytest.mark.parametrize(
    ("preset", "places"),
    long_except(
        [("standard", "even"), ("standard", "steep")],
        itertools.product(PRESETS, PLACES),
        several=True,
    ),
)
def test_every_pixel_has_its_own_wavefront(preset, places):
    field = FieldBlur(LENS, PLACES[places], HALF_DIAGONAL)
    expected = by_own_wavefronts(field)
    knobs, tolerance = PRESETS[preset]
    found = through(field, knobs=replace(knobs, tolerance=tolerance))
    assert rms(found, expected) <= tolerance, rms(found, expected) / tolerance
    assert rms(expected, PICTURE) > 0.05


def through(*blurs, knobs) -> np.ndarray:
    """The picture through the lens and some blurs."""
    effects = PERFECT, *blurs, aperture(SENSOR)
    transfer = light(*effects, wavelengths=WAVELENGTHS)
    optical_path = path(SENSOR, *effects, transfer=transfer, knobs=knobs)
    return signal(optical_path, of_picture(PICTURE, PITCH))


COPIES = 1.6e-6, 1.1e-6
FAR = 300e-6


@pytest.mark.parametrize(
    ("filter_kind", "plates", "copies"),
    [
        pytest.param(
            *(ObliqueLowPass, (COPIES,), ((0.8e-6, 0.55e-6), (-0.8e-6, -0.55e-6))),
            id="oblique",
            marks=pytest.mark.long,
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
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_filter_that_doubles_the_image_acts_beside_a_field(filter_kind, plates, copies):
    """Displaced copies of what every pixel's own wavefront makes."""
    field = FieldBlur(LENS, GROWING, HALF_DIAGONAL)
    expected = by_own_wavefronts(field, copies)
    found = through(field, filter_kind(plates), knobs=replace(REFERENCE, tolerance=0.0005))
    assert rms(found, expected) <= 0.0005
    assert rms(expected, by_own_wavefronts(field)) > 0.01


def test_what_too_few_places_err_by_is_stated(monkeypatch):
    """Defocus grows by half a wave to the corner: three places do not follow it, nine do."""
    sets = ["array.rows=24", "array.columns=32", "quality=[]", "accuracy=draft"]
    sets += ["optics.zernike=[{field: 0, 4: 0 um}, {field: 1, 4: 0.3 um}]"]
    sets += ["effects={aberration: on}", "scene.source={kind: chart, chart: slanted-edge}"]

    # not those that are remembered of as many places
    monkeypatch.setattr(FieldBlur, "rings", FieldBlur.rings.__wrapped__)

    def frame(most):
        monkeypatch.setattr(field_blur, "MAX_PLACES", most)
        return simulate(load("starter", sets), workers=1, shared=Shared()).frame

    few, enough = frame(3), frame(33)
    error = rms(few.rate - enough.rate)
    assert 0 < error < few.spectrum.lost_rms
    assert enough.spectrum.lost_rms < 0.1 * few.spectrum.lost_rms
