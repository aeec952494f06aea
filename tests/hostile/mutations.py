"""Harm done to YAML files: one to three changes of a file that was good.

Half of the changes are to what the file says (a value, a key, a number's size, its unit), which
get deep into the program; the others are to its text. `harmed` is a pure function of its seed.
"""

import copy
import random
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import yaml

Place = tuple[Any, Any]
"""A dict or list and a key of it."""

NUMBERS = (
    "0", "-0.0", "1", "-1", "0.5", "2", "3", "7", "64", "1000", "1e-300", "5e-324", "1e-30",
    "1e-9", "1e9", "1e30", "1e300", "1.7976931348623157e308", "1e999", ".nan", ".inf", "-.inf",
    "0x7fffffffffffffff", "9223372036854775808", "18446744073709551616", "1/0", "1/3", "0/0",
    "9" * 40, "1" + "0" * 250, "1_000", "1,5", "٣", "½", "1e", "+", "--1", "50 %", "100.0001 %",
)  # fmt: skip
UNITS = (
    "um", "nm", "mm", "m", "km", "s", "ms", "e", "ke", "e/s", "uV/e", "V", "fF", "K", "C", "deg",
    "rad", "cd/m2", "lx", "W/(sr m2)", "lp/mm", "nA/cm2", "DN", "%", "1/m", "cm-3", "dB", "",
    "parsec", "µm", "um um", "um/0", "(m",
)  # fmt: skip
WORDS = (
    "auto", "none", "all", "on", "off", "true", "null", "infinity", "exact", "sensor", "fit",
    "srgb", "starter", "D65", "bayer-rggb", "monochrome", "stacked", "honeycomb", "rgbw",
    "quad-bayer", "ktc", "junction", "from-file", "uniform", "colorchecker", "ccd", "pps", "dps",
    "aps-3t", "cmos-0.18um", "generic-rgb", "ir-cut-650", "logarithmic", "weighted", "optimal",
    "/dev/zero", "/", ".", "..", "../..", "", "~", "~root", "http://127.0.0.1:9/a.png",
    "file:///etc/passwd", "$HOME", "${PATH}", "`id`", "$(id)", "%s%n", "{0.__class__}", "a\0b",
    "\x1b[31m", "\u202e", "\ud7ff", "😀" * 9, "x" * 5000, "!!python/object", "NaN", "__class__",
)  # fmt: skip
SHAPES: tuple[Any, ...] = (
    None, True, False, [], {}, [[]], [None], {"": None}, [[[[1]]]], {"a": {"b": {"c": 1}}},
    {0: 1}, {1: {}}, [1, 2, 3], ["R", "G"], [["R"], ["G", "B"]], {"blackbody": "3000 K"},
    {"table": {400: 1, 700: 0}}, {"table": {700: "x"}}, {"file": "nothing.csv"}, {"use": "starter"},
    {"value": 1}, {"min": 0, "max": 1}, {"start": "1 um", "stop": "1 nm", "count": 3},
    {"kind": "chart", "chart": "csf", "max_frequency": "1e9 lp/mm"},
)  # fmt: skip
SNIPPETS = (
    "&a", "*a", "*b", "!!int ", "!x ", "<<: ", "---\n", "...\n", "%TAG ! x\n", "? ", ": ", "- ",
    "{", "}", "[", "]", "'", '"', "|\n", ">\n", "#", "\t", "\r", "\0", "\ufeff", "\u2028", "\x85",
    "\n\n", "  ", "@", "`", "%", "extends: ./it.yaml\n", "extends: starter\n", "name: x\n",
    "? [a]\n: b\n", "a: &a [*a]\n", "\udc80",
)  # fmt: skip


def harmed(text: str, seed: int) -> bytes:
    """A file's bytes after one to three changes."""
    chance = random.Random(seed)
    data = text
    if chance.random() < 0.85:
        tree = copy.deepcopy(_read(text))
        for _ in range(chance.choice((1, 1, 1, 2))):
            tree = _in_tree(tree, chance)
        data = _dumped(tree)
    if chance.random() < 0.15:
        for _ in range(chance.choice((1, 1, 2))):
            data = _in_text(data, chance)
    out = data.encode("utf-8", "surrogateescape" if chance.random() < 0.5 else "replace")
    if chance.random() < 0.04:
        out = _in_bytes(out, chance)
    return out


@cache
def _read(text: str) -> Any:
    return yaml.load(text, getattr(yaml, "CBaseLoader", yaml.BaseLoader))


def _in_tree(tree: Any, chance: random.Random) -> Any:
    places = list(_places(tree))
    if not places:
        return chance.choice(SHAPES)
    holder, key = chance.choice(places)
    value = holder[key]
    match chance.randrange(12):
        case 0 | 1 | 2 | 3 | 4 | 5:
            holder[key] = _another_size(value, chance) if isinstance(value, str) else value
        case 6 | 7:
            holder[key] = copy.deepcopy(chance.choice((*NUMBERS, *WORDS, *SHAPES)))
        case 8:
            holder[key] = f"{chance.choice(NUMBERS)} {chance.choice(UNITS)}"
        case 9:
            del holder[key]
        case 10:  # what stands elsewhere in the file
            other, its = chance.choice(places)
            holder[key] = copy.deepcopy(other[its])
        case _:
            _new_key(holder, key, chance)
    return tree


def _another_size(value: str, chance: random.Random) -> str:
    """A number of another size, or with another unit."""
    found = re.match(r"([-+.0-9eE]+)(.*)", value, re.DOTALL)
    if found is None:
        return chance.choice(WORDS)
    if chance.random() < 0.2:
        return f"{found[1]} {chance.choice(UNITS)}"
    if chance.random() < 0.3:
        return chance.choice(NUMBERS) + found[2]
    try:
        number = float(found[1])
    except ValueError:
        return found[2]
    return f"{number * 10.0 ** chance.choice((-40, -12, -6, -3, -1, 1, 3, 6, 12, 40))!r}{found[2]}"


def _new_key(holder: Any, key: Any, chance: random.Random) -> None:
    value = copy.deepcopy(holder[key])
    if isinstance(holder, list):
        holder.insert(0, value)
    elif isinstance(key, str) and key and chance.random() < 0.5:
        at = chance.randrange(len(key))
        holder[key[:at] + key[at + 1 :]] = holder.pop(key)
    else:
        holder[chance.choice(WORDS)] = value


def _places(tree: Any) -> Iterator[Place]:
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(entries):
        yield tree, key
        if isinstance(value, (dict, list)):
            yield from _places(value)


def _dumped(tree: Any) -> str:
    """YAML whose plain scalars are read anew: `2.8` is a number again."""
    text = yaml.dump(tree, sort_keys=False, allow_unicode=True, Dumper=_Plain, width=10**6)
    return re.sub(r": '([-+.0-9][^'\n]*)'$", r": \1", text, flags=re.MULTILINE)


_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Plain(_DUMPER):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def _in_text(text: str, chance: random.Random) -> str:
    at = chance.randrange(len(text) + 1)
    end = min(len(text), at + chance.randrange(1, 40))
    match chance.randrange(5):
        case 0:
            return text[:at] + text[end:]
        case 1:
            return text[:at]
        case 2:
            return text[:at] + text[at:end] * chance.choice((2, 3, 50)) + text[end:]
        case 3:
            lines = text.splitlines(keepends=True)
            chance.shuffle(lines)
            return "".join(lines)
        case _:
            return text[:at] + chance.choice(SNIPPETS) + text[at:]


def _in_bytes(data: bytes, chance: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(3):
        if out:
            out[chance.randrange(len(out))] = chance.randrange(256)
    return bytes(out)
