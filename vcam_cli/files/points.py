"""The finished points of a sweep: a small file each, in the folder `points` of its output.

A file is written whole, under the hash of all that the point depends on, with a check of its own:
what is there and checks is finished, whoever wrote it. So a sweep may be killed at any moment, and
several processes may work in one folder. They share the work through locks on single bytes of a
file, one for each point, which the kernel drops when their holder dies; without such locks some
points are computed twice, and nothing else happens.
"""

import fcntl
import hashlib
import json
import os
import re
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vcam_cli.errors import CannotDo, bad
from vcam_cli.files import atomic, map_store
from vcam_cli.files.folder import PROGRAM, is_foreign, previous_files
from vcam_cli.files.report import hash_file, hash_text, to_json

POINTS = "points"
RECORD = "study.json"
_CLAIMS = ".claims"
_OURS = re.compile(
    r"[0-9a-f]{32}\.(json|raw\.exr|render\.png|maps\.npz|figure\.png)|\.claims|\..*\.part"
)
"""Names in the folder of points."""
_PLOT = "figure.png"
_LARGEST = 1 << 20  # bytes of a point's file
_ABANDONED = 3600.0
"""Seconds after which nobody writes a temporary file any more."""


class SweepFolder:
    """The output folder of a sweep; several processes may have it at once.

        with SweepFolder(path, inputs) as folder:
            folder.begin({"name": "pixel-size"})
            folder.write("3fe0...", {"metrics": {"snr_db": 30.1}})
            folder.finish({"points.csv": "..."}, {"name": "pixel-size"})

    Raises on entry BadInput for a folder that is not vcam's, CannotDo where it cannot be made.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.corrupted: list[str] = []
        """Names of point files that were not as they had been written."""
        self._used: set[str] = set()
        self._claims = -1

    def __enter__(self) -> Self:
        try:
            if is_foreign(self.path) and not self._begun():
                message = f"{self.path} is not empty and holds no {RECORD} of vcam"
                raise bad("--out", message, "choose a new or empty folder")
            (self.path / POINTS).mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            self._claims = os.open(self.path / POINTS / _CLAIMS, flags, 0o666)
        except (FileExistsError, NotADirectoryError) as error:
            message = f"{error.filename or self.path} is not a folder"
            raise bad("--out", message, "choose another one") from error
        except ValueError as error:
            raise bad("--out", f"{self.path} is no folder name", "choose another one") from error
        except OSError as error:
            raise atomic.cannot_write(self.path, error) from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._claims)

    def _begun(self) -> bool:
        """Whether there is nothing but points: of a sweep that has not come to its record yet, or
        brought here from other machines."""
        points = self.path / POINTS
        names = set(os.listdir(self.path)) - {POINTS}
        if RECORD in names:  # another process has written it since it was looked for
            return not is_foreign(self.path)
        if not points.is_dir() or any(not _OURS.fullmatch(name) for name in names):
            return False
        return all(_OURS.fullmatch(name) for name in os.listdir(points))

    def begin(self, record: Mapping[str, Any]) -> None:
        """Says whose folder this is, where nothing says so yet."""
        if not (self.path / RECORD).exists():
            self._write_record(record, [])

    def read(self, point: str, frames: tuple[str, ...] = ()) -> dict[str, Any] | None:
        """What was written of a finished point; None where it is to be computed.

        frames: names of files that must be there beside it, of the size in which they were kept.
        """
        path = self.path / POINTS / f"{point}.json"
        try:
            with open(path, "rb") as file:
                data = file.read(_LARGEST + 1)
        except FileNotFoundError:
            return None
        except OSError as error:
            message = f"cannot read {path}: {error.strerror}"
            raise CannotDo(message, "check its permissions, or choose another folder") from error
        whole = _checked(point, data)
        if whole is None:
            self.corrupted += [path.name] if path.name not in self.corrupted else []
            return None
        found: dict[str, Any] = whole["point"]
        # What has a digest is compared with it by whoever reads it, who tells where it differs.
        sizes = {} if "digest" in found else whole.get("sizes", {})
        self._used.add(point)
        return found if all(self._is_kept(point, name, sizes) for name in frames) else None

    def _is_kept(self, point: str, name: str, sizes: Mapping[str, int]) -> bool:
        path = self.path / POINTS / f"{point}.{name}"
        return path.is_file() and path.stat().st_size == sizes.get(name, path.stat().st_size)

    def is_whole(self, key: str, frames: tuple[str, ...] = ()) -> bool:
        """Whether what was kept under a key is there as it was written, a map or plot included."""
        content = self.read(key, frames)
        if content is None or "digest" not in content:
            return content is not None
        beside = (self.path / POINTS / f"{key}.{name}" for name in (map_store.NAME, _PLOT))
        return content["digest"] in (hash_file(path) for path in beside if path.is_file())

    def write(
        self, point: str, content: Mapping[str, Any], frames: Mapping[str, bytes] | None = None
    ) -> None:
        """Keeps a finished point, the frames beside it first. Raises CannotDo (disk full)."""
        for name, data in (frames or {}).items():
            with atomic.write_whole(self.path / POINTS / f"{point}.{name}") as temporary:
                temporary.write_bytes(data)
        plain = json.loads(to_json(content))
        sizes = {name: len(data) for name, data in (frames or {}).items()}
        check = _check(point, plain)
        whole = {"program": PROGRAM, "id": point, "point": plain, "check": check, "sizes": sizes}
        atomic.write_text(self.path / POINTS / f"{point}.json", to_json(whole))
        self._used.add(point)

    def frame(self, point: str, name: str) -> bytes:
        """A frame that was kept beside a finished point. Raises CannotDo."""
        path = self.path / POINTS / f"{point}.{name}"
        try:
            return path.read_bytes()
        except OSError as error:
            message = f"cannot read {path}: {error.strerror}"
            raise CannotDo(message, "check its permissions, or choose another folder") from error

    def plot(self, key: str, draw: Callable[[Path], None], path: Path) -> None:
        """Writes a PNG that `draw` draws, or that was kept under a key: drawing takes its time.

        Raises CannotDo.
        """
        content = self.read(key, (_PLOT,))
        data = b"" if content is None else self.frame(key, _PLOT)
        if content is None or content.get("digest") != hashlib.sha256(data).hexdigest():
            data = as_bytes(_PLOT, draw)
            self.write(key, {"digest": hashlib.sha256(data).hexdigest()}, {_PLOT: data})
        with atomic.write_whole(path) as temporary:
            temporary.write_bytes(data)

    def claim(self, point: str) -> bool:
        """Whether this process may compute the point; False while another one does."""
        try:
            fcntl.lockf(self._claims, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _byte(point))
        except (BlockingIOError, PermissionError):
            return False
        except OSError:  # a file system without locks
            return True
        return True

    def release(self, point: str) -> None:
        """Gives a claim back."""
        with suppress(OSError):
            fcntl.lockf(self._claims, fcntl.LOCK_UN, 1, _byte(point))

    def finish(
        self,
        writers: Mapping[str, Callable[[Path], None]],
        record: Mapping[str, Any],
        inputs: tuple[Path, ...] = (),
    ) -> None:
        """Writes tables and plots, each whole, then the record; removes those of former studies.

        writers: name -> what writes the file of a path. Raises BadInput where one of them would
        replace an input, CannotDo where it cannot be written.
        """
        former = previous_files(self.path / RECORD)
        taken = {os.path.realpath(path) for path in inputs}
        for name in (*writers, RECORD):
            if os.path.realpath(self.path / name) in taken:
                message = f"{self.path / name} is an input of this study and would be replaced"
                raise bad("--out", message, "choose another folder")
        for name, write in writers.items():
            write(self.path / name)
        for name in former:
            if name not in writers and "/" not in name:
                with suppress(OSError):
                    (self.path / name).unlink(missing_ok=True)
        self._write_record(record, sorted(writers))
        self._clear_abandoned()

    def _clear_abandoned(self) -> None:
        """Removes temporary files of processes that were killed."""
        for path in (self.path / POINTS).glob(".*.part"):
            with suppress(OSError):
                if time.time() - path.lstat().st_mtime > _ABANDONED:
                    path.unlink()

    def _write_record(self, record: Mapping[str, Any], names: list[str]) -> None:
        kept = sorted(self._used.difference(record.get("points", ())))
        written = {name: hash_file(self.path / name) for name in names}
        about = {"program": PROGRAM, "files": names, "written": written, "kept": kept}
        whole = {**record, **about}
        atomic.write_text(self.path / RECORD, to_json({**whole, "check": record_check(whole)}))


def record_check(record: Mapping[str, Any]) -> str:
    """The check of a record: of all that it says but for the check itself."""
    return hash_text(to_json({name: said for name, said in record.items() if name != "check"}))


def as_bytes(name: str, write: Callable[[Path], None]) -> bytes:
    """What `write` writes into the file of a path, which ends in `name`. Raises CannotDo."""
    try:
        with tempfile.TemporaryDirectory(prefix="vcam-") as folder:
            write(Path(folder) / name)
            return (Path(folder) / name).read_bytes()
    except OSError as error:
        raise atomic.cannot_write(tempfile.gettempdir(), error) from error


def _checked(point: str, data: bytes) -> dict[str, Any] | None:
    """What a point's file says; None where it is not what was once written."""
    try:
        whole = json.loads(data)
        content = whole["point"]
        right = whole["id"] == point and whole["check"] == _check(point, content)
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return whole if right and isinstance(content, dict) else None


def _check(point: str, content: Any) -> str:
    return hash_text(point + json.dumps(content, sort_keys=True))[:16]


def _byte(point: str) -> int:
    return int(point[:15], 16)
