"""The fixed pattern of one sensor, measured: maps of offset, gain and dark current.

    electrons = (light + dark d(x, y)) g(x, y) + o(x, y) - mean(o)

d and g are the maps of dark current and gain over their means, o is the map of offsets [electrons].
Dark current has shot noise of its own; gains act on the charge behind it.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass

OFFSET, GAIN, DARK = MAPS = tuple(f"pixel.fpn.{n}_map" for n in ("offset", "gain", "dark"))
"""Keys under which the camera carries the maps that its files hold."""


@dataclass(frozen=True)
class PatternMaps(NoiseSource):
    """Deviations of every pixel from the mean pixel, from files.

    Means stay as the camera file has them: offsets add to none, gains multiply by 1 and dark
    currents are the camera's in the mean. Of maps larger than the array the center is taken.
    """

    files: tuple[str | None, ...]
    """Names of the files of offset, gain and dark current."""
    shape: tuple[int, int]
    """Rows and columns of the array."""
    maps: tuple[Array | None, ...] = field(compare=False, repr=False)
    """Offsets less their mean [electrons], gains and dark currents over theirs less 1; None where
    the file gives none, or was not read yet."""

    name = "fpn_maps"
    reference = "EMVA 1288 release 4.0, section 8 (DSNU and PRNU images)"
    keys_behind_light = MAPS
    absent = "pixel.fpn has no offset_map, gain_map or dark_map"
    seconds_per_pixel = 6e-9
    scope = "sensor"
    sample_draws = "common"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the pattern of the files, or None where the camera file names none."""
        fpn = camera.pixel.fpn
        files = fpn.offset_map, fpn.gain_map, fpn.dark_map
        if not any(files):
            return None
        shape = geometry.rows, geometry.columns
        read = [camera.samples(key) for key in MAPS]
        found = [None if whole is None else _center(whole, shape) for whole in read]
        additive = (True, False, False)
        maps = [
            None if one is None else _deviations(one, adds)
            for one, adds in zip(found, additive, strict=True)
        ]
        return cls(files, shape, tuple(maps))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        units = (" e", " %", " %")
        said = [
            f"{name} {rms * (100 if unit == ' %' else 1):.3g}{unit} rms"
            for name, rms, unit in zip(
                ("offset", "gain", "dark current"), self._rms, units, strict=True
            )
            if rms
        ]
        return ", ".join(said) or "maps of every pixel"

    @cached_property
    def _rms(self) -> tuple[float, ...]:
        """Rms of the maps over the array."""
        return tuple(float(value) for value in np.sqrt(np.diag(self._covariance)))

    @cached_property
    def _covariance(self) -> Array:
        """Mean products of the maps over the array (3, 3)."""
        there = [m for m in self.maps if m is not None]
        out = np.zeros((3, 3))
        at = [number for number, m in enumerate(self.maps) if m is not None]
        for i, one in zip(at, there, strict=True):
            for j, other in zip(at, there, strict=True):
                out[i, j] = np.mean(one * other, dtype=float)
        return out

    def before_shot(self, mean: Array, site: Site) -> Array:
        """Return the mean signal with dark currents in it; it reuses the array [electrons]."""
        if self.maps[2] is not None and site.has_dark:
            mean += self._map(site, 2).astype(mean.dtype, copy=False) * site.dark
        return mean

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with gains and offsets in it; it reuses the array [electrons]."""
        if any(f is not None and m is None for f, m in zip(self.files, self.maps, strict=True)):
            raise RuntimeError(f"{', '.join(filter(None, self.files))}: not read")
        offset, gain, _ = self.maps
        if gain is not None:
            electrons *= 1 + self._map(site, 1)
        if offset is not None:
            electrons += self._map(site, 0)
        return electrons

    def _map(self, site: Site, number: int) -> Array:
        """Return the rows of a block of a map: of offsets, gains or dark currents."""
        whole = self.maps[number]
        assert whole is not None

        def rows(here: Site) -> Array:
            return whole[here.first_row : here.first_row + here.rows]

        return site.sensor_map(f"{self.name} {MAPS[number]}", rows)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance over the array that it adds [electrons squared].

        That of an even signal; products of gain and dark current deviations are left out.
        """
        weights = np.array([1.0, mean, dark])
        return float(weights @ self._covariance @ weights)


def _center(whole: Array, shape: tuple[int, int]) -> Array:
    """Return the middle of a map in the size of the array."""
    top, left = ((have - want) // 2 for have, want in zip(whole.shape, shape, strict=True))
    return whole[top : top + shape[0], left : left + shape[1]]


def _deviations(pixels: Array, additive: bool) -> Array:
    """Return what pixels deviate from their mean by, or from 1 where they are over it."""
    mean = pixels.mean(dtype=np.float64)
    found: Array = (pixels - mean if additive else pixels / mean - 1).astype(np.float32)
    return found
