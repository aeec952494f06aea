"""Rays, pupils and wavefronts against a tracer that shares no code, and against closed forms."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from making import long_except

from tests.lenses.oracle import FIRST_ORDER, LENSES, ORACLE
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.files import shipped_lens
from vcam_cli.lenses.glasses import AIR, ModelGlass
from vcam_cli.lenses.paraxial import paraxial
from vcam_cli.lenses.prescription import Prescription, Surface
from vcam_cli.lenses.pupils import pupils
from vcam_cli.lenses.wavefronts import NoImage, trace_field
from vcam_cli.physics import zernike


@cache
def view(name: str) -> View:
    return View(shipped_lens(name))


@cache
def disk():
    """Gauss points of the pupil, and the polynomials of Noll times their weights."""
    node, weight = np.polynomial.legendre.leggauss(32)
    angle = 2 * np.pi * np.arange(64) / 64
    rho, theta = (a.ravel() for a in np.meshgrid(np.sqrt((node + 1) / 2), angle, indexing="ij"))
    share = np.repeat(weight / 2 / 64, 64)
    polynomials = np.array([share * zernike.polynomial(j, rho, theta) for j in range(1, 38)])
    return rho * np.cos(theta), rho * np.sin(theta), polynomials


FEW_LENSES = pytest.mark.parametrize("name", long_except(["cooke-triplet", "sonnar"], LENSES))


@pytest.mark.parametrize("name", LENSES)
def test_first_order_data(name):
    for micrometers, expected in ORACLE[name]["paraxial"].items():
        found = paraxial(view(name).lens, float(micrometers) * 1e-6)
        for key, attribute in FIRST_ORDER.items():
            value = getattr(found, attribute) * 1e3
            assert value == pytest.approx(expected[key], rel=1e-12, abs=1e-10), (key, micrometers)
    # printed with 15 digits
    assert view(name).image_scale * 1e3 == pytest.approx(ORACLE[name]["scale"], rel=1e-12)


@FEW_LENSES
def test_chief_rays_land_where_the_oracles_do(name):
    for degrees, heights in ORACLE[name]["heights"]:
        angle, waves = math.radians(degrees), [float(w) * 1e-6 for w in heights]
        found = view(name).heights(np.array([angle]), np.array(waves))[0] * 1e3
        assert found == pytest.approx(list(heights.values()), abs=1e-9)
        back = view(name).angle_of(found[[2]] * 1e-3)  # the third wavelength is the primary one
        assert back[0] == pytest.approx(angle, rel=1e-10)


@FEW_LENSES
def test_launched_rays_land_and_are_aimed_as_the_oracles(name):
    for field, wave, px, py, u, v, x, y, l, m, opd in ORACLE[name]["rays"]:  # noqa: E741
        angle = np.array([math.radians(field * ORACLE[name]["field"])])
        waves = np.array([wave * 1e-6])
        place = np.array([[[u * 1e-3]]]), np.array([[[v * 1e-3]]])
        rays = view(name).trace(angle, waves, *place).rays
        assert [rays.x.item() * 1e3, rays.y.item() * 1e3] == pytest.approx([x, y], abs=1e-9)
        assert [rays.l.item(), rays.m.item()] == pytest.approx([l, m], abs=1e-11)
        aimed = view(name).aim(angle, waves, np.array([px]), np.array([py]))
        assert [a.item() * 1e3 for a in aimed] == pytest.approx([u, v], abs=1e-8)
        chief = view(name).chief(angle, waves)
        path = view(name).wavefront(angle, waves, *place, chief).path.item()
        tolerance = 1e-7 if name == "sonnar" else 1e-8
        assert path / waves[0] == pytest.approx(opd, abs=tolerance)


@FEW_LENSES
def test_wavefronts_have_the_oracles_coefficients(name):
    px, py, polynomials = disk()
    for degrees, wave, expected in ORACLE[name]["wavefronts"]:
        angle, waves = np.array([math.radians(degrees)]), np.array([wave * 1e-6])
        place = view(name).aim(angle, waves, px, py)
        found = view(name).wavefront(angle, waves, *place, view(name).chief(angle, waves))
        # the oracle's own 64 bits differ by up to 1.5e-9
        assert polynomials @ found.path[0, 0] / waves[0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("name", [n for n in LENSES if "finite" in ORACLE[n]])
def test_wavefronts_of_near_objects(name):
    near = ORACLE[name]["finite"]
    lens, far = view(name).lens, view(name).paraxial
    distance = near["object_distance_from_first"] * 1e-3
    shift = near["image_from_last"] * 1e-3 - lens.surfaces[-1].thickness
    seen = View(lens.moved(shift), distance)
    assert seen.paraxial.image(distance + far.front_principal) == pytest.approx(
        near["image_from_last"] * 1e-3, rel=1e-12
    )
    px, py, polynomials = disk()
    angle = math.atan2(-near["object_x"] * 1e-3, distance)
    waves = np.array([near["wavelength_um"] * 1e-6])

    def launch(x, y):
        """Where rays to (x, y) of the entrance pupil meet the launching plane."""
        start = np.array([near["object_x"] * 1e-3, 0, -distance])
        along = np.stack([x, y, np.full(x.shape, far.entrance_pupil)]) - start[:, None]
        normal = np.array([math.sin(angle), 0, math.cos(angle)])
        at = start[:, None] - (normal @ start) / (normal @ along) * along
        return at[0] * math.cos(angle) - at[2] * math.sin(angle), at[1]

    radius = lens.pupil_diameter / 2
    u, v = launch(radius * px, radius * py)
    chief = launch(np.zeros(1), np.zeros(1))[0][None]
    found = seen.wavefront(np.array([angle]), waves, u[None, None], v[None, None], chief)
    expected = near["zernike_noll_waves"]
    assert polynomials @ found.path[0, 0] / waves[0] == pytest.approx(expected, abs=1e-8)


@FEW_LENSES
def test_relative_illumination_is_the_pupils_area(name):
    rows = np.array(ORACLE[name]["illumination"])
    waves = np.array([view(name).lens.primary])
    for vignetted, column in ((False, 1), (True, 2)):
        area = pupils(view(name), rows[:, 0] * 1e-3, waves, 1024, vignetted).area[:, 0]
        assert area[0] == pytest.approx(ORACLE[name]["axis_sr"], rel=1e-9)
        # corners of vignetted pupils fall between directions: the oracle errs by up to 2e-5
        tolerance = 4e-6 if vignetted else 1e-9
        assert (np.abs(area / area[0] - rows[:, column]) <= tolerance).all()


def test_places_without_light_are_told():
    waves = np.array([view("double-gauss").lens.primary])
    with pytest.raises(NoImage, match="no light through 40 mm off axis"):
        trace_field(view("double-gauss"), np.array([0, 0.04]), waves[0], waves[0])
    lit, dark = pupils(view("double-gauss"), np.array([0, 0.05]), waves).area[:, 0]
    assert lit > dark == 0


GLASS = ModelGlass("1.5/60", 1.5, 60.0)


def singlet(conic: float, asphere: tuple[float, ...] = ()) -> Prescription:
    """A plano-convex lens of 100 mm, its plane towards the object, f/2."""
    index = float(GLASS.index(np.array(550e-9)))
    surfaces = (
        Surface(0.0, 10e-3, GLASS),
        Surface(-1 / (0.1 * (index - 1)), 0.1, AIR, conic, asphere),
    )
    return Prescription("singlet", surfaces, 0, 50e-3, 550e-9)


def test_a_hyperboloid_has_no_spherical_aberration():
    # A plane wave in glass of index n meets in a point behind a conic of -n^2 (Descartes).
    lens = singlet(-(float(GLASS.index(np.array(550e-9))) ** 2))
    seen, waves = View(lens), np.array([550e-9])
    px = np.linspace(-1, 1, 21)
    u, v = seen.aim(np.zeros(1), waves, px, 0 * px)
    found = seen.wavefront(np.zeros(1), waves, u, v, np.zeros((1, 1)))
    assert np.abs(found.path).max() < 1e-8 * 550e-9
    assert np.abs(found.landing_x).max() < 1e-15


def test_a_conic_written_as_an_asphere_traces_the_same():
    # The paraboloid c r^2 / 2 is a sphere and a series of the difference.
    parabola = singlet(-1.0)
    c = parabola.surfaces[1].curvature
    series = tuple(
        -math.comb(2 * k - 2, k - 1) / k / 2 ** (2 * k - 1) * c ** (2 * k - 1) for k in range(2, 16)
    )
    sphere = singlet(0.0, series)
    px = np.linspace(-0.5, 0.5, 15)
    waves = np.array([550e-9])
    lands = []
    for lens in (parabola, sphere):
        seen = View(lens)
        u, v = seen.aim(np.array([0.1]), waves, px, 0.3 * px)
        rays = seen.trace(np.array([0.1]), waves, u, v).rays
        lands.append(np.array([rays.x, rays.y, rays.l, rays.m]))
    # the series is cut behind r^30, and r c is 0.3
    assert np.abs(lands[0] - lands[1]).max() < 1e-13


def test_scaling_scales_lengths_and_keeps_angles():
    lens = view("topogon").lens
    small = View(lens.scaled(0.1))
    angle, waves = np.array([0.4]), np.array([550e-9])
    whole = view("topogon").heights(angle, waves)
    assert small.heights(angle, waves) == pytest.approx(0.1 * whole, rel=1e-12)
    assert small.paraxial.focal_length == pytest.approx(0.1 * view("topogon").paraxial.focal_length)


def test_rays_that_fail_are_told_apart():
    seen, waves = view("cooke-triplet"), np.array([550e-9])
    u = np.array([[[0.0, 0.2]]])  # a ray 200 mm off the axis misses a lens of 40 mm radius
    rays = seen.trace(np.zeros(1), waves, u, 0 * u).rays
    assert rays.alive.tolist() == [[[True, False]]]
    assert np.isnan(seen.heights(np.array([1.5]), waves)).all()


def test_a_lens_without_power_is_refused():
    flat = replace(view("sonnar").lens, surfaces=(Surface(0.0, 1e-3), Surface(0.0, 1e-3)), stop=0)
    with pytest.raises(ValueError, match="no positive power"):
        paraxial(flat, 550e-9)
