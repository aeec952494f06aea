"""Warps against sums that share no code with the engine: every pixel by points and instants.

Lenses are distorted by formulas that are written out here and inverted by fixed points. Where the
lens diffracts, a wave is seen with the contrast that the closed form leaves of its frequency in
each place; the photodetector is a mean over points.
"""

import math

import numpy as np
import pytest
from making import camera, long_except
from moving_waves import (
    ANGLE,
    COLUMNS,
    FREQUENCY,
    IMAGE,
    PITCH,
    ROWS,
    SCALE,
    SIDE,
    STILL,
    TIME,
    WAVE,
    delays,
    exposure,
    places,
    wave_and_levels,
)

from vcam_cli import simulate

K1, P1 = -25.0, 0.2
"""The array's corner is 0.04 image distances from the axis: 4 % of distortion there, 1.7 pixels."""
LENS = {"optics.distortion": {"k1": K1, "p1": P1}}
CUTOFF = 1 / (550e-9 * 16 / (1 - 5e-3))
"""Of the plain camera's lens, stopped down to f/16 at 1 m [cycles/m]."""
WAVE_VECTOR = FREQUENCY * np.exp(-1j * ANGLE)
STANDARD, REFERENCE = 5e-4, 2e-4
"""Measured 1e-4 to 3e-4 at the tolerance 5e-3, and 4e-5 at 2e-4."""
RAYS = {"optics.diffraction": False, "accuracy": "standard"}


def result(folder, *changes: dict):
    merged = dict(STILL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged))


def distorted(z: np.ndarray) -> np.ndarray:
    """Where a place x + i y [m] of the ideal image lies: OpenCV's k1 and p1."""
    x, y = z.real / IMAGE, z.imag / IMAGE
    r2 = x * x + y * y
    factor = 1 + K1 * r2
    return IMAGE * (x * factor + 2 * P1 * x * y + 1j * (y * factor + P1 * (r2 + 2 * y * y)))


def undistorted(z: np.ndarray) -> np.ndarray:
    found = z.astype(complex)
    for _ in range(14):  # each leaves an eighth: 1e-13
        found = found - (distorted(found) - z)
    return found


def otf(frequency: np.ndarray) -> np.ndarray:
    nu = np.minimum(frequency / CUTOFF, 1)
    return 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu * nu))


def wave(still: np.ndarray, place, times, lens=np.ones_like) -> np.ndarray:
    """The mean of a wave over the photodetectors and over instants, ((time, weight), ...)."""
    level, amplitude = wave_and_levels(still)
    amplitude /= lens(np.array(FREQUENCY))
    nodes, weights = np.polynomial.legendre.leggauss(5)
    total = np.zeros((ROWS, COLUMNS))
    step = 1e-8
    for time, share in times:

        def phase(z, time=time):
            at = place(z, time)
            return 2 * np.pi * (np.conj(WAVE_VECTOR) * at).real + math.radians(25)

        z = places()
        slopes = [(phase(z + d) - phase(z - d)) / (4 * np.pi * step) for d in (step, 1j * step)]
        passed = lens(np.hypot(*slopes))
        for u, wu in zip(nodes, weights, strict=True):
            for v, wv in zip(nodes, weights, strict=True):
                at = phase(z + SIDE / 2 * (u + 1j * v))
                total += share * wu * wv / 4 * passed * np.cos(at)
    return level + amplitude * total


def instants(direction: str | None, count: int = 12):
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return [
        (delays(direction) + TIME * node / 2, weight / 2)
        for node, weight in zip(nodes, weights, strict=True)
    ]


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


@pytest.fixture(scope="module")
def still(tmp_path_factory) -> np.ndarray:
    folder = tmp_path_factory.mktemp("still")
    return result(folder, {"scene.source": WAVE}, RAYS).mean_electrons


@pytest.mark.parametrize(("accuracy", "allowed"), [("standard", STANDARD), (2e-4, REFERENCE)])
def test_distortion_alone(accuracy, allowed, still, tmp_path):
    changes = {"scene.source": WAVE}, RAYS, LENS, {"accuracy": accuracy}
    seen = result(tmp_path, *changes).mean_electrons
    truth = wave(still, lambda z, t: undistorted(z), [(0.0, 1.0)])
    assert rms(seen - truth) < allowed * truth.max()
    assert rms(seen - still) > 0.05 * truth.max()


def test_the_lens_blurs_the_distorted_image(tmp_path):
    """What is compressed has higher frequencies, of which the lens leaves less."""
    sharp = {"scene.source": WAVE, "accuracy": "standard", "optics.f_number": 16}
    still = result(tmp_path, sharp).mean_electrons
    seen = result(tmp_path, sharp, LENS).mean_electrons
    truth = wave(still, lambda z, t: undistorted(z), [(0.0, 1.0)], otf)
    # The contrast of one frequency in each place errs, too: a blur is wider than a place.
    assert rms(seen - truth) < 2 * STANDARD * truth.max()
    unblurred = wave(still, lambda z, t: undistorted(z), [(0.0, 1.0)])
    assert rms(unblurred - truth) > 4 * STANDARD * truth.max()


@pytest.mark.parametrize("direction", long_except([None], [None, "down", "right"]))
def test_motion_through_a_lens_that_distorts(direction, still, tmp_path):
    """The lens distorts the image of the scene as it is when a pixel looks."""
    motion = {"motion": {"x": "0.6 m/s", "y": "-0.3 m/s"}}
    shift = (0.6 - 0.3j) * SCALE
    assert abs(shift) * TIME > 5 * PITCH
    seen = result(tmp_path, {"scene.source": WAVE | motion}, exposure(direction), RAYS, LENS)
    truth = wave(still, lambda z, t: undistorted(z) - shift * t, instants(direction))
    assert rms(seen.mean_electrons - truth) < STANDARD * truth.max()
    # In the other order, of a distorted image that moves, it is another picture.
    other = wave(still, lambda z, t: undistorted(z - shift * t), instants(direction, 4))
    assert rms(other - truth) > 2 * STANDARD * truth.max()


def test_a_turn_through_a_lens_that_distorts(still, tmp_path):
    spin = math.radians(4) / TIME
    motion = {"motion": {"rotate": f"{math.degrees(spin)!r} deg/s"}}
    seen = result(tmp_path, {"scene.source": WAVE | motion}, exposure("down"), RAYS, LENS)
    truth = wave(still, lambda z, t: undistorted(z) * np.exp(-1j * spin * t), instants("down"))
    assert rms(seen.mean_electrons - truth) < STANDARD * truth.max()


def test_motion_long_before_the_exposure_warps_as_well(still, tmp_path):
    """The exposure begins late: by then the scene has moved by 21 pixels."""
    motion = {"motion": {"x": "0.2 m/s"}}
    late = {"time": "10 ms", "start": "100 ms", "reference": "0 s"}
    seen = result(tmp_path, {"scene.source": WAVE | motion, "exposure": late}, RAYS, LENS)
    times = [(0.105 + t, w) for t, w in instants(None)]
    truth = wave(still, lambda z, t: undistorted(z) - 0.2 * SCALE * t, times)
    assert rms(seen.mean_electrons - truth) < STANDARD * truth.max()
