"""Automatic exposure from frame to frame: every frame is exposed by what the one before metered.

The control law is that of a first-order follower in EV,

    log2 E(n + 1) = log2 E(n) + follow (log2 E*(n) - log2 E(n)),

with the exposure E = time x gain, E* the exposure that would have brought the level of frame n to
its target, and `exposure.auto.follow`. What is metered is the light of frame n as its pixels held
it, so that an overexposed frame tells no more than that it was. Time goes first, then gain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.readout import auto_exposure
from vcam_cli.readout.auto_exposure import ExposureSettings
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.solve.solved import Solved


def next_exposure(camera: Solved, last: Prepared) -> ExposureSettings:
    """Return time and gain of the frame after one that was taken.

    Parameters
    ----------
    camera : Solved
        The camera, with its automatic exposure, at the gain that its file gives.
    last : Prepared
        The frame before.

    Returns
    -------
    ExposureSettings
        Time, gain, and the limit that stops it.
    """
    auto = camera.exposure.auto
    assert auto is not None
    circuit, time, gain = camera.chain.metered, last.exposure_time, last.solved.gain
    full = min(circuit.full_well, circuit.adc_full_scale * circuit.exposure_gain / gain)
    metered = np.minimum(last.rate, max(full / time - last.dark_rate, 0.0))
    white = float(last.white_rate.max())
    wanted = auto_exposure.exposure_settings(
        camera.limited_exposure, metered, white, last.dark_rate, circuit
    )
    now = time * gain
    product = now * (wanted.time * wanted.gain / now) ** auto.follow
    chosen = min(max(product / circuit.exposure_gain, auto.min), auto.max)
    return replace(wanted, time=chosen, gain=max(product / chosen, circuit.exposure_gain))


def set_exposure(camera: Camera, settings: ExposureSettings) -> Camera:
    """Return the camera with the exposure that its control has set.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    settings : ExposureSettings
        Time and gain of the control.

    Returns
    -------
    Camera
        Camera with a single exposure.
    """
    return camera.model_copy(
        update={"exposure": camera.exposure.single(settings.time, settings.gain)}
    )
