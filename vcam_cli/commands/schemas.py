"""The files that a user writes, and their JSON Schemas.

A schema says less than `vcam validate`: which keys exclude each other, and whatever needs
arithmetic, is checked there.
"""

from vcam_cli.camera.camera import STUDIES, Camera
from vcam_cli.camera.sensor.technology import Technology
from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.config.key_index import Key, keys
from vcam_cli.config.schema import (
    Schema,
    file_schema,
    model_schema,
    part_schema,
    reference,
    with_parts,
)
from vcam_cli.datasets.model import Dataset
from vcam_cli.lenses.table import LensTable
from vcam_cli.sweeps.model import Case, Sweep
from vcam_cli.verification.model import Measurement

SECTIONS = {"scene": "Scene", "optics": "Optics", "pixel": "Pixel", "array": "Array"}
"""Sections of a camera that may be a part file -> their definitions."""


def schemas() -> dict[str, Schema]:
    """Return file name -> JSON Schema (draft 2020-12) of all files a user writes."""
    camera = with_parts(model_schema(Camera), "Camera", SECTIONS, "a camera file")
    return {
        "camera.schema.json": camera,
        "study.schema.json": _study_schema(),
        "lens.schema.json": file_schema(model_schema(LensTable), "a lens: a table of surfaces"),
        "measurement.schema.json": file_schema(model_schema(Measurement), "a measurement file"),
        "technology.schema.json": file_schema(model_schema(Technology), "a technology file"),
        **{
            f"{section}.schema.json": part_schema(camera, name, f"a part file: {section}")
            for section, name in SECTIONS.items()
        },
    }


def _complete_paths(definitions: Schema) -> None:
    """Add the paths of a camera's keys where a sweep has them, to be completed and explained."""
    paths = {key.dotted: _about(key) for key in keys(Camera)}
    sweep, case, drawn = (definitions[m.__name__]["properties"] for m in (Sweep, Case, Dataset))
    listed = (("vary", "", (sweep, case)), ("repeat", "", (sweep,)), ("vary", "drawn ", (drawn,)))
    for name, kind, mappings in listed:
        value = mappings[0][name]["additionalProperties"]
        known = {path: about | value for path, about in paths.items()}
        definitions[f"{kind}{name} paths"] = {"properties": known, "additionalProperties": value}
        for properties in mappings:
            del properties[name]["additionalProperties"]
            properties[name] |= {"$ref": reference(f"{kind}{name} paths")}
    case |= {path: about for path, about in paths.items() if path not in case}


def _about(key: Key) -> Schema:
    """Return what an editor shows of a key."""
    title = f"{key.dotted} [{key.unit}]" if key.unit else key.dotted
    said = f"{key.description[:1].upper()}{key.description[1:]}."
    return {"title": title, "description": said, "examples": [key.example]}


def _study_schema() -> Schema:
    """Return the schema of a study file: the kind that it says it is, else a sweep."""
    definitions: Schema = {}
    for model in (Sweep, ScheduleStudy, Dataset):
        schema = model_schema(model)
        definitions |= schema.pop("$defs") | {model.__name__: schema}
    _complete_paths(definitions)
    either: Schema = {
        "$defs": definitions,
        "type": "object",
        "properties": {"kind": {"enum": list(STUDIES)}},
        **_choice("schedule", ScheduleStudy, _choice("dataset", Dataset, _schema_reference(Sweep))),
    }
    return file_schema(either, "a study file")


def _schema_reference(model: type) -> Schema:
    return {"$ref": reference(model.__name__)}


def _choice(kind: str, model: type, other: Schema) -> Schema:
    """Return the schema of a model where a file says that it is of a kind, else another one."""
    says_so = {"properties": {"kind": {"const": kind}}, "required": ["kind"]}
    return {"if": says_so, "then": _schema_reference(model), "else": other}
