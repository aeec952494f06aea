"""Lays one YAML tree over another: what `extends`, `use` and `--set` mean.

Mappings are merged key by key, anything else is replaced; an empty mapping under a key empties it.
Keys laid over the name of a part change that part.
`MergeRules` keep an override from meaning what nobody wrote.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from vcam_cli import errors
from vcam_cli.config.yaml_tree import Key, Node, child_path
from vcam_cli.errors import BadInput


@dataclass(frozen=True)
class Alternatives:
    """Groups of keys of which a mapping gives one: an override drops the others of its base."""

    groups: tuple[frozenset[Key], ...]
    path: errors.Path | None = None
    """Path of the only mapping that they are keys of; None for any mapping."""

    @classmethod
    def parse(cls, text: str, path: errors.Path | None = None) -> "Alternatives":
        """Return the groups of a text such as "rows columns | die"."""
        return cls(tuple(frozenset(group.split()) for group in text.split("|")), path)


@dataclass(frozen=True)
class MergeRules:
    """Where an override replaces more than the keys that it gives."""

    alternatives: tuple[Alternatives, ...] = ()
    variants: Mapping[errors.Path, tuple[Key, ...]] = field(default_factory=dict)
    """Path of a mapping -> keys that tell what it describes, the most general first. A change of
    one leaves nothing of the base but the keys before it."""
    single_values: frozenset[Key] = frozenset()
    """Keys of mappings that are one value, and not merged."""
    part_keys: Mapping[errors.Path, Key] = field(default_factory=dict)
    """Where the name of a part may stand -> the key that has it beside changes of that part."""
    words: Mapping[errors.Path, str] = field(default_factory=dict)
    """Where the name of a part may stand -> a word that names none."""


NO_RULES = MergeRules()


def merge(base: Node, over: Node, rules: MergeRules = NO_RULES, path: errors.Path = ()) -> Node:
    """Return `over` laid over `base`; `path` is where both stand in the whole tree.

    Raises BadInput where `over` names an element that a list of `base` does not have.
    """
    if over.whole or over.mapping is None:
        return over
    if isinstance(base.value, list) and over.mapping and all(type(k) is int for k in over.mapping):
        return _merge_list(base, over, rules, path)
    if base.mapping is None:
        return _over_value(base, over, rules, path)
    kept = _remaining_entries(base.mapping, over.mapping, rules, path)
    merged = dict(kept)
    for key, node in over.mapping.items():
        both = key in kept and key not in rules.single_values
        merged[key] = _merge_entry(kept[key], node, rules, child_path(path, key)) if both else node
    keys = {key: node for key, node in (base.keys | over.keys).items() if key in merged}
    return replace(base, value=merged, keys=keys)


def _over_value(base: Node, over: Node, rules: MergeRules, path: errors.Path) -> Node:
    """Lay a mapping over what is none: it stands alone, but beside the name of a part."""
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
        given = [group for group in alternatives.groups if group & over.keys()]
        if given and alternatives.path in (None, path):
            dropped |= frozenset().union(*alternatives.groups) - frozenset().union(*given)
    return {key: node for key, node in base.items() if key not in dropped}


def _merge_list(base: Node, over: Node, rules: MergeRules, path: errors.Path) -> Node:
    """Lay over elements of a list by their numbers: `--set processing.1.demosaic=...`."""
    assert isinstance(base.value, list) and over.mapping is not None
    elements = list(base.value)
    for index, node in over.mapping.items():
        if not isinstance(index, int) or not 0 <= index < len(elements):
            message = f"there is no element {index} in this list of {len(elements)}"
            remedy = f"use 0 to {len(elements) - 1}" if elements else "give the whole list"
            raise BadInput([node.problem(child_path(path, index), message, remedy)])
        elements[index] = _merge_entry(elements[index], node, rules, (*path, index))
    return replace(base, value=elements)
