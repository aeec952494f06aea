"""What simulations of many cameras in one process have in common: pictures read, light brought."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.image_formation.rate_cache import RateCache

Picture = tuple[Any, tuple[str, ...]]
"""What a scene's file holds, and notes about it."""


@dataclass
class Shared:
    """Kept from one camera to the next; results are the same bytes with and without it.

    Files are taken to stay as they are meanwhile.
    """

    rate_cache: RateCache = field(default_factory=RateCache)
    _last: tuple[str, Picture] | None = None

    def picture(self, camera: Camera, read: Callable[[], Picture]) -> Picture:
        """Return what `read` gives, or gave for a camera before with the same file as its scene."""
        key = camera.scene.source.model_dump_json(exclude={"crop"})
        if self._last is None or self._last[0] != key:
            self._last = (key, read())
        return self._last[1]
