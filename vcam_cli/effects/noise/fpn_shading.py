"""Low-frequency fixed pattern: offsets and gains that vary slowly over the array.

    offset(x, y) = sum_jk a_jk cos(pi j x / W) cos(pi k y / H),   likewise gain(x, y) - 1

a are drawn from the sensor seed and scaled to the rms, W and H are the sides of the array.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class PatternShading(NoiseSource):
    """Offsets [electrons] and gains [1] that are sums of few cosines over the array.

    The cosines are those of the discrete cosine transform up to `cycles` per width and height,
    without the even one; their strengths are drawn from the sensor seed. Offsets and gains are
    scaled to exactly their rms over the array, and uncorrelated, so that the variance stated is
    that of every sensor.
    """

    offset: float
    """Rms of the offsets over the array [electrons]."""
    gain: float
    """Rms of the gains over the array."""
    cycles: int
    """Highest spatial frequency [cycles per width, and per height]."""

    name = "fpn_shading"
    reference = "EMVA 1288 release 4.0, section 8 (low frequencies of the spectrogram); own model"
    keys_behind_light = ("pixel.fpn.shading",)
    absent = "pixel.fpn.shading has the value none or 0"
    seconds_per_pixel = 5.6e-9
    scope = "sensor"
    sample_draws = "common"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the pattern that the file gives, or None where it gives none."""
        given = camera.pixel.fpn.shading
        if given is None or not (given.offset or given.gain):
            return None
        return cls(given.offset, given.gain, given.cycles)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return (
            f"{self.offset:.4g} e, {100 * self.gain:.3g} % rms, up to {self.cycles} cycles over the"
            " array"
        )

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with gains and offsets in it; it reuses the array [electrons]."""
        offsets, gains = site.sensor_map(self.name, self._maps)
        if self.gain:
            electrons *= 1 + gains
        if self.offset:
            electrons += offsets
        return electrons

    def _maps(self, site: Site) -> Array:
        """Return offsets and gains of a block (2, rows, columns); 0 where there are none."""
        maps: Array = np.zeros((2, site.rows, site.columns), site.dtype)
        strengths = zip((self.offset, self.gain), self._strengths(site), maps, strict=True)
        for rms, waves, target in strengths:
            if rms:
                target += rms * _cosines(waves, site).astype(site.dtype)
        return maps

    def _strengths(self, site: Site) -> tuple[Array, Array]:
        """Return the strengths of the cosines, (along y, along x), for offsets and for gains."""
        half_cycles = 2 * self.cycles
        rows = np.arange(min(half_cycles + 1, site.all_rows))
        columns = np.arange(min(half_cycles + 1, site.columns))
        low = np.hypot(rows[:, None], columns) <= half_cycles
        low[0, 0] = False
        drawn = site.line_stream(self.name).standard_normal((2, *low.shape)) * low
        offsets, gains = drawn / max(np.linalg.norm(drawn[0]), np.finfo(float).tiny)
        if low.sum() > 1:
            gains = gains - (gains * offsets).sum() * offsets
        return offsets, gains / max(float(np.linalg.norm(gains)), np.finfo(float).tiny)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance over the array that it adds [electrons squared]."""
        return self.offset**2 + (self.gain * mean) ** 2

    def binned_variance(self, mean: float, dark: float, binning: Binning | None) -> float:
        """Return the same of pixels that are read as one: neighbors are alike."""
        return self.variance(mean, dark)


def _cosines(strengths: Array, site: Site) -> Array:
    """Return the sum of cosines at the pixels of a block, (rows, columns)."""
    rows = site.first_row + np.arange(site.rows)
    along_y = _basis(rows, site.all_rows, strengths.shape[0])
    along_x = _basis(np.arange(site.columns), site.columns, strengths.shape[1])
    return along_y @ strengths @ along_x.T


def _basis(places: Array, length: int, count: int) -> Array:
    """Return cosines of unit mean square over `length` pixels, (places, count)."""
    waves = np.cos(np.pi / length * np.outer(places + 0.5, np.arange(count)))
    waves[:, 1:] *= np.sqrt(2)
    return waves
