"""Overrides "PATH=VALUE" of the command line as a tree."""

from collections.abc import Sequence
from pathlib import Path

from vcam_cli import errors
from vcam_cli.config.merge import MergeRules, merge
from vcam_cli.config.yaml_reader import read_text
from vcam_cli.config.yaml_tree import Node, Source, tree_at
from vcam_cli.errors import BadInput, Collector, Problem, one_line


def overlay(sets: Sequence[str], folder: Path, rules: MergeRules) -> Node:
    """Return the tree of overrides, VALUE read as YAML, later ones laid over earlier ones.

    Relative file names start from `folder`. Raises BadInput for what is no override.
    """
    whole = Node({}, Source("--set", folder, lines=False))
    problems = Collector()
    for item in sets:
        try:
            whole = merge(whole, _override(item, folder), rules)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return whole


def _override(item: str, folder: Path) -> Node:
    path, _, text = item.partition("=")
    keys = errors.split(path.strip())
    if "" in path.strip().split(".") or not text.strip():
        message = f"{item!r} is not PATH=VALUE"
        raise BadInput([Problem((), message, "write pixel.width=8um", "--set")])
    source = Source(f"--set {one_line(item)}", folder, lines=False)
    return tree_at(keys, read_text(text, source))
