"""The slow camera's lens held to closed forms: wavefronts, spread functions, blurred squares."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference as ref
import reference_light as light
from reference_light import Aberrated, Field, Measured, Wavefront
from scipy.special import j1
from test_reference import camera, wave

pytestmark = pytest.mark.long

NOLL = {  # table I of Noll 1976: radial order and azimuthal order; even numbers are cosines
    1: (0, 0), 2: (1, 1), 3: (1, -1), 4: (2, 0), 5: (2, -2), 6: (2, 2), 7: (3, -1), 8: (3, 1),
    9: (3, -3), 10: (3, 3), 11: (4, 0), 12: (4, 2), 13: (4, -2), 14: (4, 4), 15: (4, -4),
    16: (5, 1), 22: (6, 0),
}  # fmt: skip
N, GREEN = 4.0, 550e-9
RING = N * GREEN


# --- wavefronts ----------------------------------------------------------------------------------


@pytest.mark.parametrize("number", NOLL)
def test_order_is_nolls(number):
    assert light.noll(number) == NOLL[number]


def test_polynomials_are_orthonormal():
    # products of two polynomials of order 6: the rule of 40 points is exact for them to rounding
    u, v, weight = light.chords(40)
    each = np.array([light.zernike(number, u, v).ravel() for number in range(1, 29)])
    assert (each * weight.ravel()) @ each.T / np.pi == pytest.approx(np.eye(28), abs=1e-12)


def test_named_polynomials():
    u, v = np.array([0.3, -0.5]), np.array([0.6, 0.2])
    r2 = u**2 + v**2
    assert light.zernike(3, u, v) == pytest.approx(2 * v)
    assert light.zernike(4, u, v) == pytest.approx(math.sqrt(3) * (2 * r2 - 1))
    assert light.zernike(5, u, v) == pytest.approx(math.sqrt(6) * 2 * u * v)
    assert light.zernike(8, u, v) == pytest.approx(math.sqrt(8) * (3 * r2 - 2) * u)
    assert light.zernike(11, u, v) == pytest.approx(math.sqrt(5) * (6 * r2**2 - 6 * r2 + 1))


def test_a_turned_wavefront_has_its_features_turned():
    # coma along +x turned by 90 degrees, from x toward y, is coma along +y: Noll 8 becomes 7
    u, v, _ = light.chords(20)
    turned = Wavefront(((8, 1e-7),), turned=math.pi / 2).path(u, v, N)
    assert turned == pytest.approx(Wavefront(((7, 1e-7),)).path(u, v, N), abs=1e-20)


# --- spread functions ----------------------------------------------------------------------------


def test_spread_of_a_perfect_lens_is_airys():
    x, y = np.array([0.0, 1e-6, 7e-6, -30e-6]), np.array([0.4e-6, 20e-6])
    z = np.pi * np.hypot(x, y[:, None]) / RING
    airy = np.pi / (4 * RING**2) * (2 * j1(z) / z) ** 2
    found = light.spread(Wavefront(), x, y, GREEN, N)
    assert found == pytest.approx(airy, abs=1e-12 * airy.max())


@pytest.mark.parametrize("waves", [0.2, 0.7, 1.0, 2.3])
def test_peak_of_a_defocused_lens(waves):
    # Strehl ratio of W = a r^2 over the disk: (sin(pi a) / (pi a))^2, zero at a whole wave
    front = Wavefront(defocus=8 * N**2 * waves * GREEN)
    peak = light.spread(front, np.zeros(1), np.zeros(1), GREEN, N)[0, 0]
    perfect = np.pi / (4 * RING**2)
    assert peak / perfect == pytest.approx(np.sinc(waves) ** 2, abs=1e-12)


def test_defocus_is_nolls_fourth_but_for_a_constant():
    # a r^2 = a/2 + a / (2 sqrt 3) Z4
    shift = 30e-6
    edge = shift / (8 * N**2)
    x = np.linspace(-9e-6, 9e-6, 7)
    found = light.spread(Wavefront(defocus=shift), x, x, GREEN, N)
    expected = light.spread(Wavefront(((4, edge / (2 * math.sqrt(3))),)), x, x, GREEN, N)
    assert found == pytest.approx(expected, rel=1e-9)


def test_tilt_moves_the_spread_right_and_down():
    # W = 2 c u moves it by 4 N c; both polynomials, different coefficients
    front = Wavefront(((2, 0.2e-6), (3, 0.5e-6)))
    x = np.linspace(-20e-6, 20e-6, 9)
    found = light.spread(front, x + 4 * N * 0.2e-6, x + 4 * N * 0.5e-6, GREEN, N)
    assert found == pytest.approx(light.spread(Wavefront(), x, x, GREEN, N), rel=1e-6, abs=1)


LOPSIDED = Wavefront(((5, 40e-9), (7, -35e-9), (8, 60e-9), (11, 30e-9)), defocus=8e-6)


@pytest.mark.parametrize("f", [(0.0, 0.0), (90e3, 0.0), (-60e3, 140e3), (300e3, -200e3)])
def test_overlap_of_pupils_is_the_transform_of_the_spread(f):
    # what the sum leaves out beyond 160 um is 2 ring / (pi^2 160 um) of the light, at every place:
    # up to 3e-3 at frequency 0, less where it swings
    x = np.arange(-320, 321) * 0.5e-6
    h = light.spread(LOPSIDED, x, x, GREEN, N) * 0.25e-12
    turn = np.exp(-2j * np.pi * (f[1] * x[:, None] + f[0] * x))
    found = light.transfer(LOPSIDED, *f, GREEN, N)
    assert found == pytest.approx((turn * h).sum(), abs=3e-3 if f == (0.0, 0.0) else 2e-4)


def test_centroid_of_coma():
    # the mean slope of Noll 8 is sqrt 8 along u, so the light's center moves by 2 N sqrt 8 c; the
    # phase of low frequencies is that of a displacement, but for the steeper rims that two pupils
    # do not share, some ring f = 1e-4 of all
    f, c = 50.0, 80e-9
    h = light.transfer(Wavefront(((8, c),)), f, 0.0, GREEN, N)
    assert -np.angle(h) / (2 * np.pi * f) == pytest.approx(2 * N * math.sqrt(8) * c, rel=1e-3)
    assert np.angle(light.transfer(Wavefront(((8, c),)), 0.0, f, GREEN, N)) == pytest.approx(0)


@pytest.mark.parametrize("nu", [0.05, 0.4, 0.93])
def test_transfer_of_a_perfect_lens(nu):
    closed = 2 / np.pi * (math.acos(nu) - nu * math.sqrt(1 - nu**2))
    assert light.transfer(Wavefront(), 0.0, nu / RING, GREEN, N) == pytest.approx(closed, rel=1e-12)
    assert light.transfer(Wavefront(), 0.0, 1.01 / RING, GREEN, N) == 0


def test_large_defocus_is_the_geometric_disk():
    # 20 waves: the light fills a disk of radius shift / (2 N), the transform of which is
    # 2 J1(z) / z; diffraction softens its rim by some ring / radius
    shift = 20 * 8 * N**2 * GREEN
    radius = shift / (2 * N)
    f = 0.6 / radius
    z = 2 * np.pi * f * radius
    found = light.transfer(Wavefront(defocus=shift), f, 0.0, GREEN, N)
    assert found == pytest.approx(2 * j1(z) / z, abs=0.03)


def test_measured_samples_are_displacements():
    # three samples in an L: their own phases, the middle one at the ideal place
    samples = np.zeros((1, 3, 3))
    samples[0, 1, 1], samples[0, 1, 2], samples[0, 0, 1] = 2, 1, 1
    found = Measured(samples, 1e-6).transfer(1e5, 2e5, GREEN, N)
    expected = (2 + np.exp(-2j * np.pi * 0.1) + np.exp(2j * np.pi * 0.2)) / 4
    assert found == pytest.approx(expected)


def test_measured_wavelengths_mix():
    samples = np.zeros((2, 1, 3))
    samples[0, 0, 1] = 5  # sharp at 400 nm
    samples[1, 0, 0] = 2  # all light one sample to the left at 600 nm
    shares = Measured(samples, 1e-6, (400e-9, 600e-9)).shares(450e-9)
    assert shares == pytest.approx(np.array([[0.25, 0.75, 0.0]]))


def test_rays_of_a_defocused_lens_fill_a_disk():
    # radius shift / (2 N): 2 J1(z) / z; a tilt moves it to the right
    f, shift = 40e3, 50e-6
    z = 2 * np.pi * f * shift / (2 * N)
    front = Wavefront(((2, 0.2e-6),), defocus=shift)
    found = light.Rays(front).transfer(f, 0.0, GREEN, N)
    moved = np.exp(-2j * np.pi * f * 4 * N * 0.2e-6)
    assert found == pytest.approx(2 * j1(z) / z * moved, rel=1e-6)


def test_field_lists_are_straight_lines_of_the_radius():
    lens = Field((0.0, 0.5, 1.0), (((8, 0.0),), ((8, 2e-8), (11, 1e-8)), ((8, 6e-8),)), 1e-3)
    here = lens.at(0.0, 0.75e-3)
    assert dict(here.terms) == pytest.approx({8: 4e-8, 11: 0.5e-8})
    assert here.turned == pytest.approx(math.pi / 2)


# --- squares through lenses ----------------------------------------------------------------------


def random_squares(seed: int = 5) -> ref.Squares:
    """Twice the camera's pixels, so squares of 2 x 2.5 um."""
    return ref.Squares(np.random.default_rng(seed).uniform(size=(1, 24, 32)), 2e-6, 2.5e-6)


def test_patch_agrees_with_displacements():
    # both blur by Airy's pattern; white noise is the hardest picture for displacements
    setup = camera(random_squares(), wavelength=(450e-9, 620e-9))
    expected = ref.mean_electrons(setup)
    found = ref.mean_electrons(replace(setup, lens=Aberrated(Wavefront())))
    assert np.sqrt(np.mean((found - expected) ** 2)) < 2e-4 * expected.max()


def test_finer_cells_change_nothing():
    # squares and photodetectors end where cells do: nothing is approximated but the function's end
    setup = camera(random_squares(), lens=Aberrated(LOPSIDED))
    coarse, fine = (ref.mean_electrons(replace(setup, cell=c)) for c in (0.25e-6, 0.125e-6))
    assert np.abs(coarse - fine).max() < 1e-6 * fine.max()


@pytest.mark.parametrize("lens", ["aberrated", "measured"])
def test_squares_painted_with_a_wave_agree_with_the_wave(lens):
    # the picture repeats after one mirrored period: two whole waves across, cells a 16th of a pixel
    f = 2 / 64e-6
    samples = np.random.default_rng(3).uniform(size=(1, 7, 6))
    glass = Aberrated(LOPSIDED) if lens == "aberrated" else Measured(samples, 0.7e-6)
    scene = ref.Waves((0.5, 0.4), (0.0, f), (0.0, 0.0), (0.0, 2 * np.pi * f * 32e-6))
    expected = ref.mean_electrons(camera(scene, lens=glass))
    x = (np.arange(256) + 0.5) * 0.25e-6
    painted = 0.5 + 0.4 * np.cos(2 * np.pi * f * x)
    squares = ref.Squares(np.tile(painted, (1, 48, 1)), 0.25e-6, 1.25e-6)
    found = ref.mean_electrons(camera(squares, lens=glass))
    assert np.abs(found - expected).max() < 3e-4 * expected.max()


def test_a_field_that_does_not_change_is_one_lens():
    # turned by the azimuth, so only symmetric terms; both sum the same shares in two orders
    terms = ((4, 50e-9), (11, 40e-9))
    setup = camera(random_squares())
    expected = ref.mean_electrons(replace(setup, lens=Aberrated(Wavefront(terms, 5e-6))))
    chosen = np.zeros((12, 16), bool)
    chosen[[0, 3, 11], [0, 9, 4]] = True
    field = replace(setup, lens=Field((0.0, 1.0), (terms, terms), 1e-3, 5e-6))
    found = ref.electrons_of_field(field, chosen)
    assert found[chosen] == pytest.approx(expected[chosen], rel=1e-4)
    assert np.isnan(found[~chosen]).all()


def test_coma_of_a_field_points_outward():
    # a black picture with one bright square at each of two pixels left and right of the center:
    # coma along +x at the right is turned at the left, so the two images mirror each other
    planes = np.zeros((1, 24, 32))
    planes[0, 10:14, 4:6] = planes[0, 10:14, 26:28] = 1
    lens = Field((0.0, 1.0), (((8, 0.0),), ((8, 150e-9),)), 32e-6)
    setup = camera(ref.Squares(planes, 2e-6, 2.5e-6), lens=lens, cell=0.5e-6)
    chosen = np.zeros((12, 16), bool)
    chosen[6, [1, 3, 12, 14]] = True
    found = ref.electrons_of_field(setup, chosen)[6]
    assert found[[1, 3]] == pytest.approx(found[[14, 12]], rel=1e-4)
    assert found[14] > 1.1 * found[12]  # the light's center lies on the outer side


def test_illumination_from_a_table():
    setup = camera(wave(0.0), off_axis="file", illumination=((0.0, 1e-5, 2e-5), (1.0, 0.9, 0.5)))
    found = ref.relative_illumination(setup, np.array([0.0, 4e-6, 15e-6]), np.array([0.0, 3e-6, 0]))
    assert found == pytest.approx([1.0, 0.95, 0.7])


def test_stray_light_keeps_the_mean_of_every_color():
    color = np.indices((12, 16)).sum(axis=0) % 2
    setup = camera(random_squares(), color=color, diffraction=False,
                   response=np.array([[0.2], [0.5]]), stray=0.3)  # fmt: skip
    clear = ref.mean_electrons(replace(setup, stray=0.0))
    found = ref.mean_electrons(setup)
    for k in (0, 1):
        mean = clear[color == k].mean()
        assert found[color == k].mean() == pytest.approx(mean, rel=1e-12)
        assert found[color == k].std() == pytest.approx(0.7 * clear[color == k].std(), rel=1e-12)
