"""What can go wrong, and how it is said: one line a problem, with place, path and remedy.

Every error a user can cause is a `VcamError` and carries the exit code of the command line.
Anything else that escapes is a bug of vcam and deserves its traceback.

Why problems are values: whoever finds a mistake knows its YAML path, seldom the line of the
file. The loader fills in the places afterwards (`BadInput.located`), and gathers all
problems of a file before it raises (`Collector`).
"""

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

Path = tuple[str | int, ...]
LONGEST = 2000
"""Characters of a message: a file may hold megabytes where a word belongs."""


@dataclass(frozen=True)
class Problem:
    """One mistake: `path` in the YAML file (() = the whole file), what is wrong, what to do."""

    path: Path
    message: str
    remedy: str = ""
    where: str = ""  # "camera.yaml:12:10" once known

    def __str__(self) -> str:
        parts = [part for part in (self.where, dotted(self.path), self.message) if part]
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

    def located(self, locate: Callable[[Path], str]) -> "BadInput":
        """The same error with every empty `where` filled in by `locate(path)`."""
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
        self.problems.append(Problem(split(path), message, remedy))

    def extend(self, error: BadInput) -> None:
        self.problems.extend(error.problems)

    def raise_if_any(self) -> None:
        if self.problems:
            raise BadInput(self.problems)


def bad(path: Path | str, message: str, remedy: str = "") -> BadInput:
    """A `BadInput` with one problem; `path` is a tuple or dotted ("pixel.width")."""
    return BadInput([Problem(split(path), message, remedy)])


def dotted(path: Path) -> str:
    """("processing", 1, "gamma") -> "processing.1.gamma", the notation of `--set`."""
    return ".".join(str(part) for part in path)


def split(path: Path | str) -> Path:
    """The inverse of `dotted`; parts that are whole numbers become int."""
    if isinstance(path, tuple):
        return path
    return tuple(int(p) if p.isascii() and p.isdigit() else p for p in path.split(".") if p)


def nearest(word: object, allowed: Iterable[object]) -> str | None:
    """The allowed name closest to `word`, case, `-` and `_` aside; None when none is close."""
    if not isinstance(word, str):
        return None
    names = {_plain(name): name for name in allowed if isinstance(name, str)}
    found = difflib.get_close_matches(_plain(word[:100]), names, n=1, cutoff=0.6)
    return names[found[0]] if found else None


def _plain(word: str) -> str:
    return word.lower().replace("-", "_")


def one_line(text: str) -> str:
    """Control characters escaped: a message stays one line and cannot steer a terminal.

    Of a very long one the beginning and the end.
    """
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
