"""A camera file -> a `Camera`: read, put together, check, and say everything that is wrong.

The steps: read the YAML with its places, read in the parts and bases, lay `--set` over it, make
file names absolute, validate the model, refuse what is not supported yet, check the geometry.
Every step gives its problems the place in the file they come from, and as many as can be known
are reported at once: what is wrong in one section keeps back only the checks that need it.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

from pydantic import ValidationError

from vcam_cli import errors
from vcam_cli.camera import (
    electrical,
    explain,
    falloff,
    geometry,
    named_spectra,
    photodiode,
    shipped,
)
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.merge import merge
from vcam_cli.camera.parts import Findings, Parts, existing, is_file, looks_like_path
from vcam_cli.camera.yaml_tree import Key, Node, Source, below, read_text, walk
from vcam_cli.errors import BadInput, CannotDo, Collector, Problem, bad, nearest, one_line

FILE_KEYS = ("file", "positions")
EXAMPLE = "starter"
"""The shipped camera whose sections stand in for those that a file has wrong."""

Check = tuple[Callable[[Camera], None], str]
"""What raises BadInput for a camera that is wrong, and the sections that it needs to say so."""
_CHECKS: tuple[Check, ...] = (
    (named_spectra.check_spectra, "scene"),
    (geometry.check, "scene optics pixel array"),
    (electrical.check, "pixel adc"),
    (falloff.check, "scene optics pixel array"),
    (photodiode.check, "pixel"),
)


@dataclass(frozen=True)
class Origin:
    """Where a camera comes from: its file, all input files, and the place of every key.

    `files` are the YAML files read, then the files that they name (pictures, tables).
    """

    file: Path
    files: tuple[Path, ...]
    tree: Node

    @cached_property
    def places(self) -> dict[errors.Path, str]:
        """The place of every key that is written."""
        return places(self.tree)

    def locate(self, path: errors.Path) -> str:
        """ "camera.yaml:12:10" of `path`, or of the nearest thing around it that is written."""
        while path not in self.places and path:
            path = path[:-1]
        return self.places.get(path, "")


@dataclass(frozen=True)
class Base:
    """A camera file read once, of which any number of cameras are made, each with overrides."""

    file: Path
    tree: Node
    files: tuple[Path, ...]
    """The YAML files that went into it."""
    findings: Findings
    """What is wrong with it so far."""

    def overlaid(self, over: Node) -> "Base":
        """With a tree of overrides laid over it, and the parts that these name read in."""
        found = Findings(list(self.findings.problems), set(self.findings.failed))
        parts = Parts(list(self.files), found)
        tree = merge(self.tree, parts.expand(over, (), ()))
        return Base(self.file, tree, tuple(parts.files), found)

    def camera(self, checks: Sequence[Check] = ()) -> Camera:
        """The validated camera. Raises BadInput with every problem, see `load`."""
        findings = Findings(list(self.findings.problems), set(self.findings.failed))
        tree, named = _absolute_files(self._named(), findings)
        origin = Origin(self.file, tuple(dict.fromkeys((*self.files, *named))), tree)
        result, wrong = _validated(tree, origin, findings)
        if result is not None:
            _check(result, origin, findings, wrong, checks)
        if findings.problems or result is None:
            raise BadInput(dict.fromkeys(sorted(findings.problems, key=by_place)))
        return result.with_origin(origin)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """The YAML files that went into it and the files that these name, of those there are."""
        _, named = _absolute_files(self.tree, Findings())
        return tuple(dict.fromkeys((*self.files, *named)))

    def _named(self) -> Node:
        """The tree with a name, the file's where it has none of its own."""
        tree = self.tree
        if tree.get("name") is not None:
            return tree
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", self.file.stem)[:64] or "camera"
        entries: dict[Key, Node] = {"name": Node(stem, tree.source, tree.line, tree.column)}
        return replace(tree, value=entries | (tree.mapping or {}))


def read(camera: str | Path, folder: Path) -> Base:
    """A camera file, or a shipped camera's, with all its parts. Raises BadInput, CannotDo."""
    parts = Parts()
    file = find(camera, folder)
    return Base(file, parts.file(file, "cameras"), tuple(parts.files), parts.findings)


def load(
    camera: str | Path,
    sets: Sequence[str] = (),
    folder: Path | None = None,
    checks: Sequence[Check] = (),
) -> Camera:
    """The validated camera of a file, or of a shipped camera's name.

    `sets` are overrides "PATH=VALUE", VALUE read as YAML; `folder` is where relative paths start
    (default the current one). `camera.locate(path)` of the result gives the place of a key.
    `checks` are further ones, made where the sections that they need are valid and supported.
    Raises BadInput with every problem of the file, CannotDo where a file may not be read.
    """
    start = folder or current_folder()
    return read(camera, start).overlaid(overlay(sets, start)).camera(checks)


@cache
def example() -> Camera:
    """The shipped camera whose sections stand in for those that a file has wrong, read once."""
    return load(shipped.find("cameras", EXAMPLE), folder=shipped.folder())


def find(camera: str | Path, folder: Path, kind: str = "cameras") -> Path:
    """The file meant by a path or the name of a shipped one of that kind. Raises BadInput."""
    text = str(camera)
    path = folder / text
    if isinstance(camera, Path) or looks_like_path(text) or is_file(path):
        try:
            return existing(path, text)
        except BadInput as error:
            near = nearest(path.stem, shipped.names(kind))
            if near is None or (near != path.stem and "did you mean" in str(error)):
                raise
            raise bad(
                (), error.problems[0].message, f"a {shipped.KINDS[kind]} {near!r} ships"
            ) from None
    return shipped.find(kind, text)


def overlay(sets: Sequence[str], folder: Path) -> Node:
    """The tree of "PATH=VALUE" overrides. Raises BadInput for what is none."""
    whole = Node({}, Source("--set", folder, lines=False))
    problems = Collector()
    for item in sets:
        source = Source(f"--set {one_line(item)}", folder, lines=False)
        path, _, text = item.partition("=")
        keys = errors.split(path.strip())
        if "" in path.strip().split(".") or not text.strip():
            problem = Problem((), f"{item!r} is not PATH=VALUE", "write pixel.width=8um", "--set")
            problems.extend(BadInput([problem]))
            continue
        try:
            whole = merge(whole, nested(keys, read_text(text, source)))
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return whole


def nested(path: errors.Path, node: Node) -> Node:
    """The tree in which a node stands at a path, and nothing else."""
    for key in reversed(path):
        node = Node({key: node}, node.source, node.line, node.column)
    return node


def places(tree: Node) -> dict[errors.Path, str]:
    """The place of every value; of a block that begins below its key, the place of the key."""
    found: dict[errors.Path, str] = {}
    for path, node in walk(tree):
        found.setdefault(path, node.where)
        for key, standing in node.keys.items():
            child = node.get(key)
            if child is not None and isinstance(child.value, (dict, list)):
                begins_below = child.source is standing.source and child.line > standing.line
                found[below(path, key)] = standing.where if begins_below else child.where
    return found


def current_folder() -> Path:
    """The current folder. Raises CannotDo where it has been removed."""
    try:
        return Path.cwd()
    except OSError as error:
        reason = error.strerror or error
        raise CannotDo(f"the current folder is gone: {reason}", "go to another one") from error


def _absolute_files(node: Node, findings: Findings) -> tuple[Node, list[Path]]:
    """The tree with every file name absolute, and the files; what is no file is reported."""
    named: list[Path] = []

    def visit(node: Node, path: errors.Path) -> Node:
        if path and path[-1] in FILE_KEYS and isinstance(node.value, str):
            try:
                named.append(_absolute(node))
                return replace(node, value=str(named[-1]))
            except BadInput as error:
                findings.fail(path, error.problems)
                return node
        if isinstance(node.value, dict):
            entries = {k: visit(child, below(path, k)) for k, child in node.value.items()}
            return replace(node, value=entries)
        if isinstance(node.value, list):
            return replace(node, value=[visit(c, (*path, i)) for i, c in enumerate(node.value)])
        return node

    return visit(node, ()), named


def _absolute(node: Node) -> Path:
    text = str(node.value)
    try:
        return existing(node.source.folder / text, text)
    except BadInput as error:
        raise error.located(lambda _: node.where) from None


def _validated(tree: Node, origin: Origin, findings: Findings) -> tuple[Camera | None, set]:
    """The camera, and which of its sections are not the file's, since they are wrong there.

    What is wrong is added to the findings. None where no camera can be made.
    """
    value = tree.plain()
    assert isinstance(value, dict)
    try:
        return Camera.model_validate(value), set()
    except ValidationError as error:
        problems = explain.problems(error, Camera, value)
        findings.add(problems, origin.locate)
    wrong = {problem.path[0] for problem in problems if problem.path}
    findings.failed |= {(name,) for name in wrong}
    right = {name: section for name, section in value.items() if name not in wrong}
    good = example()
    needed = {n for n, field in Camera.model_fields.items() if field.is_required()} & wrong
    try:
        return Camera.model_validate(right | {name: getattr(good, name) for name in needed}), wrong
    except ValidationError:  # what is wrong between sections
        return None, wrong


def _check(
    camera: Camera, origin: Origin, findings: Findings, wrong: set, more: Sequence[Check]
) -> None:
    """Finds all that a valid camera can still have wrong, but for its sections `wrong`."""
    checks = [check for check, needed in (*_CHECKS, *more) if not wrong & set(needed.split())]
    for check in checks:
        try:
            check(camera)
        except BadInput as error:
            findings.add(error.problems, origin.locate)


def by_place(problem: Problem) -> tuple[str, int, int]:
    """File, line and column of a problem, to tell problems in the order of the file."""
    match = re.fullmatch(r"(.*?):(\d+):(\d+)", problem.where)
    return (match[1], int(match[2]), int(match[3])) if match else (problem.where, 0, 0)
