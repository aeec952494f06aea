"""How long the shutter is open: given, or chosen for the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.exposure import AutoExposure


def exposure_time(
    camera: Camera, rate: NDArray, white_rate: float, dark_rate: float, saturation: float
) -> float:
    """Exposure time [s]; of several samples of one integration the last that the file gives.

    rate: photo-electrons per second of every pixel; white_rate: of the scene's perfect white on
    the axis in its brightest color; dark_rate: of the dark [e/s]; saturation: electrons at which
    well or ADC is full. The level that is brought to its target is the white's, a percentile of
    the pixels', or their mean; each with the dark signal on it.
    """
    auto = camera.exposure.auto
    if auto is None:
        assert camera.exposure.longest is not None
        return camera.exposure.longest
    return _reach(auto, _level(auto, rate, white_rate) + dark_rate, saturation)


def _level(auto: AutoExposure, rate: NDArray, white_rate: float) -> float:
    """The photo rate that decides [e/s]."""
    if auto.method == "white":
        return white_rate
    if auto.method == "mean":
        return float(rate.mean(dtype=np.float64))
    return percentile(rate, auto.percentile)


def ceiling(camera: Camera, white_rate: float, saturation: float) -> float:
    """Photo-electrons per second that fill a pixel, as far as it is known before the light is.

    A given time tells; of several samples the last, which asks for the finest detail. An automatic
    one will be about that of the perfect white, or the longest.
    """
    auto = camera.exposure.auto
    if auto is None:
        assert camera.exposure.longest is not None
        return saturation / camera.exposure.longest
    return max(white_rate / auto.target, saturation / auto.max)


def _reach(auto: AutoExposure, rate: float, saturation: float) -> float:
    """Time at which `rate` fills the target's share of the well, within the limits."""
    wanted = auto.target * saturation / rate if rate > 0 else np.inf
    return float(min(max(wanted, auto.min), auto.max))


def percentile(values: NDArray, percent: float) -> float:
    """Value below which `percent` % of the values lie, by partial sorting."""
    flat = values.ravel()
    index = min(len(flat) - 1, max(0, int(np.ceil(percent / 100 * len(flat))) - 1))
    return float(np.partition(flat, index)[index])
