"""Heavy-tailed noise of the readout: large values are more frequent than in normal noise.

    noise = rms Q(u) / std(Q),   Q(u) = (u^s - (1 - u)^s) / s

u is a number drawn evenly from 0 to 1 and s the shape: 0.14 is close to normal, 0 is
logistic; below tails are heavier, above lighter. The file may give the scale, rms / std(Q), in
place of rms.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.noise import at_gain
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass

LEAST_CHANCE = 2.0**-54
"""A number drawn evenly from 0 to 1 is kept this far from 0, half of the generator's step."""
SERIES_UP_TO, SERIES_TERMS = 0.1, 25
"""Shapes below which the variance is a series, and the power at which that ends: of the ratio 2e-16
are left out."""


def tukey_lambda(chance: Array, shape: float) -> Array:
    """Return the quantile of Tukey's lambda distribution, (u^s - (1 - u)^s) / s; the logit for 0.

    Parameters
    ----------
    chance : Array
        Probabilities u, above 0 and below 1.
    shape : float
        Shape s of the distribution.

    Returns
    -------
    Array
        Quantiles, symmetric about 0 [dimensionless].

    References
    ----------
    J. W. Tukey, "The practical relationship between the common transformations of percentages or
    fractions and of amounts", 1960; B. L. Joiner and J. R. Rosenblatt, J. Am. Stat. Assoc. 66,
    1971, doi:10.1080/01621459.1971.10482275.
    """
    below, above = np.log(chance), np.log1p(-chance)
    if shape == 0:
        return below - above
    return (np.expm1(shape * below) - np.expm1(shape * above)) / shape


@lru_cache(maxsize=64)
def tukey_lambda_spread(shape: float) -> float:
    """Return the standard deviation of Tukey's lambda distribution of scale 1.

    Its variance is 2 (1 - G(1 + a)^2 / G(1 + 2 a)) / (a^2 (1 + 2 a)) for the shape a, with the
    gamma function G; near 0, where the logarithm of that ratio is a difference of like numbers, by
    its power series. `scipy.stats`, which knows it, too, takes 40 MB and a second to import.

    Parameters
    ----------
    shape : float
        Shape lambda of the distribution.

    Returns
    -------
    float
        Standard deviation, in units of the scale.
    """
    if shape == 0:
        return math.pi / math.sqrt(3)
    if abs(shape) < SERIES_UP_TO:
        from scipy.special import zeta

        k = np.arange(2, SERIES_TERMS)
        ratio = float(np.sum(zeta(k) / k * (2 - 2.0**k) * (-shape) ** k))
    else:
        ratio = 2 * math.lgamma(1 + shape) - math.lgamma(1 + 2 * shape)
    return math.sqrt(-2 * math.expm1(ratio) / (1 + 2 * shape)) / abs(shape)


@dataclass(frozen=True)
class HeavyTailedNoise(NoiseSource):
    """Independent noise of every pixel and readout, by Tukey's lambda distribution.

    It adds to `read_noise`: a readout that has no normal noise gives 0 there.
    """

    rms: float
    """Standard deviation [electrons]."""
    shape: float

    name = "heavy_tailed_noise"
    reference = (
        "Wei et al., A physics-based noise formation model for extreme low-light raw denoising,"
        " CVPR 2020, section 3.2 (read noise)"
    )
    keys_behind_light = ("pixel.readout.heavy_tailed_noise",)
    absent = "pixel.readout.heavy_tailed_noise has the value none or 0"
    seconds_per_pixel = 9e-9
    origin = "readout"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise that the file gives, or None where it gives none."""
        given = camera.pixel.readout.heavy_tailed_noise
        if given is None:
            return None
        if given.rms is not None:
            rms = at_gain(given.rms, camera.exposure_gain)
        else:
            assert given.scale is not None  # the model has one of both
            rms = at_gain(given.scale, camera.exposure_gain) * tukey_lambda_spread(given.shape)
        return cls(rms, given.shape) if rms else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.rms:.4g} e rms, Tukey lambda of shape {self.shape:g}"

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the noise of one readout in it; it reuses the array [electrons]."""
        # 64 bits whatever the rest is computed in: tails end where the generator's steps begin.
        chance = site.uniform(self.name)
        z = tukey_lambda(np.maximum(chance, LEAST_CHANCE), self.shape)
        z *= self.rms / tukey_lambda_spread(self.shape)
        electrons += z.astype(electrons.dtype)
        return electrons

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        return self.rms**2
