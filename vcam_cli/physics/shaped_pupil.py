"""The OTF of a pupil of any shape: its samples on a grid, correlated with themselves.

    H(f) = integral P(u - s/2) P*(u + s/2) d2u / area,   s = wavelength f,

with the pupil u in direction cosines on the image side, where light of even radiance has even
power, and P = exp(2 pi i W / wavelength) inside the pupil. It is the full transfer function, of
aberrations and of diffraction.

Cells at the edge count by the part of them that lies inside, sharpened by a 24th of the
Laplacian: the OTF of a disk of 128 samples errs by 2e-4, of 256 by 7e-5. Between lags cubic
splines interpolate what differs from the OTF of a disk, whose cusp at 0 they would blunt. Their
coefficients come from the same transform as the lags: that takes 1.9 ms for 192 samples, recursive
filters of the lags take 4.9.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics import diffraction
from vcam_cli.records import dataclass

FEWEST, MOST = 128, 640
"""Samples across a pupil."""
PER_RADIAN, PER_ROOT_RADIAN = 3.4, 25.0
"""Samples for each radian of phase that half a pupil holds at its steepest place, and for the
square root of those radians: what `pupil_grid` needs for 1e-4 of the light, and half of that."""
LEAST_PER_RADIAN = 1.36
"""Samples a radian of steeper wavefronts, for which `MOST` are too few; 0.64 would alias."""
PARTS = 8
"""Parts along each side that a cell at the edge is cut into."""
MIRRORED_LAGS = 12
"""Lags kept on the far side of the axis, where the spline's coefficients have to settle."""


def exponents(order: int) -> tuple[tuple[int, int], ...]:
    """Return the degrees (i, j) of the polynomials P_i(x) P_j(y) of a wavefront even in y.

    Legendre's, with i + j at most `order`: on a grid they are evaluated axis by axis.
    """
    return tuple((i, j) for j in range(0, order + 1, 2) for i in range(order + 1 - j))


def basis(x: Array, y: Array, order: int) -> Array:
    """Return the polynomials (..., T) of `exponents(order)` at places of the frame."""
    vander = np.polynomial.legendre.legvander
    along, across = vander(x, order), vander(y, order)
    return np.stack([along[..., i] * across[..., j] for i, j in exponents(order)], axis=-1)


def tensor(terms: Array, order: int) -> Array:
    """Return the coefficients (order + 1, order + 1) over the degrees in x and in y."""
    found = np.zeros((order + 1, order + 1))
    for value, (i, j) in zip(terms.tolist(), exponents(order), strict=True):
        found[i, j] = value
    return found


def slopes(terms: Array, order: int, x: Array, y: Array) -> tuple[Array, Array]:
    """Return dW/dx and dW/dy at places of the frame [unit of the terms per half frame]."""
    legendre = np.polynomial.legendre
    whole = tensor(terms, order)
    return (
        legendre.legval2d(x, y, legendre.legder(whole, axis=0)),
        legendre.legval2d(x, y, legendre.legder(whole, axis=1)),
    )


@dataclass(frozen=True, eq=False)
class Mask:
    """What of each cell of a grid over the pupil's frame lies inside; the frame is -1 .. 1."""

    weights: Array
    """(n, n) over y and x, sharpened."""

    @property
    def samples(self) -> int:
        """Samples across, with one beyond the frame on each side."""
        return len(self.weights)

    @property
    def step(self) -> float:
        """Between samples, in half frames."""
        return 2 / (self.samples - 2)

    @property
    def share(self) -> float:
        """Area over that of the frame's disk."""
        return float(self.weights.sum()) * self.step**2 / math.pi


def mask(inside: Callable[[Array, Array], Array], samples: int) -> Mask:
    """Return the mask of a shape.

    Parameters
    ----------
    inside : callable
        From x and y in half frames, of one shape, to whether they lie inside.
    samples : int
        Samples across the frame.

    Returns
    -------
    Mask
        The mask.
    """
    at = _places(samples)
    x, y = np.meshgrid(at, at)
    here = inside(x, y)
    step = 2 / samples
    weights = here.astype(float)
    near = np.zeros(here.shape, bool)
    for axis in (0, 1):  # cells whose neighbors differ, and theirs
        change = np.diff(here, axis=axis)
        near |= np.pad(change, [(1, 0) if a == axis else (0, 0) for a in (0, 1)])
        near |= np.pad(change, [(0, 1) if a == axis else (0, 0) for a in (0, 1)])
    near[1:-1, 1:-1] |= near[2:, 1:-1] | near[:-2, 1:-1] | near[1:-1, 2:] | near[1:-1, :-2]
    part = ((np.arange(PARTS) + 0.5) / PARTS - 0.5) * step
    fine_x = np.broadcast_to(x[near][:, None, None] + part, (near.sum(), PARTS, PARTS))
    fine_y = np.broadcast_to(y[near][:, None, None] + part[:, None], fine_x.shape)
    weights[near] = inside(fine_x, fine_y).mean(axis=(1, 2))
    around = -4 * weights
    around[1:-1, 1:-1] += weights[2:, 1:-1] + weights[:-2, 1:-1]
    around[1:-1, 1:-1] += weights[1:-1, 2:] + weights[1:-1, :-2]
    return Mask((weights - around / 24).astype(np.float32))


def _places(samples: int) -> Array:
    return (np.arange(samples + 2) - (samples + 1) / 2) * (2 / samples)


def samples_across(slope: float) -> int:
    """Return the samples for a wavefront's largest slope [wavelengths per half frame]."""
    radians = 2 * math.pi * slope
    wanted = max(FEWEST, PER_RADIAN * radians, PER_ROOT_RADIAN * math.sqrt(radians))
    return 32 * math.ceil(max(min(wanted, MOST), LEAST_PER_RADIAN * radians) / 32)


@dataclass(frozen=True, eq=False)
class OtfGrid:
    """An OTF over lags in half frames: a disk's, and splines of what differs from it."""

    step: float
    disk: float
    """Radius of that disk."""
    spline: Array
    """Complex coefficients (rows, columns); the lag 0 is at (rows // 2, MIRRORED_LAGS)."""
    farthest: float
    """Lag along each axis up to which it is known; from 2 on there is nothing."""

    @property
    def nbytes(self) -> int:
        """Memory that the coefficients take [bytes]."""
        return self.spline.nbytes

    def interpolate(self, sx: Array, sy: Array) -> Array:
        """Return the OTF at any lags [half frames], which broadcast; 1 at 0."""
        from scipy.ndimage import map_coordinates

        sx, sy = np.broadcast_arrays(np.atleast_1d(sx), sy)
        length = np.hypot(sx, sy)
        inside = (np.abs(sx) <= self.farthest) & (np.abs(sy) <= self.farthest)
        left = (sx < 0) | ((sx == 0) & (sy < 0))
        sign = np.where(left, -1, 1) / self.step
        row = np.where(inside, sign * sy, 0) + self.spline.shape[0] // 2
        column = np.where(inside, sign * sx, 0) + MIRRORED_LAGS
        rest = map_coordinates(self.spline, [row, column], order=3, prefilter=False)
        otf = _disk(length / (2 * self.disk)) + np.where(left, rest.conj(), rest)
        otf = np.where(inside, otf, 0).astype(np.complex128)
        otf /= np.maximum(np.abs(otf), 1.0)
        otf[length == 0] = 1.0
        return otf


def _disk(lag: Array) -> Array:
    """Return the OTF of a disk at lags in its diameters."""
    return np.asarray(diffraction.otf_circular(lag, 1.0, 1.0))


def otf_grid(pupil: Mask, waves: Array, order: int, farthest: float = 2.0) -> OtfGrid:
    """Return the OTF of a pupil with a wavefront.

    Parameters
    ----------
    pupil : Mask
        Its shape.
    waves : ndarray
        Coefficients (T,) of the polynomials of `exponents(order)` over the frame [wavelengths].
    order : int
        Their highest order.
    farthest : float
        Lag along each axis up to which the OTF is wanted [half frames].

    Returns
    -------
    OtfGrid
        The OTF over lags in half frames.
    """
    from vcam_cli.parallel import product  # threads, which a camera file's check does not need

    vander = np.polynomial.legendre.legvander(places(pupil), order)
    turns = product(vander @ tensor(waves, order).T, np.ascontiguousarray(vander.T))
    return grid_of_paths(pupil, turns, farthest)


def places(pupil: Mask) -> Array:
    """Return the places (n,) of a pupil's samples along either axis [half frames]."""
    return _places(pupil.samples - 2)


def grid_of_paths(pupil: Mask, turns: Array, farthest: float = 2.0) -> OtfGrid:
    """Return the OTF of a pupil with a wavefront that is known at its samples.

    Parameters
    ----------
    pupil : Mask
        Its shape.
    turns : ndarray
        Wavefront (n, n) over y and x [wavelengths].
    farthest : float
        Lag along each axis up to which the OTF is wanted [half frames].

    Returns
    -------
    OtfGrid
        The OTF over lags in half frames.
    """
    from scipy import fft

    samples = pupil.samples
    phase = (2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
    field = np.empty(phase.shape, np.complex64)
    np.cos(phase, out=field.real)
    np.sin(phase, out=field.imag)
    field *= pupil.weights
    most = min(math.ceil(farthest / pupil.step) + MIRRORED_LAGS, samples)
    size = fft.next_fast_len(samples + most)
    spectrum = fft.fft(fft.fft(field, size, axis=1), size, axis=0)  # few rows are not empty
    power = spectrum.real**2 + spectrum.imag**2
    # Sharpened weights are right for what two pupils share, their squares are not: at the lag 0
    # all of the light is there.
    total = float(pupil.weights.sum())
    power += np.float32(total - power.mean(dtype=np.float64))
    sharp = _to_spline(size)
    power *= sharp[:, None]
    power *= sharp
    # of a real function only half of the lags are needed; those to the left are conjugate
    lags = fft.rfft2(power)[:, : most + 1] / np.float32(size**2 * total)
    right = np.concatenate([lags[-most:], lags[: most + 1]])
    left = right[::-1, MIRRORED_LAGS:0:-1].conj()
    spline = np.concatenate([left, right], axis=1)
    disk = math.sqrt(pupil.share)
    spline -= _disk_spline(samples, disk)[samples - most : samples + most + 1, : spline.shape[1]]
    return OtfGrid(pupil.step, disk, spline, farthest if most < samples else 2.0)


def _to_spline(size: int) -> Array:
    """Return the factor (size,) by which values become coefficients of their cubic spline.

    It acts on the discrete Fourier transform of values, whose ends meet.
    """
    turns = 2 * np.pi * np.arange(size) / size
    return np.asarray(3 / (2 + np.cos(turns)), np.float32)


@lru_cache(maxsize=2)
def _disk_spline(samples: int, disk: float) -> Array:
    """Return the spline of a disk's OTF at all lags of a grid, as `OtfGrid.spline` has it.

    Wavelengths of one place share it.
    """
    from scipy.ndimage import spline_filter

    down = np.arange(-samples, samples + 1) * (2 / (samples - 2))
    right = down[samples - MIRRORED_LAGS :]
    otf = _disk(np.hypot(down[:, None], right) / (2 * disk))
    return np.asarray(spline_filter(otf, 3, output=np.float32))
