"""What every section of a camera file is built from: a frozen model, a key, a rule.

A model's attributes are the YAML keys; its values are SI numbers once validated, and
`model_dump(mode="json")` gives the YAML form back, units and all. Unknown keys are errors.
All mistakes of a mapping are found in one pass: those of its keys, and those of its `rules`,
which look only at which keys are present.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from vcam_cli.camera import explain
from vcam_cli.camera.explain import fault

Rule = Callable[[Mapping[str, Any]], Iterable[InitErrorDetails]]
"""Looks at the keys of a mapping as it was written; gives the mistakes it finds."""


class Model(BaseModel):
    """A mapping of a camera file."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, protected_namespaces=()
    )
    rules: ClassVar[tuple[Rule, ...]] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _all_mistakes(cls, given: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Validates; raises all mistakes of this mapping at once, in words."""
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            message = "is empty" if given is None else f"{explain.shown(given)} is not a mapping"
            keys = ", ".join(explain.names(cls))
            raise explain.failure([fault((), message, f"write a mapping of {keys}", given)])
        found = [mistake for rule in cls.rules for mistake in rule(given)]
        value = None
        try:
            value = handler(given)
        except ValidationError as error:
            found = explain.sentences(error, cls) + found
        if found or value is None:
            raise explain.failure(found, cls.__name__)
        return value

    @model_serializer(mode="wrap")
    def _written(
        self, handler: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        """As a mapping; in YAML form (mode "json") keys that were not given are left out."""
        written: dict[str, Any] = handler(self)
        if info.mode != "json":
            return written
        return {_yaml_key(type(self), k): v for k, v in written.items() if v is not None}

    def _fill(self, **values: Any) -> None:
        """Sets defaults that depend on other keys, while the model is being built."""
        self.__dict__.update(values)


def _yaml_key(model: type[BaseModel], name: str) -> str:
    field = model.model_fields.get(name)
    return field.alias if field is not None and field.alias else name


def key(
    description: str,
    *,
    example: Any,
    default: Any = ...,
    unit: str = "",
    **more: Any,
) -> Any:
    """A key of a camera file; `unit` is the one a user may write ("" = none, or no number)."""
    about: dict[str, Any] = {"description": description, "examples": [example]}
    make = {"default_factory": default} if callable(default) else {"default": default}
    return Field(**make, **about, json_schema_extra={"unit": unit}, **more)


def exactly_one(*keys: str, of: str, remedy: str, unless: tuple[str, ...] = ()) -> Rule:
    """Exactly one of `keys` is there (none need be where one of `unless` is)."""
    at_most = at_most_one(*keys)
    listed = f"{', '.join(keys[:-1])} or {keys[-1]}"

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        if not any(name in given for name in (*keys, *unless)):
            yield fault((), f"{of} is missing: give one of {listed}", remedy)
        yield from at_most(given)

    return rule


def at_most_one(*keys: str) -> Rule:
    """No two of `keys` are there."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        first, *others = [name for name in keys if name in given] or [""]
        for name in others:
            message = f"{name} and {first} cannot both be given"
            yield fault((name,), message, "keep one of them", given[name])

    return rule


def together(*keys: str) -> Rule:
    """All of `keys` are there or none."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        there = [name for name in keys if name in given]
        for name in keys:
            if there and name not in there:
                yield fault((name,), f"is missing: {there[0]} is given", f"add {name}")

    return rule


def needs(key: str, other: str, why: str) -> Rule:
    """`key` is there only where `other` is."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        if key in given and other not in given:
            yield fault((key,), why, f"add {other}, or remove {key}", given[key])

    return rule
