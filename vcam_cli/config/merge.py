"""Lays one YAML tree over another: what `extends`, `use` and `--set` mean.

Mappings are merged key by key, anything else is replaced; an empty mapping under a key empties it.
Keys laid over the name of a part change that part.
`MergeRules` keep an override from changing keys that it does not name.
"""

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property

from vcam_cli import errors
from vcam_cli.config.yaml_tree import Key, Node, child_path
from vcam_cli.errors import BadInput
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Alternatives:
    """Groups of alternative keys: an override with one drops the others of its base."""

    groups: tuple[frozenset[Key], ...]
    path: errors.Path | None = None
    """Path of the only mapping that they are keys of; None for any mapping."""

    @cached_property
    def keys(self) -> frozenset[Key]:
        """All keys of the groups."""
        return frozenset().union(*self.groups)

    @classmethod
    def parse(cls, text: str, path: errors.Path | None = None) -> "Alternatives":
        """Return the groups of a text such as "rows columns | die"."""
        return cls(tuple(frozenset(group.split()) for group in text.split("|")), path)


@dataclass(frozen=True)
class MergeRules:
    """Where an override replaces more than the keys that it gives."""

    alternatives: tuple[Alternatives, ...] = ()
    determines: Mapping[Key, frozenset[Key]] = field(default_factory=dict)
    """Key -> keys that follow from it: an override with the key drops them from the base. An
    override with one of them drops nothing, so that both together remain an error."""
    variants: Mapping[errors.Path, tuple[Key, ...]] = field(default_factory=dict)
    """Path of a mapping -> keys that tell what it describes, the most general first. A change of
    one leaves nothing of the base but the keys before it."""
    single_values: frozenset[Key] = frozenset()
    """Keys of mappings that are one value, and not merged."""
    part_keys: Mapping[errors.Path, Key] = field(default_factory=dict)
    """Where the name of a part may stand -> the key that has it beside changes of that part."""
    words: Mapping[errors.Path, str] = field(default_factory=dict)
    """Where the name of a part may stand -> a word that names none."""
    step_lists: frozenset[errors.Path] = frozenset()
    """Paths of lists of steps, mappings of one key: an override may name a step by this key."""


NO_RULES = MergeRules()


def merge(base: Node, over: Node, rules: MergeRules = NO_RULES, path: errors.Path = ()) -> Node:
    """Return `over` laid over `base`; `path` is where both stand in the whole tree.

    Raises BadInput where `over` names an element that a list of `base` does not have.
    """
    entries = over.mapping
    if over.whole or entries is None:
        return over
    if isinstance(base.value, list) and entries:
        if path in rules.step_lists:
            entries = _by_numbers(base.value, entries, path)
        if all(type(key) is int for key in entries):
            return _merge_list(base, entries, rules, path)
    if base.mapping is None:
        return _over_value(base, over, rules, path)
    kept = _remaining_entries(base.mapping, entries, rules, path)
    merged = dict(kept)
    for key, node in entries.items():
        both = key in kept and key not in rules.single_values
        merged[key] = _merge_entry(kept[key], node, rules, child_path(path, key)) if both else node
    keys = {key: node for key, node in (base.keys | over.keys).items() if key in merged}
    return replace(base, value=merged, keys=keys)


def _over_value(base: Node, over: Node, rules: MergeRules, path: errors.Path) -> Node:
    """Lay a mapping over another value: it stands alone, but beside the name of a part."""
    assert over.mapping is not None
    key = rules.part_keys.get(path) if isinstance(base.value, str) else None
    if key is None or base.value == rules.words.get(path):
        return replace(over, whole=True)
    return replace(over, value={key: base, **over.mapping}, whole=True)


def _merge_entry(base: Node, over: Node, rules: MergeRules, path: errors.Path) -> Node:
    """Lay over an entry: an empty mapping empties it, and what both are laid over later."""
    if over.mapping == {}:
        return over
    merged = merge(base, over, rules, path)
    return replace(merged, whole=True) if base.mapping == {} else merged


def _remaining_entries(
    base: dict[Key, Node], over: dict[Key, Node], rules: MergeRules, path: errors.Path
) -> dict[Key, Node]:
    """Return the entries of `base` that stay beside those of `over`."""
    telling = rules.variants.get(path, ())
    for i, key in enumerate(telling):
        if key in over and key in base and over[key].value != base[key].value:
            return {k: base[k] for k in telling[:i] if k in base}
    dropped: set[Key] = set()
    for alternatives in rules.alternatives:
        if alternatives.path not in (None, path) or alternatives.keys.isdisjoint(over):
            continue
        given = [group for group in alternatives.groups if group & over.keys()]
        dropped |= alternatives.keys - frozenset().union(*given)
    for key, following in rules.determines.items():
        if key in over and over[key].value not in (None, "none"):
            dropped |= following
    return {key: node for key, node in base.items() if key not in dropped}


def _by_numbers(steps: list[Node], over: dict[Key, Node], path: errors.Path) -> dict[Key, Node]:
    """Return what is laid over steps of a list by their numbers: `--set processing.gamma=2`.

    Raises BadInput for a step that the list does not have, or not at the number given.
    """
    names = [str(next(iter(step.mapping or {}), "")) for step in steps]
    entries: dict[Key, Node] = {}
    for key, node in over.items():
        if not isinstance(key, int):
            name = str(key)
            there = names.count(name) == 1
            index, node = names.index(name) if there else -1, replace(node, value={name: node})
        else:
            index, name = key, str(next(iter(node.mapping or {}), ""))
            there = not name or name in names[key : key + 1]
        if not there:
            raise BadInput([node.problem(child_path(path, key), *_which_step(name, names, path))])
        entries[index] = node
    return entries


def _which_step(name: str, names: list[str], path: errors.Path) -> tuple[str, str]:
    """Return which steps there are, and how an override says which one is meant."""
    listed = ", ".join(names) or "none"
    numbers = [i for i, other in enumerate(names) if other == name]
    if not numbers:
        message = f"there is no step {name} in this list, which has {listed}"
        if close := errors.nearest(name, names):
            return message, f"write {errors.dotted_path((*path, close))}"
        return message, f"give the whole list, with {name} where it belongs"
    meant = [(*path, name)] if len(numbers) == 1 else [(*path, i, name) for i in numbers]
    return (
        f"the steps of this list are {listed}",
        f"write {' or '.join(map(errors.dotted_path, meant))}",
    )


def _merge_list(base: Node, over: dict[Key, Node], rules: MergeRules, path: errors.Path) -> Node:
    """Lay over elements of a list by their numbers: `--set processing.1.demosaic=...`."""
    assert isinstance(base.value, list)
    elements = list(base.value)
    for index, node in over.items():
        if not isinstance(index, int) or not 0 <= index < len(elements):
            message = f"there is no element {index} in this list of {len(elements)}"
            remedy = f"use 0 to {len(elements) - 1}" if elements else "give the whole list"
            raise BadInput([node.problem(child_path(path, index), message, remedy)])
        elements[index] = _merge_entry(elements[index], node, rules, (*path, index))
    return replace(base, value=elements)
