"""Part files: `optics: f2.8-normal`, `{use: NAME, ...}`, `extends: OTHER.yaml`.

A name is looked up beside the file that uses it, then in what ships; a text with `/` or ending
in `.yaml` is a path, relative to that file. Parts may use and extend further parts; a circle is
an error.

`pixel.technology: NAME` is read in as `{from: what its file says}`.

Why a name never means the file it stands in (or another camera, for shipped ones): a camera
`csf.yaml` may well say `scene: csf`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from vcam_cli import errors
from vcam_cli.camera import shipped
from vcam_cli.camera.merge import merge
from vcam_cli.camera.yaml_tree import Key, Node, below, read_file, shown
from vcam_cli.errors import BadInput, Problem, bad, nearest

LONGEST_CHAIN = 32
SECTIONS: dict[errors.Path, str] = {
    ("scene",): "scenes",
    ("optics",): "optics",
    ("pixel",): "pixels",
    ("array",): "arrays",
    ("array", "filters"): "filters",
    ("pixel", "technology", "from"): "technologies",
}  # where a part file may stand -> what kind of part
_TECHNOLOGY = ("pixel", "technology")
_SUFFIXES = (".yaml", ".yml")


@dataclass
class Findings:
    """The problems found so far, and the paths of what could not be had at all.

    What later steps find wrong below such a path would only be an echo, and is dropped.
    """

    problems: list[Problem] = field(default_factory=list)
    failed: set[errors.Path] = field(default_factory=set)

    def fail(self, path: errors.Path, problems: Iterable[Problem]) -> None:
        """`path` could not be had, because of `problems`."""
        self.failed.add(path)
        self.problems.extend(_under(path, problem) for problem in problems)

    def add(self, problems: Iterable[Problem], locate: Callable[[errors.Path], str]) -> None:
        """Further problems, put in place by `locate`."""
        for problem in BadInput(problems).located(locate).problems:
            if not any(problem.path[: len(path)] == path for path in self.failed):
                self.problems.append(problem)


@dataclass
class Parts:
    """Expands trees; remembers the files read and what was wrong with parts."""

    files: list[Path] = field(default_factory=list)
    findings: Findings = field(default_factory=Findings)

    def file(
        self, path: Path, kind: str, at: errors.Path = (), chain: tuple[Path, ...] = ()
    ) -> Node:
        """The tree of a camera or part file, with all its parts and bases in it.

        `kind` says which (cameras, optics ...), `at` where in the camera it stands, `chain`
        which files led here. Raises BadInput; what is wrong with a part inside is collected.
        """
        self.files.append(path.resolve())
        root = read_file(path)
        chain = (*chain, path.resolve())
        if root.mapping is None:
            remedy = "write lines of `key: value`"
            raise BadInput([root.problem(at, "a mapping is needed here", remedy)])
        if not at:
            refuse_study(root)
        own = self.expand(without(root, "extends"), at, chain)
        base = root.get("extends")
        if base is None:
            return own
        return merge(without(self._part(base, kind, at, chain), "name"), own, at)

    def expand(self, node: Node, at: errors.Path, chain: tuple[Path, ...]) -> Node:
        """`node`, which stands at `at`, with the part files named in it read in."""
        if node.mapping is None:
            return node
        entries: dict[Key, Node] = {}
        for key, child in node.mapping.items():
            there = below(at, key)
            if there in SECTIONS:
                child = self._section(child, there, chain)
            elif there == _TECHNOLOGY:
                child = self.expand(_as_mapping(child), there, chain)
            entries[key] = child
        return replace(node, value=entries)

    def _section(self, node: Node, at: errors.Path, chain: tuple[Path, ...]) -> Node:
        use = node.get("use") if node.mapping is not None else node
        if use is None or (use is node and not isinstance(node.value, str)):
            return self.expand(node, at, chain)
        try:
            part = self._part(use, SECTIONS[at], at, chain)
            if use is not node:
                part = merge(part, self.expand(without(node, "use"), at, chain), at)
            return replace(part, whole=True)
        except BadInput as error:
            self.findings.fail(at, error.problems)
            return node

    def _part(self, name: Node, kind: str, at: errors.Path, chain: tuple[Path, ...]) -> Node:
        """The tree of the file that `name` names."""
        try:
            path = locate(name, kind, chain)
        except BadInput as error:
            raise error.located(lambda _: name.where) from None
        if path.resolve() in chain:
            circle = " -> ".join(file.name for file in (*chain, path))
            message = f"the files refer to each other in a circle: {circle}"
            raise BadInput([name.problem(at, message, "remove one of the references")])
        if len(chain) >= LONGEST_CHAIN:
            message = f"more than {LONGEST_CHAIN} files refer to each other"
            raise BadInput([name.problem(at, message, "write some of them into one file")])
        return self.file(path, kind, at, chain)


def locate(name: Node, kind: str, chain: tuple[Path, ...] = ()) -> Path:
    """The file that the text of `name` names, as the module says. Raises BadInput."""
    text, folder = name.value, name.source.folder
    if not isinstance(text, str) or not text:
        raise bad((), "the name or path of a file is needed", f"shipped: {_shipped(kind)}")
    if looks_like_path(text):
        return existing(folder / text, text)
    inside_shipped = shipped.folder() in (folder, *folder.parents)
    for suffix in _SUFFIXES:
        beside = folder / (text + suffix)
        if not inside_shipped and is_file(beside) and beside.resolve() not in chain:
            return beside
    return shipped.find(kind, text)


def looks_like_path(text: str) -> bool:
    """Whether a text names a file and not something that ships."""
    return "/" in text or text.endswith(_SUFFIXES)


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for what cannot be a file's name at all."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def existing(path: Path, text: str) -> Path:
    """`path` when it is a regular file. Raises BadInput, with a name close to it."""
    if "://" in text:
        raise bad((), f"{text!r} is a URL", "download the file and give its path")
    if text.startswith("~"):
        raise bad((), f"~ is not expanded in {text!r}", "write the whole path")
    try:
        if path.is_file():
            return path
        if path.is_symlink():
            raise bad((), f"{text!r} is a broken link", "point it to a file, or give another one")
        if path.exists():
            raise bad((), f"{text!r} is not a regular file", "give the path of a file")
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
    except (OSError, ValueError):
        siblings = []
    near = nearest(path.name, siblings)
    remedy = f"did you mean {near!r}?" if near else f"looked in {shown(path.parent)}"
    raise bad((), f"there is no file {text!r}", remedy)


def refuse_study(root: Node) -> None:
    """Raises BadInput when the file is a study and not a camera."""
    kind = root.get("kind")
    if kind is not None and kind.value in ("sweep", "schedule"):
        message, remedy = f"this is a study (kind: {kind.value})", "give a camera file"
        remedy += f", or run the study with vcam {kind.value}"
        raise BadInput([kind.problem(("kind",), message, remedy)])


def without(node: Node, key: Key) -> Node:
    """A mapping less one of its keys."""
    assert node.mapping is not None
    return replace(node, value={k: v for k, v in node.mapping.items() if k != key})


def _as_mapping(technology: Node) -> Node:
    """The name of a technology as {from: name}, so that keys beside it can be laid over it."""
    if not isinstance(technology.value, str):
        return technology
    return replace(technology, value={"from": technology}, whole=True)


def _under(at: errors.Path, problem: Problem) -> Problem:
    """A problem of a part file, with its path in the camera."""
    inside = problem.path[: len(at)] == at
    return problem if inside else replace(problem, path=(*at, *problem.path))


def _shipped(kind: str) -> str:
    return ", ".join(shipped.names(kind)) or "none"
