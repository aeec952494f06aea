"""What follows from a camera's description in closed form, without a frame: numbers and curves.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, sections 3.2 and 3.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import photodiode
from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import process
from vcam_cli.characterization.closed_form import directional_mtf, sharing_mtf
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.optics.off_axis import OffAxis
from vcam_cli.effects.pixel.pixel_vignetting import PixelVignetting
from vcam_cli.effects.pixel_signal import Gain, NeighborSharing
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import bad
from vcam_cli.image_formation.neighbor_sharing import array_sharing
from vcam_cli.image_formation.pixel_response import scene_transfer
from vcam_cli.physics import readout, vignetting
from vcam_cli.records import dataclass
from vcam_cli.scenes import light
from vcam_cli.simulation.pixel_figures import pixel_figures
from vcam_cli.solve.effects import camera_effects
from vcam_cli.solve.layout import camera_layout
from vcam_cli.solve.solved import solve
from vcam_cli.sweeps.quantities import FREQUENCY, POSITION, PROPERTIES, WAVELENGTH

FREQUENCIES = 161
POSITIONS = 201
"""Points of a curve over spatial frequency, and along the diagonal of a sensor."""
WAVELENGTH_STEP = 2.0
"""Step of a curve over wavelength [nm]."""


def value(camera: Camera, name: str) -> float:
    """Return a property of a camera in the unit of `PROPERTIES`; nan where it does not have it.

    Raises BadInput where it depends on an exposure time that the camera chooses by its picture.
    """
    return float(_VALUES[name](camera, geometry(camera)))


def _scale(value: float | None, factor: float) -> float:
    return math.nan if value is None else value * factor


def _voltage(camera: Camera, name: str, factor: float) -> float:
    """Return a figure of the circuit, nan where the camera only counts electrons."""
    circuit = electrical(camera)
    return _scale(getattr(circuit, name) if circuit.has_volts else None, factor)


def _feature_size(camera: Camera) -> float | None:
    technology = process(camera)
    return None if technology is None else technology.feature_size


def _corner_vignetting(camera: Camera, g: Geometry) -> float:
    """Return the share of the light that the tunnel takes in the corner of the sensor."""
    tunnel = PixelVignetting.from_camera(camera, g)
    if tunnel is None:
        return math.nan
    corner = np.array([g.sensor_width / 2]), np.array([g.sensor_height / 2])
    return 1 - float(_tunnel_transmission(tunnel, *corner)[0])


def _pixel_figure(name: str) -> Callable[[Camera, Geometry], float]:
    """Return what computes a figure of signal and noise, eqs 3.1 and 3.2 of [1]."""

    def value(camera: Camera, _: Geometry) -> float:
        time = camera.exposure.longest
        if time is None:
            message = f"{name} depends on the exposure time, which this camera chooses itself"
            raise bad("exposure", message, "add set: {exposure.time: 30 ms}")
        return float(getattr(pixel_figures(solve(camera), time), name))

    return value


_VALUES: dict[str, Callable[[Camera, Geometry], float]] = {
    "fill_factor": lambda _, g: g.fill_factor,
    "effective_fill_factor": lambda _, g: g.effective_fill_factor,
    "photodetector_area": lambda _, g: g.detector_area * 1e12,
    "photodetector_perimeter": lambda camera, _: detector(camera).perimeter * 1e6,
    "capacitance": lambda camera, _: _scale(electrical(camera).capacitance, 1e15),
    "conversion_gain": lambda camera, _: _voltage(camera, "conversion_gain", 1e6),
    "voltage_swing": lambda camera, _: _voltage(camera, "voltage_swing", 1.0),
    "full_well": lambda camera, _: electrical(camera).full_well,
    "well_capacity": lambda camera, g: (
        electrical(camera).full_well * camera_layout(camera, g).binning_groups.summed_codes
    ),
    "dark_current": lambda camera, _: dark_rate(camera),
    "dark_current_density": lambda camera, g: (
        dark_rate(camera) * readout.ELEMENTARY_CHARGE / g.detector_area * 1e5
    ),
    "nyquist_frequency": lambda _, g: 0.5e-3 / g.pitch_x,
    "feature_size": lambda camera, _: _scale(_feature_size(camera), 1e6),
    "corner_vignetting": _corner_vignetting,
    "dynamic_range_db": _pixel_figure("dynamic_range_db"),
    "snr_db": _pixel_figure("snr_db"),
}
assert _VALUES.keys() == PROPERTIES.keys()


@dataclass(frozen=True)
class Curves:
    """Curves of a camera over one quantity, of one color of its pixels."""

    color: str
    """"" where the color does not matter."""
    x: dict[str, Array]
    """Abscissa by column, and what else it may be counted in."""
    y: dict[str, Array]
    """Values by the name of the quantity."""


def curves(camera: Camera, abscissa: str, nyquist: float) -> tuple[Curves, ...]:
    """Return all curves of a camera over a spatial frequency, a wavelength or a position.

    nyquist: the largest spatial frequency [lp/mm]. Raises BadInput where the camera has none.
    """
    if abscissa == FREQUENCY:
        return tuple(_mtf(camera, nyquist))
    if abscissa == WAVELENGTH:
        return tuple(_quantum_efficiency(camera))
    return tuple(_diagonal_curves(camera))


def _mtf(camera: Camera, nyquist: float) -> list[Curves]:
    """Return the transfer along the rows on the axis, in the light of the scene's white.

    There is that of the system, eq 2.28 of [1], and that of silicon and aperture, section 3.2.2.
    """
    if camera.scene.illuminant is None:
        message = "the light level of this scene is only in its file"
        raise bad("scene.source", message, "set a chart and an illuminant for this figure")
    solved, frequency = solve(camera), np.linspace(0, nyquist * 1e3, FREQUENCIES)
    mosaic, white = solved.layout.mosaic, (light.white_radiance(camera.scene),)

    def transfer(effects: tuple[Effect, ...]) -> list[Array]:
        step = solved.settings.wavelength_step
        found = scene_transfer(solved.response, white, effects, step)
        level = found.level[0]
        sharing = array_sharing(
            *(of_kind(effects, NeighborSharing), solved.response, white[0]),
            *(mosaic, solved.layout.planes),
        )
        curves = []
        for color in range(len(mosaic.colors)):
            own = directional_mtf(found, effects, color, frequency, (1.0, 0.0))
            if sharing is not None:
                own *= sharing_mtf(sharing, solved.geometry, color, level, frequency, (1.0, 0.0))
            curves.append(own)
        return curves

    effects = solved.effects.mean_signal
    both = transfer(effects), transfer(tuple(e for e in effects if e.origin != "lens"))
    x = {FREQUENCY: frequency / 1e3, "of_nyquist": frequency / (nyquist * 1e3)}
    return [
        Curves(color, x, {"system_mtf": system, "sensor_mtf": sensor})
        for color, system, sensor in zip(mosaic.colors, *both, strict=True)
    ]


def _quantum_efficiency(camera: Camera) -> list[Curves]:
    """Return electrons per photon on the photodetector, behind the array's filters.

    A quantum efficiency that is given per pixel is that of photons on the pixel.
    """
    band = camera.scene.wavelengths
    count = round((band.stop - band.start) * 1e9 / WAVELENGTH_STEP) + 1
    wavelength = np.linspace(band.start, band.stop, max(count, 2))
    silicon = photodiode.quantum_efficiency(camera)
    found = []
    for color in camera_layout(camera, geometry(camera)).mosaic.colors:
        spec = camera.array.filters.get(color)
        response = silicon if spec is None else silicon.multiply(spec.resolve())
        values = {"quantum_efficiency": np.asarray(response.evaluate(wavelength))}
        found.append(Curves(color, {WAVELENGTH: np.round(wavelength * 1e9, 6)}, values))
    return found


def _diagonal_curves(camera: Camera) -> Iterator[Curves]:
    """Yield what pixels along the diagonal collect, positions positive to the lower right.

    Raises BadInput where all pixels collect alike.
    """
    g = geometry(camera)
    gains = of_kind(camera_effects(camera, g).enabled, Gain)
    tunnel = next(iter(of_kind(gains, PixelVignetting)), None)
    falloff = next((e for e in gains if e.name == OffAxis.name), None)
    if tunnel is None and falloff is None:
        message = (
            "needs a stack above the pixels or a lens falloff: here all pixels collect equally"
        )
        raise bad("pixel.stack", message, "name a case that has one, or set pixel.stack")
    part, ones = np.linspace(-1, 1, POSITIONS), np.ones(POSITIONS)
    x, y = part * g.sensor_width / 2, part * g.sensor_height / 2
    efficiency = ones if tunnel is None else _tunnel_transmission(tunnel, x, y)
    relative = efficiency / efficiency[POSITIONS // 2]
    position = part * math.hypot(g.sensor_width, g.sensor_height) / 2
    colors = camera_layout(camera, g).mosaic.colors
    for color in colors[: 1 if falloff is None or falloff.is_neutral else None]:
        illumination = ones
        if falloff is not None:
            illumination = np.diagonal(falloff.of_color(color).gain(x, y)) / falloff.on_axis
        yield Curves(
            "" if falloff is None or falloff.is_neutral else color,
            {POSITION: position * 1e3},
            {
                "relative_qe": relative,
                "qe_over_no_vignetting": efficiency,
                "lens_falloff": illumination,
                "relative_signal": relative * illumination,
            },
        )


def _tunnel_transmission(tunnel: PixelVignetting, x: Array, y: Array) -> Array:
    """Return the share of the light behind the layers that meets the photodetector."""
    share = np.asarray(tunnel.exact_gain(x, y), float)
    straight = float(vignetting.stack_transmission(1.0, tunnel.layers))
    return share / straight if tunnel.internal else share
