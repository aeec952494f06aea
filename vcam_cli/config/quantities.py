"""Types of numbers in a file: quantities with a unit, bare numbers, whole numbers.

A quantity is a string with its unit in YAML ("6.5 um"), an SI float in the model, and a string
again when the model is written (`units.render`, which loses nothing). Where a word may replace
a value ("auto", "none") the type lists it: `Quantity("length", words={"auto": None})`.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import field
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from vcam_cli import units
from vcam_cli.config.validation_messages import describe, one_of, refusal
from vcam_cli.config.yaml_type import DEFINED, YamlType
from vcam_cli.records import dataclass

NO_WORDS: Mapping[str, Any] = MappingProxyType({})
LEAST_SIZE, MOST_SIZE = 1e-45, 1e45
"""Sizes of numbers other than 0, in SI units: what is made of several of them stays a number.

No real quantity comes near. What may be negative is added and not divided by, and may be as small
as it likes.
"""


@dataclass(frozen=True, kw_only=True)
class Numeric(YamlType):
    """Base of the types of numbers: limits, and words that replace a value."""

    above: float = -math.inf
    """Exclusive lower limit."""
    least: float = -math.inf
    """Inclusive lower limit."""
    most: float = math.inf
    """Inclusive upper limit."""
    below: float = math.inf
    """Exclusive upper limit."""
    words: Mapping[str, Any] = field(default_factory=lambda: NO_WORDS, hash=False)

    def read(self, given: Any) -> Any:
        """Return the value of a number or word; raise ValueError with a sentence."""
        if isinstance(given, str) and given in self.words:
            return self.words[given]
        try:
            value = self.number(given)
        except ValueError as error:
            if self.words and not _numberlike(given):
                raise refusal((), *one_of(given, self.words, self.hint), given) from None
            if given is None:
                raise ValueError(f"is empty; write {self.hint}, or remove the key") from None
            raise error
        self._check(value, given)
        return value

    def write(self, value: Any) -> Any:
        """Return the YAML form of a value; None for a key that is not given."""
        for word, meaning in self.words.items():
            if value is meaning or (isinstance(meaning, str) and value == meaning):
                return word
        return None if value is None else self.text(value)

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of what may be written."""
        form = self.number_schema()
        return {"anyOf": [{"enum": list(self.words)}, form]} if self.words else form

    def _check(self, value: float, given: Any) -> None:
        low, high = self.above, self.below
        if value <= low or value < self.least:
            limit, how = (low, "more than") if value <= low else (self.least, "at least")
        elif (value >= high and high < math.inf) or value > self.most:
            limit, how = (high, "less than") if value >= high else (self.most, "at most")
        elif MOST_SIZE < abs(value) < math.inf or (0 < value < LEAST_SIZE and not self.is_signed):
            size = "large" if abs(value) > MOST_SIZE else "small"
            raise ValueError(f"{describe(given)} is too {size} to compute with; write {self.hint}")
        else:
            return
        if limit == 0:
            wrong = "is zero" if value == 0 else "is negative"
            raise ValueError(f"{describe(given)} {wrong}; write {self.hint}")
        text = self.text(limit)
        limit_text = f"{text:g}" if isinstance(text, float) else text
        raise ValueError(f"{describe(given)} is out of range; it must be {how} {limit_text}")

    @abstractmethod
    def number(self, given: Any) -> float:
        """Return the number that is written, limits aside; raise ValueError with a sentence."""

    @abstractmethod
    def text(self, value: Any) -> Any:
        """Return a number as it is written in YAML."""

    @abstractmethod
    def number_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of a number."""

    @property
    @abstractmethod
    def hint(self) -> str:
        """What to write, for messages."""

    @property
    def is_signed(self) -> bool:
        """Whether a number may be negative."""
        return self.least < 0 and self.above < 0

    @property
    def limits(self) -> dict[str, float]:
        """Limits of a bare number in a JSON Schema."""
        limits = {
            "minimum": self.least,
            "exclusiveMinimum": self.above,
            "maximum": self.most,
            "exclusiveMaximum": self.below,
        }
        return {name: value for name, value in limits.items() if math.isfinite(value)}


@dataclass(frozen=True)
class Quantity(Numeric):
    """A quantity of a dimension of `units`; limits in SI."""

    dimension: str
    difference: bool = field(default=False, kw_only=True)
    """Whether a temperature is a difference, which degC cannot say."""

    def number(self, given: Any) -> float:
        """Return the quantity in SI."""
        if not isinstance(given, (str, int, float)) or isinstance(given, bool):
            raise ValueError(f"{describe(given)} is not {self._kind.title}; write {self.hint}")
        if self.difference and isinstance(given, str) and "C" in given:
            raise ValueError(f"{describe(given)} is a difference of temperatures; write 8 K")
        return units.parse(given, self.dimension)

    def text(self, value: Any) -> str:
        """Return the quantity with its unit."""
        return units.render(value, self.dimension)

    def number_schema(self) -> dict[str, Any]:
        """Return a definition that all keys of this dimension share."""
        kind, name, pattern = self._kind, f"signed_{self.dimension}", self._kind.pattern
        if not self.is_signed:
            name, pattern = self.dimension, pattern.replace("[+-]?", "[+]?", 1)
        about = f"{kind.title.capitalize()} with its unit: {', '.join(list(kind.units)[:12])}."
        return {
            DEFINED: {"name": name, "description": about, "examples": [kind.example]},
            "type": "string",
            "pattern": pattern,
        }

    @property
    def _kind(self) -> units.Dimension:
        return units.DIMENSIONS[self.dimension]

    @property
    def hint(self) -> str:
        """What to write, for messages."""
        title = self._kind.title
        if not self.is_signed and self.above >= 0:
            title = f"a positive {title.split(' ', 1)[1]}"
        return f"{title} such as {self._kind.example}"


@dataclass(frozen=True)
class Number(Numeric):
    """A dimensionless number, bare or in percent."""

    example: str = "0.5"

    def number(self, given: Any) -> float:
        """Return the number, 0.05 of "5 %"."""
        try:
            return units.parse_fraction(given)
        except ValueError as error:
            if isinstance(given, (str, int, float)) and not isinstance(given, bool):
                raise error
            raise ValueError(f"{describe(given)} is not a number; write {self.hint}") from None

    def text(self, value: Any) -> float:
        """Return the bare number."""
        return float(value)

    def number_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of a bare number within limits, or a fraction or percentage."""
        number = r"(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?"
        sign = "[+-]?" if self.is_signed else "[+]?"
        text = rf"^\s*{sign}{number}\s*(%|/\s*{number}\s*%?)\s*$"
        bare = {"type": "number"} | self.limits
        return {"anyOf": [bare, {"type": "string", "pattern": text}]}

    @property
    def hint(self) -> str:
        """What to write, for messages."""
        return f"a number such as {self.example}"


@dataclass(frozen=True)
class Percentage(Number):
    """A number that the field gives in percent: bare, 0.5 could be 0.5 % or 50 %."""

    example: str = "0.5 %"

    def number(self, given: Any) -> float:
        """Return the number, 0.05 of "5 %"; a bare one is refused, but for 0."""
        value = super().number(given)
        if (isinstance(given, str) and "%" in given) or value == 0:
            return value
        percent = f"{value:g} %"
        raise ValueError(
            f"{describe(given)} is a bare number: {percent} or {100 * value:g} %? write {percent},"
            f" or {100 * value:g} %"
        )

    def text(self, value: Any) -> Any:
        """Return the number in percent, which is read as the same."""
        return f"{units.decimal(Decimal(repr(float(value))).scaleb(2))} %"

    def number_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of 0, or a text in percent."""
        _, percent = super().number_schema()["anyOf"]
        return {"anyOf": [{"const": 0}, percent]}


@dataclass(frozen=True)
class Whole(Number):
    """A whole number."""

    def number(self, given: Any) -> int:
        """Return the number; true and 1.0 are none."""
        if isinstance(given, bool) or not isinstance(given, int):
            raise ValueError(f"{describe(given)} is not a whole number; write {self.hint}")
        return given

    def text(self, value: Any) -> int:
        """Return the number."""
        return int(value)

    def number_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of an integer within limits."""
        return {"type": "integer"} | self.limits

    @property
    def hint(self) -> str:
        """What to write, for messages."""
        return f"a whole number such as {self.example}"


def _numberlike(given: Any) -> bool:
    """Return whether a user seems to have meant a number: then say what is wrong with it."""
    if isinstance(given, str):
        return given.lstrip("+-. \t")[:1].isdigit()
    return isinstance(given, (int, float)) and not isinstance(given, bool)
