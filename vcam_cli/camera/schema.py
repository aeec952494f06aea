"""JSON Schemas of the files a user writes, from the models.

They serve editors (completion, hover texts, mistakes while typing) and other programs. A schema
says less than `vcam validate`: which keys exclude each other, and whatever needs arithmetic, is
checked there.

Why every section has a second definition "... overrides": a section that says `use`, or a file
that says `extends`, may leave out what is required otherwise.
"""

import json
from collections.abc import Callable, Iterator
from typing import Any

from pydantic import AliasChoices, BaseModel

from vcam_cli.camera import explain
from vcam_cli.camera.base import Model
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.schedule_study import ScheduleStudy
from vcam_cli.camera.study import KINDS, Sweep
from vcam_cli.camera.technology import Technology
from vcam_cli.camera.values import DEFINED

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
SECTIONS = {"scene": "Scene", "optics": "Optics", "pixel": "Pixel", "array": "Array"}
"""Sections that may be a part file -> their definitions."""
OVERRIDES = " overrides"
_PART = "The name or path of a part file"


def schemas() -> dict[str, Schema]:
    """File name -> JSON Schema (draft 2020-12) of all files a user writes."""
    return {
        "camera.schema.json": camera_schema(),
        "study.schema.json": study_schema(),
        "technology.schema.json": _whole(_plain(Technology), "Technology", "a technology file"),
    }


def text(schema: Schema) -> str:
    """A schema as the text of its file."""
    return json.dumps(schema, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def camera_schema() -> Schema:
    """The schema of a camera file: sections, part files, `use` and `extends`."""
    schema = _plain(Camera)
    definitions = schema["$defs"]
    body = {name: schema[name] for name in ("type", "properties", "required", "description")}
    definitions["Camera"] = body | {"title": "Camera", "additionalProperties": False}
    _add_overrides(definitions, ["Camera", *SECTIONS.values()])
    base = {
        "type": "string",
        "description": f"{_PART} that this file changes: the rest is taken from it.",
        "examples": ["OTHER.yaml"],
    }
    for section, name in SECTIONS.items():
        for camera in ("Camera", "Camera" + OVERRIDES):
            properties = definitions[camera]["properties"]
            loose = camera != "Camera"
            properties[section] = _section(properties[section], name, loose)
        use: Schema = {"type": "string", "description": f"{_PART} that this section changes."}
        use["examples"] = ["NAME"]
        properties = definitions[name + OVERRIDES]["properties"]
        definitions[name + OVERRIDES]["properties"] = {"use": use, "extends": base} | properties
    loose_camera = definitions["Camera" + OVERRIDES]
    loose_camera["properties"] = {"extends": base} | loose_camera["properties"]
    whole: Schema = {
        "$defs": definitions,
        "type": "object",
        "if": {"required": ["extends"]},
        "then": {"$ref": _ref("Camera" + OVERRIDES)},
        "else": {"$ref": _ref("Camera")},
    }
    return _whole(whole, "Camera", "a camera file")


def study_schema() -> Schema:
    """The schema of a study file: of capture schedules where it says so, else a sweep."""
    definitions: Schema = {}
    for model in (Sweep, ScheduleStudy):
        schema = _plain(model)
        definitions |= schema.pop("$defs") | {model.__name__: schema}
    whole: Schema = {
        "$defs": definitions,
        "type": "object",
        "properties": {"kind": {"enum": list(KINDS)}},
        "if": {"properties": {"kind": {"const": "schedule"}}, "required": ["kind"]},
        "then": {"$ref": _ref(ScheduleStudy.__name__)},
        "else": {"$ref": _ref(Sweep.__name__)},
    }
    return _whole(whole, "Study", "a study file")


def _whole(schema: Schema, name: str, what: str) -> Schema:
    """A schema with its head, its definitions sorted and those in use."""
    head = {"$schema": DIALECT, "title": f"vcam: {what}"}
    rest = {k: v for k, v in schema.items() if k not in ("title", "$defs")}
    definitions = schema.get("$defs", {})
    used = _reachable(rest, definitions)
    return head | rest | {"$defs": {n: definitions[n] for n in sorted(definitions) if n in used}}


def _section(field: Schema, name: str, loose: bool) -> Schema:
    """A section: a part file's name, or a mapping, which need not be whole where it says `use`."""
    changed = {"$ref": _ref(name + OVERRIDES)}
    mapping: Schema = {"type": "object"}
    if loose:
        mapping |= changed
    else:
        whole = {"$ref": _ref(name)}
        some = {"anyOf": [{"required": ["use"]}, {"required": ["extends"]}]}
        mapping |= {"if": some, "then": changed, "else": whole}
    said = {k: v for k, v in field.items() if k != "$ref"}
    part = {"type": "string", "minLength": 1, "description": f"{_PART}."}
    return said | {"anyOf": [part, mapping]}


def _plain(model: type[Model]) -> Schema:
    """Pydantic's schema of a model, with what it cannot know, and its forms gathered."""
    schema = model.model_json_schema(mode="validation")
    definitions = schema.setdefault("$defs", {})
    for each in _models(model):
        body = schema if each is model else definitions.get(each.__name__)
        if body is not None:
            _dress(body, each)
    gathered: Schema = {}
    schema = _gather(schema, gathered)
    schema["$defs"] |= gathered
    return schema


def _models(model: type[BaseModel]) -> list[type[Model]]:
    """All models of camera files that have been defined, `model` first."""
    found: list[type[Model]] = [model]  # type: ignore[list-item]
    queue: list[type[Model]] = [Model]
    while queue:
        for child in queue.pop().__subclasses__():
            queue.append(child)
            if child not in found:
                found.append(child)
    return found


def _dress(body: Schema, model: type[Model]) -> None:
    """Titles with units, defaults as YAML writes them, and second names."""
    defaults = model.model_construct().model_dump(mode="json")
    properties: Schema = {}
    for name, field in model.model_fields.items():
        key = str(field.alias or name)
        if key not in body["properties"]:
            key = name
        one = {k: v for k, v in body["properties"][key].items() if k != "unit"}
        extra = field.json_schema_extra
        unit = extra.get("unit", "") if isinstance(extra, dict) else ""
        one["title"] = f"{key} [{unit}]" if unit else key
        one["description"] = _described(field.description or "")
        one.pop("default", None)  # an SI number; given again below, as YAML writes it
        default = defaults.get(key)
        if default is not None and not isinstance(default, dict):
            one["default"] = default
        properties[key] = one
        if isinstance(field.validation_alias, AliasChoices):
            for other in explain.names(model):
                if explain.names(model)[other] is field and other != key:
                    properties[other] = one | {"title": one["title"].replace(key, other)}
    body["properties"] = properties
    body["description"] = (model.__doc__ or "").strip().partition("\n\n")[0]


def _described(text: str) -> str:
    return text[:1].upper() + text[1:] + "."


def _gather(node: Any, definitions: Schema) -> Any:
    """The schema with every form that has a name of its own moved to the definitions."""
    if isinstance(node, list):
        return [_gather(item, definitions) for item in node]
    if not isinstance(node, dict):
        return node
    if DEFINED not in node:
        return {key: _gather(item, definitions) for key, item in node.items()}
    said = {k: node[k] for k in ("title", "description", "examples", "default") if k in node}
    form = {k: _gather(v, definitions) for k, v in node.items() if k not in (DEFINED, *said)}
    about = node[DEFINED]
    form = {k: v for k, v in about.items() if k != "name"} | form
    if definitions.setdefault(about["name"], form) != form:
        raise ValueError(f"two forms are called {about['name']}")
    return said | {"$ref": _ref(about["name"])}


def _ref(name: str) -> str:
    return f"#/$defs/{name}"


def _refs(node: Any) -> Iterator[str]:
    """The names of all definitions a schema refers to."""
    if isinstance(node, dict):
        target = node.get("$ref")
        if isinstance(target, str):
            yield target.removeprefix("#/$defs/")
        for item in node.values():
            yield from _refs(item)
    elif isinstance(node, list):
        for item in node:
            yield from _refs(item)


def _reachable(node: Any, definitions: Schema) -> set[str]:
    found: set[str] = set()
    queue = list(_refs(node))
    while queue:
        name = queue.pop()
        if name not in found:
            found.add(name)
            queue.extend(_refs(definitions[name]))
    return found


def _add_overrides(definitions: Schema, names: list[str]) -> None:
    """For these definitions, and those below that require a key, one that requires nothing."""
    models = {name for name in definitions if name[0].isupper()}
    strict = {name for name in models if "required" in definitions[name]}
    below = {name: {name, *_reachable(definitions[name], definitions)} for name in models}
    loose = {name for name in models if below[name] & strict} | set(names)

    def rename(name: str) -> str:
        return name + OVERRIDES if name in loose else name

    for name in sorted(loose):
        definitions[name + OVERRIDES] = _loosened(definitions[name], rename)


def _loosened(node: Any, rename: Callable[[str], str]) -> Any:
    if isinstance(node, list):
        return [_loosened(item, rename) for item in node]
    if not isinstance(node, dict):
        return node
    found = {}
    for key, item in node.items():
        if key == "required" and isinstance(item, list):
            continue
        if key == "$ref":
            found[key] = _ref(rename(item.removeprefix("#/$defs/")))
        else:
            found[key] = item if key in ("examples", "default") else _loosened(item, rename)
    return found
