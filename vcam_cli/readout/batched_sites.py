"""Where noise is drawn for many frames of a sensor at once, on one device.

What is new in every frame comes from the device's generator (`counter_noise.py`). What stays with
the sensor is drawn by the processor, once, from the same streams as everywhere else, and copied:
so a sensor is the same on every device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import partial
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices import counter_noise
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.signal_chain import Site
from vcam_cli.readout.exposure import LAYER
from vcam_cli.records import dataclass
from vcam_cli.rng import BLOCK_ROWS, blocks, stream


@dataclass(frozen=True)
class SensorMaps:
    """What stays with a sensor, on a device: drawn and copied when it is first needed."""

    device: Processor
    seed: int
    """The sensor seed."""
    rows: int
    columns: int
    dtype: type
    coarse_normals: bool = False
    layer: int = 0
    """Index of the layer of stacked pixels."""
    maps: dict[str, Array] = field(default_factory=dict)

    def get(self, name: str, make: Callable[[Site], Array]) -> Array:
        """Return a map (..., rows, columns) of the array.

        Parameters
        ----------
        name : str
            Name of the map.
        make : callable
            What a block of rows has of it, from its site.
        """
        if name not in self.maps:
            parts = [make(self._site(block)) for block in blocks(self.rows)]
            self.maps[name] = self.device.put(np.concatenate(parts, axis=-2))
        return self.maps[name]

    def line(self, name: str, make: Callable[[Site], Array]) -> Array:
        """Return what every column has, or every row, from the site of the whole array."""
        if name not in self.maps:
            self.maps[name] = self.device.put(make(self._site(slice(0, self.rows))))
        return self.maps[name]

    def _site(self, block: slice) -> Site:
        """Return the processor's site of a block, as `exposure.sites` has it."""
        opened: dict[str, np.random.Generator] = {}
        first = self.layer << LAYER

        def of_block(name: str) -> np.random.Generator:
            if name not in opened:
                opened[name] = stream(self.seed, name, block=first + block.start // BLOCK_ROWS)
            return opened[name]

        return Site(
            rows=block.stop - block.start,
            columns=self.columns,
            stream=of_block,
            line_stream=partial(stream, self.seed, block=first),
            dtype=self.dtype,
            first_row=block.start,
            array_rows=self.rows,
            coarse_normals=self.coarse_normals,
        )


@dataclass(frozen=True)
class SensorSite(Site):
    """A site of what stays with the sensor; its maps are the same for all frames."""

    maps: SensorMaps = None  # type: ignore[assignment]

    def normal(self, name: str) -> Array:
        """Return one standard normal number a pixel (rows, columns)."""
        return self.maps.get(name, lambda site: site.normal(name)).copy()

    def add_normal(self, name: str, electrons: Array, rms: float) -> Array:
        """Return frames plus one normal number a pixel, the same in all."""
        electrons += self.maps.get(name, lambda site: site.normal(name)) * self.dtype(rms)
        return electrons

    def uniform(self, name: str) -> Array:
        """Return one number between 0 and 1 a pixel (rows, columns)."""
        return self.maps.get(name, lambda site: site.uniform(name))

    def sensor_uniform(self, name: str) -> Array:
        """Return the same."""
        return self.uniform(name)

    def exponential(self, name: str) -> Array:
        """Return one standard exponential number a pixel (rows, columns)."""
        return self.maps.get(name, lambda site: site.exponential(name))

    def sensor_map(self, name: str, make: Callable[[Site], Array]) -> Array:
        """Return a map (rows, columns) that stays with the sensor."""
        return self.maps.get(name, make)

    def normal_columns(self, name: str) -> Array:
        """Return one standard normal number a column (columns,)."""
        return self.maps.line(name, lambda site: site.normal_columns(name))

    def uniform_columns(self, name: str) -> Array:
        """Return one number between 0 and 1 a column (columns,)."""
        return self.maps.line(name, lambda site: site.uniform_columns(name))

    def uniform_rows(self, name: str) -> Array:
        """Return one number between 0 and 1 a row (rows, 1)."""
        return self.maps.line(name, lambda site: site.uniform_rows(name))

    @property
    def has_dark(self) -> bool:
        """Whether there is any dark signal."""
        return not isinstance(self.dark, float) or self.dark > 0


@dataclass(frozen=True)
class FrameSite(SensorSite):
    """A site of what is new in every frame of a batch; arrays are (B, rows, columns)."""

    keys: Array = None  # type: ignore[assignment]
    """Keys (B,) of the frames' seeds, on the device."""
    seeds: tuple[int, ...] = ()
    """The seeds of the frames."""
    sample: int = 0
    """Index of the sample of an exposure."""

    @property
    def _shape(self) -> tuple[int, int, int]:
        return len(self.seeds), self.rows, self.columns

    def normal(self, name: str) -> Array:
        """Return one standard normal number a pixel (B, rows, columns)."""
        return self._normals(name, self.rows * self.columns).reshape(self._shape)

    def _normals(self, name: str, count: int) -> Array:
        return self.maps.device.normals(self.keys, name, self.sample, count, self.dtype)

    def add_normal(self, name: str, electrons: Array, rms: float) -> Array:
        """Return frames (B, rows, columns) plus one normal number a pixel."""
        device = self.maps.device
        return device.add_normals(electrons, float(rms), self.keys, name, self.sample)

    def poisson(self, name: str, mean: Array) -> Array:
        """Return Poisson numbers of means (B, rows, columns) [electrons]."""
        return self.maps.device.poisson(self.keys, name, self.sample, mean)

    def uniform(self, name: str) -> Array:
        """Return one number between 0 and 1 a pixel (B, rows, columns)."""
        count = self.rows * self.columns
        found = self.maps.device.uniforms(self.keys, name, self.sample, count)
        return found.reshape(self._shape)

    def sensor_uniform(self, name: str) -> Array:
        """Return one number a pixel (rows, columns) that stays with the sensor."""
        return self.maps.get(name, lambda site: site.uniform(name))

    def exponential(self, name: str) -> Array:
        """Return one standard exponential number a pixel (B, rows, columns)."""
        return -np.log(self.uniform(name))

    def normal_columns(self, name: str) -> Array:
        """Return one standard normal number a column (B, 1, columns)."""
        return self._normals(name, self.columns)[:, None, :]

    def normal_rows(self, name: str) -> Array:
        """Return one standard normal number a row (B, rows, 1)."""
        return self._normals(name, self.rows)[:, :, None]

    def uniform_columns(self, name: str) -> Array:
        """Return one number between 0 and 1 a column (B, 1, columns)."""
        found = self.maps.device.uniforms(self.keys, name, self.sample, self.columns)
        return found[:, None, :]

    def uniform_rows(self, name: str) -> Array:
        """Return one number between 0 and 1 a row (B, rows, 1)."""
        return self.maps.device.uniforms(self.keys, name, self.sample, self.rows)[:, :, None]

    def of_all_rows(self, name: str, shape: Callable[[Array], Array]) -> Array:
        """Return a sequence over all rows of each frame (B, rows, 1).

        The processor makes it, of the same words: it is a number a row.
        """
        keys = np.array([counter_noise.seed_key(seed) for seed in self.seeds], np.uint64)
        word = counter_noise.words(keys, name, self.sample, self.rows)
        z = counter_noise.normals(word).astype(np.float64)
        found = np.array([shape(row) for row in z])
        return self.maps.device.put(found)[:, :, None]


def sites(maps: SensorMaps, seeds: Sequence[int], dark: Any, sample: int = 0) -> dict[str, Site]:
    """Return the sites of a batch, by scope.

    Parameters
    ----------
    maps : SensorMaps
        What stays with the sensor.
    seeds : sequence of int
        Frame seeds (B,).
    dark : float or Array
        Mean dark signal, of all frames or of each (B, 1, 1) [electrons].
    sample : int, optional
        Index of the sample of an exposure.
    """

    def refused(name: str) -> np.random.Generator:
        raise TypeError(f"{name}: a batch has no generator of its own")

    common: dict[str, Any] = {
        "rows": maps.rows,
        "columns": maps.columns,
        "stream": refused,
        "line_stream": refused,
        "dtype": maps.dtype,
        "dark": dark,
        "maps": maps,
    }
    frame = FrameSite(**common, keys=maps.device.keys(seeds), seeds=tuple(seeds), sample=sample)
    return {"sensor": SensorSite(**common), "frame": frame}
