"""How long the shutter is open: given, or chosen for the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.exposure import AutoExposure


def exposure_time(
    camera: Camera, rate: NDArray, white_rate: float, dark_rate: float, saturation: float
) -> float:
    """Return the exposure time of a camera, given or chosen for the scene.

    The level that an automatic exposure brings to its target is the white's, a percentile of the
    pixels', or their mean, each with the dark signal on it.

    Parameters
    ----------
    camera : Camera
        Camera whose exposure is sought.
    rate : NDArray
        Photo-electrons per second of every pixel, of any shape [e/s].
    white_rate : float
        Rate of the scene's perfect white on the axis in its brightest color [e/s].
    dark_rate : float
        Rate of the dark current [e/s].
    saturation : float
        Signal at which well or ADC is full [electrons].

    Returns
    -------
    float
        Exposure time [s]; of several samples of one integration the last that the file gives.
    """
    auto = camera.exposure.auto
    if auto is None:
        assert camera.exposure.longest is not None
        return camera.exposure.longest
    return _reach(auto, _level(auto, rate, white_rate) + dark_rate, saturation)


def _level(auto: AutoExposure, rate: NDArray, white_rate: float) -> float:
    """Return the photo rate that an automatic exposure judges [e/s]."""
    if auto.method == "white":
        return white_rate
    if auto.method == "mean":
        return float(rate.mean(dtype=np.float64))
    return percentile(rate, auto.percentile)


def ceiling(camera: Camera, white_rate: float, saturation: float) -> float:
    """Return the photo rate that fills a pixel, as far as it is known before the light is.

    A given exposure time determines it; of several samples the last, which asks for the finest
    detail. An automatic exposure is estimated by that of the perfect white, or by its longest time.

    Parameters
    ----------
    camera : Camera
        Camera whose exposure is meant.
    white_rate : float
        Rate of the scene's perfect white on the axis in its brightest color [e/s].
    saturation : float
        Signal at which well or ADC is full [electrons].

    Returns
    -------
    float
        Photo-electrons per second [e/s].
    """
    auto = camera.exposure.auto
    if auto is None:
        assert camera.exposure.longest is not None
        return saturation / camera.exposure.longest
    return max(white_rate / auto.target, saturation / auto.max)


def _reach(auto: AutoExposure, rate: float, saturation: float) -> float:
    """Return the time at which `rate` fills the target's share of the well, within limits [s]."""
    wanted = auto.target * saturation / rate if rate > 0 else np.inf
    return float(min(max(wanted, auto.min), auto.max))


def percentile(values: NDArray, percent: float) -> float:
    """Return the value below which a percentage of the values lie, by partial sorting.

    Parameters
    ----------
    values : NDArray
        Values, of any shape and unit.
    percent : float
        Percentage of the values, 0 to 100.

    Returns
    -------
    float
        One of the values, in their unit.
    """
    flat = values.ravel()
    index = min(len(flat) - 1, max(0, int(np.ceil(percent / 100 * len(flat))) - 1))
    return float(np.partition(flat, index)[index])
