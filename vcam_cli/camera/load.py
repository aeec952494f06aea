"""A camera file -> a `Camera`: read, put together, check, and say everything that is wrong.

The steps: read the YAML with its places, read in the parts and bases, lay `--set` over it, make
file names absolute, validate the model, refuse what is not supported yet, check the geometry.
Every step gives its problems the place in the file they come from, and as many as can be known
are reported at once: what is wrong in one section keeps back only the checks that need it.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from vcam_cli import errors
from vcam_cli.camera import electrical, explain, geometry, shipped, support
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
    (support.check_spectra, "scene"),
    (geometry.check, "scene optics pixel array"),
)
_OF_WHAT_IS_BUILT: tuple[Check, ...] = ((electrical.check, "pixel adc"),)
"""Those that do not know the values that are not supported yet."""


@dataclass(frozen=True)
class Origin:
    """Where a camera comes from: its file, all input files, and the place of every key.

    `files` are the YAML files read, then the files that they name (pictures, tables).
    """

    file: Path
    files: tuple[Path, ...]
    places: dict[errors.Path, str]

    def locate(self, path: errors.Path) -> str:
        """ "camera.yaml:12:10" of `path`, or of the nearest thing around it that is written."""
        while path not in self.places and path:
            path = path[:-1]
        return self.places.get(path, "")


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
    start = folder or _current()
    file = find(camera, start)
    tree, parts = _read(file, sets, start)
    findings = parts.findings
    tree, named = _absolute_files(tree, findings)
    origin = Origin(file, tuple(dict.fromkeys((*parts.files, *named))), places(tree))
    result, wrong = _validated(tree, origin, findings)
    if result is not None:
        _check(result, origin, findings, wrong, checks)
    if findings.problems or result is None:
        raise BadInput(dict.fromkeys(sorted(findings.problems, key=_place)))
    return result.with_origin(origin)


def find(camera: str | Path, folder: Path) -> Path:
    """The camera file meant by a path or the name of a shipped one. Raises BadInput."""
    text = str(camera)
    path = folder / text
    if isinstance(camera, Path) or looks_like_path(text) or is_file(path):
        try:
            return existing(path, text)
        except BadInput as error:
            near = nearest(path.stem, shipped.names("cameras"))
            if near is None or (near != path.stem and "did you mean" in str(error)):
                raise
            raise bad((), error.problems[0].message, f"a camera {near!r} ships") from None
    return shipped.find("cameras", text)


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
            node = read_text(text, source)
            for key in reversed(keys):
                node = Node({key: node}, source)
            whole = merge(whole, node)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return whole


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


def _current() -> Path:
    """The current folder. Raises CannotDo where it has been removed."""
    try:
        return Path.cwd()
    except OSError as error:
        reason = error.strerror or error
        raise CannotDo(f"the current folder is gone: {reason}", "go to another one") from error


def _read(file: Path, sets: Sequence[str], folder: Path) -> tuple[Node, Parts]:
    """The whole tree of a file, and the parts that went into it."""
    parts = Parts()
    tree = parts.file(file, "cameras")
    tree = merge(tree, parts.expand(overlay(sets, folder), (), ()))
    if tree.get("name") is None:
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem)[:64] or "camera"
        entries: dict[Key, Node] = {"name": Node(stem, tree.source, tree.line, tree.column)}
        tree = replace(tree, value=entries | (tree.mapping or {}))
    return tree, parts


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
    good = load(shipped.find("cameras", EXAMPLE), folder=shipped.folder())
    needed = {n for n, field in Camera.model_fields.items() if field.is_required()} & wrong
    try:
        return Camera.model_validate(right | {name: getattr(good, name) for name in needed}), wrong
    except ValidationError:  # what is wrong between sections
        return None, wrong


def _check(
    camera: Camera, origin: Origin, findings: Findings, wrong: set, more: Sequence[Check]
) -> None:
    """Finds all that a valid camera can still have wrong, but for its sections `wrong`."""
    unsupported = support.unsupported(camera)
    findings.add(unsupported, origin.locate)
    unbuilt = wrong | {problem.path[0] for problem in unsupported}
    checks = [check for check, needed in _CHECKS if not wrong & set(needed.split())]
    for check, needed in (*_OF_WHAT_IS_BUILT, *more):
        checks += [check] if not unbuilt & set(needed.split()) else []
    for check in checks:
        try:
            check(camera)
        except BadInput as error:
            findings.add(error.problems, origin.locate)


def _place(problem: Problem) -> tuple[str, int, int]:
    """File, line and column of a problem, to tell problems in the order of the file."""
    match = re.fullmatch(r"(.*?):(\d+):(\d+)", problem.where)
    return (match[1], int(match[2]), int(match[3])) if match else (problem.where, 0, 0)
