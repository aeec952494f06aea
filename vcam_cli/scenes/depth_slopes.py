"""The light of slopes of depth, which rays see denser on their one side.

The rays through the point u of the aperture (in its radii) see the sample at x of a picture at
p = x - r u, where r(x) is the radius of its blur. A surface whose r rises by g = grad r a length
lies under them 1 - g u times as densely, which its image has to first order,

    E(p) = integral L(x) mean_u[(1 - g u) delta(p - x + r u)] dx.

A sample that faces the lens has the 1 alone. What is missing has the transfer
i g f / |f| 2 J2(z) / z with z = 2 pi |f| r, that of a disc of light displaced by d = r g / 4 has
i g f / |f| J1(z) / 2, and both start as z / 4. So samples are taken to lie at x + d, their light to
be L - d grad L; that is exact for light which changes little over a blur, and what is left of finer
detail is predicted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scenes.depth_cut import Detail, block_means, disc_transfer

STEEPEST = 1.0
"""Difference of the radii of samples side by side from which on they are no slope, whatever else
says so: it would fold under the rays [samples]."""
GROUPS = 16
"""Groups of radii by which what slopes change is predicted."""
MARGIN = 1.7
"""Factor on what is predicted, fitted: without it, on four slopes of 0.13 to 0.19 with pictures of
discs, 0.57 to 0.71 of what was measured was predicted."""


def displaced(light: NDArray, radius: NDArray, jump: float = STEEPEST) -> NDArray:
    """Return light as if each sample lay where a slope's rays see it in the mean.

    Parameters
    ----------
    light : NDArray
        Light (h, w) of samples.
    radius : NDArray
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].
    jump : float, optional
        Difference of radii from which on one sample hides another, and is no slope [samples].

    Returns
    -------
    NDArray
        Light (h, w), in the same type.
    """
    change = np.zeros(light.shape, light.dtype)
    for axis in (0, 1):
        slope, (before, after) = _slope(light, radius, axis, jump)
        change += slope * (before + after) / 2
    return np.asarray(light - change * (radius / 4).astype(light.dtype))


def slope_light(light: NDArray, radius: NDArray, jump: float = STEEPEST) -> NDArray:
    """Return d grad L (h, w), the change of light by slopes, taken between samples side by side.

    Parameters are those of `displaced`, which takes it over two samples.
    """
    change = np.zeros(light.shape)
    for axis in (0, 1):
        slope, (_, after) = _slope(light, radius, axis, jump)
        change += slope * after
    return np.asarray(change * radius / 4)


def _slope(
    light: NDArray, radius: NDArray, axis: int, jump: float
) -> tuple[NDArray, tuple[NDArray, NDArray]]:
    """Return the slope of the radius along an axis, and the rises of light before and after.

    The slope is the smaller of both sides', and 0 where they differ in sign (the minmod limiter of
    P. L. Roe, Annu. Rev. Fluid Mech. 18, 337, 1986): planes one behind the other have none.
    """
    rise = np.diff(radius, axis=axis)
    is_slope = np.abs(rise) < min(jump, STEEPEST)
    before, after = _sides(np.where(is_slope, rise, 0).astype(light.dtype), axis)
    smaller = np.where(np.abs(before) < np.abs(after), before, after)
    slope = np.where(before * after > 0, smaller, 0)
    return slope, _sides(np.where(is_slope, np.diff(light, axis=axis), 0), axis)


def _sides(rises: NDArray, axis: int) -> tuple[NDArray, NDArray]:
    """Return the rises between samples before and after each sample; none beyond the ends."""
    ends = [(1, 1) if along == axis else (0, 0) for along in (0, 1)]
    padded = np.pad(rises, ends)
    return np.split(padded, [-1], axis)[0], np.split(padded, [1], axis)[1]


def mean_slope(radius: NDArray, side: int) -> float:
    """Return by how much the radius rises over a length, rms, where nothing is hidden.

    Parameters
    ----------
    radius : NDArray
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].
    side : int
        Side of a pixel, within which steps of a map are taken together [samples].

    Returns
    -------
    float
        Slope without unit.
    """
    squares = 0.0
    for axis in (0, 1):
        rise = np.diff(radius, axis=axis)
        if rise.size:
            means = block_means(np.where(np.abs(rise) < STEEPEST, rise, 0), side)
            squares += float(np.square(means).mean())
    return math.sqrt(squares)


def undisplaced_error(detail: Detail, radius: NDArray, pitch: float, side: int) -> float:
    """Return the rms error, over full signal, of a picture whose samples stay where they are.

    It counts what slopes change as 2 J2(z) / z of all detail, and so the steps of a coarse map,
    over which no sample is displaced.

    Parameters
    ----------
    detail : Detail
        Detail of the picture.
    radius : NDArray
        Radius (h, w) of the blur at every sample's distance, with its sign [m].
    pitch : float
        Pitch of the samples [m].
    side : int
        Side of a pixel [samples].

    Returns
    -------
    float
        Error without unit.
    """
    middle = float(np.sqrt(np.square(radius).mean()))
    z = 2 * np.pi * detail.frequency * middle
    tilt = detail.rms(z / 4 * _paraboloid(detail, middle)) / math.sqrt(2)
    return mean_slope(radius / pitch, side) * tilt


@dataclass(frozen=True)
class SlopeBlur:
    """How far the light of slopes is blurred, in groups of radii."""

    radii: NDArray
    """Radii (n,) [m]."""
    shares: NDArray
    """Part (n,) of the mean square of `slope_light` that each group has."""
    pitch: float
    """Pitch of the samples [m]."""

    @classmethod
    def of(cls, light: NDArray, radius: NDArray, pitch: float) -> SlopeBlur:
        """Return that of light (h, w) of slopes with radii (h, w) [m]."""
        size, squares = np.abs(radius).ravel(), np.square(light).ravel()
        edges = np.linspace(size.min(), size.max(), GROUPS + 1)
        group = np.clip(np.searchsorted(edges, size) - 1, 0, GROUPS - 1)
        weight = np.bincount(group, squares, GROUPS)
        there = weight > 0
        mean = np.bincount(group, squares * np.square(size), GROUPS)[there] / weight[there]
        return cls(np.sqrt(mean), weight[there] / weight.sum(), pitch)

    def change(self, detail: Detail) -> float:
        """Return the rms, over full signal, of what slopes change, by the detail of their light."""
        return self._rms(detail, lambda radius: _paraboloid(detail, radius))

    def error(self, detail: Detail) -> float:
        """Return the rms, over full signal, of what displaced samples leave of that."""
        along = np.sinc(2 * self._cycles(detail))
        return self._rms(
            detail,
            lambda radius: (
                _paraboloid(detail, radius) - along * disc_transfer(detail.frequency, radius)
            ),
        )

    def _rms(self, detail: Detail, transfer: Callable[[float], NDArray]) -> float:
        between = np.sinc(self._cycles(detail))
        squares = [detail.rms(transfer(float(radius)) / between) ** 2 for radius in self.radii]
        return MARGIN * math.sqrt(float(self.shares @ squares))

    def _cycles(self, detail: Detail) -> NDArray:
        """Return frequencies [cycles/sample], those beyond a row's last one as that."""
        return np.minimum(detail.frequency * self.pitch, 0.5)


def _paraboloid(detail: Detail, radius: float) -> NDArray:
    """Return the transfer 8 J2(z) / z^2 of a paraboloid, what 2 J2(z) / z is over z / 4."""
    from scipy.special import jv

    z = 2 * np.pi * detail.frequency * abs(radius)
    return np.where(z > 1e-3, 8 * jv(2, z) / np.where(z > 1e-3, z, 1.0) ** 2, 1.0)
