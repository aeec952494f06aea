"""What a scene's spectrum holds, and what filters leave of it: mean squares by Parseval's theorem.

Coefficients are summed as products of planes over blocks of neighboring frequencies: exactly, in
one pass over the whole spectrum. A transfer function is then read in the middle of each block, a
few thousand values in place of millions of terms; what drops light reads it at the blocks' ends,
too, and takes the largest. Mean squares are those of the continuous signal, before it is sampled by
the pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, reduce

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.effects.blurs import SeparableTransfer
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import Pair, SceneSpectrum, pairs
from vcam_cli.image_formation.transfer_tables import Tables, reader
from vcam_cli.parallel import product
from vcam_cli.records import dataclass

WIDTH = 1 / 20
"""Width of a block relative to its frequency: the lowest 40 terms are blocks of their own."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of neighboring terms along one axis."""

    edges: Array
    """(b + 1,) first coefficients of blocks of the samples' spectrum, from 0, and the end."""
    weights: Array
    """(n, b) from squares of those coefficients to mean squares of the terms in every block, where
    a square of light passes most of it."""
    low: Array
    """(n,) lowest frequency of every block of terms [cycles/m]."""
    high: Array
    """(n,) highest frequency of every block of terms [cycles/m]."""

    @property
    def places(self) -> tuple[Array, Array, Array]:
        """Frequencies (n,) at the lower ends of blocks, in the middle, at the upper ends [1/m]."""
        return self.low, (self.low + self.high) / 2, self.high

    @cached_property
    def own_weights(self) -> Array | None:
        """The weights (n,) where each block of terms is one of coefficients; None elsewhere."""
        diagonal = np.diagonal(self.weights)
        is_one = (
            self.weights.shape == 2 * diagonal.shape
            and not (self.weights - np.diag(diagonal)).any()
        )
        return diagonal if is_one else None


ReadTables = Callable[[Tables, int, Blocks, Blocks, int], Array]
"""What reads tables of a parity at one of the `places` of blocks along x and y."""


@lru_cache(64)
def blocks(axis: Axis) -> Blocks:
    """Return the blocks of the terms of an axis.

    The spectrum of uniform squares of light goes on beyond that of the samples: coefficients repeat
    backwards and forwards, and so do their blocks.

    Parameters
    ----------
    axis : Axis
        Samples and terms along the axis.

    Returns
    -------
    Blocks
        Blocks whose width grows with the frequency.
    """
    count = min(axis.samples, axis.terms)
    starts = _starts(count)
    first, last = starts, np.append(starts[1:], count) - 1
    low, high, source = [], [], []
    for number in range(-(-axis.terms // count)):
        ends = (first, last) if number % 2 == 0 else (count - last[::-1], count - first[::-1])
        low.append(ends[0] + number * count)
        high.append(ends[1] + number * count)
        source.append(np.arange(len(starts))[:: 1 if number % 2 == 0 else -1])
    inside = np.concatenate(low) < axis.terms
    start, stop = np.concatenate(low)[inside], np.concatenate(high)[inside]
    stop = np.minimum(stop, axis.terms - 1)
    box = np.sinc(np.array([start, (start + stop) / 2, stop]) / (2 * axis.samples))
    weight = np.square((box if axis.squares else 1 / box) / (2 * axis.samples)).max(axis=0)
    weight *= np.where(start > 0, 2, 1)
    target = np.searchsorted(_starts(axis.terms), start, side="right") - 1
    merged = np.flatnonzero(np.diff(target, prepend=-1))
    row = np.cumsum(np.diff(target, prepend=-1) > 0) - 1
    weights = np.zeros((len(merged), len(starts)))
    np.add.at(weights, (row, np.concatenate(source)[inside]), weight)
    step = 1 / (2 * axis.length)
    edges = np.append(starts, count)
    return Blocks(edges, weights, start[merged] * step, np.maximum.reduceat(stop, merged) * step)


@lru_cache(1 << 7)
def _starts(terms: int) -> Array:
    """Return the first terms of blocks whose width grows with the frequency."""
    starts, at = [], 0
    while at < terms:
        starts.append(at)
        at += max(1, int(at * WIDTH))
    found = np.array(starts)
    found.setflags(write=False)
    return found


@dataclass(frozen=True, eq=False)
class PowerSpectrum:
    """Mean squares of a scene's planes by frequency, separable transfer functions aside."""

    x: Blocks
    y: Blocks
    products: Array
    """(pairs, blocks along y, blocks along x) of planes (r, s), r <= s, twice where they differ."""
    pairs: Sequence[Pair]
    """Those planes: all that any color sees together."""
    separable: tuple[SeparableTransfer, ...]

    def filtered_power(self, tables: Tables) -> Array:
        """Return the mean squares of every color's signal; what is read of the tables is not kept.

        Parameters
        ----------
        tables : Tables
            Transfer functions of a lens that is looked at once.

        Returns
        -------
        Array
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return self.pixel_power(self._passed_power(tables, 1, _read_tables))

    def by_length(self, tables: Tables) -> Array:
        """Return the power by the length of frequencies, at the entries of tables over |f|.

        Each block counts at the two entries beside its middle, behind the separable functions.

        Parameters
        ----------
        tables : Tables
            Tables over |f|.

        Returns
        -------
        Array
            Mean squares (pairs, entries) of the planes.
        """
        count = tables.radial.shape[-1]
        length = np.hypot(self.x.places[1], self.y.places[1][:, None]).ravel()
        place = np.minimum(length * ((count - 1) / tables.top), count - 1)
        first = np.minimum(place.astype(np.intp), count - 2)
        beyond, found = place - first, np.empty((len(self.products), count))
        passed = self._separable_squares(self.separable)
        for own, squares in zip(found, self.products, strict=True):
            power = (squares * passed).ravel()
            second = power * beyond
            own[:] = np.bincount(first, power - second, count)
            own += np.bincount(first + 1, second, count)
        return found

    def lens_power(self, tables: Tables) -> Array:
        """Return the mean squares before the separable transfer functions.

        Parameters
        ----------
        tables : Tables
            Transfer functions of the lens.

        Returns
        -------
        Array
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return self._passed_power(tables, 1)

    def pixel_power(self, power: Array) -> Array:
        """Return mean squares behind the separable transfer functions.

        Parameters
        ----------
        power : Array
            Mean squares before them, from `lens_power`.

        Returns
        -------
        Array
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return power * self._separable_squares(self.separable)

    def largest_power(self, tables: Tables) -> Array:
        """Return mean squares of every color's signal, each block where it passes most light.

        A transfer function falls steeply next to its cut-off: read in the middle of the blocks
        alone, a lone sample behind f/1.7 lost 1.2 times as much as was stated.

        Parameters
        ----------
        tables : Tables
            Transfer functions of the lens.

        Returns
        -------
        Array
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return self.pixel_power(self.lens_powers(tables)[1])

    def lens_powers(self, tables: Tables) -> tuple[Array, Array]:
        """Return the mean squares before the separable transfer functions, and the largest.

        Parameters
        ----------
        tables : Tables
            Transfer functions of the lens.

        Returns
        -------
        middle, largest : Array
            Those of `lens_power`, and each block where it passes most light, (C, blocks along y,
            blocks along x) [(e/s)^2].
        """
        powers = [self._passed_power(tables, place) for place in range(3)]
        return powers[1], reduce(np.maximum, powers)

    def _passed_power(self, tables: Tables, place: int, read: ReadTables | None = None) -> Array:
        """Return what a lens passes at one of the `places` of the blocks (C, along y, along x)."""
        power = np.zeros((tables.colors, len(self.y.low), len(self.x.low)))
        for parity in tables.parities:
            values = (read or _values)(tables, parity, self.x, self.y, place)
            for (r, s), squares in zip(self.pairs, self.products, strict=True):
                seen = np.flatnonzero(tables.is_seen[r] & tables.is_seen[s])
                if not len(seen):
                    continue
                colors = slice(seen[0], seen[-1] + 1)  # others between them add 0
                both = values[r, colors] * values[s, colors]
                both *= squares
                power[colors] += both
        return np.maximum(power, 0)

    def upper_bound(self, tables: Tables) -> Array:
        """Return mean squares that no lens exceeds whose radial part is given.

        Planes whose light cancels through one lens need not through another: it is as if none did.

        Parameters
        ----------
        tables : Tables
            Tables over |f| that the lens passes at most.

        Returns
        -------
        Array
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        read = (np.abs(_values(tables, 0, self.x, self.y, place)) for place in range(3))
        values = reduce(np.maximum, read)
        own = [p for (r, s), p in zip(self.pairs, self.products, strict=True) if r == s]
        amplitudes = values * np.sqrt(np.maximum(own, 0))[:, None]
        return self.pixel_power(np.square(amplitudes.sum(axis=0)))

    def omission_power(self, power: Array, effect: SeparableTransfer) -> Array:
        """Return mean squares of what leaving out a separable transfer function adds.

        Parameters
        ----------
        power : Array
            Mean squares from `lens_power`.
        effect : SeparableTransfer
            The transfer function that is left out.

        Returns
        -------
        Array
            Mean squares (C,) [(e/s)^2].
        """
        others = self._separable_squares([e for e in self.separable if e is not effect])
        own = np.outer(effect.along_y(self.y.places[1]), effect.along_x(self.x.places[1]))
        return np.asarray((power * (others * np.square(1 - own))).sum(axis=(1, 2)))

    def _separable_squares(self, effects: Sequence[SeparableTransfer]) -> Array:
        """Return the largest squares of separable transfer functions in the blocks."""
        along_x, along_y = np.ones(len(self.x.low)), np.ones(len(self.y.low))
        for effect in effects:
            along_x *= _largest_squares(effect.along_x, self.x)
            along_y *= _largest_squares(effect.along_y, self.y)
        return np.outer(along_y, along_x)

    def tails(self, power: Array, pitch: tuple[float, float]) -> Tails:
        """Return what lies beyond each frequency.

        Pixels cannot tell apart a term of each zone between multiples of their Nyquist frequency:
        within a zone mean squares add up, those of zones as if all of them met in phase.

        Parameters
        ----------
        power : Array
            Mean squares (C, ...) from `largest_power` or `upper_bound` [(e/s)^2].
        pitch : tuple of float
            Pixel pitch along y and x [m].

        Returns
        -------
        Tails
            Rms at the pixels, at most.
        """
        frequency, bins, zones = _shells(self.x, self.y, pitch)
        size = zones * len(frequency)
        left = []
        for color in power.reshape(len(power), -1):
            of_zones = np.bincount(bins, color, size).reshape(-1, len(frequency))
            left.append(np.sqrt(np.cumsum(of_zones[:, ::-1], axis=1)[:, ::-1]).sum(axis=0))
        return Tails(frequency, np.array(left).max(axis=0))


@dataclass(frozen=True, eq=False)
class Tails:
    """What of a spectrum lies beyond each frequency, in the color of most.

    The frequency of a term is the larger of those along both axes, each in its own Nyquist
    frequency.
    """

    frequency: Array
    """Frequencies (n,), rising [pixel Nyquist]."""
    left: Array
    """Rms at the pixels of what lies at each and beyond (n,) [e/s]."""

    def needed_frequency(self, budget: float) -> float:
        """Return the frequency beyond which little enough is left.

        Parameters
        ----------
        budget : float
            Rms that may be left at the pixels [e/s].

        Returns
        -------
        float
            Frequency [pixel Nyquist].
        """
        needed = np.flatnonzero(self.left > budget)
        return float(self.frequency[needed[-1]]) if len(needed) else 0.0

    def rms(self, frequency: float) -> float:
        """Return the rms of all that lies beyond a frequency.

        Parameters
        ----------
        frequency : float
            Frequency [pixel Nyquist].

        Returns
        -------
        float
            Rms at the pixels, at most [e/s].
        """
        beyond = int(np.searchsorted(self.frequency, frequency * (1 + 1e-9), side="right"))
        return float(self.left[beyond]) if beyond < len(self.left) else 0.0


def _values(tables: Tables, parity: int, x: Blocks, y: Blocks, place: int) -> Array:
    """Return tables at one of the `places` of the blocks (R, C, along y, along x) [e/s]."""
    read = _read_radial if tables.is_radial else _read_tables
    return read(tables, parity, x, y, place)


def _read_tables(tables: Tables, parity: int, x: Blocks, y: Blocks, place: int) -> Array:
    return tables.of_every(reader(tables, parity, x.places[place]).values(y.places[place]))


def _read_radial(tables: Tables, parity: int, x: Blocks, y: Blocks, place: int) -> Array:
    key = tables, parity, x, y, place
    return _RADIAL.get(key, lambda: _read_tables(tables, parity, x, y, place))


KEPT = 1 << 22
"""Bytes of values over |f| that are kept."""
_RADIAL: ByteCache[Array] = ByteCache(KEPT, strict=True)
"""Values of one lens are the same for all pictures of a size."""


@lru_cache(16)  # a scene of eight layers has windows of as many sizes
def _shells(x: Blocks, y: Blocks, pitch: tuple[float, float]) -> tuple[Array, Array, int]:
    """Return frequencies (n,) [pixel Nyquist], each block's zone and shell, the number of zones.

    A block (blocks along y, blocks along x), flat, is in the bin zone * n + shell.
    """
    along_y, along_x = 2 * pitch[0] * y.high, 2 * pitch[1] * x.high
    frequency, shell = np.unique(np.maximum(along_y[:, None], along_x), return_inverse=True)
    zones = [np.maximum(np.ceil(at - 1e-6), 1).astype(int) - 1 for at in (along_y, along_x)]
    count = int(zones[1].max()) + 1
    zone = zones[0][:, None] * count + zones[1]
    bins = zone.ravel() * len(frequency) + shell.ravel()
    return frequency, bins, (int(zones[0].max()) + 1) * count


def _largest_squares(transfer: Callable[[Array], Array], blocks: Blocks) -> Array:
    """Return the largest square of a transfer function along one axis in every block."""
    return np.asarray(np.square([transfer(f) for f in blocks.places]).max(axis=0))


def _block_squares(sums: Array, x: Blocks, y: Blocks) -> Array:
    """Return sums over blocks of coefficients as mean squares of blocks of terms."""
    if x.own_weights is None or y.own_weights is None:
        return product(y.weights, product(sums, x.weights.T))
    return np.asarray(sums * x.own_weights * y.own_weights[:, None])  # in a tenth of the time


def power_spectrum(
    spectrum: SceneSpectrum,
    x: Axis,
    y: Axis,
    separable: Sequence[SeparableTransfer],
    workers: int,
    of: Sequence[Pair] | None = None,
) -> PowerSpectrum:
    """Return the power spectrum of planes up to the highest terms of the axes.

    Parameters
    ----------
    spectrum : SceneSpectrum
        Spectrum of the planes.
    x, y : Axis
        Terms along x and y.
    separable : sequence of SeparableTransfer
        Transfer functions along the axes.
    workers : int
        Number of threads; the result does not depend on it.
    of : sequence of Pair, optional
        Pairs of planes that a color sees together; by default all.

    Returns
    -------
    PowerSpectrum
        Mean squares by block of terms.
    """
    along_x, along_y = blocks(x), blocks(y)
    products = []
    every = of or pairs(len(spectrum))
    sums = spectrum.products(along_y.edges, along_x.edges, workers, every)
    for (r, s), of_pair in zip(every, sums, strict=True):
        twice = 1 if r == s else 2
        products.append(twice * _block_squares(of_pair, along_x, along_y))
    return PowerSpectrum(along_x, along_y, np.array(products), every, tuple(separable))
