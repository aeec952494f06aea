"""What Python callers hand in, refused in one sentence where it is of the wrong type."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

_EXAMPLES = {
    "camera": "camera.yaml",
    "study": "study.yaml",
    "measurement": "bench.yaml",
    "image": "render.png",
    "reference": "reference.png",
}


def require_name(given: Any, kind: str) -> None:
    """Raise TypeError for what is no file or name of a kind, of `_EXAMPLES`."""
    if not isinstance(given, str | PathLike) or isinstance(given, bytes):
        raise TypeError(f'{brief(given)} is no file or name of a {kind}; write "{_EXAMPLES[kind]}"')


def require_overrides(given: Any) -> None:
    """Raise TypeError for what is no list of overrides "PATH=VALUE"."""
    if not isinstance(given, list | tuple) or not all(isinstance(item, str) for item in given):
        raise TypeError(f'{brief(given)} is no list of overrides; write ["pixel.width=8 um"]')


def require_folder(given: Any) -> Path:
    """Return the path of a folder. Raise TypeError for other types."""
    if not isinstance(given, str | PathLike) or isinstance(given, bytes):
        raise TypeError(f'{brief(given)} is no folder; write "out/mine"')
    return Path(given)


def require_whole(given: Any, name: str, least: int) -> None:
    """Raise TypeError or ValueError for what is no whole number from `least` up."""
    if isinstance(given, bool) or not hasattr(given, "__index__"):
        raise TypeError(f"{name}={brief(given)} is no whole number; write {name}={max(least, 1)}")
    if given < least:
        raise ValueError(f"{name}={given} is less than {least}; write {name}={max(least, 1)}")


def brief(given: Any) -> str:
    """Return how a value reads in a message, at most a line long."""
    text = repr(given)
    return text if len(text) <= 80 else f"{text[:60]}... ({type(given).__name__})"
