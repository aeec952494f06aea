"""`--set` of a study: its own keys, or else those of its camera.

Keys of a study may be paths of a camera with dots in them: `vary.pixel.width.count=8` is the key
`count` of `pixel.width` in `vary`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from vcam_cli.config.merge import MergeRules, merge
from vcam_cli.config.overrides import read_override
from vcam_cli.config.yaml_tree import Node, Source, tree_at
from vcam_cli.errors import BadInput, Collector
from vcam_cli.errors import Path as KeyPath

PATHS = ("vary", "repeat", "set")
"""Keys whose own keys are paths of a camera."""
CASES = "cases"
"""The key whose entries have such keys beside `vary`."""
VARIATION = ("start", "stop", "count", "spacing", "values", "uniform", "log_uniform", "choice")
"""Keys behind a path that is varied."""


def split_sets(
    sets: Sequence[str], own: Collection[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the overrides of a study, whose first keys are its `own`, and those of its camera."""
    study = [item for item in sets if item.partition("=")[0].strip().partition(".")[0] in own]
    return tuple(study), tuple(item for item in sets if item not in study)


def lay_over(tree: Node, sets: Sequence[str], folder: Path, rules: MergeRules) -> Node:
    """Return a study's tree with overrides "PATH=VALUE" laid over it. Raises BadInput."""
    problems = Collector()
    for item in sets:
        try:
            path, node = read_override(item, folder)
            over = tree_at(study_path(path, tree), node)
            tree = merge(tree, over, rules)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return tree


def study_path(parts: KeyPath, tree: Node) -> KeyPath:
    """Return the keys of a study that a dotted path means: camera paths are one key each."""
    found: list[str | int] = []
    rest, node = [str(part) for part in parts], tree
    while rest:
        count = _key_length(rest, found, node)
        found.append(".".join(rest[:count]))
        rest = rest[count:]
        node = node.get(found[-1]) or Node({}, Source("", Path()))
    return tuple(found)


def _key_length(rest: Sequence[str], above: Sequence[str | int], node: Node) -> int:
    """Return of how many parts the next key is: of one that is there, or that may be there."""
    for count in range(len(rest), 0, -1):
        if ".".join(rest[:count]) in (node.mapping or {}):
            return count
    is_case = len(above) == 2 and above[0] == CASES
    if is_case and rest[0] in PATHS:
        return 1
    if not above or (above[-1] not in PATHS and not is_case):
        return 1
    varied = above[-1] == "vary" and len(rest) > 1 and rest[-1] in VARIATION
    return len(rest) - 1 if varied else len(rest)
