"""Processes told to the slow camera: their published numbers, and the photodiode they make.

Lengths in meters, capacitances in F/m2 and F/m, currents in A/m2 and A/m, at 300 K. Junction and
sidewall capacitances are those of MOSIS runs T69H, T69J and T16X; the rest is as the technology
files of `configs/technologies` say in their `source`.
"""

import math
from dataclasses import dataclass

import numpy as np
import reference_silicon as silicon

CHARGE, VACUUM = 1.602176634e-19, 8.8541878128e-12
SILICON, OXIDE = 11.7 * VACUUM, 3.9 * VACUUM


@dataclass(frozen=True)
class Process:
    feature: float
    swing: float
    reset: float  # voltage to which the photodiode is reset [V]
    area: tuple[float, float, float]  # capacitance at zero bias, built-in potential, grading
    sidewall: tuple[float, float, float]
    depth: float = 0.2e-6
    neutral: float = 5e-6
    length: float = 20e-6
    film: float = 0.25e-6  # of polysilicon, over a photogate
    dark_area: float = 1e-4
    supply: float = 3.3
    acceptors: float = 8e22
    well: float = 1.5e-6
    well_donors: float = 5e22
    scale: float = 0.75  # of the quantum efficiency: reflection and stack
    border: float = 5.017
    transistors: float = 91.1


PROCESSES = {
    "cmos-0.35um": Process(
        0.35e-6, 1.38, 2.25, (0.906e-3, 0.8, 0.36), (0.297e-9, 0.8, 0.2)
    ),
    "cmos-0.25um": Process(
        0.25e-6, 1.67, 2.25, (1.762e-3, 0.99, 0.46), (0.388e-9, 0.99, 0.35),
        depth=0.143e-6, neutral=3.57e-6, length=14.3e-6, film=0.2e-6, acceptors=3.7e23,
        well=1.2e-6, well_donors=7e22,
    ),
    "cmos-0.18um": Process(
        0.18e-6, 1.12, 1.65, (0.9925e-3, 0.727, 0.357), (0.2475e-9, 0.575, 0.132),
        depth=0.103e-6, neutral=2.57e-6, length=10.3e-6, film=0.2e-6, acceptors=8.6e22,
        supply=2.5, well=1e-6, well_donors=1e23,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Photodiode:
    """Of one pixel in one process."""

    process: Process
    kind: str
    area: float
    perimeter: float
    side: tuple[float, float]  # of the rectangle of this area, of the pixel's shape
    capacitance: float
    depths: tuple[float, float, float]

    def quantum_efficiency(self, wavelength: np.ndarray) -> np.ndarray:
        """Of light in the silicon."""
        alpha = silicon.absorption(wavelength)
        film = self.process.film if self.kind == "photogate" else 0.0
        return silicon.quantum_efficiency(alpha, self.kind, *self.depths, film=film)

    def external_efficiency(self, wavelength: np.ndarray) -> np.ndarray:
        """Of light on the pixel's face."""
        return self.process.scale * self.quantum_efficiency(wavelength)

    def dark_rate(self, temperature: float = 300.0) -> float:
        """Electrons of a pixel [e/s]; the surface of a pinned diode makes none."""
        edge = 0.0 if self.kind == "pinned" else self.edge_current
        current = self.process.dark_area * self.area + edge
        return silicon.doubled(current, temperature, 300.0, 8.0) / CHARGE

    @property
    def edge_current(self) -> float:
        """Of the walls of the junction down to the end of what is depleted [A]."""
        return self.process.dark_area * self.depths[1] * self.perimeter

    @property
    def diffusion(self) -> silicon.Diffusion:
        x1, x2, x3 = self.depths
        return silicon.Diffusion(self.process.length, x2 - x1, x3 - x2)


def photodiode(process: Process, width: float, height: float, kind: str = "ndiff-psub"):
    """The photodiode that the process's layout leaves of a pixel [m].

    A photogate's and a pinned one's capacitance is not told here.
    """
    p = process
    area, perimeter = silicon.layout(width, height, p.feature, p.border, p.transistors)
    part = math.sqrt(area / (width * height))
    bias = p.reset - p.swing, p.reset
    per_area = silicon.mean_over_swing(p.area[0], *bias, *p.area[1:])
    per_length = silicon.mean_over_swing(p.sidewall[0], *bias, *p.sidewall[1:])
    gate = 2.5 * p.feature * p.feature * OXIDE / (p.feature / 44)
    x1, depleted = p.depth, SILICON / per_area
    if kind == "photogate":
        x1, depleted = 0.0, gate_depletion(p.supply, p.feature, p.acceptors)
    elif kind == "pinned":
        x1, depleted = 0.1e-6, pinned_depletion()
    elif kind == "nwell-psub":
        x1, depleted = p.well, well_depletion(p, p.well_donors)
    x2 = x1 + depleted
    return Photodiode(
        p, kind, area, perimeter, (part * width, part * height),
        per_area * area + per_length * perimeter + gate, (x1, x2, x2 + p.neutral),
    )  # fmt: skip


def thermal(concentration: float) -> float:
    """(k T / q) ln(N / n_i) at 300 K [V], with the package's n_i: it is known to some percent."""
    from vcam_cli.physics.silicon import intrinsic_concentration

    n_i = float(intrinsic_concentration(300.0))
    return 1.380649e-23 * 300 / CHARGE * math.log(concentration / n_i)


def pinned_depletion(layer=0.25e-6, donors=5e22, acceptors=1.6e21, surface=1e24) -> float:
    """All of the n layer and what is depleted below it: where both regions meet [m].

    Sought by the upper region's width, at which both sides have the layer at one voltage.
    """
    from scipy.optimize import brentq

    slope = CHARGE * donors / (2 * SILICON)
    upper, lower = thermal(donors) + thermal(surface), thermal(donors) + thermal(acceptors)

    def difference(x: float) -> float:
        below = slope * (1 + donors / acceptors) * (layer - x) ** 2
        return (slope * x**2 - upper) - (below - lower)

    x = brentq(difference, 0, layer, xtol=1e-16)
    return layer + (layer - x) * donors / acceptors


def gate_depletion(supply: float, feature: float, acceptors: float) -> float:
    """Mean width of the region below a gate, empty in deep depletion, and full at inversion [m]."""
    from scipy.optimize import brentq

    fermi, oxide = thermal(acceptors), OXIDE / (feature / 44)

    def width(psi: float) -> float:
        return math.sqrt(2 * SILICON * psi / (CHARGE * acceptors))

    voltage = supply + 0.56 + fermi
    empty = brentq(
        lambda psi: psi + CHARGE * acceptors * width(psi) / oxide - voltage, 0, voltage, xtol=1e-15
    )
    return (width(empty) + width(2 * fermi)) / 2


def well_depletion(process: Process, donors: float, acceptors: float = 1.6e21) -> float:
    """Permittivity over the capacitance per area of an abrupt junction, averaged [m]."""
    potential = thermal(donors) + thermal(acceptors)
    both = donors * acceptors / (donors + acceptors)
    zero = SILICON / math.sqrt(2 * SILICON * potential / (CHARGE * both))
    bias = process.reset - process.swing, process.reset
    return SILICON / silicon.mean_over_swing(zero, *bias, potential, 0.5)
