"""How long the shutter is open: given, or chosen for the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.exposure import AutoExposure


def exposure_time(
    camera: Camera, rate: NDArray, white_rate: float, dark_rate: float, saturation: float
) -> float:
    """Exposure time [s].

    rate: photo-electrons per second of every pixel; white_rate: of the scene's perfect white on
    the axis in its brightest color; dark_rate: of the dark [e/s]; saturation: electrons at which
    well or ADC is full.
    """
    auto = camera.exposure.auto
    if auto is None:
        assert camera.exposure.time is not None
        return camera.exposure.time
    level = white_rate if auto.method == "white" else percentile(rate, auto.percentile)
    return _reach(auto, level + dark_rate, saturation)


def _reach(auto: AutoExposure, rate: float, saturation: float) -> float:
    """Time at which `rate` fills the target's share of the well, within the limits."""
    wanted = auto.target * saturation / rate if rate > 0 else np.inf
    return float(min(max(wanted, auto.min), auto.max))


def percentile(values: NDArray, percent: float) -> float:
    """Value below which `percent` % of the values lie, by partial sorting."""
    flat = values.ravel()
    index = min(len(flat) - 1, max(0, int(np.ceil(percent / 100 * len(flat))) - 1))
    return float(np.partition(flat, index)[index])
