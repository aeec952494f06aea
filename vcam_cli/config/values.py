"""The types of keys: the usual quantities, words, files, and one of several forms."""

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, Strict, StringConstraints

from vcam_cli.config.quantities import NO_WORDS, Number, Percentage, Quantity
from vcam_cli.config.validation_messages import describe, key_fields, one_of, refusal
from vcam_cli.config.yaml_type import YamlType, to_yaml
from vcam_cli.records import dataclass

MOST_ELECTRONS = 1e9
"""Most electrons of a noise: beyond any well, and its square is still a number in 32 bits."""

_LENGTH = Quantity("length", above=0, least=1e-12, most=1e6)
"""Of what can be made, from less than an atom to more than a telescope."""
TIME = Quantity("time", above=0, least=1e-15, most=1e9)
"""From less than a period of light to thirty years."""
_TEMPERATURE = Quantity("temperature", above=0, least=4.0, most=1000.0)
"""Of silicon, from liquid helium to where it conducts by itself whatever its doping (S. M. Sze and
K. K. Ng, Physics of Semiconductor Devices, 3rd ed., 2007, section 1.4)."""

Length = Annotated[float, _LENGTH]
Gap = Annotated[float, Quantity("length", least=0, most=1e6)]
Wavelength = Annotated[float, Quantity("length", above=0, least=1e-9, most=1e-3)]
Shift = Annotated[float, Quantity("length")]
Time = Annotated[float, TIME]
Temperature = Annotated[float, Quantity("temperature", above=0)]
SiliconTemperature = Annotated[float, _TEMPERATURE]
Angle = Annotated[float, Quantity("angle")]
Electrons = Annotated[float, Quantity("charge", least=0, most=MOST_ELECTRONS)]
Frequency = Annotated[float, Quantity("spatial_frequency", least=0)]
Fraction = Annotated[float, Number(least=0, most=1)]
Percent = Annotated[float, Percentage(least=0, most=1)]
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
MaybeLength = Annotated[float | None, _LENGTH]
MaybeGap = Annotated[float | None, Quantity("length", least=0, most=1e6)]
MaybeTime = Annotated[float | None, TIME]
MaybeSiliconTemperature = Annotated[float | None, _TEMPERATURE]
MaybeFraction = Annotated[float | None, Number(least=0, most=1)]
MaybePositive = Annotated[float | None, Number(above=0, example="1")]


@dataclass(frozen=True, init=False)
class Choice(YamlType):
    """One of some words (or numbers that name a choice), for a key that need not be given."""

    allowed: tuple[str | int, ...]

    def __init__(self, *allowed: str | int) -> None:
        object.__setattr__(self, "allowed", allowed)

    def read(self, given: Any) -> Any:
        """Return `given` when it is allowed; true and 32.0 are no choices."""
        if type(given) in (str, int) and given in self.allowed:
            return given
        raise refusal((), *one_of(given, self.allowed), given)

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of the choices."""
        return {"enum": list(self.allowed)}


@dataclass(frozen=True)
class Either(YamlType):
    """One of several forms, told apart by `pick`, which validates what is written."""

    pick: Callable[[Any], Any]
    forms: Any
    """Types for the JSON Schema."""
    words: Mapping[str, Any] = field(default_factory=lambda: NO_WORDS, hash=False)
    """Words that replace a value ("none": None)."""
    yaml_form: Callable[[Any], Any] = to_yaml
    """What returns the YAML form of a value."""

    def read(self, given: Any) -> Any:
        """Return what `pick` makes of it."""
        return self.pick(given)

    def write(self, value: Any) -> Any:
        """Return the YAML form of a value; None for a key that is not given."""
        for word, meaning in self.words.items():
            if value is meaning:
                return word
        return None if value is None else self.yaml_form(value)


@dataclass(frozen=True)
class ByWords(Either):
    """One of several models, told apart by words that each requires of some of its keys.

    So an editor completes the keys of the one that is meant, and not of all.
    """

    telling: tuple[str, ...] = ()
    """The keys whose words tell."""

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema: for the words of each model, that model."""
        chosen: list[dict[str, Any]] = []
        keys: dict[str, None] = {}
        words: dict[str, list[str]] = {name: [] for name in self.telling}
        for model, form in zip(get_args(self.forms), forms["anyOf"], strict=True):
            own = {
                name: get_args(model.model_fields[name].annotation)[0]
                for name in self.telling
                if name in model.model_fields
            }
            said = {name: {"const": word} for name, word in own.items()}
            chosen.append({"if": {"properties": said, "required": list(own)}, "then": form})
            for name, word in own.items():
                words[name].append(word)
            keys |= dict.fromkeys(key_fields(model))
        properties = {n: {"enum": list(dict.fromkeys(found))} for n, found in words.items()}
        return {
            "type": "object",
            "required": [self.telling[0]],
            "properties": properties,
            "propertyNames": {"enum": list(keys)},
            "allOf": chosen,
        }


def word_or(model: type[BaseModel], words: Mapping[str, Any]) -> Either:
    """Return the type of a word, or a mapping that `model` describes."""

    def pick(given: Any) -> Any:
        if isinstance(given, (Mapping, model)):
            return model.model_validate(given)
        if isinstance(given, str) and given in words:
            return words[given]
        also = "a mapping of " + ", ".join(key_fields(model))
        unknown = (
            "is empty" if given is None else f"{describe(given)} is not allowed here",
            f"write {also}",
        )
        raise refusal((), *(one_of(given, words, also) if words else unknown), given)

    return Either(pick, Literal[tuple(words)] | model if words else model, words)


def mapping(model: type[BaseModel]) -> Either:
    """Return the type of a mapping that `model` describes, for a key that need not be given."""
    return word_or(model, NO_WORDS)


@dataclass(frozen=True)
class FileName(YamlType):
    """The path of a file."""

    forms = Annotated[str, StringConstraints(min_length=1)]

    def read(self, given: Any) -> str:
        """Return the path, as written."""
        if not isinstance(given, str) or not given.strip() or "\0" in given:
            raise ValueError(
                f"{describe(given)} is not the name of a file; write for example qe.csv"
            )
        return given


File = Annotated[str, FileName()]
