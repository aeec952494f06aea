"""Noise of a pixel in the dark, without dark current: what the offset of an ADC makes room for.

It is of the camera that the file describes, whatever effects are switched off, and of no exposure
time: the shot noise of a dark signal comes with the signal itself, which lifts it off zero.
Telegraph noise is left out: it is of few pixels.
"""

from __future__ import annotations

import math

from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.physics import readout

SIGMAS = 4.0
"""Standard deviations below black that an automatic offset keeps: 3 of 100 000 pixels are lower."""


def reset_noise(camera: CameraModel, capacitance: float | None) -> float:
    """Return the noise that the reset leaves in a frame [e rms].

    Parameters
    ----------
    camera : CameraModel
        The camera.
    capacitance : float or None
        Capacitance of the photodiode's node [F]; needed where its kTC noise is asked for.

    Returns
    -------
    float
        Noise [e rms]; 0 where the architecture removes it.
    """
    given = camera.pixel.readout.reset_noise
    of_what = ARCHITECTURES[camera.pixel.architecture].reset_noise
    if given == "none" or of_what == "none":
        return 0.0
    if given != "ktc":
        return float(given)
    if of_what == "bit line":
        capacitance = camera.pixel.readout.bit_line_capacitance
    if capacitance is None:  # `electrical.check` refuses that where the file is read
        return 0.0
    variance = readout.reset_noise_variance(capacitance, camera.pixel.temperature)
    return float(variance) ** 0.5


def dark_noise(camera: CameraModel, capacitance: float | None) -> float:
    """Return the spread of pixels in the dark, temporal and fixed pattern together [e rms].

    Parameters
    ----------
    camera : CameraModel
        The camera.
    capacitance : float or None
        Capacitance of the photodiode's node [F].

    Returns
    -------
    float
        Noise [e rms].
    """
    given, pattern = camera.pixel.readout, camera.pixel.fpn
    parts = [given.read_noise, given.row_noise, pattern.offset_pixel]
    parts.append(reset_noise(camera, capacitance))
    for noise in (given.heavy_tailed_noise, given.correlated_row_noise):
        parts.append(0.0 if noise is None else noise.rms)
    parts.append(0.0 if pattern.shading is None else pattern.shading.offset)
    if ARCHITECTURES[camera.pixel.architecture].column_terms:
        parts += [given.column_noise, pattern.offset_column]
    return math.hypot(*parts)
