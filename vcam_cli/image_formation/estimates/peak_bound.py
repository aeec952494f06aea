"""A bound from below on the brightest pixel, from a small part of a scene's spectrum.

No mean over pixels with weights that are not negative is brighter than the brightest of them. Means
over smooth windows of pixels need few terms of the cosine series: those whose frequency the pixels
see as nearly constant. Detail that repeats with the pixels is among them, as the constant light
that the pixels make of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import SeparableTransfer
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import SceneSpectrum
from vcam_cli.image_formation.transfer_tables import PARITIES, Tables, reader
from vcam_cli.parallel import pieces, product

WINDOW = 0.35875, 0.48829, 0.14128, 0.01168
"""Amplitudes of the cosines of the Blackman-Harris window, which is nowhere negative and passes
less than 3e-5 of what is off its four lowest frequencies (F. J. Harris, Proc. IEEE 66, 1978,
doi:10.1109/PROC.1978.10837)."""
LENGTHS = 1 / 4, 1.0
"""Lengths of windows over that of the array; the longer tell where the shorter tell nothing: fewer
terms are as constant in them."""
PLACES = 16
"""Windows along each axis."""
MOST, MOST_PART = 1 << 18, 1 / 8
"""Terms that are summed, at most: so many, or that part of all."""
LARGEST_REACH = 1 / 4
"""Reach of a blur over the length of a window from which on windows are no longer moved by it."""
STEP = 1 / 16
"""Distance of the places to which a window is moved, over its length: between them its mean changes
by about 3 %."""
ROWS = 32
"""Rows of terms that are summed together: few enough for the cache."""
KEPT = 3e-5
"""Part of a term that is left in the mean over a window, from which on it is summed."""


def brightest_pixel(
    spectrum: SceneSpectrum,
    axes: tuple[Axis, Axis],
    tables: Tables,
    separable: Sequence[SeparableTransfer],
    rms: float,
    rms_beyond: Callable[[float], float],
    reach: float,
    length: float,
) -> float:
    """Return a signal that the brightest pixel of the array has at least [electrons / s].

    It is that of one color, as if all pixels had it. The terms that are not summed can
    bring no more than their part of the mean square, by Cauchy's inequality; where too many would
    have to be, those of high frequencies are not summed either. A blur that the tables
    leave out makes of the mean over a window one of means over that window moved, by its reach at
    most: the darkest of them counts. Where the reach is no small part of a window, what the mean
    over the array keeps of the light that is further from its border counts.

    Parameters
    ----------
    spectrum : SceneSpectrum
        Spectrum of the scene, mirrored at its borders.
    axes : (Axis, Axis)
        Terms and pixels along x and y.
    tables : Tables
        Transfer functions of the spectrum's planes to that color.
    separable : sequence of SeparableTransfer
        Transfer functions along the axes.
    rms : float
        Root mean square of the signal over the scene, at least [electrons / s].
    rms_beyond : callable
        From a part of the highest frequency along both axes to the root mean square of what lies
        beyond, at least [electrons / s].
    reach : float
        Reach of blurs that are not in the tables [m].
    length : float
        Length of the windows over that of the array.

    Returns
    -------
    float
        The bound; 0 where none is known.
    """
    x, y = axes
    along_x, along_y = _windows(x, reach, length), _windows(y, reach, length)
    if along_x is None or along_y is None:
        return 0.0
    count, most = len(along_x.terms) * len(along_y.terms), max(MOST, x.terms * y.terms * MOST_PART)
    part = math.sqrt(most / count) if count > most else 1.0
    along_x, along_y = along_x.below(part), along_y.below(part)
    fx, fy = x.frequencies[along_x.terms], y.frequencies[along_y.terms]
    (index_x, factor_x), (index_y, factor_y) = along_x.coefficients, along_y.coefficients
    for effect in separable:
        factor_x = factor_x * effect.along_x(fx)
        factor_y = factor_y * effect.along_y(fy)
    shorter = min(along_x.length, along_y.length)
    is_wide = reach > shorter * LARGEST_REACH
    steps = 0 if is_wide else math.ceil(reach / (shorter * STEP))
    moved = np.linspace(-reach, reach, 2 * steps + 1) if steps else np.zeros(1)
    signal = np.zeros((len(along_y.centers) * len(moved), len(along_x.centers) * len(moved)))
    for parity in tables.parities:
        odd_x, odd_y = PARITIES[parity]
        table = reader(tables, parity, fx)
        over_x = (along_x.waves(odd_x, moved) * factor_x).T
        over_y = along_y.waves(odd_y, moved) * factor_y
        for rows in pieces(len(fy), ROWS):
            light: NDArray = np.zeros(1)
            for plane, of_plane in enumerate(table.values(fy[rows])[:, 0]):
                light = light + of_plane * spectrum.terms(plane, index_y[rows], index_x)
            signal += over_y[:, rows] @ product(light, over_x)
    every, below, summed = np.multiply(along_x.power, along_y.power)
    left_out = math.sqrt(max(below - summed, 0.0) * len(tables.parities)) * rms
    if part < 1:
        beyond = max(every - below, 0.0) * len(tables.parities)
        left_out += math.sqrt(beyond) * rms_beyond(part)
    if is_wide:
        return max(0.0, along_x.share * along_y.share * (float(signal.mean()) - left_out))
    darkest = signal.reshape(len(along_y.centers), len(moved), -1, len(moved)).min(axis=(1, 3))
    return max(0.0, float(darkest.max()) - left_out)


def brightest_of_mosaic(
    mosaic: Mosaic,
    spectrum: SceneSpectrum,
    axes: tuple[Axis, Axis],
    tables: Tables,
    separable: Sequence[SeparableTransfer],
    rms: float,
    rms_beyond: Callable[[float], float],
    reach: float,
) -> float:
    """Return the same for an array whose pixels have the colors of a mosaic [electrons / s].

    Detail as fine as its block may be bright on the pixels of one color and dark on all others, so
    the color of most light is followed on pixels of its own: those of its first place in the block.
    """
    index = tables.brightest_color
    color = mosaic.colors[index]
    row = next(i for i, line in enumerate(mosaic.block) if color in line)
    column = mosaic.block[row].index(color)
    x = _every_nth(axes[0], column, len(mosaic.block[row]))
    y = _every_nth(axes[1], row, len(mosaic.block))
    if not (x.pixels and y.pixels):
        return 0.0
    known = spectrum, (x, y), tables.of_color(index), separable, rms, rms_beyond, reach
    bounds = (brightest_pixel(*known, length) for length in LENGTHS)
    return next((bound for bound in bounds if bound > 0), 0.0)


def _every_nth(axis: Axis, first: int, step: int) -> Axis:
    """Return an axis with every n-th of its pixels, from the first of them on."""
    return replace(
        axis,
        pixels=len(range(first, axis.pixels, step)),
        pixel_pitch=step * axis.pixel_pitch,
        first=axis.first + first * axis.pixel_pitch,
    )


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of pixels along an axis, and the terms of the series that count in them."""

    axis: Axis
    left: NDArray
    """(terms of the axis,) Part of each of them that is left in the mean over a window."""
    count: int
    """Terms up to the highest frequency that is summed."""
    centers: NDArray
    """(p,) Centers of the windows, from the scene's edge [m]."""
    length: float
    """Length of a window [m]."""
    share: float
    """Weight of a pixel in the mean over the array over that in the mean of all windows, at
    least."""

    def below(self, part: float) -> Windows:
        """Return them with the terms up to a part of the axis's highest frequency alone."""
        return replace(self, count=max(1, int(part * self.axis.terms)))

    @cached_property
    def terms(self) -> NDArray:
        """The terms that count (m,), rising."""
        return np.flatnonzero(np.abs(self.left[: self.count]) > KEPT)

    @property
    def power(self) -> tuple[float, float, float]:
        """Sum of the squares of what is left, each over the mean square of its wave.

        That of all terms, of those up to the highest frequency that is summed, and of those that
        count.
        """
        power = np.square(self.left) * _twice(np.arange(self.axis.terms))
        every, below, kept = power, power[: self.count], power[self.terms]
        return float(every.sum()), float(below.sum()), float(kept.sum())

    @property
    def coefficients(self) -> tuple[NDArray, NDArray]:
        """The coefficients behind the terms, and what the mean over a window has of them: (m,)."""
        index, sign = self.axis.coefficient_index(self.terms)
        left = self.left[self.terms]
        return index, sign * left * self.axis.weights[self.terms] * _twice(self.terms)

    def waves(self, odd: bool, moved: NDArray) -> NDArray:
        """Return every term, as cosine or sine, at every center, moved by so much [m]: (p, m)."""
        places = np.add.outer(self.centers, moved).ravel()
        angle = np.outer(places, 2 * np.pi * self.axis.frequencies[self.terms])
        return np.sin(angle) if odd else np.cos(angle)


def _twice(terms: NDArray) -> NDArray:
    """Return how often a DCT counts each term; the inverse of the mean square of its wave."""
    return np.where(terms > 0, 2, 1)


def _windows(axis: Axis, reach: float, length: float) -> Windows | None:
    """Return windows all over the array's side; None where blurs left out are wider than it.

    Their length is relative to that side.
    What such blurs move by their reach is still on the array, if it is not nearer to its border,
    or mirrored there.
    """
    pitch = abs(axis.pixel_pitch)  # negative where the scene overtakes the shutter
    aside = 0 if axis.virtual_pixels == axis.pixels else math.ceil(reach / pitch)
    inside = axis.pixels - 2 * aside
    if inside < 1:
        return None
    pixels = max(math.floor(length * inside), 1)
    starts = np.unique(np.rint(np.linspace(aside, aside + inside - pixels, PLACES))).astype(int)
    return Windows(
        axis=axis,
        left=window_spectrum(2 * np.pi * axis.frequencies * axis.pixel_pitch, pixels),
        count=axis.terms,
        centers=axis.first + (starts + (pixels - 1) / 2) * axis.pixel_pitch,
        length=pixels * pitch,
        share=_share_of_mean(starts, pixels, axis.pixels),
    )


def _share_of_mean(starts: NDArray, pixels: int, array: int) -> float:
    """Return the least weight of a pixel in the mean over the array, over that in all windows."""
    weight = window(pixels)
    total = np.zeros(array)
    for start in starts:
        total[start : start + pixels] += weight
    return len(starts) / (array * float(total.max()))


def window(pixels: int) -> NDArray:
    """Return the weights of a window of so many pixels, whose sum is 1."""
    place = (np.arange(pixels) + 0.5) / pixels - 0.5
    weights = np.cos(2 * np.pi * np.outer(place, np.arange(len(WINDOW)))) @ np.array(WINDOW)
    return weights / weights.sum()


def window_spectrum(angle: NDArray, pixels: int) -> NDArray:
    """Return the mean over a window of waves that have so much phase from pixel to pixel [rad].

    The phase is 0 at the window's center.
    """
    angle = np.append(angle, 0.0)
    total = WINDOW[0] * _dirichlet(angle, pixels)
    for number, amplitude in enumerate(WINDOW[1:], start=1):
        for shift in (2 * np.pi * number / pixels, -2 * np.pi * number / pixels):
            total += amplitude / 2 * _dirichlet(angle + shift, pixels)
    return total[:-1] / total[-1]


def _dirichlet(angle: NDArray, pixels: int) -> NDArray:
    """Return the sum of so many waves with this phase from one to the next, 0 in their middle."""
    half = angle / 2
    below, total = np.sin(half), np.sin(pixels * half)
    even = np.abs(below) < 1e-9
    total[~even] /= below[~even]
    total[even] = pixels * np.cos(pixels * half[even]) / np.cos(half[even])
    return total
