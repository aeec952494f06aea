"""Pixel vignetting: light that comes at an angle into the tunnel above a photodetector.

The metal layers of a chip leave a tunnel above every photodetector, filled with dielectrics. Light
is partly reflected where they meet, is refracted, and falls sideways by the depth of the tunnel
times the tangent of its angle inside; what falls beside the photodetector is lost.

Angles of light are given by their tangents in air: (x, y) of the direction over its z.

References
----------
.. [1] P. B. Catrysse, X. Liu, A. El Gamal, "QE reduction due to pixel vignetting in CMOS image
   sensors", Proc. SPIE 3965, 420-430, 2000, doi:10.1117/12.385460.
.. [2] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.2.
.. [3] M. Born, E. Wolf, "Principles of Optics", 7th edition, 1999, section 1.5.2 and 1.5.3,
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

POINTS_ACROSS, POINTS_ALONG = 12, 5
"""Gauss points a panel: from chord to chord of the pupil, and along each."""
STEEP = 0.6
"""Tangent of the chief ray beyond which there are twice as many: kinks bend there."""
MAX_TANGENT = 1e6
"""Tangents beyond count as this: no light comes so flat."""
MIN_DEPTH = 1e-100
"""Depth of a tunnel that has none, where it is divided by [m]."""


def refracted_cosine(cosine: ArrayLike, index: ArrayLike, below: ArrayLike) -> Floats:
    """Return the cosine of the angle of refraction, by Snell's law.

    Parameters
    ----------
    cosine : array_like
        Cosine of the angle of incidence [dimensionless], in 0..1.
    index : array_like
        Refractive index of the medium that the light leaves.
    below : array_like
        Refractive index of the medium that it enters. All three broadcast.

    Returns
    -------
    ndarray
        Cosine of the angle below [dimensionless], in 0..1.

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
    """Return the transmittance of a surface for light polarized across the plane of incidence [3].

    T_s = 4 n1 cos1 n2 cos2 / (n1 cos1 + n2 cos2)^2.

    Parameters
    ----------
    cosine : array_like
        Cosine of the angle of incidence [dimensionless], in 0..1.
    index : array_like
        Refractive index n1 of the medium that the light leaves.
    below : array_like
        Refractive index n2 of the medium that it enters. All three broadcast.

    Returns
    -------
    ndarray
        Share of the power that passes [dimensionless], in 0..1.

    Raises
    ------
    ValueError
        Total internal reflection.
    """
    c, n1, n2 = (np.asarray(v, np.float64) for v in (cosine, index, below))
    return _power_transmission(n1 * c, n2 * refracted_cosine(c, n1, n2))[()]


def transmission_p(cosine: ArrayLike, index: ArrayLike, below: ArrayLike) -> Floats:
    """Return the transmittance of a surface for light polarized in the plane of incidence [3].

    T_p = 4 n1 cos1 n2 cos2 / (n2 cos1 + n1 cos2)^2; 1 at Brewster's angle, tan = n2 / n1.

    Parameters
    ----------
    cosine, index, below
        As those of `transmission_s`.

    Returns
    -------
    ndarray
        Share of the power that passes [dimensionless], in 0..1.

    Raises
    ------
    ValueError
        Total internal reflection.
    """
    c, n1, n2 = (np.asarray(v, np.float64) for v in (cosine, index, below))
    return _power_transmission(n2 * c, n1 * refracted_cosine(c, n1, n2))[()]


def _power_transmission(one: Floats, two: Floats) -> Floats:
    """Return the share of the power that passes between two admittances."""
    return 4 * one * two / (one + two) ** 2


def stack_transmission(cosine: ArrayLike, layers: Layers) -> Floats:
    """Return the transmittance of the upper surfaces of all layers, T_p T_s of [2].

    Light is taken as unpolarized at each surface, and what is reflected between them as lost; no
    interference: layers are thicker than the light is coherent.

    Parameters
    ----------
    cosine : array_like
        Cosine of the angle in air [dimensionless], in 0..1.
    layers : Layers
        Thickness [m] and refractive index of each layer from the air down; one without thickness
        reflects all the same.

    Returns
    -------
    ndarray
        Share of the power that passes [dimensionless], in the shape of `cosine`.
    """
    above, n1 = np.asarray(cosine, np.float64), 1.0
    total = np.ones_like(above)
    for _, n2 in layers:
        both = transmission_s(above, n1, n2) + transmission_p(above, n1, n2)
        total = total * (both / 2)
        above, n1 = refracted_cosine(above, n1, n2), n2
    return total[()]


def depth_per_tangent(tangent_squared: ArrayLike, layers: Layers) -> Floats:
    """Return how far light falls sideways in the layers, per tangent of its angle in air.

    The sum of t tan(theta_i) over the layers is tan(theta) times this: with sin(theta_i) =
    sin(theta) / n it is the sum of t / sqrt(n^2 + (n^2 - 1) tan^2(theta)).

    Parameters
    ----------
    tangent_squared : array_like
        tan^2(theta) of the angle in air [dimensionless].
    layers : Layers
        Thickness [m] and refractive index of each layer from the air down.

    Returns
    -------
    ndarray
        Lateral shift per tangent [m], in the shape of `tangent_squared`.
    """
    u2 = np.asarray(tangent_squared, np.float64)
    return sum((t / np.sqrt(n**2 + (n**2 - 1) * u2) for t, n in layers), start=np.zeros_like(u2))[
        ()
    ]


def overlap(dx: ArrayLike, dy: ArrayLike, width: float, height: float) -> Floats:
    """Return the share that two equal rectangles have in common when one is shifted.

    Parameters
    ----------
    dx, dy : array_like
        Shift along the width and the height [m]; they broadcast.
    width, height : float
        Sides of the rectangles [m].

    Returns
    -------
    ndarray
        Share of the area [dimensionless], in 0..1.
    """
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
    """Return the share of the light on a tunnel's mouth that reaches the photodetector below [1].

    The mean of overlap x T over the exit pupil, a uniform Lambertian disk, by the irradiance that
    its parts cause (cos^4 of the angle). Relative to the light without a tunnel and without
    reflection: 1 for no depth and the indices of air. To multiply a QE that was measured at normal
    incidence, divide by `stack_transmission(1, layers)`.

    Parameters
    ----------
    x, y : array_like
        Tangents of the chief ray at the pixel [dimensionless]: position over distance of the exit
        pupil; they broadcast.
    cone : float
        Tangent of the image-side cone's half-angle on the axis, 1 / (2 N (1 - m)) [dimensionless].
    layers : Layers
        Thickness [m] and refractive index, at least 1, of each layer in the tunnel.
    width, height : float
        Sides of the tunnel and of the photodetector [m].
    chief_centered : bool
        Whether the chief ray hits the center of the photodetector, as microlenses make it that
        follow the chief ray; the tunnel then only sees the spread of the cone.

    Returns
    -------
    ndarray
        Share of the light [dimensionless], in the shape to which x and y broadcast.

    Notes
    -----
    Gauss quadrature along chords of the pupil, in panels between the kinks of the overlap: where
    light falls straight down, and where it just vanishes. Along a chord they are found exactly. The
    absolute error is below 2e-7 where all of the pupil gives light, and below 5e-5 where a part
    of it does not, or where `chief_centered`; from f/1 on. At f/0.5, or in openings far narrower
    than they are deep and long, it may be 4e-4.
    """
    found = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    cx, cy = (each.reshape(-1, 1) for each in found)
    square = cx**2 + cy**2
    depth = depth_per_tangent(square, layers) if chief_centered else np.zeros_like(square)
    offset = depth * cx, depth * cy
    finer = 2 if square.max(initial=0.0) > STEEP**2 else 1
    tx, chord, across = _chords(cx, cy, cone, layers, offset, width, finer * POINTS_ACROSS)
    pixel, _ = lit = np.nonzero(across)  # panels without width are many: no light there is seen
    tx, chord, across = tx[lit][:, None], chord[lit][:, None], across[lit]
    cy, ox, oy = cy[pixel], offset[0][pixel], offset[1][pixel]
    kinks = np.concatenate([_tangent(oy + s * height, tx**2, layers) for s in (-1, 0, 1)], -1)
    ty, along = _panels(np.clip(kinks, cy - chord, cy + chord), finer * POINTS_ALONG)
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
    cx: Floats,
    cy: Floats,
    cone: float,
    layers: Layers,
    offset: tuple[Floats, Floats],
    width: float,
    points: int,
) -> tuple[Floats, Floats, Floats]:
    """Return chords x = constant of the pupil: x, half of their length, quadrature weights.

    They are spaced as cone x sin(v), which makes the length cone x cos(v) a smooth function.
    Panels end where x is a kink or the light vanishes, and where the pupil's rim meets the kink
    along y.
    """
    ox, oy = offset
    near, far = np.maximum(0, np.abs(cy) - cone) ** 2, (np.abs(cy) + cone) ** 2

    def darkness(side: int) -> Floats:
        """Return the tangent at which the last light vanishes on a side, on whichever chord."""
        shift = ox + side * width
        return _tangent(shift, np.where(side * shift > 0, far, near), layers)

    ends = [darkness(-1), _tangent(ox, cy**2, layers), darkness(1)]
    v = np.arcsin(np.clip((np.concatenate(ends, -1) - cx) / cone, -1, 1))
    rim = np.arccos(np.clip(np.abs(_tangent(oy, cx**2, layers) - cy) / cone, 0, 1))
    inside = [np.clip(at, v[..., :1], v[..., 2:]) for at in (-rim, rim)]
    v, weight = _panels(np.sort(np.concatenate([v, *inside], -1), axis=-1), points)
    chord = cone * np.cos(v)
    return cx + cone * np.sin(v), chord, weight * chord


def _tangent(shift: Floats, other_squared: Floats, layers: Layers) -> Floats:
    """Return the tangent along one axis at which light falls `shift` sideways.

    The tangent along the other axis is given. By Newton's method, which cannot overshoot: the shift
    grows with the tangent, ever more slowly.
    """
    tangent = np.zeros(np.broadcast_shapes(np.shape(shift), np.shape(other_squared)))
    for _ in range(6):
        square = other_squared + tangent**2
        short = shift - tangent * depth_per_tangent(square, layers)
        slope = sum(
            t * (n**2 + (n**2 - 1) * other_squared) / (n**2 + (n**2 - 1) * square) ** 1.5
            for t, n in layers
        )
        tangent = tangent + short / np.maximum(slope, MIN_DEPTH)
        tangent = np.clip(tangent, -MAX_TANGENT, MAX_TANGENT)
    return tangent


def _panels(ends: Floats, count: int) -> tuple[Floats, Floats]:
    """Return Gauss points and weights in all panels between consecutive `ends` (..., n)."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = (np.diff(ends) / 2)[..., None]
    middle = ((ends[..., 1:] + ends[..., :-1]) / 2)[..., None]
    shape = (*ends.shape[:-1], (ends.shape[-1] - 1) * count)
    return (middle + half * node).reshape(shape), (half * weight).reshape(shape)
