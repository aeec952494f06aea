"""Tables of transfer functions against the functions that they hold."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import Gaussian, Leaning, light
from scipy.interpolate import CubicSpline, make_interp_spline

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.half_pupil import HalfPupil
from vcam_cli.effects.optics.low_pass import LowPassAlongAxes, ObliqueLowPass
from vcam_cli.effects.optics.turned_transfer import TurnedTransfer
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens, SymmetricBlur
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import (
    LARGEST_PLANE,
    PARITIES,
    SMALLEST_PLANE,
    Tables,
    TableSize,
    bounding_tables,
    mixtures,
    plane_grid,
    reader,
    spline_weights,
    split_by_parity,
    tabulate,
)

WAVELENGTHS = np.linspace(420e-9, 660e-9, 7)
F = np.linspace(0, 2.1e5, 37)
G = np.linspace(0, 1.9e5, 29)
COMA = ((7, 50e-9),)
MIXED = ((4, 40e-9), (5, 25e-9), (8, 45e-9), (9, -20e-9))


def spectral(*blurs, components=2, colors=3, seed=0) -> Transfer:
    """Light of several spectra in several colors, at seven wavelengths."""
    weights = np.random.default_rng(seed).random((components, colors, 7))
    return light(*blurs, weights=weights, wavelengths=WAVELENGTHS)


def size_of(exact: Transfer, entries: int = 8193, steps: float = 8.0) -> TableSize:
    return TableSize(min(exact.cutoff, 4e5), entries, 0.0, steps)


def read(tables: Tables, parity: int, fx, fy) -> np.ndarray:
    """Return transfer functions (R, C, m, n) of one parity."""
    return tables.of_every(reader(tables, parity, fx).values(fy))


def tables_of(exact: Transfer, **sizes) -> Tables:
    size = size_of(exact, **sizes)
    return tabulate(exact, size, (np.eye(len(exact.weights)), 0.0))


@pytest.mark.parametrize("blurs", ["none", "diffraction", "defocus", "gaussian"])
def test_radial_tables_are_the_transfer_functions(blurs):
    """Linear between 8193 entries: they err by the second difference over 8, but for the ends."""
    lens = {
        "none": (),
        "diffraction": (Diffraction(2.8, 0.0),),
        "defocus": (Diffraction(2.8, 0.0), SymmetricBlur(Lens(2.8, True), ((4, 60e-9),))),
        "gaussian": (Gaussian(2e-6), Gaussian(1e-6)),
    }[blurs]
    exact = spectral(*lens)
    tables = tables_of(exact)
    assert tables.parities == [0]
    assert tables.colors == 3
    found = read(tables, 0, F, G)
    expected = exact.radial_response(np.hypot(F, G[:, None]))
    np.testing.assert_allclose(found, expected, atol=2e-7 * exact.level.max())


def combined(tables: Tables, fx, fy) -> np.ndarray:
    """What the tables say of H at (fx, fy) in the quadrant: (R, C, m, n), complex.

    cos becomes cos and sines of the same frequencies; so H of a half-plane is put together again.
    """
    total = np.zeros((len(tables.mix), tables.colors, len(fy), len(fx)), complex)
    # cos cos -> H0 cos cos + H1 sin sin + H2 sin cos + H3 cos sin: see `split_by_parity`
    factors = {0: 1, 1: -1, 2: -1j, 3: -1j}
    for parity in tables.parities:
        total = total + factors[parity] * read(tables, parity, fx, fy)
    return total


@pytest.mark.parametrize("terms", [COMA, MIXED, ((2, 30e-9),)], ids=["coma", "several", "tilt"])
def test_plane_tables_are_the_transfer_functions(terms):
    """Thinned to every second wavelength, which the radial part is not: 2e-3 of the light.

    To its second order a transfer is linear between neighboring wavelengths.
    """
    exact = spectral(Diffraction(2.8, 0.0), DirectedBlur(Lens(2.8, True), terms))
    tables = tables_of(exact)
    found = combined(tables, F, G)
    expected = exact.plane_response(F, G)
    level = exact.level[..., None, None]
    assert np.abs((found - expected) / level).max() < 2e-3
    # along the axes of the quadrant's mirror image, which the parities have in them too
    mirrored = exact.plane_response(F, -G)
    sine = {1: 1, 3: 1j}
    other = sum(sine.get(p, {0: 1, 2: -1j}.get(p)) * read(tables, p, F, G) for p in tables.parities)
    assert np.abs((other - mirrored) / level).max() < 2e-3


@pytest.mark.parametrize("steps", [4.0, 8.0, 16.0])
def test_plane_tables_follow_the_phase_of_a_blur(steps):
    """A Gaussian beside its place, at one wavelength: only the spline's error is left."""
    blur = Leaning(6e-6, -4e-6, 1.5e-6, 2e-6)
    exact = light(blur)
    found = combined(tables_of(exact, steps=steps), F, G)
    worst = np.abs(found - exact.plane_response(F, G)).max()
    # a cubic spline with n steps in a period errs by about (2 pi / n)^4 / 384
    assert worst < 2 * (2 * np.pi / steps) ** 4 / 384


GEOMETRIC = {
    "low-pass": (ObliqueLowPass(((300e-6, 200e-6),)),),
    "turned": (TurnedTransfer(LowPassAlongAxes(((9e-6, 0.0), (0.0, 4e-6))), 0.3),),
    "half a pupil": (HalfPupil(7e-6, 1),),
    "both": (HalfPupil(7e-6, -1), ObliqueLowPass(((30e-6, 20e-6),))),
}


@pytest.mark.parametrize("terms", [(), MIXED], ids=["round", "directed"])
@pytest.mark.parametrize("name", GEOMETRIC)
def test_blurs_that_are_computed_at_each_frequency_multiply_the_tables(name, terms):
    """However far they reach: only the tables of the others err, as above."""
    lens = (DirectedBlur(Lens(2.8, True), terms),) if terms else ()
    exact = spectral(Diffraction(2.8, 0.0), *lens, *GEOMETRIC[name])
    tables = tables_of(exact)
    assert tables.is_radial == (not terms)
    found = combined(tables, F, G)
    expected = exact.plane_response(F, G)
    level = exact.level[..., None, None]
    assert np.abs((found - expected) / level).max() < (2e-3 if terms else 2e-7)
    change = combined(replace(tables, is_change=True), F, G)
    np.testing.assert_allclose(
        found - change, exact.radial_response(np.hypot(F, G[:, None])), atol=2e-7 * level.max()
    )


@pytest.mark.parametrize("name", GEOMETRIC)
def test_transfers_of_symmetric_blurs_are_real(name):
    for blur in GEOMETRIC[name]:
        assert np.isrealobj(blur.otf_plane(F, G, 550e-9)) == blur.is_symmetric


def test_entries_follow_the_reach_within_limits():
    size = TableSize(4e5, 100, 0.0, 8)
    assert size.plane_entries((Leaning(0, 0, 1e-9, 1e-9),), 1) == SMALLEST_PLANE
    far = (Leaning(0, 0, 1e-2, 1e-2),)
    assert size.plane_entries(far, 100) == LARGEST_PLANE
    assert size.plane_entries(far, 2) == 2048
    assert size.plane_entries((Leaning(0, 0, 1e-5, 1e-6), Leaning(0, 0, 1e-6, 1e-6)), 1) == 97


@pytest.mark.parametrize("entries", [41, 61])
def test_tables_of_too_few_entries_say_what_they_err_by(entries):
    blur = Leaning(6e-6, -4e-6, 1.5e-6, 2e-6)
    exact, size = light(blur), TableSize(4e5, 100, 0.0, 16)
    change = plane_grid(exact, size.top, entries).change([blur])
    found = combined(replace(tables_of(exact), top=size.top, planes=tuple(change)), F, G)
    worst = np.abs(found - exact.plane_response(F, G)).max() / exact.level.max()
    assert worst < size.plane_error([blur], entries) < 20 * worst
    assert size.plane_error([blur], size.plane_entries([blur], 1)) == 0


def test_a_reader_of_fewer_columns_is_the_same():
    """To the rounding of a matrix product, whose sums run in another order for another width."""
    exact = spectral(Diffraction(2.8, 0.0), DirectedBlur(Lens(2.8, True), MIXED))
    tables = tables_of(exact)
    for parity in range(4):
        whole = reader(tables, parity, F)
        few, all_columns = whole.values(G[3:5], 9), whole.values(G)
        np.testing.assert_allclose(few, all_columns[:, 3:5, :9], rtol=1e-14)


def test_a_spline_by_weights_is_the_spline():
    rng = np.random.default_rng(1)
    table, at = rng.random(23), np.sort(rng.random(50))
    spline = CubicSpline(np.linspace(0, 1, 23), table, bc_type="not-a-knot")
    coefficients = make_interp_spline(np.linspace(0, 1, 23), table, k=3).c
    np.testing.assert_allclose(spline_weights(23, at) @ coefficients, spline(at), atol=1e-12)


def test_weights_of_a_spline():
    places = np.append(np.random.default_rng(0).random(40), [0.0, 1.0, 1.0 + 1e-9, 2.0])
    weights = spline_weights(23, places)
    assert weights.nnz == 4 * len(places)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    at = np.linspace(0, 1, 23)
    for power in range(4):  # cubics are their own splines
        coefficients = make_interp_spline(at, at**power, k=3).c
        expected = np.minimum(places, 1) ** power
        np.testing.assert_allclose(weights @ coefficients, expected, atol=1e-12)


@pytest.mark.parametrize("fx", [3e4, 0.0])
@pytest.mark.parametrize("fy", [5e4, 0.0])
def test_parities_turn_a_cosine_into_what_a_blur_makes_of_it(fx, fy):
    """Against the light of a wave that a blur moves and weakens, in space."""
    blur = Leaning(2.5e-6, -1.3e-6, 1.6e-6, 2.4e-6)
    at = np.array([[fx]]), np.array([[fy]])
    plus, minus = (blur.otf_plane(at[0][0], sign * at[1][0], 550e-9) for sign in (1, -1))
    parts = split_by_parity(plus, minus)[:, 0, 0]
    x, y = np.linspace(-9e-6, 9e-6, 13), np.linspace(-7e-6, 7e-6, 11)[:, None]
    size = np.exp(-2 * np.pi**2 * ((1.6e-6 * fx) ** 2 + (2.4e-6 * fy) ** 2))
    moved = np.cos(2 * np.pi * fx * (x - 2.5e-6)) * np.cos(2 * np.pi * fy * (y + 1.3e-6))
    wave = [(np.cos(2 * np.pi * f * p), np.sin(2 * np.pi * f * p)) for f, p in ((fx, x), (fy, y))]
    found = sum(
        part * wave[0][odd_x] * wave[1][odd_y]
        for part, (odd_x, odd_y) in zip(parts, PARITIES, strict=True)
    )
    np.testing.assert_allclose(found, size * moved, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("is_sine", [False, True])
def test_a_harmonic_of_the_direction_has_its_parity(order, is_sine):
    """Waves along x or y change sign as the cosine or sine of the direction does."""
    tables = Tables(
        np.eye(1), np.linspace(0, 1, 65)[None, None], 4e5, 0.0, (None,) * 4, order, is_sine
    )
    (parity,) = tables.parities
    wave = np.sin if is_sine else np.cos

    def expected(fx, fy):
        return np.hypot(fx, fy) / 4e5 * wave(order * np.arctan2(fy, fx))

    f = np.array([3e4, 1.1e5]), np.array([7e4, 1.5e5])
    found = read(tables, parity, *f)[0, 0]
    np.testing.assert_allclose(found, expected(f[0], f[1][:, None]), atol=1e-12)
    odd_x, odd_y = PARITIES[parity]
    np.testing.assert_allclose(expected(f[0], -f[1]), (1 - 2 * odd_y) * expected(*f), atol=1e-12)
    np.testing.assert_allclose(expected(-f[0], f[1]), (1 - 2 * odd_x) * expected(*f), atol=1e-12)


def test_what_is_added_to_the_radial_part_is_zero_for_round_blurs():
    """By a grid of two halves of the plane, of a blur known over |f|: parity 0 alone."""
    exact = spectral(Diffraction(2.8, 0.0))
    grid = plane_grid(exact, 3e5, 17)
    parts = grid.change([Gaussian(1e-6)])
    length = np.hypot(grid.frequency, grid.frequency[:, None])
    added = exact.with_half_the_wavelengths().radial_response(length) * (
        np.exp(-2 * (np.pi * 1e-6 * length) ** 2) - 1
    )
    np.testing.assert_allclose(parts[0], added, atol=1e-12 * exact.level.max())
    assert np.abs(parts[1:]).max() < 1e-12 * exact.level.max()


@pytest.mark.parametrize("sign", [1, -1])
def test_no_lens_exceeds_the_bound(sign):
    """Weights of both signs, and any blur with a direction."""
    weights = np.random.default_rng(3).random((2, 2, 7))
    weights[1] *= sign
    weights[1, :, ::2] *= -1
    blurs = Diffraction(2.8, 0.0), DirectedBlur(Lens(2.8, True), MIXED)
    exact = light(*blurs, weights=weights, wavelengths=WAVELENGTHS)
    size = size_of(exact)
    limit = read(bounding_tables(exact, size, (np.eye(2), 0.0)), 0, F, G)
    assert (np.abs(exact.plane_response(F, G)) <= limit + 1e-6 * limit.max()).all()


def test_mixtures_serve_every_place_of_a_field():
    """Two lenses of the same spectra: what is kept for both keeps each within the tolerance."""
    one = spectral(Diffraction(2.8, 0.0), components=12)
    two = one.with_effects((*one.effects, SymmetricBlur(Lens(2.8, True), ((4, 120e-9),))))
    size = TableSize(3e5, 2049, 1e-3, 8)

    def more():
        return [two.radial_response(np.linspace(0, size.top, 256)).reshape(12, -1)]

    mix, error = mixtures(one, size, more)
    assert len(mix) < 12
    assert error <= 1e-3
    f = np.linspace(0, 3e5, 999)
    for exact in (one, two):
        rebuilt = np.tensordot(mix.T, exact.with_mixtures(mix).radial_response(f), axes=1)
        assert (
            np.abs(rebuilt - exact.radial_response(f)).max() <= 1.05e-3 * np.abs(exact.level).max()
        )
    limited, worse = mixtures(one, TableSize(3e5, 2049, 1e-9, 8, rank=2), more)
    assert len(limited) == 2
    assert worse > error


def test_mixtures_err_as_stated_between_the_frequencies_at_which_they_are_judged():
    """Behind a defocus of many waves, whose contrast turns often."""
    strong = SymmetricBlur(Lens(2.8, True), ((4, 2e-6),))
    exact = spectral(Diffraction(2.8, 0.0), strong, components=31)
    size = TableSize(4e5, 2049, 2e-3, 8)
    mix, error = mixtures(exact, size)
    f = np.linspace(0, size.top, 4001)
    rebuilt = np.tensordot(mix.T, exact.with_mixtures(mix).radial_response(f), axes=1)
    lost = np.abs(rebuilt - exact.radial_response(f)).max() / exact.level.max()
    assert error <= lost * (1 + 1e-9) <= 1.02 * error


def test_components_without_a_common_color_are_not_mixed():
    """Two colors see the first three components, a third one the fourth, and none the last."""
    wavelengths = np.linspace(450e-9, 650e-9, 5)
    weights = np.zeros((5, 3, 5))
    weights[:3, :2] = np.random.default_rng(2).random((3, 2, 5))
    weights[2, :2] = weights[0, :2] + weights[1, :2]
    weights[3, 2] = 1.0
    exact = light(Diffraction(2.8, 0.0), weights=weights, wavelengths=wavelengths)
    size = TableSize(3e5, 257, 1e-6, 8)
    mix, error = mixtures(exact, size)
    assert len(mix) == 3
    assert error <= 1e-6
    alone = mix[:, 3] != 0
    assert alone.sum() == 1
    np.testing.assert_array_equal(mix[alone], [[0, 0, 0, 1, 0]])
    assert not mix[:, 4].any()
    seen = tabulate(exact, size, (mix, error)).planes_by_color
    assert [(list(~alone[planes]), colors) for planes, colors in seen] == [
        ([True, True], slice(0, 2)),
        ([False], slice(2, 3)),
    ]
