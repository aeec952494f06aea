"""Row noise correlated between neighboring rows: horizontal bands.

    x_k = r x_(k-1) + sqrt(1 - r^2) z_k

is the noise of row k over its rms, r the correlation of neighbors, z normal numbers.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class CorrelatedRowNoise(NoiseSource):
    """Noise of rows as a first-order autoregression from the first row to the last.

    Row k has x_k = r x_(k-1) + sqrt(1 - r^2) z_k of normal numbers z, so that rows n apart have the
    correlation r^n and the power spectrum over f [cycles/row] is rms^2 (1 - r^2) / (1 - 2 r cos(2
    pi f) + r^2). It adds to `row_noise`, which is independent from row to row.
    """

    rms: float
    """Standard deviation [electrons]."""
    correlation: float
    """Correlation r of neighboring rows."""

    name = "correlated_row_noise"
    reference = "EMVA 1288 release 4.0, section 8 (row noise); Box and Jenkins 1976, section 3.2.3"
    keys_behind_light = ("pixel.readout.correlated_row_noise",)
    absent = "pixel.readout.correlated_row_noise has the value none or 0"
    seconds_per_pixel = 1.7e-9
    origin = "readout"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise that the file gives, or None where it gives none."""
        given = camera.pixel.readout.correlated_row_noise
        return cls(given.rms, given.correlation) if given is not None and given.rms else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.rms:.4g} e rms per row, correlation {self.correlation:g} between rows"

    def split(self) -> tuple[Self | None, Self | None, Self | None]:
        """Return nothing of pixels by themselves nor of columns: all of it is the rows'."""
        return replace(self, rms=0.0), None, self

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the noise of its rows in it; it reuses the array [electrons]."""
        if self.rms:
            rows = site.of_all_rows(self.name, self._autoregression)
            electrons += (self.rms * rows).astype(electrons.dtype)
        return electrons

    def _autoregression(self, z: Array) -> Array:
        """Return the sequence of all rows of unit variance, of independent normal numbers.

        A loop over numbers of Python takes 0.1 ms for a thousand rows; the module of `lfilter`, the
        same to the last bit, takes 0.5 s and 30 MB to import.
        """
        correlation, fresh = self.correlation, np.sqrt(1 - self.correlation**2)
        numbers = accumulate(
            (fresh * z[1:]).tolist(), lambda x, new: new + correlation * x, initial=float(z[0])
        )
        return np.fromiter(numbers, float, len(z))

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        return self.rms**2

    def binned_variance(self, mean: float, dark: float, binning: Binning | None) -> float:
        """Return the variance of the mean of pixels read as one, whose rows are neighbors.

        In mosaics, where they lie farther apart, it is an upper bound [electrons squared].
        """
        if binning is None or binning.kind != "digital":
            return self.variance(mean, dark)
        apart = np.arange(1, binning.rows)
        pairs = float(((binning.rows - apart) * self.correlation**apart).sum())
        return self.rms**2 * (binning.rows + 2 * pairs) / binning.rows**2
