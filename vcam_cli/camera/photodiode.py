"""The photodiode of a pixel: what light it collects, what heat adds, where its charge wanders.

What the file gives as a number is used as it is. The rest follows from the process: one geometry
of depths for everything that says `junction` (or leaves it to the technology).

The kinds of photodetector differ only in what follows from the junction: an n-well is deeper and
less doped (`process`); a photogate has a film above it and no n region; the surface layer of a
pinned diode collects nothing and keeps its surface dark.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[2] J. R. Janesick, "Scientific Charge-Coupled Devices", SPIE Press, 2001, section 7.1.1 (dark
    current and temperature).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.detector import detector
from vcam_cli.camera.once import once
from vcam_cli.camera.photodetector import ChargeDiffusion, DarkCurrentDensity
from vcam_cli.camera.process import process, require
from vcam_cli.camera.sense_node import area_capacitance, capacitance
from vcam_cli.errors import BadInput, Collector, bad, split
from vcam_cli.physics import photodiode as physics
from vcam_cli.physics import readout, silicon
from vcam_cli.spectra import Spectrum

MOST_DOUBLINGS = 60
"""The rule of a doubling every few kelvin holds over some tens of them, not over hundreds."""
DOUBLING = 8.0
"""Rise of temperature that doubles a dark current where the technology does not say [K]."""
ABSORPTION_TEMPERATURE = 300.0
"""At which silicon absorbs as tabulated [K]."""
_STEP = 0.25e-9
"""Between the wavelengths of a QE that follows from the junction [m]: straight lines between them
are within 6e-5 of the curve, relatively."""
_HERE = "pixel.photodetector"


@dataclass(frozen=True)
class Depths:
    """Of the junction, from the surface of the silicon [m]."""

    x1: float
    """Upper edge of the depletion region."""
    x2: float
    """Its lower edge."""
    x3: float
    """Where electrons are lost to the bottom."""


@dataclass(frozen=True)
class Diffusion:
    """What decides how far charge wanders [m]."""

    diffusion_length: float
    depletion_width: float
    neutral_depth: float


@dataclass(frozen=True)
class Photodiode:
    """All that follows from the file and its technology."""

    quantum_efficiency: Spectrum
    """Electrons per photon on the photodetector; on the pixel where the file says `pixel`."""
    capacitance: float | None
    """[F]; None where the conversion gain says it."""
    dark_rate: float
    """Electrons that heat makes in a pixel [e/s]."""
    depths: Depths | None
    """None where nothing asks for them."""
    diffusion: Diffusion | None
    """None where the file asks for no diffusion of charge."""


@once
def photodiode(camera: Camera) -> Photodiode:
    """The photodiode of `camera`. Raises BadInput where numbers are missing or impossible."""
    return Photodiode(
        quantum_efficiency=quantum_efficiency(camera),
        capacitance=capacitance(camera),
        dark_rate=dark_rate(camera),
        depths=_depths(camera, _HERE, "the photodiode") if _asks_depths(camera) else None,
        diffusion=diffusion(camera),
    )


def check(camera: Camera) -> None:
    """Raises BadInput with all that keeps the photodiode from following from its process."""
    problems = Collector()
    parts = (capacitance, dark_rate, diffusion, *((quantum_efficiency,) * _asks_depths(camera)))
    for part in parts:
        try:
            part(camera)
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()


def remarks(camera: Camera) -> tuple[str, ...]:
    """What a user should know of the models used."""
    own, kelvin = camera.pixel.photodetector, camera.pixel.temperature
    asked = own.quantum_efficiency.given is None or own.charge_diffusion is not None
    if not asked or kelvin == ABSORPTION_TEMPERATURE:
        return ()
    return (
        f"silicon absorbs light as at {ABSORPTION_TEMPERATURE:g} K here, though the pixel is at"
        f" {kelvin:g} K",
    )


def quantum_efficiency(camera: Camera) -> Spectrum:
    """The QE that the file gives, else that of the junction, eq 2.30 of [1].

    The latter is internal: times the technology's scale for reflection and stack, unless the camera
    gives a stack, whose transmission is then computed.
    """
    at = f"{_HERE}.quantum_efficiency"
    own = camera.pixel.photodetector
    if own.quantum_efficiency.given is not None:
        return own.quantum_efficiency.given.resolve(
            split(f"{at}.pixel" if own.quantum_efficiency.per_pixel else at)
        )
    what = "the quantum efficiency of the junction"
    x = _depths(camera, at, what)
    low, high = silicon.ABSORPTION_RANGE
    wavelength = np.linspace(low, high, round((high - low) / _STEP) + 1)
    absorption = silicon.absorption(wavelength)
    if own.kind == "photogate":
        (film,) = require(camera, at, what, "gate.thickness")
        value = physics.quantum_efficiency_photogate(absorption, film, x.x2, x.x3)
    elif own.kind == "pinned":
        value = physics.quantum_efficiency_pinned(absorption, x.x1, x.x2, x.x3)
    else:
        value = physics.quantum_efficiency(absorption, x.x1, x.x2, x.x3)
    made = process(camera)
    scale = made.quantum_efficiency_scale if made is not None and not camera.pixel.stack else None
    return Spectrum.sampled(wavelength, value).scaled(1.0 if scale is None else scale)


def dark_rate(camera: Camera) -> float:
    """Dark current of a pixel at its temperature [e/s].

    As the file gives it; `junction` = eq 2.31 of [1] and what the technology adds along the
    perimeter; where the file says nothing the technology's terms per area and per perimeter.
    """
    own = camera.pixel.photodetector
    if own.dark_current is not None:
        return own.dark_current * own.dark_current_scale
    given = own.dark_current_density
    if isinstance(given, DarkCurrentDensity):
        at = f"{_HERE}.dark_current_density"
        growth = _growth(camera, given.temperature, given.doubling, at)
        current = given.value * growth * detector(camera).area
    elif given == "junction":
        current = _junction_density(camera) * detector(camera).area + _perimeter_current(camera)
    else:
        current = _area_current(camera) + _perimeter_current(camera)
    return current / readout.ELEMENTARY_CHARGE * own.dark_current_scale


@once
def diffusion(camera: Camera) -> Diffusion | None:
    """The lengths that decide the diffusion of charge, where the file asks for it."""
    at = f"{_HERE}.charge_diffusion"
    given = camera.pixel.photodetector.charge_diffusion
    if given is None:
        return None
    if isinstance(given, ChargeDiffusion):
        return Diffusion(given.diffusion_length, given.depletion_width, given.substrate_depth)
    what = "the diffusion of charge"
    keys = ("diffusion_length", "depletion_width", "substrate_depth")
    length, width, depth = require(camera, at, what, *(f"junction.{key}" for key in keys))
    return Diffusion(length, _depletion_width(camera, width, at, what), depth)


def _asks_depths(camera: Camera) -> bool:
    own = camera.pixel.photodetector
    return own.quantum_efficiency.given is None or own.dark_current_density == "junction"


def _depths(camera: Camera, at: str, what: str) -> Depths:
    """The junction's depths; a photogate's begin at the surface of the silicon."""
    gated = camera.pixel.photodetector.kind == "photogate"
    keys = ("junction.depletion_width", "junction.substrate_depth", "junction.depth")
    given, neutral, *depth = require(camera, at, what, *keys[: 2 if gated else 3])
    width = _depletion_width(camera, given, at, what)
    x1 = sum(depth)
    return Depths(x1, x1 + width, x1 + width + neutral)


def _depletion_width(camera: Camera, given: float | str, at: str, what: str) -> float:
    """As given, or permittivity over the junction's mean capacitance per area [m]."""
    if isinstance(given, float):
        return given
    per_area = area_capacitance(camera, at, what)
    if per_area <= 0:
        raise bad(
            at,
            "a junction without capacitance per area has a depletion region without end",
            "give junction.depletion_width, or the technology's capacitance.area",
        )
    return float(physics.depletion_width(per_area))


def _junction_density(camera: Camera) -> float:
    """Dark current density by eq 2.31 of [1] at the pixel's temperature [A/m2]."""
    at, what = f"{_HERE}.dark_current_density", "the dark current of the junction"
    names = "acceptors electron_diffusivity electron_lifetime substrate_depth depletion_width"
    gated = camera.pixel.photodetector.kind == "photogate"
    if not gated:
        names += " donors hole_diffusivity hole_lifetime depth"
    keys = (f"junction.{name}" for name in names.split())
    n_a, d_n, tau_n, neutral, given, *n_side = require(camera, at, what, *keys)
    width = _depletion_width(camera, given, at, what)
    if gated:  # no n region: no diffusion from it, and all of the depletion region in p
        n_d, d_p, tau_p, surface, x_n, x_p = 1.0, 0.0, 1.0, 1.0, 0.0, width
    else:
        n_d, d_p, tau_p, surface = n_side
        x_n, x_p = (float(part) for part in physics.depletion_split(width, n_d, n_a))
    n_i = _intrinsic(camera.pixel.temperature)
    return float(
        physics.dark_current_density(
            n_i, d_p, d_n, n_d, n_a, surface, neutral, x_n, x_p, tau_p, tau_n
        )
    )


def _intrinsic(temperature: float) -> float:
    try:
        return float(silicon.intrinsic_concentration(temperature))
    except ValueError as error:
        raise bad(
            "pixel.temperature",
            f"{error}, not at {temperature:g} K",
            "change it, or give the dark current as a number",
        ) from None


def _area_current(camera: Camera) -> float:
    """What the technology says of the photodetector's area [A]."""
    made = process(camera)
    if made is None or not made.dark_current.area:
        return 0.0
    return made.dark_current.area * _technology_growth(camera) * detector(camera).area


def _perimeter_current(camera: Camera) -> float:
    """What the technology says of its perimeter [A]: none where the surface is pinned."""
    pinned = camera.pixel.photodetector.kind == "pinned" or camera.pixel.architecture == "aps-4t"
    made = process(camera)
    if pinned or made is None or not made.dark_current.perimeter:
        return 0.0
    return made.dark_current.perimeter * _technology_growth(camera) * detector(camera).perimeter


def _technology_growth(camera: Camera) -> float:
    made = process(camera)
    assert made is not None
    doubling = made.dark_current.doubling or DOUBLING
    return _growth(camera, made.dark_current.temperature, doubling, "pixel.technology.dark_current")


def _growth(camera: Camera, temperature: float | None, doubling: float, at: str) -> float:
    """Factor on a dark current from `temperature` [K] to the pixel's, [2]; 1 where it is None."""
    if temperature is None:
        return 1.0
    doublings = (camera.pixel.temperature - temperature) / doubling
    if abs(doublings) > MOST_DOUBLINGS:
        raise bad(
            at,
            f"from {temperature:g} K to {camera.pixel.temperature:g} K it doubles"
            f" {doublings:.3g} times",
            "give it at a temperature nearer to the pixel's, or another doubling",
        )
    return float(2**doublings)
