"""The light on the sensor, computed once for cameras that differ only in what comes after it.

A sweep over seeds, noise, ADC or processing brings the same light to the same pixels again and
again, and that is most of a frame's cost. What the light depends on is told from the camera file:
all of it but the keys listed here, of which none is read before electrons are counted. A key that
is not listed counts as one that changes the light, so a new one can cost time but no truth.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.effects.base import Charge
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.image_formation.photon_rate import Rate
from vcam_cli.image_formation.settings import camera_settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.physics.cache import ByteCache

INDEPENDENT_KEYS: tuple[tuple[str, ...], ...] = tuple(
    tuple(path.split("."))
    for path in (
        *("name", "seed", "adc", "exposure", "processing", "quality", "output"),
        *("accuracy.shot_noise", "display.dpi", "display.width", "display.viewing_distance"),
        *("pixel.fpn", "pixel.defects"),
        *(f"pixel.readout.{k}" for k in ("gain", "read_noise", "column_noise", "row_noise")),
        *(f"pixel.readout.{k}" for k in ("heavy_tailed_noise", "correlated_row_noise")),
        *(f"pixel.readout.{k}" for k in ("telegraph_noise", "reset_noise", "charge_transfer")),
        "pixel.readout.timing",
        *(f"pixel.photodetector.{k}" for k in ("dark_current", "dark_current_density")),
        *("pixel.photodetector.dark_current_scale", "array.binning"),
    )
)
"""Keys on which the light does not depend. Exposure, ADC and analog gain set the level at which a
pixel is full, beyond which the light is not followed as exactly: see `RateCache.rate`."""
_RANDOM = {kind.name for kind in ORDER if issubclass(kind, NoiseSource | Charge)}
_LIMIT = 1 << 28
"""Bytes of light that are kept."""
_MOST = 64
"""Cameras whose brightest light is remembered."""


def light_key(camera: Camera) -> str:
    """Return all that the light on the sensor depends on, as a text.

    The level of saturation is not in it.

    Parameters
    ----------
    camera : Camera
        The camera.

    Returns
    -------
    str
        JSON of the camera file without the `INDEPENDENT_KEYS`.
    """
    form = camera.model_dump(mode="json")
    moving = ("exposure",) if camera.scene.moves else ()
    for path in INDEPENDENT_KEYS:
        if path != moving:
            _drop(form, path)
    form["tolerance"] = camera_settings(camera).tolerance  # not that of the file alone
    accuracy = form["accuracy"]  # a preset by itself is written as its name
    if isinstance(accuracy, dict) and set(accuracy) == {"preset"}:
        form["accuracy"] = accuracy["preset"]
    if isinstance(form.get("effects"), dict):
        own = {name: state for name, state in form["effects"].items() if name not in _RANDOM}
        form["effects"] = own or "auto"
    return json.dumps(form, sort_keys=True)


def changes_light(path: str) -> bool:
    """Return whether a key of a camera, by its dotted path, changes the light on the sensor."""
    keys = tuple(path.split("."))
    return not any(keys[: len(known)] == known for known in INDEPENDENT_KEYS)


def _drop(form: Any, path: tuple[str, ...]) -> None:
    *parents, last = path
    for name in parents:
        form = form.get(name) if isinstance(form, dict) else None
    if isinstance(form, dict):
        form.pop(last, None)


@dataclass(frozen=True)
class _CachedRate:
    rate: Rate

    @property
    def nbytes(self) -> int:
        return self.rate.values.nbytes


class RateCache:
    """The light of the last cameras."""

    def __init__(self, limit: int = _LIMIT) -> None:
        self.limit = limit
        """Bytes of light that are kept; the newest always."""
        self._rates: ByteCache[_CachedRate] = ByteCache(limit)
        self._transfer: tuple[str, Transfer] | None = None
        self._peaks: dict[str, float] = {}
        self._last_key: tuple[Camera, str] | None = None

    def _key(self, camera: Camera) -> str:
        """Return what its light depends on, computed once for a camera that is asked again."""
        if self._last_key is None or self._last_key[0] is not camera:
            self._last_key = camera, light_key(camera)
        return self._last_key[1]

    def transfer(self, camera: Camera, make: Callable[[], Transfer]) -> Transfer:
        """Return a transfer, computed where the camera before had other light.

        Parameters
        ----------
        camera : Camera
            The camera.
        make : callable
            Function that computes it.

        Returns
        -------
        Transfer
            The transfer.
        """
        key, kept = self._key(camera), self._transfer
        if kept is None or kept[0] != key:
            kept = self._transfer = (key, make())
        return kept[1]

    def rate(self, camera: Camera, ceiling: float, make: Callable[[], Rate]) -> Rate:
        """Return the light of a camera, computed where no camera of the same light filled as fast.

        All ceilings are alike that the light does not reach.

        Parameters
        ----------
        camera : Camera
            The camera.
        ceiling : float
            Rate at which a pixel is full, see `auto_exposure.ceiling` [e/s].
        make : callable
            Function that computes it.

        Returns
        -------
        Rate
            The light.
        """
        key = self._key(camera)
        if key in self._peaks:
            level = min(ceiling, self._peaks[key])
            return self._rates.get((key, level), lambda: _CachedRate(make())).rate
        if len(self._peaks) >= _MOST:
            self._peaks.clear()
        rate = make()
        self._peaks[key] = rate.spectrum.peak
        return self._rates.get(
            (key, min(ceiling, rate.spectrum.peak)), lambda: _CachedRate(rate)
        ).rate
