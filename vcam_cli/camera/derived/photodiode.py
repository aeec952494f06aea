"""The photodiode of a pixel: what light it collects, and how far its charge wanders.

What the file gives as a number is used as it is. The rest follows from the process: one geometry
of depths for everything that says `junction` (or leaves it to the technology).

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.camera.derived.dark_current import DOUBLING, dark_rate, junction_parts
from vcam_cli.camera.derived.junction import depletion_width, depths
from vcam_cli.camera.derived.process import Need, process
from vcam_cli.camera.derived.sense_node import capacitance
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.photodetector import ChargeDiffusion
from vcam_cli.errors import Collector, split
from vcam_cli.physics import photodiode as physics
from vcam_cli.physics import silicon
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum

ABSORPTION_TEMPERATURE = 300.0
"""Temperature of the table of silicon's absorption [K]."""
MOST_DARK_CURRENT = 10e-5
"""Dark current of photodiodes whose surface is depleted, at most, as data sheets have it [A/m2]."""
USUAL_DARK_CURRENT = {"pinned": 1e-5}
"""The same of kinds whose surface is shielded [A/m2]."""
ROOM_TEMPERATURE = 300.0
"""Temperature of these [K]."""
_STEP = 0.25e-9
"""Step of the wavelengths of a QE that follows from the junction [m]: straight lines between them
are within 6e-5 of the curve, relatively."""
_EFFICIENCY = "pixel.photodetector.quantum_efficiency"


@dataclass(frozen=True)
class Diffusion:
    """Lengths that decide how far charge wanders [m]."""

    diffusion_length: float
    depletion_width: float
    neutral_depth: float


def check(camera: CameraModel) -> None:
    """Raise BadInput with all that keeps the photodiode from following from its process."""
    problems = Collector()
    for part in (capacitance, dark_rate, diffusion):
        problems.attempt(part, camera)
    own = camera.pixel.photodetector
    if own.quantum_efficiency.given is None or own.dark_current_density == "junction":
        problems.attempt(quantum_efficiency, camera)
    problems.raise_if_any()


def remarks(camera: CameraModel) -> tuple[str, ...]:
    """Return what a user should know of the models used."""
    own, kelvin = camera.pixel.photodetector, camera.pixel.temperature
    notes = _unusual_dark_current(camera)
    asked = own.quantum_efficiency.given is None or own.charge_diffusion is not None
    if not asked or kelvin == ABSORPTION_TEMPERATURE:
        return notes
    return (
        *notes,
        f"silicon absorbs light as at {ABSORPTION_TEMPERATURE:g} K here, though the pixel is at"
        f" {kelvin:g} K",
    )


def _unusual_dark_current(camera: CameraModel) -> tuple[str, ...]:
    """Return that the junction's dark current is more than such photodiodes are sold with."""
    own = camera.pixel.photodetector
    if own.dark_current is not None or own.dark_current_density != "junction":
        return ()
    usual = USUAL_DARK_CURRENT.get(own.kind, MOST_DARK_CURRENT)
    density = own.dark_current_scale * sum(junction_parts(camera, process(camera)))
    cooler = 2 ** ((camera.pixel.temperature - ROOM_TEMPERATURE) / DOUBLING)
    if density <= usual * max(cooler, 1):
        return ()
    return (
        f"the equation of the junction gives {1e5 * density:.4g} nA/cm2 of dark current, and"
        f" photodetectors of the kind {own.kind} have mostly less than {1e5 * usual:.2g} nA/cm2 at"
        f" {ROOM_TEMPERATURE:.0f} K: the junction's lifetimes may belong to another process;"
        " give a measured dark_current_density as a number",
    )


def quantum_efficiency(camera: CameraModel) -> Spectrum:
    """Return the electrons per photon that the file gives, else those of the junction.

    The latter, eq 2.30 of [1], is internal: times the technology's scale for reflection and stack,
    unless the camera gives a stack, whose transmission is then computed.

    Raises BadInput for a spectrum that is not to be had, and numbers of the process that are
    missing.
    """
    own = camera.pixel.photodetector
    given = own.quantum_efficiency
    if given.given is not None:
        return given.given.resolve(
            split(f"{_EFFICIENCY}.pixel" if given.per_pixel else _EFFICIENCY)
        )
    need = Need(_EFFICIENCY, "the quantum efficiency of the junction")
    made, x = process(camera), depths(camera, need)
    low, high = silicon.ABSORPTION_RANGE
    wavelength = np.linspace(low, high, round((high - low) / _STEP) + 1)
    absorption = silicon.absorption(wavelength)
    if own.kind == "photogate":
        (film,) = made.require(need, "gate.thickness")
        value = physics.quantum_efficiency_photogate(absorption, film, x.x2, x.x3)
    elif own.kind == "pinned":
        value = physics.quantum_efficiency_pinned(absorption, x.x1, x.x2, x.x3)
    else:
        value = physics.quantum_efficiency(absorption, x.x1, x.x2, x.x3)
    scale = None if camera.pixel.stack else made.quantum_efficiency_scale
    return Spectrum.from_samples(wavelength, value).scale_by(1.0 if scale is None else scale)


def diffusion(camera: CameraModel) -> Diffusion | None:
    """Return the lengths that decide the diffusion of charge, where the file requests it.

    Raises BadInput for numbers of the process that are missing.
    """
    given = camera.pixel.photodetector.charge_diffusion
    if given is None:
        return None
    if isinstance(given, ChargeDiffusion):
        return Diffusion(given.diffusion_length, given.depletion_width, given.substrate_depth)
    made, need = (
        process(camera),
        Need("pixel.photodetector.charge_diffusion", "the diffusion of charge"),
    )
    keys = ("diffusion_length", "depletion_width", "substrate_depth")
    length, width, depth = made.require(need, *(f"junction.{key}" for key in keys))
    return Diffusion(length, depletion_width(camera, made, width, need), depth)
