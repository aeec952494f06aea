"""Apertures that are no circles: closed forms of area, OTF and rays."""

import math

import numpy as np
import pytest

from vcam_cli.physics import shaped_pupil
from vcam_cli.physics.opening import CIRCLE, Opening


def annulus(nu: np.ndarray, e: float) -> np.ndarray:
    """OTF of an obscured disk: O'Neill, J. Opt. Soc. Am. 46, 285, 1956."""

    def disk(v: np.ndarray) -> np.ndarray:
        v = np.minimum(v, 1)
        return 2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v**2))

    angle = np.arccos(np.clip((1 + e**2 - 4 * nu**2) / (2 * e), -1, 1))
    slope = (1 + e) / (1 - e) * np.tan(np.minimum(angle, np.pi - 1e-12) / 2)
    both = 2 * e / np.pi * np.sin(angle) + (1 + e**2) / np.pi * angle
    both = both - 2 * (1 - e**2) / np.pi * np.arctan(slope) - 2 * e**2
    both = np.where(nu <= (1 - e) / 2, -2 * e**2, np.where(nu < (1 + e) / 2, both, 0))
    return (disk(nu) + e**2 * disk(nu / e) + both) / (1 - e**2)


@pytest.mark.parametrize("obscuration", [0.2, 0.5])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_otf_of_an_annulus_is_the_closed_form(obscuration, angle):
    pupil = Opening(obscuration=obscuration).mask(384)
    grid = shaped_pupil.grid_of_paths(pupil, np.zeros((pupil.samples,) * 2))
    nu = np.linspace(0, 1, 201)
    found = grid.interpolate(2 * nu * math.cos(angle), 2 * nu * math.sin(angle))
    assert np.abs(found - annulus(nu, obscuration)).max() < 6e-4


@pytest.mark.parametrize("blades", [3, 5, 6, 9])
def test_area_of_blades_is_a_polygons(blades):
    opening = Opening(blades, 0.3)
    assert opening.mask(512).share == pytest.approx(opening.share, rel=2e-4)
    assert Opening(blades, obscuration=0.3).share == pytest.approx(opening.share - 0.09)


def test_spiders_cover_bars_from_the_obscuration_outwards():
    vane, hole = 0.02, 0.3
    found = Opening(obscuration=hole, spiders=3, vane=vane).share
    bar, _ = np.polynomial.legendre.leggauss(40), None
    across = bar[0] * vane
    length = np.sqrt(1 - across**2) - np.sqrt(hole**2 - across**2)
    covered = float((length * bar[1]).sum() * vane)
    assert found == pytest.approx(1 - hole**2 - 3 * covered / math.pi, abs=3e-5)


def test_a_square_of_four_blades_has_triangles_for_its_otf():
    # corners at the right, below, left, above; along a diagonal it is a square of side sqrt(2)
    pupil = Opening(4).mask(512)
    grid = shaped_pupil.grid_of_paths(pupil, np.zeros((pupil.samples,) * 2))
    lag = np.linspace(0, math.sqrt(2), 50)
    diagonal = grid.interpolate(lag / math.sqrt(2), lag / math.sqrt(2))
    assert np.abs(diagonal - (1 - lag / math.sqrt(2))).max() < 1e-3
    along = grid.interpolate(lag, 0 * lag)
    assert np.abs(along - np.square(1 - lag / 2)).max() < 1e-3


def test_many_blades_are_a_circle():
    assert Opening(64).share == pytest.approx(CIRCLE.share, abs=2e-3)


def test_the_loss_at_small_lags_is_bounded():
    for opening in (Opening(5), Opening(obscuration=0.5), Opening(6, 0.1, 0.3, 4, 0.02)):
        pupil = opening.mask(384)
        grid = shaped_pupil.grid_of_paths(pupil, np.zeros((pupil.samples,) * 2))
        for angle in np.linspace(0, np.pi, 13):
            lag = np.geomspace(0.02, 0.5, 8)
            found = grid.interpolate(lag * np.cos(angle), lag * np.sin(angle)).real
            assert (1 - found <= 1.002 * opening.edge / opening.share * lag).all()
