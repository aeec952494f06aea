"""Sharpness from frames of a slanted edge: MTF50 of the system, and the transfer of the lens.

The edge tells the transfer of lens and pixel together (e-SFR of ISO 12233, `quality.mtf`). That of
a pixel of the camera file is known, the sinc of its sides along the edge's normal; the quotient is
the MTF of the lens, or of the silicon: it goes into the camera file as `optics.mtf`.
"""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics.diffraction import cutoff_frequency
from vcam_cli.quality.mtf import EdgeResponse
from vcam_cli.records import dataclass
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import Estimate

LEAST_APERTURE = 0.3
"""Transfer of the pixel below which that of the lens is not told: it would be noise, enlarged."""
MOST_ERROR = 0.03
"""Standard error of the transfer above which it is no longer told."""
ASSUMED = 0.02
"""Noise of one frame by itself, in the same unit as `_noise` returns it."""
SHORTEST = 380e-9
"""Wavelength with the highest MTF of the aperture [m]."""
COLUMNS = ("frequency_lp_per_mm", "value")


@dataclass(frozen=True)
class LensTransfer:
    """Modulation transfer of the lens, in the mean over frames and colors."""

    frequency: Array
    """Spatial frequencies (n,), rising from 0 [cycles/m]."""
    value: Array
    """Modulation transfer (n,), 1 at frequency 0."""

    def rows(self) -> list[tuple[float, float]]:
        """Return the rows of mtf.csv, columns `COLUMNS`."""
        pairs = zip(self.frequency, self.value, strict=True)
        return [(float(f) * 1e-3, round(float(v), 6)) for f, v in pairs]


def mtf50(responses: list[EdgeResponse]) -> Estimate | None:
    """Return MTF50 of one color, mean and standard error over frames [cycles/m].

    None where there is one frame only, or a transfer that never falls to one half.
    """
    values = [response.mtf50 for response in responses]
    if len(values) < 2 or not math.isfinite(sum(values)):
        return None
    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return Estimate(float(np.mean(values)), spread)


def lens_transfer(responses: list[EdgeResponse], measurement: Measurement) -> LensTransfer:
    """Return the transfer of the lens from responses of all frames and colors.

    Parameters
    ----------
    responses : list of EdgeResponse
        One or more.
    measurement : Measurement
        Size of the pixels, and the lens where it is known: beyond what its aperture leaves there
        is nothing.

    Returns
    -------
    LensTransfer
        Up to the frequency where the pixel's MTF falls into the noise.
    """
    pixel = measurement.pixel
    assert pixel is not None
    assert pixel.width is not None
    frequency = responses[0].frequency
    apertures, values = [], []
    for each in responses:
        across = frequency * pixel.width * math.cos(each.angle)
        down = frequency * (pixel.height or pixel.width) * math.sin(each.angle)
        apertures.append(np.sinc(across) * np.sinc(down))
        values.append(np.interp(frequency, each.frequency, each.mtf))
    aperture = np.mean(apertures, axis=0)
    noise = _noise(np.array(values), frequency * responses[0].pitch)
    mean, error = (seen / np.maximum(aperture, LEAST_APERTURE) for seen in
                   (np.mean(values, axis=0), noise / math.sqrt(len(values))))  # fmt: skip
    told = (aperture >= LEAST_APERTURE) & (error <= MOST_ERROR) & (mean > error)
    if measurement.optics is not None:
        told &= frequency < float(cutoff_frequency(SHORTEST, measurement.optics.f_number))
    told[0] = True
    count = int(np.argmin(told)) if not told.all() else len(told)
    value = np.clip(mean[:count], 0.0, 1.0)
    return LensTransfer(frequency[:count], value / value[0])


def _noise(values: Array, frequency: Array) -> Array:
    """Return the standard deviation of a frame's transfer (n,).

    The derivative of the edge makes white noise rise with the frequency, so that all frequencies
    tell one number; by the scatter of few frames each would be known badly.

    Parameters
    ----------
    values : Array
        Transfers of the frames (frames, n).
    frequency : Array
        Spatial frequencies (n,), rising from 0 [cycles/pixel].
    """
    if len(values) < 2:
        return ASSUMED * frequency
    spread = values.std(axis=0, ddof=1)[1:] / frequency[1:]
    return float(np.sqrt(np.mean(spread**2))) * frequency
