"""The true pupil: which directions an image point sees through the lens, traced backwards.

Its area in direction cosines is the irradiance of a uniform Lambertian scene over its radiance.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.fields import View, reversed_lens
from vcam_cli.lenses.tracing import Rays, Trace, trace
from vcam_cli.records import dataclass

ANGLES = 256
"""Directions in which the edge is sought: corners of vignetted pupils cost 1e-5 of the area."""
ROOT_STEPS = 60
EDGE = 1e-11
"""Width of the bracket of the edge, over the radius of the axial pupil, at which a search ends."""
STRIDE, STRIDES = 0.08, 120
"""Steps in which the edge is bracketed, in radii of the axial pupil, and how many at most."""
SCAN = 65
"""Places of the meridian at which light is sought where the chief ray is vignetted."""
WIDEST = 0.999
"""Direction cosine at which a pupil ends, whatever the lens."""


@dataclass(frozen=True, eq=False)
class Pupil:
    """The edge of the pupil in direction cosines, in polar coordinates about a point of it.

    Arrays over field points and wavelengths (F, W), the edge over evenly spaced azimuths, too.
    """

    center: Array
    """Direction cosine along x, outwards, of a ray inside (F, W); NaN where no light comes."""
    radius: Array
    """From there to the edge (F, W, angles)."""

    @property
    def area(self) -> Array:
        """Area (F, W) [sr]: of the projected solid angle; 0 where no light comes."""
        step = 2 * math.pi / self.radius.shape[-1]
        return np.asarray(np.nan_to_num((self.radius**2).sum(axis=-1) * (step / 2)))


def pupils(
    view: View, heights: Array, wavelengths: Array, angles: int = ANGLES, vignetted: bool = True
) -> Pupil:
    """Return the pupils that image points see.

    Parameters
    ----------
    view : View
        The lens; the object's distance does not matter.
    heights : ndarray
        Distances of the image points from the axis (F,) [m].
    wavelengths : ndarray
        Wavelengths (W,) [m].
    angles : int
        Directions of the edge.
    vignetted : bool
        Whether the apertures that the file fixes clip, besides the stop.

    Returns
    -------
    Pupil
        The pupils (F, W).
    """
    seen = _Backwards(view, np.asarray(heights, float), wavelengths, vignetted)
    scale = view.paraxial.exit_pupil_diameter / 2 / abs(view.exit_pupil)
    return Pupil(*_edges(seen.fullness, seen.chief, scale, angles))


def beam_edges(view: View, angles: Array, wavelength: float, count: int, vignetted: bool) -> Pupil:
    """Return the edges of the beams that come from object points, where they are launched.

    Parameters
    ----------
    view : View
        The lens before its object.
    angles : ndarray
        Field angles (F,) [rad].
    wavelength : float
        Wavelength [m].
    count : int
        Directions of the edge.
    vignetted : bool
        Whether the apertures that the file fixes clip, besides the stop.

    Returns
    -------
    Pupil
        Places (u, v) (F, 1) in polar coordinates, in meters.
    """
    waves = np.array([wavelength])
    stop = view.paraxial.stop_semi_diameter

    def fullness(u: Array, v: Array) -> Array:
        found = view.trace(angles, waves, u, v)
        return _largest_fullness(found, stop, vignetted)

    chief = view.chief(angles, waves)[..., None]
    return Pupil(*_edges(fullness, chief, view.lens.pupil_diameter / 2, count))


def _largest_fullness(found: Trace, stop: float, vignetted: bool) -> Array:
    """Return how full the fullest aperture is, by radius; infinite where a ray fails."""
    most = np.hypot(found.stop_x, found.stop_y) / stop
    if vignetted:
        most = np.fmax(most, np.sqrt(found.fullness))
    return np.where(found.rays.alive & np.isfinite(most), most, np.inf)


Fullness = Callable[[Array, Array], Array]
"""From places (F, W, n) to how full the fullest aperture is there: an edge has 1."""


class _Backwards:
    """Rays from image points, by their direction cosines."""

    def __init__(self, view: View, heights: Array, wavelengths: Array, vignetted: bool) -> None:
        self._lens = reversed_lens(view.lens)
        self._gap = view.lens.surfaces[-1].thickness
        self._stop = view.paraxial.stop_semi_diameter
        self._heights = heights[:, None, None]
        self._indices = self._lens.indices(wavelengths)[:, :, None]
        self._vignetted = vignetted
        shape = len(heights), len(wavelengths), 1
        toward = -self._heights / np.hypot(self._heights, view.exit_pupil)
        self.chief = np.broadcast_to(toward, shape)

    def fullness(self, x: Array, y: Array) -> Array:
        """Return it for direction cosines (F, W, n)."""
        square = 1 - x * x - y * y
        real = square > 1 - WIDEST**2
        n = np.sqrt(np.where(real, square, 1.0))
        at = np.broadcast_to(self._heights, x.shape)
        zero = np.zeros(x.shape)
        rays = Rays(at, zero, zero - self._gap, x, y, n, zero, real)
        rays = rays.after(self._gap / n, 1.0)
        found = trace(self._lens.surfaces, self._indices, rays, self._lens.stop)
        return _largest_fullness(found, self._stop, self._vignetted)


def _edges(fullness: Fullness, chief: Array, scale: float, count: int) -> tuple[Array, Array]:
    """Return centers (F, W) and radii (F, W, count) of what is bright, in its coordinates."""
    center = _centers(fullness, chief, scale)
    azimuth = 2 * np.pi * np.arange(count // 2 + 1) / count
    half = _edge(fullness, center, azimuth, scale)  # the lens is symmetric about the meridian
    return center, np.concatenate([half, half[..., -2:0:-1]], axis=-1)


def _centers(fullness: Fullness, chief: Array, scale: float) -> Array:
    """Return the place along x of a ray well inside (F, W)."""
    steps = np.linspace(-2.5, 2.5, SCAN) * scale
    found = np.full(chief.shape[:2], np.nan)
    for reach in (1.0, 3.0, 9.0):
        x = chief + reach * steps
        inside = fullness(x, np.zeros(x.shape)) < 1
        some = inside.any(axis=-1)
        middle = np.where(inside, x, 0).sum(axis=-1) / np.maximum(inside.sum(axis=-1), 1)
        found = np.where(np.isnan(found) & some, middle, found)
        if not np.isnan(found).any():
            break
    return found


def _edge(fullness: Fullness, center: Array, azimuth: Array, scale: float) -> Array:
    """Return the radius (F, W, angles) at which the fullness is 1, in a bracket (Illinois)."""
    cosine, sine = np.cos(azimuth), np.sin(azimuth)

    def over(radius: Array) -> Array:
        found = fullness(center[..., None] + radius * cosine, radius * sine)
        return np.minimum(found, 4.0) - 1

    shape = (*center.shape, len(azimuth))
    low, high = np.zeros(shape), np.full(shape, STRIDE * scale)
    # Where no light comes there is no edge: a bracket there ends the search like any other.
    is_dark = np.isnan(center)[..., None]
    at_low, at_high = np.where(is_dark, -1.0, over(low)), over(high)
    for _ in range(STRIDES):  # step by step: beyond the edge rays may come through again
        short = at_high < 0
        if not short.any():
            break
        low, at_low = np.where(short, high, low), np.where(short, at_high, at_low)
        high = np.where(short, high + STRIDE * scale, high)
        at_high = np.where(short, over(high), at_high)
    side = np.zeros(shape)
    for step in range(ROOT_STEPS):
        width = high - low
        if not (width > EDGE * scale).any():
            break
        secant = low - at_low * width / (at_high - at_low)
        # Every third step halves: a ray that fails beyond the edge has no useful height.
        trial = np.where((at_high > 2.9) | (step % 4 == 3), low + width / 2, secant)
        value = over(trial)
        inside = value < 0
        at_high = np.where(inside & (side == 1), at_high / 2, at_high)
        at_low = np.where(~inside & (side == -1), at_low / 2, at_low)
        side = np.where(inside, 1, -1)
        low, at_low = np.where(inside, trial, low), np.where(inside, value, at_low)
        high, at_high = np.where(inside, high, trial), np.where(inside, at_high, value)
    return np.where(is_dark, np.nan, (low + high) / 2)
