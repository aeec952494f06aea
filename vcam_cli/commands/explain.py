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
        remedy = f"did you mean {near}?" if near else "`vcam list` shows what there is"
        raise bad((), f"nothing here is called {name!r}", remedy)
    if as_json:
        options.write_json({"name": name, "explanations": entries})
        return
    print("\n\n".join(_text(entry) for entry in entries))


def names() -> list[str]:
    """Return all that can be explained."""
    from vcam_cli.camera import hint_tables
    from vcam_cli.camera.scene.sources import CHARTS

    found = [key.dotted for _, key in _all_keys()] + [key.name for _, key in _all_keys()]
    return [*found, *_effects(), *_metrics(), *CHARTS, *hint_tables.KEYS]


def explanations(name: str) -> Iterator[dict[str, Any]]:
    """Yield what there is to say of a name: title, about, and further lines by their headings."""
    from vcam_cli.camera import hint_tables

    word = re.sub(r"^f/[\d.]*$", "f_number", name.strip().lower().replace(" ", "_"))
    yield from _of_effect(word)
    yield from _of_metric(word)
    yield from _of_chart(word)
    found = _keys_called(word)
    meant = hint_tables.KEYS.get(word.replace("-", "_"))
    if meant:  # what most people mean by the word comes first
        first = _keys_called(meant.partition(": ")[0])
        found = [*first, *(key for key in found if key not in first)]
    yield from (_of_key(where, key) for where, key in found)
    if about := hint_tables.NOT_SIMULATED.get(word.replace("-", "_")):
        yield {"title": f"{word} (not simulated)", "about": f"{about[:1].upper()}{about[1:]}."}


@cache
def _all_keys() -> tuple[tuple[str, Any], ...]:
    """Return all keys that files may have, with the kind of file; each path of a kind once."""
    from vcam_cli.camera.hints import index
    from vcam_cli.capture_schedules.model import ScheduleStudy
    from vcam_cli.config.key_index import keys
    from vcam_cli.datasets.model import Dataset
    from vcam_cli.sweeps.model import Sweep

    found = [("camera file", key) for key in index()]
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
    whole = [(where, key) for where, key in _all_keys() if key.dotted.lower() == word]
    ends = [(where, key) for where, key in _all_keys() if key.dotted.lower().endswith(f".{word}")]
    return whole or [found for found in ends if found[1].path[0] != "effects"]


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
    effects = [effect for effect in _effects().values() if concerns(effect, key)]
    if where == "camera file" and effects and key.path[0] != "effects":
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


def _of_effect(word: str) -> Iterator[dict[str, Any]]:
    import inspect

    from vcam_cli.effects.base import Blur, FieldTransfer, ImageMotion, SeparableTransfer

    effect = _effects().get(word.removeprefix("effects.").replace("-", "_"))
    if effect is None:
        return
    filters = issubclass(effect, Blur | FieldTransfer | SeparableTransfer | ImageMotion)
    cost = "a transform or two; the plan says how long they take" if filters else "little"
    if effect.seconds_per_pixel:
        cost = f"about {effect.seconds_per_pixel * 1e9:.2g} ns a pixel on one core"
    keys = [
        key.dotted
        for where, key in _all_keys()
        if where == "camera file"
        and key.path[0] != "effects"
        and len(key.path) > 1
        and concerns(effect, key)
    ]
    yield {
        "title": f"{effect.name} (effect of the {effect.origin})",
        "about": " ".join(inspect.cleandoc(effect.__doc__ or "").split()),
        "equation": equation(effect),
        "source": effect.reference,
        "when it matters": f"not where {effect.absent}"
        + (
            "; else `vcam plan CAMERA` says how much it changes for that scene"
            if effect.removable
            else "; the plan never leaves it out"
        ),
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
    yield {
        "title": f"{word.replace('_', '-')} (chart)",
        "about": (chart.__doc__ or "").strip(),
        "keys": "; ".join(f"{key.name}: {key.example} ({key.description})" for key in own)
        or "none",
        "example": f"source: {{kind: chart, chart: {word.replace('_', '-')}}}",
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
