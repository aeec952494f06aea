"""The modulation transfer of a camera from one slanted edge: e-SFR of ISO 12233.

An edge a few degrees off the lines of pixels crosses them at ever different places, so that all
lines together sample it many times finer than one. The steps are those of the standard [1]: find
the edge in every line by the centroid of its derivative, fit a line through the places, sort all
pixels by their distance from it into bins a quarter of a pixel wide, take the derivative of the
edge, window it, and transform. What averaging over a bin and the derivative's filter take from
the result is given back: without that MTF50 comes out some percent too low [2], [3].

Pixels come as lattices with their true positions, so that one color of a mosaic is measured from
its own sites and nothing is interpolated.

Why bins are moved: the pixels that fall into a bin seldom lie evenly in it, least of all those of
one color. Each mean is carried along the edge's slope from where its pixels lie to the middle of
the bin; what averaging does then depends on the bin's width alone.

References
----------
.. [1] ISO 12233:2017, Photography - Electronic still picture imaging - Resolution and spatial
   frequency responses, annex D (e-SFR).
.. [2] P. Burns, "Slanted-edge MTF for digital camera and scanner analysis", Proc. IS&T PICS,
   135-138, 2000.
.. [3] K. Masaoka et al., "Modified slanted-edge method and multidirectional modulation transfer
   function estimation", Optics Express 22, 6040-6046, 2014, doi:10.1364/OE.22.006040.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.floats import rms
from vcam_cli.records import dataclass

Floats = NDArray[np.floating]

BINS_PER_PIXEL = 4
"""Sampling of the edge over that of the pixels [1]."""
MAX_FREQUENCY = 0.45
"""Frequency up to which the transfer is given [cycles/bin]."""
WINDOW_FLAT_PART = 0.5
"""Part of the window that does not fall off: wide tails of a lens keep their weight there."""
FIT_ITERATIONS = 3
"""Times that the line is fitted: each time windows lie around the line of the time before."""


@dataclass(frozen=True)
class Lattice:
    """Pixels on straight rows and columns, all of one color."""

    values: Array
    """Values (rows, columns) in any unit."""
    x: Floats
    """Positions of the columns (columns,), rising [m]."""
    y: Floats
    """Positions of the rows (rows,), rising [m]."""

    @property
    def transpose(self) -> Lattice:
        """The same pixels with rows for columns."""
        return Lattice(self.values.T, self.y, self.x)


@dataclass(frozen=True)
class EdgeResponse:
    """Spatial frequency response of one edge, and where the edge lies."""

    frequency: Floats
    """Spatial frequencies across the edge (n,), from 0 [cycles/m]."""
    mtf: Floats
    """Transfer at those frequencies (n,) [dimensionless]; 1 at frequency 0."""
    angle: float
    """Angle of the edge's normal to the x axis, y down [rad]."""
    offset: float
    """Distance of the edge from the origin, along its normal [m]."""
    distance: Floats
    """Centers of the bins (bins,), from the edge [m]."""
    profile: Floats
    """Edge spread function (bins,) in the unit of the values."""
    pitch: float
    """Pitch of the pixels [m]."""

    @property
    def mtf50(self) -> float:
        """First frequency at which the transfer is one half [cycles/m]; inf where it never is."""
        return crossing_frequency(self.frequency, self.mtf, 0.5)


def crossing_frequency(frequency: Floats, mtf: Floats, level: float) -> float:
    """Return the first frequency at which a transfer function falls to a level.

    Parameters
    ----------
    frequency : ndarray
        Spatial frequencies (n,), rising [cycles/m].
    mtf : ndarray
        Transfer at those frequencies (n,) [dimensionless]; straight between them.
    level : float
        Level [dimensionless].

    Returns
    -------
    float
        Frequency [cycles/m]; inf where the level is never reached.
    """
    below = np.flatnonzero(mtf <= level)
    if not len(below):
        return math.inf
    k = int(below[0])
    if k == 0:
        return float(frequency[0])
    part = (mtf[k - 1] - level) / (mtf[k - 1] - mtf[k])
    return float(frequency[k - 1] + part * (frequency[k] - frequency[k - 1]))


def slanted_edge_sfr(
    lattices: Sequence[Lattice], pitch: float, reach: float, degree: int = 1
) -> EdgeResponse:
    """Return the spatial frequency response of a slanted edge, e-SFR of ISO 12233 [1].

    The edge may be near the vertical or the horizontal, and either side may be bright.

    Parameters
    ----------
    lattices : sequence of Lattice
        All pixels of one color.
    pitch : float
        Pitch of the array's pixels [m]; bins are a quarter of it.
    reach : float
        Half the width of the window around the edge [m].
    degree : int
        Degree of the curve through the edge's places: 1 for a lens without distortion.

    Returns
    -------
    EdgeResponse
        The response, and the edge's place.

    Raises
    ------
    ValueError
        No edge is found, or the edge does not cross the lines of pixels.
    """
    upright = _is_upright(lattices)
    seen = lattices if upright else [lattice.transpose for lattice in lattices]
    curve = _fit_edge(seen, reach, degree)
    slope = float(np.polyval(np.polyder(curve), 0.0)) if degree else 0.0
    cosine = math.cos(math.atan(slope))
    width = pitch / BINS_PER_PIXEL
    distance, value = _edge_distances(seen, curve, cosine)
    centers, profile = _bin_means(distance, value, width, reach)
    frequency, mtf = _sfr_of_profile(profile, width)
    angle = -math.atan(slope) if upright else math.pi / 2 + math.atan(slope)
    offset = float(np.polyval(curve, 0.0)) * cosine
    return EdgeResponse(frequency, mtf, angle, offset, centers, profile, pitch)


def _is_upright(lattices: Sequence[Lattice]) -> bool:
    """Return whether the edge is nearer to the columns than to the rows."""
    across = down = 0.0
    for lattice in lattices:
        v = lattice.values.astype(np.float64)
        if min(v.shape) < 4:
            raise ValueError(f"{v.shape[0]} x {v.shape[1]} pixels are too few for an edge")
        across += abs(float(v[:, -1].mean() - v[:, 0].mean()))
        down += abs(float(v[-1].mean() - v[0].mean()))
    if not max(across, down) > 0:
        raise ValueError("no edge: all sides have the same signal")
    return across >= down


def _fit_edge(lattices: Sequence[Lattice], reach: float, degree: int) -> Floats:
    """Return the coefficients of the curve x(y) through the edge, highest power first."""
    curve: Floats = np.zeros(degree + 1)
    for number in range(FIT_ITERATIONS):
        found = [
            _edge_centroids(lattice, None if number == 0 else curve, reach / 2**number)
            for lattice in lattices
        ]
        y, x = (np.concatenate(parts) for parts in zip(*found, strict=True))
        if len(y) < max(4, 2 * degree + 2):
            raise ValueError("the edge is found in too few lines")
        curve = _polyfit_without_outliers(y, x, degree)
    return curve


def _polyfit_without_outliers(y: Floats, x: Floats, degree: int) -> Floats:
    """Fit by least squares, once more without what lies 3 deviations off.

    Noise moves some centroids far away.
    """
    scale = float(np.abs(y).max()) or 1.0
    powers = scale ** -np.arange(degree, -1, -1.0)
    curve = np.polyfit(y / scale, x, degree) * powers
    off = np.abs(x - np.polyval(curve, y))
    near = off <= 3 * max(rms(off), 1e-15)
    if near.sum() > 2 * degree + 2:
        curve = np.polyfit(y[near] / scale, x[near], degree) * powers
    return np.asarray(curve, dtype=np.float64)


def _edge_centroids(lattice: Lattice, curve: Floats | None, reach: float) -> tuple[Floats, Floats]:
    """Return y and x of the edge in every line: the centroid of the derivative, in a cosine window.

    Without a curve the window lies around each line's middle of the rise: smoothed, since noise
    has steep places anywhere.
    """
    slopes = np.diff(lattice.values.astype(np.float64), axis=1)
    between = (lattice.x[1:] + lattice.x[:-1]) / 2
    if curve is None:
        middle = np.full(len(lattice.y), _half_rise(slopes, between))
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


def _half_rise(slopes: Floats, between: Floats) -> float:
    """Return where the mean of all lines rises or falls by half [m]."""
    rise = np.cumsum(slopes.mean(axis=0))
    return float(between[np.argmin(np.abs(rise - rise[-1] / 2))])


def _edge_distances(
    lattices: Sequence[Lattice], curve: Floats, cosine: float
) -> tuple[Floats, Floats]:
    """Return the distance from the edge, along its normal [m], and the value of every pixel."""
    distances, values = [], []
    for lattice in lattices:
        edge = np.polyval(curve, lattice.y)
        distances.append(((lattice.x[None, :] - edge[:, None]) * cosine).ravel())
        values.append(lattice.values.astype(np.float64).ravel())
    return np.concatenate(distances), np.concatenate(values)


def _bin_means(
    distance: Floats, value: Floats, width: float, reach: float
) -> tuple[Floats, Floats]:
    """Return the centers of bins out to `reach`, and means moved to these centers.

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


def _sfr_of_profile(profile: Floats, width: float) -> tuple[Floats, Floats]:
    """Return frequencies [cycles/m] and transfer of an edge profile, corrections included.

    The derivative over two bins passes sinc(2 f w), the bins' average sinc(f w); both are
    divided out. At two cycles a pixel the derivative passes nothing; the result ends before.
    """
    spread = (profile[2:] - profile[:-2]) / 2
    spectrum = np.abs(np.fft.rfft(spread * tukey_window(len(spread), WINDOW_FLAT_PART)))
    frequency = np.fft.rfftfreq(len(spread), width)
    used = frequency * width < MAX_FREQUENCY
    f = frequency[used] * width
    if not spectrum[0] > 0:
        raise ValueError("no edge: both sides have the same signal")
    return frequency[used], spectrum[used] / spectrum[0] / (np.sinc(2 * f) * np.sinc(f))


def tukey_window(count: int, flat: float) -> Floats:
    """Return a Tukey window: 1 over its middle part, falling to 0 as a cosine on both sides.

    Parameters
    ----------
    count : int
        Number of samples.
    flat : float
        Part of the window that is 1, in 0..1.

    Returns
    -------
    ndarray
        Window (count,) [dimensionless].
    """
    at = np.abs(2 * (np.arange(count) + 0.5) / count - 1)
    fall = np.clip((at - flat) / (1 - flat), 0, 1) if flat < 1 else np.zeros(count)
    return np.cos(np.pi / 2 * fall) ** 2
