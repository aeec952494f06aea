"""A map of depth, cut into layers as finely as a tolerance asks, and what lies hidden behind.

A point at the distance d blurs to a disc whose radius is a line of 1 / d, signed: positive before
what is in focus. So the cuts are made in that radius. A sample between two layers belongs to both,
in the shares by which its radius lies between theirs: their blurs, so mixed, are its own up to the
second order of the layers' spacing,

    T(r) = (1 - w) T(r_i) + w T(r_i+1) + O((r_i - r_i+1)^2).

How wide the spacing may be, the power spectrum of 4 w (1 - w) times the picture tells, behind the
blurs' second difference. Even light has detail, too, where shares change. But layers are composed
such that even light stays even: light counts by what it differs from the mean, and cover that is
not 1 by the contrast of what it mixes.

Behind a sample with farther ones beside it, so near that rays through the aperture pass it, what
the picture does not show goes on as the nearest of these: its light and its distance. A second
guess, the picture's mirror image at the edge, estimates its error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.depth_detail import Detail
from vcam_cli.scenes.depth_slopes import slopes

MOST_LAYERS = 256
"""Layers of a picture, at most."""
FINEST = 2e-5
"""Error of the cuts below which no more layers are made, rms, relative to full signal."""
BETWEEN = math.sqrt(8 / 15)
"""Rms over all places between two layers of an error that is largest in the middle, 4 t (1 - t).
Spacings are chosen alike by it; how wide they may be, the shares themselves tell."""
TRIES = 8
"""Cuts that are tried. Errors fall as the square of the spacing: two or three are enough."""
LEAST_JUMP = 0.1
"""Difference of blur radii above which one sample hides another [pixels]. At `standard` random
depths then err by 1e-3 of full signal, by 6e-4 with half of it, by 2e-2 with ten times as much."""
STEPS = 24
"""Groups of radii, each searched at once for the background behind it. A matter of cost: with 12 to
200 random depths change by less than 1e-4 of full signal."""
EDGE = 1.0
"""Samples by which the middles of those at an edge are apart."""
FEW = 10_000
"""Samples that tell whether a map has few values."""


@dataclass(frozen=True)
class Hidden:
    """What lies behind samples that other samples beside them are far behind of."""

    samples: Array
    """Index (n,) of the samples that hide it, in the flattened map."""
    sources: Array
    """Index (n,) of the samples as which it goes on."""
    unknown: float
    """Rms difference of two guesses of its light, relative to full signal."""
    most_unknown: float
    """The largest difference of both."""


@dataclass(frozen=True)
class DepthCut:
    """A map of depth in layers."""

    radii: Array
    """Radius (N,) of the blur at each layer's distance, falling: the nearest first [m]."""
    first: Array
    """Layer (h, w) that a sample belongs to, or the nearer one of both."""
    share: Array
    """Share (h, w) of each sample that belongs to the layer behind it."""
    hidden: Hidden
    error: float
    """Predicted rms error by the layers' spacing, relative to full signal."""

    def coverage(self, layer: int, rows: Array, columns: Array) -> Array:
        """Return what part of samples belongs to a layer.

        Parameters
        ----------
        layer : int
            Number of the layer.
        rows, columns : Array
            Indices (m,) and (n,) of the samples.

        Returns
        -------
        Array
            Parts (m, n), from 0 to 1.
        """
        here = np.ix_(rows, columns)
        first, share = self.first[here], self.share[here]
        return np.where(first == layer, 1 - share, np.where(first == layer - 1, share, 0))

    def radius(self, samples: Array) -> Array:
        """Return the blur's radius of samples.

        Parameters
        ----------
        samples : Array
            Their indices (n,) in the flattened map.

        Returns
        -------
        Array
            Radii (n,) [m], positive when nearer than the focus.
        """
        first, share = self.first.ravel()[samples].astype(int), self.share.ravel()[samples]
        behind = np.minimum(first + 1, len(self.radii) - 1)
        return np.asarray(self.radii[first] * (1 - share) + self.radii[behind] * share)

    def is_used(self) -> Array:
        """Return which layers (N,) anything lies in."""
        count = len(self.radii)
        near = np.bincount(self.first.ravel(), minlength=count)
        behind = np.bincount(self.first[self.share > 0].ravel() + 1, minlength=count)
        return np.asarray(near[:count] + behind[:count] > 0)


def is_flat(radius: Array, detail: Detail, allowed: float) -> bool:
    """Return whether a map of blur radii may be taken as one distance, in the middle of all.

    Parameters
    ----------
    radius : Array
        Radii of the blur [m].
    detail : Detail
        Detail of the picture.
    allowed : float
        Rms change that counts for nothing, over full signal.

    Returns
    -------
    bool
        Whether the change is at most `allowed` at both ends of the map.
    """
    low, high = float(radius.min()), float(radius.max())
    middle = (low + high) / 2
    return max(detail.blur_change((1, middle), (-1, end)) for end in (low, high)) <= allowed


def cut_depth(
    radius: Array,
    picture: Array,
    pitch: float,
    pixel: float,
    detail_of: Callable[[Array], Detail],
    allowed: float,
) -> DepthCut:
    """Cut a picture into layers.

    Parameters
    ----------
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [m].
    picture : Array
        Light (h, w), relative to white.
    pitch : float
        Pitch of the samples on the sensor [m].
    pixel : float
        Side of the pixels [m].
    detail_of : callable
        What returns the detail of light (h, w) on the same samples.
    allowed : float
        Error that the cut may leave, rms, relative to full signal.

    Returns
    -------
    DepthCut
        The layers.
    """
    allowed = max(allowed, FINEST)
    detail, aim = detail_of(picture), allowed
    for _ in range(TRIES):
        radii, reached = _layer_radii(radius, detail, aim)
        values = _few_values(radius, len(radii))
        radii = radii if values is None else values
        first, share = _shares(radius, radii)
        if len(radii) == 1:
            error = reached if values is None else 0.0
        else:
            error = _mixing_error(radii, picture, first, share, detail, detail_of)
        if error <= allowed or reached > aim:
            break
        aim *= max(0.9 * allowed / error, 0.1)
    hidden = _hidden(radius / pitch, picture, LEAST_JUMP * pixel / pitch)
    return DepthCut(radii, first, share, hidden, error)


def _shares(radius: Array, radii: Array) -> tuple[Array, Array]:
    """Return the layer (h, w) of every sample, the nearer one of two, and the farther one's share.

    Parameters are the samples' radii (h, w) and those of the layers (N,), falling.
    """
    if len(radii) == 1:
        return np.zeros(radius.shape, np.uint16), np.zeros(radius.shape, np.float32)
    place = np.interp(-radius, -radii, np.arange(len(radii)))
    first = np.minimum(place, len(radii) - 2).astype(np.uint16)
    return first, (place - first).astype(np.float32)


def _mixing_error(
    radii: Array,
    picture: Array,
    first: Array,
    share: Array,
    detail: Detail,
    detail_of: Callable[[Array], Detail],
) -> float:
    """Return the rms error, over full signal, of blurs that are mixed of two layers'.

    What all pairs of layers lack adds up as mean squares: with its signs it is 0.2 to 1.04 times
    as much on slopes of 4 to 38 layers. That of light and that of cover add up.
    """
    mixed, contrast = 4 * share * (1 - share), picture - picture.mean()
    squares = np.zeros(2)
    for number, (near, far) in enumerate(pairwise(radii)):
        here = np.where(first == number, mixed, 0)
        if here.any():
            lacks = (1, (near + far) / 2), (-0.5, near), (-0.5, far)
            lost = [detail_of(light).blur_change(*lacks) for light in (here * contrast, here)]
            squares += np.square(lost)
    light, cover = np.sqrt(squares)
    seen = detail.rms(np.ones_like(detail.frequency)) * detail.full
    return float(light + seen * cover)


def _layer_radii(radius: Array, detail: Detail, allowed: float) -> tuple[Array, float]:
    """Return the layers' radii, from the largest to the smallest, and the error between them.

    What is in focus is a layer of its own. Light that spots of rays bring across an edge is
    proportional to |r|, so mixtures of blurs on both sides of the focus err by the first order.
    """
    high, low = float(radius.max()), float(radius.min())
    if is_flat(radius, detail, allowed):
        return np.array([(high + low) / 2]), allowed
    while True:
        radii = [high]
        while radii[-1] > low and len(radii) <= MOST_LAYERS:
            end = 0.0 if radii[-1] > 0 > low else low
            radii.append(_next_radius(radii[-1], end, detail, allowed))
        if len(radii) <= MOST_LAYERS:
            return np.array(radii), allowed
        allowed *= 1.5


def _next_radius(start: float, low: float, detail: Detail, allowed: float) -> float:
    """Return the smallest radius down to which the blurs between are mixtures of the ends'."""

    def error(end: float) -> float:
        middle = (start + end) / 2
        return BETWEEN * detail.blur_change((1, middle), (-0.5, start), (-0.5, end))

    near, far = start, low
    if error(low) <= allowed and error((start + low) / 2) <= allowed:
        return low
    for _ in range(30):
        middle = (near + far) / 2
        near, far = (middle, far) if error(middle) <= allowed else (near, middle)
    return near if near < start - 1e-9 * abs(start - low) else (start + far) / 2


def _few_values(radius: Array, most: int) -> Array | None:
    """Return the values of a map, falling, where they are few; else None."""
    flat = radius.ravel()
    for part in (flat[:: max(len(flat) // FEW, 1)], flat):
        values = np.unique(part)[::-1]
        if len(values) > most:
            return None
    return np.asarray(values)


def _hidden(radius: Array, picture: Array, jump: float) -> Hidden:
    """Return what lies hidden; radii and the least jump are counted in samples."""
    samples, sources = [], []
    for behind, source in _sources(radius, jump):
        samples.append(behind)
        sources.append(source)
    if not sum(map(len, samples)):
        none = np.zeros(0, int)
        return Hidden(none, none, 0.0, 0.0)
    behind, source = np.concatenate(samples), np.concatenate(sources)
    difference = picture.ravel()[source] - picture.ravel()[_mirrored(radius, behind, source, jump)]
    full = min(float(picture.max()), 1.0) or 1.0
    rms = float(np.sqrt(np.square(difference, dtype=float).mean())) / full
    return Hidden(behind, source, rms, float(np.abs(difference).max()) / full)


def _sources(radius: Array, jump: float) -> Iterator[tuple[Array, Array]]:
    """Yield samples behind which something lies hidden, and the farther ones as which it goes on.

    Rays see as far behind a sample as both radii differ.
    """
    from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

    low, high = float(radius.min()), float(radius.max())
    if high - low < jump:
        return
    reach = min(int(np.ceil(high - low + EDGE)), max(radius.shape))
    over = radius - minimum_filter(radius, 2 * reach + 1, mode="nearest") >= jump
    over &= maximum_filter(_at_jumps(radius, jump), 2 * reach + 1, mode="constant")
    group = max((high - low) / STEPS, jump)
    number = np.where(over, ((radius - low) / group).astype(int), -1)
    for step in np.unique(number[over]):
        rows, columns = (np.flatnonzero((number == step).any(axis=axis)) for axis in (1, 0))
        window = tuple(
            slice(max(at[0] - reach, 0), min(at[-1] + reach + 1, count))
            for at, count in zip((rows, columns), radius.shape, strict=True)
        )
        near, own = number[window] == step, radius[window]
        far = own <= own[near].min() - jump
        if not far.any():
            continue
        apart, index = distance_transform_edt(~far, return_indices=True)
        seen = near & (apart <= own - own[tuple(index)] + EDGE)
        y, x = np.nonzero(seen)
        top, left, width = window[0].start, window[1].start, radius.shape[1]
        yield (
            (y + top) * width + x + left,
            (index[0][seen] + top) * width + index[1][seen] + left,
        )


def _at_jumps(radius: Array, jump: float) -> Array:
    """Return the samples (h, w) beside which the radius jumps: rays do not pass by a slope."""
    found = np.zeros(radius.shape, bool)
    for axis, slope in enumerate(slopes(radius)):
        jumps = np.moveaxis(np.abs(np.diff(radius, axis=axis) - slope) >= jump, axis, 0)
        own = np.moveaxis(found, axis, 0)
        own[:-1] |= jumps
        own[1:] |= jumps
    return found


def _mirrored(radius: Array, behind: Array, source: Array, jump: float) -> Array:
    """Return the samples as which what is hidden goes on mirrored at its edge, where they may be.

    Elsewhere they are the sources themselves.
    """
    shape, flat = radius.shape, radius.ravel()
    own, other = np.unravel_index(behind, shape), np.unravel_index(source, shape)
    places = [2 * b - a for a, b in zip(own, other, strict=True)]
    inside = [np.clip(p, 0, count - 1) for p, count in zip(places, shape, strict=True)]
    found = np.ravel_multi_index(tuple(inside), shape)
    return np.where(flat[found] <= flat[behind] - jump, found, source)
