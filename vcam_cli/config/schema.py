"""JSON Schemas of models, as editors and other programs read them.

They hold titles with units, defaults as YAML writes them, second names of keys, and one definition
for every form that keys share.

Why a section has a second definition "... overrides": one that says `use`, or a file that says
`extends`, may leave out what is required otherwise.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from vcam_cli.config.model import Model
from vcam_cli.config.validation_messages import key_fields
from vcam_cli.config.yaml_type import DEFINED

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
OVERRIDES = " overrides"
_PART = "The name or path of a part file"


def text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


class _Generator(GenerateJsonSchema):
    """Pydantic's generator, which keeps a list of the models that it meets."""

    def __init__(self) -> None:
        super().__init__()
        self.models: list[type[BaseModel]] = []

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        self.models.append(schema["cls"])
        return super().model_schema(schema)


def model_schema(model: type[Model]) -> Schema:
    """Return the schema of a model, with what pydantic cannot know, and shared forms gathered."""
    generator = _Generator()
    schema = generator.generate(model.__pydantic_core_schema__, mode="validation")
    definitions = schema.setdefault("$defs", {})
    for each in generator.models:
        _complete(schema if each is model else definitions[each.__name__], each)
    gathered: Schema = {}
    complete: Schema = _gather(schema, gathered)
    complete["$defs"] |= gathered
    return complete


def file_schema(schema: Schema, title: str) -> Schema:
    """Return the schema of a file: with its head, its definitions sorted and those in use."""
    head = {"$schema": DIALECT, "title": f"vcam: {title}"}
    rest = {k: v for k, v in schema.items() if k not in ("title", "$defs")}
    definitions = schema.get("$defs", {})
    used = _reachable(rest, definitions)
    return head | rest | {"$defs": {n: definitions[n] for n in sorted(definitions) if n in used}}


def with_parts(schema: Schema, name: str, sections: dict[str, str], title: str) -> Schema:
    """Return the schema of a file whose sections may be part files, and that may extend another.

    Parameters
    ----------
    schema : dict
        What `model_schema` returned.
    name : str
        Name of the definition of the whole file.
    sections : dict
        Key of every section that may be a part file -> its definition.
    title : str
        What the file is.
    """
    definitions = schema["$defs"]
    body = {key: schema[key] for key in ("type", "properties", "required", "description")}
    definitions[name] = body | {"title": name, "additionalProperties": False}
    _add_overrides(definitions, [name, *sections.values()])
    base = {
        "type": "string",
        "description": f"{_PART} that this file changes: all other keys are those of that file.",
        "examples": ["OTHER.yaml"],
    }
    use = {
        "type": "string",
        "description": f"{_PART} that this section changes.",
        "examples": ["NAME"],
    }
    for key, section in sections.items():
        for whole in (name, name + OVERRIDES):
            properties = definitions[whole]["properties"]
            properties[key] = _section(properties[key], section, loose=whole != name)
        loose = definitions[section + OVERRIDES]
        loose["properties"] = {"use": use, "extends": base} | loose["properties"]
    loose = definitions[name + OVERRIDES]
    loose["properties"] = {"extends": base} | loose["properties"]
    then, otherwise = {"$ref": reference(name + OVERRIDES)}, {"$ref": reference(name)}
    either = {"if": {"required": ["extends"]}, "then": then, "else": otherwise}
    return file_schema({"$defs": definitions, "type": "object", **either}, title)


def part_schema(whole: Schema, section: str, title: str) -> Schema:
    """Return the schema of a part file: a section of a file, which may extend another part.

    Parameters
    ----------
    whole : dict
        What `with_parts` returned.
    section : str
        Definition of the section.
    title : str
        What the file is.
    """
    some = {"anyOf": [{"required": ["use"]}, {"required": ["extends"]}]}
    then, otherwise = {"$ref": reference(section + OVERRIDES)}, {"$ref": reference(section)}
    either = {"if": some, "then": then, "else": otherwise}
    return file_schema({"$defs": whole["$defs"], "type": "object", **either}, title)


def reference(name: str) -> str:
    """Return the reference to a definition."""
    return f"#/$defs/{name}"


def _section(field: Schema, name: str, loose: bool) -> Schema:
    """Return a section: a part file's name, or a mapping, not whole where it says `use`."""
    changed = {"$ref": reference(name + OVERRIDES)}
    mapping: Schema = {"type": "object"}
    if loose:
        mapping |= changed
    else:
        whole = {"$ref": reference(name)}
        some = {"anyOf": [{"required": ["use"]}, {"required": ["extends"]}]}
        mapping |= {"if": some, "then": changed, "else": whole}
    about = {k: v for k, v in field.items() if k != "$ref"}
    part = {"type": "string", "minLength": 1, "description": f"{_PART}."}
    return about | {"anyOf": [part, mapping]}


def _complete(body: Schema, model: type[BaseModel]) -> None:
    """Add units to titles, defaults as YAML writes them, and second names of keys."""
    defaults = model.model_construct().model_dump(mode="json")
    properties: Schema = {}
    for name, field in model.model_fields.items():
        key = str(field.alias or name)
        given = body["properties"].get(key) or body["properties"][name]
        one = {k: v for k, v in given.items() if k not in ("unit", "default")}
        about, extra = field.description or "", field.json_schema_extra
        unit = extra.get("unit", "") if isinstance(extra, dict) else ""
        one["title"] = f"{key} [{unit}]" if unit else key
        one["description"] = about[:1].upper() + about[1:] + "."
        default = defaults.get(key)  # in the place of pydantic's, an SI number
        if default is not None and not isinstance(default, dict):
            one["default"] = default
        others = [
            other for other, its in key_fields(model).items() if its is field and other != key
        ]
        for other in (key, *others):
            properties[other] = one | {"title": one["title"].replace(key, other)}
    body["properties"] = properties
    body["description"] = (model.__doc__ or "").strip().partition("\n\n")[0]


def _gather(node: Any, definitions: Schema) -> Any:
    """Return the schema with every form that has a name of its own moved to the definitions."""
    if isinstance(node, list):
        return [_gather(item, definitions) for item in node]
    if not isinstance(node, dict):
        return node
    if DEFINED not in node:
        return {key: _gather(item, definitions) for key, item in node.items()}
    about = {k: node[k] for k in ("title", "description", "examples", "default") if k in node}
    form = {k: _gather(v, definitions) for k, v in node.items() if k not in (DEFINED, *about)}
    defined = dict(node[DEFINED])
    name = defined.pop("name")
    form = defined | form
    if definitions.setdefault(name, form) != form:
        raise ValueError(f"two forms are called {name}")
    return about | {"$ref": reference(name)}


def _references(node: Any) -> Iterator[str]:
    """Yield the names of all definitions a schema refers to."""
    if isinstance(node, dict):
        target = node.get("$ref")
        if isinstance(target, str):
            yield target.removeprefix("#/$defs/")
        for item in node.values():
            yield from _references(item)
    elif isinstance(node, list):
        for item in node:
            yield from _references(item)


def _reachable(node: Any, definitions: Schema) -> set[str]:
    found: set[str] = set()
    queue = list(_references(node))
    while queue:
        name = queue.pop()
        if name not in found:
            found.add(name)
            queue.extend(_references(definitions[name]))
    return found


def _add_overrides(definitions: Schema, names: Iterable[str]) -> None:
    """Add definitions that require nothing: of `names`, and of those below that require a key."""
    models = {name for name in definitions if name[0].isupper()}
    strict = {name for name in models if "required" in definitions[name]}
    below = {name: {name, *_reachable(definitions[name], definitions)} for name in models}
    loose = {name for name in models if below[name] & strict} | set(names)

    def rename(name: str) -> str:
        return name + OVERRIDES if name in loose else name

    for name in sorted(loose):
        definitions[name + OVERRIDES] = _loosen(definitions[name], rename)


def _loosen(node: Any, rename: Callable[[str], str]) -> Any:
    if isinstance(node, list):
        return [_loosen(item, rename) for item in node]
    if not isinstance(node, dict):
        return node
    found = {}
    for key, item in node.items():
        if key == "required" and isinstance(item, list):
            continue
        if key == "if":  # which form is meant
            found[key] = item
        elif key == "$ref":
            found[key] = reference(rename(item.removeprefix("#/$defs/")))
        else:
            found[key] = item if key in ("examples", "default") else _loosen(item, rename)
    return found
