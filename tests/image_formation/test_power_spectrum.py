"""Mean squares by frequency, against sums over all terms and against simulated pictures."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import light, rms

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.image_formation.closed_spectrum import rectangle_spectrum
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates import power_spectrum as module
from vcam_cli.image_formation.estimates.power_spectrum import blocks, power_spectrum
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.image_formation.scene_spectrum import SampledSpectrum, transform_planes
from vcam_cli.image_formation.transfer_tables import Tables, TableSize, bounding_tables, tabulate
from vcam_cli.scenes.closed_form import Rectangles

PITCH = 2e-6
NYQUIST = 0.5 / PITCH
AXES = {
    "squares beyond their own Nyquist frequency": (
        Axis(50, 3 * PITCH, 150, PITCH, PITCH / 2, True, 2.5 * NYQUIST),
        Axis(37, 3 * PITCH, 111, PITCH, PITCH / 2, True, 2.5 * NYQUIST),
    ),
    "squares below it": (
        Axis(300, PITCH / 3, 100, PITCH, PITCH / 2, True, 1.3 * NYQUIST),
        Axis(240, PITCH / 3, 80, PITCH, PITCH / 2, True, 1.3 * NYQUIST),
    ),
    "chart": (
        Axis(200, PITCH / 2, 100, PITCH, PITCH / 2, False, 1.6 * NYQUIST),
        Axis(160, PITCH / 2, 80, PITCH, PITCH / 2, False, 1.6 * NYQUIST),
    ),
    "few samples": (
        Axis(3, 7 * PITCH, 21, PITCH, PITCH / 2, True, 1.5 * NYQUIST),
        Axis(1, 7 * PITCH, 7, PITCH, PITCH / 2, True, 1.5 * NYQUIST),
    ),
}


def flat(top: float = 10 * NYQUIST, planes: int = 1) -> Tables:
    """A transfer of 1 for each plane, in a single color."""
    return Tables(np.eye(planes), np.ones((planes, 1, 2)), top, 0.0)


def lens(values, top: float = 2 * NYQUIST) -> Tables:
    values = np.atleast_3d(values)
    return Tables(np.eye(len(values)), values, top, 0.0)


def amplitudes(plane: np.ndarray, x: Axis, y: Axis) -> np.ndarray:
    """Every term of the series of one plane, as the mean square of its wave has it: (y, x)."""

    def analysis(axis):
        k = np.arange(axis.terms)
        n = (np.arange(axis.samples) + 0.5) / axis.samples
        box = np.sinc(k / 2 / axis.samples)
        box = box if axis.squares else 1 / box
        wave = np.cos(np.pi * np.outer(k, n)) * box[:, None] / axis.samples
        # a wave 2 a cos has the mean square 2 a^2, the constant a^2
        return wave * np.where(k > 0, np.sqrt(2), 1)[:, None]

    return analysis(y) @ plane @ analysis(x).T


def planes_of(x: Axis, y: Axis, count: int = 1, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, y.samples, x.samples))


@pytest.mark.parametrize("name", AXES)
def test_blocks_hold_every_term_once(name):
    for axis in AXES[name]:
        parts = blocks(axis)
        step = 1 / (2 * axis.length)
        first, last = (np.rint(f / step).astype(int) for f in (parts.low, parts.high))
        assert first[0] == 0
        assert axis.terms - 2 <= last[-1] < axis.terms
        assert (first[1:] >= first[:-1]).all()
        assert (first <= last).all()
        # frequencies at which squares have no light may lie between blocks, none other
        between = [k for a, b in zip(last[:-1], first[1:], strict=True) for k in range(a + 1, b)]
        assert all(axis.squares and k % axis.samples == 0 for k in between)
        narrow = np.maximum(1, module.WIDTH * parts.high / step)
        assert (last - first <= 2 * narrow).all()


@pytest.mark.parametrize("name", AXES)
def test_power_is_the_sum_over_all_terms(name):
    """Of noise, without a lens: never less, and more as squares pass more at an end of a block."""
    x, y = AXES[name]
    plane = planes_of(x, y)
    power = power_spectrum(transform_planes(plane.copy(), 1), x, y, (), 1)
    every = np.square(amplitudes(plane[0], x, y))
    found = power.filtered_power(flat())[0].sum()
    assert every.sum() * (1 - 1e-9) <= found <= 1.02 * every.sum()
    assert power.products[0][0, 0] == pytest.approx(every[0, 0], rel=1e-12)


@pytest.mark.parametrize("name", AXES)
def test_every_block_is_the_sum_over_its_terms(name):
    """Of a picture whose light falls with frequency as that of photographs does."""
    x, y = AXES[name]
    spectrum = planes_of(x, y)
    for axis, count in ((1, y.samples), (2, x.samples)):
        shape = (-1, 1) if axis == 1 else (1, -1)
        spectrum /= (1 + np.arange(count)).reshape(shape) ** 0.7
    power = power_spectrum(SampledSpectrum(spectrum), x, y, (), 1)
    index_x, index_y = (a.coefficient_index(np.arange(a.terms)) for a in (x, y))
    terms = spectrum[0][index_y[0]][:, index_x[0]] * np.outer(index_y[1], index_x[1])
    twice = np.outer(*(np.where(np.arange(a.terms) > 0, 2, 1) for a in (y, x)))
    every = np.square(terms * np.outer(y.weights, x.weights)) * twice
    step = [1 / (2 * a.length) for a in (y, x)]
    low = [
        np.searchsorted(np.rint(b.low / s), np.arange(a.terms), side="right") - 1
        for b, s, a in zip((power.y, power.x), step, (y, x), strict=True)
    ]
    expected = np.zeros(power.products[0].shape)
    np.add.at(expected, np.ix_(*low), every)
    # blocks are 5 % of their frequency wide, over which the mean over a square changes
    np.testing.assert_allclose(power.products[0], expected, rtol=0.06, atol=1e-9 * every.sum())


def test_mean_squares_are_those_of_the_picture():
    """By Parseval's theorem: of the picture itself, on a grid as fine as its highest frequency."""
    x, y = AXES["squares beyond their own Nyquist frequency"]
    plane = planes_of(x, y)
    tables = lens(np.exp(-2 * (np.linspace(0, 2.5, 4001)[None, None]) ** 2), 3.6 * NYQUIST)
    spectrum = transform_planes(plane.copy(), 1)
    fine = [replace(a, pixels=3 * a.pixels, pixel_pitch=PITCH / 3, first=PITCH / 6) for a in (x, y)]
    filter = Filter(*fine, tables, *(np.ones(a.terms) for a in fine), cubic_range=tables.top / 64)
    picture = filter.apply(spectrum, 1).signal(0, slice(None))
    power = power_spectrum(spectrum, x, y, (), 1).filtered_power(tables)
    assert power.sum() == pytest.approx(np.mean(picture**2), rel=0.01)


@pytest.mark.parametrize("tone", [(0, 331), (217, 0), (90, 140), (31, 7)])
def test_a_grating_beyond_nyquist_is_not_lost(tone):
    """All light is in one coefficient, and where it is repeated, anywhere in its blocks."""
    x, y = AXES["squares beyond their own Nyquist frequency"]
    spectrum = np.zeros((1, y.samples, x.samples))
    index = [a.coefficient_index(np.arange(a.terms)) for a in (y, x)]
    row, column = (i[0][k] for i, k in zip(index, tone, strict=True))
    spectrum[0, row, column] = 1.0
    top = 4 * NYQUIST
    tables = lens(np.linspace(1, 0, 2001)[None, None], top)
    power = power_spectrum(SampledSpectrum(spectrum), x, y, (), 1).filtered_power(tables).sum()
    along_y, along_x = (
        a.weights * (i[0] == k) * i[1] * np.where(np.arange(a.terms) > 0, np.sqrt(2), 1)
        for a, i, k in zip((y, x), index, (row, column), strict=True)
    )
    h = 1 - np.hypot(x.frequencies, y.frequencies[:, None]) / top
    expected = np.square(np.outer(along_y, along_x) * h).sum()
    assert power == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("off", range(-12, 13, 3))
def test_a_tone_beside_the_dark_of_the_aperture_is_not_missed(off):
    """The aperture is judged where it passes most in a block: never less than what it passes."""
    x, y = (
        Axis(600, PITCH / 2, 300, PITCH, PITCH / 2, True, 2.2 * NYQUIST),
        Axis(40, PITCH / 2, 20, PITCH, PITCH / 2, True, 2.2 * NYQUIST),
    )
    term = 600 + off  # at twice the pixels' Nyquist frequency, but for `off` terms
    tone = np.zeros((1, 40, 600))
    index = x.coefficient_index(np.array([term]))[0][0]
    tone[0, 0, index] = 1.0
    both = np.array(sorted({k for k in (index, 1200 - index) if k < x.terms}))
    separable = (PixelAperture(PITCH, PITCH),)
    passed = np.sinc(x.frequencies[both] * PITCH)
    exact = 2 * np.square(x.weights[both] * y.weights[0] * passed).sum()
    found = power_spectrum(SampledSpectrum(tone), x, y, separable, 1).filtered_power(flat()).sum()
    assert found >= 0.99 * exact
    # and no more than it passes two blocks away
    most = 2 * module.WIDTH
    assert found <= 2 * np.square(x.weights[both] * y.weights[0] * most).sum() * 1.1


def test_planes_through_several_colors():
    """Products of planes, each through its own transfer: against the sum over all terms."""
    x, y = AXES["squares below it"]
    planes = planes_of(x, y, 3)
    planes[1] += 0.7 * planes[0]
    f = np.linspace(0, 1, 2001)
    values = np.array([[(1 - f) ** (1 + r + 0.5 * c) * (r + 1) for c in (0, 1)] for r in range(3)])
    values[2] *= -1
    tables = Tables(np.eye(3), values, 2 * NYQUIST, 0.0)
    power = power_spectrum(transform_planes(planes.copy(), 1), x, y, (), 1).filtered_power(tables)
    radius = np.hypot(x.frequencies, y.frequencies[:, None]) / (2 * NYQUIST)
    for color in (0, 1):
        total = sum(
            amplitudes(plane, x, y) * np.interp(radius, f, own[color])
            for plane, own in zip(planes, values, strict=True)
        )
        assert power[color].sum() == pytest.approx(np.square(total).sum(), rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_no_weaker_lens_passes_more_than_the_most(seed):
    """Components may cancel through one lens, and not through another that passes less of each."""
    x, y = AXES["squares below it"]
    rng = np.random.default_rng(seed)
    planes = planes_of(x, y, 3, seed)
    planes[1] = -planes[0]
    table = np.linspace(1, 0, 60) * np.array([1.0, 1.0, 0.5])[:, None, None]
    most = Tables(np.eye(3), np.repeat(table, 2, axis=1), 2 * NYQUIST, 0.0)
    power = power_spectrum(transform_planes(planes, 1), x, y, (), 1)
    limit = power.upper_bound(most)
    for _ in range(3):
        weaker = replace(most, radial=most.radial * rng.uniform(-1, 1, most.radial.shape))
        assert (power.filtered_power(weaker) <= limit * (1 + 1e-9)).all()
    through = power.filtered_power(most)
    assert (through <= limit * (1 + 1e-9)).all()
    assert through.sum() < 0.5 * limit.sum()


def test_no_lens_with_coma_passes_more_than_the_most():
    """The bound is made of the radial part, and of weights that do not cancel."""
    x, y = AXES["squares below it"]
    weights = np.array([[[0.2, 0.8]], [[0.6, -0.3]]])
    blurs = Diffraction(2.8, 0.0), DirectedBlur(Lens(2.8, True), ((7, 120e-9),))
    exact = light(*blurs, weights=weights, wavelengths=(450e-9, 650e-9))
    size, mixing = TableSize(1.9 * NYQUIST, 2049, 0.0, 12), (np.eye(2), 0.0)
    power = power_spectrum(transform_planes(planes_of(x, y, 2), 1), x, y, (), 1)
    passed = power.filtered_power(tabulate(exact, size, mixing))
    limit = power.upper_bound(bounding_tables(exact, size, mixing))
    assert (passed <= limit * (1 + 1e-6) + 1e-9 * limit.max()).all()


@pytest.mark.parametrize("name", AXES)
def test_what_is_lost_next_to_a_cutoff_is_never_understated(name):
    """A lens that ends at the last term passes most at the lower ends of blocks; lines of noise."""
    x, y = AXES[name]
    plane = np.repeat(planes_of(x, y)[:, :1], y.samples, axis=1)
    top = x.frequencies[-1]
    power = power_spectrum(transform_planes(plane.copy(), 1), x, y, (), 1)
    squares = power.largest_power(lens((1 - np.linspace(0, 1, 4001))[None, None], top))
    every = np.square(amplitudes(plane[0], x, y)[0] * (1 - x.frequencies / top))
    for frequency in power.x.high[:-1]:
        exact = np.sqrt(every[x.frequencies > frequency * (1 + 1e-9)].sum())
        told = power.tails(squares, (PITCH, PITCH)).rms(frequency / NYQUIST)
        assert exact <= told * (1 + 1e-6)


def test_what_is_lost_without_an_effect():
    """Leaving out an aperture adds what it would have taken: against the sum over all terms."""
    x, y = AXES["squares below it"]
    plane = planes_of(x, y)
    own, other = PixelAperture(PITCH, 0.7 * PITCH), PixelAperture(0.3 * PITCH, 0.5 * PITCH)
    f = np.linspace(0, 1, 2001)
    tables = lens((1 - f)[None, None])
    power = power_spectrum(transform_planes(plane.copy(), 1), x, y, (own, other), 1)
    radius = np.hypot(x.frequencies, y.frequencies[:, None]) / (2 * NYQUIST)
    rest = amplitudes(plane[0], x, y) * np.interp(radius, f, 1 - f)
    rest *= np.outer(other.along_y(y.frequencies), other.along_x(x.frequencies))
    lost = rest * (1 - np.outer(own.along_y(y.frequencies), own.along_x(x.frequencies)))
    found = power.omission_power(power.lens_power(tables), own)
    # others are judged at the largest that they pass in a block
    assert found.shape == (1,)
    assert found[0] == pytest.approx(np.square(lost).sum(), rel=0.03)


@pytest.mark.parametrize("name", AXES)
def test_rms_beyond_a_frequency(name):
    """Within a zone between multiples of the pixels' Nyquist frequency squares add up.

    Zones meet at the pixels, in phase at most.
    """
    x, y = AXES[name]
    plane = planes_of(x, y)
    power = power_spectrum(transform_planes(plane.copy(), 1), x, y, (), 1)
    squares = power.filtered_power(flat())
    every = np.square(amplitudes(plane[0], x, y))
    at = [axis.frequencies / NYQUIST for axis in (y, x)]
    shell = np.maximum(at[0][:, None], at[1])
    of_y, of_x = (np.ceil(np.maximum(a, 1e-6) - 1e-6) for a in at)
    zone = np.add.outer(9 * of_y, of_x)

    def in_phase(beyond: float) -> float:
        inside = every * (shell > beyond)
        return sum(np.sqrt(inside[zone == z].sum()) for z in np.unique(zone))

    for frequency in (0.0, 0.2, 0.7, 1.0):
        found = power.tails(squares, (PITCH, PITCH)).rms(frequency)
        # a block counts as its highest frequency does: never less than what lies beyond
        wider = in_phase(frequency * (1 - 2 * module.WIDTH) - 1e-9)
        exact = np.sqrt(every[shell > frequency * (1 + 1e-9)].sum())
        assert exact * (1 - 2e-3) <= found <= wider * (1 + 0.02)
    assert power.tails(squares, (PITCH, PITCH)).rms(3.0) == 0


@pytest.mark.parametrize("seed", range(5))
def test_what_pixels_see_beyond_a_frequency_is_at_most_as_told(seed):
    """Terms beyond, evaluated at the pixels: a comb is in phase in all zones."""
    x, y = AXES["squares beyond their own Nyquist frequency"]
    plane = (
        planes_of(x, y, seed=seed)
        if seed
        else np.tile(np.arange(x.samples) % 5 == 0, (1, y.samples, 1)) * 1.0
    )
    power = power_spectrum(transform_planes(plane.copy(), 1), x, y, (), 1)
    squares = power.filtered_power(flat())
    terms = amplitudes(plane[0], x, y)
    shell = np.maximum(x.frequencies, y.frequencies[:, None]) / NYQUIST
    for frequency in (0.3, 0.8, 1.0, 1.7):
        beyond = terms * (shell > frequency * (1 + 1e-9))
        seen = waves_at_pixels(y) @ beyond @ waves_at_pixels(x).T
        told = power.tails(squares, (PITCH, PITCH)).rms(frequency)
        assert rms(seen) <= told * (1 + 2e-3)


def waves_at_pixels(axis: Axis) -> np.ndarray:
    """Every term's wave at the pixels (pixels, terms), of mean square 1."""
    k, place = np.arange(axis.terms), (np.arange(axis.pixels) + 0.5) / axis.pixels
    return np.cos(np.pi * np.outer(place, k)) * np.where(k > 0, np.sqrt(2), 1)


@pytest.mark.parametrize("pitch", [(PITCH, PITCH), (2 * PITCH, PITCH), (PITCH, 3 * PITCH)])
def test_the_highest_that_is_needed_leaves_no_more_than_the_budget(pitch):
    """And the next lower block would: pixels need not be square."""
    x, y = AXES["squares below it"]
    power = power_spectrum(transform_planes(planes_of(x, y), 1), x, y, (), 1)
    squares = power.filtered_power(lens(np.exp(-3 * np.linspace(0, 1, 500))[None, None]))
    whole = power.tails(squares, pitch).rms(-1.0)
    for part in (0.9, 0.5, 0.1, 0.01, 1e-9):
        needed = power.tails(squares, pitch).needed_frequency(part * whole)
        assert power.tails(squares, pitch).rms(needed) <= part * whole
        assert power.tails(squares, pitch).rms(needed * (1 - 1e-6)) > part * whole
    assert power.tails(squares, pitch).needed_frequency(1.01 * whole) == 0.0


def test_the_color_of_most_decides():
    x, y = AXES["squares below it"]
    power = power_spectrum(transform_planes(planes_of(x, y), 1), x, y, (), 1)
    f = np.linspace(0, 2, 500)
    soft, sharp = np.exp(-((3 * f) ** 2)), 0.5 * np.exp(-((0.5 * f) ** 2))
    squares = power.filtered_power(Tables(np.eye(1), np.array([[soft, sharp]]), 2 * NYQUIST, 0.0))
    pitch = PITCH, PITCH
    for frequency in (0.0, 1.0):
        each = [power.tails(squares[c : c + 1], pitch).rms(frequency) for c in (0, 1)]
        assert power.tails(squares, pitch).rms(frequency) == pytest.approx(max(each))


def test_power_of_rectangles_is_that_of_their_cells():
    """A chart of even rectangles, known in closed form, against the same one finely painted."""
    x, y = AXES["chart"]
    rng, n = np.random.default_rng(1), 8
    edges = [np.array([0, 37, 60, 141, a.samples]) for a in (x, y)]
    values = rng.random((2, 4, 4))
    chart = Rectangles(*(e * PITCH / 2 for e in edges), values)
    known = rectangle_spectrum(chart, (y.samples, x.samples), (y, x), np.float64)
    power = power_spectrum(known, x, y, (), 1)
    fine = [replace(a, samples=n * a.samples, sample_pitch=a.sample_pitch / n) for a in (x, y)]
    cells = values.repeat(n * np.diff(edges[1]), axis=1).repeat(n * np.diff(edges[0]), axis=2)
    painted = power_spectrum(transform_planes(cells, 1), *fine, (), 1)
    tables = flat(planes=2)
    # edges of cells that no border cuts: what these fold is a hundredth at their own Nyquist
    assert power.filtered_power(tables).sum() == pytest.approx(
        painted.filtered_power(tables).sum(), rel=1e-4
    )
    for found, expected in zip(power.products, painted.products, strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.01, atol=1e-6 * abs(expected).max())
