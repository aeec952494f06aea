"""The dark current of a pixel: as the file gives it, or from its process.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[2] J. R. Janesick, "Scientific Charge-Coupled Devices", SPIE Press, 2001, section 7.1.1 (dark
    current and temperature).
[3] S. M. Sze, K. K. Ng, "Physics of Semiconductor Devices", 3rd edition, Wiley, 2007, section 2.2.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from vcam_cli.camera.derived import sense_node
from vcam_cli.camera.derived.charge_storage import TRANSFERRED
from vcam_cli.camera.derived.junction import depletion_width
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.photodetector import DarkCurrentDensity
from vcam_cli.errors import bad
from vcam_cli.physics import junction as physics
from vcam_cli.physics import readout, silicon

STEPS = 65
"""Biases, and depths of the depletion region, over which the effect of the field is averaged."""
FIELD_TEMPERATURE = 300.0
"""At which tunneling by traps is taken [K]; it changes little over tens of kelvins."""
MOST_DOUBLINGS = 60
"""The rule of a doubling every few kelvin holds over some tens of them, not over hundreds."""
DOUBLING = 8.0
"""Rise of temperature that doubles a dark current where the technology does not say [K]."""
_PATH = "pixel.photodetector.dark_current_density"
_TECHNOLOGY = "pixel.technology.dark_current"


def dark_rate(camera: CameraModel) -> float:
    """Return the dark current of a pixel at its temperature [e/s].

    It is what the file gives; `junction` is eq 2.31 of [1] and what the technology adds along the
    perimeter; where the file says nothing, the technology's terms per area and per perimeter.

    Raises BadInput for numbers of the process that are missing, and temperatures too far apart.
    """
    own = camera.pixel.photodetector
    if (pixel := own.dark_current) is not None:
        path = "pixel.photodetector.dark_current"
        growth = _growth(camera, pixel.temperature, pixel.doubling, path)
        return pixel.value * growth * own.dark_current_scale
    given, made = own.dark_current_density, process(camera)
    per_length = 0.0
    if isinstance(given, DarkCurrentDensity):
        per_area = given.value * _growth(camera, given.temperature, given.doubling, _PATH)
    else:
        junction = given == "junction"
        density = made.dark_current.area
        per_area = (
            _junction_density(camera, made)
            if junction
            else _density_at_temperature(camera, made, density)
        )
        if own.kind != "pinned" and camera.pixel.architecture != "aps-4t":
            density = edge_density(camera, made)
            per_length = _density_at_temperature(camera, made, density)
    if not per_area and not per_length:
        return 0.0
    size = detector(camera)
    current = per_area * size.area + per_length * size.perimeter
    return current / readout.ELEMENTARY_CHARGE * own.dark_current_scale


def edge_density(camera: CameraModel, made: Process) -> float | None:
    """Return the technology's dark current along the perimeter [A/m]; None where it gives none.

    `geometry` takes the wall of the junction for silicon like that below it: the density per area,
    over the junction's depth and its depletion region, which is as wide sideways as downward. A
    photogate has no junction to go down to. Raises BadInput where numbers are missing.
    """
    given = made.dark_current.perimeter
    if given != "geometry":
        return given
    need = Need(f"{_TECHNOLOGY}.perimeter", "the dark current of the perimeter from geometry")
    keys = ("dark_current.area", "junction.depletion_width", "junction.depth")
    gated = camera.pixel.photodetector.kind == "photogate"
    density, width, *depth = made.require(need, *keys[: 2 if gated else 3])
    return float(density * (sum(depth) + depletion_width(camera, made, width, need)))


def _junction_density(camera: CameraModel, made: Process) -> float:
    """Return the dark current density by eq 2.31 of [1] at the pixel's temperature [A/m2]."""
    return sum(junction_parts(camera, made))


def junction_parts(camera: CameraModel, made: Process) -> tuple[float, float, float]:
    """Return the terms of eq 2.31 of [1] at the pixel's temperature [A/m2].

    They are diffusion from the n region, generation in the depletion region, diffusion from the p
    region. Raises BadInput where numbers are missing.
    """
    need = Need(_PATH, "the dark current of the junction")
    names = "acceptors electron_diffusivity electron_lifetime substrate_depth depletion_width"
    gated = camera.pixel.photodetector.kind == "photogate"
    if not gated:
        names += " donors hole_diffusivity hole_lifetime depth"
    keys = (f"junction.{name}" for name in names.split())
    n_a, d_n, tau_n, neutral, given, *n_side = made.require(need, *keys)
    width = depletion_width(camera, made, given, need)
    if gated:  # no n region: no diffusion from it, and all of the depletion region in p
        n_d, d_p, tau_p, surface, x_n, x_p = 1.0, 0.0, 1.0, 1.0, 0.0, width
    else:
        n_d, d_p, tau_p, surface = n_side
        x_n, x_p = (float(part) for part in physics.depletion_split(width, n_d, n_a))
    n_i = _intrinsic(camera.pixel.temperature)
    numbers = (n_i, d_p, d_n, n_d, n_a, surface, neutral, x_n, x_p, tau_p, tau_n)
    holes, generation, electrons = physics.dark_current_parts(*numbers)
    if made.junction.tunneling == "traps" and camera.pixel.photodetector.kind not in TRANSFERRED:
        generation = generation * field_factor(camera, made, need)
    return float(holes), float(generation), float(electrons)


def highest_field(camera: CameraModel, made: Process, need: Need, bias: float) -> float:
    """Return the highest field of an abrupt junction of the measured capacitance [V/m], [3].

    It is 2 (V + phi) / W at a reverse bias [V]. Raises BadInput where numbers are missing.
    """
    (zero, built_in, grading), _ = sense_node.junction_capacitances(camera, made, need)[0]
    per_area = float(physics.capacitance(zero, bias, built_in, grading)) / detector(camera).area
    return 2 * (bias + built_in) / float(physics.depletion_width(per_area))


def field_factor(camera: CameraModel, made: Process, need: Need) -> float:
    """Return by how much tunneling by traps raises the generation, over the swing and the region.

    In an abrupt junction the field falls straight from its highest value to 0.
    """
    biases = np.linspace(*sense_node.bias_range(camera, made, need), STEPS)
    highest = np.array([highest_field(camera, made, need, float(bias)) for bias in biases])
    within = (np.arange(STEPS) + 0.5) / STEPS
    return float(physics.field_enhancement(np.outer(highest, within), FIELD_TEMPERATURE).mean())


def _intrinsic(temperature: float) -> float:
    try:
        return float(silicon.intrinsic_concentration(temperature))
    except ValueError as error:
        raise bad(
            "pixel.temperature",
            f"{error}, not at {temperature:g} K",
            "change it, or give the dark current as a number",
        ) from None


def _density_at_temperature(camera: CameraModel, made: Process, density: float | None) -> float:
    """Return a current density of the technology at the pixel's temperature; 0 where none is."""
    if not density:
        return 0.0
    given = made.dark_current
    doubling = given.doubling or DOUBLING
    return density * _growth(camera, given.temperature, doubling, _TECHNOLOGY)


def _growth(
    camera: CameraModel, given_at: float | None, doubling: float | Literal["silicon"], path: str
) -> float:
    """Return the factor on a dark current from a temperature [K], if any, to the pixel's, [2]."""
    if given_at is None:
        return 1.0
    at = camera.pixel.temperature
    if doubling == "silicon":
        return float(silicon.dark_current_ratio(at, given_at))
    doublings = (at - given_at) / doubling
    if abs(doublings) > MOST_DOUBLINGS:
        raise bad(
            path,
            f"from {given_at:g} K to {at:g} K it doubles {doublings:.3g} times",
            "give it at a temperature nearer to the pixel's, or write doubling: silicon",
        )
    return float(2**doublings)
