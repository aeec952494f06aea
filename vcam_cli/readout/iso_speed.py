"""ISO speed of a camera: how much light fills it, and which gain an ISO speed asks for.

Saturation-based, as ISO 12232 defines it: the camera faces daylight, and the exposure of the focal
plane [lx s] is sought at which its brightest color is full, in the pixel or in the ADC. Light is
measured behind the lens, so that only the spectrum of its transmittance counts, as that of a filter
against infrared; dark signal does not count, as it depends on the time.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Gain, of_kind, switched_off
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.settings import camera_settings
from vcam_cli.physics import readout
from vcam_cli.readout.layout import Layout
from vcam_cli.spectra import VISIBLE, Spectrum, illuminant, luminance

DAYLIGHT = "D55"
"""Illuminant of ISO 12232 for daylight, ISO 7589."""


def base_iso(camera: Camera, geometry: Geometry, layout: Layout) -> float:
    """Return the saturation-based ISO speed of a camera at an exposure gain of 1.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Its geometry.
    layout : Layout
        Which pixels are read as one.

    Returns
    -------
    float
        ISO speed; 0 of a camera that sees nothing of daylight.

    References
    ----------
    ISO 12232:2019, section 6.2.
    """
    per_exposure = electrons_per_exposure(camera, geometry, layout, illuminant(DAYLIGHT))
    most = float(per_exposure.max()) * layout.binning_groups.summed_charges
    if most <= 0:
        return 0.0
    circuit = electrical(camera.with_exposure_gain(1.0))
    return float(readout.saturation_speed(circuit.saturation / most))


def electrons_per_exposure(
    camera: Camera, geometry: Geometry, layout: Layout, light: Spectrum
) -> Array:
    """Return the electrons of a pixel on the axis for an exposure of the focal plane.

    Light is measured behind the lens.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Its geometry.
    layout : Layout
        Which colors its pixels have.
    light : Spectrum
        Spectral radiance of the scene's white, in any scale.

    Returns
    -------
    Array
        Electrons of every color (C,) [e / (lx s)]; 0 behind a lens that passes no light.
    """
    kinds = [kind for kind in ORDER if issubclass(kind, Gain)]
    wanted = [k.from_camera(camera, geometry) for k in kinds if not switched_off(camera, k.name)]
    gains = of_kind((gain for gain in wanted if gain is not None), Gain)
    levels = photon_rate.axis_levels(
        camera, geometry, camera_settings(camera), [light], layout.mosaic, gains
    )
    lux = _lux(camera, geometry, light)
    return np.asarray(levels[0] / lux if lux > 0 else np.zeros(len(levels[0])))


def _lux(camera: Camera, geometry: Geometry, light: Spectrum) -> float:
    """Return the illuminance behind the lens before a scene of a light, unscaled [lx]."""
    lens = camera.optics.transmittance.resolve()
    band = camera.scene.wavelengths
    start, stop = VISIBLE if lens.covers(*VISIBLE) else (band.start, band.stop)
    behind = luminance(light.multiply(lens), start, stop)
    return geometry.irradiance_per_radiance * behind


def set_gain(camera: Camera, base_iso: float) -> Camera:
    """Return the camera at the gain that its ISO speed asks for, gain = iso / base_iso.

    Parameters
    ----------
    camera : Camera
        The camera.
    base_iso : float
        Its ISO speed at gain 1.

    Returns
    -------
    Camera
        The camera, whose `exposure_gain` is known.

    Raises
    ------
    BadInput
        For an ISO speed of a camera that sees nothing of daylight, or beyond `max_gain`.
    """
    given, path = camera.exposure, ("exposure", "iso")
    if given.iso is None:
        return camera
    if base_iso == 0:
        message = "this camera sees nothing of daylight, and has no ISO speed"
        raise bad(path, message, "give exposure.gain")
    gain = given.iso / base_iso
    if given.auto and "max_gain" in given.auto.model_fields_set and gain > given.auto.max_gain:
        message = f"is a gain of {gain:.4g} (base ISO {base_iso:.4g}), more than auto.max_gain"
        raise bad(path, message, "raise max_gain, or lower iso")
    return camera.with_exposure_gain(gain)
