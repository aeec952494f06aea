"""From a scene's spectrum to the pixels: multiply by the transfer function, fold, transform back.

The heart of image formation. A transfer function is computed at four frequencies of up to 128
neighboring rows of the spectrum; the cubic through them is a product of small matrices. Frames of
photographs and of charts of rectangles take 1.4 to 1.5 times as long where every term is looked up
instead (docs/engine_ablation.md). Work is cut into fixed pieces of rows or columns that threads
share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import Pair, SceneSpectrum
from vcam_cli.image_formation.transfer_tables import PARITIES, TableReader, Tables, reader
from vcam_cli.parallel import each, pieces, product, rows_at_once, slices_within
from vcam_cli.records import dataclass

LONGEST = 128
"""Rows of a spectrum that are filtered together."""
NODES = 4
"""Frequencies at which a stretch of rows has its transfer function computed."""
_AT = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
"""Chebyshev's nodes between -1 and 1."""
_FROM_POWERS = np.linalg.inv(np.vander(_AT, NODES, increasing=True))
"""From the powers of a place to the weights of the polynomial through values at the nodes."""
GROWTH = 1.5
"""Highest over lowest frequency of a stretch: an OTF has a cusp at 0. The cubic through Chebyshev
nodes then errs by 1e-5 of what the OTF has lost up to there."""
FEW = 1 << 14
"""Terms of a piece up to which all colors are filtered in one call: frames of 64 x 64 pixels, whose
pieces have some hundred terms, take two thirds of the time."""
STRETCHES = 10, 2
"""Nodes of all stretches of a piece over those of one, at most: of the piece with the lowest
frequencies, whose stretches are short, and of others."""
SHORTEST = 8
"""Rows below which every row has its own transfer function."""
KEPT = 1 << 19
"""Terms of a filter, counted for every mixture and color, up to which its pieces are kept, 2 MB at
most: pictures before one lens have it in common, and frames of 64 x 64 pixels of a data set take a
tenth less."""

Waves = tuple[bool, bool]
"""Whether waves along x, and along y, are sines."""


@dataclass(frozen=True)
class Series:
    """A signal that is known at the rows of photodetectors, and as a series along x."""

    x: Axis
    parts: dict[bool, Array]
    """Cosines (False) and sines (True): (C, rows, folded x) [electrons / s]."""

    def signal(self, color: int, rows: slice) -> Array:
        """Return the signal of a color at the photodetectors of some rows.

        Parameters
        ----------
        color : int
            Number of the color.
        rows : slice
            Rows of the array.

        Returns
        -------
        Array
            Signal (rows, columns) [e/s].
        """
        parts = {odd: part[color, rows] for odd, part in self.parts.items()}
        if self.x.row_shifts is not None:
            return self.x.evaluate_rows(parts, self.x.row_shifts[rows])
        found = [self.x.evaluate(part, axis=1, odd=odd) for odd, part in parts.items()]
        return found[0] if len(found) == 1 else found[0] + found[1]

    def on_processor(self) -> Callable[[int, slice], Array]:
        """Return `signal` for the processor; of a device all of it is computed and copied now."""
        if not self.x.device.whole:
            return self.signal
        colors = range(len(next(iter(self.parts.values()))))
        planes = [self.x.device.get(self.signal(color, slice(None))) for color in colors]
        return lambda color, rows: planes[color][rows]


@dataclass(frozen=True)
class _Ones:
    """The spectrum of a plane whose coefficients are all 1: filtered, it is the filter."""

    columns: int
    dtype = np.dtype(np.float64)

    def __len__(self) -> int:
        return 1

    def rows(self, plane: int, index: Array | slice, count: int | None = None) -> Array:
        """Return ones (n, count)."""
        width = self.columns if count is None else min(count, self.columns)
        return np.ones((self.count_of(index), width))

    @staticmethod
    def count_of(index: Array | slice) -> int:
        """Return how many rows an index has, as `_consecutive` makes it."""
        if not isinstance(index, slice):
            return len(index)
        stop = -1 if index.stop is None else index.stop
        return int((stop - index.start) // index.step)

    def products(self, y: Array, x: Array, workers: int, of: Sequence[Pair] | None = None) -> Array:
        """Return nothing: a filter does not ask."""
        return np.zeros((1, len(y) - 1, len(x) - 1))


@dataclass(frozen=True)
class _Rows:
    """Rows of a spectrum that are filtered together, and their transfer function, a cubic in fy."""

    part: slice
    """Which of the terms."""
    index: Array | slice
    """Rows of the DCT-II coefficients behind them."""
    count: int
    """Terms along x."""
    shares: Array
    """Weights (n, nodes) of the nodes in every row."""
    values: Array
    """Transfer (P, nodes, count) of each mixture and a color that sees it at the nodes [e/s]."""


@dataclass(frozen=True, eq=False)
class Filter:
    """A transfer function acting on the cosine series of a scene."""

    x: Axis
    y: Axis
    tables: Tables
    along_x: Array
    """Separable transfer along x at every term of the axis, without unit."""
    along_y: Array
    cubic_range: float
    """Frequency range over which the tables are a cubic [cycles/m]."""
    _kept: dict[tuple[object, ...], list[tuple[slice, list[_Rows]]]] = field(
        default_factory=dict, init=False, repr=False
    )
    """Parity, waves along y, piece and type -> rows of the piece, by where they fold to."""

    def apply(self, spectrum: SceneSpectrum, workers: int) -> Series:
        """Filter a spectrum and fold it onto the rows of photodetectors.

        Parameters
        ----------
        spectrum : SceneSpectrum
            Spectrum of the R mixtures that the tables are for.
        workers : int
            Number of threads; the result does not depend on it.

        Returns
        -------
        Series
            Signal of every color, still a series along x.
        """
        folded: dict[Waves, Array] = {}
        for parity in self.tables.parities:
            self._multiply(spectrum, parity, folded, workers)
        parts: dict[bool, Array] = {}
        for waves in sorted(folded):
            found = self._evaluate_columns(folded.pop(waves), waves[1], workers)
            if waves[0] in parts:
                parts[waves[0]] += found
            else:
                parts[waves[0]] = found
        return Series(self.x, parts)

    def on(self, device: Processor) -> Filter:
        """Return the same filter for spectra on a device; itself where it is on that device."""
        if device is self._device:
            return self
        return replace(self, x=replace(self.x, device=device), y=replace(self.y, device=device))

    @property
    def _device(self) -> Processor:
        return self.x.device

    @property
    def terms(self) -> int:
        """Number of terms of a plane's spectrum that are filtered."""
        return int(self._counts(self.y.frequencies).sum())

    def factors(self) -> Iterator[tuple[int, slice, Array, Array]]:
        """Yield what `apply` multiplies terms with, for filters without sines.

        Yields
        ------
        mixture : int
            Number of the mixture.
        colors : slice
            Numbers of the colors.
        terms : Array
            Consecutive terms along y (n,).
        factors : Array
            Factors (colors, n, terms along x, those that are 0 left out) on the DCT-II
            coefficients behind the terms, with their signs and the fold along y [e/s].

        Raises
        ------
        ValueError
            Where a wave becomes another one: `is_even` tells.
        """
        if not self.is_even:
            raise ValueError("a filter that turns cosines into sines is no single factor")
        radial, plane = self.tables.radial, self.tables.planes[0]
        ones = _Ones(self.x.samples)
        for mixture in range(self.tables.shape[0]):
            only = slice(mixture, mixture + 1)
            of_plane = None if plane is None else plane[only]
            alone = replace(
                self.tables,
                mix=self.tables.mix[only],
                radial=radial[only],
                planes=(of_plane, None, None, None),
            )
            table = reader(alone, 0, self.x.frequencies)
            one = replace(self, tables=alone)
            for rows in pieces(self.y.folded_terms, LONGEST):
                for _, terms, weights in self.y.folding(rows):
                    every = one._rows(table, terms, weights, ones.dtype)
                    for part, colors, light in one._filter_rows(ones, every):
                        yield mixture, colors, terms[part], light

    @property
    def is_even(self) -> bool:
        """Whether cosines stay cosines, and pixels see them where a transform evaluates them."""
        found = self.x.virtual_pixels and self.y.virtual_pixels
        return bool(found) and not (self.x.shift or self.y.shift) and self.tables.parities == [0]

    def _multiply(
        self, spectrum: SceneSpectrum, parity: int, folded: dict[Waves, Array], workers: int
    ) -> None:
        """Add what the planes give through one parity of the tables to the pixels' waves."""
        odd_x, odd_y = PARITIES[parity]
        dtype = spectrum.dtype
        shape = self.tables.colors, self.y.folded_terms, self.x.folded_terms
        for wave_y, share_y in self.y.pixel_waves(odd_y):
            targets = []
            for wave_x, share_x in self.x.pixel_waves(odd_x):
                sums = folded.setdefault((wave_x, wave_y), self._device.zeros(shape, dtype))
                share = None if share_x is None else self._device.put(share_x, dtype)
                targets.append((sums, wave_x, share))

            def multiply(
                rows: slice,
                wave_y: bool = wave_y,
                share_y: Array | None = share_y,
                targets: list[tuple[Array, bool, Array | None]] = targets,
            ) -> None:
                for target, some_rows in self._piece(parity, wave_y, share_y, rows, dtype):
                    for part, colors, light in self._filter_rows(spectrum, some_rows):
                        here = slice(target.start + part.start, target.start + part.stop)
                        for sums, wave_x, share_x in targets:
                            some = light if share_x is None else light * share_x[: light.shape[2]]
                            last = sums is targets[-1][0]
                            sums[colors, here] += self.x.fold(some, wave_x, overwrite=last)

            threads = 1 if self._device.whole else workers
            each(multiply, pieces(self.y.folded_terms, LONGEST), threads)

    def _piece(
        self, parity: int, wave_y: bool, share_y: Array | None, rows: slice, dtype: np.dtype
    ) -> list[tuple[slice, list[_Rows]]]:
        """Return where a piece of the folded axis comes from: its part, and the rows added to it.

        share_y: how much of `wave_y` is in every term; None for all.
        """
        key = parity, wave_y, rows.start, rows.stop, dtype
        if key in self._kept:
            return self._kept[key]
        table = reader(self.tables, parity, self.x.frequencies)
        found = []
        for target, terms, weights in self.y.folding(rows, wave_y):
            if share_y is not None:
                weights = weights * share_y[terms]
            found.append((target, list(self._rows(table, terms, weights, dtype))))
        if has_few_terms(self.x, self.y, self.tables):
            self._kept[key] = found
        return found

    def _rows(
        self, table: TableReader, terms: Array, weights: Array, dtype: np.dtype
    ) -> Iterator[_Rows]:
        """Yield terms (n,) as rows that are filtered together.

        They are consecutive rows, rising or falling; `weights` are factors on them.
        """
        device = self._device
        factor = self._weights_x
        coefficients, signs = self.y.coefficient_index(terms)
        below = weights * signs * self.y.weights[terms]
        below = below * self.along_y[terms]
        for stretch in self._stretches(terms):
            fy = self.y.frequencies[terms[stretch]]
            count = self._count(fy)
            if not count:
                continue
            nodes, shares = chebyshev(fy) if len(fy) >= SHORTEST else (fy, np.eye(len(fy)))
            shares = device.put(shares * below[stretch, None], dtype)
            read = table.values(nodes, count)
            read *= factor[:count]
            values = device.put(read, dtype)
            longest = LONGEST if device.whole else rows_at_once(count)
            for part in slices_within(stretch, longest):
                index = _consecutive(coefficients[part])
                if not isinstance(index, slice):
                    index = device.put(index)
                at = slice(part.start - stretch.start, part.stop - stretch.start)
                yield _Rows(part, index, count, shares[at], values)

    def _filter_rows(
        self, spectrum: SceneSpectrum, some: Iterable[_Rows]
    ) -> Iterator[tuple[slice, slice, Array]]:
        """Yield rows of the filtered spectrum: (which of the terms, colors, (colors, n, count))."""
        every, numbers = range(len(spectrum)), self.tables.pair_numbers
        for rows in some:
            planes = [
                self.x.extend(spectrum.rows(plane, rows.index, rows.count), rows.count)
                for plane in every
            ]
            few = self._device.whole or len(rows.shares) * rows.count <= FEW
            for seen, colors in self.tables.planes_by_color:
                for part in pieces(colors.stop - colors.start, colors.stop if few else 1):
                    own = slice(colors.start + part.start, colors.start + part.stop)
                    total: Array | None = None
                    for plane in seen:
                        first = int(numbers[plane, own.start])
                        values = rows.values[first : first + own.stop - own.start]
                        light = (
                            rows.shares @ values if few else product(rows.shares, values[0])[None]
                        )
                        light *= planes[plane]
                        total = light if total is None else np.add(total, light, out=total)
                    assert total is not None
                    yield rows.part, own, total

    @cached_property
    def _weights_x(self) -> Array:
        return self.x.weights * self.along_x

    def _stretches(self, terms: Array) -> Iterator[slice]:
        """Yield consecutive rows over which the tables are a cubic in fy."""
        widest = min(LONGEST, int(self.cubic_range * 2 * self.y.length))
        start, count = 0, len(terms)
        rising = count < 2 or terms[1] > terms[0]
        while start < count:
            first = int(terms[start])
            size = first * (GROWTH - 1) if rising else first * (1 - 1 / GROWTH)
            size = min(int(size), widest)
            if size < SHORTEST:
                size = SHORTEST - 1
            yield slice(start, min(start + size, count))
            start += size

    def _count(self, fy: Array) -> int:
        """Return the terms along x that the tables reach at some of these frequencies along y."""
        return int(self._counts(fy.min()))

    def _counts(self, fy: Array) -> Array:
        """Return the terms along x that the tables reach at each of these frequencies along y."""
        left = self.tables.top**2 - fy**2
        count = (np.sqrt(np.maximum(left, 0)) * 2 * self.x.length).astype(int) + 1
        return np.where(left < 0, 0, np.minimum(count, self.x.terms))

    def _evaluate_columns(self, folded: Array, odd: bool, workers: int) -> Array:
        """Return the signal at the rows of photodetectors of waves (C, rows, folded x) along y.

        It takes the place of its argument where the virtual pixels' rows do.
        """
        window = self.y.window
        out = folded
        if window is None:
            shape = (len(folded), self.y.pixels, self.x.folded_terms)
            out = np.empty_like(folded, shape=shape)
        some = self.x.folded_terms if self._device.whole else rows_at_once(self.y.transform)
        columns, threads = pieces(self.x.folded_terms, some), 1 if self._device.whole else workers

        def evaluate(task: tuple[int, slice]) -> None:
            color, s = task
            found = self.y.evaluate(folded[color, :, s], axis=0, odd=odd)
            (out[color] if window is None else out[color, window])[:, s] = found

        each(evaluate, [(c, s) for c in range(len(folded)) for s in columns], threads)
        return out if window is None else out[:, window]


def has_few_terms(x: Axis, y: Axis, tables: Tables) -> bool:
    """Return whether a filter has so few terms that its pieces are kept.

    Parameters
    ----------
    x, y : Axis
        Samples and pixels along x and y, with the terms that are filtered.
    tables : Tables
        Its transfer functions.
    """
    return x.terms * y.terms * math.prod(tables.shape) <= KEPT


def working_bytes(
    x: Axis, y: Axis, planes: int, colors: int, pairs: int, width: int
) -> tuple[int, int]:
    """Return the memory of a thread while it filters a piece of a spectrum.

    Parameters
    ----------
    x, y : Axis
        Samples and pixels along x and y, with the terms that are filtered.
    planes : int
        Number of planes of the spectrum.
    colors : int
        Number of colors that see the same planes.
    pairs : int
        Number of pairs of a plane and a color that sees it.
    width : int
        Memory of a number [bytes].

    Returns
    -------
    lowest, others : int
        Bytes for the piece with the lowest frequencies along y, and for another: transfer functions
        at the nodes of all rows that fold onto the piece, what is read of the tables for a stretch
        of them, the rows of all planes, and light of one or all colors.
    """
    rows = min(rows_at_once(x.terms), y.terms, LONGEST)
    folds = math.ceil(y.terms / y.folded_terms)
    nodes = pairs * min(NODES, y.terms) * x.terms
    light = colors if rows * x.terms <= FEW else 1
    of_rows = (planes + 3 * light) * rows * x.terms
    lowest, others = (
        width * ((least + (folds - 1) * STRETCHES[1]) * nodes + of_rows) + 8 * 3 * nodes
        for least in STRETCHES
    )
    return lowest, others


def chebyshev(at: Array) -> tuple[Array, Array]:
    """Return Chebyshev's nodes in a range, and the weights of the cubic through them.

    The cubic through the values at the nodes is `weights @ values`.

    Parameters
    ----------
    at : Array
        Places (n,) between whose ends the nodes lie.

    Returns
    -------
    nodes : Array
        Nodes (NODES,), in the unit of the places.
    weights : Array
        Weights (n, NODES) at the places.
    """
    low, high = float(at.min()), float(at.max())
    middle, half = (low + high) / 2, (high - low) / 2
    powers = np.vander((at - middle) / half, NODES, increasing=True)
    return middle + half * _AT, powers @ _FROM_POWERS


def _consecutive(index: Array) -> Array | slice:
    """Return consecutive indices, rising or falling, as a slice, so that NumPy returns a view."""
    steps = np.diff(index)
    if not len(steps) or abs(steps[0]) != 1 or (steps != steps[0]).any():
        return index
    step, stop = int(steps[0]), int(index[-1] + steps[0])
    return slice(int(index[0]), stop if stop >= 0 else None, step)
