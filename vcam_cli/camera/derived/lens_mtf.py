"""A lens's measured modulation transfer, read from its file."""

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad, data_file_problems
from vcam_cli.physics import diffraction
from vcam_cli.records import dataclass
from vcam_cli.spectra.text import read_rows

FREQUENCY, VALUE = "frequency_lp_per_mm", "value"
WAVELENGTH, HEIGHT = "wavelength_nm", "image_height_mm"
PATH = ("optics", "mtf", "file")
REMEDY = f"write the columns {FREQUENCY},{VALUE} (and {WAVELENGTH}, {HEIGHT} where it has them)"
LARGEST = 1.2
"""Largest value: a transfer is at most 1, but for errors of measurement."""
NOISE = 0.05
"""Largest value that a measurement may have where diffraction leaves nothing."""
SLACK = 1e-9
"""By how much the last height may miss the corner, relative: rounding."""


@dataclass(frozen=True)
class MtfCurve:
    """Modulation transfer at one wavelength and image height, straight between its points."""

    frequencies: tuple[float, ...]
    """Spatial frequencies on the sensor, rising from 0 [cycles/m]."""
    values: tuple[float, ...]
    """Modulation transfer, 1 at frequency 0."""


@dataclass(frozen=True)
class MtfAtHeight:
    """Modulation transfer at one distance from the axis."""

    height: float
    """Distance from the axis [m]."""
    wavelengths: tuple[float, ...]
    """Wavelengths of the curves, rising [m]; () where one curve is for all."""
    curves: tuple[MtfCurve, ...]


def lens_mtf(camera: CameraModel, geometry: Geometry) -> tuple[MtfAtHeight, ...]:
    """Return the table that `optics.mtf` names, by rising image height; () where it names none.

    Raises BadInput for a file that cannot be read, is no such table, ends before the corner of the
    array, or has contrast left where the lens's aperture leaves none.
    """
    given = camera.optics.mtf
    if given is None:
        return ()
    found = _table(given.file)
    corner = float(np.hypot(geometry.sensor_width, geometry.sensor_height)) / 2
    if len(found) > 1 and found[-1].height < corner * (1 - SLACK):
        raise bad(
            PATH,
            f"ends at an image height of {found[-1].height * 1e3:.6g} mm, but the corner of the"
            f" array is {corner * 1e3:.6g} mm from the axis",
            f"add rows up to {corner * 1e3:.6g} mm, or make the array smaller",
        )
    for place in found:
        _require_aperture(place, camera.scene.wavelengths.start, geometry)
    return found


def check(camera: CameraModel) -> None:
    """Raise BadInput where the modulation transfer is not to be had."""
    if camera.optics.mtf is not None:
        lens_mtf(camera, geometry(camera))


def _require_aperture(place: MtfAtHeight, shortest: float, geometry: Geometry) -> None:
    """Refuse contrast that the lens's aperture cannot leave; `shortest` wavelength in m."""
    for number, curve in enumerate(place.curves):
        wavelength = place.wavelengths[number] if place.wavelengths else shortest
        cutoff = diffraction.cutoff_frequency(wavelength, geometry.working_f_number)
        for frequency, value in zip(curve.frequencies, curve.values, strict=True):
            if frequency > cutoff and value > NOISE:
                raise bad(
                    PATH,
                    f"has a contrast of {value:g} at {frequency / 1e3:g} lp/mm, but an aperture of"
                    f" f/{geometry.f_number:g} leaves nothing from {cutoff / 1e3:.4g} lp/mm on",
                    "give the f-number it was measured at, or look for a wrong unit",
                )


def _table(file: str) -> tuple[MtfAtHeight, ...]:
    """Return the curves of a file by image height. Raises BadInput."""
    with data_file_problems(file, PATH, REMEDY):
        header, rows = read_rows(file)
        unknown = set(header) - {FREQUENCY, VALUE, WAVELENGTH, HEIGHT}
        if unknown or len(set(header)) < len(header) or not {FREQUENCY, VALUE} <= set(header):
            raise ValueError(f"{file}: the header is {','.join(header)!r}")
        if len(rows) == 0:
            raise ValueError(f"{file}: has no rows below its header")
        columns = dict(zip(header, rows.T, strict=True))
        if (columns.get(WAVELENGTH, np.ones(1)) <= 0).any():
            raise ValueError(f"{file}: a wavelength must be positive")
        heights = np.unique(columns[HEIGHT]) if HEIGHT in columns else np.zeros(1)
        if heights[0] != 0:
            raise ValueError(f"{file}: begins at {heights[0]:g} mm from the axis, not on it")
        return tuple(_at_height(file, columns, height) for height in heights.tolist())


def _at_height(file: str, columns: dict[str, Array], height: float) -> MtfAtHeight:
    here = columns[HEIGHT] == height if HEIGHT in columns else np.ones(len(columns[VALUE]), bool)
    waves = np.unique(columns[WAVELENGTH][here]).tolist() if WAVELENGTH in columns else []
    chosen = [here & (columns[WAVELENGTH] == wave) for wave in waves] or [here]
    curves = [_curve(file, columns[FREQUENCY][rows], columns[VALUE][rows]) for rows in chosen]
    return MtfAtHeight(height / 1e3, tuple(wave / 1e9 for wave in waves), tuple(curves))


def _curve(file: str, frequency: Array, value: Array) -> MtfCurve:
    """Return a curve of its rows, from 1 at frequency 0."""
    if (np.diff(frequency) <= 0).any() or frequency[0] < 0:
        raise ValueError(f"{file}: the frequencies of a curve must rise from 0")
    if (value < 0).any() or (value > LARGEST).any():
        worst = int(np.argmax((value < 0) | (value > LARGEST)))
        raise ValueError(
            f"{file}: {value[worst]:g} at {frequency[worst]:g} lp/mm; a modulation transfer is a"
            " fraction from 0 to 1"
        )
    if frequency[0] == 0:
        if value[0] == 0:
            raise ValueError(f"{file}: is 0 at frequency 0, and values are relative to it")
        value = value / value[0]
    else:
        frequency, value = np.append(0.0, frequency), np.append(1.0, value)
    if len(frequency) < 2:
        raise ValueError(f"{file}: a curve needs a frequency above 0")
    return MtfCurve(tuple((frequency * 1e3).tolist()), tuple(value.tolist()))
