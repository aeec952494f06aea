"""Pages of the documentation that list every key of a kind of file, from its models."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent


def camera_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    """Return title, introduction, keys and schema's definitions of camera files."""
    from vcam_cli.camera.hints import index

    about = "Every key of a camera file. `vcam explain KEY` says the same in a terminal."
    return "Keys of a camera file", about, index(), _definitions("camera")


def study_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    """Return the same of studies."""
    from vcam_cli.capture_schedules.model import ScheduleStudy
    from vcam_cli.config.key_index import keys
    from vcam_cli.datasets.model import Dataset
    from vcam_cli.sweeps.model import Sweep

    found = [
        (kind, key)
        for kind, model in (("sweep", Sweep), ("schedule", ScheduleStudy), ("dataset", Dataset))
        for key in {key.path: key for key in keys(model)}.values()
    ]
    about = (
        "Every key of a sweep study (`kind: sweep`), of a schedule (`kind: schedule`), and of a"
        " data set (`kind: dataset`)."
    )
    return "Keys of studies", about, found, _definitions("study")


def measurement_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    """Return the same of measurements."""
    from vcam_cli.config.key_index import keys
    from vcam_cli.verification.model import Measurement

    about = (
        "Every key of a file of measured signals or frames (`kind: measurement`), for `vcam verify`"
        " and `vcam fit`."
    )
    found = {key.path: ("measurement", key) for key in keys(Measurement)}
    return "Keys of measurements", about, found.values(), _definitions("measurement")


def _definitions(name: str) -> dict[str, Any]:
    schema = json.loads((ROOT / "schemas" / f"{name}.schema.json").read_text("utf-8"))
    return dict(schema["$defs"])


def keys_page(title: str, about: str, keys: Iterable[Any], definitions: dict[str, Any]) -> str:
    """Return the page: an entry a key, in the order of the models."""
    lines, section = [f"# {title}", "", about, ""], ""
    for item in keys:
        kind, key = item if isinstance(item, tuple) else ("", item)
        first = kind or str(key.path[0])
        if first != section:
            lines += [f"## {first}", ""]
            section = first
        anchor = f"{kind}.{key.dotted}" if kind else key.dotted
        lines += [f"### `{key.dotted}` {{ #{anchor} }}", "", *_key_lines(key, definitions), ""]
    return "\n".join(lines)


def _key_lines(key: Any, definitions: dict[str, Any]) -> Iterator[str]:
    from vcam_cli.config.validation_messages import yaml_text

    yield sentence(escaped(key.description)) + "\n"
    if key.unit:
        yield f"- unit: `{key.unit}`"
    if key.required:
        yield "- must be given"
    elif key.default is not None:
        yield f"- default: `{yaml_text(key.default)}`"
    else:
        yield "- default: not given"
    field = definitions.get(key.model.__name__, {}).get("properties", {}).get(key.name)
    allowed = _allowed(field, definitions) if field else ""
    if allowed:
        yield f"- allowed: {allowed}"
    if key.example:
        yield f"- example: `{key.name}: {key.example}`"
    effects = _effects_of(key)
    if effects:
        yield "- effect: " + ", ".join(f"[{name}](effects.md#{name})" for name in effects)


def _effects_of(key: Any) -> list[str]:
    from vcam_cli.commands.explain import concerns
    from vcam_cli.effects.order import ORDER

    if key.path[0] in ("effects", "kind", "vary", "pdf", "sensor"):
        return []
    return [effect.name for effect in ORDER if concerns(effect, key)]


def _allowed(field: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Return what a field's schema allows, in words."""
    forms = [_form(form, definitions) for form in field.get("anyOf", [field])]
    mappings = [form for form in forms if form.startswith("a mapping")]
    if len(mappings) > 2:
        forms = [form for form in forms if form not in mappings] + ["one of several mappings"]
    return " or ".join(dict.fromkeys(form for form in forms if form))


def _form(form: dict[str, Any], definitions: dict[str, Any]) -> str:
    if "const" in form:
        return f"`{form['const']}`"
    if "enum" in form:
        return ", ".join(f"`{json.dumps(word).strip(chr(34))}`" for word in form["enum"])
    if "$ref" in form:
        return _referred(form["$ref"].rpartition("/")[2], definitions)
    kind = form.get("type")
    if kind in ("number", "integer"):
        return _range(form, kind)
    words = {"boolean": "`true`, `false`", "array": "a list", "object": "a mapping"}
    if kind == "array" and "items" in form:
        inside = _allowed(form["items"], definitions)
        return f"a list of {inside}" if inside else "a list"
    if kind == "string" and "%" in form.get("pattern", ""):
        return "a percentage"
    return words.get(str(kind), "")


def _referred(name: str, definitions: dict[str, Any]) -> str:
    if definitions.get(name, {}).get("properties"):
        return f"a mapping of {', '.join(f'`{k}`' for k in definitions[name]['properties'])}"
    if name.startswith("spectrum"):
        return "a [spectrum](../camera-file.md#spectra)" + " of at most 1" * name.endswith("_1")
    return f"a {name.replace('_', ' ')} with its unit"


def _range(form: dict[str, Any], kind: str) -> str:
    low, high = form.get("minimum"), form.get("maximum")
    above, below = form.get("exclusiveMinimum"), form.get("exclusiveMaximum")
    name = "a whole number" if kind == "integer" else "a number"
    limits = [
        f"from {low:g}" if low is not None else f"above {above:g}" if above is not None else ""
    ]
    limits.append(f"to {high:g}" if high is not None else f"below {below:g}" if below else "")
    return " ".join([name, *filter(None, limits)])


def sentence(text: str) -> str:
    """Return text with a capital at its beginning and a point at its end."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def escaped(text: str) -> str:
    """Return text that Markdown shows as it is; code between backticks needs no escapes."""
    parts = text.split("`")
    for i in range(0, len(parts), 2 if len(parts) % 2 else 1):
        parts[i] = re.sub(r"([*_<>\[\]{}|#])", r"\\\1", parts[i])
    return "`".join(parts)
