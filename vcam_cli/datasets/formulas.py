"""Formulas of a data set: arithmetic with units over drawn values, such as "20 ms / gain".

A grammar of its own reads them; nothing is evaluated as a program.

    sum     = product {("+" | "-") product}
    product = power {("*" | "/") power}
    power   = ["-"] atom ["^" power]
    atom    = number [unit] | name | function "(" sum {"," sum} ")" | "(" sum ")"

A name is the path of another key, or its last part. Units are carried through every step, so that
a formula that adds seconds to electrons is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import lru_cache
from typing import Any

from vcam_cli import units
from vcam_cli.records import dataclass
from vcam_cli.units import DIMENSIONS

LONGEST, DEEPEST = 400, 20
"""Characters and nested parentheses of a formula, at most: its reader recurses."""
DIGITS = 9
"""Digits of a value that is computed."""
_UNITS = sorted(
    {unit for kind in DIMENSIONS.values() for unit in kind.units if " " not in unit}
    - {unit for kind in DIMENSIONS.values() for unit in kind.offsets}
    | {"K", "%"},
    key=lambda unit: (-len(unit), unit),
)
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3}(?![\w.]))?)"
    rf"(?:\s?(?P<unit>{'|'.join(map(re.escape, _UNITS))})(?![\w.]))?"
    r"|(?P<name>[A-Za-z_][\w.]*)|(?P<mark>[-+*/^(),]))",
    re.ASCII,
)


def _only(number: Callable[..., float]) -> Callable[[Sequence[_Value]], _Value]:
    """Return a function of bare numbers as one of values."""

    def apply(given: Sequence[_Value]) -> _Value:
        if any(value.kinds for value in given):
            raise ValueError(
                "a function of a pure number has an argument with a unit; divide by a unit first"
            )
        values = [value.number for value in given]
        try:
            return _Value(number(*values))
        except ValueError:
            raise ValueError(f"{number.__name__} of {values[0]:g} is no number") from None

    return apply


def _extreme(choose: Callable[..., float]) -> Callable[[Sequence[_Value]], _Value]:
    def apply(given: Sequence[_Value]) -> _Value:
        if any(value.kinds != given[0].kinds for value in given):
            raise ValueError("values of different units are compared")
        return _Value(choose(value.number for value in given), given[0].kinds)

    return apply


@dataclass(frozen=True)
class _Value:
    """A number in SI units, and the powers of the kinds of quantity that it is a product of."""

    number: float
    kinds: Mapping[str, int] = field(default_factory=dict)

    def times(self, other: _Value, sign: int = 1) -> _Value:
        """Return the product; with sign -1 the quotient."""
        names = dict.fromkeys((*self.kinds, *other.kinds))
        powers = {n: self.kinds.get(n, 0) + sign * other.kinds.get(n, 0) for n in names}
        kinds = {name: power for name, power in powers.items() if power}
        number = self.number * other.number if sign > 0 else self.number / other.number
        return _Value(number, kinds)

    def plus(self, other: _Value, sign: int) -> _Value:
        """Return the sum; with sign -1 the difference."""
        if self.kinds != other.kinds:
            raise ValueError(f"{_title(self.kinds)} and {_title(other.kinds)} do not add")
        return _Value(self.number + sign * other.number, self.kinds)

    def power(self, other: _Value) -> _Value:
        """Return the power, of bare numbers or by whole numbers."""
        if other.kinds or (self.kinds and other.number != int(other.number)):
            raise ValueError(
                "an exponent is a number without a unit, and an integer for a base with a unit"
            )
        raised = self.number**other.number
        if isinstance(raised, complex):
            raise ValueError("a negative number has no such power")
        kinds = {name: count * int(other.number) for name, count in self.kinds.items()}
        return _Value(raised, {name: count for name, count in kinds.items() if count})


def _title(kinds: Mapping[str, int]) -> str:
    """Return what a product of kinds of quantity is called in messages."""
    if not kinds:
        return "a bare number"
    if len(kinds) == 1 and [*kinds.values()] == [1]:
        return DIMENSIONS[next(iter(kinds))].title
    return " x ".join(
        DIMENSIONS[name].title.partition(" ")[2] + (f"^{power}" if power != 1 else "")
        for name, power in kinds.items()
    )


FUNCTIONS: Mapping[str, tuple[int, Callable[[Sequence[_Value]], _Value]]] = {
    "sqrt": (1, _only(math.sqrt)),
    "exp": (1, _only(math.exp)),
    "log": (1, _only(math.log)),
    "min": (2, _extreme(min)),
    "max": (2, _extreme(max)),
}
"""Function -> number of its arguments, and what it does; log is the natural logarithm."""


Find = Callable[[str], _Value]
"""What returns the value of a name."""
Term = Callable[[Find], _Value]
"""A part of a formula: what it gives, where names have values."""


@dataclass(frozen=True)
class Formula:
    """A formula that was read."""

    text: str
    names: tuple[str, ...]
    """Names in it that are neither units nor functions."""
    term: Term

    def value(self, known: Mapping[str, Any], factor: float = 1.0) -> Any:
        """Return what it gives, as YAML has it: a number, or text with its unit.

        Parameters
        ----------
        known : mapping
            Name -> value as YAML has it.
        factor : float
            Number by which the result is multiplied.

        Raises
        ------
        ValueError
            Incompatible units, a division by zero, an invalid number.
        """

        def find(name: str) -> _Value:
            number, unit = units.split(known[name])
            return _quantity(float(number), unit)

        try:
            found = self.term(find)
            number = float(f"{found.number * factor:.{DIGITS}g}")
        except ZeroDivisionError:
            raise ValueError(f"{self.text!r} divides by zero") from None
        except OverflowError:
            raise ValueError(f"{self.text!r} is too large") from None
        if not math.isfinite(number):
            raise ValueError(f"{self.text!r} is too large")
        if not found.kinds:
            return number
        if [*found.kinds.values()] != [1]:
            raise ValueError(f"{self.text!r} is {_title(found.kinds)}, which no key takes")
        return units.render(number, next(iter(found.kinds)))


@lru_cache(maxsize=1024)  # read once for all frames
def read_formula(text: str) -> Formula:
    """Return a formula; raise ValueError with a sentence for an invalid text.

    >>> read_formula("20 ms / exposure.gain").value({"exposure.gain": 4})
    '5 ms'
    """
    if not text.strip() or len(text) > LONGEST:
        example = 'write for example {from: "20 ms / exposure.gain"}'
        raise ValueError(f"a formula has 1 to {LONGEST} characters; {example}")
    reader = _Reader(text)
    term = reader.whole()
    return Formula(text, tuple(reader.names), term)


def _quantity(number: float, unit: str) -> _Value:
    """Return a number with its unit, in SI."""
    if not unit:
        return _Value(number)
    if unit == "%":
        return _Value(number / 100)
    for kind in DIMENSIONS.values():
        if unit in kind.units and unit not in kind.offsets:
            return _Value(float(Fraction(number) * kind.units[unit]), {kind.name: 1})
        if unit == "K" and kind.name == "temperature":
            return _Value(number, {kind.name: 1})
    raise ValueError(f"{unit!r} cannot stand in a formula")


class _Reader:
    """Reads a formula from left to right."""

    def __init__(self, text: str) -> None:
        self._tokens = [*_tokens(text)]
        self._text = text
        self._at = self._depth = 0
        self.names: dict[str, None] = {}

    def whole(self) -> Term:
        """Return the term that is the whole formula."""
        term = self._sum()
        if self._at < len(self._tokens):
            raise ValueError(f"{self._text!r}: {self._tokens[self._at][1]!r} is not expected there")
        return term

    def _take(self, *marks: str) -> str:
        """Return the next mark where it is one of some, and go past it; "" elsewhere."""
        if self._at < len(self._tokens) and self._tokens[self._at][1] in marks:
            self._at += 1
            return self._tokens[self._at - 1][1]
        return ""

    def _missing(self, what: str) -> ValueError:
        rest = self._tokens[self._at :]
        where = f"before {rest[0][1]!r}" if rest else "at the end"
        return ValueError(f"{self._text!r}: {what} is missing {where}")

    def _sum(self) -> Term:
        term = self._product()
        while mark := self._take("+", "-"):
            term = _joined(_Value.plus, term, self._product(), 1 if mark == "+" else -1)
        return term

    def _product(self) -> Term:
        term = self._power()
        while mark := self._take("*", "/"):
            term = _joined(_Value.times, term, self._power(), 1 if mark == "*" else -1)
        return term

    def _power(self) -> Term:
        self._depth += 1
        if self._depth > DEEPEST:
            raise ValueError(f"{self._text!r} is nested too deeply")
        negative = self._take("-")
        term = self._atom()
        if self._take("^"):
            term = _joined(_Value.power, term, self._power())
        self._depth -= 1
        return _joined(_Value.times, term, lambda find: _Value(-1.0)) if negative else term

    def _atom(self) -> Term:
        if self._take("("):
            term = self._sum()
            if not self._take(")"):
                raise self._missing("')'")
            return term
        if self._at >= len(self._tokens) or self._tokens[self._at][0] == "mark":
            raise self._missing("a number or a name")
        kind, text, unit = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            value = _quantity(float(text), unit)
            return lambda find: value
        if self._take("("):
            return self._function(text)
        self.names[text] = None
        return lambda find: find(text)

    def _function(self, name: str) -> Term:
        if name not in FUNCTIONS:
            raise ValueError(f"{name!r} is not a function; there are {', '.join(FUNCTIONS)}")
        count, function = FUNCTIONS[name]
        given = [self._sum()]
        while self._take(","):
            given.append(self._sum())
        if not self._take(")"):
            raise self._missing("')'")
        if len(given) != count:
            raise ValueError(f"{name} takes {count} value{'s' * (count > 1)}, not {len(given)}")
        return lambda find: function([term(find) for term in given])


def _joined(join: Callable[..., _Value], left: Term, right: Term, *more: int) -> Term:
    """Return the term of two terms that an operator joins."""
    return lambda find: join(left(find), right(find), *more)


def _tokens(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield kind, text and unit of every token. Raises ValueError for other characters."""
    at, end = 0, len(text.rstrip())
    while at < end:
        found = _TOKEN.match(text, at)
        if found is None:
            raise ValueError(f"{text!r}: {text[at:].strip()[:10]!r} is no number, unit or name")
        kind = str(found.lastgroup if found.lastgroup != "unit" else "number")
        yield kind, found[kind], found["unit"] or ""
        at = found.end()
