"""What pydantic found, in sentences a user understands.

Every model hands its errors through `sentences`, which knows the model's keys, their examples
and the nearest right name; so an error is said where it is found, and its path is the YAML path.

Why: pydantic speaks of tags, types and inputs. A user wrote a YAML file.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import AliasChoices, BaseModel, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from vcam_cli.errors import Path, Problem, nearest

KIND = "vcam"
NO_SUCH_KEY = "there is no such key here"
_LONGEST = 40


def problems(
    error: ValidationError, model: type[BaseModel] | None = None, tree: object = None
) -> list[Problem]:
    """The problems of a ValidationError, one a mistake, with YAML paths.

    `model` and `tree` (what was validated) are not needed: the models explain themselves.
    """
    found: dict[Problem, None] = {}
    for item in error.errors(include_url=False, include_input=False):
        ctx = item.get("ctx", {})
        message = str(ctx.get("message", item["msg"]))
        found[Problem(tuple(item["loc"]), message, str(ctx.get("remedy", "")))] = None
    return list(found)


def fault(loc: Path, message: str, remedy: str = "", given: object = None) -> InitErrorDetails:
    """One mistake at `loc` below the value being validated, as pydantic carries it."""
    context = {"message": message, "remedy": remedy}
    text = PydanticCustomError(KIND, "{message}; {remedy}" if remedy else "{message}", context)
    return InitErrorDetails(type=text, loc=loc, input=given)


def failure(faults: Iterable[InitErrorDetails], title: str = "camera") -> ValidationError:
    """What a validator raises to report mistakes at places of its own."""
    return ValidationError.from_exception_data(title, list(faults))


def sentences(error: ValidationError, model: type[BaseModel]) -> list[InitErrorDetails]:
    """The mistakes of an error raised while `model` was validated, put into words."""
    known = names(model)
    return [
        _said(item, model)
        for item in error.errors(include_url=False)
        if item["type"] != "extra_forbidden" or item["loc"][0] not in known  # a key's other name
    ]


def repeats(items: Iterable[object]) -> frozenset[int]:
    """Places of the items that came before, in a time that grows as their number does."""
    seen: set[object] = set()
    places = []
    for place, item in enumerate(items):
        try:
            known = item in seen
        except TypeError:  # a list or mapping of YAML
            item = repr(item)
            known = item in seen
        if known:
            places.append(place)
        seen.add(item)
    return frozenset(places)


def shown(value: object) -> str:
    """What was given, short enough for a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return f"a mapping with {', '.join(str(key) for key in list(value)[:4]) or 'no keys'}"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def one_of(value: object, allowed: Iterable[object], also: str = "") -> tuple[str, str]:
    """Message and remedy for a value that is none of the allowed words."""
    words = [str(word) for word in allowed]
    near = nearest(value, words) if len(words) > 1 else None
    listed = ", ".join(words) + (f", or {also}" if also else "")
    message = "is empty" if value is None else f"{shown(value)} is not allowed here"
    if near and near != value:
        return f"{message}; allowed: {listed}", f"did you mean {near}?"
    return message, f"write {listed}" if len(words) == 1 else f"write one of: {listed}"


def names(model: type[BaseModel]) -> dict[str, Any]:
    """The YAML keys of a model -> its fields; a key of two names comes twice."""
    found: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        alias = field.validation_alias
        if isinstance(alias, AliasChoices):
            found |= {str(choice): field for choice in alias.choices}
        else:
            found[str(alias or name)] = field
    return found


def _said(item: Any, model: type[BaseModel]) -> InitErrorDetails:
    loc, kind, given = tuple(item["loc"]), item["type"], item["input"]
    ctx = item.get("ctx", {})
    if kind == KIND:
        return fault(loc, ctx["message"], ctx["remedy"], given)
    if kind == "value_error":
        message, _, remedy = str(ctx["error"]).partition("; ")
        return fault(loc, message, remedy, given)
    fields = names(model)
    key = loc[0] if loc else ""
    field = fields.get(str(key))
    example = _example(field)
    if kind == "missing":
        return fault(loc, "is missing", f"add it, for example {key}: {example}", given)
    if kind in ("extra_forbidden", "invalid_key"):
        return _unknown(loc, key, fields, given)
    if kind == "literal_error" and field is not None:
        return fault(loc, *one_of(given, _literals(ctx)), given=given)
    if given is None:
        return fault(loc, "is empty", f"write for example {example}, or remove the key", given)
    wanted = _WANTED.get(kind)
    message = f"{shown(given)} is not {wanted}" if wanted else f"{shown(given)}: {item['msg']}"
    return fault(loc, message, f"write for example {example}" if example else "", given)


_WANTED = {
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping of keys",
    "model_type": "a mapping of keys",
    "string_pattern_mismatch": "a name of letters, digits, '.', '_' and '-'",
    "string_too_long": "a name of at most 64 characters",
    "string_too_short": "a name",
    "too_short": "long enough a list",
    "too_long": "short enough a list",
}


def _unknown(
    loc: Path, key: object, fields: Mapping[str, object], given: object
) -> InitErrorDetails:
    near = nearest(key, fields)
    allowed = ", ".join(fields) or "none"
    remedy = f"did you mean {near}?" if near else "remove it, or write one of the allowed keys"
    return fault(loc, f"{NO_SUCH_KEY}; allowed: {allowed}", remedy, given)


def _example(field: Any) -> str:
    if field is None or not field.examples:
        return ""
    return in_yaml(field.examples[0])


def in_yaml(value: object) -> str:
    """A value as YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {in_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(in_yaml(item) for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _literals(ctx: Mapping[str, str]) -> list[str]:
    """The words of pydantic's "'a', 'b' or 'c'"."""
    return [word.strip(" '") for word in ctx["expected"].replace(" or ", ",").split(",")]
