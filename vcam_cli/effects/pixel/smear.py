"""Light that falls on charge while a ccd moves it along the columns.

    s'(i) = (1 - a) s(i) + a mean of s over the column

The share a of all light on a column is caught by packets on their way and spread evenly over the
column: no charge is lost or made. Bright light, also beyond the full well, draws a line through the
whole picture.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.mosaic import NONE, Mosaic
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import ColumnSpread
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Smear(ColumnSpread):
    """Packets pass the light of their whole column, each place for as long as any other.

    So it is where frames follow each other: what is clocked in for the next frame passes the same
    light. A frame-transfer ccd that moves its frame in the time t after an exposure of T has a =
    t / (T + t); of an interline ccd it is the share of light that meets the vertical register.
    Photons are absorbed at random, so pixels stay Poisson and independent of each other.
    """

    share: float
    """Share of the light on a column."""

    name = "smear"
    reference = (
        "Theuwissen, Solid-State Imaging with Charge-Coupled Devices, 1995, section 5.3;"
        " splitting of Poisson numbers: Kingman, Poisson Processes, 1993, section 5.5"
    )
    keys_behind_light = ("pixel.readout.charge_transfer",)
    absent = "pixel.readout.charge_transfer.smear is 0"
    seconds_per_pixel = 3e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the smear of a ccd, or None where its transfer takes no time."""
        given = camera.pixel.readout.charge_transfer
        return None if given is None or not given.smear else cls(given.smear)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        tenth = _percent(self.share / 10)
        return (
            f"{_percent(self.share)} of the light is spread over its column; light on a tenth"
            f" of the rows smears {tenth} of its signal over all"
        )

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change by leaving it out, of no light beyond full signal."""
        return self.share * signal.full_signal

    def spread(self, light: Array) -> Array:
        """Return the light (..., rows, columns) as packets have it, in its unit and float type."""
        kind = light.dtype.type
        columns = light.mean(axis=-2, dtype=np.float64, keepdims=True)
        spread: Array = light * kind(1 - self.share)
        spread += (self.share * columns).astype(light.dtype)
        return spread

    def color_matrix(self, mosaic: Mosaic, planes: bool) -> Array:
        """Return the signal (C, C) of each color that even light of the colors leaves."""
        colors = mosaic.colors
        out = (1 - self.share) * np.eye(len(colors))
        if planes or len(colors) == 1:
            return out + self.share * np.eye(len(colors))
        block = np.array(mosaic.block)
        for number, color in enumerate(colors):
            # A color's sites, column by column of the block, as many as there are of it.
            sites = [column for column in block.T for name in column if name == color]
            for other, name in enumerate(colors):
                shares = [np.mean(column[column != NONE] == name) for column in sites]
                out[number, other] += self.share * float(np.mean(shares))
        return out


def _percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100 * share:.3g} %"
