"""Quantities: text with a unit <-> float in SI.

`parse("6.5 um", "length")` is 6.5e-6 and `render(6.5e-6, "length")` is "6.5 um". A quantity
is a number or a quotient of two ("1/60 s"), then a unit of the requested dimension;
a bare number, NaN, infinity or another dimension's unit is a ValueError whose text is meant
for the user.

Why a grammar of our own: it is strict (one dimension is expected, nothing is guessed) and
exact. Arithmetic is rational, so "6.5 um" is the double nearest to 6.5e-6 and rendering
can promise `parse(render(x)) == x` bit for bit.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import field
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from types import MappingProxyType

from vcam_cli.records import dataclass

_NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?"
_QUANTITY = re.compile(rf"([+-]?{_NUMBER})(?:\s*/\s*({_NUMBER}))?\s*(.*)", re.ASCII | re.DOTALL)
_LONGEST = 80  # characters; keeps rational arithmetic small
_LARGEST = 10**200  # in any unit it is a double
_PI = Fraction("3.14159265358979323846264338327950288419716939937510")
_PREFIXES = {
    "a": -18, "f": -15, "p": -12, "n": -9, "u": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9,
}  # fmt: skip
_SPELLINGS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "³": "3", "°": "deg", "Ω": "ohm"})


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its SI unit inside, its accepted units, and how it is shown."""

    name: str
    title: str
    """The name with its article: "a length"."""
    si: str
    """SI unit in which values are kept."""
    units: Mapping[str, Fraction]
    """Size of every accepted unit in SI."""
    shown: tuple[str, ...]
    """Units that `render` chooses from, rising: powers of ten except where `render` checks."""
    example: str
    """A value that a user might write."""
    offsets: Mapping[str, Fraction] = field(default_factory=dict)
    """Numbers added before the unit's size is applied (degC)."""
    words: Mapping[str, float] = field(default_factory=dict)
    """Values that are written as words (infinity)."""

    @property
    def pattern(self) -> str:
        """A regular expression (JSON Schema dialect) of everything `parse` may accept."""
        names = sorted(self.units, key=lambda unit: (-len(unit), unit))
        units = "|".join(map(_spellings, names))
        words = "".join(f"|{word}" for word in self.words)
        return rf"^\s*([+-]?{_NUMBER}(\s*/\s*{_NUMBER})?\s*({units}){words})\s*$"


def parse(text: object, dimension: str) -> float:
    """Return the quantity `text` in the SI unit of `dimension` (a key of `DIMENSIONS`).

    Raises ValueError, with a sentence that names the dimension and gives an example.

    >>> parse("6.5 um", "length")
    6.5e-06
    >>> parse("1/60 s", "time") == 1 / 60
    True
    >>> parse(30, "time")
    Traceback (most recent call last):
    ValueError: 30 is a bare number; a time needs its unit, for example 30 ms
    """
    kind = DIMENSIONS[dimension]
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        if not math.isfinite(text):
            raise ValueError(f"{text} is not {kind.title}; write for example {kind.example}")
        raise ValueError(f"{text} is a bare number; {_needs(kind)}")
    if not isinstance(text, str):
        raise ValueError(f"{kind.title} is a number with its unit, for example {kind.example}")
    return _parse(text, dimension)


@lru_cache(maxsize=4096)  # sweeps read the same texts for every point
def _parse(text: str, dimension: str) -> float:
    kind = DIMENSIONS[dimension]
    plain = " ".join(text.translate(_SPELLINGS).split())
    if plain in kind.words:
        return kind.words[plain]
    if len(plain) > _LONGEST:
        raise ValueError(f"{text[:20]!r}... is too long; {_needs(kind)}")
    match = _QUANTITY.fullmatch(plain)
    if match is None:
        raise ValueError(f"{text!r} does not begin with a number; {_needs(kind)}")
    number, divisor, unit = match.groups()
    size = _unit_size(kind, text, unit)
    return _value(kind, text, Fraction(number), divisor, kind.offsets.get(unit), size)


def parse_fraction(value: object) -> float:
    """Return a dimensionless number, bare (0.05) or in percent ("5 %"). Raises ValueError."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite; write a finite number, for example 0.05")
        return float(value)
    match = _QUANTITY.fullmatch(value.strip()) if isinstance(value, str) else None
    if match is None or len(str(value)) > _LONGEST:
        raise ValueError(f"{_brief(value)} is not a number; write for example 0.05 or 5 %")
    number, divisor, unit = match.groups()
    if unit not in ("", "%"):
        raise ValueError(f"{value!r} has the unit {unit!r}; write a bare number, or 5 %")
    return _value(_FRACTION, str(value), Fraction(number), divisor, None, _FRACTION.units[unit])


def split(text: object) -> tuple[Fraction, str]:
    """Return a quantity of any dimension as its number and its unit: "1/60 s" is (1/60, "s").

    A bare number has the unit "". Raises ValueError for what is no number with a unit.
    """
    if isinstance(text, (int, float)) and not isinstance(text, bool) and math.isfinite(text):
        return Fraction(repr(text)), ""
    plain = " ".join(text.translate(_SPELLINGS).split()) if isinstance(text, str) else ""
    match = _QUANTITY.fullmatch(plain)
    if match is None or len(plain) > _LONGEST:
        raise ValueError(f"{_brief(text)} is not a number with its unit; write for example 5.3 um")
    number, divisor, unit = match.groups()
    if divisor is not None and Fraction(divisor) == 0:
        raise ValueError(f"{text!r} divides by zero; write for example 5.3 um")
    value = Fraction(number) / Fraction(divisor or 1)
    if abs(value) > _LARGEST:
        raise ValueError(f"{text!r} is too large; write for example 5.3 um")
    return value, unit


def convert(number: Fraction, unit: str, other: str) -> Fraction:
    """Return a number of one unit in another one of the same dimension.

    Raises ValueError for units of two dimensions, and for those whose zeros differ (degC and K).
    """
    if unit == other:
        return number
    for kind in (*DIMENSIONS.values(), _FRACTION):
        a, b = kind.units.get(unit.replace("^", "")), kind.units.get(other.replace("^", ""))
        if a is not None and b is not None and not {unit, other} & kind.offsets.keys():
            return number * a / b
    units = f"{unit or 'a bare number'} and {other or 'a bare number'}"
    raise ValueError(f"{units} do not go together; write all of them in one unit")


@lru_cache(maxsize=4096)
def render(value: float, dimension: str) -> str:
    """Return the shortest text with `parse(text, dimension) == value`, in a readable unit."""
    kind = DIMENSIONS[dimension]
    value = float(value)
    for word, meaning in kind.words.items():
        if value == meaning:
            return word
    if not math.isfinite(value):
        raise ValueError(f"{value} is not {kind.title}")
    exact = Decimal(repr(value))
    unit = kind.shown[0] if value else kind.example.partition(" ")[2]
    for larger in kind.shown[1:]:
        if abs(value) >= kind.units[larger]:
            unit = larger
    size = kind.units[unit]
    if size.numerator == 1 or size.denominator == 1:
        return f"{decimal(exact * size.denominator / size.numerator)} {unit}"
    rounded = f"{float(Fraction(value) / size):.15g}"  # deg: exact where a short number is
    if abs(float(rounded)) < 1e6 and parse(f"{rounded} {unit}", dimension) == value:
        return f"{decimal(Decimal(rounded))} {unit}"
    return f"{decimal(exact)} {kind.si}"


def _spellings(unit: str) -> str:
    """Return a regular expression of the ways to write `unit`: um, µm; m2, m^2, m²."""
    unit = re.sub(r"([()])", r"\\\1", unit).replace("u", "[uµμ]").replace("deg", "(deg|°)")
    unit = unit.replace("V0.5", "V\\^?0[.]5")
    return re.sub(r"(?<=m)2", "\\^?[2²]", re.sub(r"(?<=m)3", "\\^?[3³]", unit))


def _needs(kind: Dimension) -> str:
    return f"{kind.title} needs its unit, for example {kind.example}"


def _unit_size(kind: Dimension, text: str, unit: str) -> Fraction:
    """Return the size of `unit` in SI, or raise a ValueError that says which units there are."""
    key = unit.replace("^", "")
    if key in kind.units:
        return kind.units[key]
    if not unit:
        raise ValueError(f"{text!r} has no unit; {_needs(kind)}")
    if "," in unit:
        raise ValueError(f"{text!r} has a comma; write a decimal point, for example {kind.example}")
    for allowed in kind.units:
        if allowed.lower() == key.lower():
            raise ValueError(f"{text!r}: there is no unit {unit!r}; did you mean {allowed}?")
    spelled = _SPELLED.get(key, "")
    if spelled in kind.units:
        raise ValueError(f"{text!r}: there is no unit {unit!r}; did you mean {spelled}?")
    others = [other.title for other in DIMENSIONS.values() if key in other.units]
    units = ", ".join(list(kind.units)[:10])
    said = f"is {others[0]}, not {kind.title}" if others else f": unknown unit {unit!r}"
    raise ValueError(
        f"{text!r}{' ' if others else ''}{said}; {kind.title} is given in {units}, "
        f"for example {kind.example}"
    )


_SPELLED = {
    "lux": "lx", "nit": "cd/m2", "nits": "cd/m2", "micron": "um", "microns": "um", "mu": "um",
    "sec": "s", "second": "s", "seconds": "s", "msec": "ms", "usec": "us", "C": "degC",
    "°C": "degC", "Kelvin": "K", "kelvin": "K", "inch": "in", "inches": "in",
    "electrons": "e", "electron": "e",
    "e-": "e", "ke-": "ke", "e-/s": "e/s", "electrons/s": "e/s", "uV/e-": "uV/e", "DN/e-": "DN/e",
    "degree": "deg", "degrees": "deg", "cycles/millimeter": "cycles/mm", "LSB": "DN", "ADU": "DN",
}  # fmt: skip
"""Units as they are also written -> their names here."""


def _value(
    kind: Dimension,
    text: str,
    number: Fraction,
    divisor: str | None,
    offset: Fraction | None,
    size: Fraction,
) -> float:
    """Return number / divisor in SI as the nearest double; ValueError without one."""
    if divisor is not None:
        if Fraction(divisor) == 0:
            raise ValueError(f"{text!r} divides by zero; write for example {kind.example}")
        number /= Fraction(divisor)
    exact = (number + (offset or 0)) * size
    try:
        value = float(exact)
    except OverflowError:
        value = math.inf
    if math.isinf(value) or (value == 0 and exact != 0):
        raise ValueError(f"{text!r} is out of range; write for example {kind.example}")
    return value


def decimal(number: Decimal) -> str:
    """Return the shortest spelling of a decimal number."""
    if number == 0:
        return "0"
    digits = number.normalize()
    plain = format(digits, "f")
    short = len(plain) <= 20 and abs(digits.adjusted()) <= 8
    return plain if short else f"{digits:e}".replace("e+", "e")


def _prefixed_units(
    unit: str, prefixes: str, power: int = 1, scale: int = 0
) -> dict[str, Fraction]:
    """{"um": 1e-6, ...}: `unit` with every prefix ("-": no prefix), to a power."""
    names = ["" if letter == "-" else letter for letter in prefixes]
    return {p + unit: Fraction(10) ** (_PREFIXES[p] * power + scale) for p in names}


def _per(top: dict[str, Fraction], bottom: dict[str, Fraction]) -> dict[str, Fraction]:
    """All quotients "top/bottom"."""
    return {f"{t}/{b}": ts / bs for t, ts in top.items() for b, bs in bottom.items()}


def _dimensions() -> dict[str, Dimension]:
    length = _prefixed_units("m", "num-pk") | {"cm": Fraction(1, 100), "in": Fraction(254, 10000)}
    time = _prefixed_units("s", "-munp") | {"min": Fraction(60)}
    area = {"cm2": Fraction(1, 10**4), "m2": Fraction(1), "mm2": Fraction(1, 10**6)}
    area["um2"] = Fraction(1, 10**12)
    cm_or_m = {"cm": Fraction(1, 100), "m": Fraction(1)}
    volume = {"cm3": Fraction(1, 10**6), "m3": Fraction(1), "um3": Fraction(1, 10**18)}
    current = _prefixed_units("A", "fpnum-a")
    farad = _prefixed_units("F", "fpanum-")
    electrons = _prefixed_units("e", "-kM")
    pairs = {"lp/mm": 1000, "cycles/mm": 1000, "c/mm": 1000, "lp/m": 1, "cycles/m": 1, "lp/cm": 100}
    watts = _prefixed_units("W", "-mu")
    forms = ("{}/(sr m2)", "{}/(m2 sr)", "{}/sr/m2", "{}/m2/sr")
    radiance = {form.format(w): Fraction(size) for form in forms for w, size in watts.items()}
    per_volume = {f"{one}/{v}": 1 / s for v, s in volume.items() for one in ("1", "")}
    per_volume |= {"cm-3": Fraction(10**6), "m-3": Fraction(1)}
    angle = {"deg": _PI / 180, "rad": Fraction(1), "mrad": Fraction(1, 1000)}
    kelvin = {"K": Fraction(1), "degC": Fraction(1)}
    lengths = ("nm", "um", "mm", "m")
    far = {"infinity": math.inf}
    table = [
        Dimension("length", "a length", "m", length, lengths, "6.5 um"),
        Dimension("distance", "a distance", "m", length, (*lengths, "km"), "1 m", words=far),
        Dimension("time", "a time", "s", time, ("ns", "us", "ms", "s"), "30 ms"),
        Dimension("speed", "a speed", "m/s",
                  _per(length, {"s": Fraction(1)}) | {"km/h": Fraction(10, 36)},
                  ("m/s",), "0.5 m/s"),
        Dimension("turning_speed", "a turning speed", "rad/s",
                  {f"{name}/s": size for name, size in angle.items()}, ("deg/s",), "10 deg/s"),
        Dimension("frequency", "a frequency", "Hz", _prefixed_units("Hz", "-kM"),
                  ("Hz", "kHz", "MHz"), "100 Hz"),
        Dimension("voltage", "a voltage", "V", _prefixed_units("V", "-munk"), ("uV", "mV", "V"),
                  "1.38 V"),
        Dimension("capacitance", "a capacitance", "F", farad, ("aF", "fF", "pF", "nF"), "12 fF"),
        Dimension("temperature", "a temperature", "K", kelvin, ("K",), "300 K",
                  offsets={"degC": Fraction("273.15")}),
        Dimension("angle", "an angle", "rad", angle, ("deg",), "45 deg"),
        Dimension("charge", "a charge in electrons", "e", electrons, ("e", "ke", "Me"), "5 e"),
        Dimension("rate", "a rate in electrons per second", "e/s",
                  _per(electrons, {"s": Fraction(1), "ms": Fraction(1, 1000)}),
                  ("e/s", "ke/s", "Me/s"), "12 e/s"),
        Dimension("current_density", "a current density", "A/m2", _per(current, area),
                  ("pA/cm2", "nA/cm2", "uA/cm2", "mA/cm2", "A/cm2"), "1 nA/cm2"),
        Dimension("linear_current_density", "a current per length", "A/m", _per(current, cm_or_m),
                  ("pA/cm", "nA/cm", "uA/cm"), "0.437 pA/cm"),
        Dimension("current", "a current", "A", current, ("fA", "pA", "nA", "uA", "mA"), "5 fA"),
        Dimension("luminance", "a luminance", "cd/m2",
                  _per(_prefixed_units("cd", "-mk"), {"m2": Fraction(1)}),
                  ("mcd/m2", "cd/m2", "kcd/m2"), "100 cd/m2"),
        Dimension("radiance", "a radiance", "W/(sr m2)", radiance,
                  ("W/(sr m2)",), "0.4 W/(sr m2)"),
        Dimension("irradiance", "an irradiance", "W/m2",
                  _per(watts, {unit: area[unit] for unit in ("cm2", "m2")}),
                  ("W/m2",), "0.12 W/m2"),
        Dimension("illuminance", "an illuminance", "lx", _prefixed_units("lx", "-mk"),
                  ("mlx", "lx", "klx"), "300 lx"),
        Dimension("spatial_frequency", "a spatial frequency", "cycles/m",
                  {name: Fraction(size) for name, size in pairs.items()}, ("lp/mm",), "33 lp/mm"),
        Dimension("conversion_gain", "a conversion gain", "V/e",
                  _per(_prefixed_units("V", "umn-"), {"e": Fraction(1)}),
                  ("nV/e", "uV/e", "mV/e", "V/e"), "20 uV/e"),
        Dimension("exposure_value", "an exposure value", "EV", {"EV": Fraction(1)}, ("EV",),
                  "1 EV"),
        Dimension("adc_gain", "an ADC gain", "DN/e",
                  {"DN/e": Fraction(1), "DN/ke": Fraction(1, 1000)}, ("DN/e",), "0.25 DN/e"),
        Dimension("pixels", "a length in pixels", "px", {"px": Fraction(1)}, ("px",), "1 px"),
        Dimension("dn", "a number of DN", "DN", {"DN": Fraction(1)}, ("DN",), "64 DN"),
        Dimension("capacitance_per_area", "a capacitance per area", "F/m2", _per(farad, area),
                  ("fF/um2", "pF/um2"), "0.906 fF/um2"),
        Dimension("capacitance_per_length", "a capacitance per length", "F/m",
                  _per(farad, {"um": Fraction(1, 10**6)} | cm_or_m), ("fF/um", "pF/um"),
                  "0.297 fF/um"),
        Dimension("concentration", "a concentration", "1/m3", per_volume, ("1/cm3",), "1e15 1/cm3"),
        Dimension("body_effect", "a body-effect coefficient", "sqrt(V)",
                  {"sqrt(V)": Fraction(1), "V0.5": Fraction(1)}, ("sqrt(V)",), "0.5 sqrt(V)"),
        Dimension("diffusivity", "a diffusivity", "m2/s", _per(area, {"s": Fraction(1)}),
                  ("cm2/s",), "12 cm2/s"),
    ]  # fmt: skip
    return {dimension.name: dimension for dimension in table}


_FRACTION = Dimension(
    "fraction", "a number", "", {"": Fraction(1), "%": Fraction(1, 100)}, ("",), "0.05 or 5 %"
)
DIMENSIONS: Mapping[str, Dimension] = MappingProxyType(_dimensions())


def _brief(given: object) -> str:
    """Return what was given, for a message: its beginning where it is long."""
    text = repr(given)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]}..."
