"""run.json and its like: deterministic JSON, and the hashes that go into it."""

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from vcam_cli.errors import CannotDo


def to_json(value: Any) -> str:
    """Return JSON text with sorted keys, indented by 2, one final line feed; equal in, equal out.

    Accepts mappings, sequences, sets (sorted), numbers and arrays of NumPy, paths. Floats have
    their shortest exact form. JSON knows no infinity: it is written as the string
    "infinity" ("-infinity", "nan"), the word the camera file uses.

    Raise TypeError for anything else.
    """
    return json.dumps(_plain(value), indent=2, sort_keys=True, ensure_ascii=False) + "\n"


def hash_text(text: str) -> str:
    """Return the SHA-256 of the text in UTF-8, hexadecimal."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def file_digest(path: Path | str) -> str:
    """Return the SHA-256 of a file, hexadecimal. Raise OSError where it cannot be read."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_file(path: Path | str) -> str:
    """Return the SHA-256 of a file, hexadecimal. Raise CannotDo when it cannot be read."""
    try:
        return file_digest(path)
    except OSError as error:
        raise CannotDo(
            f"cannot read {path}: {error.strerror}", "check that the file can be read"
        ) from error


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return _finite(float(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, set | frozenset):
        return [_plain(item) for item in sorted(value)]
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError(f"a {type(value).__name__} has no place in a report")


def _finite(value: float) -> float | str:
    if math.isfinite(value):
        return value
    return "nan" if math.isnan(value) else "infinity" if value > 0 else "-infinity"
