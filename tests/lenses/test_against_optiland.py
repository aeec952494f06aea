"""Rays through the shipped lenses against optiland, where it is installed."""

import math

import numpy as np
import pytest

from tests.lenses.oracle import LENSES
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.files import shipped_lens

DISTANCE = 20e-3
"""From the plane through the first vertex back to where rays start there [m]."""


@pytest.fixture(scope="module")
def optiland():
    """Import it without its warnings, which are its own."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("optiland.optic", reason="optiland is not installed")
        from optiland.materials import IdealMaterial
        from optiland.optic import Optic
        from optiland.rays import RealRays
    return Optic, IdealMaterial, RealRays


def built(optiland, lens, wavelength):
    """The same surfaces in optiland, with the indices of one wavelength."""
    optic_class, material, _ = optiland
    indices = lens.indices(np.array([wavelength]))[:, 0]
    found = optic_class()
    found.add_surface(index=0, thickness=np.inf)
    for number, (surface, index) in enumerate(zip(lens.surfaces, indices[1:], strict=True), 1):
        radius = 1e3 / surface.curvature if surface.curvature else np.inf
        found.add_surface(
            index=number,
            radius=radius,
            conic=surface.conic,
            thickness=surface.thickness * 1e3,
            material=material(n=float(index)),
            is_stop=number == lens.stop + 1,
        )
    found.add_surface(index=len(lens.surfaces) + 1)
    found.set_aperture("EPD", lens.pupil_diameter * 1e3)
    found.set_field_type("angle")
    found.add_field(y=0)
    found.add_wavelength(wavelength * 1e6, is_primary=True)
    return found


@pytest.mark.parametrize("name", LENSES)
def test_rays_land_where_optilands_do(optiland, name):
    view = View(shipped_lens(name))
    assert not any(surface.asphere for surface in view.lens.surfaces)
    px = np.array([0.0, 0.6, -0.6, 0.9, -0.9, 0.0, 0.0, 0.5])
    py = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.7, 0.9, 0.5])
    points, paths = [], []
    for wavelength in (486.1e-9, 587.6e-9, 656.3e-9):
        other = built(optiland, view.lens, wavelength)
        for part in (0.0, 0.7, 1.0):
            angle, waves = part * view.lens.field, np.array([wavelength])
            u, v = view.aim(np.array([angle]), waves, px, py)
            ours = view.trace(np.array([angle]), waves, u, v).rays
            sine, cosine = math.sin(angle), math.cos(angle)
            u, v, ones = u[0, 0], v[0, 0], np.ones(len(px))
            start = (u * cosine - DISTANCE * sine, v, -u * sine - DISTANCE * cosine)
            theirs = optiland[2](
                *(side * 1e3 for side in start),
                *(sine * ones, 0 * ones, cosine * ones, ones, wavelength * 1e6 * ones),
            )
            other.surface_group.trace(theirs)
            good = np.isfinite(np.asarray(theirs.x)) & ours.alive[0, 0]
            assert good.sum() >= len(px) - 1  # it loses rays of the sonnar at full field
            for mine, its in ((ours.x, theirs.x), (ours.y, theirs.y)):
                points.append(np.abs(mine[0, 0] * 1e3 - np.asarray(its))[good].max())
            path = ours.path[0, 0] * 1e3 + DISTANCE * 1e3 - np.asarray(theirs.opd)
            paths.append(np.abs(path - path[0])[good].max() / (wavelength * 1e3))
    assert max(points) < 1e-9  # [mm]
    assert max(paths) < 1e-6  # [waves], of paths of some hundred millimeters in 64 bits
