"""What pydantic found, in sentences a user understands.

Every model hands its errors through `explanations`, which knows the model's keys, their examples
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
"""Pydantic's type of an error -> what the value should have been."""


def problems(error: ValidationError) -> list[Problem]:
    """Return the problems of a ValidationError, one a mistake, with YAML paths."""
    found: dict[Problem, None] = {}
    for item in error.errors(include_url=False, include_input=False):
        ctx = item.get("ctx", {})
        message = str(ctx.get("message", item["msg"]))
        found[Problem(tuple(item["loc"]), message, str(ctx.get("remedy", "")))] = None
    return list(found)


def fault(loc: Path, message: str, remedy: str = "", given: object = None) -> InitErrorDetails:
    """Return one mistake at `loc` below the value being validated, as pydantic carries it."""
    context = {"message": message, "remedy": remedy}
    text = PydanticCustomError(KIND, "{message}; {remedy}" if remedy else "{message}", context)
    return InitErrorDetails(type=text, loc=loc, input=given)


def failure(faults: Iterable[InitErrorDetails]) -> ValidationError:
    """Return what a validator raises to report mistakes at places of its own."""
    return ValidationError.from_exception_data("file", list(faults))


def refusal(loc: Path, message: str, remedy: str = "", given: object = None) -> ValidationError:
    """Return what a validator raises to report one mistake at a place of its own."""
    return failure([fault(loc, message, remedy, given)])


def faults_at(place: str | int, error: ValueError, given: object) -> list[InitErrorDetails]:
    """Return the mistakes of an item of a list or mapping, at its place."""
    if isinstance(error, ValidationError):
        return [fault((place, *p.path), p.message, p.remedy, given) for p in problems(error)]
    message, _, remedy = str(error).partition("; ")
    return [fault((place,), message, remedy, given)]


def describe(value: object) -> str:
    """Return what was given, short enough for a message."""
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
    """Return message and remedy for a value that is not an allowed word."""
    words = [str(word) for word in allowed]
    near = nearest(value, words) if len(words) > 1 else None
    listed = ", ".join(words) + (f", or {also}" if also else "")
    message = "is empty" if value is None else f"{describe(value)} is not allowed here"
    if near and near != value:
        return f"{message}; allowed: {listed}", f"did you mean {near}?"
    return message, f"write {listed}" if len(words) == 1 else f"write one of: {listed}"


def key_fields(model: type[BaseModel]) -> dict[str, Any]:
    """Return the YAML keys of a model -> its fields; a key of two names comes twice."""
    found: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        alias = field.validation_alias
        if isinstance(alias, AliasChoices):
            found |= {str(choice): field for choice in alias.choices}
        else:
            found[str(alias or name)] = field
    return found


def yaml_text(value: object) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {yaml_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(yaml_text(item) for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def explanations(error: ValidationError, model: type[BaseModel]) -> list[InitErrorDetails]:
    """Return the mistakes of an error raised while `model` was validated, put into words."""
    fields = key_fields(model)
    return [
        _explanation(item, fields)
        for item in error.errors(include_url=False)
        if item["type"] != "extra_forbidden" or item["loc"][0] not in fields  # a key's other name
    ]


def _explanation(item: Any, fields: Mapping[str, Any]) -> InitErrorDetails:
    loc, kind, given = tuple(item["loc"]), item["type"], item["input"]
    ctx = item.get("ctx", {})
    if kind == KIND:
        return fault(loc, ctx["message"], ctx["remedy"], given)
    if kind == "value_error":
        message, _, remedy = str(ctx["error"]).partition("; ")
        return fault(loc, message, remedy, given)
    key = loc[0] if loc else ""
    field = fields.get(str(key))
    example = yaml_text(field.examples[0]) if field is not None and field.examples else ""
    if kind == "missing":
        return fault(loc, "is missing", f"add it, for example {key}: {example}", given)
    if kind in ("extra_forbidden", "invalid_key"):
        return _unknown(loc, key, fields, given)
    if kind == "literal_error" and field is not None:
        return fault(loc, *one_of(given, _literals(ctx)), given=given)
    if given is None:
        return fault(loc, "is empty", f"write for example {example}, or remove the key", given)
    wanted = _WANTED.get(kind)
    message = (
        f"{describe(given)} is not {wanted}" if wanted else f"{describe(given)}: {item['msg']}"
    )
    return fault(loc, message, f"write for example {example}" if example else "", given)


def _unknown(
    loc: Path, key: object, fields: Mapping[str, object], given: object
) -> InitErrorDetails:
    near = nearest(key, fields)
    allowed = ", ".join(fields) or "none"
    remedy = f"did you mean {near}?" if near else "remove it, or write one of the allowed keys"
    return fault(loc, f"{NO_SUCH_KEY}; allowed: {allowed}", remedy, given)


def _literals(ctx: Mapping[str, str]) -> list[str]:
    """Return the words of pydantic's "'a', 'b' or 'c'"."""
    return [word.strip(" '") for word in ctx["expected"].replace(" or ", ",").split(",")]
