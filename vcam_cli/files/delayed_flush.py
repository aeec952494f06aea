"""Files that are flushed to disk together, soon after they are written.

A file that is renamed survives a killed process at once. A power cut may take what was written
within the last second: its readers have to know a file that is not whole.
"""

from __future__ import annotations

from pathlib import Path
from threading import Lock, Timer

from vcam_cli.files import atomic

SECONDS = 1.0
"""Longest delay before a written file is on the disk [s]."""


class DelayedFlush:
    """Flushes the files of one folder, at most once in `SECONDS`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting: list[Path] = []
        self._timer: Timer | None = None
        self._failed: OSError | None = None
        self._lock, self._flushing = Lock(), Lock()

    def add(self, path: Path) -> None:
        """Have a file flushed that has just been renamed. Raise CannotDo where one before failed.

        Parameters
        ----------
        path : Path
            The file.
        """
        self._raise_failed()
        with self._lock:
            self._waiting.append(path)
            if self._timer is not None:
                return
            self._timer = timer = Timer(SECONDS, self._flush)
            timer.daemon = True
        try:
            timer.start()
        except RuntimeError:  # the system starts no more threads
            self._flush()

    def flush(self) -> None:
        """Flush all that waits now, and wait for it. Raise CannotDo where that fails."""
        with self._lock:
            timer = self._timer
        if timer is not None:
            timer.cancel()
        self._flush()
        self._raise_failed()

    def _flush(self) -> None:
        with self._flushing:
            with self._lock:
                waiting, self._waiting, self._timer = self._waiting, [], None
            for path in waiting:
                try:
                    atomic.flush(path)
                except FileNotFoundError:  # removed since, as the frames of a packed shard are
                    pass
                except OSError as error:
                    self._failed = error
            if waiting:
                atomic.flush_folder(self._folder)

    def _raise_failed(self) -> None:
        failed, self._failed = self._failed, None
        if failed is not None:
            raise atomic.cannot_write(self._folder, failed) from failed
