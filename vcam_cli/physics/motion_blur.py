"""Blur by an image that moves while it is exposed: its mean over the path."""

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array

LEAST_NODES = 4
"""Gauss-Legendre nodes of a straight piece of a path, at least."""
NODES_PER_WAVE = 3
"""More of them for each period of the finest wave that a piece crosses: then its mean is good to
1e-6."""


def path_transfer(fx: Array, fy: Array, times: ArrayLike, x: ArrayLike, y: ArrayLike) -> Array:
    """Return what a path leaves of waves: the mean of exp(-2 pi i f . x(t)) over its time.

    The path is straight and its speed constant between its points. Of one straight piece the mean
    is sinc(f . path), about its middle.

    Parameters
    ----------
    fx, fy : Array
        Spatial frequencies along x (n,) and y (m,) [cycles/m].
    times : array_like
        Times of the points (p,), rising, at least two [s].
    x, y : array_like
        Displacement of the image at these times (p,) [m].

    Returns
    -------
    Array
        Complex transfer (m, n), 1 at frequency 0.

    References
    ----------
    R. N. Bracewell, The Fourier Transform and Its Applications, 3rd ed., 2000 (running means); O.
    Hadar, I. Dror and N. S. Kopeika, "Image resolution limits resulting from mechanical vibrations.
    Part IV", Opt. Eng. 33, 566-578, 1994, doi:10.1117/12.153186 (transfer of any path).
    """
    times, x, y = (np.asarray(values, dtype=float) for values in (times, x, y))
    highest = float(np.abs(fx).max(initial=0)), float(np.abs(fy).max(initial=0))
    waves = np.abs(np.diff(x)) * highest[0] + np.abs(np.diff(y)) * highest[1]
    count = LEAST_NODES + int(np.ceil(NODES_PER_WAVE * waves.max(initial=0)))
    nodes, weights = np.polynomial.legendre.leggauss(count)
    part = (nodes + 1) / 2
    at_x, at_y = (values[:-1, None] + np.outer(np.diff(values), part) for values in (x, y))
    share = np.outer(np.diff(times) / (times[-1] - times[0]), weights / 2).ravel()
    along_x = np.exp(-2j * np.pi * np.outer(at_x.ravel(), fx))
    along_y = np.exp(-2j * np.pi * np.outer(fy, at_y.ravel()))
    return np.asarray((along_y * share) @ along_x)


def turned_back(x: Array, y: Array, angle: ArrayLike) -> tuple[Array, Array]:
    """Return where points lay before the picture was turned about its center.

    Parameters
    ----------
    x, y : Array
        Positions right of the center and below it, of shapes that go together [m].
    angle : array_like
        Turn of the picture, clockwise as it is seen, of a shape that goes with them [rad].

    Returns
    -------
    tuple of Array
        Positions x and y before [m].
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(cosine * x + sine * y), np.asarray(cosine * y - sine * x)
