"""What ISETCam goes on with: the scene, the optical image and the sensor as its structures.

`scene.mat` (variable `scene`), `irradiance.mat` (`opticalimage`) and `volts.mat` (`isa`) load with
ISETCam's vcLoadObject, or with `load`. Photons are per second, square meter and nanometer (and
steradian, in the scene), at the camera's wavelengths, in 32 bits. The scene is sampled at the
pixels' centers; its illuminant is the radiance of a perfect white.

References
----------
ISET/isetcam: sceneGet.m, oiGet.m, sensorGet.m, vcSaveObject.m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import CannotDo, bad
from vcam_cli.files.mat import LARGEST, write_mat
from vcam_cli.simulation import spectral_irradiance
from vcam_cli.simulation.frame import Frame
from vcam_cli.spectra import PLANCK, SPEED_OF_LIGHT

_PATH = ("output", "isetcam")


def check(camera: Camera) -> None:
    """Check that ISETCam's structures can hold the camera's frame, where they are written.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For scattered pixels, or unknown volts.
    """
    if not camera.output.isetcam:
        return
    if camera.array.is_scattered:
        message = "ISETCam reads only pixels in rows and columns"
        raise bad(_PATH, message, "write isetcam: false")
    if not electrical(camera).has_volts:
        message = "ISETCam's sensors hold volts, which are unknown here"
        raise bad(_PATH, message, "give pixel.readout.conversion_gain, or write isetcam: false")


def write_isetcam(
    new_file: Callable[[str], Path], frame: Frame, workers: int, step: Callable[[int, int], None]
) -> None:
    """Write the three files.

    Parameters
    ----------
    new_file : function
        What gives a path to write to for a name.
    frame : Frame
        The frame.
    workers : int
        Threads.
    step : function
        Told how many of how many planes of the optical image are done.

    Raises
    ------
    CannotDo
        Where memory or the format does not hold them.
    """
    wavelengths = spectral_irradiance.nodes(frame)
    write_mat(new_file("scene.mat"), {"scene": _scene(frame, wavelengths)})
    optical_image = _optical_image(frame, wavelengths, workers, step)
    write_mat(new_file("irradiance.mat"), {"opticalimage": optical_image})
    write_mat(new_file("volts.mat"), {"isa": _sensor(frame)})


def _scene(frame: Frame, wavelengths: Array) -> dict[str, Any]:
    g, layout = frame.geometry, frame.layout
    levels = spectral_irradiance.spectral_levels(
        frame.solved.output, frame.scene.spectra, wavelengths
    )
    planes = (
        frame.scene.values_at(layout.picture_x, layout.picture_y, level[np.newaxis])[0]
        for level in levels.T
    )
    shape = len(layout.picture_y), len(layout.picture_x)
    white = spectral_irradiance.spectral_levels(
        frame.solved.output, (frame.scene.white,), wavelengths
    )[0]
    return {
        "type": "scene",
        "name": frame.solved.name,
        "data": {"photons": _photons(planes, shape, wavelengths)},
        "spectrum": {"wave": _nanometers(wavelengths)},
        "illuminant": {
            "type": "illuminant",
            "name": "white",
            "data": {"photons": white * _per_watt(wavelengths)},
            "spectrum": {"wave": _nanometers(wavelengths)},
        },
        "distance": g.object_distance,
        "magnification": 1.0,
        "wAngular": _field_of_view(frame),
    }


def _optical_image(
    frame: Frame, wavelengths: Array, workers: int, step: Callable[[int, int], None]
) -> dict[str, Any]:
    g = frame.geometry

    def planes() -> Iterable[Array]:
        for done, plane in enumerate(spectral_irradiance.planes(frame, workers)):
            step(done, len(wavelengths))
            yield plane

    shape = frame.layout.geometry.rows, frame.layout.geometry.columns
    distance = g.object_distance
    return {
        "type": "opticalimage",
        "name": frame.solved.name,
        "data": {"photons": _photons(planes(), shape, wavelengths)},
        "spectrum": {"wave": _nanometers(wavelengths)},
        "optics": {
            "type": "optics",
            "name": frame.solved.name,
            "model": "diffractionlimited",
            "fNumber": g.f_number,
            "focalLength": g.focal_length,
        },
        "wAngular": _field_of_view(frame),
        # From it follow the distance of the image and so the spacing of its samples.
        **({"depthMap": np.full(shape, distance)} if math.isfinite(distance) else {}),
    }


def _sensor(frame: Frame) -> dict[str, Any]:
    e, g, block = frame.electrical, frame.layout.geometry, frame.mosaic.block
    volts = e.volts_of(np.asarray(frame.electrons, np.float32))
    names = np.array(frame.mosaic.colors, dtype=object)
    order = [[frame.mosaic.colors.index(color) + 1 for color in row] for row in block]
    return {
        "type": "sensor",
        "name": frame.solved.name,
        "rows": g.rows,
        "cols": g.columns,
        "data": {
            "volts": _colors_last(volts),
            "dv": _colors_last(np.asarray(frame.dn, np.float32)),
        },
        "color": {"filterNames": names},
        "cfa": {"pattern": np.array(order, np.float64)},
        "integrationTime": frame.exposure_time,
        "pixel": {
            "type": "pixel",
            "width": g.pixel_width,
            "height": g.pixel_height,
            "widthGap": g.pitch_x - g.pixel_width,
            "heightGap": g.pitch_y - g.pixel_height,
            "pdWidth": g.detector_width,
            "pdHeight": g.detector_height,
            "pdXpos": (g.pixel_width - g.detector_width) / 2 + g.detector_x,
            "pdYpos": (g.pixel_height - g.detector_height) / 2 + g.detector_y,
            "conversionGain": e.conversion_gain,
            "voltageSwing": e.full_well * e.conversion_gain,
        },
    }


def _colors_last(values: Array) -> Array:
    """Return colors behind rows and columns."""
    return np.moveaxis(values, 0, -1) if values.ndim == 3 else values


def _photons(planes: Iterable[Array], shape: tuple[int, int], wavelengths: Array) -> Array:
    """Return planes in watts per meter as photons per nanometer (rows, columns, bands)."""
    size = 4 * math.prod(shape) * len(wavelengths)
    if size > LARGEST or 2 * size > memory.available():
        message = f"{len(wavelengths)} wavelengths of {shape[0]} x {shape[1]} pixels are"
        said = f"{message} {size / 1e9:.1f} GB, more than memory or a file of MATLAB 5 holds"
        raise CannotDo(said, "write a larger scene.wavelengths.step, or a smaller array")
    found = np.empty((*shape, len(wavelengths)), np.float32, order="F")
    for band, (plane, factor) in enumerate(zip(planes, _per_watt(wavelengths), strict=True)):
        found[:, :, band] = plane * factor
    return found


def _per_watt(wavelengths: Array) -> Array:
    """Return photons per second and nanometer of a watt per meter of wavelength."""
    return np.asarray(1e-9 * wavelengths / (PLANCK * SPEED_OF_LIGHT))


def _nanometers(wavelengths: Array) -> Array:
    return np.asarray(np.round(wavelengths * 1e9, 9))


def _field_of_view(frame: Frame) -> float:
    """Return the horizontal field of view [degree]."""
    report = frame.layout.report(frame.spectrum.oversampling)
    return math.degrees(float(report["field_of_view_horizontal"]))
