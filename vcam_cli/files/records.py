"""Records of vcam's output folders, and the proof that a file in one is vcam's own.

A record (run.json and its like) names the files that were written with it, with the size and the
SHA-256 of each. Only a file that still has both is removed or replaced: what a person has changed,
and what a folder from elsewhere merely claims, stays.
"""

import hashlib
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from vcam_cli.errors import bad
from vcam_cli.files.atomic import STAGING, write_text
from vcam_cli.files.report import hash_text, to_json

PROGRAM = "vcam"
"""A record is vcam's when it says {"program": "vcam", "files": [...]}."""
LOCK = ".vcam-lock"
RECORDS = (
    "run.json",
    "accuracy.json",
    "characterize.json",
    "study.json",
    "compare.json",
    "scenes.json",
    "verify.json",
    "fit.json",
    "dataset.json",
)
"""The records of vcam's commands: each may add its files to the folder of another."""
_LARGEST_RECORD = 1 << 26  # bytes
_ORIGINS = ("written", "pending")
"""Keys of a record with fingerprints: of files that are there, and of those about to be."""

Fingerprint = dict[str, Any]
"""{"bytes": size of a file, "sha256": its hash, hexadecimal}."""


def read_record(path: Path) -> dict[str, Any] | None:
    """Return the JSON object in `path` when it is a record or journal of vcam, else None."""
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or not 0 < status.st_size <= _LARGEST_RECORD:
            return None
        value = json.loads(path.read_text(encoding="utf-8"), parse_int=_whole)
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(value, dict) or value.get("program") != PROGRAM:
        return None
    names = value.get("files")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None
    return value


def _whole(digits: str) -> int | float:
    """Return a whole number of JSON; as a float where 64 bits do not hold it, as others have it."""
    return int(digits) if len(digits) < 19 else float(digits)


def fingerprint(data: bytes) -> Fingerprint:
    """Return the fingerprint of a file that holds these bytes."""
    return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def file_fingerprint(path: Path) -> Fingerprint:
    """Return the fingerprint of a file. Raise OSError where it cannot be read."""
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return {"bytes": os.fstat(file.fileno()).st_size, "sha256": digest}


_FINGERPRINTS: dict[tuple[int, ...], Fingerprint] = {}
"""State of a file -> its fingerprint, of files that this process has read or written last."""
_REMEMBERED = 4096


def _state(status: os.stat_result) -> tuple[int, ...]:
    """Return numbers of a file; one changes whenever its content does."""
    times = status.st_mtime_ns, status.st_ctime_ns
    return status.st_dev, status.st_ino, status.st_size, *times


def _remember(state: tuple[int, ...], made: Fingerprint) -> None:
    while len(_FINGERPRINTS) >= _REMEMBERED:
        _FINGERPRINTS.pop(next(iter(_FINGERPRINTS)), None)
    _FINGERPRINTS[state] = made


def remember(path: Path, before: os.stat_result, made: Fingerprint) -> None:
    """Remember the fingerprint of a file that was hashed before it got its name.

    To read a shard again takes longer than to compute it. A rename keeps content, size and time of
    the last change; a file of another size or time is read when it is needed.

    Parameters
    ----------
    path : Path
        The file under its name.
    before : os.stat_result
        Its state when it was hashed, under its temporary name.
    made : Fingerprint
        Its fingerprint.
    """
    after = path.lstat()
    if _state(before)[:4] == _state(after)[:4]:
        _remember(_state(after), made)


class Proofs:
    """What records say of the files of a folder: which of them are vcam's."""

    def __init__(self, folder: Path, *records: Mapping[str, Any] | None) -> None:
        self._folder = folder
        self._known: dict[str, list[Fingerprint]] = {}
        for record in filter(None, records):
            for name in record["files"]:
                self._known.setdefault(name, [])
            for origin in _ORIGINS:
                self.add(record.get(origin))

    def add(self, fingerprints: object) -> None:
        """Take further fingerprints of files, by name; anything else proves nothing."""
        if isinstance(fingerprints, Mapping):
            for name, known in fingerprints.items():
                self._known.setdefault(name, []).extend(
                    known if isinstance(known, list) else [known]
                )

    @property
    def names(self) -> list[str]:
        """The names of the files that are said to be vcam's."""
        return sorted(self._known)

    def plain(self) -> dict[str, list[Fingerprint]]:
        """Return all fingerprints by name."""
        return dict(self._known)

    def holds(self, name: str) -> bool:
        """Tell whether the file of a name is inside the folder and as vcam wrote it."""
        known = self._known.get(name, [])
        path = self._folder / name
        if not known or not is_safe(name) or not has_real_parents(self._folder, name):
            return False
        try:
            status = path.lstat()
            if not stat.S_ISREG(status.st_mode):
                return False
            if not any(isinstance(k, dict) and k.get("bytes") == status.st_size for k in known):
                return False
            state = _state(status)
            found = _FINGERPRINTS.get(state)
            if found is None:
                found = file_fingerprint(path)
                _remember(state, found)
            return found in known
        except OSError:
            return False

    def require(self, names: Iterable[str]) -> None:
        """Raise BadInput where a file of one of these names is there and not proven vcam's."""
        found = list(self._unproven(names))
        if found:
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            raise bad(
                "--out",
                f"{found[0]}{more} is there already and was not written by vcam, or changed since",
                "move it away, or choose another folder",
            )

    def _unproven(self, names: Iterable[str]) -> Iterator[str]:
        for name in names:
            if not is_safe(name):
                yield f"{name!a} of the record in {self._folder}"
            elif os.path.lexists(self._folder / name) and not self.holds(name):
                yield str(self._folder / name)


def is_safe(name: str) -> bool:
    """Tell whether a file can have the name, and stays inside its folder with it."""
    path = PurePosixPath(name)
    try:
        short = all(len(os.fsencode(part)) <= 255 for part in path.parts)
    except UnicodeError:
        return False
    inside = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return short and inside and "\0" not in name and path.parts[0] not in (LOCK, STAGING)


def has_real_parents(folder: Path, name: str) -> bool:
    """Tell whether every folder on the way to `name` is missing or a folder itself, no link."""
    for parent in PurePosixPath(name).parents[:-1]:
        path = folder / parent
        if os.path.lexists(path) and (path.is_symlink() or not path.is_dir()):
            return False
    return True


def record_check(record: Mapping[str, Any]) -> str:
    """Return the hash of all that a record says, but for this hash itself."""
    return hash_text(to_json({name: value for name, value in record.items() if name != "check"}))


def adopt(path: Path) -> None:
    """Name a file that a command has written into a folder of another one in that one's record.

    So the next run there knows it as vcam's. Nothing happens where the folder has no record.
    Raises CannotDo.
    """
    for record in (path.parent / name for name in RECORDS):
        known = read_record(record)
        if known is None:
            continue
        written = known.get("written")
        whole = known | {
            "files": sorted({*known["files"], path.name}),
            "written": (written if isinstance(written, dict) else {})
            | {path.name: file_fingerprint(path)},
        }
        if "check" in known:
            whole["check"] = record_check(whole)
        write_text(record, to_json(whole))
        return
