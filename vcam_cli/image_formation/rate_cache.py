"""The light on the sensor, computed once for cameras that differ only in what comes after it.

A sweep over seeds, noise, ADC or processing brings the same light to the same pixels again and
again, and that is most of a frame's cost. Cameras of the same key (`solve.light_key`) share it.
"""

from __future__ import annotations

from collections.abc import Callable

from vcam_cli.cache import ByteCache
from vcam_cli.image_formation.photon_rate import Rate
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.records import dataclass

_LIMIT = 1 << 28
"""Bytes of light that are kept."""
_MOST = 64
"""Cameras whose brightest light is remembered."""


@dataclass(frozen=True)
class _CachedRate:
    rate: Rate

    @property
    def nbytes(self) -> int:
        return self.rate.values.nbytes


class RateCache:
    """The light of the last cameras."""

    def __init__(self, limit: int = _LIMIT, strict: bool = False) -> None:
        self.limit = limit
        """Bytes of light that are kept; the newest always, unless `strict`."""
        self._rates: ByteCache[_CachedRate] = ByteCache(limit, strict)
        self._transfer: tuple[str, Transfer] | None = None
        self._peaks: dict[str, float] = {}

    def transfer(self, key: str, make: Callable[[], Transfer]) -> Transfer:
        """Return a transfer, computed where the camera before had another one.

        Parameters
        ----------
        key : str
            All that it depends on: `Solved.lens_key`, and the number of the scene's components.
        make : callable
            Function that computes it.

        Returns
        -------
        Transfer
            The transfer.
        """
        kept = self._transfer
        if kept is None or kept[0] != key:
            kept = self._transfer = (key, make())
        return kept[1]

    def rate(self, key: str, ceiling: float, make: Callable[[], Rate]) -> Rate:
        """Return the light of a camera, computed where no camera of the same light filled as fast.

        All ceilings are alike that the light does not reach.

        Parameters
        ----------
        key : str
            All that the light depends on: `Solved.light_key`.
        ceiling : float
            Rate at which a pixel is full, see `auto_exposure.ceiling` [e/s].
        make : callable
            Function that computes it.

        Returns
        -------
        Rate
            The light.
        """
        peak = self._peaks.get(key)
        if peak is not None:
            return self._rates.get((key, min(ceiling, peak)), lambda: _kept(make())).rate
        if len(self._peaks) >= _MOST:
            self._peaks.clear()
        rate = make()
        self._peaks[key] = peak = rate.spectrum.peak
        return self._rates.get((key, min(ceiling, peak)), lambda: _kept(rate)).rate

    @property
    def nbytes(self) -> int:
        """Memory of the light that is kept [bytes]."""
        return self._rates.nbytes


def _kept(rate: Rate) -> _CachedRate:
    """Return light as it is kept: read-only."""
    rate.values.setflags(write=False)
    return _CachedRate(rate)
