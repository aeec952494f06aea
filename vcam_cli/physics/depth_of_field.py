"""Depth of field: how far from the distance of focus a point's blur stays small.

Rays of a thin lens in air; distances count from the lens. Diffraction is not in these numbers: it
blurs what is in focus, too.

References
----------
.. [1] S. F. Ray, Applied Photographic Optics, 3rd ed., Focal Press, 2002.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array


def blur_diameter(
    distance: ArrayLike, focus_distance: float, focal_length: float, f_number: float
) -> Array:
    """Return the diameter on the sensor of the blur of a point, by rays.

    It is A |1 / d - 1 / s| v: the cone from the aperture A to the image of a point at the distance
    d, cut at the distance v at which a point at s is sharp.

    Parameters
    ----------
    distance : array_like
        Distances d of points, above 0; inf for one infinitely far [m].
    focus_distance : float
        Distance s that is in focus, longer than the focal length; or inf [m].
    focal_length : float
        Focal length [m].
    f_number : float
        F-number N; the aperture's diameter is A = f / N.

    Returns
    -------
    Array
        Diameters in the shape of `distance` [m].
    """
    image_distance = 1 / (1 / focal_length - 1 / focus_distance)
    defocus = np.abs(1 / np.asarray(distance, dtype=float) - 1 / focus_distance)
    return np.asarray(focal_length / f_number * defocus * image_distance)


def hyperfocal_distance(focal_length: float, f_number: float, circle: float) -> float:
    """Return the nearest focus at which a point infinitely far is blurred by no more than a circle.

    It is f^2 / (N c) + f; then all is sharp from half of it on.

    Parameters
    ----------
    focal_length : float
        Focal length [m].
    f_number : float
        F-number.
    circle : float
        Diameter of the largest blur that counts as sharp, the circle of confusion c [m].

    Returns
    -------
    float
        Distance [m].
    """
    return focal_length**2 / (f_number * circle) + focal_length


def depth_of_field(
    focus_distance: float, focal_length: float, f_number: float, circle: float
) -> tuple[float, float]:
    """Return the nearest and the farthest distance at which the blur is no more than a circle.

    Parameters
    ----------
    focus_distance : float
        Distance that is in focus; or inf [m].
    focal_length, f_number, circle : float
        As in `hyperfocal_distance`.

    Returns
    -------
    near, far : float
        Distances; `far` is inf from the hyperfocal distance on [m].
    """
    image_distance = 1 / (1 / focal_length - 1 / focus_distance)
    allowed = circle * f_number / (focal_length * image_distance)
    left = 1 / focus_distance - allowed
    # At the hyperfocal distance itself the two are equal but for rounding.
    return 1 / (1 / focus_distance + allowed), 1 / left if left > 1e-12 * allowed else np.inf
