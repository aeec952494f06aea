"""Light that lens and housing scatter over the whole sensor."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Veil


@dataclass(frozen=True)
class StrayLight(Veil):
    """Veiling glare: E becomes (1 - s) E + s mean(E), the mean of a color over the array.

    What lies beside the picture throws no light into it, and takes none.
    """

    fraction: float

    name = "stray_light"
    reference = "ISO 9358:1994 (veiling glare index); Matsuda and Nitoh, Appl. Opt. 11, 1972"
    absent = "the file gives no optics.stray_light, or 0"
    in_lens = True
    seconds_per_pixel = 1.5e-9

    @classmethod
    def of(cls, camera, geometry):
        fraction = camera.optics.stray_light
        return cls(fraction) if fraction > 0 else None

    def describe(self) -> str:
        return f"{self.fraction:.3%} of the light lies evenly over the sensor"

    def mean_error(self, outlook) -> float:
        # Numbers from 0 to full signal deviate from their mean by half of it rms, at most.
        return self.fraction * outlook.full_signal / 2
