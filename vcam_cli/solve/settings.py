"""The settings of image formation that follow from a camera's accuracy."""

from __future__ import annotations

from dataclasses import replace

from vcam_cli.camera.camera import Camera
from vcam_cli.image_formation.settings import DRAFT, FINE, REFERENCE, STANDARD, Settings

PERCENTILE_SHARE = 0.5
"""Part of the tolerance for light that is metered at a percentile: an error of that one pixel is
one of all pixels."""
LADDER = ((0.02, DRAFT), (0.005, STANDARD), (0.001, FINE), (0.0, REFERENCE))
"""Settings for tolerances from the first number of each pair upward."""


def camera_settings(camera: Camera) -> Settings:
    """Return the settings for the camera's tolerance, with those that its file states itself.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    Settings
        Settings of image formation.
    """
    accuracy = camera.accuracy
    chosen = next(s for least, s in LADDER if accuracy.tolerance >= least)
    mixing = min(chosen.mixing_tolerance, accuracy.tolerance / 10)
    auto = camera.exposure.auto
    share = PERCENTILE_SHARE if auto is not None and auto.method == "percentile" else 1.0
    chosen = replace(chosen, tolerance=share * accuracy.tolerance, mixing_tolerance=mixing)
    if camera.scene.wavelengths.step is not None:
        chosen = replace(chosen, wavelength_step=camera.scene.wavelengths.step)
    if "float_width" in accuracy.knobs:
        chosen = replace(chosen, chart_width=accuracy.knobs["float_width"])
    return replace(chosen, **accuracy.knobs)
