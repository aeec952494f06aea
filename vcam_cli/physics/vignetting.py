"""Pixel vignetting: light that comes at an angle into the tunnel above a photodetector.

The metal layers of a chip leave a tunnel above every photodetector, filled with dielectrics. Light
is partly reflected where they meet, is refracted, and falls sideways by the depth of the tunnel
times the tangent of its angle inside; what falls beside the photodetector is lost.

Angles of light are given by their tangents in air: (x, y) of the direction over its z.

References
----------
[1] P. B. Catrysse, X. Liu, A. El Gamal, "QE reduction due to pixel vignetting in CMOS image
    sensors", Proc. SPIE 3965, 420-430, 2000, doi:10.1117/12.385460.
[2] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[3] M. Born, E. Wolf, "Principles of Optics", 7th edition, 1999, section 1.5.2 and 1.5.3,
    doi:10.1017/CBO9781139644181.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics import radiometry

Floats = NDArray[np.float64]
Layers = Sequence[tuple[float, float]]
"""Dielectrics from the air down: (thickness [m], refractive index)."""

ACROSS, ALONG = 12, 5
"""Gauss points a panel, from chord to chord of the pupil and along each."""
STEEPEST = 1e6
"""Tangents beyond count as this: no light comes so flat."""
LEAST_DEPTH = 1e-100
"""Stands for the depth of a tunnel that has none, where it is divided by [m]."""


def refracted_cosine(cosine: ArrayLike, index: ArrayLike, below: ArrayLike) -> Floats:
    """Cosine of the angle of light after it passes from one medium to another, Snell's law.

    Parameters
    ----------
    cosine : of the angle of incidence, 0..1
    index, below : refractive indices of the medium it leaves and of the one it enters

    Raises
    ------
    ValueError
        Total internal reflection; it cannot happen in layers that light enters from air.
    """
    c, n1, n2 = (np.asarray(v, np.float64) for v in (cosine, index, below))
    # 1 - (n1 / n2)^2 sin^2 as a sum: at grazing incidence the difference would cancel.
    square = ((n2 - n1) * (n2 + n1) + (n1 * c) ** 2) / n2**2
    if not (square >= 0).all():
        raise ValueError("the light is totally reflected")
    return np.sqrt(square)[()]


def transmission_s(cosine: ArrayLike, index: ArrayLike, below: ArrayLike) -> Floats:
    """Share of the power that passes a surface, polarized across the plane of incidence [3].

    T_s = 4 n1 cos1 n2 cos2 / (n1 cos1 + n2 cos2)^2; parameters as in `refracted_cosine`.
    """
    c, n1, n2 = (np.asarray(v, np.float64) for v in (cosine, index, below))
    return _passing(n1 * c, n2 * refracted_cosine(c, n1, n2))[()]


def transmission_p(cosine: ArrayLike, index: ArrayLike, below: ArrayLike) -> Floats:
    """Share of the power that passes a surface, polarized in the plane of incidence [3].

    T_p = 4 n1 cos1 n2 cos2 / (n2 cos1 + n1 cos2)^2; 1 at Brewster's angle, tan = n2 / n1.
    """
    c, n1, n2 = (np.asarray(v, np.float64) for v in (cosine, index, below))
    return _passing(n2 * c, n1 * refracted_cosine(c, n1, n2))[()]


def _passing(one: Floats, two: Floats) -> Floats:
    """What passes between two admittances."""
    return 4 * one * two / (one + two) ** 2


def stack_transmission(cosine: ArrayLike, layers: Layers) -> Floats:
    """Share of the power that passes the upper surfaces of all layers, T_p T_s of [2].

    Light is taken as unpolarized at each surface, and what is reflected between them as lost; no
    interference: layers are thicker than the light is coherent.

    Parameters
    ----------
    cosine : of the angle in air, 0..1
    layers : see `Layers`; one without thickness reflects all the same
    """
    above, n1 = np.asarray(cosine, np.float64), 1.0
    total = np.ones_like(above)
    for _, n2 in layers:
        inside = refracted_cosine(above, n1, n2)
        s, p = _passing(n1 * above, n2 * inside), _passing(n2 * above, n1 * inside)
        total = total * ((s + p) / 2)
        above, n1 = inside, n2
    return total[()]


def depth_per_tangent(tangent_squared: ArrayLike, layers: Layers) -> Floats:
    """How far light falls sideways, per tangent of its angle in air [m].

    The sum of t tan(theta_i) over the layers is tan(theta) times this: with sin(theta_i) =
    sin(theta) / n it is the sum of t / sqrt(n^2 + (n^2 - 1) tan^2(theta)).
    """
    u2 = np.asarray(tangent_squared, np.float64)
    return sum((t / np.sqrt(n**2 + (n**2 - 1) * u2) for t, n in layers), start=np.zeros_like(u2))[
        ()
    ]


def lateral_shift(tangent: ArrayLike, layers: Layers) -> Floats:
    """How far light falls sideways on its way down [m], along its azimuth, from tan(theta)."""
    u = np.asarray(tangent, np.float64)
    return (u * depth_per_tangent(u**2, layers))[()]


def overlap(dx: ArrayLike, dy: ArrayLike, width: float, height: float) -> Floats:
    """Share that two equal rectangles have in common when one is shifted by (dx, dy) [m]."""
    x = np.maximum(0, 1 - np.abs(dx) / width)
    return (x * np.maximum(0, 1 - np.abs(dy) / height))[()]


def collected_fraction(
    x: ArrayLike,
    y: ArrayLike,
    cone: float,
    layers: Layers,
    width: float,
    height: float,
    chief_centered: bool = False,
) -> Floats:
    """Share of the light on a tunnel's mouth that reaches the photodetector at its bottom.

    The mean of overlap x T over the exit pupil, a uniform Lambertian disk, by the irradiance that
    its parts cause (cos^4 of the angle). Relative to the light without a tunnel and without
    reflection: 1 for no depth and the indices of air. To multiply a QE that was measured at normal
    incidence, divide by `stack_transmission(1, layers)`.

    Parameters
    ----------
    x, y : tangents of the chief ray at the pixel, position over distance of the exit pupil
    cone : tangent of the image-side cone's half-angle on the axis, 1 / (2 N (1 - m))
    layers : in the tunnel, see `Layers`; indices at least 1
    width, height : of the tunnel and the photodetector [m]
    chief_centered : whether the chief ray hits the center of the photodetector, as microlenses
        make it that follow the chief ray; the tunnel then only sees the spread of the cone

    Notes
    -----
    Gauss quadrature along chords of the pupil, in panels between the kinks of the overlap: where
    light falls straight down, and where it just vanishes. Along a chord they are found exactly. The
    absolute error is below 2e-7 where all of the pupil gives light, and below 5e-5 where a part
    of it does not, or where `chief_centered`; from f/1 on. At f/0.5 it may be 4e-4.
    """
    found = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    cx, cy = (each.reshape(-1, 1) for each in found)
    square = cx**2 + cy**2
    depth = depth_per_tangent(square, layers) if chief_centered else np.zeros_like(square)
    offset = depth * cx, depth * cy
    tx, chord, across = _chords(cx, cy, cone, layers, offset, width)
    pixel, _ = lit = np.nonzero(across)  # panels without width are many: no light there is seen
    tx, chord, across = tx[lit][:, None], chord[lit][:, None], across[lit]
    cy, ox, oy = cy[pixel], offset[0][pixel], offset[1][pixel]
    kinks = np.concatenate([_tangent(oy + s * height, tx**2, layers) for s in (-1, 0, 1)], -1)
    ty, along = _panels(np.clip(kinks, cy - chord, cy + chord), ALONG)
    u2 = tx**2 + ty**2
    depth = depth_per_tangent(u2, layers)
    light = overlap(depth * tx - ox, depth * ty - oy, width, height)
    light *= stack_transmission(1 / np.sqrt(1 + u2), layers)
    light *= along / (1 + u2) ** 2
    total = np.bincount(pixel, light.sum(axis=1) * across, len(square))
    a, b = cone**2, square[:, 0]
    whole = np.pi * a / (1 + a) * radiometry.relative_illumination_exact(a, b)  # of cos^4
    return (total / whole).reshape(found[0].shape)[()]


def _chords(
    cx: Floats, cy: Floats, cone: float, layers: Layers, offset: tuple[Floats, Floats], width: float
) -> tuple[Floats, Floats, Floats]:
    """Chords x = constant of the pupil: x, half of their length, and quadrature weights.

    They are spaced as cone x sin(v), which makes the length cone x cos(v) a smooth function.
    Panels end where x is a kink or the light vanishes, and where the pupil's rim meets the kink
    along y.
    """
    ox, oy = offset
    near, far = np.maximum(0, np.abs(cy) - cone) ** 2, (np.abs(cy) + cone) ** 2

    def darkness(side: int) -> Floats:
        """Where the last light vanishes on this side, on whichever chord that is."""
        shift = ox + side * width
        return _tangent(shift, np.where(side * shift > 0, far, near), layers)

    ends = [darkness(-1), _tangent(ox, cy**2, layers), darkness(1)]
    v = np.arcsin(np.clip((np.concatenate(ends, -1) - cx) / cone, -1, 1))
    rim = np.arccos(np.clip(np.abs(_tangent(oy, cx**2, layers) - cy) / cone, 0, 1))
    inside = [np.clip(at, v[..., :1], v[..., 2:]) for at in (-rim, rim)]
    v, weight = _panels(np.sort(np.concatenate([v, *inside], -1), axis=-1), ACROSS)
    chord = cone * np.cos(v)
    return cx + cone * np.sin(v), chord, weight * chord


def _tangent(shift: Floats, other_squared: Floats, layers: Layers) -> Floats:
    """The tangent along one axis at which light falls `shift` sideways, that along the other given.

    By fixed point: depth hardly depends on the angle (2e-4 of it are left at 45 degrees).
    """
    depth = depth_per_tangent(other_squared, layers)
    tangent = np.zeros_like(shift * depth)
    for _ in range(5):
        tangent = np.clip(shift / np.maximum(depth, LEAST_DEPTH), -STEEPEST, STEEPEST)
        depth = depth_per_tangent(other_squared + tangent**2, layers)
    return tangent


def _panels(ends: Floats, count: int) -> tuple[Floats, Floats]:
    """Gauss points and weights in all panels between consecutive `ends` (..., n)."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = (np.diff(ends) / 2)[..., None]
    middle = ((ends[..., 1:] + ends[..., :-1]) / 2)[..., None]
    shape = (*ends.shape[:-1], (ends.shape[-1] - 1) * count)
    return (middle + half * node).reshape(shape), (half * weight).reshape(shape)
