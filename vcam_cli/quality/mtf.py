"""The modulation transfer of a camera from one slanted edge: e-SFR of ISO 12233.

An edge a few degrees off the lines of pixels crosses them at ever different places, so that all
lines together sample it many times finer than one. The steps are those of the standard [1]: find
the edge in every line by the centroid of its derivative, fit a line through the places, sort all
pixels by their distance from it into bins a quarter of a pixel wide, take the derivative of the
edge, window it, and transform. What averaging over a bin and the derivative's filter take from
the result is given back: without that MTF50 comes out some percent too low [2].

Pixels come as lattices with their true positions, so that one color of a mosaic is measured from
its own sites and nothing is interpolated.

Why bins are moved: the pixels that fall into a bin seldom lie evenly in it, least of all those of
one color. Each mean is carried along the edge's slope from where its pixels lie to the middle of
the bin; what averaging does then depends on the bin's width alone.

References
----------
[1] ISO 12233:2017, Photography - Electronic still picture imaging - Resolution and spatial
    frequency responses, annex D (e-SFR).
[2] P. Burns, "Slanted-edge MTF for digital camera and scanner analysis", Proc. IS&T PICS, 2000,
    135-138; K. Masaoka et al., Optics Express 22, 6040 (2014), DOI 10.1364/OE.22.006040.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]

BINS_PER_PIXEL = 4
"""Times that the edge is sampled finer than the pixels, [1]."""
HIGHEST = 0.45
"""Frequency up to which the transfer is told [cycles/bin]."""
FLAT = 0.5
"""Part of the window that does not fall off: wide tails of a lens keep their weight there."""
ROUNDS = 3
"""Times that the line is fitted: each time windows lie around the line of the time before."""


@dataclass(frozen=True)
class Lattice:
    """Pixels on straight rows and columns, all of one color."""

    values: NDArray
    """(rows, columns) any unit."""
    x: Floats
    """(columns,) rising [m]"""
    y: Floats
    """(rows,) rising [m]"""

    @property
    def turned(self) -> Lattice:
        """Rows for columns."""
        return Lattice(self.values.T, self.y, self.x)


@dataclass(frozen=True)
class EdgeResponse:
    """What one edge tells."""

    frequency: Floats
    """(n,) Across the edge, from 0 [cycles/m]."""
    mtf: Floats
    """(n,) 1 at frequency 0."""
    angle: float
    """Of the edge's normal to the x axis, y down [rad]."""
    place: float
    """Of the edge along its normal, from the origin [m]."""
    distance: Floats
    """(bins,) Centers of the bins, from the edge [m]."""
    profile: Floats
    """(bins,) The edge, in the unit of the values."""
    pitch: float
    """Of the pixels [m]."""

    @property
    def mtf50(self) -> float:
        """First frequency at which the transfer is one half [cycles/m]; inf where it never is."""
        return crossing(self.frequency, self.mtf, 0.5)


def crossing(frequency: Floats, mtf: Floats, level: float) -> float:
    """First frequency at which a curve falls to `level`, by straight lines; inf where never."""
    below = np.flatnonzero(mtf <= level)
    if not len(below):
        return math.inf
    k = int(below[0])
    if k == 0:
        return float(frequency[0])
    part = (mtf[k - 1] - level) / (mtf[k - 1] - mtf[k])
    return float(frequency[k - 1] + part * (frequency[k] - frequency[k - 1]))


def slanted_edge(
    lattices: Sequence[Lattice], pitch: float, reach: float, degree: int = 1
) -> EdgeResponse:
    """The transfer across a slanted edge, e-SFR of ISO 12233.

    lattices: all pixels of one color; pitch: between the array's pixels, of which the bins are a
    quarter [m]; reach: half the width of the window around the edge [m]; degree: of the curve
    through the edge's places, 1 for a lens without distortion. The edge may be near the vertical
    or the horizontal and either side may be bright. Raises ValueError where no edge is found, or
    where the edge does not cross the lines of pixels.
    """
    upright = _upright(lattices)
    seen = lattices if upright else [lattice.turned for lattice in lattices]
    curve = _fitted(seen, reach, degree)
    slope = float(np.polyval(np.polyder(curve), 0.0)) if degree else 0.0
    cosine = math.cos(math.atan(slope))
    width = pitch / BINS_PER_PIXEL
    distance, value = _by_distance(seen, curve, cosine)
    centers, profile = _binned(distance, value, width, reach)
    frequency, mtf = _transformed(profile, width)
    angle = -math.atan(slope) if upright else math.pi / 2 + math.atan(slope)
    place = float(np.polyval(curve, 0.0)) * cosine
    return EdgeResponse(frequency, mtf, angle, place, centers, profile, pitch)


def _upright(lattices: Sequence[Lattice]) -> bool:
    """Whether the edge is nearer to the columns than to the rows."""
    across = down = 0.0
    for lattice in lattices:
        v = lattice.values.astype(np.float64)
        if min(v.shape) < 4:
            raise ValueError(f"{v.shape[0]} x {v.shape[1]} pixels are too few for an edge")
        across += abs(float(v[:, -1].mean() - v[:, 0].mean()))
        down += abs(float(v[-1].mean() - v[0].mean()))
    if not max(across, down) > 0:
        raise ValueError("there is no edge: all sides are alike")
    return across >= down


def _fitted(lattices: Sequence[Lattice], reach: float, degree: int) -> Floats:
    """Coefficients of the curve x(y) through the edge, highest power first."""
    curve: Floats = np.zeros(degree + 1)
    for number in range(ROUNDS):
        found = [
            _places(lattice, None if number == 0 else curve, reach / 2**number)
            for lattice in lattices
        ]
        y, x = (np.concatenate(parts) for parts in zip(*found, strict=True))
        if len(y) < max(4, 2 * degree + 2):
            raise ValueError("the edge is found in too few lines")
        curve = _polyfit_without_strays(y, x, degree)
    return curve


def _polyfit_without_strays(y: Floats, x: Floats, degree: int) -> Floats:
    """Least squares, once more without what lies 3 deviations off: noise moves some centroids."""
    scale = float(np.abs(y).max()) or 1.0
    powers = scale ** -np.arange(degree, -1, -1.0)
    curve = np.polyfit(y / scale, x, degree) * powers
    off = np.abs(x - np.polyval(curve, y))
    near = off <= 3 * max(float(np.sqrt(np.mean(off**2))), 1e-15)
    if near.sum() > 2 * degree + 2:
        curve = np.polyfit(y[near] / scale, x[near], degree) * powers
    return np.asarray(curve, dtype=np.float64)


def _places(lattice: Lattice, curve: Floats | None, reach: float) -> tuple[Floats, Floats]:
    """(y, x) of the edge in every line: the centroid of the derivative, in a cosine window.

    Without a curve the window lies around each line's middle of the rise: smoothed, since noise
    has steep places anywhere.
    """
    slopes = np.diff(lattice.values.astype(np.float64), axis=1)
    between = (lattice.x[1:] + lattice.x[:-1]) / 2
    if curve is None:
        middle = np.full(len(lattice.y), _steepest(slopes, between))
        reach = max(float(np.ptp(lattice.x)), reach)
    else:
        middle = np.polyval(curve, lattice.y)
    away = np.abs(between[None, :] - middle[:, None])
    window = np.where(away < reach, np.cos(np.pi / 2 * np.minimum(away / reach, 1)) ** 2, 0)
    weight = slopes * window
    total = weight.sum(axis=1)
    sign = np.sign(total.sum())
    good = total * sign > 0.25 * abs(np.median(total))
    good &= (middle >= between[0]) & (middle <= between[-1])
    x = (weight[good] @ between) / total[good]
    inside = (x >= lattice.x[0]) & (x <= lattice.x[-1])
    return lattice.y[good][inside], x[inside]


def _steepest(slopes: Floats, between: Floats) -> float:
    """Where the mean of all lines rises or falls by half [m]."""
    rise = np.cumsum(slopes.mean(axis=0))
    return float(between[np.argmin(np.abs(rise - rise[-1] / 2))])


def _by_distance(
    lattices: Sequence[Lattice], curve: Floats, cosine: float
) -> tuple[Floats, Floats]:
    """Distance from the edge, along its normal [m], and value of every pixel."""
    distances, values = [], []
    for lattice in lattices:
        edge = np.polyval(curve, lattice.y)
        distances.append(((lattice.x[None, :] - edge[:, None]) * cosine).ravel())
        values.append(lattice.values.astype(np.float64).ravel())
    return np.concatenate(distances), np.concatenate(values)


def _binned(distance: Floats, value: Floats, width: float, reach: float) -> tuple[Floats, Floats]:
    """Means over bins of a width, out to `reach`, moved to the bins' middles: (centers, means).

    All lengths in [m]. Empty bins take the straight line between their neighbors. Raises
    ValueError where they are too many: an edge along the pixels is sampled no finer than they are.
    """
    half = max(8, math.floor(reach / width))
    index = np.floor(distance / width).astype(np.int64) + half
    inside = (index >= 0) & (index < 2 * half)
    count = np.bincount(index[inside], minlength=2 * half)
    total = np.bincount(index[inside], weights=value[inside], minlength=2 * half)
    full = count > 0
    if full.mean() < 0.9:
        raise ValueError("the edge does not cross the lines of pixels; turn it a few degrees")
    centers = (np.arange(2 * half) - half + 0.5) * width
    places = np.bincount(index[inside], weights=distance[inside], minlength=2 * half)
    at, mean = places[full] / count[full], total[full] / count[full]
    moved = mean
    for _ in range(2):  # the slope is that of the moved means
        profile = np.interp(centers, centers[full], moved)
        moved = mean + (np.gradient(profile) / width)[full] * (centers[full] - at)
    return centers, np.interp(centers, centers[full], moved)


def _transformed(profile: Floats, width: float) -> tuple[Floats, Floats]:
    """Frequencies [cycles/m] and transfer of an edge profile, corrections included.

    The derivative over two bins passes sinc(2 f w), the bins' average sinc(f w); both are
    divided out. At two cycles a pixel the derivative passes nothing; the result ends before.
    """
    spread = (profile[2:] - profile[:-2]) / 2
    spectrum = np.abs(np.fft.rfft(spread * tukey(len(spread), FLAT)))
    frequency = np.fft.rfftfreq(len(spread), width)
    used = frequency * width < HIGHEST
    f = frequency[used] * width
    if not spectrum[0] > 0:
        raise ValueError("there is no edge: both sides are alike")
    return frequency[used], spectrum[used] / spectrum[0] / (np.sinc(2 * f) * np.sinc(f))


def tukey(count: int, flat: float) -> Floats:
    """Window that is 1 over the middle part `flat` and falls to 0 as a cosine on both sides."""
    at = np.abs(2 * (np.arange(count) + 0.5) / count - 1)
    fall = np.clip((at - flat) / (1 - flat), 0, 1) if flat < 1 else np.zeros(count)
    return np.cos(np.pi / 2 * fall) ** 2
