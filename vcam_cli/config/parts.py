"""Part files: `optics: f2.8-normal`, `{use: NAME, ...}`, `extends: OTHER.yaml`.

`file_names` says which file a name means. Parts may use and extend further parts; a circle is an
error.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Generic

from vcam_cli import errors
from vcam_cli.config.file_format import FileFormat, M
from vcam_cli.config.file_names import referenced_file
from vcam_cli.config.merge import merge
from vcam_cli.config.yaml_reader import read_file
from vcam_cli.config.yaml_tree import Node, child_path
from vcam_cli.errors import BadInput, Problem

LONGEST_CHAIN = 32


@dataclass
class Findings:
    """Gathers problems, and the paths of what could not be had at all.

    What later steps find wrong below such a path would only be an echo, and is dropped.
    """

    problems: list[Problem] = field(default_factory=list)
    failed: set[errors.Path] = field(default_factory=set)

    def fail(self, path: errors.Path, problems: Iterable[Problem]) -> None:
        """Add the problems that keep `path` from being had."""
        self.failed.add(path)
        for problem in problems:
            inside = problem.path[: len(path)] == path
            self.problems.append(problem if inside else replace(problem, path=path + problem.path))

    def add(self, problems: Iterable[Problem], locate: Callable[[errors.Path], str]) -> None:
        """Add further problems, put in place by `locate`."""
        for problem in BadInput(problems).with_places(locate).problems:
            if not any(problem.path[: len(path)] == path for path in self.failed):
                self.problems.append(problem)


@dataclass
class PartReader(Generic[M]):
    """Reads files and expands trees; keeps a list of the files, and of what is wrong with parts.

    Paths are those in the whole tree; `chain` are the files that led to one.
    """

    format: FileFormat[M]
    files: list[Path]
    findings: Findings

    def read(
        self, file: Path, kind: str, path: errors.Path = (), chain: tuple[Path, ...] = ()
    ) -> Node:
        """Return the tree of a file, which stands at `path`, with all its parts and bases in it.

        Raises BadInput; what is wrong with a part inside is gathered.
        """
        self.files.append(file.resolve())
        root = read_file(file)
        chain = (*chain, file.resolve())
        if root.mapping is None:
            remedy = "write lines of `key: value`"
            raise BadInput([root.problem(path, "a mapping is needed here", remedy)])
        if not path:
            self.format.refuse(root)
        own = self.expand(root.drop("extends"), path, chain)
        base = root.get("extends")
        if base is None:
            return own
        extended = self._part(base, kind, path, chain).drop("name")
        return merge(extended, own, self.format.merge_rules, path)

    def expand(self, node: Node, path: errors.Path = (), chain: tuple[Path, ...] = ()) -> Node:
        """Return `node`, which stands at `path`, with the part files named in it read in."""
        if node.mapping is None:
            return node
        children = {k: self._child(c, child_path(path, k), chain) for k, c in node.mapping.items()}
        return replace(node, value=children)

    def _child(self, node: Node, path: errors.Path, chain: tuple[Path, ...]) -> Node:
        if path in self.format.parts:
            return self._section(node, path, chain)
        key = self.format.shorthands.get(path)
        if key is None:
            return node
        if isinstance(node.value, str):
            node = replace(node, value={key: node}, whole=True)
        return self.expand(node, path, chain)

    def _section(self, node: Node, path: errors.Path, chain: tuple[Path, ...]) -> Node:
        name = node.get("use") if node.mapping is not None else node
        word = node.value == self.format.words.get(path, ())
        if name is None or word or (name is node and not isinstance(node.value, str)):
            return self.expand(node, path, chain)
        try:
            part = self._part(name, self.format.parts[path], path, chain)
            if name is not node:
                own = self.expand(replace(node.drop("use"), whole=False), path, chain)
                part = merge(part, own, self.format.merge_rules, path)
            return replace(part, whole=True)
        except BadInput as error:
            here = {(), path}  # and not inside the part
            problems = [
                self.format.advise(replace(p, path=path), name.value) if p.path in here else p
                for p in error.problems
            ]
            self.findings.fail(path, problems)
            return node

    def _part(self, name: Node, kind: str, path: errors.Path, chain: tuple[Path, ...]) -> Node:
        """Return the tree of the file that a text names."""
        try:
            file = referenced_file(name, kind, chain)
        except BadInput as error:
            raise error.with_places(lambda _: name.where) from None
        if file.resolve() in chain:
            circle = " -> ".join(link.name for link in (*chain, file))
            message = f"the files refer to each other in a circle: {circle}"
            raise BadInput([name.problem(path, message, "remove one of the references")])
        if len(chain) >= LONGEST_CHAIN:
            message = f"more than {LONGEST_CHAIN} files refer to each other"
            raise BadInput([name.problem(path, message, "write some of them into one file")])
        return self.read(file, kind, path, chain)
