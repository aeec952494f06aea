"""Spectra: exact integrals, coverage, lines, standard lamps, CSV files."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli import spectra
from vcam_cli.spectra import Spectrum, Table, hat_weights, integral, pair_weights, quadrature

START, STOP = 380e-9, 780e-9
NM = 1e-9


@st.composite
def tables(draw: st.DrawFn, low: float = 300, high: float = 900) -> Table:
    """Up to eight knots at whole nanometers, covering at least 380 to 780 nm."""
    inner = draw(st.sets(st.integers(int(low) + 1, int(high) - 1), max_size=6))
    wavelength = np.array([low, *sorted(inner), high]) / 1e9
    values = st.floats(0, 10).map(lambda v: round(v, 3))
    return Table(wavelength, np.array([draw(values) for _ in wavelength]))


def exact_integral(factors: list[Table], start: float, stop: float) -> float:
    """By polynomial algebra on every interval, no quadrature. In nm, to keep powers tame."""
    knots = {start, stop}
    for table in factors:
        knots |= {x for x in table.wavelength / NM if start < x < stop}
    total = 0.0
    for low, high in zip(sorted(knots)[:-1], sorted(knots)[1:], strict=True):
        product = np.polynomial.Polynomial([1.0])
        for table in factors:
            at_low, at_high = np.interp([low, high], table.wavelength / NM, table.value)
            product *= np.polynomial.Polynomial([at_low, (at_high - at_low) / (high - low)])
        total += product.integ()(high - low)
    return total * NM


@given(st.lists(tables(), min_size=1, max_size=6))
def test_integral_is_that_of_polynomial_algebra(factors: list[Table]) -> None:
    spectrum = Spectrum(tables=tuple(factors))
    expected = exact_integral(factors, 380.0, 780.0)
    # 1e-11: the reference itself loses digits in powers of up to 600 nm
    assert integral(spectrum, START, STOP) == pytest.approx(expected, rel=1e-11, abs=1e-25)


def test_integral_of_a_spike_narrower_than_any_grid() -> None:
    """A triangle 0.02 nm wide between the nanometers keeps its area exactly."""
    spike = Spectrum.from_samples(np.array([550.49, 550.5, 550.51]) * NM, [0.0, 5.0, 0.0], "zero")
    assert integral(spike, START, STOP) == pytest.approx(5.0 * 0.01 * NM, rel=1e-9)
    assert integral(spike, START, 550.5 * NM) == pytest.approx(2.5 * 0.01 * NM, rel=1e-9)
    # lambda / (h c) averaged over a symmetric triangle is its value at the middle
    photons = integral(spectra.photons(spike), START, STOP)
    middle = 550.5 * NM / (spectra.PLANCK * spectra.SPEED_OF_LIGHT)
    assert photons == pytest.approx(5.0 * 0.01 * NM * middle, rel=1e-9)


@given(st.lists(tables(), min_size=1, max_size=4), st.floats(400e-9, 700e-9))
def test_integral_adds_up_over_any_split(factors: list[Table], middle: float) -> None:
    spectrum = Spectrum(tables=tuple(factors))
    parts = integral(spectrum, START, middle) + integral(spectrum, middle, STOP)
    assert parts == pytest.approx(integral(spectrum, START, STOP), rel=1e-12, abs=1e-25)


@given(st.lists(tables(), min_size=1, max_size=4), st.integers(0, 3))
def test_quadrature_serves_every_subset(factors: list[Table], last: int) -> None:
    parts = [Spectrum(tables=(table,)) for table in factors]
    nodes, weights = quadrature(parts, START, STOP)
    assert (np.diff(nodes) > 0).all()
    assert (weights > 0).all()
    assert nodes[0] > START
    assert nodes[-1] < STOP
    assert weights.sum() == pytest.approx(STOP - START, rel=1e-12)
    subset = parts[: last + 1]
    value = np.prod([part.evaluate(nodes) for part in subset], axis=0) @ weights
    expected = integral(subset[0].multiply(*subset[1:]), START, STOP)
    assert value == pytest.approx(expected, rel=1e-12, abs=1e-25)


@given(
    st.lists(tables(), max_size=3),
    st.sets(st.integers(381, 779), min_size=0, max_size=40),
)
def test_hat_weights_share_the_integral(factors: list[Table], inner: set[int]) -> None:
    spectrum = Spectrum(scale=2.0, tables=tuple(factors))
    nodes = np.array([380, *sorted(inner), 780]) / 1e9
    weights = hat_weights(spectrum, nodes)
    whole = integral(spectrum, START, STOP)
    assert weights.sum() == pytest.approx(whole, rel=1e-12, abs=1e-25)
    hat = np.zeros(len(nodes))
    hat[len(nodes) // 2] = 1.0  # one of them, as a table of its own
    one = integral(spectrum.multiply(Spectrum.from_samples(nodes, hat)), START, STOP)
    assert weights[len(nodes) // 2] == pytest.approx(one, rel=1e-11, abs=1e-25)
    # a straight line is its own interpolation
    slope = integral(spectrum.multiply(spectra.PHOTONS), START, STOP)
    assert weights @ spectra.PHOTONS.evaluate(nodes) == pytest.approx(slope, rel=1e-12, abs=1e-5)


@given(
    st.lists(st.lists(tables(), max_size=2), min_size=1, max_size=4),
    st.lists(st.lists(tables(), max_size=2), min_size=1, max_size=3),
    st.sets(st.integers(381, 779), min_size=0, max_size=40),
)
def test_pairs_are_weighed_as_their_products(
    first: list[list[Table]], second: list[list[Table]], inner: set[int]
) -> None:
    nodes = np.array([380, *sorted(inner), 780]) / 1e9
    some = [Spectrum(scale=2.0, tables=tuple(factors)) for factors in first]
    some.insert(1, Spectrum(lines=((650e-9, 1.0), (450e-9, 2.0), (900e-9, 50.0))))
    others = [Spectrum(scale=3.0, tables=tuple(factors)) for factors in second]
    found = pair_weights(some, others, nodes)
    assert found.shape == (len(some), len(others), len(nodes))
    for row, one in zip(found, some, strict=True):
        for weights, other in zip(row, others, strict=True):
            expected = hat_weights(one.multiply(other), nodes)
            np.testing.assert_allclose(weights, expected, rtol=1e-11, atol=1e-20)


def test_pairs_of_none_and_pairs_that_cannot_be() -> None:
    nodes = [START, STOP]
    assert pair_weights([], [Spectrum.flat(1)], nodes).shape == (0, 1, 2)
    assert pair_weights([Spectrum.flat(1)], [], nodes).shape == (1, 0, 2)
    with pytest.raises(ValueError, match="lines stand first"):
        pair_weights([Spectrum.flat(1)], [Spectrum.line(500e-9)], nodes)
    with pytest.raises(ValueError, match="380-780 nm is needed"):
        pair_weights([Spectrum.flat(1), Spectrum.from_samples([4e-7, 5e-7], [1, 1])], [], nodes)


def test_no_result_depends_on_the_grid_of_a_fluorescent_lamp() -> None:
    lamp = spectra.illuminant("FL2")
    whole = integral(lamp, START, STOP)
    for step in (3, 7, 10, 37):
        nodes = np.append(np.arange(380, 780, step), 780) / 1e9
        assert hat_weights(lamp, nodes).sum() == pytest.approx(whole, rel=1e-13)
    coarse = np.arange(380, 781, 10) / 1e9
    trapezoid = np.trapezoid(lamp.evaluate(coarse), coarse)
    assert abs(trapezoid / whole - 1) > 0.005, "a grid would have been visibly wrong"


def test_lines_are_summed_as_lines() -> None:
    laser = Spectrum(lines=((650e-9, 1.0), (450e-9, 2.0), (900e-9, 50.0)))
    assert integral(laser, START, STOP) == 3.0
    assert integral(laser.scale_by(2), START, STOP) == 6.0
    glass = Spectrum.from_samples([400e-9, 1000e-9], [0.0, 0.6])
    seen = glass.multiply(laser)
    np.testing.assert_allclose(
        seen.lines or (), [(450e-9, 0.1), (650e-9, 0.25), (900e-9, 25.0)], rtol=1e-12
    )
    assert (laser.evaluate(np.array([450e-9, 500e-9])) == 0).all()
    weights = hat_weights(laser, np.array([380e-9, 480e-9, 780e-9]))
    expected = [2 * 0.3, 2 * 0.7 + 130 / 300, 170 / 300]
    np.testing.assert_allclose(weights, expected, rtol=1e-12)
    with pytest.raises(ValueError, match="lines"):
        laser.multiply(laser)
    with pytest.raises(ValueError, match="needed"):
        laser.multiply(Spectrum.from_samples([400e-9, 700e-9], [1, 1]))


def test_lines_at_the_ends_of_the_range_count() -> None:
    """380 nm may arrive as 380 * 1e-9, a rounding error away from 3.8e-7."""
    for wavelength in (380 * (1 + 1e-15) * NM, 380e-9, 780e-9, 780 * (1 + 1e-15) * NM):
        assert integral(Spectrum.line(wavelength), START, STOP) == 1.0
        assert hat_weights(Spectrum.line(wavelength), [START, 500e-9, STOP]).sum() == 1.0


def test_outside_says_what_holds_outside() -> None:
    wavelength, value = np.array([400e-9, 700e-9]), np.array([1.0, 2.0])
    asked = np.array([390e-9, 400e-9, 550e-9, 700e-9, 710e-9])
    hold = Spectrum.from_samples(wavelength, value, "hold")
    zero = Spectrum.from_samples(wavelength, value, "zero")
    strict = Spectrum.from_samples(wavelength, value)
    np.testing.assert_allclose(hold.evaluate(asked), [1, 1, 1.5, 2, 2])
    np.testing.assert_allclose(zero.evaluate(asked), [0, 1, 1.5, 2, 0])
    assert hold.covers(START, STOP)
    assert zero.covers(START, STOP)
    assert not strict.covers(START, STOP)
    assert strict.covers(400e-9 * (1 - 1e-12), 700e-9)
    assert integral(zero, START, STOP) == pytest.approx(450e-9, rel=1e-12)
    assert integral(hold, START, STOP) == pytest.approx((20 + 450 + 160) * NM, rel=1e-12)


@pytest.mark.parametrize(
    "use",
    [
        lambda s: s.evaluate(np.array([390e-9])),
        lambda s: integral(s, START, STOP),
        lambda s: hat_weights(s, [START, STOP]),
        lambda s: quadrature([Spectrum.flat(1), s], START, STOP),
        lambda s: spectra.luminance(s, START, STOP),
        lambda s: s.require(START, STOP),
    ],
)
def test_what_is_not_covered_is_an_error(use) -> None:
    with pytest.raises(ValueError, match=r"covers 400-700 nm, but .* nm is needed") as caught:
        use(Spectrum.from_samples([400e-9, 700e-9], [1.0, 1.0]))
    assert "outside: hold" in str(caught.value)


@pytest.mark.parametrize(
    ("wavelength", "value", "message"),
    [
        ([500e-9, 400e-9], [1, 1], "400 nm follows 500 nm"),
        ([500e-9, 500e-9], [1, 1], "rise"),
        ([400e-9, 500e-9], [1], "as many values"),
        ([], [], "at least one"),
        ([400e-9, math.inf], [1, 1], "finite"),
        ([400e-9, 500e-9], [1, math.nan], "finite"),
        ([-1e-9, 500e-9], [1, 1], "negative"),
    ],
)
def test_broken_tables_are_refused(wavelength: list, value: list, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Table(np.array(wavelength), np.array(value))


def test_other_broken_values_are_refused() -> None:
    with pytest.raises(ValueError, match="outside"):
        Table(np.array([1e-9]), np.array([1.0]), "nothing")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="finite"):
        Spectrum.flat(math.nan)
    with pytest.raises(ValueError, match="positive wavelengths"):
        Spectrum.line(-5e-9)
    with pytest.raises(ValueError, match="lines or tables"):
        Spectrum(tables=spectra.cmf(), lines=((5e-7, 1.0),))
    with pytest.raises(ValueError, match="rising range"):
        integral(Spectrum.flat(1), STOP, START)
    with pytest.raises(ValueError, match="rising wavelengths"):
        hat_weights(Spectrum.flat(1), [START])


def test_values_are_frozen_and_compare() -> None:
    wavelength = np.array([400e-9, 700e-9])
    one, two = (Spectrum.from_samples(wavelength, [1.0, 2.0]) for _ in range(2))
    wavelength[0] = 1.0
    assert one.tables[0].start == 400e-9, "a table must not follow the array it was made of"
    assert one == two
    assert hash(one) == hash(two)
    assert one != two.scale_by(2)
    with pytest.raises(ValueError, match="read-only"):
        one.tables[0].value[0] = 5.0


def test_knots_of_a_product() -> None:
    a = Spectrum.from_samples(np.array([300, 500, 900]) * NM, [1, 2, 3])
    b = Spectrum.from_samples(np.array([300, 500 * (1 + 1e-14), 600, 780]) * NM, [1, 2, 3, 4])
    np.testing.assert_allclose(
        a.multiply(b).knots(START, STOP), np.array([380, 500, 600, 780]) * NM
    )


@pytest.mark.parametrize(("temperature", "error"), [(2000, 3e-5), (2856, 1e-5), (6500, 1e-5)])
def test_blackbody_is_planck(temperature: float, error: float) -> None:
    wavelength = np.linspace(START, STOP, 4001)

    def planck(wl):
        x = spectra.PLANCK * spectra.SPEED_OF_LIGHT / (wl * spectra.BOLTZMANN * temperature)
        return wl**-5 / np.expm1(x)

    lamp = Spectrum.blackbody(temperature)
    np.testing.assert_allclose(
        lamp.evaluate(wavelength), planck(wavelength) / planck(560e-9), rtol=error
    )


def test_blackbody_of_2848_kelvin_is_illuminant_a() -> None:
    """CIE defines A by Planck's law at 2848 K with c2 = 14350 um K, tabulated to 6 digits."""
    c2 = spectra.PLANCK * spectra.SPEED_OF_LIGHT / spectra.BOLTZMANN
    wavelength = np.arange(380, 781, 5) * NM
    lamp = Spectrum.blackbody(2848 * c2 / 14350e-6)
    ratio = lamp.evaluate(wavelength) / spectra.illuminant("A").evaluate(wavelength)
    np.testing.assert_allclose(ratio * 100, 1, rtol=2e-5)


@pytest.mark.parametrize("temperature", [99.0, 0.0, -5.0, math.inf, math.nan])
def test_blackbody_refuses_what_does_not_glow(temperature: float) -> None:
    with pytest.raises(ValueError, match="100 K or more"):
        Spectrum.blackbody(temperature)


def test_blackbody_is_finite_at_both_ends() -> None:
    for temperature in (100.0, 1e12):
        assert np.isfinite(Spectrum.blackbody(temperature).tables[0].value).all()


def test_luminance_of_the_definition_of_the_candela() -> None:
    """1 W/sr at 555 nm, where V is 1, is 683 cd; equal energy: 683 x the sum of V, 106.857 nm."""
    assert spectra.luminance(Spectrum.line(555e-9), START, STOP) == pytest.approx(683)
    flat = spectra.luminance(Spectrum.flat(1.0), 360e-9, 830e-9)
    assert flat == pytest.approx(683 * 106.857e-9, rel=1e-5)


def test_photons_of_a_line() -> None:
    (wavelength, rate), *_ = spectra.photons(Spectrum.line(555e-9)).lines or ()
    assert wavelength == 555e-9
    assert rate == pytest.approx(555e-9 / (6.62607015e-34 * 299792458), rel=1e-14)


def test_illuminants_by_name() -> None:
    assert set(spectra.illuminant_names()) >= {"D50", "D55", "D65", "D75", "A", "C", "E", "FL12"}
    for name in spectra.illuminant_names():
        assert integral(spectra.illuminant(name), START, STOP) > 0
    assert spectra.illuminant("F2") == spectra.illuminant("FL2")
    assert spectra.illuminant("equal-energy") == spectra.illuminant("E") == Spectrum.flat(100)
    assert spectra.illuminant("D65").evaluate(560e-9) == 100
    assert spectra.illuminant("FL2").evaluate(900e-9) == 0, "a lamp is zero outside its table"


def test_illuminants_that_do_not_ship_come_from_colour_science() -> None:
    lamp = spectra.illuminant("HP1")
    assert integral(lamp, START, STOP) > 0


@pytest.mark.parametrize(("name", "near"), [("d65", "D65"), ("D 65", "D65"), ("FL22", "FL2")])
def test_an_unknown_illuminant_names_the_nearest(name: str, near: str) -> None:
    with pytest.raises(ValueError, match=f"did you mean '{near}'"):
        spectra.illuminant(name)


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "x.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_reads_csv(tmp_path: Path) -> None:
    text = "\ufeff# a lamp\n#\n\nwavelength_nm, value\r\n380, 0.5\n# inside\n780.5,1e-3\n"
    table = spectra.read_spectrum(write(tmp_path, text), "hold")
    assert table == Table(np.array([380e-9, 780.5e-9]), np.array([0.5, 1e-3]), "hold")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        ("380,0.5,0.6\n780,0.5,0.6\n", "has 2 columns of values (2, 3); write which"),
        ("nm,R,G\n380,0.5,0.2\n", "has 2 columns of values (R, G); write which"),
        ("x,y\n38,1\n78,1\n", "write unit: nm, or unit: um"),
        ("a note\nnm,value\nlow,high\n", "x.csv:2: 'nm,value' is not a row of numbers"),
        ("wavelength_nm,value\n", "no rows"),
        ("wavelength_nm,value\n380,0.5,1\n", "x.csv:2: has 3 columns"),
        ("wavelength_nm,value\n380,0.5\n390,half\n", "x.csv:3: '390,half'"),
        ("wavelength_nm,value\n380,nan\n", "not finite"),
        ("wavelength_nm,value\n380,inf\n", "not finite"),
        ("wavelength_nm,value\n380,-0.1\n", "-0.1 at 380 nm"),
        ("wavelength_nm,value\n0,0.1\n", "positive"),
        ("wavelength_nm,value\n390,1\n380,1\n385,1\n", "380 nm follows 390 nm"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe\x00", "not a text file"),
    ],
)
def test_broken_csv_is_refused_with_its_place(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(ValueError, match=r"x\.csv") as caught:
        spectra.read_spectrum(write(tmp_path, text))
    assert message in str(caught.value)
