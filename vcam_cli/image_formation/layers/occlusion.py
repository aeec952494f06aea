"""What layers hide of each other, ray by ray, beyond the product of their means.

A ray reaches the sensor at x through the point u of the aperture (in its radii) at the instant t of
the exposure. It meets a layer whose points blur to the radius r, and whose image moves by m, where
the layer's image has x + r u - m t. There it sees the layers one before the other. The signal of a
pixel is the mean of that over u, over t, and over the x that the pixel collects. A layer's mean
light times the mean of what the layers before it let pass is not the same: both depend on the ray.
Their covariance is missing,

    C = K <L_1 + (1 - a_1) (L_2 + ...)> - (K <L_1> + (1 - K <a_1>) (K <L_2> + ...)),

with the mean < > over rays, and K for what sharp lens, silicon and photodetector do to an image.
The light L_1 of the nearest layer is in both and cancels: of it the opacity alone is looked up.

Layers are known by their means over cells. Of such layers each ray has the exact value: it looks up
the cells that it meets. Its errors are those of the size of the cells and of the number of
rays, which `ray_windows.py` chooses.

A wave that diffracts comes from pairs of points of the pupil, as if both saw what their middle sees
[1]_: K < > at a frequency is a mean over the rays through middles of pairs that lie so far apart
(`ray_cells.SharpImage`). For one layer at any defocus that is exact.

References
----------
.. [1] H. H. Hopkins, "The frequency response of a defocused optical system", Proc. R. Soc. A 231,
   91-103, 1955, doi:10.1098/rspa.1955.0158.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics.opening import CIRCLE, Opening
from vcam_cli.records import dataclass
from vcam_cli.scenes.cells import cell_means

TURNS = (math.sqrt(5) - 1) / 2, math.sqrt(2) - 1
"""Turns from one point of the aperture to the next: numbers that fractions approximate worst."""
STEPS = (
    (math.sqrt(2) - 1, math.sqrt(30) - 5, math.sqrt(33) - 5),
    (math.sqrt(3) - 1, math.sqrt(7) - 2, math.sqrt(13) - 3),
)
"""Steps of instant and place from one ray to the next, of two sets without a common structure.

Few small multiples of them and of the turn add up to about a whole number: waves of such multiples
are the same for all rays. With the powers of 0.819 as steps of the first set, turn, instant, three
times the step right and that down add up to 4 but for 4e-5: 300 and 2000 rays erred alike, and 4000
by 4 to 13 times as much as with these."""

Planes = tuple[Array, Array]
"""Light times opacity (C, h, w), and opacity (h, w) or (C, h, w)."""
Sums = tuple[Array, Array, Array]
"""Rays (k, 5), and the sums over them of images of light (n, C, h, w) and of opacity (m, h, w)."""
Place = tuple[slice, slice] | tuple[Array, Array]
"""Rows and columns of cells."""
Met = Callable[[Array], Sequence[Place]]
"""What gives the cells that are met at each of some offsets (n, 2), right and down [cells]."""
Seen = Callable[[Iterable[Sums]], tuple[Array, Array]]
"""What makes of groups of rays the means over all of them in every color at the pixels:
(n, C, rows, columns) and (m, C, rows, columns)."""


@dataclass(frozen=True)
class RayLayer:
    """A layer as rays meet it. Lengths are in cells, along x and y."""

    planes: Array
    """Light times opacity of every color, and opacity (C + 1, h, w); of the nearest layer opacity
    alone will do (1, h, w)."""
    radius: tuple[float, float]
    """Radius of a point's blur; positive where the layer is nearer than what is in focus."""
    path: tuple[float, float] = (0.0, 0.0)
    """What its image goes during the exposure."""
    place: tuple[float, float] = (0.0, 0.0)
    """How far its image is displaced in the middle of the exposure."""

    def together(self, count: int) -> RayLayer:
        """Return the means over squares of cells.

        Parameters
        ----------
        count : int
            Cells along either side of a square.

        Returns
        -------
        RayLayer
            Layer on the squares, its lengths in squares.
        """
        radius, path, place = (
            (x / count, y / count) for x, y in (self.radius, self.path, self.place)
        )
        return RayLayer(cell_means(self.planes, count), radius, path, place)

    def offsets(self, rays: Array) -> Array:
        """Return how far from the beginning of its own cell each ray meets the layer.

        Parameters
        ----------
        rays : Array
            Rays (n, 5) of `rays`.

        Returns
        -------
        Array
            Offsets (n, 2) right and down [cells].
        """
        u, t, within = rays[:, :2], rays[:, 2:3] - 0.5, rays[:, 3:]
        return np.asarray(within + u * self.radius - t * self.path - self.place)


@lru_cache(1 << 5)  # windows of all places and sizes have the same
def rays(count: int, kind: int, opening: Opening = CIRCLE) -> Array:
    """Return rays (n, 5): a point of the aperture [radii], an instant and a place, 0 to 1.

    Parameters
    ----------
    count : int
        Number of rays; of an opening that is no circle about as many.
    kind : int
        0 or 1: which of two sets that share neither radii nor angles.
    opening : Opening, optional
        Shape of the aperture.

    Returns
    -------
    Array
        Rays, which fill the disc, or what of it is open, evenly on a spiral [1]_.

    References
    ----------
    .. [1] H. Vogel, "A better way to construct the sunflower head", Math. Biosciences 44, 179-189,
       1979, doi:10.1016/0025-5564(79)90080-4.
    """
    count = round(count / opening.share)
    k = np.arange(count) + 0.5
    radius, angle = np.sqrt(k / count), 2 * np.pi * TURNS[kind] * k
    rest = np.outer(k, STEPS[kind]) % 1
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    found = np.column_stack([x, y, rest])[opening.contains(x, y)]
    found.setflags(write=False)
    return found


def front_to_back(layers: Sequence[Planes]) -> Array:
    """Return the light of layers one before the other.

    Parameters
    ----------
    layers : sequence of Planes
        Light times opacity (C, h, w), and opacity (h, w) or (C, h, w), the nearest first.

    Returns
    -------
    Array
        Light (C, h, w), in the unit of the layers' light.
    """
    light, opacity = layers[0]
    total = light.copy()
    clear = 1 - opacity
    for light, opacity in layers[1:-1]:
        total += clear * light
        clear *= 1 - opacity
    if len(layers) > 1:
        total += clear * layers[-1][0]
    return total


def covariance_bytes(
    layers: Sequence[RayLayer], inner: tuple[int, int], groups: int, painting: int
) -> int:
    """Return the memory of painting layers on cells and of finding `covariance` from them.

    Parameters
    ----------
    layers : sequence of RayLayer
        Layers on cells, the nearest first.
    inner : tuple of int
        Rows and columns of cells that have rays.
    groups : int
        Groups of rays.
    painting : int
        Memory of temporary arrays while a layer is painted [bytes].

    Returns
    -------
    int
        Bytes: planes, beside temporary arrays, or beside what each lets pass, sums over rays, their
        spectra and these along one axis at the pixels; of several groups also the spectra of one
        and their product; in 64 bits the transfer, and what that of groups is found from.
    """
    if not layers:
        return painting
    last = layers[-1].planes
    planes = sum(layer.planes.nbytes for layer in layers)
    passed = sum(layer.planes[-1].nbytes for layer in layers[:-1])
    colors, cells = len(last) - 1, math.prod(inner)
    images = len(layers) * colors + len(layers) - 1
    arrays, transfers = (3, 1) if groups == 1 else (4, 4)
    summing = passed + cells * (arrays * images * last.itemsize + transfers * colors * 8)
    return int(planes + max(summing, painting))


def covariance(
    layers: Sequence[RayLayer],
    groups: Sequence[Array],
    inner: tuple[int, int],
    met: Met,
    seen: Seen,
) -> Array:
    """Return what the product of the layers' means lacks, at the pixels.

    Parameters
    ----------
    layers : sequence of RayLayer
        Layers on cells of one shape, the nearest first.
    groups : sequence of Array
        Rays (k, 5), in groups whose light is kept apart.
    inner : tuple of int
        Rows and columns of cells that have rays.
    met : callable
        What gives, of the offsets of rays, the cells at which each meets a layer.
    seen : callable
        What lens, silicon and photodetectors make of images on the inner cells.

    Returns
    -------
    Array
        Light (C, rows, columns) at the pixels, in the unit of the layers.
    """
    colors, (rows, columns) = len(layers[-1].planes) - 1, inner
    dtype = layers[-1].planes.dtype
    lights = [layer.planes[:-1] for layer in layers]
    clears = [1 - layer.planes[-1] for layer in layers[:-1]]

    def summed(rays: Array) -> Sums:
        places = [met(layer.offsets(rays)) for layer in layers]
        # Of all that is seen behind the nearest layer, and of each that is there by itself.
        light = np.zeros((len(layers), colors, rows, columns), dtype)
        clear = np.zeros((len(layers) - 1, rows, columns), dtype)
        seen: Array = np.empty((colors, rows, columns), dtype)
        for at in zip(*places, strict=True):
            behind = lights[-1][:, *at[-1]]
            light[-1] += behind
            for k in range(len(layers) - 2, -1, -1):
                passed = clears[k][at[k]]
                behind = np.multiply(behind, passed, out=seen)
                clear[k] += passed
                if k:
                    own = lights[k][:, *at[k]]
                    behind += own
                    light[k] += own
            light[0] += behind
        return rays, light, len(rays) - clear

    (together, *alone), (nearest, *covers) = seen(map(summed, groups))
    means = list(zip(alone, [*covers, np.ones_like(together)], strict=True))
    return np.asarray(together - (1 - nearest) * front_to_back(means))
