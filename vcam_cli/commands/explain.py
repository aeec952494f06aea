"""`vcam explain`: what a key, an effect, a metric, a chart or a word of the trade means."""

import re
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any

import typer

from vcam_cli.commands import options


def explain(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A key (pixel.readout.gain, or gain), effect, metric, chart or word.",
        ),
    ],
    as_json: options.Json = False,
) -> None:
    """Explain a key, effect, metric, chart or term: meaning, unit, default, equation, source.

    \b
    Example:
      vcam explain pixel.readout.read_noise
      vcam explain diffraction
      vcam explain qe
    """
    from vcam_cli.errors import bad, nearest

    entries = list(explanations(name))
    if not entries:
        near = nearest(name, names())
        remedy = f"did you mean {near}?" if near else "`vcam list` shows all names"
        raise bad((), f"no key, effect or term is named {name!r}", remedy)
    if as_json:
        options.write_json({"name": name, "explanations": entries})
        return
    print("\n\n".join(_text(entry) for entry in entries))


def names() -> list[str]:
    """Return all that can be explained."""
    from vcam_cli.camera import hint_tables
    from vcam_cli.camera.scene.sources import CHARTS
    from vcam_cli.commands import glossary
    from vcam_cli.commands.main import COMMANDS
    from vcam_cli.sweeps.quantities import QUANTITIES

    found = [key.dotted for _, key in _all_keys()] + [key.name for _, key in _all_keys()]
    columns = [name for table in glossary.written().values() for name in table]
    words = [*glossary.called(), *glossary.QUANTITIES, *columns, *QUANTITIES, *COMMANDS, *_units()]
    values = [value for value, _ in _values()]
    return [*found, *_effects(), *_metrics(), *CHARTS, *hint_tables.KEYS, *words, *values]


def explanations(name: str) -> Iterator[dict[str, Any]]:
    """Yield the explanation of a name: title, about, and further lines by their headings."""
    from vcam_cli.camera import hint_tables

    yield from _of_unit(name.strip())
    plain = re.sub(r" ?\[.*\]$", "", name.strip())  # of a column with its unit
    word = re.sub(r"^f/[\d.]*$", "f_number", plain.lower().replace(" ", "_"))
    if "." in word:  # a path: nothing else has a dot, and the tables of words take 40 ms
        yield from _of_effect(word)
        yield from (_of_key(where, key) for where, key in _keys_called(word))
        return
    yield from _of_command(word)
    yield from _of_word(word.replace("-", "_"))
    yield from _of_effect(word)
    yield from _of_metric(word)
    yield from _of_chart(word)
    found = _keys_called(word)
    meant = hint_tables.KEYS.get(word.replace("-", "_"))
    if meant:  # what most people mean by the word comes first
        first = _keys_called(meant.partition(": ")[0])
        found = [*first, *(key for key in found if key not in first)]
    yield from (_of_key(where, key) for where, key in found)
    yield from _of_value(word)
    if about := hint_tables.NOT_SIMULATED.get(word.replace("-", "_")):
        yield {"title": f"{word} (not simulated)", "about": f"{about[:1].upper()}{about[1:]}."}
    yield from _of_term(word.replace("-", "_"))


@cache
def _camera_keys() -> tuple[tuple[str, Any], ...]:
    """Return the keys of a camera file, each path once."""
    from vcam_cli.camera.hints import index

    return tuple(("camera file", key) for key in index())


@cache
def _all_keys() -> tuple[tuple[str, Any], ...]:
    """Return all keys that files may have, with the kind of file; each path of a kind once."""
    from vcam_cli.capture_schedules.model import ScheduleStudy
    from vcam_cli.config.key_index import keys
    from vcam_cli.datasets.model import Dataset
    from vcam_cli.sweeps.model import Sweep

    found = list(_camera_keys())
    studies: dict[str, Any] = {
        "sweep study": Sweep,
        "schedule study": ScheduleStudy,
        "data set": Dataset,
    }
    for where, model in studies.items():
        found += [(where, key) for key in {key.path: key for key in keys(model)}.values()]
    return tuple(found)


def _keys_called(word: str) -> list[tuple[str, Any]]:
    """Return the keys of a path, or those whose path ends so."""
    if "." in word:  # studies share no more than first parts with cameras
        whole = [(where, key) for where, key in _camera_keys() if key.dotted.lower() == word]
        if whole:
            return whole
    whole = [(where, key) for where, key in _all_keys() if key.dotted.lower() == word]
    if whole:
        return whole
    ends = [(where, key) for where, key in _all_keys() if key.dotted.lower().endswith(f".{word}")]
    return [found for found in ends if found[1].path[0] != "effects"]


def _of_key(where: str, key: Any) -> dict[str, Any]:
    from vcam_cli.config.validation_messages import yaml_text

    default = "none; it must be given" if key.required else "not given"
    if key.default is not None:
        default = yaml_text(key.default)
    entry = {
        "title": f"{key.dotted} [{key.unit}]" if key.unit else key.dotted,
        "about": f"{key.description[:1].upper()}{key.description[1:]}.",
        "in": where,
        "default": default,
        "example": f"{key.name}: {key.example}",
    }
    of_file = _camera_keys() if where == "camera file" else _all_keys()
    below = [k.name for place, k in of_file if place == where and k.path[:-1] == key.path]
    if below and key.path[0] != "effects":
        entry["keys"] = f"{', '.join(dict.fromkeys(below))}; vcam explain {key.dotted}.{below[0]}"
    if where != "camera file" or key.path[0] == "effects":
        return entry
    effects = [effect for effect in _effects().values() if concerns(effect, key)]
    if effects:
        entry["effect"] = "; ".join(f"{effect.name} ({effect.reference})" for effect in effects)
        entry["see also"] = ", ".join(f"vcam explain {effect.name}" for effect in effects)
    return entry


def concerns(effect: Any, key: Any) -> bool:
    """Return whether an effect is known by a key: it has its name, or says that it needs it.

    Or needs the mapping that the key is in.
    """
    named = any(str(part).startswith(effect.name) for part in key.path)
    places = (key.dotted, key.dotted.rpartition(".")[0])
    needed = (p for p in places if "." in p)  # a section's name is a word of its sentences, too
    return named or any(re.search(rf"{re.escape(p)}(?![.\w])", effect.absent) for p in needed)


def _effects() -> dict[str, Any]:
    from vcam_cli.effects.order import ORDER

    return {effect.name: effect for effect in ORDER}


def _when(effect: Any) -> str:
    """Return where an effect has no part, and whether the plan may skip it."""
    always = effect.absent.startswith("every ")
    present = f"always: {effect.absent}" if always else f"not where {effect.absent}"
    if not effect.removable:
        return f"{present}; the plan never skips it"
    return f"{present}; `vcam plan CAMERA` shows its contribution to that scene"


def _of_effect(word: str) -> Iterator[dict[str, Any]]:
    import inspect

    from vcam_cli.camera.simulation import EFFECTS

    name = word.removeprefix("effects.").replace("-", "_")
    if name not in EFFECTS:
        return
    from vcam_cli.effects.blurs import Blur, FieldTransfer, SeparableTransfer
    from vcam_cli.effects.warps import ImageMotion

    effect = _effects()[name]
    filters = issubclass(effect, Blur | FieldTransfer | SeparableTransfer | ImageMotion)
    cost = "one or two Fourier transforms; the plan shows their time" if filters else "little"
    if effect.seconds_per_pixel:
        cost = f"about {effect.seconds_per_pixel * 1e9:.2g} ns a pixel on one core"
    keys = [
        key.dotted
        for _, key in _camera_keys()
        if key.path[0] != "effects" and len(key.path) > 1 and concerns(effect, key)
    ]
    yield {
        "title": f"{effect.name} (effect of the {effect.origin})",
        "about": " ".join(inspect.cleandoc(effect.__doc__ or "").split()),
        "equation": equation(effect),
        "source": effect.reference,
        "when it matters": _when(effect),
        "cost": cost,
        "keys": ", ".join(keys) or "none of its own",
        "switch": f"effects: {{{effect.name}: off}}",
    }


def equation(effect: Any) -> str:
    """Return the equation of an effect: what is indented first in its module's docstring."""
    import sys

    paragraphs = (sys.modules[effect.__module__].__doc__ or "").split("\n\n")
    return next(" ".join(text.split()) for text in paragraphs if text.startswith("    "))


def _metrics() -> dict[str, str]:
    from vcam_cli.commands.list_ import KINDS

    return {item.name: item.about for item in KINDS["metrics"]()}


def _of_metric(word: str) -> Iterator[dict[str, Any]]:
    names = (word, word.replace("_", "-"), f"{word}_db")
    called = next((name for name in names if name in _metrics()), None)
    if called is not None:
        about = _metrics()[called]
        yield {"title": f"{called} (metric)", "about": f"{about[:1].upper()}{about[1:]}."}


def _of_chart(word: str) -> Iterator[dict[str, Any]]:
    from vcam_cli.camera.scene.sources import CHARTS
    from vcam_cli.config.key_index import keys

    chart = CHARTS.get(word.replace("_", "-"))
    if chart is None:
        return
    own = [key for key in keys(chart) if key.name not in ("kind", "chart")]
    needed = [f"{key.name}: {key.example}" for key in own if key.required and len(key.path) == 1]
    named = ", ".join(("kind: chart", f"chart: {word.replace('_', '-')}", *needed))
    yield {
        "title": f"{word.replace('_', '-')} (chart)",
        "about": (chart.__doc__ or "").strip(),
        "keys": "; ".join(f"{key.name}: {key.example} ({key.description})" for key in own)
        or "none",
        "example": f"source: {{{named}}}",
    }


def _of_command(word: str) -> Iterator[dict[str, Any]]:
    """Yield what a command does: the first line of its help."""
    from importlib import import_module

    from vcam_cli.commands.main import COMMANDS

    if word not in COMMANDS:
        return
    module, function = COMMANDS[word].split(":")
    called = getattr(import_module(f"vcam_cli.commands.{module}"), function)
    about = (called.__doc__ or "").strip().partition("\n\n")[0]
    yield {
        "title": f"vcam {word} (command)",
        "about": " ".join(about.split()),
        "more": f"vcam {word} -h",
    }


def _of_word(word: str) -> Iterator[dict[str, Any]]:
    """Yield a term of the trade, and what a quantity or column of a table is."""
    from vcam_cli.commands import glossary
    from vcam_cli.sweeps.quantities import QUANTITIES, unit

    about = glossary.COLUMNS.get(word)
    # Which tables have a column only their writers know: they bring the engine with them.
    written = glossary.written() if about else {}
    tables = [name for name, columns in written.items() if word in columns]
    if tables and about:
        entry = {"title": f"{word} (column)", "about": _sentence(about)}
        yield entry | {"in": ", ".join(tables)}
    about = glossary.QUANTITIES.get(word)
    if about is None and word in QUANTITIES and word not in _metrics():
        about = f"property of a camera that studies take, `{word}`"
        about += f" [{unit(word)}]" if unit(word) else ""
        if _keys_called(word):  # which is explained as a key
            about = None
    if about is not None and not tables:
        yield {"title": word, "about": _sentence(about)}


def _of_term(word: str) -> Iterator[dict[str, Any]]:
    """Yield the definition of a term of the field."""
    from vcam_cli.commands import glossary

    term = glossary.called().get(word)
    if term is None:
        return
    others = [name for name in (term.name, *term.also) if name != word]
    lines = {
        "also called": ", ".join(name.replace("_", " ") for name in others),
        "symbol": term.symbol,
        "unit": term.unit,
        "standard": term.standard,
    }
    entry = {"title": f"{word} (term)", "about": _sentence(term.definition)}
    yield entry | {heading: said for heading, said in lines.items() if said}


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _units() -> dict[str, str]:
    """Return units, and how they are also written, with what they measure."""
    from vcam_cli.units import DIMENSIONS

    found = {unit: kind.title for kind in DIMENSIONS.values() for unit in kind.units}
    also = {"e-": "e", "electrons": "e", "electron": "e", "lux": "lx", "ADU": "DN", "LSB": "DN"}
    also |= {"ADU/e-": "DN/e", "DN/e-": "DN/e", "e-/s": "e/s", "uV/e-": "uV/e"}
    found |= {word: f"{found[unit]}; files write {unit}" for word, unit in also.items()}
    inverse = f"{found['DN/e']}, inverted; files write DN/e: 2.5 {{}} is 0.4 DN/e"
    return found | {unit: inverse.format(unit) for unit in ("e-/ADU", "e/ADU", "e-/DN", "e/DN")}


def _of_unit(name: str) -> Iterator[dict[str, Any]]:
    """Yield what a unit measures."""
    word = re.sub(r"^[\d.]+ +", "", name)
    about = _units().get(word)
    if about is not None:
        yield {"title": f"{word} (unit)", "about": f"Unit of {about}."}


@cache
def _values() -> tuple[tuple[str, Any], ...]:
    """Return words that stand as values, with their keys."""
    from vcam_cli.camera.hints import index

    found = []
    for key in index():
        field = key.model.model_fields.get(key.name)
        if field is not None and key.path[0] != "effects":
            found += [(word, key) for word in dict.fromkeys(_literals(field))]
    return tuple(found)


def _literals(forms: Any) -> Iterator[str]:
    """Yield the words among the forms of a value."""
    from typing import Literal, get_args, get_origin

    from pydantic import BaseModel
    from pydantic.fields import FieldInfo

    from vcam_cli.config.yaml_type import YamlType

    if isinstance(forms, FieldInfo):
        yield from _literals((forms.annotation, *forms.metadata))
    elif isinstance(forms, YamlType):
        yield from _literals(forms.forms)
    elif isinstance(forms, tuple):
        for form in forms:
            yield from _literals(form)
    elif get_origin(forms) is Literal:
        yield from (word for word in get_args(forms) if isinstance(word, str))
    elif not (isinstance(forms, type) and issubclass(forms, BaseModel)):
        yield from _literals(get_args(forms))


def _of_value(word: str) -> Iterator[dict[str, Any]]:
    """Yield the keys that a word is a value of."""
    for value, key in _values():
        if value == word.replace("_", "-") or value == word:
            about = f"{key.description[:1].upper()}{key.description[1:]}."
            yield {
                "title": f"{value} (value of {key.dotted})",
                "about": about,
                "example": f"{key.name}: {value}",
            }


def _text(entry: dict[str, Any]) -> str:
    import textwrap

    lines = [entry["title"]]
    width = options.line_width()
    lines += textwrap.wrap(entry["about"], width, initial_indent="  ", subsequent_indent="  ")
    for heading, said in entry.items():
        if heading not in ("title", "about"):
            lines += textwrap.wrap(
                f"{heading}: {said}",
                width,
                initial_indent="  ",
                subsequent_indent="    ",
                break_long_words=False,
                break_on_hyphens=False,
            )
    return "\n".join(lines)
