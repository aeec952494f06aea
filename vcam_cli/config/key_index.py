"""All keys that a model's files may have, by their paths."""

from collections.abc import Iterator
from functools import cache, cached_property
from typing import Any, get_args

from pydantic import BaseModel

from vcam_cli.config.validation_messages import key_fields, yaml_text
from vcam_cli.config.yaml_type import YamlType
from vcam_cli.errors import Path, dotted_path
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Key:
    """One key of a file."""

    path: Path
    """Keys that lead to it; elements of lists have no part of their own."""
    description: str
    """What it is."""
    unit: str
    """Unit that is written, "" for none."""
    example: str
    """A value, as YAML has it."""
    required: bool
    """Whether it must be given."""
    model: type[BaseModel]
    """The mapping that it belongs to."""

    @property
    def name(self) -> str:
        """The last part of its path."""
        return str(self.path[-1])

    @property
    def default(self) -> Any:
        """Value where it is not given, as YAML has it; None without a default."""
        field = key_fields(self.model)[self.name]
        return _defaults(self.model).get(field.alias or self.name)

    @cached_property  # `explain` compares a word with those of all keys
    def dotted(self) -> str:
        """Its path as `--set` writes it."""
        return dotted_path(self.path)


def keys(model: type[BaseModel], above: Path = ()) -> Iterator[Key]:
    """Yield all keys of a model and below; those that share a path come one after another."""
    for name, field in key_fields(model).items():
        path, extra = (*above, name), field.json_schema_extra or {}
        yield Key(
            path,
            field.description or "",
            str(extra.get("unit", "")) if isinstance(extra, dict) else "",
            yaml_text(field.examples[0]) if field.examples else "",
            field.is_required(),
            model,
        )
        for below in dict.fromkeys(_models((field.annotation, *field.metadata))):
            if below.__doc__ and path.count(name) == 1:
                yield from keys(below, path)


@cache
def _defaults(model: type[BaseModel]) -> dict[str, Any]:
    """Return the defaults of a model's keys, as YAML has them.

    Only of the keys that are explained: pydantic takes 1 ms to write those of a model.
    """
    return model.model_construct().model_dump(mode="json")


def _models(forms: Any) -> Iterator[type[BaseModel]]:
    """Yield the models among the forms of a value."""
    if isinstance(forms, type) and issubclass(forms, BaseModel):
        if forms.model_fields:
            yield forms
    elif isinstance(forms, YamlType):
        yield from _models(forms.forms)
    elif isinstance(forms, tuple):
        for form in forms:
            yield from _models(form)
    else:
        yield from _models(get_args(forms))
