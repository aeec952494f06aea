"""Description of a package's file kinds, as their reader needs it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Generic, TypeVar

from vcam_cli import errors
from vcam_cli.config.merge import NO_RULES, MergeRules
from vcam_cli.config.model import FileModel
from vcam_cli.config.yaml_tree import Key, Node
from vcam_cli.errors import Problem
from vcam_cli.records import dataclass

M = TypeVar("M", bound=FileModel)
Check = tuple[Callable[[M], None], str]
"""What raises BadInput for a model that is wrong, and the sections that it needs."""


def names_file(keys: frozenset[Key], key: Key, kind: object) -> bool:
    """Return whether a key of a mapping holds the name of a data file.

    Parameters
    ----------
    keys : frozenset of str
        Keys that always do, and "KIND.KEY" for those that do in mappings of one `kind`.
    key : str
        The key.
    kind : object
        What the mapping has as its `kind`; None where it has none.
    """
    return key in keys or f"{kind}.{key}" in keys


@dataclass(frozen=True)
class FileFormat(Generic[M]):
    """The files that describe one model."""

    model: type[M]
    kind: str
    """Kind of the shipped files, a key of `shipped.KINDS`."""
    parts: Mapping[errors.Path, str] = field(default_factory=dict)
    """Where a part file may stand -> its kind."""
    words: Mapping[errors.Path, str] = field(default_factory=dict)
    """Where a part file may stand -> a word that names none."""
    shorthands: Mapping[errors.Path, Key] = field(default_factory=dict)
    """Where a text replaces a mapping of this one key -> the key."""
    file_keys: frozenset[Key] = frozenset()
    """Keys that hold names of data files: `names_file`."""
    merge_rules: MergeRules = NO_RULES
    refuse: Callable[[Node], None] = lambda root: None
    """What raises BadInput for a file of another format."""
    advise: Callable[[Problem, object], Problem] = lambda problem, given: problem
    """Says what is meant by a key or value that is wrong, knowing what stands there."""
    checks: Sequence[Check[M]] = ()
    """Further checks of a valid model."""
    stand_in: Callable[[], M] | None = None
    """What returns a valid model, whose sections stand in for those that a file has wrong."""
