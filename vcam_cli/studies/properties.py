"""What is known of a camera in closed form, without a frame: numbers, and curves.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, sections 3.2 and 3.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera import photodiode
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.detector import detector
from vcam_cli.camera.electrical import Electrical, electrical
from vcam_cli.camera.geometry import Geometry, geometry
from vcam_cli.camera.process import process
from vcam_cli.camera.study_figures import PROPERTIES, TIMED
from vcam_cli.effects.base import Effect, Gain
from vcam_cli.effects.off_axis import OffAxis
from vcam_cli.effects.pixel_vignetting import PixelVignetting
from vcam_cli.engine import optics, plan
from vcam_cli.engine.layout import layout
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.pixel_figures import pixel_figures
from vcam_cli.engine.settings import settings
from vcam_cli.engine.transfer import Transfer
from vcam_cli.errors import bad
from vcam_cli.physics import readout, vignetting
from vcam_cli.scenes import light
from vcam_cli.spectra import Spectrum
from vcam_cli.studies.closed_form import along

FREQUENCIES = 161
POSITIONS = 201
"""Points of a curve over spatial frequency, and along the diagonal of a sensor."""
NANOMETERS = 2.0
"""Between the wavelengths of a curve."""


def values(camera: Camera, names: tuple[str, ...]) -> tuple[float, ...]:
    """Properties of a camera, in the units of `PROPERTIES`; nan where it does not have one.

    Raises BadInput where one depends on an exposure time that the camera chooses by its picture.
    """
    known = _Known(camera, geometry(camera), electrical(camera))
    return tuple(float(_VALUES[name](known)) for name in names)


@dataclass(frozen=True)
class _Known:
    camera: Camera
    geometry: Geometry
    electrical: Electrical

    def noise(self, name: str) -> float:
        """A figure of signal and noise."""
        time = self.camera.exposure.longest
        if time is None:
            message = f"{name} depends on the exposure time, which this camera chooses itself"
            raise bad("exposure", message, "add set: {exposure.time: 30 ms} to the figure")
        joins = layout(self.camera, self.geometry).joining
        found = pixel_figures(self.camera, self.geometry, self.electrical, joins, time)
        return float(getattr(found, name))

    @property
    def well_capacity(self) -> float:
        joins = layout(self.camera, self.geometry).joining
        return self.electrical.full_well * joins.summed

    @property
    def dark_current_density(self) -> float:
        """[A/m2]"""
        rate = photodiode.dark_rate(self.camera)
        return rate * readout.ELEMENTARY_CHARGE / self.geometry.detector_area

    @property
    def corner_vignetting(self) -> float:
        """Share of the light that the tunnel takes in the corner of the sensor."""
        tunnel = PixelVignetting.of(self.camera, self.geometry)
        if tunnel is None:
            return math.nan
        corner = np.array([self.geometry.sensor_width]), np.array([self.geometry.sensor_height])
        return 1 - float(_through(tunnel, *(at / 2 for at in corner))[0])

    @property
    def feature_size(self) -> float:
        """[m]"""
        made = process(self.camera)
        size = None if made is None else made.feature_size
        return math.nan if size is None else size


_VALUES: dict[str, Callable[[_Known], float]] = {
    "fill_factor": lambda k: k.geometry.fill_factor,
    "effective_fill_factor": lambda k: k.geometry.effective_fill_factor,
    "photodetector_area": lambda k: k.geometry.detector_area * 1e12,
    "photodetector_perimeter": lambda k: detector(k.camera).perimeter * 1e6,
    "capacitance": lambda k: (k.electrical.capacitance or math.nan) * 1e15,
    "conversion_gain": lambda k: (
        k.electrical.conversion_gain * 1e6 if k.electrical.in_volts else math.nan
    ),
    "voltage_swing": lambda k: k.electrical.voltage_swing if k.electrical.in_volts else math.nan,
    "full_well": lambda k: k.electrical.full_well,
    "well_capacity": lambda k: k.well_capacity,
    "dark_current": lambda k: photodiode.dark_rate(k.camera),
    "dark_current_density": lambda k: k.dark_current_density * 1e5,
    "nyquist_frequency": lambda k: 0.5e-3 / k.geometry.pitch_x,
    "feature_size": lambda k: k.feature_size * 1e6,
    "corner_vignetting": lambda k: k.corner_vignetting,
    **{name: lambda k, name=name: k.noise(name) for name in TIMED},  # type: ignore[misc]
}
assert _VALUES.keys() == PROPERTIES.keys()


@dataclass(frozen=True)
class Mtf:
    """Transfer along the rows on the axis, in one color."""

    color: str
    nyquist: float
    """Of the pixels [cycles/m]."""
    system: NDArray
    """Lens, silicon and aperture; eq 2.28 of [1] and the lens's."""
    sensor: NDArray
    """Silicon and aperture alone, section 3.2.2 of [1]."""


def mtf(camera: Camera, frequency: NDArray) -> list[Mtf]:
    """Transfer of every color at frequencies (n,) [cycles/m], in the light of the scene's white.

    Raises BadInput for a scene whose light is known only by its file.
    """
    g, place = geometry(camera), layout(camera, geometry(camera))
    effects = plan.optical(camera, g)
    inside = tuple(e for e in effects if not e.in_lens)
    whole, alone = (_transfer(camera, g, place.mosaic, some) for some in (effects, inside))
    return [
        Mtf(
            name,
            0.5 / g.pitch_x,
            along(whole, effects, color, frequency, (1.0, 0.0)),
            along(alone, inside, color, frequency, (1.0, 0.0)),
        )
        for color, name in enumerate(place.mosaic.colors)
    ]


def _transfer(camera: Camera, g: Geometry, mosaic: Mosaic, effects: tuple[Effect, ...]) -> Transfer:
    white = (scene_white(camera),)
    return optics.scene_transfer(camera, g, settings(camera), white, mosaic, effects)


def scene_white(camera: Camera) -> Spectrum:
    """Radiance of the scene's white. Raises BadInput where only a file of spectra knows it."""
    if camera.scene.illuminant is None:
        message = "the light of this scene is known only by its file"
        raise bad("scene.source", message, "set a chart and an illuminant for this figure")
    return light.white_radiance(camera.scene)


def spectral_response(camera: Camera) -> tuple[NDArray, dict[str, NDArray]]:
    """Wavelengths (n,) [m] of the scene, and electrons per photon on the photodetector by color.

    Filters of the array included, the lens not; of a QE given per pixel, per photon on the pixel.
    """
    band = camera.scene.wavelengths
    count = round((band.stop - band.start) * 1e9 / NANOMETERS) + 1
    wavelength = np.linspace(band.start, band.stop, max(count, 2))
    silicon = photodiode.quantum_efficiency(camera)
    out = {}
    for color in layout(camera, geometry(camera)).mosaic.colors:
        spec = camera.array.filters.get(color)
        seen = silicon if spec is None else silicon.times(spec.resolve())
        out[color] = np.asarray(seen.at(wavelength))
    return wavelength, out


@dataclass(frozen=True)
class Diagonal:
    """Along the diagonal of the sensor."""

    position: NDArray
    """From the center, negative to the upper left [m]."""
    vignetting: NDArray
    """What the tunnel above a photodetector lets through, over one without; 1 where there is no
    stack of layers."""
    falloff: NDArray
    """Light on the sensor over that on the axis; 1 where there is none."""

    @property
    def relative(self) -> NDArray:
        """Of the tunnel, over the axis."""
        return self.vignetting / self.vignetting[len(self.vignetting) // 2]

    @property
    def signal(self) -> NDArray:
        """Of both, over the axis."""
        return self.relative * self.falloff


def varying_gains(camera: Camera) -> tuple[PixelVignetting | None, Gain | None]:
    """The tunnel above its photodetectors and the falloff of its lens, each where it has one.

    Raises BadInput where it has neither.
    """
    gains = [e for e in plan.wanted(camera, geometry(camera)) if isinstance(e, Gain)]
    tunnel = next((e for e in gains if isinstance(e, PixelVignetting)), None)
    falloff = next((e for e in gains if e.name == OffAxis.name), None)
    if tunnel is None and falloff is None:
        message = "neither a stack above the pixels nor a falloff is there: all collect alike"
        raise bad("pixel.stack", message, "name a case that has one, or set pixel.stack")
    return tunnel, falloff


def diagonal(camera: Camera) -> Diagonal:
    """What is collected along the diagonal. Raises BadInput where it is the same everywhere."""
    g = geometry(camera)
    tunnel, falloff = varying_gains(camera)
    part = np.linspace(-1, 1, POSITIONS)
    x, y = part * g.sensor_width / 2, part * g.sensor_height / 2
    ones = np.ones(POSITIONS)
    return Diagonal(
        part * math.hypot(g.sensor_width, g.sensor_height) / 2,
        ones if tunnel is None else _through(tunnel, x, y),
        ones if falloff is None else np.diagonal(falloff.gain(x, y)) / falloff.on_axis,
    )


def _through(tunnel: PixelVignetting, x: NDArray, y: NDArray) -> NDArray:
    """The share of the light that meets the photodetector, of all that passes the layers."""
    share = np.asarray(tunnel.at(x, y), float)
    straight = float(vignetting.stack_transmission(1.0, tunnel.layers))
    return share / straight if tunnel.internal else share
