"""YAML text -> a tree of nodes that know where they stand.

The text is read as YAML 1.2, core schema: `on`, `off`, `yes`, `no`, `none` are words, `1e-6`
is a number. Refused, with place and remedy: tags, duplicate keys, tabs as indentation, several
documents, the 1.1 merge key `<<`, text that is not UTF-8, and whatever is too large (8 MB,
64 levels, 100 000 nodes once every alias is written out).

Why events: libyaml's parser is a state machine that yields one event after the other, so
nothing here recurses on hostile depth, and an alias costs nothing until it is counted.
"""

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

import yaml

from vcam_cli import errors
from vcam_cli.config.yaml_tree import Key, Node, Scalar, Source, child_path
from vcam_cli.errors import BadInput, CannotDo, Problem

MAX_BYTES = 8 * 1024 * 1024
MAX_DEPTH = 64
MAX_NODES = 100_000
MAX_DIGITS = 300

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Loader of plain data; libyaml's where it is there, ten times as fast."""
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPELLINGS: dict[str, Scalar] = {
    "~ null Null NULL": None,
    "true True TRUE": True,
    "false False FALSE": False,
    ".inf .Inf .INF +.inf +.Inf +.INF": float("inf"),
    "-.inf -.Inf -.INF": float("-inf"),
    ".nan .NaN .NAN": float("nan"),
}
_WORDS = {"": None} | {word: value for words, value in _SPELLINGS.items() for word in words.split()}


def read_file(path: Path) -> Node:
    """Return the tree of a YAML file.

    Raises BadInput for a path that is no file, is too large, or is not the YAML described above,
    CannotDo where permission is missing.
    """
    source = Source(display_path(path), path.absolute().parent)
    data = _read_bytes(path, source)
    if len(data) > MAX_BYTES:
        raise _refusal(source, f"is larger than {MAX_BYTES // 2**20} MB", "give a YAML file")
    try:
        return read_text(data.decode("utf-8-sig"), source)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        message = "is not UTF-8 text"
        raise _refusal(source, message, "save the file as UTF-8", line, column) from error


def _read_bytes(path: Path, source: Source) -> bytes:
    """Return a file's content, or so much of it that it is seen to be too large."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise _refusal(source, "is not a regular file", "give a YAML file")
        with open(path, "rb") as file:
            return file.read(MAX_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:
        raise _refusal(source, "there is no such file", "check the path") from error
    except OSError as error:
        message = f"{source.name}: cannot be read: {error.strerror or error}"
        raise CannotDo(message, "check its permissions") from error


def read_text(text: str, source: Source) -> Node:
    """Return the tree of a YAML text. Raises BadInput."""
    unprintable = _UNPRINTABLE.search(text)
    if unprintable:
        start = unprintable.start()
        line, column = text.count("\n", 0, start) + 1, start - text.rfind("\n", 0, start)
        message = f"the character {text[start]!a} is not allowed in YAML"
        raise _refusal(source, message, "is this a text file?", line, column)
    try:
        root = _Builder(source).build(text)
    except yaml.MarkedYAMLError as error:
        raise _syntax_error(error, text, source) from error
    except yaml.YAMLError as error:
        raise _refusal(source, f"is not YAML: {error}", "check the file") from error
    if root is None:
        remedy = "run `vcam init` for a file to start from"
        raise _refusal(source, "the file is empty", remedy, 1, 1)
    return root


def scalar(text: str) -> Scalar:
    """Return a plain scalar by the core schema of YAML 1.2. Raises ValueError: too many digits."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) or _FLOAT.fullmatch(text):
        if len(text) > MAX_DIGITS:
            raise ValueError(f"a number with {len(text)} digits")
        if text[:2] in ("0o", "0x"):
            return int(text, 0)
        return int(text) if _INTEGER.fullmatch(text) else float(text)
    return text


def display_path(path: Path) -> str:
    """Return a path as messages show it: relative where it lies below the current folder."""
    try:
        return str(path.absolute().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


@dataclass
class _Collection:
    """A mapping or list whose end has not been read."""

    node: Node
    anchor: str | None
    key: tuple[Key, Node] | None = None
    """Key that has been read, its value not yet."""
    size: int = 1
    """Number of nodes, with aliases written out."""
    height: int = 1
    """Number of levels, with aliases written out."""


class _Builder:
    """Builds the tree of a YAML document from the parser's events."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.stack: list[_Collection] = []
        self.anchors: dict[str, tuple[Node, int, int]] = {}  # node, size and height
        self.root: Node | None = None
        self.documents = 0
        self.mistakes = errors.Collector()  # those after which reading can go on

    def build(self, text: str) -> Node | None:
        for event in yaml.parse(text, Loader=LOADER):
            self._handle(event)
        self.mistakes.raise_if_any()
        return self.root

    def _handle(self, event: yaml.Event) -> None:
        match event:
            case yaml.DocumentStartEvent():
                self.documents += 1
                if self.documents > 1:
                    raise self._error(event, "a second YAML document begins", "keep one a file")
                if event.tags:
                    raise self._error(event, "YAML tags are not allowed", "remove %TAG")
            case yaml.AliasEvent():
                self._alias(event)
            case yaml.ScalarEvent():
                self._scalar(event)
            case yaml.CollectionStartEvent():
                self._check_tag(event)
                if len(self.stack) >= MAX_DEPTH:
                    raise self._error(event, f"nested deeper than {MAX_DEPTH} levels", "flatten it")
                self._refuse_as_key(event)
                empty: dict[Key, Node] | list[Node] = (
                    {} if isinstance(event, yaml.MappingStartEvent) else []
                )
                self.stack.append(_Collection(self._node(event, empty), event.anchor))
            case yaml.CollectionEndEvent():
                done = self.stack.pop()
                self._add(event, done.node, done.size, done.height, done.anchor)

    def _scalar(self, event: yaml.ScalarEvent) -> None:
        self._check_tag(event)
        try:
            value = scalar(event.value) if not event.style else event.value
        except ValueError as error:
            raise self._error(event, str(error), "shorten it") from None
        top = self.stack[-1] if self.stack else None
        if top is None or top.key is not None or top.node.mapping is None:
            self._add(event, self._node(event, value), 1, 0, event.anchor)
            return
        if value == "<<" and not event.style:
            remedy = "use `extends: FILE`, or `use: NAME` in a section"
            raise self._error(event, "the merge key << is not YAML 1.2", remedy)
        if value is None or isinstance(value, bool) or value != value:
            raise self._error(event, f"{event.value!r} cannot be a key", "write a word")
        if value in top.node.mapping:
            line = top.node.keys[value].line
            message = f"the key {event.value!r} is given twice (first in line {line})"
            self.mistakes.extend(self._error(event, message, "remove one of them"))
        top.key = value, self._node(event, value)

    def _alias(self, event: yaml.AliasEvent) -> None:
        self._refuse_as_key(event)
        if any(waiting.anchor == event.anchor for waiting in self.stack):
            raise self._error(event, f"the alias *{event.anchor} contains itself", "remove it")
        if event.anchor not in self.anchors:
            message = f"the alias *{event.anchor} has no anchor &{event.anchor} before it"
            raise self._error(event, message, "define it or write the value out")
        self._add(event, *self.anchors[event.anchor], None)

    def _add(
        self, event: yaml.Event, node: Node, size: int, height: int, anchor: str | None
    ) -> None:
        """Hang a finished node into the collection that is open."""
        if anchor is not None:
            self.anchors[anchor] = node, size, height
        if not self.stack:
            self.root = node
            return
        top = self.stack[-1]
        top.size += size
        top.height = max(top.height, height + 1)
        if len(self.stack) + height > MAX_DEPTH:
            raise self._error(event, f"nested deeper than {MAX_DEPTH} levels", "flatten it")
        if sum(waiting.size for waiting in self.stack) > MAX_NODES:
            message = f"more than {MAX_NODES} values once aliases are written out"
            raise self._error(event, message, "put large tables into a CSV file")
        if isinstance(top.node.value, list):
            top.node.value.append(node)
        elif isinstance(top.node.value, dict) and top.key is not None:
            key, name = top.key
            top.node.value[key] = node
            top.node.keys[key] = name
            top.key = None

    def _node(self, event: yaml.Event, value: "Scalar | dict[Key, Node] | list[Node]") -> Node:
        mark = event.start_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        return Node(value, self.source, line, column)

    def _refuse_as_key(self, event: yaml.Event) -> None:
        top = self.stack[-1] if self.stack else None
        if top is not None and top.node.mapping is not None and top.key is None:
            raise self._error(event, "a mapping, list or alias cannot be a key", "write a word")

    def _check_tag(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
        if event.tag is not None:
            message = f"the YAML tag {event.tag!r} is not allowed"
            self.mistakes.extend(self._error(event, message, "remove it"))

    def _error(self, event: yaml.Event, message: str, remedy: str) -> BadInput:
        path: errors.Path = ()
        for waiting in self.stack:
            path = child_path(path, waiting.key[0]) if waiting.key is not None else path
        return BadInput([self._node(event, None).problem(path, message, remedy)])


def _syntax_error(error: yaml.MarkedYAMLError, text: str, source: Source) -> BadInput:
    """Return the parser's complaint in words that help."""
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line, mark.column) if mark else (0, 0)
    lines = text.splitlines() or [""]
    here = lines[min(line, len(lines) - 1)]
    indent = here[: len(here) - len(here.lstrip())]
    message = (error.problem or "syntax error").removeprefix("found ")
    if "maximum nesting depth" in message:  # a parser that gives up before it hands on a level
        nested = f"nested deeper than {MAX_DEPTH} levels"
        return _refusal(source, nested, "flatten it", line + 1, column + 1)
    remedy = "check indentation, colons, quotes and brackets on this line and the one before"
    if "\t" in indent or here[column : column + 1] == "\t":
        column = here.index("\t")
        message, remedy = "a tab is used as indentation", "use spaces"
    elif "mapping values are not allowed" in message:
        remedy = "check the indentation, and put text that contains ': ' in quotes"
    elif "cannot start any token" in message and here[column : column + 1]:
        message = f"the character {here[column]!r} cannot stand here"
        remedy = "put the text in quotes"
    return _refusal(source, f"is not YAML: {message}", remedy, line + 1, column + 1)


def _refusal(source: Source, message: str, remedy: str, line: int = 0, column: int = 0) -> BadInput:
    where = f"{source.name}:{line}:{column}" if line and source.lines else source.name
    return BadInput([Problem((), message, remedy, where)])
