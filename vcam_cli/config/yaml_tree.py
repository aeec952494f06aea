"""A tree of YAML values that know where they stand in a file."""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path

from vcam_cli import errors
from vcam_cli.arguments import brief
from vcam_cli.errors import Problem
from vcam_cli.records import dataclass

Scalar = str | int | float | bool | None
Key = str | int | float


@dataclass(frozen=True)
class Source:
    """The file or command-line argument that a text comes from."""

    name: str
    """Name in messages."""
    folder: Path
    """Folder that relative file names start from."""
    lines: bool = True
    """Whether lines and columns say something: False for values from the command line."""


@dataclass(frozen=True)
class Node:
    """A scalar, a mapping or a list, with its place."""

    value: "Scalar | dict[Key, Node] | list[Node]"
    source: Source
    line: int = 1
    column: int = 1
    whole: bool = False
    """Whether a mapping is a whole section (a part file), which replaces another one."""
    keys: "dict[Key, Node]" = field(default_factory=dict)
    """Nodes of a mapping's keys, for their places."""

    @property
    def where(self) -> str:
        """Place in messages, for example "lens.yaml:12:10"."""
        return self.source.name + (f":{self.line}:{self.column}" if self.source.lines else "")

    @property
    def mapping(self) -> "dict[Key, Node] | None":
        """Entries of a mapping; None for anything else."""
        return self.value if isinstance(self.value, dict) else None

    def get(self, key: Key) -> "Node | None":
        """Return the value of a mapping's key; None without it."""
        return self.value.get(key) if isinstance(self.value, dict) else None

    def drop(self, key: Key) -> "Node":
        """Return a mapping less one of its keys."""
        assert self.mapping is not None
        return replace(self, value={k: v for k, v in self.mapping.items() if k != key})

    def plain(self) -> object:
        """Return the value as dicts, lists and scalars."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def problem(self, path: errors.Path, message: str, remedy: str = "") -> Problem:
        """Return a problem that stands here."""
        return Problem(path, message, remedy, self.where)


def child_path(path: errors.Path, key: Key) -> errors.Path:
    """Return the path of a mapping's entry."""
    return (*path, key if isinstance(key, (str, int)) else str(key))


def tree_at(path: errors.Path, node: Node) -> Node:
    """Return the tree in which a node stands at a path, and nothing else."""
    for key in reversed(path):
        node = Node({key: node}, node.source, node.line, node.column)
    return node


def node_of(value: object, source: Source) -> Node:
    """Return dicts, lists and scalars as a tree, the contrary of `Node.plain`.

    Raises TypeError for anything else.
    """
    if value is None or isinstance(value, str | bool | int | float):
        return Node(value, source)
    if isinstance(value, Mapping) and all(isinstance(key, str | int | float) for key in value):
        return Node({key: node_of(item, source) for key, item in value.items()}, source)
    if isinstance(value, list | tuple):
        return Node([node_of(item, source) for item in value], source)
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays
        return node_of(value.tolist(), source)
    if isinstance(value, PathLike):
        return Node(str(value), source)
    raise TypeError(f"{brief(value)} is no value of a file; write it as YAML has it")


def walk(node: Node, path: errors.Path = ()) -> Iterator[tuple[errors.Path, Node]]:
    """Yield every node below and with `node`, with its path, parents first."""
    yield path, node
    if isinstance(node.value, dict):
        for key, child in node.value.items():
            yield from walk(child, child_path(path, key))
    elif isinstance(node.value, list):
        for index, child in enumerate(node.value):
            yield from walk(child, (*path, index))


def places(tree: Node) -> dict[errors.Path, str]:
    """Return the place of every value; of a block that begins below its key, the key's place."""
    found: dict[errors.Path, str] = {}
    for path, node in walk(tree):
        found.setdefault(path, node.where)
        for key, name in node.keys.items():
            child = node.get(key)
            if child is not None and isinstance(child.value, (dict, list)):
                begins_below = child.source is name.source and child.line > name.line
                found[child_path(path, key)] = name.where if begins_below else child.where
    return found


class PlacedKeys:
    """What comes from a tree of YAML nodes, and knows the place of every key."""

    tree: Node

    @cached_property
    def places(self) -> dict[errors.Path, str]:
        """Place of every key that is written."""
        return places(self.tree)

    def locate(self, path: errors.Path) -> str:
        """Return the place of `path`, or of the nearest thing around it that is written."""
        while path not in self.places and path:
            path = path[:-1]
        return self.places.get(path, "")


@dataclass(frozen=True)
class Origin(PlacedKeys):
    """Where a model comes from: its file, all input files, and the place of every key."""

    file: Path
    files: tuple[Path, ...]
    """YAML files read, then the data files that they name (pictures, tables)."""
    tree: Node
    yaml_files: tuple[Path, ...] = ()
    """The YAML files alone."""
