"""Which file a text names: in a YAML file, or on the command line.

A name in a YAML file is looked up beside that file, then in what ships; a text with `/` or ending
in `.yaml` is a path, relative to that file. A name never means the file it stands in: a file
`csf.yaml` may well say `scene: csf`. Shipped files look up names in what ships alone.
"""

import stat
from dataclasses import replace
from pathlib import Path

from vcam_cli import errors
from vcam_cli.config import shipped
from vcam_cli.config.yaml_reader import display_path
from vcam_cli.config.yaml_tree import Node
from vcam_cli.errors import BadInput, CannotDo, bad, nearest

COMMANDS = {
    "cameras": "vcam run",
    "studies": "vcam sweep, vcam schedule or vcam dataset",
    "measurements": "vcam verify, or vcam fit",
}
"""What ships and commands take -> the commands."""
SUFFIXES = (".yaml", ".yml")


def argument_file(argument: str | Path, folder: Path, kind: str) -> Path:
    """Return the file meant on the command line by a path, or by the name of a shipped file.

    Raises BadInput.
    """
    text = str(argument)
    path = folder / text
    if not (isinstance(argument, Path) or looks_like_path(text) or is_file(path)):
        _refuse_other_kind(text, kind)
        return shipped.find(kind, text)
    try:
        return existing_file(path, text)
    except BadInput as error:
        near = nearest(path.stem, shipped.names(kind))
        if near is None or (near != path.stem and "did you mean" in str(error)):
            raise
        message = error.problems[0].message
        raise bad((), message, f"{shipped.KINDS[kind]} {near!r} ships") from None


def _refuse_other_kind(name: str, kind: str) -> None:
    """Raise BadInput for the name of something that ships and another command takes."""
    for other, commands in COMMANDS.items():
        if other != kind and name in shipped.names(other) and name not in shipped.names(kind):
            message = f"{name!r} is {shipped.KINDS[other]}, not {shipped.KINDS[kind]}"
            raise bad((), message, f"give it to {commands}")


def referenced_file(name: Node, kind: str, chain: tuple[Path, ...] = ()) -> Path:
    """Return the file of a kind that a text in a YAML file names.

    `chain` are the files that led here, a name refers to none of these. Raises BadInput.
    """
    text, folder = name.value, name.source.folder
    if not isinstance(text, str) or not text:
        listed = ", ".join(shipped.names(kind)) or "none"
        raise bad((), "the name or path of a file is needed", f"shipped: {listed}")
    if looks_like_path(text):
        return existing_file(folder / text, text)
    if shipped.folder() not in (folder, *folder.parents):
        for suffix in SUFFIXES:
            beside = folder / (text + suffix)
            if is_file(beside) and beside.resolve() not in chain:
                return beside
    return shipped.find(kind, text)


def absolute_file(name: Node, path: errors.Path) -> Node:
    """Return the name of a data file, which stands at `path`, made absolute. Raises BadInput."""
    text = str(name.value)
    try:
        return replace(name, value=str(existing_file(name.source.folder / text, text)))
    except BadInput as error:
        raise BadInput(replace(p, path=path, where=name.where) for p in error.problems) from None


def looks_like_path(text: str) -> bool:
    """Return whether a text names a file and not something that ships."""
    return "/" in text or text.endswith(SUFFIXES)


def is_file(path: Path) -> bool:
    """Return whether there is such a file; False for what cannot be a file's name at all."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def existing_file(path: Path, text: str) -> Path:
    """Return `path`, which `text` names, when it is a regular file.

    Raises BadInput, with a name close to it.
    """
    if "://" in text:
        raise bad((), f"{text!r} is a URL", "download the file and give its path")
    if text.startswith("~"):
        raise bad((), f"~ is not expanded in {text!r}", "write the whole path")
    try:
        if path.is_file():
            return path
        if path.is_symlink():
            where = f"link to {_kind(path)}" if path.exists() else "broken link"
            raise bad((), f"{text!r} is a {where}", "point it to a file, or give another one")
        if path.exists():
            raise bad((), f"{text!r} is not a regular file", "give the path of a file")
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
    except (OSError, ValueError):
        siblings = []
    near = nearest(path.name, siblings)
    remedy = f"did you mean {near!r}?" if near else f"looked in {display_path(path.parent)}"
    raise bad((), f"there is no file {text!r}", remedy)


def _kind(path: Path) -> str:
    """Return what is at a path, links followed, that is no regular file."""
    mode = path.stat().st_mode
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "a device")


def current_folder() -> Path:
    """Return the current folder. Raises CannotDo where it has been removed."""
    try:
        return Path.cwd()
    except OSError as error:
        reason = error.strerror or error
        raise CannotDo(f"the current folder is gone: {reason}", "go to another one") from error
