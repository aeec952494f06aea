"""Fixed-pattern noise: no two pixels, and no two columns, are alike."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Draw


@dataclass(frozen=True)
class FixedPattern(Draw):
    """Offsets [electrons] and gains [1], per pixel and per column, drawn from the sensor seed."""

    offset_pixel: float
    offset_column: float
    gain_pixel: float
    gain_column: float

    name = "fpn"
    reference = "Chen 2003, eq 2.26 (Q_f); El Gamal et al., Proc. SPIE 3301, 1998"
    absent = "the file gives no pixel.fpn"
    seconds_per_pixel = 20e-9
    scope = "sensor"

    @classmethod
    def of(cls, camera, geometry):
        fpn = camera.pixel.fpn
        strengths = (fpn.offset_pixel, fpn.offset_column, fpn.gain_pixel, fpn.gain_column)
        return cls(*strengths) if any(strengths) else None

    def describe(self) -> str:
        return (
            f"offsets of {self.offset_pixel:.4g} e a pixel and {self.offset_column:.4g} e a column,"
            f" gains of {self.gain_pixel:.3%} a pixel and {self.gain_column:.3%} a column"
        )

    def apply(self, electrons, site):
        if self.gain_pixel or self.gain_column:
            gain = 1 + self.gain_column * site.normal_columns("fpn gain column")
            if self.gain_pixel:
                g = site.normal("fpn gain pixel")
                g *= self.gain_pixel
                g += gain
                gain = g
            electrons *= gain
        if self.offset_pixel:
            z = site.normal("fpn offset pixel")
            z *= self.offset_pixel
            electrons += z
        if self.offset_column:
            electrons += self.offset_column * site.normal_columns("fpn offset column")
        return electrons

    def variance(self, mean):
        gain = self.gain_pixel**2 + self.gain_column**2
        return gain * mean**2 + self.offset_pixel**2 + self.offset_column**2
