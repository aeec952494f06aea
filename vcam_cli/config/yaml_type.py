"""The base of types that read and write the YAML form of their values themselves.

Why validators of our own and not pydantic unions: a union reports every branch it tried, under
paths that are not in the file.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter
from pydantic_core import CoreSchema, core_schema

DEFINED = "x-definition"
"""In a JSON Schema: name, description and examples of a form that `schema` gathers."""


class YamlType(ABC):
    """The type of a key: `Annotated[TYPE_OF_THE_VALUE, YamlType]`."""

    forms: Any = None
    """Types that the JSON Schema is made of; None where `json_schema` needs none."""

    @abstractmethod
    def read(self, given: Any) -> Any:
        """Return the value of what is written in YAML; raise ValueError with a sentence."""

    def write(self, value: Any) -> Any:
        """Return the YAML form of a value; None for a key that is not given."""
        return to_yaml(value)

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of what may be written, of that of `forms`."""
        return forms

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
        # Here and not above: building the forms of all keys takes longer than reading a file.
        forms = (
            core_schema.any_schema() if self.forms is None else TypeAdapter(self.forms).core_schema
        )
        given = core_schema.no_info_plain_validator_function(
            self.read, json_schema_input_schema=forms
        )
        return self.json_schema(dict(handler(given)))


def to_yaml(value: Any) -> Any:
    """Return the YAML form of a value that holds models."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Mapping):
        return {str(name): to_yaml(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_yaml(item) for item in value]
    return value
