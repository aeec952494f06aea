"""Electrons per second that pixels on the axis make of spectral radiances."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.image_formation.transfer_functions import Band, Transfer, transfer
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True)
class PixelResponse:
    """What a pixel on the axis makes of radiance before any effect acts."""

    spectra: tuple[Spectrum, ...]
    """Electrons per photon of every color: transmittance x filter x quantum efficiency."""
    irradiance_per_radiance: float
    """Irradiance on the sensor over the radiance of the scene, of a perfect lens [sr]."""
    area: float
    """Area whose light the quantum efficiency counts [m2]."""
    start: float
    """Shortest wavelength simulated [m]."""
    stop: float
    """Longest wavelength simulated [m]."""


def scene_transfer(
    response: PixelResponse,
    spectra: Sequence[Spectrum],
    effects: Sequence[Effect],
    wavelength_step: float,
) -> Transfer:
    """Return the transfer H_kc of scene spectra on the axis.

    Of the effects it has the blurs that are the same everywhere, and the gains as they are on the
    axis.

    Parameters
    ----------
    response : PixelResponse
        Response of the pixels.
    spectra : sequence of Spectrum
        Spectral radiances of the scene's components [W/(sr m2 m)].
    effects : sequence of Effect
        Effects of the camera.
    wavelength_step : float
        Spacing of the wavelengths at which blurs are computed [m].

    Returns
    -------
    Transfer
        Transfer of the K components in C colors [e/s].

    References
    ----------
    T. Chen, PhD thesis, Stanford University, 2003, eqs 2.18 and 2.23.
    """
    area = response.area
    area *= math.prod((gain.on_axis for gain in of_kind(effects, Gain)), start=1.0)
    return transfer(
        spectra,
        list(response.spectra),
        response.irradiance_per_radiance * area,
        Band(response.start, response.stop, wavelength_step),
        of_kind(effects, Blur),
    )


def axis_levels(
    response: PixelResponse, spectra: Sequence[Spectrum], gains: Sequence[Gain]
) -> Array:
    """Return the electrons per second of uniform radiances on the axis.

    Parameters
    ----------
    response : PixelResponse
        Response of the pixels.
    spectra : sequence of Spectrum
        Spectral radiances [W/(sr m2 m)].
    gains : sequence of Gain
        Gains of the camera.

    Returns
    -------
    ndarray
        (K, C) rates of K radiances in C colors [e/s].
    """
    # Levels are exact with any wavelengths: the first and the last are enough.
    return scene_transfer(response, spectra, gains, math.inf).level
