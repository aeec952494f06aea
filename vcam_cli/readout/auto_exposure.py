"""How long the shutter is open, and at what gain: given, or chosen for the scene."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.exposure import AutoExposure, Exposure
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ExposureSettings:
    """Time and gain of an exposure."""

    time: float
    """Exposure time [s]; of several samples of one integration the last that the file gives."""
    gain: float
    """Analog gain before the ADC."""
    limit: str = ""
    """Which limit an automatic exposure ran into: "longest time", "shortest time", "largest gain";
    "" where it reached its target, or where the file gives the time."""


def exposure_settings(
    exposure: Exposure, rate: Array, white_rate: float, dark_rate: float, circuit: Electrical
) -> ExposureSettings:
    """Return time and gain of a camera's exposure, given or chosen for the scene.

    The level that an automatic exposure brings to its target is the white's, a percentile of the
    pixels', or their mean, each with the dark signal on it. It takes the time first: the gain rises
    only where the longest time is not enough.

    Parameters
    ----------
    exposure : Exposure
        What the file says of the exposure.
    rate : Array
        Photo-electrons per second of every pixel, of any shape [e/s].
    white_rate : float
        Rate of the scene's perfect white on the axis in its brightest color [e/s].
    dark_rate : float
        Rate of the dark current [e/s].
    circuit : Electrical
        Full well and ADC, at the gain that the file gives.

    Returns
    -------
    ExposureSettings
        Time, gain, and the limit that stopped an automatic exposure.
    """
    auto, gain = exposure.auto, circuit.exposure_gain
    if auto is None:
        assert exposure.longest is not None
        return ExposureSettings(exposure.longest, gain)
    level = _level(auto, rate, white_rate) + dark_rate
    target = _target(exposure)
    wanted = target * circuit.saturation / level if level > 0 else np.inf
    time = float(min(max(wanted, auto.min), auto.max))
    if wanted < auto.min:
        return ExposureSettings(time, gain, "shortest time")
    if wanted <= auto.max:
        return ExposureSettings(time, gain)
    if auto.max_gain <= gain:
        return ExposureSettings(time, gain, "longest time")
    full_scale = circuit.adc_full_scale * gain
    wanted = target * full_scale / (level * time) if level > 0 else np.inf
    limit = "largest gain" if wanted > auto.max_gain else ""
    return ExposureSettings(time, float(min(max(wanted, gain), auto.max_gain)), limit)


def _target(exposure: Exposure) -> float:
    """Return the share of saturation that an automatic exposure aims at, compensation included."""
    assert exposure.auto is not None
    return exposure.auto.target * 2**exposure.compensation


def _level(auto: AutoExposure, rate: Array, white_rate: float) -> float:
    """Return the photo rate that an automatic exposure judges [e/s]."""
    if auto.method == "white":
        return white_rate
    if auto.method == "mean":
        return float(rate.mean(dtype=np.float64))
    return percentile(rate, auto.percentile)


def ceiling(exposure: Exposure, white_rate: float, saturation: float) -> float:
    """Return the photo rate that fills a pixel, where it is known before the light is.

    A given exposure time determines it; of several samples the last, which needs the finest
    detail. An automatic exposure is estimated by that of the perfect white, or by its longest time.

    Parameters
    ----------
    exposure : Exposure
        What the file says of the exposure.
    white_rate : float
        Rate of the scene's perfect white on the axis in its brightest color [e/s].
    saturation : float
        Signal at which well or ADC is full [electrons].

    Returns
    -------
    float
        Photo-electrons per second [e/s].
    """
    auto = exposure.auto
    if auto is None:
        assert exposure.longest is not None
        return saturation / exposure.longest
    return max(white_rate / _target(exposure), saturation / auto.max)


def percentile(values: Array, percent: float) -> float:
    """Return the value below which a percentage of the values lie, by partial sorting.

    Parameters
    ----------
    values : Array
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
