"""Quantities: exact values, refusals that help, and an outside judge (pint)."""

import math
import re

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.units import DIMENSIONS, parse, parse_fraction, render

EXACT = [
    # text, dimension, SI value as Python reads it: equality is meant, the arithmetic is rational
    ("6.5 um", "length", 6.5e-6),
    ("6.5um", "length", 6.5e-6),
    ("6.5 µm", "length", 6.5e-6),
    ("6.5 μm", "length", 6.5e-6),
    (" 6.5   um ", "length", 6.5e-6),
    ("18 in", "length", 0.4572),
    ("-1 mm", "length", -1e-3),
    (".5 m", "length", 0.5),
    ("5. m", "length", 5.0),
    ("infinity", "distance", math.inf),
    ("2 km", "distance", 2000.0),
    ("30 ms", "time", 0.03),
    ("1/60 s", "time", 1 / 60),
    ("1 / 60 s", "time", 1 / 60),
    ("1.38 V", "voltage", 1.38),
    ("20 fF", "capacitance", 20e-15),
    ("300 K", "temperature", 300.0),
    ("25 degC", "temperature", 298.15),
    ("-40 °C", "temperature", 233.15),
    ("180 deg", "angle", math.pi),
    ("90°", "angle", math.pi / 2),
    ("10 mrad", "angle", 0.01),
    ("5 e", "charge", 5.0),
    ("5e", "charge", 5.0),
    ("5e3 e", "charge", 5000.0),
    ("20 ke", "charge", 20000.0),
    ("12 e/s", "rate", 12.0),
    ("1 nA/cm2", "current_density", 1e-5),
    ("1 nA/cm^2", "current_density", 1e-5),
    ("1 nA/cm²", "current_density", 1e-5),
    ("0.437 pA/cm", "linear_current_density", 0.437e-10),
    ("5 fA", "current", 5e-15),
    ("100 cd/m2", "luminance", 100.0),
    ("0.4 W/(sr m2)", "radiance", 0.4),
    ("0.4 W/sr/m2", "radiance", 0.4),
    ("2 klx", "illuminance", 2000.0),
    ("33 lp/mm", "spatial_frequency", 33000.0),
    ("33 cycles/mm", "spatial_frequency", 33000.0),
    ("20 uV/e", "conversion_gain", 20e-6),
    ("0.25 DN/e", "adc_gain", 0.25),
    ("64 DN", "dn", 64.0),
    ("0.906 fF/um2", "capacitance_per_area", 0.906e-3),
    ("0.297 fF/um", "capacitance_per_length", 0.297e-9),
    ("1e15 1/cm3", "concentration", 1e21),
    ("1e15/cm3", "concentration", 1e21),
    ("1e15 cm-3", "concentration", 1e21),
    ("12 cm2/s", "diffusivity", 12e-4),
]


def test_a_quantity_is_the_nearest_double():
    for text, dimension, value in EXACT:
        assert parse(text, dimension) == value, text


def test_the_schema_pattern_accepts_what_parse_accepts():
    for text, dimension, _ in EXACT:
        assert re.search(DIMENSIONS[dimension].pattern, text), text


REFUSED = [
    (6.5, "length", "6.5 is a bare number; a length needs its unit, for example 6.5 um"),
    (0, "length", "bare number"),
    ("6.5", "length", "no unit; a length needs its unit, for example 6.5 um"),
    ("um", "length", "does not begin with a number"),
    ("", "length", "does not begin with a number"),
    ("6.5 ms", "length", "is a time, not a length"),
    ("6.5 furlong", "length", "unknown unit 'furlong'"),
    ("6.5 UM", "length", "did you mean um?"),
    ("6,5 um", "length", "decimal point"),
    ("nan m", "length", "does not begin with a number"),
    ("inf m", "length", "does not begin with a number"),
    (math.nan, "length", "nan is not a length"),
    (math.inf, "distance", "inf is not a distance"),
    ("infinity", "length", "does not begin with a number"),
    ("1e999 m", "length", "out of range"),
    ("1e-999 m", "length", "out of range"),
    ("1e9999999999 m", "length", "unknown unit"),
    ("1/0 s", "time", "divides by zero"),
    ("1 m m", "length", "unknown unit"),
    ("１ m", "length", "does not begin with a number"),  # a full-width digit
    ("9" * 1000 + " m", "length", "too long"),
    (True, "length", "a length is a number with its unit"),
    (None, "time", "a time is a number with its unit, for example 30 ms"),
    ([1], "time", "a time is a number"),
    ({"a": 1}, "time", "a time is a number"),
    ("300 C", "temperature", "no unit 'C'; did you mean degC"),
]


def refusal(text: object, dimension: str) -> str:
    """What is said of a quantity that is refused; nothing of one that is accepted."""
    try:
        parse(text, dimension)
    except ValueError as error:
        return str(error)
    return ""


def test_a_refusal_says_what_is_wrong_and_gives_an_example():
    for text, dimension, said in REFUSED:
        message = refusal(text, dimension)
        assert said in message, (text, dimension)
        assert len(message) < 300, text
        assert DIMENSIONS[dimension].example in message or "did you mean" in message, text


@pytest.mark.parametrize("dimension", DIMENSIONS)
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_rendering_is_exact(dimension, value):
    # Below 1e-290 a value in SI may leave the doubles on its way through the unit.
    if 0 < abs(value) < 1e-290 or abs(value) > 1e290:
        value = 0.1
    assert parse(render(value, dimension), dimension) == value


def test_every_example_and_unit_is_valid():
    for dimension, kind in DIMENSIONS.items():
        assert render(parse(kind.example, dimension), dimension) == kind.example
        for unit in kind.units:
            assert math.isfinite(parse(f"1 {unit}", dimension)), (dimension, unit)
            assert re.search(kind.pattern, f"1 {unit}"), (dimension, unit)


@pytest.mark.parametrize(
    ("value", "dimension", "text"),
    [
        (6.5e-6, "length", "6.5 um"),
        (550e-9, "length", "550 nm"),
        (0.0, "length", "0 um"),
        (1.0, "length", "1 m"),
        (0.03, "time", "30 ms"),
        (-2e-3, "length", "-2 mm"),
        (math.inf, "distance", "infinity"),
        (69000.0, "charge", "69 ke"),
        (math.pi / 4, "angle", "45 deg"),
        (298.15, "temperature", "298.15 K"),
    ],
)
def test_rendering_is_readable(value, dimension, text):
    assert render(value, dimension) == text


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_quantity_is_not_rendered(value):
    with pytest.raises(ValueError, match="is not a length"):
        render(value, "length")


def in_pint(unit: str) -> str:
    """Our spelling of a unit in pint's."""
    if unit in ("cm-3", "m-3"):
        return f"1/{unit[:-2]}**3"
    text = re.sub(r"(?<=m)([23])", r"**\1", unit)
    text = text.replace("(sr ", "(sr*").replace(" sr)", "*sr)")
    text = re.sub(r"sqrt\(V\)|V0\.5", "V**0.5", text)
    text = text.replace("cycles/", "1/").replace("mcd", "millicandela")
    return f"1{text}" if text.startswith("/") else text


OURS_ALONE = {"charge", "rate", "conversion_gain", "adc_gain", "dn"}  # electrons and DN
IN_PINT = [
    (name, unit)
    for name, kind in DIMENSIONS.items()
    for unit in kind.units
    if name not in OURS_ALONE and not unit.startswith(("lp", "c/")) and unit != "degC"
]


def test_units_agree_with_pint():
    registry = pint.UnitRegistry()
    for name, unit in IN_PINT:
        size = registry(in_pint(unit)) / registry(in_pint(DIMENSIONS[name].si))
        # pint multiplies floats: a few roundings of 1e-16 each
        assert parse(f"1 {unit}", name) == pytest.approx(size.m_as(""), rel=1e-14), unit


@pytest.mark.parametrize(
    ("given_", "value"),
    [(0.5, 0.5), (1, 1.0), ("5 %", 0.05), ("0.5%", 0.005), ("0.3", 0.3), ("1/3", 1 / 3)],
)
def test_fractions(given_, value):
    assert parse_fraction(given_) == value


@pytest.mark.parametrize("given_", [math.nan, math.inf, "", "x", "5 um", "1/0", None, True, [1]])
def test_what_is_no_fraction(given_):
    with pytest.raises(ValueError, match="write"):
        parse_fraction(given_)
