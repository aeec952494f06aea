"""The electrons per photon of a camera's pixels, from its lens, filters and silicon."""

from __future__ import annotations

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.camera.derived.photodiode import quantum_efficiency
from vcam_cli.image_formation.pixel_response import PixelResponse
from vcam_cli.spectra import Spectrum


def responses(camera: Camera, mosaic: Mosaic) -> tuple[Spectrum, ...]:
    """Return the electrons per photon of each color: transmittance x filter x QE.

    Parameters
    ----------
    camera : Camera
        The camera.
    mosaic : Mosaic
        Colors of the pixels.

    Returns
    -------
    tuple of Spectrum
        Spectra without unit, one for each color.
    """
    common = (camera.optics.transmittance.resolve(), quantum_efficiency(camera))
    out = []
    for color in mosaic.colors:
        spec = camera.array.filters.get(color)
        filters = () if spec is None else (spec.resolve(),)
        out.append(common[0].multiply(common[1], *filters))
    return tuple(out)


def pixel_response(camera: Camera, geometry: Geometry, mosaic: Mosaic) -> PixelResponse:
    """Return what the pixels on the axis make of radiance.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Its geometry.
    mosaic : Mosaic
        Colors of the pixels.

    Returns
    -------
    PixelResponse
        Response in every color.
    """
    area = geometry.detector_area
    if camera.pixel.photodetector.quantum_efficiency.per_pixel:
        area = geometry.pixel_width * geometry.pixel_height
    band = camera.scene.wavelengths
    return PixelResponse(
        responses(camera, mosaic), geometry.irradiance_per_radiance, area, band.start, band.stop
    )
