"""Words of photographers, data sheets and other simulators, led to the keys that they mean.

A camera file is written by someone who knows cameras and not yet this file. `hint_tables` has their
words, with keys as a file may have them; here are the rules by which these are found.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import PurePath

from vcam_cli import units
from vcam_cli.camera.hint_tables import (
    BARE,
    DATA,
    ELSEWHERE,
    FOREIGN,
    FORMS,
    KEYS,
    NOT_SIMULATED,
    PICTURES,
    SECTIONS,
    SIDES_SEEN,
    SWITCHES,
    VALUES,
)
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.scene.sources import CHARTS
from vcam_cli.config.key_index import Key, keys
from vcam_cli.config.validation_messages import NO_SUCH_KEY, yaml_text
from vcam_cli.errors import Path, Problem, dotted_path, nearest

AT_MOST_1 = "it must be at most 1"
"""What is said of a fraction that is too large, mostly since it is in percent."""
_SEPARATE = {"name", "kind", "file", "value", "rows", "columns"}
"""Keys that many mappings have: elsewhere they mean something else."""
NOTHING = {"none", "off", "no", "false", "0"}
"""Words for what is not to be."""
_CLOSE = 0.75
"""How alike a word must be to one of another section."""
_FILM_DIAGONAL = math.hypot(36, 24)
"""Of the frame that focal lengths are equivalent to [mm]."""
_NUMBER = re.compile(r"[A-Za-z/ .=-]*?(\d+(?:\.\d+)?)[ -]*([kM]?)[A-Za-z ]*")
"""A number among letters: ISO800, 10 bit, 3024 px."""
_DECIBELS = re.compile(r"([+-]?\d{1,2}(?:\.\d+)?) ?dB")
_SIZE = re.compile(r"(\d+) *[xX*×] *(\d+)|(\d{1,3}(?:\.\d+)?) *(?:MP|Mpx|megapixels?)?")
"""Columns and rows, or millions of pixels."""


@cache
def index() -> tuple[Key, ...]:
    """Return all keys of a camera file, each path once; those of a technology file aside."""
    found = {
        key.path: key for key in reversed(list(keys(CameraModel))) if "from" not in key.path[:-1]
    }
    return tuple(reversed(found.values()))


def set_option(name: str) -> str:
    """Return the `--set` that is meant by an option that no command has; "" for none known."""
    word = _plain(name.lstrip("-"))
    entry = re.split(" or | and ", _meant_key((word,), None))[0]
    path, _, value = entry.partition(": ")
    key = next((key for key in index() if f"write {key.dotted}" == path), None)
    if key is not None and value == "false":  # who names a switch wants it
        value = "true"
    if path.startswith("write "):
        return f'--set {path.removeprefix("write ")}="{value}"'
    return f"--set {word}.KEY=VALUE" if word in CameraModel.model_fields else ""


def advise(problem: Problem, given: object) -> Problem:
    """Return a problem with the remedy of someone who knows cameras, where there is one.

    Parameters
    ----------
    problem : Problem
        What the model says.
    given : object
        What stands at its path, as YAML has it.
    """
    if problem.message.startswith(NO_SUCH_KEY):
        meant = _meant_key(problem.path, given)
    else:
        meant = _meant_value(problem, given)
    return replace(problem, remedy=meant) if meant else problem


def _meant_key(path: Path, given: object) -> str:
    """Return which key is meant by one that is not there; "" for none that is known."""
    word, above = _plain(path[-1]), tuple(path[:-1])
    if word in NOT_SIMULATED:
        return f"remove it, as this is not simulated: {NOT_SIMULATED[word]}"
    if dotted := _below(path):
        return f"write {_nested(dotted.path[len(above) :], _value(given, dotted, dotted.example))}"
    if "readout_time" in word and (meant := _line_time(yaml_text(given))):
        return meant
    if path == ("kind",):
        return "remove it: a file without kind is a camera"
    if isinstance(path[-1], int) and given is None:
        return "write numbers with a decimal point, as in 2.8"
    if "equivalent" in word or "35mm" in word:
        return _field_of_view(yaml_text(given))
    if isinstance(given, Mapping) and (meant := _meant_section(word, given)):
        return meant
    here = [key.name for key in index() if key.path[:-1] == above]
    if word == "shutter" and isinstance(given, str) and (meant := _shutter(given)):
        return meant
    if word == "noise" and not above and _plain(yaml_text(given)) in NOTHING:
        return f"write {ELSEWHERE[('effects',)]['noise']}"
    if said := ELSEWHERE.get(above, {}).get(word):
        return f"write {_with_value(said, given)}"
    if (
        path[0] in ("processing", "accuracy")
        or "technology" in above
        or word in {_plain(name) for name in here}
    ):
        return ""
    if word in KEYS:
        return f"write {_entry(word, given)}"
    places = [key for key in index() if key.path[0] != "effects" and "technology" not in key.path]
    same = sorted((key for key in places if key.name == word), key=lambda key: len(key.path))
    if same and word not in _SEPARATE:
        return "write " + " or ".join(_place(key, given) for key in same[:3])
    if len(word) < 4 or word in SECTIONS or nearest(word, here):
        return ""
    close = nearest(word, [*(key.name for key in places), *KEYS], _CLOSE)
    if close is not None and close in KEYS:
        return f"write {_entry(close, given)}"
    same = [key for key in places if key.name == close]
    return f"did you mean {_place(same[0], given)}?" if same else ""


def _below(path: Path) -> Key | None:
    """Return the key that is meant by a name with dots in it, such as optics.focal_length."""
    if not isinstance(path[-1], str) or "." not in path[-1]:
        return None
    meant = (*path[:-1], *path[-1].split("."))
    return next((key for key in index() if key.path == meant), None)


def _nested(path: Path, value: str) -> str:
    """Return a key as a file has it: a mapping in each section that leads to it."""
    first, *rest = path
    return f"{first}: {{{_nested(tuple(rest), value)}}}" if rest else f"{first}: {value}"


def _line_time(text: str) -> str:
    """Return what is meant by the time that all rows take; "" for no time."""
    try:
        number, unit = units.split(text)
        units.convert(number, unit, "s")
    except ValueError:
        return ""
    each = units.render(units.parse(f"{float(number / 1000):.6g} {unit}", "time"), "time")
    return (
        "write exposure.shutter: {rolling: {line_time: ..}}, the time from a row to the next:"
        f" {text} over 1000 rows are line_time: {each}"
    )


def _shutter(text: str) -> str:
    """Return what is meant by a shutter: how rows are exposed, or how long; "" for neither."""
    if _plain(text) == "global":
        return "write exposure.shutter: global"
    try:
        units.parse(text if re.search("[a-z]", text) else f"{text} s", "time")
    except ValueError:
        return ""
    return f"write exposure.time: {text if re.search('[a-z]', text) else text + ' s'}"


def _meant_section(word: str, given: Mapping[object, object]) -> str:
    """Return which key is meant by one in a section that is not there, such as lens.f_number."""
    if word not in SECTIONS or len(given) != 1:
        return ""
    (name, value), sections = next(iter(given.items())), SECTIONS[word]
    found = [key for key in index() if key.name == name and key.path[0] in sections]
    if not found:
        return _meant_key((word, str(name)), value)
    first = min(found, key=lambda key: (len(key.path), sections.index(str(key.path[0]))))
    return f"write {_place(first, value)}"


def _field_of_view(text: str) -> str:
    """Return the field of view of a focal length that is equivalent on film; "" for no number."""
    match = _NUMBER.fullmatch(re.sub(r"35 ?mm|\(|\)", "", text))
    if match is None or not float(match[1]):
        return ""
    angle = math.degrees(2 * math.atan(_FILM_DIAGONAL / 2 / float(match[1])))
    return (
        f"write optics.field_of_view: {angle:.3g} deg, the diagonal that {match[1]} mm have there"
    )


def _entry(word: str, given: object) -> str:
    """Return what is meant by a word of `KEYS`, with the value that was given if it will do."""
    if word in SIDES_SEEN:
        angle = _with_value(KEYS["fov"], given).partition(": ")[2]
        return f"optics.field_of_view: {{{SIDES_SEEN[word]}: {angle}}}"
    meant = _with_value(KEYS[word], given)
    if word in ("fov", "angle_of_view"):
        angle = meant.partition(": ")[2]
        meant += f", which is over the diagonal, or {{horizontal: {angle}}}"
    return meant


def _with_value(entry: str, given: object) -> str:
    """Return an entry "path: value", with the value that was given if it will do."""
    path, _, example = entry.partition(": ")
    if " and " in entry and (size := _SIZE.fullmatch(yaml_text(given).strip())):
        width, height = size[1], size[2]
        if width is None:  # of a picture of 4:3
            height = round(math.sqrt(float(size[3]) * 1e6 * 3 / 4))
            width = round(height * 4 / 3)
        return f"array.columns: {width} and array.rows: {height}"
    key = next((key for key in index() if key.dotted == path), None)
    if isinstance(given, Mapping) and len(given) == 1 and not example.startswith("{"):
        given = next(iter(given.values()))  # noise: {read: 5 e}
    if key is not None and (file := _in_file(key.path, given)):
        return f"{path}: {file}"
    return f"{path}: {_value(given, key, example)}" if key else entry


def _in_file(path: Path, given: object) -> str:
    """Return the mapping that names a file of data; "" where no key there is a file's."""
    file = next((key for key in index() if key.path == (*path, "file")), None)
    if file is None or not isinstance(given, str) or PurePath(given).suffix.lower() not in DATA:
        return ""
    beside = [key for key in index() if key.path[:-1] == path and key.model is file.model]
    needed = [f"{key.name}: {key.example}" for key in beside if key.required][1:]
    return f"{{{', '.join((f'file: {given}', *needed))}}}"


def _place(key: Key, given: object) -> str:
    """Return a key as a file has it, with the value that was given if it will do."""
    value = _value(given, key, key.example)
    if key.path[0] == "processing":
        return f"a step of processing: - {key.name}: {value}"
    return f"{key.dotted}: {value}"


def _value(given: object, key: Key, example: str) -> str:
    """Return the value that was given, where it may be one of the key, or else an example."""
    if isinstance(given, bool) or not isinstance(given, (str, int, float)) or example[:1] in "[{":
        return example
    text = in_electrons(yaml_text(given))
    if known := VALUES.get(key.dotted, {}).get(_plain(text)):
        return known
    if key.name == "f_number":
        text = re.sub(r"^[fF] ?/? ?", "", text)
    try:
        number, unit = units.split(text)
        if not unit and key.unit:
            meant = "s" if "/" in text and key.unit == "ms" else BARE.get(key.unit)
            return f"{text} {meant}" if meant else example
        if unit == "%" and not key.unit:
            return text
        units.convert(number, unit, key.unit)
    except ValueError:
        return example
    return text


def in_electrons(text: str) -> str:
    """Return a quantity with electrons as a file writes it: 6 e for 6 e-, 6 e- rms, 6 electrons."""
    text = re.sub(r" ?rms$|/(pix|px|pixel)(?=/|$)", "", text.strip())
    return re.sub(r"(?<![a-z])(k?)(e-|electrons?)(?=$|/)", r"\1e", text)


def _meant_value(problem: Problem, given: object) -> str:
    """Return what is meant by a value that is not allowed at its key; "" where that is unknown."""
    path = dotted_path(tuple(part for part in problem.path if not isinstance(part, int)))
    word = yaml_text(given) if isinstance(given, (str, int, float)) else ""
    if not word:
        return ""
    if meant := VALUES.get(path, {}).get(_plain(word)):
        return f"write {meant}"
    if " unit 'dB'" in problem.message and (decibels := _DECIBELS.fullmatch(word)):
        return f"write {10 ** (float(decibels[1]) / 20):.4g}, as {word} are 20 log10 of it"
    for form, remedy in FORMS.get(path, ()):
        if match := re.fullmatch(form, word.strip()):
            return match.expand(remedy)
    if problem.path == ("adc", "gain") and (meant := _in_codes_per_electron(word)):
        return f"write {meant}"
    if (plain := in_electrons(word)) != word and " unit " in problem.message:
        return f"write {plain}"
    if "equivalent" in word and (meant := _field_of_view(word)):
        return f"{meant}, in its place"
    if meant := _as_written(f"{problem.message}; {problem.remedy}", word):
        return f"write {meant}"
    if problem.remedy == AT_MOST_1 and isinstance(given, (int, float)) and 1 < given <= 100:
        percent = f"write {word} %, or {given / 100:g}"
        return percent if given >= 2 else f"{AT_MOST_1}; if a percentage is meant, {percent}"
    if "is not true or false" in problem.message and _plain(word) in SWITCHES:
        return f"write {SWITCHES[_plain(word)]}"
    if problem.path[0] == "effects" and len(problem.path) == 2 and _plain(word) in SWITCHES:
        return f"write {'on' if SWITCHES[_plain(word)] == 'true' else 'off'}"
    if path == "scene.source":
        if PurePath(word).suffix.lower() in PICTURES:
            return f"write {{kind: image, file: {word}}}"
        chart = VALUES["scene.source.chart"].get(_plain(word)) or nearest(word, CHARTS)
        return f"write {{kind: chart, chart: {chart}}}" if chart else ""
    if file := _in_file(problem.path, word):
        return f"write {file}"
    key = next((key for key in index() if key.path == problem.path), None)
    if key is not None and key.unit and "bare number" in problem.message:
        before, has_example, _ = problem.remedy.partition("for example ")
        example = f"{word} {BARE[key.unit]}" if key.unit in BARE else key.example
        return f"{before}for example {example}" if has_example else ""
    return ""


def _in_codes_per_electron(text: str) -> str:
    """Return a gain in DN/e for one in ADU/e-, or in e-/ADU, which is its inverse; "" for none."""
    match = re.fullmatch(r"([\d.eE+-]+) ?([A-Za-z-]+)/([A-Za-z-]+)", in_electrons(text))
    if match is None:
        return ""
    codes, electrons = {"DN", "ADU", "LSB", "counts", "count"}, {"e", "e-", "electron", "electrons"}
    try:
        number = float(match[1])
    except ValueError:
        return ""
    if match[2] in codes and match[3] in electrons:
        return f"{number:.6g} DN/e"
    if match[2] in electrons and match[3] in codes and number:
        return f"{1 / number:.6g} DN/e, the inverse of {text}"
    return ""


def _as_written(said: str, word: str) -> str:
    """Return a value as a file has it, where only its form is wrong; "" where more is.

    said: what is said of it so far.
    """
    if any(quote in word for quote in "“”‘’„"):
        return re.sub("[“”‘’„]", "", word) + ", with straight quotes or none"
    if match := re.fullmatch(r"([a-z_]+):([^/\\\s].*)", word):
        return f"{match[1]}: {match[2]}, with a space behind the colon"
    if "is not a name of letters" in said:
        return re.sub(r"[^A-Za-z0-9._-]+", "-", word).strip("-")[:64]
    if _plain(word) in ("inf", ".inf", "infinite", "∞") and "a distance" in said:
        return "infinity"
    if " unit " in said:
        return _in_known_unit(word)
    is_whole = "is not a whole number" in said
    if (is_whole or "is not a number" in said) and (match := _NUMBER.fullmatch(word)):
        number = float(match[1]) * {"k": 1e3, "M": 1e6}.get(match[2], 1)
        return "" if is_whole and number % 1 else f"{number:.12g}"
    return ""


def _in_known_unit(text: str) -> str:
    """Return a quantity whose unit files do not have in one that they have; "" if none is known."""
    try:
        number, unit = units.split(text)
    except ValueError:
        return ""
    if unit not in FOREIGN:
        return ""
    size, known = FOREIGN[unit]
    return f"{float(number * size):.6g} {known}"


def _plain(word: object) -> str:
    return str(word).lower().replace("-", "_").replace(" ", "_")
