"""The output folder of a run: its files appear together, or nothing changes.

A run writes its files into a staging folder beside their final place. `finish` removes what the
previous run had named in its record (run.json), moves the new files in, and writes the record
last: a folder with a record is complete, and a run that fails leaves the former results.

Why a journal: between the removal of the old record and the writing of the new one, no record names
the files in the folder. Their names are in the lock file during that time, so that a run after a
power cut knows which files are vcam's.

Why flock: the kernel drops it when its holder dies, however it dies.

Why an interrupt is deferred here: between two of these steps nobody would know what to undo. None
of them takes long.
"""

import errno
import fcntl
import json
import os
import shutil
import stat
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any, Self

from vcam_cli.errors import BadInput, CannotDo, bad
from vcam_cli.files.atomic import STAGING, cannot_write, flush_folder, write_text
from vcam_cli.files.report import to_json
from vcam_cli.interrupts import defer_interrupts

LOCK = ".vcam-lock"
PROGRAM = "vcam"
"""A record is vcam's when it says {"program": "vcam", "files": [...]}."""
RECORDS = (
    "run.json",
    "accuracy.json",
    "characterize.json",
    "study.json",
    "compare.json",
    "scenes.json",
)
"""The records of vcam's commands: each may add its files to the folder of another."""
_LARGEST_RECORD = 1 << 26  # bytes
_NO_LOCKS_HERE = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
_NOT_A_FOLDER = {errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL}


class OutputFolder:
    """Context of one run's output folder, created (with its parents) and locked on entry.

        with OutputFolder(path, inputs=[scene_file]) as folder:
            write_metrics(folder.new("metrics.csv"), rows)
            folder.finish({"seconds": 1.2})

    Without `finish`, or when anything raises, every new file, the lock and the folders
    created on entry are removed again, and the results of an earlier run are untouched.

    Raises on entry BadInput: `path` is a file, or a non-empty folder that is not vcam's, or
    one of `inputs` would be replaced. CannotDo: another run has the folder, no permission,
    read-only, disk full.
    """

    def __init__(
        self, path: Path | str, record: str = "run.json", inputs: Iterable[Path | str] = ()
    ) -> None:
        self.path = Path(path)
        self._record = record
        self._inputs = tuple(os.path.realpath(name) for name in inputs)
        self._made: list[Path] = []
        self._lock: int | None = None
        self._previous: frozenset[str] = frozenset()
        self._new: list[str] = []
        self._finished = False

    def __enter__(self) -> Self:
        try:
            with defer_interrupts():
                self._begin()
        except OSError as error:
            self._leave()
            raise self._unusable(error) from error
        except ValueError as error:  # a NUL, or no text of this system
            reason = "is not UTF-8" if isinstance(error, UnicodeError) else f"({error})"
            message = f"{self.path} is no folder name: {reason}"
            raise bad("--out", message, "choose another folder") from error
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with defer_interrupts():
            self._leave()

    def new(self, name: str) -> Path:
        """Return the temporary path of the new file `name`, as "captures/raw_001.exr".

        Raise BadInput when a file of that name is there that no run of vcam wrote.
        """
        self._check_new(name)
        path = self.path / STAGING / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise cannot_write(path, error) from error
        if name not in self._new:
            self._new.append(name)
        return path

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the new files, in the order of the calls of `new`."""
        return tuple(self._new)

    def finish(self, report: Mapping[str, Any]) -> None:
        """Replace the previous run's files by the new ones, then write the record.

        The record is `report` with `program` and `files` (names of the new files) added. The file
        of every call of `new` must have been written. Raise CannotDo, and BadInput when the place
        of a file was taken meanwhile; then nothing is removed.
        """
        names = sorted(self._new)
        for name in names:
            self._check_new(name)
        text = to_json({**report, "program": PROGRAM, "files": names})
        try:
            with defer_interrupts():
                self._replace_previous(names, text)
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def _replace_previous(self, names: list[str], text: str) -> None:
        """Move the new files in; see the module for the order."""
        record = self.path / STAGING / self._record
        record.parent.mkdir(exist_ok=True)
        write_text(record, text)
        for name in names:  # all are there: else nothing is removed
            (self.path / STAGING / name).stat()
        self._write_journal(sorted({*names, *self._previous}))
        self._remove([self._record, *sorted(self._previous - set(names))])
        for name in [*names, self._record]:
            self._move_in(name)
        flush_folder(self.path)
        self._finished = True

    def _begin(self) -> None:
        """Make, lock and check the folder."""
        str(self.path).encode("utf-8")  # the libraries that write pictures take no other names
        self._refuse_foreign(before_lock=True)
        self._make_and_lock()
        self._refuse_foreign()
        self._recover()

    def _refuse_foreign(self, before_lock: bool = False) -> None:
        """Raise BadInput for a non-empty folder without a record or journal of vcam."""
        try:
            present = set(os.listdir(self.path))
        except FileNotFoundError:
            return
        if before_lock and LOCK in present:
            return  # perhaps of a run at work: checked again under the lock
        ours = self._own_record() or self._journal() or self._has_other_record()
        if present - {LOCK, STAGING} and not ours:
            raise bad(
                "--out",
                f"{self.path} is not empty and holds no {self._record} of vcam",
                "choose a new or empty folder",
            )

    def _make_and_lock(self) -> None:
        for _ in range(20):  # another run may remove the folder or the lock in between
            self._make()
            with suppress(FileNotFoundError):
                if self._try_lock():
                    return
        raise CannotDo(f"{self.path} cannot be locked", "choose another folder")

    def _make(self) -> None:
        for folder in [*reversed(self.path.parents), self.path]:
            try:
                folder.mkdir()
            except OSError:
                if not folder.is_dir():
                    raise
            else:
                self._made.append(folder)

    def _try_lock(self) -> bool:
        name = self.path / LOCK
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        lock = os.open(name, flags, 0o666)
        try:
            if not stat.S_ISREG(os.fstat(lock).st_mode):
                raise OSError(errno.EINVAL, f"{LOCK} is not a regular file")
            _flock(lock, self.path)
            if os.path.samestat(os.fstat(lock), os.stat(name, follow_symlinks=False)):
                self._lock, lock = lock, -1
        finally:
            if lock >= 0:
                os.close(lock)
        return self._lock is not None

    def _recover(self) -> None:
        """Read what the previous run wrote, and remove what a killed one left unfinished."""
        self._clear_staging()
        record = self._own_record()
        names = record["files"] if record else self._journal()
        self._previous = frozenset(filter(_is_safe, names))
        self._protect_inputs([*self._previous, self._record])
        if not record:
            self._remove(sorted(self._previous))
            self._previous = frozenset()
        self._write_journal([])

    def _protect_inputs(self, names: Iterable[str]) -> None:
        for name in names:
            if os.path.realpath(self.path / name) in self._inputs:
                raise bad(
                    "--out",
                    f"{self.path / name} is an input of this run and would be replaced",
                    "choose another folder",
                )

    def _check_new(self, name: str) -> None:
        parts = PurePosixPath(name).parts
        if not _is_safe(name) or parts[0] in (LOCK, STAGING) or name == self._record:
            raise ValueError(f"{name!r} is no name for a file of a run")
        self._protect_inputs([name])
        target = self.path / name
        ours = name in self._previous and (target.is_symlink() or not target.is_dir())
        if (os.path.lexists(target) and not ours) or not _has_real_parents(self.path, name):
            raise bad(
                "--out",
                f"{target} is there already and was not written by vcam",
                "move it away, or choose another folder",
            )

    def _own_record(self) -> dict[str, Any] | None:
        """Return the record of the previous run, when it is vcam's."""
        return read_record(self.path / self._record)

    def _has_other_record(self) -> bool:
        """Tell whether another command of vcam has finished here."""
        return any(read_record(self.path / name) for name in RECORDS if name != self._record)

    def _journal(self) -> list[str]:
        """Return the names that the lock file holds, see the module."""
        journal = read_record(self.path / LOCK)
        return journal["files"] if journal else []

    def _write_journal(self, names: list[str]) -> None:
        assert self._lock is not None
        text = to_json({"program": PROGRAM, "files": names}) if names else ""
        os.ftruncate(self._lock, 0)
        os.pwrite(self._lock, text.encode(), 0)
        os.fsync(self._lock)

    def _remove(self, names: Iterable[str]) -> None:
        """Remove these files of the folder and the subfolders left empty, nothing outside."""
        for name in names:
            if not _is_safe(name) or not _has_real_parents(self.path, name):
                continue
            path = self.path / name
            if path.is_dir() and not path.is_symlink():
                continue
            path.unlink(missing_ok=True)
            for parent in PurePosixPath(name).parents[:-1]:
                with suppress(OSError):
                    (self.path / parent).rmdir()

    def _move_in(self, name: str) -> None:
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(self.path / STAGING / name, target)

    def _clear_staging(self) -> None:
        staging = self.path / STAGING
        if staging.is_symlink():
            staging.unlink()
        elif staging.exists():
            shutil.rmtree(staging)

    def _leave(self) -> None:
        """Remove all that is not a finished result and free the lock; never raise."""
        if self._lock is not None:
            clean = True
            try:
                self._clear_staging()
                if not self._finished and not self._own_record():
                    self._remove(self._journal())
            except OSError:
                clean = False  # the journal stays for the next run
            with suppress(OSError):
                if clean:
                    (self.path / LOCK).unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = None
        if not self._finished:
            for folder in reversed(self._made):
                with suppress(OSError):
                    folder.rmdir()
        self._made = []

    def _unusable(self, error: OSError) -> BadInput | CannotDo:
        """Return the error that tells why the folder cannot be used."""
        if error.errno in _NOT_A_FOLDER:
            reason = (
                "is a file" if os.path.isfile(self.path) else f"is no folder ({error.strerror})"
            )
            return bad("--out", f"{self.path} {reason}", "choose another folder")
        return cannot_write(self.path, error)


def is_foreign(folder: Path) -> bool:
    """Tell whether a folder holds files, and none that shows it is vcam's. Raise OSError."""
    try:
        present = set(os.listdir(folder))
    except FileNotFoundError:
        return False
    ours = any(read_record(folder / name) for name in (*RECORDS, LOCK))
    return bool(present - {LOCK, STAGING}) and not ours


def previous_files(record: Path) -> list[str]:
    """Return the names of the files that a record of vcam lists, none outside its folder."""
    found = read_record(record)
    return [name for name in found["files"] if _is_safe(name)] if found else []


def _flock(lock: int, folder: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise CannotDo(
            f"folder in use: another run is writing {folder}",
            "wait for it, or choose another folder",
        ) from None
    except OSError as error:
        if error.errno not in _NO_LOCKS_HERE:  # some cluster file systems have none
            raise


def read_record(path: Path) -> dict[str, Any] | None:
    """Return the JSON object in `path` when it is a record or journal of vcam, else None."""
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or not 0 < status.st_size <= _LARGEST_RECORD:
            return None
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(value, dict) or value.get("program") != PROGRAM:
        return None
    names = value.get("files")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None
    return value


def _is_safe(name: str) -> bool:
    """Tell whether a file can have the name, and stays inside its folder with it."""
    path = PurePosixPath(name)
    try:
        short = all(len(os.fsencode(part)) <= 255 for part in path.parts)
    except UnicodeError:
        return False
    inside = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return short and inside and "\0" not in name


def _has_real_parents(folder: Path, name: str) -> bool:
    """Tell whether every folder on the way to `name` is missing or a folder itself, no link."""
    for parent in PurePosixPath(name).parents[:-1]:
        path = folder / parent
        if os.path.lexists(path) and (path.is_symlink() or not path.is_dir()):
            return False
    return True
