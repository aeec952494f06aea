"""Fixed-pattern noise: offsets and gains of pixels and columns, and defects.

    electrons = signal (1 + g_pixel z_1 + g_column z_2) + o_pixel z_3 + o_column z_4

z are normal numbers of pixels (1, 3) and columns (2, 4), the same in every frame.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.errors import bad
from vcam_cli.records import dataclass

OVERFULL = 100
"""Full wells of charge in a hot pixel: more than the noise of any readout brings below one."""
DRAW, DEFECTS = 7.5e-9, 4.2e-9
"""Time of one pixel for each part that is drawn, and for defects [core seconds]."""


@dataclass(frozen=True)
class FixedPattern(NoiseSource):
    """Offsets [electrons] and gains [1], per pixel and per column, drawn from the sensor seed.

    Dark currents vary as well: that of a pixel is the mean times 1 + `dark` z, at least zero, with
    its own shot noise. Defects: a hot pixel reads the full well in any light, without readout
    noise, or has an exponentially distributed factor on its dark current, whose noise is drawn but
    not included in the stated temporal variance. A dead pixel, and those of a dead column or row,
    collects no charge and reads offset and readout noise. The selection of pixels does not depend
    on the float type; a larger fraction includes the pixels of a smaller one. Charge transfer of a
    CCD does not move defects and dark currents.
    """

    offset_pixel: float
    offset_column: float
    gain_pixel: float
    gain_column: float
    dark: float = 0.0
    """Relative spread of the pixels' dark currents."""
    hot: float = 0.0
    dead: float = 0.0
    """Fractions of the pixels."""
    full_well: float = math.inf
    """Of a pixel [electrons]."""
    hot_current: float = 0.0
    """Mean dark current of hot pixels over that of the others; 0: they read the full well."""
    bad_columns: float = 0.0
    bad_rows: float = 0.0
    """Fractions of the columns and rows whose pixels collect nothing."""
    no_columns: str = ""
    """The architecture, where it has no column terms though the file gives them."""

    name = "fpn"
    reference = "Chen 2003, eq 2.26 (Q_f); El Gamal et al., Proc. SPIE 3301, 1998"
    keys_behind_light = ("pixel.fpn", "pixel.defects")
    absent = "pixel.fpn and pixel.defects have nothing that the architecture has"
    seconds_per_pixel = 3 * DRAW + DEFECTS
    scope = "sensor"
    sample_draws = "common"
    parts = ("offset_pixel", "gain_pixel", "dark")

    @property
    def pixel_seconds(self) -> float:
        """Time of one pixel with what this camera's numbers call for [core seconds]."""
        drawn = sum(part > 0 for part in (self.offset_pixel, self.gain_pixel, self.dark))
        return DRAW * drawn + DEFECTS * (self.hot > 0 or self.dead > 0)

    def __post_init__(self) -> None:
        # Where all pixels are defective they do not differ: the plan would see no noise in it.
        object.__setattr__(self, "removable", not (self.hot or self._dead_fraction))

    @property
    def _dead_fraction(self) -> float:
        """Fraction of the pixels that collect nothing."""
        return 1 - (1 - self.dead) * (1 - self.bad_columns) * (1 - self.bad_rows)

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the fixed pattern that the pixel's architecture has, or None where it has none."""
        fpn, defects, name = camera.pixel.fpn, camera.pixel.defects, camera.pixel.architecture
        columns = fpn.offset_column, fpn.gain_column
        missing = any(columns) and not ARCHITECTURES[name].column_terms
        offset, gain = (0.0, 0.0) if missing else columns
        strengths = (fpn.offset_pixel, offset, fpn.gain_pixel, gain, fpn.dark)
        lines = defects.columns, defects.rows
        if not any((*strengths, defects.hot, defects.dead, *lines)):
            return None
        leak = (defects.hot_current or 0.0) if defects.hot else 0.0
        if leak and not dark_rate(camera):
            raise bad(
                "pixel.defects.hot_current",
                "there is no dark current that it could multiply",
                "give pixel.photodetector.dark_current, or remove it",
            )
        well = circuit(camera).full_well
        said = name if missing else ""
        return cls(*strengths, defects.hot, defects.dead, well, leak, *lines, said)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        said = f"per pixel {self.offset_pixel:.4g} e, {100 * self.gain_pixel:.3g} % rms"
        if self.no_columns:
            said += f" (no column pattern in a {self.no_columns})"
        else:
            said += f"; per column {self.offset_column:.4g} e, {100 * self.gain_column:.3g} %"
        if self.dark:
            said += f"; dark current {100 * self.dark:.3g} %"
        if self.hot or self.dead:
            said += f"; {100 * self.hot:.3g} % hot, {100 * self.dead:.3g} % dead pixels"
        if self.bad_columns or self.bad_rows:
            said += (
                f"; {100 * self.bad_columns:.3g} % bad columns, {100 * self.bad_rows:.3g} % rows"
            )
        return said

    def without_parts(self, names: Collection[str]) -> Self:
        """Return it with some of its parts at 0."""
        gone: dict[str, Any] = dict.fromkeys(names, 0.0)
        return replace(self, **gone)

    def split(self) -> tuple[FixedPattern, FixedPattern | None, None]:
        """Return the pixels' own pattern, the columns' and None: rows are alike."""
        own = replace(self, offset_column=0.0, gain_column=0.0)
        if not (self.offset_column or self.gain_column):
            return own, None, None
        return own, FixedPattern(0.0, self.offset_column, 0.0, self.gain_column), None

    def before_shot(self, mean: Array, site: Site) -> Array:
        """Return the mean signal with dark currents and defects in it; it reuses the array."""
        if self.dark and site.has_dark:
            z = site.normal("fpn dark")
            z *= self.dark
            np.maximum(z, -1, out=z)
            mean += z * site.dark
        if self.hot or self.dead:
            # 64 bits whatever the rest is computed in: the same pixels in both.
            chance = site.uniform("fpn defects")
            if self.hot_current:
                leak = site.exponential("fpn hot")
                mean += np.where(chance < self.hot, self.hot_current * site.dark * leak, 0)
            else:
                np.copyto(mean, float(OVERFULL * self.full_well), where=chance < self.hot)
            np.copyto(mean, 0.0, where=chance >= 1 - self.dead)
        if self.bad_columns:
            np.copyto(mean, 0.0, where=site.uniform_columns("fpn bad columns") < self.bad_columns)
        if self.bad_rows:
            np.copyto(mean, 0.0, where=site.uniform_rows("fpn bad rows") < self.bad_rows)
        return mean

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with gains and offsets in it; it reuses the array [electrons]."""
        if self.gain_pixel or self.gain_column:
            gain: Array = 1 + self.gain_column * site.normal_columns("fpn gain column")
            if self.gain_pixel:
                g = site.normal("fpn gain pixel")
                g *= self.gain_pixel
                g += gain
                gain = g
            electrons *= gain
        if self.offset_pixel:
            electrons = site.add_normal("fpn offset pixel", electrons, self.offset_pixel)
        if self.offset_column:
            electrons += self.offset_column * site.normal_columns("fpn offset column")
        return electrons

    @property
    def fills_wells(self) -> bool:
        """Whether there are hot pixels."""
        return self.hot > 0

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        offsets = self.offset_pixel**2 + self.offset_column**2
        gains = (self.gain_pixel**2 + self.gain_column**2) * mean**2
        lost = self._dead_fraction
        if self.hot_current:
            return self._leaking_variance(mean, dark, offsets, gains)
        working = 1 - self.hot - lost
        # Of a mixture: the mean variance of its parts, and the variance of their means.
        within = offsets * (1 - self.hot) + (gains + self._dark_variance(dark)) * working
        if not self.hot:
            return within + lost * (1 - lost) * mean**2
        center = self.hot * self.full_well + working * mean
        between = self.hot * (self.full_well - center) ** 2 + working * (mean - center) ** 2
        return within + between + lost * center**2

    def _leaking_variance(self, mean: float, dark: float, offsets: float, gains: float) -> float:
        """Variance where hot pixels have a dark current of their own [electrons squared]."""
        working, leak = 1 - self._dead_fraction, self.hot_current * dark
        within = offsets + (gains + self._dark_variance(dark)) * working
        center = working * mean + self.hot * leak
        # The mean square of an exponential distribution is twice its squared mean.
        square = working * mean**2 + 2 * self.hot * (mean * leak + leak**2)
        return within + square - center**2

    def working_variance(self) -> float:
        """Return the variance of the offsets of working pixels [electrons squared]."""
        return replace(
            self, hot=0.0, dead=0.0, hot_current=0.0, bad_columns=0.0, bad_rows=0.0
        ).variance(0.0)

    def _dark_variance(self, dark: float) -> float:
        """Variance of the dark signals [electrons squared]: of a normal number, 0 if below 0."""
        if not self.dark or not dark:
            return 0.0
        top = 1 / self.dark
        below = math.erfc(top / math.sqrt(2)) / 2
        density = math.exp(-(top**2) / 2) / math.sqrt(2 * math.pi)
        # Mean square less squared mean with the ones taken out: a small spread would drown in them.
        spread = self.dark**2 * (1 - below - density**2)
        return (below * (1 - below) + spread - self.dark * density * (1 - 2 * below)) * dark**2
