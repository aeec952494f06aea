"""Largest differences of traced lenses from the oracle's numbers, as a table: make lenses."""

from __future__ import annotations

import math

import numpy as np

from tests.lenses.oracle import FIRST_ORDER, LENSES, ORACLE
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.files import shipped_lens
from vcam_cli.lenses.paraxial import paraxial
from vcam_cli.lenses.pupils import pupils
from vcam_cli.physics import zernike


def first_order(view: View, known: dict) -> float:
    """Relative difference of focal lengths, distances and pupils."""
    errors = []
    for micrometers, expected in known["paraxial"].items():
        found = paraxial(view.lens, float(micrometers) * 1e-6)
        for key, attribute in FIRST_ORDER.items():
            errors.append(abs(getattr(found, attribute) * 1e3 / expected[key] - 1))
    return max(errors)


def chief_heights(view: View, known: dict) -> float:
    """Difference of chief rays' heights [mm]."""
    errors = []
    for degrees, heights in known["heights"]:
        waves = np.array([float(w) * 1e-6 for w in heights])
        found = view.heights(np.array([math.radians(degrees)]), waves)[0] * 1e3
        errors.append(np.abs(found - list(heights.values())).max())
    return float(max(errors))


def rays(view: View, known: dict) -> tuple[float, float]:
    """Differences of launched rays' landing points [mm] and optical paths [waves]."""
    points, paths = [], []
    for field, wave, _, _, u, v, x, y, _, _, opd in known["rays"]:
        angle, waves = np.array([math.radians(field * known["field"])]), np.array([wave * 1e-6])
        place = np.array([[[u * 1e-3]]]), np.array([[[v * 1e-3]]])
        found = view.trace(angle, waves, *place).rays
        points.append(math.hypot(found.x.item() * 1e3 - x, found.y.item() * 1e3 - y))
        front = view.wavefront(angle, waves, *place, view.chief(angle, waves))
        paths.append(abs(front.path.item() / waves[0] - opd))
    return max(points), max(paths)


def coefficients(view: View, known: dict) -> float:
    """Difference of 37 coefficients of Noll [waves]."""
    node, weight = np.polynomial.legendre.leggauss(32)
    angle = 2 * np.pi * np.arange(64) / 64
    rho, theta = (a.ravel() for a in np.meshgrid(np.sqrt((node + 1) / 2), angle, indexing="ij"))
    share = np.repeat(weight / 2 / 64, 64)
    basis = np.array([share * zernike.polynomial(j, rho, theta) for j in range(1, 38)])
    errors = []
    for degrees, wave, expected in known["wavefronts"]:
        field, waves = np.array([math.radians(degrees)]), np.array([wave * 1e-6])
        place = view.aim(field, waves, rho * np.cos(theta), rho * np.sin(theta))
        front = view.wavefront(field, waves, *place, view.chief(field, waves))
        errors.append(np.abs(basis @ front.path[0, 0] / waves[0] - expected).max())
    return float(max(errors))


def illumination(view: View, known: dict) -> tuple[float, float]:
    """Differences of relative illumination, by the stop alone and by all fixed apertures."""
    rows, waves = np.array(known["illumination"]), np.array([view.lens.primary])
    found = []
    for vignetted, column in ((False, 1), (True, 2)):
        area = pupils(view, rows[:, 0] * 1e-3, waves, 1024, vignetted).area[:, 0]
        found.append(float(np.abs(area / area[0] - rows[:, column]).max()))
    return found[0], found[1]


def main() -> None:
    """Print the table."""
    header = ("lens", "first order", "chief [mm]", "ray [mm]", "path [waves]", "Noll [waves]")
    header += ("illumination, stop", "illumination, fixed")
    print(" | ".join(header))
    for name in LENSES:
        view, known = View(shipped_lens(name)), ORACLE[name]
        numbers = [first_order(view, known), chief_heights(view, known), *rays(view, known)]
        numbers += [coefficients(view, known), *illumination(view, known)]
        print(" | ".join([name, *(f"{number:.1e}" for number in numbers)]))


if __name__ == "__main__":
    main()
