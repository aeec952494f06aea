"""The silicon of the slow camera: absorption, collection, dark current, capacitance, layout.

Everything is an integral or a solved equation where the package has a closed form. SI units.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CHARGE, PERMITTIVITY = 1.602176634e-19, 11.7 * 8.8541878128e-12
TABLE = Path(__file__).parent / "data" / "silicon-absorption-green-2008.csv"


def absorption(wavelength: np.ndarray) -> np.ndarray:
    """Of crystalline silicon at 300 K [1/m]: Green's table, the logarithm straight between rows."""
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    at = np.array([float(row["wavelength_nm"]) for row in rows]) * 1e-9
    value = np.array([float(row["alpha_per_cm"]) for row in rows]) * 100
    return np.exp(np.interp(wavelength, at, np.log(value)))


def depths(thickness: float, panels: int = 12, points: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points from 0 to `thickness`, crowded toward 0 where light is absorbed: z, weight."""
    node, weight = np.polynomial.legendre.leggauss(points)
    edges = thickness * np.concatenate([[0.0], 0.5 ** np.arange(panels, -1.0, -1.0)])
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    return (middle[:, None] + half[:, None] * node).ravel(), np.outer(half, weight).ravel()


# --- diffusion of charge -------------------------------------------------------------------------


@dataclass(frozen=True)
class Diffusion:
    """A layer that collects all that is made in it, over one through which electrons must walk.

    In the lower layer n = 0 at both faces: at the upper one electrons are collected, at the lower
    one they are lost; on the way they live sqrt(diffusivity lifetime) = `length`.
    """

    length: float
    depleted: float  # depth of the upper layer [m]
    neutral: float  # depth of the lower layer [m]

    def arrival(self, frequency: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Part of a sheet of charge, a wave of `frequency` at depth z, that arrives: (F, Z).

        Solution of n'' = n (1/L^2 + (2 pi f)^2) from z to both faces: sinh over sinh.
        """
        k = np.sqrt(1 / self.length**2 + (2 * np.pi * frequency) ** 2)[:, None]
        left = -np.expm1(-2 * k * (self.neutral - z))
        return np.exp(-k * z) * left / -np.expm1(-2 * k * self.neutral)

    def collected(self, frequency: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Electrons collected per photon in the silicon, light a wave of `frequency`: (A, F)."""
        z, weight = depths(self.neutral)
        above = -np.expm1(-alpha * self.depleted)
        made = alpha[:, None] * np.exp(-np.outer(alpha, self.depleted + z)) * weight
        return above[:, None] + made @ self.arrival(np.ravel(frequency), z).T

    def modulation(self, frequency: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """What a wave of light keeps of its contrast: (A, F)."""
        return self.collected(frequency, alpha) / self.collected(np.zeros(1), alpha)


def arrival_by_differences(
    frequency: float, z: float, length: float, neutral: float, cells: int = 4000
) -> float:
    """The same part, by finite differences: the current into the upper face per charge at z."""
    step = neutral / cells
    source = round(z / step)
    k2 = 1 / length**2 + (2 * np.pi * frequency) ** 2
    from scipy.linalg import solve_banded

    bands = np.zeros((3, cells - 1))
    bands[0, 1:] = bands[2, :-1] = -1 / step**2
    bands[1] = 2 / step**2 + k2
    made = np.zeros(cells - 1)
    made[source - 1] = 1 / step
    n = solve_banded((1, 1), bands, made)
    return float(n[0] / step)


def arrival_within(radius: np.ndarray, z: float, length: float, neutral: float) -> np.ndarray:
    """Chance that an electron made at depth z is collected within `radius` of where it was made.

    The point's mirror images in both faces, at depths a = z + 2 n W, and in each other's: a pair
    at +a and -a sends a (exp(-|a|/L) / |a| - exp(-R/L) / R) through the plane within r, where
    R^2 = r^2 + a^2.
    """
    images = z + 2 * neutral * np.arange(-400, 401)[:, None]
    away = np.hypot(images, radius)
    part = np.exp(-np.abs(images) / length) / np.abs(images) - np.exp(-away / length) / away
    return (images * part).sum(axis=0)


# --- quantum efficiency --------------------------------------------------------------------------


def chance(z: np.ndarray, kind: str, x1: float, x2: float, x3: float) -> np.ndarray:
    """Of an electron-hole pair made at depth z to be collected.

    All between x1 and x2; below, less and less to none at x3; above, as a minority carrier that
    walks between the surface, where it is lost, and x1. A pinned surface layer collects nothing.
    """
    top = np.zeros_like(z) if kind == "pinned" or x1 == 0 else z / x1
    below = np.clip((x3 - z) / (x3 - x2), 0, 1)
    return np.where(z < x1, top, np.where(z < x2, 1.0, below))


def quantum_efficiency(
    alpha: np.ndarray, kind: str, x1: float, x2: float, x3: float, film: float = 0.0
) -> np.ndarray:
    """Electrons per photon that enters: generation times chance, integrated over depth."""
    if kind == "photogate":
        x1 = 0.0
    total = np.zeros_like(alpha)
    for start, stop in ((0.0, x1), (x1, x2), (x2, x3)):
        if stop <= start:
            continue
        z, weight = depths(stop - start, panels=14, points=10)
        p = chance(np.clip(start + z, start, np.nextafter(stop, start)), kind, x1, x2, x3)
        total += alpha * (np.exp(-np.outer(alpha, start + z)) @ (weight * p))
    return total * np.exp(-alpha * film)


# --- electrical ----------------------------------------------------------------------------------


def minority_current(diffusivity: float, n0: float, width: float) -> float:
    """Current density [A/m2] of n = n0 (1 - z / width): diffusion from `width` to a sink at 0."""
    z = np.linspace(0, width, 101)
    n = n0 * z / width
    return float(CHARGE * diffusivity * np.gradient(n, z).mean())


def dark_density(intrinsic: float, junction: dict[str, float], x_n: float, x_p: float) -> float:
    """Dark current density [A/m2] (2.31): two neutral layers and the depleted one between."""
    holes = minority_current(
        junction["hole_diffusivity"], intrinsic**2 / junction["donors"], junction["x1"]
    )
    electrons = minority_current(
        junction["electron_diffusivity"], intrinsic**2 / junction["acceptors"], junction["neutral"]
    )
    depleted = (
        intrinsic / 2 * (x_n / junction["hole_lifetime"] + x_p / junction["electron_lifetime"])
    )
    return holes + electrons + CHARGE * depleted


def mean_over_swing(
    zero_bias: float, low: float, high: float, built_in: float, grading: float
) -> float:
    """Junction capacitance averaged over the reverse bias, sum of 200 Gauss points."""
    node, weight = np.polynomial.legendre.leggauss(200)
    bias = (low + high) / 2 + (high - low) / 2 * node
    return float(weight @ (zero_bias * (1 + bias / built_in) ** -grading) / 2)


def layout(
    width: float, height: float, feature: float, border: float, transistors: float
) -> tuple[float, float]:
    """Area [m2] and perimeter [m] of the photodetector that the rules of a process leave."""
    w, h = width - border * feature, height - border * feature
    return w * h - transistors * feature**2, 2 * (w + h)


def doubled(rate: float, temperature: float, given_at: float, doubling: float) -> float:
    """A dark current moved to another temperature."""
    return rate * math.exp(math.log(2) * (temperature - given_at) / doubling)
