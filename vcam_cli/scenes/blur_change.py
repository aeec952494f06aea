"""What a blur changes of a scene, at most: bounds that each kind of scene computes for itself.

A blur with the transfer H takes |1 - H(f)| from a wave of the frequency f. All that is known of it
here is how far it displaces light in the mean, s:

    |1 - H(f)| <= min(M, 2 pi |f| s),   M = 1 where H is never negative, else 2.

Light that is the same all over between edges has edges alone for its derivatives. With the heights
A_i and the places u_i of parallel edges, the change has for each unit of their length the energy

    sum_ij A_i A_j G(u_i - u_j),   G(u) = integral min(M / (2 pi f), s)^2 cos(2 pi f u) df,

and in two directions no more than the sum of both, since min(M, a + b)^2 <= min(M, a)^2 + min(M,
b)^2 for squares a and b. G(0) = 2 s M / pi. Pixels see means over their photodetectors: the mean
square over pixels is at most that over all places, divided by the fill factor (Jensen).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache, remembered
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.records import dataclass
from vcam_cli.scenes.closed_form import Profile


@dataclass(frozen=True)
class BlurLoss:
    """A blur before light of several components, colors and wavelengths."""

    weights: Array
    """Signal (K, C, J) of a component of 1 in each color, by wavelength [e/s]."""
    spread: Array
    """How far it displaces light in the mean, at most (J,) [m]."""
    most: float
    """Bound on |1 - H|."""
    is_even: bool = True
    """Whether its kernel is symmetric along x and along y. Before a mirrored picture any other may
    change one of the four mirror images by all of what it changes in them."""
    is_uniform: bool = True
    """Whether it is the same everywhere."""
    aperture: float = 0.0
    """Width over which pixels average what it displaces [m]; 0 of a blur, which may act behind."""

    @property
    def level(self) -> Array:
        """Signal (K, C) of a component of 1 [e/s]."""
        level: Array = np.abs(self.weights).sum(axis=2)
        return level

    def of_wave(self, amplitudes: Array, frequency: float) -> Array:
        """Return the most that is taken from a wave, (C,) [e/s], wherever it is looked at.

        Parameters
        ----------
        amplitudes : Array
            Amplitudes (K,) of the components.
        frequency : float
            Spatial frequency [cycles/m].
        """
        lost = np.minimum(self.most, 2 * np.pi * frequency * self.spread)
        return np.asarray(np.abs(np.tensordot(amplitudes, self.weights, axes=1)) @ lost)


@dataclass(frozen=True)
class ChangeBounds:
    """What blurs change of a scene, at most."""

    full: float
    """The largest signal on the array, at least; at most what fills a pixel [e/s]."""
    changes: list[float]
    """Rms change of the mean signal over the array by leaving out each blur, in the color of most;
    inf where no bound is known [e/s]."""

    def shares(self) -> list[float]:
        """Return the changes over full signal; 0 where nothing changes."""
        return [
            change / self.full if self.full > 0 else (math.inf if change else 0.0)
            for change in self.changes
        ]


WIDEST = 1.0
"""Spread of a blur without a known bound, in numbers that stay finite [m]."""


def edge_energy(distance: Array, spread: Array, most: float, aperture: float = 0.0) -> Array:
    """Return G(u), what a blur changes of two edges of height 1 together, of each unit of length.

    Parameters
    ----------
    distance : Array
        Distances u between edges, of any shape [m].
    spread : Array
        How far the blur displaces light in the mean (J,) [m].
    most : float
        Bound on |1 - H|.
    aperture : float, optional
        Width over which pixels average [m]: of a mean over p there is sinc(f p) of a wave, and
        integral s^2 sinc(f p)^2 cos(2 pi f u) df = s^2 (1 - |u| / p) / p bounds what is displaced.

    Returns
    -------
    Array
        G (J, *shape) [m].
    """
    from scipy.special import sici

    spread = np.minimum(spread, WIDEST).reshape(-1, *(1,) * distance.ndim)
    if spread.max() < aperture / 2:
        return np.asarray(spread**2 * np.maximum(1 - np.abs(distance) / aperture, 0) / aperture)
    end = most / (2 * np.pi * np.maximum(spread, 1e-30))  # where both bounds meet
    phase = 2 * np.pi * end * np.abs(distance)
    integral, _ = sici(phase)
    below = 2 * spread**2 * end * np.sinc(phase / np.pi)
    beyond = np.cos(phase) - phase * (np.pi / 2 - integral)
    return np.asarray(below + 2 * (most / (2 * np.pi)) ** 2 / end * beyond)


def parallel_edges_change(places: Array, heights: Array, lengths: Array, loss: BlurLoss) -> Array:
    """Return the integral of the squared change across parallel edges.

    Parameters
    ----------
    places : Array
        Places (n,) of the edges [m].
    heights : Array
        Steps (K, r, n) of the components at the edges, in r strips.
    lengths : Array
        Lengths (r,) of the strips along the edges [m].
    loss : BlurLoss
        The blur.

    Returns
    -------
    Array
        Integrals (C, J) for each wavelength by itself [(e/s)^2 m^2].
    """
    arrays = places, heights, lengths, loss.weights, loss.spread
    key = *(a.tobytes() for a in arrays), heights.shape, loss.most, loss.aperture
    return _INTEGRALS.get(key, partial(_integrals, places, heights, lengths, loss))


_INTEGRALS: ByteCache[Array] = ByteCache(1 << 14)
"""Those of the last blurs: a camera that times its exposure by a scene that moves plans the light
of the scene at rest, too. Of a step wedge they are a fifth of the plan's time."""


def _integrals(places: Array, heights: Array, lengths: Array, loss: BlurLoss) -> Array:
    """Return what `parallel_edges_change` does, computed."""
    steps = np.tensordot(loss.weights, heights, axes=(0, 0))  # (C, J, r, n)
    i, j = _pairs(len(places))
    both = np.empty((len(loss.spread), len(places), len(places)))
    energy = edge_energy(places[j] - places[i], loss.spread, loss.most, loss.aperture)
    both[:, i, j] = both[:, j, i] = energy
    pairs = np.sum(np.matmul(steps, both) * steps, axis=-1)
    changes: Array = np.maximum(pairs, 0.0) @ lengths
    return changes


_pairs = remembered(8)(np.triu_indices)
"""Indices of the pairs of a number of edges: of few edges they take a third of the time."""


def squares_factor(pitch: float, loss: BlurLoss) -> Array:
    """Return the rms change of a picture over the rms of its steps from sample to sample.

    Samples are uniform squares of light. Of all frequencies that the grid cannot tell apart, f + m
    / pitch, the bound is (s / pitch)^2 for m = 0 and min(M / (2 pi (m + x)), s / pitch)^2 else, x =
    f pitch from -1/2 to 1/2; their sum is largest for x = 1/2.

    Parameters
    ----------
    pitch : float
        Pitch of the samples, the smaller of both [m].
    loss : BlurLoss
        The blur.

    Returns
    -------
    Array
        Factors (J,) without unit.
    """
    own = (loss.spread / pitch) ** 2
    if (
        loss.spread.max() < loss.aperture / 2
    ):  # of shell m pixels leave 1 / (pi (m - 1/2) p / pitch)
        return np.sqrt(own * (1 + (pitch / loss.aperture) ** 2))
    shell = np.arange(SHELLS) + 0.5
    others = np.minimum((loss.most / (2 * np.pi * shell)) ** 2, own[:, None])
    rest = (loss.most / (2 * np.pi)) ** 2 / SHELLS  # of the shells beyond, by their integral
    factors: Array = np.sqrt(own + 2 * others.sum(axis=1) - others[:, 0] + 2 * rest)
    return factors


SHELLS = 64
"""Frequencies that a grid cannot tell apart which are summed; beyond, an integral bounds them. With
any number it is a bound; more make it tighter."""


def rectangle_bounds(
    x: Array,
    y: Array,
    values: Array,
    losses: Sequence[BlurLoss],
    geometry: Geometry,
    ceiling: float,
) -> ChangeBounds:
    """Return what blurs change of even rectangles in rows and columns.

    All that they change, beside the array too, counts as if it lay on the array.

    Parameters
    ----------
    x, y : Array
        Edges (e + 1,) and (d + 1,), rising [m].
    values : Array
        Light (K, d, e) of the components.
    losses : sequence of BlurLoss
        The blurs, all of one light.
    geometry : Geometry
        Geometry of the array.
    ceiling : float
        Rate that fills a pixel [e/s].

    Returns
    -------
    ChangeBounds
        The bounds, none for blurs that change over the field.
    """
    light = np.tensordot(losses[0].level, values, axes=(0, 0)).max(axis=0)
    sides = [
        np.diff(_clipped_edges(e, size)) for e, size in zip((y, x), _size(geometry), strict=True)
    ]
    brightest, half = _widest_bright(light, *sides)
    full = _least_signal(brightest, half, 2, losses, geometry, ceiling)
    changes = []
    for loss in losses:
        of_x = parallel_edges_change(x[1:-1], np.diff(values, axis=2), np.diff(y), loss)
        along_x = np.swapaxes(np.diff(values, axis=1), 1, 2)
        of_y = parallel_edges_change(y[1:-1], along_x, np.diff(x), loss)
        changes.append(_rms(of_x + of_y, loss, geometry))
    return ChangeBounds(full, changes)


def profile_bounds(
    profile: Profile, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float
) -> ChangeBounds:
    """Return what blurs change of even light between parallel edges.

    Parameters
    ----------
    profile : Profile
        The light.
    losses, geometry, ceiling
        As those of `rectangle_bounds`.

    Returns
    -------
    ChangeBounds
        The bounds, none for blurs that change over the field.
    """
    height, width = _size(geometry)
    x, y = (abs(part) for part in profile.across)
    length = min(width / max(y, 1e-9), height / max(x, 1e-9))  # of a straight line on the array
    far = (width * x + height * y) / 2
    inside = np.abs(profile.places) < far
    heights = np.diff(profile.levels)[inside][None, None]
    ends = np.concatenate([[-far], profile.places[inside], [far]])
    first = int(np.searchsorted(profile.places, -far, side="right"))
    levels = profile.levels[first : first + len(ends) - 1]
    light = float(losses[0].level.max(axis=1)[0]) * levels[None]
    # The outermost sides have no end, and so the place to look at may be that of their far side.
    halves = np.diff(ends) / 2
    halves[[0, -1]] *= 2
    brightest, half = _widest_bright(light, np.full(1, math.inf), 2 * halves)
    full = _least_signal(brightest, half, 1, losses, geometry, ceiling)
    lengths = np.array([length])
    places = profile.places[inside]
    integrals = (parallel_edges_change(places, heights, lengths, loss) for loss in losses)
    changes = [_rms(i, loss, geometry) for i, loss in zip(integrals, losses, strict=True)]
    return ChangeBounds(full, changes)


def _size(geometry: Geometry) -> tuple[float, float]:
    return geometry.sensor_height, geometry.sensor_width


def _clipped_edges(edges: Array, length: float) -> Array:
    return np.clip(edges, -length / 2, length / 2)


def _rms(integrals: Array, loss: BlurLoss, geometry: Geometry) -> float:
    """Return the rms change over the array of what is changed in each wavelength (C, J) [e/s]."""
    changes = np.sqrt(integrals).sum(axis=1)
    if changes.any() and not (loss.is_uniform and np.isfinite(loss.spread).all()):
        return math.inf
    area = math.prod(_size(geometry)) * geometry.fill_of_pitch
    return float(changes.max()) / math.sqrt(area)


def _widest_bright(values: Array, heights: Array, widths: Array) -> tuple[float, float]:
    """Return the brightest light of rectangles at least half as wide as the widest is.

    With it comes half of the shorter side of that rectangle [m]. `values` are (d, e).
    """
    shorter = np.minimum(heights[:, None], widths) / 2
    wide = shorter >= shorter.max() / 2
    at = np.unravel_index(int(np.where(wide, values, -math.inf).argmax()), values.shape)
    return float(values[at]), float(shorter[at])


def _least_signal(
    brightest: float,
    half: float,
    axes: int,
    losses: Sequence[BlurLoss],
    geometry: Geometry,
    ceiling: float,
) -> float:
    """Return the least signal of a pixel amid even light that is so far from its borders [e/s].

    Of light displaced by s in the mean, the part 2 s / a at most is displaced by a or more along
    one axis (P. Billingsley, Probability and Measure, 3rd edition, 1995, eq 26.22). A pixel's
    collecting area begins within a pitch of the middle.
    """
    clear = half - 1.5 * max(geometry.pitch_x, geometry.pitch_y)
    spread = sum(float(loss.spread.max()) for loss in losses)
    inside = 1 - axes * 2 * spread / clear if clear > 0 else 0.0
    return min(max(inside, 0.0) * brightest, ceiling)
