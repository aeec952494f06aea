"""What every section of a file is built from: a frozen model, a key, a rule.

A model's attributes are the YAML keys; its values are SI numbers once validated, and
`model_dump(mode="json")` gives the YAML form back, units and all. Unknown keys are errors.
All mistakes of a mapping are found in one pass: those of its keys, and those of its `rules`,
which look only at which keys are present.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from vcam_cli import errors
from vcam_cli.config.validation_messages import (
    describe,
    explanations,
    failure,
    fault,
    key_fields,
    refusal,
)
from vcam_cli.config.yaml_tree import Origin

Rule = Callable[[Mapping[str, Any]], Iterable[InitErrorDetails]]
"""Looks at the keys of a mapping as it was written; gives the mistakes it finds."""


class Model(BaseModel):
    """A mapping of a file."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, protected_namespaces=(), defer_build=True
    )
    rules: ClassVar[tuple[Rule, ...]] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _all_mistakes(cls, given: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Validate a mapping; raise all its mistakes at once, in words."""
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            message = "is empty" if given is None else f"{describe(given)} is not a mapping"
            remedy = f"write a mapping of {', '.join(key_fields(cls))}"
            raise refusal((), message, remedy, given)
        found = [mistake for rule in cls.rules for mistake in rule(given)]
        value = None
        try:
            value = handler(given)
        except ValidationError as error:
            found = explanations(error, cls) + found
        if found or value is None:
            raise failure(found)
        return value

    @model_serializer(mode="wrap")
    def _write(
        self, handler: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        """Return a mapping; in YAML form (mode "json") without keys that were not given."""
        written: dict[str, Any] = handler(self)
        if info.mode != "json":
            return written
        fields = type(self).model_fields
        names = {name: field.alias for name, field in fields.items() if field.alias}
        return {names.get(k, k): v for k, v in written.items() if v is not None}

    def _fill(self, **values: Any) -> None:
        """Set defaults that depend on other keys; validators call it while they build a model."""
        self.__dict__.update(values)

    def with_derived(self, **values: Any) -> Self:
        """Return the same model with values that follow from other keys, and so are not given."""
        model = self.model_copy()
        model._fill(**values)
        return model


class FileModel(Model):
    """A model of a whole file, which knows where it was read from."""

    _origin: Origin | None = PrivateAttr(default=None)

    def with_origin(self, origin: Origin) -> Self:
        """Return the same model, which knows where it was read from."""
        model = self.model_copy()
        model._origin = origin
        return model

    @property
    def origin(self) -> Path | None:
        """File that it was read from."""
        return None if self._origin is None else self._origin.file

    @property
    def source_tree(self) -> Origin | None:
        """What was read, with its places; None for a model that comes from no file."""
        return self._origin

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that it was read from."""
        return () if self._origin is None else self._origin.files

    def locate(self, path: errors.Path) -> str:
        """Return the place of a key, "lens.yaml:12:10"; "" for a model that comes from no file."""
        return "" if self._origin is None else self._origin.locate(path)

    def __eq__(self, other: object) -> bool:
        """Return whether keys and values are equal, wherever they were read from."""
        return type(other) is type(self) and self.__dict__ == other.__dict__

    __hash__ = None  # type: ignore[assignment]


def key(
    description: str,
    *,
    example: Any = None,
    default: Any = ...,
    unit: str | None = None,
    **more: Any,
) -> Any:
    """Return the field of a key.

    Parameters
    ----------
    description : str
        What the key is.
    example : object, optional
        A value as YAML has it; default `default`.
    default : object, optional
        Value where the key is not given; the key is required without one. For a mapping without
        keys it is `Model.model_construct`: to validate one takes 0.5 ms, once.
    unit : str, optional
        Unit that a user may write, "" for none; default that of the example.
    **more
        Further arguments of pydantic's `Field`.
    """
    example = default if example is None else example
    if unit is None:
        quantity = isinstance(example, str) and example[:1].isdigit()
        unit = example.partition(" ")[2] if quantity else ""
    make = {"default_factory": default} if callable(default) else {"default": default}
    extra = {"unit": unit}
    return Field(
        **make, description=description, examples=[example], json_schema_extra=extra, **more
    )


def _is_given(given: Mapping[str, Any], key: str) -> bool:
    """Return whether a key is given, and no empty list, which says as much as no key."""
    return key in given and given[key] not in ([], ())


def exactly_one(*keys: str, of: str, remedy: str) -> Rule:
    """Return the rule that one of `keys` is given, and no second: they say what `of` names."""
    at_most = at_most_one(*keys)
    listed = f"{', '.join(keys[:-1])} or {keys[-1]}"

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        if not any(_is_given(given, name) for name in keys):
            yield fault((), f"{of} is missing: give one of {listed}", remedy)
        yield from at_most(given)

    return rule


def at_most_one(*keys: str) -> Rule:
    """Return the rule that no two of `keys` are given."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        first, *others = [name for name in keys if _is_given(given, name)] or [""]
        for name in others:
            message = f"{name} and {first} cannot both be given"
            yield fault((name,), message, "keep one of them", given[name])

    return rule


def all_or_none(*keys: str) -> Rule:
    """Return the rule that all of `keys` are given, or none."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        there = [name for name in keys if name in given]
        for name in keys:
            if there and name not in there:
                yield fault((name,), f"is missing: {there[0]} is given", f"add {name}")

    return rule


def needs(key: str, other: str, why: str) -> Rule:
    """Return the rule that `key` is given only beside `other`."""

    def rule(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        if key in given and other not in given:
            yield fault((key,), why, f"add {other}, or remove {key}", given[key])

    return rule
