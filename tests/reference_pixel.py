"""What lies above the photodetector of the slow camera: layers, tunnel, microlens.

Light comes to a pixel as rays from every point of the exit pupil. Each is refracted into the
passivation and into the oxide below it, loses a part at both faces (Fresnel, unpolarized), and
lands t_p tan theta_p + t_s tan theta_s further on than it entered. The tunnel above the
photodetector is as wide as that, so what lands is the overlap of two equal rectangles.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stack:
    """Two dielectrics: thickness [m] and refractive index, the upper one first."""

    passivation: tuple[float, float]
    oxide: tuple[float, float]


@dataclass(frozen=True)
class Pupil:
    """The exit pupil: a disk `distance` [m] before the sensor, seen as a cone of f/`f_number`."""

    distance: float
    f_number: float  # N (1 - m)

    def rays(self, rings: int = 100, spokes: int = 400) -> tuple[np.ndarray, np.ndarray]:
        """Points of the disk, each standing for the same area [m]."""
        radius = self.distance / (2 * self.f_number) * np.sqrt((np.arange(rings) + 0.5) / rings)
        angle = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
        turned = angle + np.pi / spokes * (np.arange(rings)[:, None] % 2)
        x, y = radius[:, None] * np.cos(turned), radius[:, None] * np.sin(turned)
        return x.ravel(), y.ravel()


def transmitted(first: float, second: float, sine: np.ndarray) -> np.ndarray:
    """Part of unpolarized light that a face lets through; `sine` of the angle in vacuum."""
    before, after = np.sqrt(1 - (sine / first) ** 2), np.sqrt(1 - (sine / second) ** 2)
    across = (first * before - second * after) / (first * before + second * after)
    along = (first * after - second * before) / (first * after + second * before)
    return 1 - (across**2 + along**2) / 2


def through(stack: Stack, sine: np.ndarray) -> np.ndarray:
    """Part of the light that reaches the oxide."""
    upper, lower = stack.passivation[1], stack.oxide[1]
    return transmitted(1.0, upper, sine) * transmitted(upper, lower, sine)


def carried(stack: Stack, sine: np.ndarray) -> np.ndarray:
    """How far a ray lands from where it entered [m]."""
    total = np.zeros(np.shape(sine))
    for thickness, index in (stack.passivation, stack.oxide):
        inside = sine / index
        total = total + thickness * inside / np.sqrt(1 - inside**2)
    return total


def landing(stack: Stack, dx: np.ndarray, dy: np.ndarray, distance: float) -> tuple:
    """(x, y) that rays are carried, which move by (dx, dy) over `distance`; sine of their angle."""
    aside = np.hypot(dx, dy)
    sine = aside / np.hypot(aside, distance)
    carry = carried(stack, sine) / np.where(aside > 0, aside, 1)
    return carry * dx, carry * dy, sine


def microlens_shift(stack: Stack, x: np.ndarray, y: np.ndarray, distance: float) -> tuple:
    """How far the collecting area stands from the photodetector, toward the axis [m]."""
    sx, sy, _ = landing(stack, x, y, distance)
    return -sx, -sy


def vignetting(
    stack: Stack,
    pupil: Pupil,
    x: np.ndarray,
    y: np.ndarray,
    tunnel: tuple[float, float],
    *,
    internal: bool,
    follows: bool = False,
) -> np.ndarray:
    """Part of the light that every pixel at (x, y) gets through its tunnel; shape of x.

    internal: the quantum efficiency is that of light in the silicon, so all that the faces take is
    lost here; otherwise only what they take beyond normal incidence. follows: a microlens sends
    the chief ray to the middle, and only the others land beside it.
    """
    px, py = pupil.rays()
    width, height = tunnel
    normal = 1.0 if internal else float(through(stack, np.zeros(1))[0])
    found = np.empty(np.shape(x))
    for place in np.ndindex(found.shape):
        u, v = x[place], y[place]
        dx, dy, sine = landing(stack, u - px, v - py, pupil.distance)
        if follows:
            cx, cy, _ = landing(stack, np.array(u), np.array(v), pupil.distance)
            dx, dy = dx - cx, dy - cy
        overlap = np.clip(1 - abs(dx) / width, 0, 1) * np.clip(1 - abs(dy) / height, 0, 1)
        weight = (1 - sine**2) ** 2  # cos^4: a patch of the pupil seen from the pixel
        found[place] = (weight * overlap * through(stack, sine)).sum() / weight.sum() / normal
    return found


def effective(gain: float | None, efficiency: float | None, fill_factor: float) -> float:
    """Fill factor under a microlens."""
    return efficiency if efficiency is not None else min(gain * fill_factor, 0.95)


def side(fill_factor: float) -> float:
    """Of a square in a unit square."""
    return math.sqrt(fill_factor)
