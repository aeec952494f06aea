"""Processing steps of other packages: a package registers a model, a camera file names its key.

A package declares an entry point of the group `vcam.processing` whose name is the step's:

    [project.entry-points."vcam.processing"]
    posterize = "my_package:Posterize"

The class derives from `PluginStep`, has one key of that name, and `process`. Nothing is imported
before a file names the step. A name that vcam has itself stays vcam's.
"""

import hashlib
import inspect
import os
import sys
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, ClassVar, get_args

from vcam_cli.camera.processing_steps import ActsOn, Step

GROUP = "vcam.processing"
"""The group of entry points."""


MOST_HALO = 1000
"""The largest `halo` [pixels]: blocks of rows are padded by it on every side."""


class PluginStep(Step):
    """A step of an installed package."""

    acts_on = "colors"
    halo: ClassVar[int] = 0
    """Pixels on every side that `process` looks at; unused where it takes codes."""

    @abstractmethod
    def process(self, picture: Any) -> Any:
        """Return the picture after this step, in the same shape and type.

        Parameters
        ----------
        picture : ndarray
            Where `acts_on` is "light" or "colors", some rows of it with `halo` more on every side,
            mirrored beyond its border: linear light (C, rows, columns), float32; "light" is (1,
            rows, columns) before demosaic, and its first row may be of any phase. Where it is
            "codes", the whole render (rows, columns, C), or (rows, columns), uint8 or uint16.
        """

    def process_ideal(self, colors: Any) -> Any:
        """Return colors (C, ...) of the ideal image after this step; as they are by default.

        The perfect white that sets the scale of the picture passes through here, too: a step that
        changes colors, and not only detail or noise, says here what it does to them.
        """
        return colors


def registered() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages, by the name of their step.

    Every frame of a sweep needs them; they are read again where a folder that Python looks into
    has changed, as it has when a package was installed.
    """
    folders = []
    for folder in sys.path:
        with suppress(OSError):
            folders.append((folder, os.stat(folder or ".").st_mtime_ns))
    return dict(_entry_points(tuple(folders)))


@lru_cache(1)
def _entry_points(folders: tuple[tuple[str, int], ...]) -> dict[str, EntryPoint]:
    """Return the entry points in folders, each folder with the time of its last change."""
    return {point.name: point for point in entry_points(group=GROUP)}


@cache
def plugin(name: str) -> type[PluginStep] | None:
    """Return the model of a registered step; None where no package registers it.

    Raises
    ------
    ValueError
        The package cannot be imported, or registers something else; in words for the user.
    """
    point = registered().get(name)
    if point is None:
        return None
    remedy = f"mend {origin(point)}, or remove the step"
    try:
        found = point.load()
    except (
        Exception,
        SystemExit,
    ) as error:  # whatever a foreign package raises while it is imported
        what = f"{type(error).__name__}: {error}"
        raise ValueError(f"{point.value} cannot be imported ({what}); {remedy}") from error
    if not (inspect.isclass(found) and issubclass(found, PluginStep)):
        raise ValueError(f"{point.value} is no PluginStep; {remedy}")
    if tuple(found.model_fields) != (name,):
        raise ValueError(f"{point.value} must have one key, called {name}; {remedy}")
    if inspect.isabstract(found):
        raise ValueError(f"{point.value} has no method `process`; {remedy}")
    if found.acts_on not in get_args(ActsOn):
        allowed = ", ".join(get_args(ActsOn))
        raise ValueError(f"{point.value} acts_on {found.acts_on!r}, not one of {allowed}; {remedy}")
    return found


def checked_halo(step: PluginStep) -> int:
    """Return the halo of a step [pixels]. Raises ValueError for an invalid one."""
    halo = step.halo
    if isinstance(halo, bool) or not isinstance(halo, int) or not 0 <= halo <= MOST_HALO:
        raise ValueError(f"its halo is {halo!r}, not a whole number from 0 to {MOST_HALO} pixels")
    return halo


def origin(point: EntryPoint) -> str:
    """Return the package that an entry point belongs to, with its version."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else "the package"


def code(steps: Iterable[Step]) -> dict[str, str]:
    """Return what the numbers of plug-in steps depend on: package, version, hash of the module."""
    foreign = [step for step in steps if isinstance(step, PluginStep)]
    points = registered() if foreign else {}
    return {
        step.name: f"{origin(points[step.name])} {_file_hash(type(step))}"
        for step in foreign
        if step.name in points
    }


def _file_hash(kind: type) -> str:
    try:
        file = inspect.getsourcefile(kind)
    except (TypeError, OSError):  # a class that was made by no file
        return ""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16] if file else ""
