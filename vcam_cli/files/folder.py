"""The output folder of a run: its files appear together, or nothing changes.

A run writes its files into a staging folder beside their final place. `finish` removes what the
previous run had named in its record (run.json), moves the new files in, and writes the record
last: a folder with a record is complete, and a run that fails leaves the former results. What is
removed or replaced must be as the record says (`records`); else the folder is refused.

Why a journal: between the removal of the old record and the writing of the new one, no record names
the files in the folder. Their names are in the lock file during that time, so that a run after a
power cut knows which files are vcam's. It also names the inode of the staging folder, whose files
are unfinished and have no fingerprint: one that came from elsewhere has another inode.

Why flock: the kernel drops it when its holder dies, however it dies.

Why an interrupt is deferred here: between two of these steps it is unknown what to undo. None
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
from vcam_cli.files.in_use import require_no_sweep
from vcam_cli.files.records import (
    LOCK,
    PROGRAM,
    RECORDS,
    Fingerprint,
    Proofs,
    file_fingerprint,
    has_real_parents,
    is_safe,
    read_record,
)
from vcam_cli.files.report import to_json
from vcam_cli.interrupts import defer_interrupts

_NO_LOCKS_HERE = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
_NOT_A_FOLDER = {errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL}


class OutputFolder:
    """Context of one run's output folder, created (with its parents) and locked on entry.

        with OutputFolder(path, inputs=[scene_file]) as folder:
            write_metrics(folder.new("metrics.csv"), rows)
            folder.finish({"seconds": 1.2})

    Without `finish`, or when anything raises, every new file, the lock and the folders
    created on entry are removed again, and the results of an earlier run are untouched.

    Raises on entry BadInput: `path` is a file, or a non-empty folder that is not vcam's, or a
    file that would be removed is not as vcam wrote it, or one of `inputs` would be replaced.
    CannotDo: another run has the folder, no permission, read-only, disk full.
    """

    def __init__(
        self, path: Path | str, record: str = "run.json", inputs: Iterable[Path | str] = ()
    ) -> None:
        self.path = Path(path)
        self._record = record
        self._inputs = tuple(os.path.realpath(name) for name in inputs)
        self._made: list[Path] = []
        self._lock: int | None = None
        self._staging: int | None = None
        self._previous = Proofs(self.path)
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
            self._leave()
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

    def written(self, *suffixes: str) -> dict[str, bytes]:
        """Return the bytes of the new files of some kinds, by name, in the order of `new`."""
        names = [name for name in self._new if name.endswith(suffixes)]
        return {name: (self.path / STAGING / name).read_bytes() for name in names}

    def finish(self, report: Mapping[str, Any]) -> None:
        """Replace the previous run's files by the new ones, then write the record.

        The record is `report` with `program`, `files` (names of the new files) and `written`
        (their sizes and hashes) added. The file of every call of `new` must have been written.
        Raise CannotDo, and BadInput when the place of a file was taken, or what it holds changed,
        meanwhile; then nothing is removed.
        """
        names = sorted(self._new)
        for name in names:
            self._check_new(name)
        self._previous.require(self._previous.names)
        try:  # all are there: else nothing is removed
            written = {name: file_fingerprint(self.path / STAGING / name) for name in names}
            text = to_json({**report, "program": PROGRAM, "files": names, "written": written})
            with defer_interrupts():
                self._replace_previous(written, text)
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def _replace_previous(self, written: Mapping[str, Fingerprint], text: str) -> None:
        """Move the new files in; see the module for the order."""
        names = list(written)
        write_text(self.path / STAGING / self._record, text)
        self._write_journal(written, self._previous.plain())
        (self.path / self._record).unlink(missing_ok=True)
        self._remove([name for name in self._previous.names if name not in written])
        for name in [*names, self._record]:
            self._move_in(name)
        flush_folder(self.path)
        self._finished = True

    def _begin(self) -> None:
        """Make, lock and check the folder."""
        str(self.path).encode("utf-8")  # the libraries that write pictures take no other names
        self._refuse_foreign(before_lock=True)
        self._make_and_lock()
        require_no_sweep(self.path)
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
        ours = self._own_record() or self._journal()["files"] or self._has_other_record()
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
        journal, record = self._journal(), self._own_record()
        self._clear_staging(journal.get("staging"))
        self._previous = Proofs(self.path, journal, record)
        self._protect_inputs([*filter(is_safe, self._previous.names), self._record])
        self._previous.require(self._previous.names)
        if not record:
            self._remove(self._previous.names)
            self._previous = Proofs(self.path)
        self._make_staging()

    def _make_staging(self) -> None:
        """Make the staging folder, and keep in the journal which one it is."""
        staging = self.path / STAGING
        staging.mkdir()
        self._staging = staging.lstat().st_ino
        self._write_journal({})

    def _protect_inputs(self, names: Iterable[str]) -> None:
        for name in names:
            if os.path.realpath(self.path / name) in self._inputs:
                raise bad(
                    "--out",
                    f"{self.path / name} is an input of this run and would be replaced",
                    "choose another folder",
                )

    def _check_new(self, name: str) -> None:
        if not is_safe(name) or name == self._record:
            raise ValueError(f"{name!r} is no name for a file of a run")
        self._protect_inputs([name])
        if not has_real_parents(self.path, name):
            raise bad(
                "--out",
                f"{self.path / name} lies behind a link or a file that vcam did not make",
                "move it away, or choose another folder",
            )
        self._previous.require([name])

    def _own_record(self) -> dict[str, Any] | None:
        """Return the record of the previous run, when it is vcam's."""
        return read_record(self.path / self._record)

    def _has_other_record(self) -> bool:
        """Tell whether another command of vcam has finished here."""
        return any(read_record(self.path / name) for name in RECORDS if name != self._record)

    def _journal(self) -> dict[str, Any]:
        """Return what the lock file holds, see the module. Raise BadInput where it is foreign."""
        place = self.path / LOCK
        found = read_record(place)
        if found is None and place.exists() and place.lstat().st_size:
            message = f"{place} is no lock of vcam"
            raise bad("--out", message, "remove it, or choose another folder")
        return found or {"program": PROGRAM, "files": []}

    def _write_journal(
        self, pending: Mapping[str, Any], written: Mapping[str, Any] | None = None
    ) -> None:
        """Write the names and fingerprints of files about to come, and of those before them."""
        assert self._lock is not None
        journal: dict[str, Any] = {
            "program": PROGRAM,
            "files": sorted({*pending, *(written or {})}),
        }
        if journal["files"]:
            journal |= {"pending": dict(pending), "written": dict(written or {})}
        text = json.dumps(journal | {"staging": self._staging}).encode()
        # Blanks in place of what was longer: the file is JSON after each step.
        os.pwrite(self._lock, text.ljust(os.fstat(self._lock).st_size), 0)
        os.ftruncate(self._lock, len(text))
        os.fsync(self._lock)

    def _remove(self, names: Iterable[str]) -> None:
        """Remove files that are proven vcam's, and the subfolders left empty."""
        for name in names:
            if not self._previous.holds(name):
                continue
            (self.path / name).unlink(missing_ok=True)
            for parent in PurePosixPath(name).parents[:-1]:
                with suppress(OSError):
                    (self.path / parent).rmdir()

    def _move_in(self, name: str) -> None:
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(self.path / STAGING / name, target)

    def _clear_staging(self, inode: object) -> None:
        """Remove the staging folder of an inode. Raise BadInput where it is another one."""
        staging = self.path / STAGING
        if not os.path.lexists(staging):
            return
        status = staging.lstat()
        if inode == status.st_ino and stat.S_ISDIR(status.st_mode):
            shutil.rmtree(staging)
            return
        try:
            staging.rmdir()
        except OSError:
            message = f"{staging} is there already and was not made by a run in this folder"
            remedy = "move it away, or choose another folder"
            raise bad("--out", message, remedy) from None

    def _leave(self) -> None:
        """Remove all that is not a finished result and free the lock; never raise."""
        if self._lock is not None:
            clean, entered = False, self._staging is not None
            with suppress(OSError, BadInput):  # else the journal stays for the next run
                if entered:
                    self._clear_staging(self._staging)
                if entered and not self._finished and not self._own_record():
                    self._previous = Proofs(self.path, self._journal())
                    self._remove(self._previous.names)
                clean = entered or not os.fstat(self._lock).st_size
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
