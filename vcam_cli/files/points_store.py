"""The finished points of a sweep: a small file each, in the folder `points` of its output.

The frames of a data set are such points, too.

A file is written whole, under the hash of all that the point depends on, with a check of its own
and the hashes of the files beside it: what is there and agrees is finished, whoever wrote it. So a
sweep may be killed at any moment, and several processes may work in one folder. They share the work
through locks on single bytes of a file, one for each point, which the kernel drops when their
holder dies; without such locks some points are computed twice, and nothing else happens. A point
that is kept survives whatever kills the process. It is on the disk within a second
(`delayed_flush`): one that a power cut leaves in part is known by its check, and computed again.
"""

import fcntl
import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from vcam_cli.errors import CannotDo, bad
from vcam_cli.files import atomic
from vcam_cli.files.delayed_flush import DelayedFlush
from vcam_cli.files.folder import is_foreign
from vcam_cli.files.in_use import CLAIMS, POINTS, STUDIES, STUDIES_END, require_no_run
from vcam_cli.files.records import (
    PROGRAM,
    Fingerprint,
    Proofs,
    fingerprint,
    read_record,
    record_check,
)
from vcam_cli.files.report import file_digest, to_json

RECORD = "study.json"
_KEPT = r"[0-9a-f]{32}\.(json|raw\.exr|render\.png|npz)"
_UNFINISHED = re.compile(rf"\.{_KEPT}\.\d+-[0-9a-f]{{8}}\.part")
_POINT_FILE = re.compile(rf"{_KEPT}|\.claims|\..*\.part")
"""The names in the folder of points."""
_STARTING, _FINISHING, _SUMMARY = (1 << 61) + 1, (1 << 61) + 2, (1 << 61) + 3
"""Bytes that a process holds while it looks for other studies, replaces tables, summarizes."""
_LARGEST = 1 << 26
"""The most bytes that a point's own file can have."""
_ABANDONED = 3600.0
"""Seconds after which a temporary file is abandoned."""


class SweepFolder:
    """The output folder of a sweep; several processes may have it at once.

        with SweepFolder(path) as folder:
            folder.begin({"name": "pixel-size"})
            folder.write("3fe0...", {"metrics": {"snr_db": 30.1}})
            folder.finish({"points.csv": write_points}, {"name": "pixel-size"})

    Raises on entry BadInput for a folder that is not vcam's, CannotDo where it cannot be made.
    """

    def __init__(self, path: Path | str, record: str = RECORD) -> None:
        self.path = Path(path)
        self._record = record
        self._flush = DelayedFlush(self.path / POINTS)
        self.corrupted: dict[str, None] = {}
        """Names of files of points that are not as they were written, in the order of reading."""

    def __enter__(self) -> Self:
        try:
            if is_foreign(self.path) and not self._holds_only_points():
                message = f"{self.path} is not empty and holds no {self._record} of vcam"
                raise bad("--out", message, "choose a new or empty folder")
            (self.path / POINTS).mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._claims = os.open(self.path / POINTS / CLAIMS, flags, 0o666)
        except (FileExistsError, NotADirectoryError) as error:
            message = f"{error.filename or self.path} is not a folder"
            raise bad("--out", message, "choose another one") from error
        except ValueError as error:
            raise bad("--out", f"{self.path} is no folder name", "choose another one") from error
        except OSError as error:
            raise atomic.cannot_write(self.path, error) from error
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._flush.flush()
        finally:
            os.close(self._claims)

    def _holds_only_points(self) -> bool:
        """Tell whether the folder is of a sweep without a record yet, or of other machines."""
        names = set(os.listdir(self.path))
        if self._record in names:  # another process has written it since it was looked for
            return not is_foreign(self.path)
        if not (self.path / POINTS).is_dir():
            return False
        names |= set(os.listdir(self.path / POINTS))
        return all(map(_POINT_FILE.fullmatch, names - {POINTS}))

    def begin(self, record: Mapping[str, Any], study: str = "0") -> dict[str, Any]:
        """Return the record of the folder; without one, write this one first.

        study: hexadecimal hash of what the tables will show. Raise CannotDo where another process
        is at work on something else here, BadInput where a file that would be replaced is not as
        vcam wrote it.
        """
        with self._locked(_STARTING):
            self._claim_study(STUDIES + _byte(study))
            require_no_run(self.path)
        with self._locked(_FINISHING):
            if not os.path.lexists(self.path / self._record):
                self._write_record(record, [])
            former = read_record(self.path / self._record)
            if former is None:
                message = f"{self.path / self._record} is no record of vcam"
                raise bad("--out", message, "move it away, or choose another folder")
            proofs = Proofs(self.path, former)
            proofs.require(proofs.names)
            return former

    def _claim_study(self, own: int) -> None:
        """Hold the byte of a study, together with others of it. Raise CannotDo, see `begin`."""
        for start, end in ((STUDIES, own), (own + 1, STUDIES_END)):
            if not self._try_lock(start, end - start):
                message = f"folder in use: another study is being written into {self.path}"
                raise CannotDo(message, "wait for it, or choose another folder")
            self._unlock(start, end - start)
        with suppress(OSError):
            fcntl.lockf(self._claims, fcntl.LOCK_SH, 1, own)

    def read(self, key: str, files: Sequence[str] = ()) -> dict[str, Any] | None:
        """Return what was written under a key; None where it is missing or corrupted.

        files: names of files that must have been written with it.
        """
        path = self.file(key, "json")
        try:
            with open(path, "rb") as file:
                entry = json.loads(file.read(_LARGEST))
            if entry["id"] != key or entry["check"] != record_check(entry):
                raise ValueError(key)
            if not entry["hashes"].keys() >= set(files):
                return None
            for name, digest in entry["hashes"].items():
                path = self.file(key, name)
                if file_digest(path) != digest:
                    raise ValueError(name)
        except (FileNotFoundError, IsADirectoryError):
            return None
        except OSError as error:
            message = f"cannot read {path}: {error.strerror}"
            raise CannotDo(message, "check its permissions, or choose another folder") from error
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            self.corrupted[path.name] = None
            return None
        point: dict[str, Any] = entry["point"]
        return point

    def write(
        self, key: str, content: Mapping[str, Any], files: Mapping[str, bytes] | None = None
    ) -> None:
        """Keep a finished point and files beside it.

        Raise BadInput where a folder is in the place of one of them, CannotDo.
        """
        for name in ("json", *(files or {})):
            path = self.file(key, name)
            if path.is_dir() and not path.is_symlink():
                raise bad((), f"{POINTS}/{path.name} is a folder", "move it away")
        hashes = {}
        for name, data in (files or {}).items():
            hashes[name] = hashlib.sha256(data).hexdigest()
            self._write_unflushed(self.file(key, name), data)
        entry = {"program": PROGRAM, "id": key, "point": content, "hashes": hashes}
        entry = json.loads(to_json(entry))  # numbers as they are read back
        text = to_json(entry | {"check": record_check(entry)})
        self._write_unflushed(self.file(key, "json"), text.encode("utf-8", "backslashreplace"))

    def _write_unflushed(self, path: Path, data: bytes) -> None:
        atomic.write_bytes(path, data, is_flushed=False)
        self._flush.add(path)

    def file(self, key: str, name: str) -> Path:
        """Return the file of a name that is kept beside a point."""
        return self.path / POINTS / f"{key}.{name}"

    def discard(self, key: str, names: Sequence[str]) -> None:
        """Remove files of a point."""
        for name in names:
            with suppress(OSError):
                self.file(key, name).unlink(missing_ok=True)

    @contextmanager
    def summarizing(self) -> Iterator[None]:
        """Wait until no other process makes tables or shards of these points, and do it alone.

        What is read, made and written within misses no point: of processes that finish at once,
        each one reads what those before it have kept.
        """
        with self._locked(_SUMMARY):
            yield

    def claim(self, point: str) -> bool:
        """Claim a point for this process; False where another process has it."""
        return self._try_lock(_byte(point), 1)

    def release(self, point: str) -> None:
        """Give a claim back."""
        self._unlock(_byte(point), 1)

    def _try_lock(self, start: int, count: int) -> bool:
        """Lock bytes for this process; False where another one has any of them."""
        if not count:
            return True
        try:
            fcntl.lockf(self._claims, fcntl.LOCK_EX | fcntl.LOCK_NB, count, start)
        except OSError as error:  # a file system without locks claims nothing
            return not isinstance(error, BlockingIOError | PermissionError)
        return True

    def _unlock(self, start: int, count: int) -> None:
        with suppress(OSError):
            if count:  # 0 would be all bytes to the end
                fcntl.lockf(self._claims, fcntl.LOCK_UN, count, start)

    @contextmanager
    def _locked(self, byte: int) -> Iterator[None]:
        """Wait until no other process holds a byte, and hold it; without locks do not wait."""
        with suppress(OSError):
            fcntl.lockf(self._claims, fcntl.LOCK_EX, 1, byte)
        try:
            yield
        finally:
            self._unlock(byte, 1)

    def finish(
        self,
        writers: Mapping[str, Callable[[Path], None]],
        record: Mapping[str, Any],
        inputs: Sequence[Path] = (),
        report: Callable[[Mapping[str, bytes]], Mapping[str, bytes]] | None = None,
        there: Mapping[str, Fingerprint] | None = None,
    ) -> None:
        """Write tables and plots, each whole, then the record; remove those of former studies.

        writers: name of a file -> function that writes it; report: from the bytes of all of these
        to those of further files; there: further files that have been written already. Raise
        BadInput where one of them would replace an input, or a file that is not as vcam wrote it,
        CannotDo where one cannot be written.
        """
        protected = {os.path.realpath(path) for path in inputs}
        for path in (self.path / name for name in (*writers, self._record)):
            if os.path.realpath(path) in protected:
                message = f"{path} is an input of this study and would be replaced"
                raise bad("--out", message, "choose another folder")
        contents = {name: atomic.written_bytes(name, write) for name, write in writers.items()}
        contents |= report(contents) if report else {}
        self._flush.flush()
        written = {name: fingerprint(data) for name, data in contents.items()}
        with self._locked(_FINISHING):
            self._replace(contents, {**written, **(there or {})})
            written |= there or {}
            self._write_record(record, sorted(written), written=written)
        self._remove_abandoned()

    def _replace(self, contents: Mapping[str, bytes], written: Mapping[str, Fingerprint]) -> None:
        """Put new files in the place of the former ones.

        Meanwhile the record knows both, so that a sweep after a power cut knows which files are
        vcam's. A file that is as the new one, perhaps of another process, is as good.
        """
        former = read_record(self.path / self._record) or {"files": []}
        proofs = Proofs(self.path, former, {"files": [], "written": written})
        proofs.require(proofs.names)
        there = [name for name in former["files"] if name in written]
        unfinished = former | {"asked": ""}
        self._write_record(unfinished, there, written=former.get("written"), pending=written)
        for name, data in contents.items():
            atomic.write_bytes(self.path / name, data)
        for name in proofs.names:
            if name not in written and proofs.holds(name):
                (self.path / name).unlink(missing_ok=True)

    def _remove_abandoned(self) -> None:
        """Remove temporary files of processes that were killed."""
        for path in (self.path / POINTS).glob(".*.part"):
            with suppress(OSError):
                is_ours = _UNFINISHED.fullmatch(path.name) and not path.is_symlink()
                if is_ours and time.time() - path.lstat().st_mtime > _ABANDONED:
                    path.unlink()

    def _write_record(self, record: Mapping[str, Any], names: list[str], **more: Any) -> None:
        whole = {**record, "program": PROGRAM, "files": names, **more}
        if "pending" not in more:
            whole.pop("pending", None)
        atomic.write_text(
            self.path / self._record, to_json({**whole, "check": record_check(whole)})
        )


def _byte(point: str) -> int:
    return int(point[:15], 16)
