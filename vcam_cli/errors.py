"""What can go wrong, and how it is said: one line a problem, with place, path and remedy.

Every error a user can cause is a `VcamError` and carries the exit code of the command line.
Anything else that escapes is a bug of vcam and deserves its traceback.

Why problems are values: whoever finds a mistake knows its YAML path, seldom the line of the
file. The loader fills in the places afterwards (`BadInput.with_places`), and gathers all
problems of a file before it raises (`Collector`).
"""

import difflib
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from typing import TypeVar

from vcam_cli.records import dataclass

T = TypeVar("T")
Path = tuple[str | int, ...]
LONGEST = 2000
"""Characters of a message: a file may hold megabytes where a word belongs."""


@dataclass(frozen=True)
class Problem:
    """One mistake in the user's input."""

    path: Path
    """Keys that lead to it in the YAML file; () is the whole file."""
    message: str
    """What is wrong."""
    remedy: str = ""
    """What to do about it."""
    where: str = ""
    """File, line and column once they are known: "camera.yaml:12:10"."""

    def __str__(self) -> str:
        parts = [part for part in (self.where, dotted_path(self.path), self.message) if part]
        text = ": ".join(parts)
        return one_line(f"{text}; {self.remedy}" if self.remedy else text)


class VcamError(Exception):
    """Base of all errors with a message for the user and an exit code."""

    exit_code = 1


class BadInput(VcamError):
    """The user's input is wrong: one or more `problems`, all of them."""

    exit_code = 2

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)

    def with_places(self, locate: Callable[[Path], str]) -> "BadInput":
        """Return the same error with every empty `where` filled in by `locate(path)`."""
        return BadInput(
            problem if problem.where else replace(problem, where=locate(problem.path))
            for problem in self.problems
        )


class CannotDo(VcamError):
    """The input is right, but this machine cannot: memory, disk, permission, folder in use."""

    exit_code = 3

    def __init__(self, message: str, remedy: str = "") -> None:
        self.message = message
        self.remedy = remedy
        super().__init__(message, remedy)

    def __str__(self) -> str:
        return one_line(f"{self.message}; {self.remedy}" if self.remedy else self.message)


class Collector:
    """Gathers problems, so that a user sees all mistakes of a file at once."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def add(self, path: Path | str, message: str, remedy: str = "") -> None:
        """Add a mistake at a path, a tuple or dotted."""
        self.problems.append(Problem(split(path), message, remedy))

    def extend(self, error: BadInput) -> None:
        """Add all the problems of an error."""
        self.problems.extend(error.problems)

    def attempt(self, function: Callable[..., T], *arguments: object) -> T | None:
        """Return what a function returns; add the problems of its BadInput and return None."""
        try:
            return function(*arguments)
        except BadInput as error:
            self.extend(error)
            return None

    def raise_if_any(self) -> None:
        """Raise BadInput where there are problems."""
        if self.problems:
            raise BadInput(self.problems)


def bad(path: Path | str, message: str, remedy: str = "") -> BadInput:
    """Return a `BadInput` with one problem; `path` is a tuple or dotted ("pixel.width")."""
    return BadInput([Problem(split(path), message, remedy)])


@contextmanager
def data_file_problems(file: str | PathLike[str], path: Path, remedy: str) -> Iterator[None]:
    """Raise what goes wrong while a data file is read as BadInput about the key that names it.

    Parameters
    ----------
    file : str or PathLike
        The file.
    path : tuple
        The key that names it.
    remedy : str
        What to write, for a file whose content is wrong and whose reader does not say it.
    """
    try:
        yield
    except ValueError as error:
        message, _, own = str(error).partition("; write ")
        raise bad(path, message, f"write {own}" if own else remedy) from None
    except OSError as error:
        raise bad(path, f"{file} cannot be read: {error.strerror}", "check the file name") from None


def dotted_path(path: Path) -> str:
    """Return a path as `--set` writes it: ("processing", 1, "gamma") is "processing.1.gamma"."""
    return ".".join(str(part) for part in path)


def split(path: Path | str) -> Path:
    """Return the path that `dotted_path` wrote; parts that are whole numbers become int.

    Elements of lists may be in brackets, as in "processing[1].demosaic".
    """
    if isinstance(path, tuple):
        return path
    path = re.sub(r"\[(\d+)\]", r".\1", path)
    return tuple(int(p) if p.isascii() and p.isdigit() else p for p in path.split(".") if p)


def nearest(word: object, allowed: Iterable[object], least: float = 0.6) -> str | None:
    """Return the allowed name closest to `word`, case, `-` and `_` aside, or None.

    It must be alike to the ratio `least` of `difflib`.
    One that begins with the whole word, such as snr_db with snr, is closer than any other.
    """
    if not isinstance(word, str):
        return None
    names = {_plain(name): name for name in allowed if isinstance(name, str)}
    begun = [name for name in names if name.startswith(f"{_plain(word)}_")]
    if begun and _plain(word) not in names:
        return names[min(begun, key=len)]
    found = difflib.get_close_matches(_plain(word[:100]), names, n=1, cutoff=least)
    return names[found[0]] if found else None


def _plain(word: str) -> str:
    return word.lower().replace("-", "_")


def one_line(text: str) -> str:
    """Return a message as one line that cannot steer a terminal: control characters are escaped.

    Of a very long message the beginning and the end stay.
    """
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
