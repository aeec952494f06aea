"""ISO speed of a camera: the light that fills it, and the gain for an ISO speed.

Saturation-based, as ISO 12232 defines it: the camera faces daylight, and the exposure of the focal
plane [lx s] is sought at which its brightest color is full, in the pixel or in the ADC. Light is
measured behind the lens, so that only the spectrum of its transmittance counts, as that of a filter
against infrared; dark signal does not count, as it depends on the time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.exposure import Exposure
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.errors import Path, bad
from vcam_cli.image_formation.pixel_response import PixelResponse, axis_levels
from vcam_cli.physics import readout
from vcam_cli.spectra import VISIBLE, Spectrum, illuminant, luminance

DAYLIGHT = "D55"
"""Illuminant of ISO 12232 for daylight, ISO 7589."""


def daylight() -> Spectrum:
    """Return the light that a camera faces."""
    return illuminant(DAYLIGHT)


def base_iso(electrons_per_exposure: float, saturation: float) -> float:
    """Return the saturation-based ISO speed of a camera at an exposure gain of 1.

    Parameters
    ----------
    electrons_per_exposure : float
        Electrons that the brightest color makes of daylight [e / (lx s)].
    saturation : float
        Electrons at which the well or the ADC is full at that gain [electrons].

    Returns
    -------
    float
        ISO speed.

    References
    ----------
    ISO 12232:2019, section 6.2.
    """
    return float(readout.saturation_speed(saturation / electrons_per_exposure))


@remembered(4)  # 4 % of a frame of 64 x 64 pixels of a data set
def electrons_per_exposure(
    response: PixelResponse, lens: Spectrum, gains: Sequence[Gain], light: Spectrum
) -> Array:
    """Return the electrons of a pixel on the axis for an exposure of the focal plane.

    Light is measured behind the lens.

    Parameters
    ----------
    response : PixelResponse
        Response of the pixels.
    lens : Spectrum
        Transmittance of the lens.
    gains : sequence of Gain
        Gains of the camera.
    light : Spectrum
        Spectral radiance of the scene's white, in any scale.

    Returns
    -------
    Array
        Electrons of every color (C,) [e / (lx s)]; 0 behind a lens that passes no light.
    """
    levels = axis_levels(response, [light], gains)
    start, stop = VISIBLE if lens.covers(*VISIBLE) else (response.start, response.stop)
    behind = luminance(light.multiply(lens), start, stop)
    lux = response.irradiance_per_radiance * behind
    return np.asarray(levels[0] / lux if lux > 0 else np.zeros(len(levels[0])))


def limited(exposure: Exposure, base_iso: float, least: float) -> Exposure:
    """Return an exposure whose largest gain follows from its largest ISO speed.

    Parameters
    ----------
    exposure : Exposure
        What the file says of the exposure.
    base_iso : float
        ISO speed of the camera at gain 1; 0 of one that sees nothing of daylight.
    least : float
        Gain from which an automatic exposure starts.

    Returns
    -------
    Exposure
        The same, `auto.max_gain` = `auto.max_iso` / base_iso, where the file gives `max_iso`.

    Raises
    ------
    BadInput
        For a camera that sees nothing of daylight, or whose gain is beyond `max_iso` already.
    """
    auto, path = exposure.auto, "exposure.auto.max_iso"
    if auto is None or auto.max_iso is None:
        return exposure
    _require_daylight(base_iso, path, "give exposure.auto.max_gain")
    most = auto.max_iso / base_iso
    if most < least:
        message = f"is below ISO {base_iso * least:.4g}, the camera's at gain {least:g}"
        raise bad(path, message, "raise it")
    changed = auto.model_copy(update={"max_gain": most})
    return exposure.model_copy(update={"auto": changed})


def gain(exposure: Exposure, base_iso: float, given: float) -> float:
    """Return the gain for an ISO speed, gain = iso / base_iso.

    Parameters
    ----------
    exposure : Exposure
        What the file says of the exposure.
    base_iso : float
        ISO speed of the camera at gain 1; 0 of one that sees nothing of daylight.
    given : float
        Gain where the exposure sets no ISO speed.

    Returns
    -------
    float
        Gain of the exposure.

    Raises
    ------
    BadInput
        For an ISO speed of a camera that sees nothing of daylight, or beyond `max_gain`.
    """
    path = ("exposure", "iso")
    if exposure.iso is None:
        return given
    _require_daylight(base_iso, path, "give exposure.gain")
    found = exposure.iso / base_iso
    auto = exposure.auto
    if auto and "max_gain" in auto.model_fields_set and found > auto.max_gain:
        message = f"is a gain of {found:.4g} (base ISO {base_iso:.4g}), more than auto.max_gain"
        raise bad(path, message, "raise max_gain, or lower iso")
    return found


def _require_daylight(base_iso: float, path: Path | str, remedy: str) -> None:
    """Refuse an ISO speed where the camera has no response to daylight (BadInput)."""
    if base_iso == 0:
        raise bad(path, "this camera sees nothing of daylight, and has no ISO speed", remedy)
