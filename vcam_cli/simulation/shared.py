"""What simulations of many cameras in one process have in common: pictures read, light brought."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from threading import Lock
from typing import Any

from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.records import dataclass
from vcam_cli.simulation.output.provenance import data_files
from vcam_cli.simulation.scene_files import scene_bytes

Picture = tuple[Any, tuple[str, ...]]
"""What a scene's file holds, and notes about it."""
KEPT = 1 << 26
"""Bytes of light, and of pictures, that a process keeps by itself: 12 megapixels of light."""
_FILES = 1024
"""Files whose states are remembered."""
_State = tuple[int, int, int] | None
"""Time of the last change [ns], size and number of a file; None where it cannot be looked at."""


@dataclass(frozen=True)
class _KeptPicture:
    picture: Picture

    @property
    def nbytes(self) -> int:
        return scene_bytes(self.picture[0])


@dataclass
class Shared:
    """Kept from one camera to the next; results are the same bytes with and without it.

    Files are taken to stay as they are meanwhile.
    """

    rate_cache: RateCache = field(default_factory=RateCache)
    pictures: ByteCache[_KeptPicture] = field(default_factory=lambda: ByteCache(0))
    """By default the last one alone."""

    def picture(self, camera: Camera, read: Callable[[], Picture]) -> Picture:
        """Return the contents of a scene's files, read once for cameras with the same source.

        Parameters
        ----------
        camera : Camera
            Camera as its file describes it.
        read : callable
            Reads them.

        Returns
        -------
        Picture
            Contents and notes.
        """
        key = camera.scene.source.model_dump_json(exclude={"crop"})
        return self.pictures.get(key, lambda: _KeptPicture(read())).picture

    @property
    def nbytes(self) -> int:
        """Memory of light and pictures [bytes]."""
        return self.rate_cache.nbytes + self.pictures.nbytes


class Recent:
    """What the last simulations of this process have in common, as long as no file changes."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.clear()

    def clear(self) -> None:
        """Keep nothing of what was."""
        self._shared = Shared(RateCache(KEPT, strict=True), ByteCache(KEPT, strict=True))
        self._files: dict[Path, _State] = {}

    def shared_with(self, camera: Camera) -> Shared:
        """Return what a camera may share: nothing where a file has changed since it was read.

        Parameters
        ----------
        camera : Camera
            The camera.

        Returns
        -------
        Shared
            What the cameras before had in common.
        """
        found = {path: _state(path) for path in data_files(camera)}
        with self._lock:
            changed = any(self._files.get(path, state) != state for path, state in found.items())
            if changed or len(self._files) > _FILES:
                self.clear()
            self._files |= found
            return self._shared


RECENT = Recent()
"""That of `simulate` and `plan` where a caller hands in none of its own."""


def _state(path: Path) -> _State:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
