"""A YAML file -> a model: read, put together, check, and say everything that is wrong.

The steps: read the YAML with its places, read in the parts and bases, lay overrides over it, make
file names absolute, validate the model, make further checks. Every step gives its problems the
place in the file they come from, and as many as can be known are reported at once: what is wrong
in one section keeps back only the checks that need it.
"""

import operator
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Generic

from pydantic import ValidationError

from vcam_cli import errors
from vcam_cli.config import validation_messages
from vcam_cli.config.file_format import Check, FileFormat, M, names_file
from vcam_cli.config.file_names import absolute_file, argument_file
from vcam_cli.config.merge import merge
from vcam_cli.config.parts import Findings, PartReader
from vcam_cli.config.yaml_tree import Key, Node, Origin, Source, child_path, node_of
from vcam_cli.errors import BadInput, Problem
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Document(Generic[M]):
    """A file read once: a source of any number of models, each with its overrides."""

    file: Path
    tree: Node
    format: FileFormat[M]
    files: tuple[Path, ...] = ()
    """YAML files that went into the tree."""
    problems: tuple[Problem, ...] = ()
    """What is wrong so far."""
    failed: frozenset[errors.Path] = frozenset()
    """Paths of what could not be had."""

    def overlay(self, over: Node) -> "Document[M]":
        """Return it with a tree of overrides laid over it, and the parts that these name read in.

        Raises BadInput where they name an element that a list does not have.
        """
        reader = PartReader(self.format, list(self.files), self._findings())
        tree = merge(self.tree, reader.expand(over), self.format.merge_rules)
        return _document(self.file, tree, reader)

    def validate(self, checks: Sequence[Check[M]] = ()) -> M:
        """Return the model. Raises BadInput with every problem.

        `checks` are further ones than those of the format.
        """
        findings = self._findings()
        tree, data = absolute_files(self._with_name(), self.format.file_keys, findings)
        origin = Origin(self.file, tuple(dict.fromkeys((*self.files, *data))), tree, self.files)
        model, wrong = _validate(tree, self.format, origin, findings)
        for check, sections in (*self.format.checks, *checks):
            if model is not None and not wrong & set(sections.split()):
                try:
                    check(model)
                except BadInput as error:
                    findings.add(error.problems, origin.locate)
        if findings.problems or model is None:
            raise BadInput(dict.fromkeys(sorted(findings.problems, key=place_order)))
        return model.with_origin(origin)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """YAML files that went into it and data files that these name, of those there are."""
        _, data = absolute_files(self.tree, self.format.file_keys, Findings())
        return tuple(dict.fromkeys((*self.files, *data)))

    def _findings(self) -> Findings:
        return Findings(list(self.problems), set(self.failed))

    def _with_name(self) -> Node:
        """Return the tree with a name, the file's where it has none of its own."""
        tree = self.tree
        if tree.get("name") is not None:
            return tree
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", self.file.stem)[:64]
        name = stem or self.format.model.model_fields["name"].default
        entries: dict[Key, Node] = {"name": Node(name, tree.source, tree.line, tree.column)}
        return replace(tree, value=entries | (tree.mapping or {}))


def read(name: str | Path, folder: Path, format: FileFormat[M]) -> Document[M]:
    """Return a file, or a shipped one of that name, with all its parts.

    Raises BadInput, CannotDo.
    """
    reader = PartReader(format, [], Findings())
    file = argument_file(name, folder, format.kind)
    return _document(file, reader.read(file, format.kind), reader)


def reopen(model: M, format: FileFormat[M]) -> Document[M]:
    """Return the document of a model: its file's, or the model's own keys where they differ.

    A default that follows from other keys follows those of the next model, if it was not written.
    """
    origin = model.source_tree
    if origin is not None and format.model.model_validate(origin.tree.plain()) == model:
        return Document(origin.file, origin.tree, format, origin.yaml_files)
    file = model.origin or Path(f"{format.model.__name__.lower()}.yaml")
    said = node_of(model.model_dump(mode="json"), Source(str(file), file.parent, lines=False))
    return Document(file, said, format, origin.yaml_files if origin else ())


def place_order(problem: Problem) -> tuple[str, int, int]:
    """Return file, line and column of a problem, to sort problems in the order of the file."""
    match = re.fullmatch(r"(.*?):(\d+):(\d+)", problem.where)
    return (match[1], int(match[2]), int(match[3])) if match else (problem.where, 0, 0)


def _document(file: Path, tree: Node, reader: PartReader[M]) -> Document[M]:
    found = reader.findings
    files, problems = tuple(reader.files), tuple(found.problems)
    return Document(file, tree, reader.format, files, problems, frozenset(found.failed))


def absolute_files(tree: Node, keys: frozenset[Key], findings: Findings) -> tuple[Node, list[Path]]:
    """Return the tree with every data file's name absolute, and the files; note what is wrong."""
    files: list[Path] = []

    def visit(node: Node, path: errors.Path, kind: object = None) -> Node:
        if path and names_file(keys, path[-1], kind) and isinstance(node.value, str):
            try:
                node = absolute_file(node, path)
                files.append(Path(str(node.value)))
            except BadInput as error:
                findings.fail(path, error.problems)
            return node
        if isinstance(node.value, dict):
            own = node.value["kind"].value if "kind" in node.value else None
            entries = {k: visit(child, child_path(path, k), own) for k, child in node.value.items()}
            is_same = all(entries[key] is child for key, child in node.value.items())
            return node if is_same else replace(node, value=entries)
        if isinstance(node.value, list):
            items = [visit(child, (*path, i)) for i, child in enumerate(node.value)]
            is_same = all(map(operator.is_, items, node.value))
            return node if is_same else replace(node, value=items)
        return node

    return visit(tree, ()), files


def given_at(tree: Node, path: errors.Path) -> object:
    """Return what stands at a path, as YAML has it; None where nothing does."""
    value = tree.plain()
    for part in path:
        if isinstance(value, dict):
            value = value.get(part)
        elif isinstance(value, list) and isinstance(part, int) and part < len(value):
            value = value[part]
        else:
            return None
    return value


def _validate(
    tree: Node, format: FileFormat[M], origin: Origin, findings: Findings
) -> tuple[M | None, set[str | int]]:
    """Return the model, and which of its sections are not the file's, since they are wrong there.

    What is wrong is added to the findings. None where no model can be made.
    """
    value = tree.plain()
    assert isinstance(value, dict)
    try:
        return format.model.model_validate(value), set()
    except ValidationError as error:
        problems = [
            format.advise(problem, given_at(tree, problem.path))
            for problem in validation_messages.problems(error)
        ]
        findings.add(problems, origin.locate)
    wrong = {problem.path[0] for problem in problems if problem.path}
    findings.failed |= {(name,) for name in wrong}
    if format.stand_in is None:
        return None, wrong
    right = {name: section for name, section in value.items() if name not in wrong}
    good, fields = format.stand_in(), format.model.model_fields
    lent = {
        n: getattr(good, n) for n, field in fields.items() if field.is_required() and n in wrong
    }
    try:
        return format.model.model_validate(right | lent), wrong
    except ValidationError:  # what is wrong between sections
        return None, wrong
