"""The types of values in a camera file: quantities with a unit, numbers, words, files.

A quantity is a string with its unit in YAML ("6.5 um"), an SI float in the model, and a string
again when the model is written (`units.render`, which loses nothing). Where a word may stand for
a value ("auto", "none") the type says so: `Quantity("length", words={"auto": None})`.

Why validators of our own and not pydantic unions: a union reports every branch it tried, under
paths that are not in the file.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
)
from pydantic_core import CoreSchema, core_schema

from vcam_cli import units
from vcam_cli.camera.explain import failure, fault, names, one_of, shown

DEFINED = "x-definition"
"""In a JSON Schema: name, description and examples of a form that `schema` gathers."""
NONE: Mapping[str, Any] = MappingProxyType({})
LEAST_SIZE, MOST_SIZE = 1e-45, 1e45
"""Sizes of numbers other than 0, in SI units: what is made of several of them stays a number.

Nothing that a camera has comes near. What may be negative is added and not divided by, and may be
as small as it likes.
"""


@dataclass(frozen=True, kw_only=True)
class _Value(ABC):
    """Base of the scalar types: limits, and words that stand for a value."""

    above: float = -math.inf
    """exclusive lower limit"""
    least: float = -math.inf
    most: float = math.inf
    below: float = math.inf
    """exclusive upper limit"""
    words: Mapping[str, Any] = field(default_factory=lambda: NONE, hash=False)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.write, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        if not self.words:
            return self.form()
        return {"anyOf": [{"enum": list(self.words)}, self.form()]}

    def read(self, given: Any) -> Any:
        """The value of what is written in YAML; ValueError with a sentence for the user."""
        if isinstance(given, str) and given in self.words:
            return self.words[given]
        try:
            value = self.number(given)
        except ValueError as error:
            if self.words and not _numberlike(given):
                raise failure([fault((), *one_of(given, self.words, self.hint), given)]) from None
            if given is None:
                raise ValueError(f"is empty; write {self.hint}, or remove the key") from None
            raise error
        self._check(value, given)
        return value

    def write(self, value: Any) -> Any:
        """The YAML form of a value; None for a key that is not given."""
        for word, meaning in self.words.items():
            if value is meaning or (isinstance(meaning, str) and value == meaning):
                return word
        return None if value is None else self.text(value)

    def _check(self, value: float, given: Any) -> None:
        low, high = self.above, self.below
        if value <= low or value < self.least:
            limit, how = (low, "more than") if value <= low else (self.least, "at least")
        elif (value >= high and high < math.inf) or value > self.most:
            limit, how = (high, "less than") if value >= high else (self.most, "at most")
        elif MOST_SIZE < abs(value) < math.inf or (0 < value < LEAST_SIZE and not self.signed):
            size = "large" if abs(value) > MOST_SIZE else "small"
            raise ValueError(f"{shown(given)} is too {size} to compute with; write {self.hint}")
        else:
            return
        if limit == 0:
            wrong = "is zero" if value == 0 else "is negative"
            raise ValueError(f"{shown(given)} {wrong}; write {self.hint}")
        text = self.text(limit)
        limit_text = f"{text:g}" if isinstance(text, float) else text
        raise ValueError(f"{shown(given)} is out of range; it must be {how} {limit_text}")

    @abstractmethod
    def number(self, given: Any) -> float:
        """The number itself, limits aside."""

    @abstractmethod
    def text(self, value: Any) -> Any:
        """A number as it is written in YAML."""

    @abstractmethod
    def form(self) -> dict[str, Any]:
        """JSON Schema of what may be written."""

    @property
    @abstractmethod
    def hint(self) -> str:
        """What to write, for messages."""

    @property
    def signed(self) -> bool:
        return self.least < 0 and self.above < 0


@dataclass(frozen=True)
class Quantity(_Value):
    """A quantity of a dimension of `units`; limits in SI."""

    dimension: str
    difference: bool = field(default=False, kw_only=True)
    """Of temperatures: a difference, which degC cannot say."""

    def number(self, given: Any) -> float:
        if not isinstance(given, (str, int, float)) or isinstance(given, bool):
            raise ValueError(f"{shown(given)} is not {self._title}; write {self.hint}")
        if self.difference and isinstance(given, str) and "C" in given:
            raise ValueError(f"{shown(given)} is a difference of temperatures; write 8 K")
        return units.parse(given, self.dimension)

    def text(self, value: Any) -> str:
        return units.render(value, self.dimension)

    def form(self) -> dict[str, Any]:
        dimension = units.DIMENSIONS[self.dimension]
        pattern, name = dimension.pattern, self.dimension
        units_ = ", ".join(list(dimension.units)[:12])
        if not self.signed:
            pattern = pattern.replace("[+-]?", "[+]?", 1)
        else:
            name = f"signed_{name}"
        return {
            DEFINED: {
                "name": name,
                "description": f"{dimension.title.capitalize()} with its unit: {units_}.",
                "examples": [dimension.example],
            },
            "type": "string",
            "pattern": pattern,
        }

    @property
    def _title(self) -> str:
        return units.DIMENSIONS[self.dimension].title

    @property
    def hint(self) -> str:
        positive = "" if self.signed else "positive " if self.above >= 0 else ""
        title = self._title
        if positive:
            title = f"a positive {title.split(' ', 1)[1]}"
        return f"{title} such as {units.DIMENSIONS[self.dimension].example}"


@dataclass(frozen=True)
class Number(_Value):
    """A dimensionless number, bare or in percent."""

    example: str = "0.5"

    def number(self, given: Any) -> float:
        try:
            return units.parse_fraction(given)
        except ValueError as error:
            if isinstance(given, (str, int, float)) and not isinstance(given, bool):
                raise error
            raise ValueError(f"{shown(given)} is not a number; write {self.hint}") from None

    def text(self, value: Any) -> float:
        return float(value)

    def form(self) -> dict[str, Any]:
        percent = r"^\s*[+]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?\s*%\s*$"
        if self.signed:
            percent = percent.replace("[+]?", "[+-]?", 1)
        return {
            "anyOf": [{"type": "number"} | self._limits(), {"type": "string", "pattern": percent}]
        }

    def _limits(self) -> dict[str, float]:
        limits = {
            "minimum": self.least,
            "exclusiveMinimum": self.above,
            "maximum": self.most,
            "exclusiveMaximum": self.below,
        }
        return {name: value for name, value in limits.items() if math.isfinite(value)}

    @property
    def hint(self) -> str:
        return f"a number such as {self.example}"


@dataclass(frozen=True)
class Whole(Number):
    """A whole number."""

    def number(self, given: Any) -> int:
        if isinstance(given, bool) or not isinstance(given, int):
            raise ValueError(f"{shown(given)} is not a whole number; write {self.hint}")
        return given

    def text(self, value: Any) -> int:
        return int(value)

    def form(self) -> dict[str, Any]:
        return {"type": "integer"} | self._limits()

    @property
    def hint(self) -> str:
        return f"a whole number such as {self.example}"


@dataclass(frozen=True, init=False)
class Choice:
    """One of some words (or numbers that name a choice), for a key that need not be given."""

    allowed: tuple[str | int, ...]

    def __init__(self, *allowed: str | int) -> None:
        object.__setattr__(self, "allowed", allowed)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"enum": list(self.allowed)}

    def read(self, given: Any) -> Any:
        """`given` when it is allowed; true and 32.0 are no choices."""
        if type(given) in (str, int) and given in self.allowed:
            return given
        raise failure([fault((), *one_of(given, self.allowed), given)])


@dataclass(frozen=True)
class Either:
    """One of several forms, told apart by `pick`, which validates what is written.

    `forms` are the types for the JSON Schema; `words` as in `Quantity`, for a word that stands
    for a value ("none" for None).
    """

    pick: Callable[[Any], Any]
    forms: Any
    words: Mapping[str, Any] = field(default_factory=lambda: NONE, hash=False)
    write: Callable[[Any], Any] | None = None
    """The YAML form of a value; default `written`."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.pick,
            json_schema_input_schema=handler.generate_schema(self.forms),
            serialization=core_schema.plain_serializer_function_ser_schema(
                self._write, when_used="json"
            ),
        )

    def _write(self, value: Any) -> Any:
        for word, meaning in self.words.items():
            if value is meaning:
                return word
        if value is None:
            return None
        return written(value) if self.write is None else self.write(value)


def word_or(model: type[BaseModel], words: Mapping[str, Any]) -> Either:
    """A word, or a mapping that `model` describes."""

    def pick(given: Any) -> Any:
        if isinstance(given, (Mapping, model)):
            return model.model_validate(given)
        if isinstance(given, str) and given in words:
            return words[given]
        also = "a mapping of " + ", ".join(names(model))
        if not words:
            raise failure(
                [fault((), f"{shown(given)} is not allowed here", f"write {also}", given)]
            )
        raise failure([fault((), *one_of(given, words, also), given)])

    forms = Literal[tuple(words)] | model if words else model
    return Either(pick, forms, words)


def mapping(model: type[BaseModel]) -> Either:
    """A mapping that `model` describes, for a key that need not be given."""
    return word_or(model, NONE)


def written(value: Any) -> Any:
    """The YAML form of a value that holds models."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Mapping):
        return {str(name): written(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [written(item) for item in value]
    return value


def _numberlike(given: Any) -> bool:
    """Whether a user seems to have meant a number: then say what is wrong with it."""
    if isinstance(given, str):
        return given.lstrip("+-. \t")[:1].isdigit()
    return isinstance(given, (int, float)) and not isinstance(given, bool)


Length = Annotated[float, Quantity("length", above=0)]
Gap = Annotated[float, Quantity("length", least=0)]
Shift = Annotated[float, Quantity("length")]
Time = Annotated[float, Quantity("time", above=0)]
Temperature = Annotated[float, Quantity("temperature", above=0)]
Angle = Annotated[float, Quantity("angle")]
MOST_ELECTRONS = 1e9
"""Of a noise: beyond any well, and its square is still a number in 32 bits."""
Electrons = Annotated[float, Quantity("charge", least=0, most=MOST_ELECTRONS)]
Frequency = Annotated[float, Quantity("spatial_frequency", least=0)]
Fraction = Annotated[float, Number(least=0, most=1)]
Positive = Annotated[float, Number(above=0, example="1")]
Switch = Annotated[bool, Strict()]
Word = Annotated[
    str,
    StringConstraints(
        strict=True, max_length=64, pattern=r"^[A-Za-z0-9._-]*[A-Za-z0-9_-][A-Za-z0-9._-]*$"
    ),
]
"""A name that becomes a folder: letters, digits, '.', '_', '-', and not dots alone."""
Text = Annotated[str, StringConstraints(strict=True)]

# The same where a key need not be given; YAML's null is not "not given" but a mistake.
MaybeLength = Annotated[float | None, Quantity("length", above=0)]
MaybeGap = Annotated[float | None, Quantity("length", least=0)]
MaybeTime = Annotated[float | None, Quantity("time", above=0)]
MaybeFraction = Annotated[float | None, Number(least=0, most=1)]
MaybePositive = Annotated[float | None, Number(above=0, example="1")]


def read_file(given: Any) -> str:
    """The path of a file, as written; ValueError for anything else."""
    if not isinstance(given, str) or not given.strip() or "\0" in given:
        raise ValueError(f"{shown(given)} is not the name of a file; write for example qe.csv")
    return given


@dataclass(frozen=True)
class _File:
    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            read_file,
            json_schema_input_schema=core_schema.str_schema(min_length=1),
            serialization=core_schema.to_string_ser_schema(),
        )


File = Annotated[str, _File()]
