"""What a step of another package makes, looked at before anything depends on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import BadInput, CannotDo, bad, one_line

Path = tuple[str | int, ...]
Work = Callable[[Array], object]


def planes(process: Work, path: Path, given: Array) -> Array:
    """Return light (C, ...) after a step, of the same shape and finite, or raise BadInput."""
    done = _array(process, path, given.copy())
    if done.shape != given.shape:
        _refuse(path, f"makes {done.shape} of {given.shape}")
    if done.dtype.kind not in "fiub":
        _refuse(path, f"makes numbers of the type {done.dtype}")
    if not np.isfinite(done).all() and np.isfinite(given).all():
        _refuse(path, "makes values that are not finite")
    return done


def codes(process: Work, path: Path, given: Array) -> Array:
    """Return codes of the render after a step, of the same shape and type, or raise BadInput."""
    done = _array(process, path, given.copy())
    if done.shape != given.shape or done.dtype != given.dtype:
        before, made = (f"{a.shape} of {a.dtype}" for a in (given, done))
        _refuse(path, f"makes {made} of {before}")
    return done


def _array(process: Work, path: Path, given: Array) -> Array:
    try:
        return np.asarray(process(given))
    except (BadInput, CannotDo, MemoryError):
        raise
    except (Exception, SystemExit) as error:  # whatever a foreign package raises
        _refuse(path, one_line(f"ends with {type(error).__name__}: {error}").rstrip(": "))


def _refuse(path: Path, what: str) -> NoReturn:
    raise bad(path, f"the step {path[-1]} {what}", "mend its package, or remove the step")
