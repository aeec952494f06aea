"""Overrides "PATH=VALUE" of the command line, and those of Python callers, as a tree."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vcam_cli import errors
from vcam_cli.arguments import brief
from vcam_cli.config.merge import MergeRules, merge
from vcam_cli.config.yaml_reader import read_text
from vcam_cli.config.yaml_tree import Node, Source, node_of, tree_at
from vcam_cli.errors import BadInput, Collector, Problem, one_line


def overlay(sets: Sequence[str], folder: Path, rules: MergeRules) -> Node:
    """Return the tree of overrides, VALUE read as YAML, later ones laid over earlier ones.

    Relative file names start from `folder`. Raises BadInput for what is no override.
    """
    whole = Node({}, Source("--set", folder, lines=False))
    problems = Collector()
    for item in sets:
        try:
            whole = merge(whole, tree_at(*read_override(item, folder)), rules)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return whole


def overlay_values(changes: Mapping[str, Any], folder: Path, rules: MergeRules) -> Node:
    """Return the tree of Python values by their paths, later ones laid over earlier ones.

    Relative file names start from `folder`. Raises BadInput, and TypeError for what is no mapping
    of paths, or for a value that YAML cannot have.
    """
    if not isinstance(changes, Mapping) or not all(isinstance(path, str) for path in changes):
        message = f"{brief(changes)} is no mapping of paths to values"
        raise TypeError(f'{message}; write {{"exposure.time": "10 ms"}}')
    whole = Node({}, Source("with_", folder, lines=False))
    problems = Collector()
    for path, value in changes.items():
        source = Source(one_line(f"with_({{{path!r}: {brief(value)}}})"), folder, lines=False)
        try:
            if "" in path.split("."):
                message = f"{path!r} is not the path of a key"
                raise BadInput([Problem((), message, "write pixel.width", source.name)])
            whole = merge(whole, tree_at(errors.split(path), node_of(value, source)), rules)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return whole


def _example(item: str) -> str:
    """Return an override in its correct form, with the path and value given, if these are found."""
    if match := re.fullmatch(r"\s*([a-z_]\w*(?:\.\w+)*)\s*(?:[=:]\s*(\S.*)?|\s(\S.*))?", item):
        return f'{match[1]}="{match[2] or match[3] or "VALUE"}"'
    return "pixel.width=8um"


def read_override(item: str, folder: Path) -> tuple[errors.Path, Node]:
    """Return path and value of an override "PATH=VALUE". Raises BadInput for another form."""
    path, _, text = item.partition("=")
    keys = errors.split(path.strip())
    if "" in path.strip().split(".") or not text.strip():
        message = f"{item!r} is not PATH=VALUE"
        raise BadInput([Problem((), message, f"write {_example(item)}", "--set")])
    source = Source(f"--set {one_line(item)}", folder, lines=False)
    return keys, read_text(text, source)
