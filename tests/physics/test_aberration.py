"""Aberrated transfer functions against brute force, closed forms, limits and symmetries.

Brute force is the mean over the overlap of two shifted pupils at one frequency, with polynomials
as Noll printed them, or SciPy's adaptive quadrature: neither shares a line with what is tested.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, special

from vcam_cli.physics import aberration, ray_blur, zernike
from vcam_cli.physics.diffraction import cutoff_frequency, otf_circular

LAMBDA, N = 550e-9, 2.8
CUTOFF = float(cutoff_frequency(LAMBDA, N))


def polar(fraction, angle):
    """fx, fy at a fraction of the cut-off."""
    return fraction * CUTOFF * np.cos(angle), fraction * CUTOFF * np.sin(angle)


def of(terms, fraction, angle=0.0):
    return aberration.otf_ratio(*polar(fraction, angle), LAMBDA, N, terms)


def symmetric(terms, fraction):
    return aberration.otf_ratio_symmetric(np.asarray(fraction) * CUTOFF, LAMBDA, N, terms)


def test_several_wavelengths_at_once_are_each_alone():
    """Longer wavelengths have shorter series: all are summed in one."""
    f = np.linspace(0, 1.1 * CUTOFF, 60).reshape(12, 5)
    several = np.array([0.4, 0.55, 0.7, 1.0]) * 1e-6
    for terms in ({4: 1.5e-6}, {4: 0.3e-6, 11: 0.2e-6}, {}):
        terms = tuple(terms.items())
        found = aberration.otf_ratio_symmetric(f, several, N, terms)
        alone = [aberration.otf_ratio_symmetric(f, float(w), N, terms) for w in several]
        np.testing.assert_allclose(found, alone, rtol=0, atol=1e-14)


def overlap(path, fraction, angle, points=101):
    """Mean of exp(2 pi i (W(u - s/2) - W(u + s/2)) / wavelength) over the overlap of two disks.

    path: W(x, y) [m]. By Gauss's rule in coordinates along and across the shift, between the arcs
    that bound the overlap: many points for a few waves, and one frequency after the other.
    """
    node, share = np.polynomial.legendre.leggauss(points)
    a = (node + 1) / 2
    top = math.acos(fraction) * a  # along the upper half of an arc
    along, high = np.cos(top) - fraction, np.sin(top)
    across = (2 * a - 1)[:, None] * high
    weight = np.outer(share, share * high**2)
    c, s = math.cos(angle), math.sin(angle)
    total = 0
    for side in (1, -1):
        x, y = c * side * along - s * across, s * side * along + c * across
        dx, dy = c * fraction, s * fraction
        turns = (path(x - dx, y - dy) - path(x + dx, y + dy)) / LAMBDA
        total += (np.exp(2j * np.pi * turns) * weight).sum()
    return total / (2 * weight.sum())


COMA = {8: lambda x, y: math.sqrt(8) * (3 * (x**2 + y**2) - 2) * x}
ASTIGMATISM = {6: lambda x, y: math.sqrt(6) * (x**2 - y**2)}
TREFOIL = {9: lambda x, y: math.sqrt(8) * (3 * x**2 * y - y**3)}
SPHERICAL = {11: lambda x, y: math.sqrt(5) * (6 * (x**2 + y**2) ** 2 - 6 * (x**2 + y**2) + 1)}
DEFOCUS = {4: lambda x, y: math.sqrt(3) * (2 * (x**2 + y**2) - 1)}
FORMS = COMA | ASTIGMATISM | TREFOIL | SPHERICAL | DEFOCUS
"""The Zernike polynomials in Cartesian coordinates, as Noll's table has them."""


def path_of(terms):
    return lambda x, y: sum(c * FORMS[i](x, y) for i, c in terms)


# --- symmetric -----------------------------------------------------------------------------------


@pytest.mark.parametrize("waves", [0.25, 1.0, 3.0])
@pytest.mark.parametrize("fraction", [0.02, 0.1, 0.35, 0.7, 0.98])
def test_defocus_against_adaptive_quadrature(waves, fraction):
    """One integral over the overlap: across the shift the phase of a parabola does not change.

    W = w rho^2: dW = -4 w h x at the shift 2 h, the height of the overlap 2 sqrt(1 - (x + h)^2);
    Hopkins 1955, eq 8.
    """
    k = 2 * math.pi * 4 * waves * fraction

    def height(x):
        return math.sqrt(max(0.0, 1 - (x + fraction) ** 2))

    area, _ = integrate.quad(height, 0, 1 - fraction, limit=200)
    value, _ = integrate.quad(lambda x: math.cos(k * x) * height(x), 0, 1 - fraction, limit=200)
    terms = zernike.defocus(8 * N**2 * waves * LAMBDA, N)
    # quad's own error at the square root of the end is 1e-9
    assert symmetric(terms, fraction) == pytest.approx(value / area, abs=1e-8)


@pytest.mark.parametrize("waves", [0.25, 2.0])
@pytest.mark.parametrize("fraction", [0.05, 0.3, 0.8])
def test_defocus_against_the_series_of_hopkins(waves, fraction):
    """Hopkins 1955, eq 13: a series of Bessel functions for the defocused response."""
    a = 8 * math.pi * waves * fraction
    beta = math.acos(fraction)
    n = np.arange(1, 60)
    sines = np.sin(2 * n * beta) / (2 * n)
    even = (-1) ** (n + 1) * sines * (special.jv(2 * n - 1, a) - special.jv(2 * n + 1, a))
    odd_n = np.arange(0, 60)
    odd = (-1) ** odd_n * np.sin((2 * odd_n + 1) * beta) / (2 * odd_n + 1)
    odd = odd * (special.jv(2 * odd_n, a) - special.jv(2 * odd_n + 2, a))
    b = a * fraction
    first = 4 / (math.pi * a) * math.cos(b) * (beta * special.j1(a) + even.sum())
    response = first - 4 / (math.pi * a) * math.sin(b) * odd.sum()
    terms = zernike.defocus(8 * N**2 * waves * LAMBDA, N)
    found = symmetric(terms, fraction) * otf_circular(fraction * CUTOFF, LAMBDA, N)
    assert found == pytest.approx(response, abs=1e-9)


@pytest.mark.parametrize("terms", [((11, 0.3),), ((4, -0.4), (11, 0.2)), ((4, 5.0), (11, 1.5))])
def test_symmetric_against_brute_force(terms):
    terms = tuple((i, c * LAMBDA) for i, c in terms)
    for fraction in (1e-3, 0.04, 0.3, 0.62, 0.93):
        expected = overlap(path_of(terms), fraction, 0.0)
        assert symmetric(terms, fraction) == pytest.approx(expected.real, abs=1e-9)
        assert abs(expected.imag) < 1e-12


def test_twenty_waves_of_spherical_aberration():
    """Peak to valley, 7.45 in Noll's normalization: 80 waves of slope."""
    terms = ((11, 20 / (1.5 * math.sqrt(5)) * LAMBDA),)
    path = path_of(terms)
    for fraction in (0.004, 0.03, 0.5):
        fine = overlap(path, fraction, 0.0, 401)
        assert symmetric(terms, fraction) == pytest.approx(fine.real, abs=1e-9)


# --- any wavefront -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "terms",
    [
        ((8, 0.1),),
        ((6, 0.1),),
        ((8, 0.3), (6, 0.2), (11, -0.1)),
        ((8, 1.0),),
        ((6, 1.0),),
        ((9, 1.0),),
    ],
    ids=str,
)
def test_directed_against_brute_force(terms):
    """Times the transfer of diffraction, 1e-4 up to 1 wave rms; near 0 and the cut-off as well."""
    terms = tuple((i, c * LAMBDA) for i, c in terms)
    path = path_of(terms)
    rng = np.random.default_rng(3)
    for fraction in (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.97, 0.995, 0.9999):
        angle = rng.uniform(-np.pi, np.pi)
        perfect = otf_circular(fraction * CUTOFF, LAMBDA, N)
        error = of(terms, fraction, angle) - overlap(path, fraction, angle)
        assert abs(error) * perfect < 1e-4, fraction


def test_twenty_waves_of_coma():
    """Peak to valley, 3.5 in Noll's normalization: 70 waves of slope."""
    terms = ((8, 20 / (2 * math.sqrt(8)) * LAMBDA),)
    path = path_of(terms)
    for fraction, angle in ((0.002, 1.0), (0.01, -2.0), (0.1, 0.3), (0.5, 2.9)):
        perfect = otf_circular(fraction * CUTOFF, LAMBDA, N)
        error = of(terms, fraction, angle) - overlap(path, fraction, angle, 301)
        # the module states 1e-3 for what is steep
        assert abs(error) * perfect < 5e-4, fraction


@pytest.mark.parametrize("terms", [(), ((1, 3e-6),), ((4, 0.0), (8, 0.0))])
def test_a_perfect_lens_is_exactly_one(terms):
    f = np.linspace(0, 0.999, 50) * CUTOFF
    assert np.array_equal(aberration.otf_ratio_symmetric(f, LAMBDA, N, terms), np.ones(50))
    assert np.array_equal(aberration.otf_ratio(f / 2, -f / 2, LAMBDA, N, terms), np.ones(50))


def test_tiny_wavefronts_are_nearly_perfect():
    """The grid of a pupil divides by itself: what is left is the square of the phase."""
    f = np.linspace(-0.7, 0.7, 41) * CUTOFF
    found = aberration.otf_ratio(f, f[:, None], LAMBDA, N, ((8, 1e-9 * LAMBDA),))
    inside = np.hypot(f, f[:, None]) < CUTOFF
    # 32-bit transforms: 1e-7 of the largest, over an overlap of at least 1/100
    np.testing.assert_allclose(found[inside], 1, atol=1e-4)


def test_tilt_moves_the_image():
    """2 rho cos(theta) has the slope 2: 4 N_w c to the right, exp(-2 pi i f.t) in the transform."""
    c = 0.7e-6
    fx, fy = polar(np.array([0.0, 0.2, 0.5, 0.9]), 0.4)
    moved = aberration.otf_ratio(fx, fy, LAMBDA, N, ((2, c),))
    np.testing.assert_allclose(moved, np.exp(-2j * np.pi * fx * 4 * N * c), atol=1e-12)
    moved = aberration.otf_ratio(fx, fy, LAMBDA, N, ((3, c),))
    np.testing.assert_allclose(moved, np.exp(-2j * np.pi * fy * 4 * N * c), atol=1e-12)
    # and with coma it is a factor: of what the grid gives, exactly
    both = aberration.otf_ratio(fx, fy, LAMBDA, N, ((2, c), (8, 1e-7)))
    coma = aberration.otf_ratio(fx, fy, LAMBDA, N, ((8, 1e-7),))
    np.testing.assert_allclose(both, coma * np.exp(-2j * np.pi * fx * 4 * N * c), atol=1e-12)


@pytest.mark.parametrize("rest", [(), ((4, 3e-7),), ((8, 1e-7),)])
def test_tilt_moves_what_rays_bring(rest):
    """By the slope of each direction, of a round blur and of one with a direction."""
    fx, fy = np.array([0.0, 0.1, 0.2]) * CUTOFF, np.array([-0.15, 0.05]) * CUTOFF
    right, down = 3e-7, -5e-7
    still = ray_blur.otf(fx, fy, N, rest)
    moved = ray_blur.otf(fx, fy, N, ((2, right), (3, down), *rest))
    waves = fx * 4 * N * right + fy[:, None] * 4 * N * down
    np.testing.assert_allclose(moved, still * np.exp(-2j * np.pi * waves), atol=1e-12)


def test_coma_throws_its_tail_the_way_its_outer_rays_go():
    """The center of gravity of the light is that of the rays, to the right for a positive Z_8."""
    c, f = 0.05 * LAMBDA, 1e-4 * CUTOFF
    right, down = zernike.gradient(((8, c),), *_disk())
    phase = np.angle(aberration.otf_ratio(f, 0.0, LAMBDA, N, ((8, c),)))
    # the first moment of the spread is that of the rays (Ehrenfest); the disk is counted to 1e-3
    assert phase == pytest.approx(-2 * math.pi * f * 2 * N * right.mean(), rel=2e-2)
    assert abs(down.mean()) < 1e-3 * right.mean()


def _disk(points=700):
    side = (np.arange(points) + 0.5) / points * 2 - 1
    x, y = np.meshgrid(side, side)
    inside = x**2 + y**2 < 1
    return x[inside], y[inside]


def test_independent_grids_agree():
    """Symmetric wavefronts by the grid, beside a coma too small to see, and by Gauss's sums."""
    terms = ((4, 0.3 * LAMBDA), (11, 0.1 * LAMBDA))
    f = np.linspace(0.01, 0.95, 40)
    grid = of((*terms, (8, 1e-12 * LAMBDA)), f, 0.7)
    perfect = otf_circular(f * CUTOFF, LAMBDA, N)
    np.testing.assert_allclose(grid * perfect, symmetric(terms, f) * perfect, atol=5e-5)


small = st.lists(st.tuples(st.integers(2, 15), st.floats(-3e-7, 3e-7)), min_size=1, max_size=4).map(
    tuple
)


@settings(max_examples=8, deadline=None)
@given(small, st.lists(st.tuples(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2)), min_size=1))
def test_at_most_one_hermitian_and_zero_beyond(terms, fractions):
    fx, fy = np.array(fractions).T * CUTOFF
    there = aberration.otf_ratio(fx, fy, LAMBDA, N, terms)
    opposite = aberration.otf_ratio(-fx, -fy, LAMBDA, N, terms)
    assert np.array_equal(there, opposite.conj())
    assert np.all(np.abs(there) <= 1 + 1e-12)
    assert not there[np.hypot(fx, fy) >= CUTOFF * (1 + 1e-9)].any()
    assert aberration.otf_ratio(0.0, 0.0, LAMBDA, N, terms) == 1


@settings(max_examples=10, deadline=None)
@given(small, st.floats(-4, 4), st.floats(0.02, 0.9), st.floats(-3, 3))
def test_a_turned_wavefront_turns_the_transfer(terms, turn, fraction, angle):
    turned = zernike.rotate(terms, turn)
    perfect = otf_circular(fraction * CUTOFF, LAMBDA, N)
    difference = of(terms, fraction, angle) - of(turned, fraction, angle + turn)
    assert abs(difference) * perfect < 1e-4  # two grids, each good to half of it


@pytest.mark.parametrize("terms", [((4, 0.03),), ((8, 0.04),), ((5, 0.03), (7, 0.02), (11, 0.03))])
def test_volume_is_the_strehl_ratio(terms):
    """The peak of the spread, over the perfect one: exp(-(2 pi rms)^2) for small aberrations.

    rms of 0.03 to 0.05 waves: the fourth order is (2 pi 0.05)^4 / 8, 1e-3. The peak is meant where
    the image point is; balanced coma has it there.
    """
    terms = tuple((i, c * LAMBDA) for i, c in terms)
    node, weight = np.polynomial.legendre.leggauss(24)
    fraction, angle = (node + 1) / 2, 2 * np.pi * np.arange(24) / 24
    ratio = of(terms, fraction, angle[:, None]).real.mean(axis=0)
    volume = weight * fraction * otf_circular(fraction * CUTOFF, LAMBDA, N)
    assert volume @ ratio / volume.sum() == pytest.approx(zernike.strehl(terms, LAMBDA), abs=2e-3)


def test_scales_with_wavelength_and_cone():
    """Only W / wavelength and the fraction of the cut-off count."""
    here = aberration.otf_ratio(0.3 * CUTOFF, 0.1 * CUTOFF, LAMBDA, N, ((8, 1e-7),))
    there = aberration.otf_ratio(0.075 * CUTOFF, 0.025 * CUTOFF, 2 * LAMBDA, 2 * N, ((8, 2e-7),))
    assert there == pytest.approx(here, abs=1e-6)  # 32-bit transforms


def test_too_steep_is_refused():
    assert aberration.slope_in_waves(((2, 1.0), (8, 1e-6)), 1e-6) == pytest.approx(7 * 8**0.5)
    for call in (aberration.otf_ratio_symmetric, lambda f, *a: aberration.otf_ratio(f, f, *a)):
        with pytest.raises(ValueError, match="waves per pupil radius"):
            call(np.zeros(1), LAMBDA, N, ((4, 1e-3),))


# --- rays ----------------------------------------------------------------------------------------


def test_rays_of_defocus_fill_a_disk():
    """The transform of a uniform disk, summed over points of it; and 2 J1(z) / z."""
    shift = 60e-6
    terms = zernike.defocus(shift, N)
    x, _ = _disk()
    for f in (1e3, 3e4, 7e4):
        counted = np.cos(2 * np.pi * f * shift / (2 * N) * x).mean()
        # 700 points across see the disk's area to 1e-3
        assert ray_blur.otf_symmetric(f, N, terms) == pytest.approx(counted, abs=1e-3)
        v = np.pi * f * shift / N
        closed = 2 * special.j1(v) / v
        assert ray_blur.otf_symmetric(-f, N, terms) == pytest.approx(closed, rel=1e-9)
    assert ray_blur.blur_radius(terms, N) == pytest.approx(shift / (2 * N), rel=1e-9)


@pytest.mark.parametrize(
    "terms",
    [
        pytest.param(((11, 1e-6),), marks=pytest.mark.long),
        ((8, 1e-6), (5, 3e-7), (2, 4e-7)),
        pytest.param(((9, 2e-6),), marks=pytest.mark.long),
    ],
)
def test_rays_against_points_of_the_pupil(terms):
    x, y = _disk(700)
    right, down = (2 * N * slope for slope in zernike.gradient(terms, x, y))
    fx, fy = np.array([-6e4, 0.0, 1e3, 4e4]), np.array([0.0, -2e3, 5e4])
    found = ray_blur.otf(fx, fy, N, terms)
    for i, j in np.ndindex(3, 4):
        counted = np.exp(-2j * np.pi * (fx[j] * right + fy[i] * down)).mean()
        # the edge of the disk is counted to 1e-3, where the outermost rays are
        assert found[i, j] == pytest.approx(counted, abs=1e-3)
    assert found[0, 1] == 1


def test_rays_far_out_are_finite():
    f = np.array([0.0, 1e-300, 1e6, 1e300])
    for terms in (((4, 1e-6),), ((11, 1e-6),), ((4, 1e-6), (11, 1e-7))):
        assert np.isfinite(ray_blur.otf_symmetric(f, N, terms)).all()
    assert np.isfinite(ray_blur.otf(f, f, N, ((8, 1e-6),))).all()
    assert np.array_equal(ray_blur.otf_symmetric(f, N, ()), np.ones(4))


def test_waves_approach_rays_when_far_out_of_focus():
    """Where the blur is 100 times the Airy disk, up to where contrast has reversed twice."""
    terms = zernike.defocus(8 * N**2 * 50 * LAMBDA, N)
    f = np.linspace(0, 2.5 * N / (8 * N**2 * 50 * LAMBDA), 30)
    waves = aberration.otf_ratio_symmetric(f, LAMBDA, N, terms)
    waves = waves * otf_circular(f, LAMBDA, N)
    rays = ray_blur.otf_symmetric(f, N, terms)
    np.testing.assert_allclose(waves, rays, atol=0.01)
    half = zernike.defocus(8 * N**2 * 5 * LAMBDA, N)  # and less so at a tenth of it
    waves = aberration.otf_ratio_symmetric(10 * f, LAMBDA, N, half)
    waves = waves * otf_circular(10 * f, LAMBDA, N)
    assert np.abs(waves - rays).max() > 0.02


def test_waves_of_coma_approach_rays():
    terms = ((8, 5 * LAMBDA),)
    f = np.linspace(-0.01, 0.01, 9) * CUTOFF
    waves = aberration.otf_ratio(f, f[:, None], LAMBDA, N, terms)
    waves = waves * otf_circular(np.hypot(f, f[:, None]), LAMBDA, N)
    np.testing.assert_allclose(waves, ray_blur.otf(f, f, N, terms), atol=0.02)
