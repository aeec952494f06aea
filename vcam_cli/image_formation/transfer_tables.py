"""Transfer functions as tables: over |f|, and over fx and fy for blurs that have a direction.

The radial part of a transfer function is a table over |f| with linear interpolation. What a blur
with a direction (coma, a measured point spread function) changes is tabulated over fx and fy by
parity, with cubic splines between the entries; it begins with the square of the frequency, so a
coarse table will do. Blurs that are the same at every wavelength (motion, a low-pass filter along a
diagonal) are no tables: they are computed at each frequency, and multiply what is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.effects.blurs import Blur, GeometricTransfer, PlaneTransfer
from vcam_cli.image_formation.scene_spectrum import Pair, pairs
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.parallel import product, slices_within
from vcam_cli.records import dataclass

PARITIES = ((False, False), (True, True), (True, False), (False, True))
"""Whether a transfer function turns the cosines along x, and along y, into sines."""
UNITS = (1, -1, -1j, -1j)
"""Factor of each of them in the complex transfer function."""
ANY_WAVELENGTH = 550e-9
"""Wavelength at which blurs are computed that are the same at all [m]."""
SMALLEST_PLANE, LARGEST_PLANE = 41, 513
"""Entries along an axis of a table over fx and fy, at least and, of many tables, at most."""
PLANE_VALUES = 1 << 25
"""Entries of all tables over fx and fy, at most, where one has more than `LARGEST_PLANE` along an
axis: 268 MB. With 513 a blur over six pixels erred by 0.1 % at a tolerance of 0.02 %."""
ROWS_VALUES = 1 << 22
"""Transfers by wavelength that are computed at once for such a table, about: 64 MB."""
JUDGED = 256
"""Frequencies at which mixtures of spectra are judged. Between them they err by 1.003 times what is
stated at most, behind a defocus of 2 um, whose contrast turns most often; with half as many by
1.055. More cost time alone."""


@dataclass(frozen=True)
class TableSize:
    """How fine tables are, and how far they go."""

    top: float
    """Highest frequency [cycles/m]."""
    entries: int
    """Entries over |f|."""
    tolerance: float
    """Largest relative error by replacing components by mixtures."""
    steps_per_period: float
    """Entries over fx and fy in one period of the phase of the widest blur."""
    rank: int | None = None
    """Largest number of mixtures; None: as many as the tolerance requires."""

    def plane_entries(self, blurs: Sequence[PlaneTransfer], tables: int) -> int:
        """Return the entries along an axis of a table over fx and fy for these blurs.

        Parameters
        ----------
        blurs : sequence of PlaneTransfer
            These blurs.
        tables : int
            Tables of each parity: mixtures times colors.

        Returns
        -------
        int
            Entries, from `SMALLEST_PLANE` to `LARGEST_PLANE`, or as many as `PLANE_VALUES` allow.
        """
        most = max(LARGEST_PLANE, math.isqrt(PLANE_VALUES // (len(PARITIES) * tables)))
        return min(self.wanted_entries(blurs), most)

    def plane_error(self, blurs: Sequence[PlaneTransfer], entries: int) -> float:
        """Return what a table of too few entries errs by, relative to the largest level.

        A cubic spline with n steps in a period errs by about (2 pi / n)^4 / 384.

        Parameters
        ----------
        blurs : sequence of PlaneTransfer
            The blurs in the table.
        entries : int
            Its entries along an axis.

        Returns
        -------
        float
            Error at one frequency; 0 where there are as many steps as required.
        """
        wanted = self.wanted_entries(blurs)
        if entries >= wanted:
            return 0.0
        steps = self.steps_per_period * (entries - 1) / (wanted - 1)
        return float(min((2 * math.pi / steps) ** 4 / 384, 1.0))

    def wanted_entries(self, blurs: Sequence[PlaneTransfer]) -> int:
        """Return the entries that follow the phase of the widest blur to the highest frequency.

        Parameters
        ----------
        blurs : sequence of PlaneTransfer
            The blurs in the table.

        Returns
        -------
        int
            Entries from 0 to the highest frequency, at least `SMALLEST_PLANE`.
        """
        steps = self.steps_per_period * self.top * max(blur.reach for blur in blurs)
        return max(int(steps + 1), SMALLEST_PLANE)


Mixing = tuple[Array, float]
"""Mixtures (R, K) of a scene's components, and the largest relative error that they leave."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Transfer functions H_rc of R mixtures of the scene's components, in C colors.

    sum_k B_k H_kc = sum_r (mix B)_r H_rc up to `error`.
    """

    mix: Array
    """(R, K) without unit."""
    radial: Array
    """(R, C, n) over |f| from 0 to `top` [electrons / s]."""
    top: float
    """Frequency of the last entry [cycles/m]."""
    error: float
    """Bound on the error by mixtures, relative to the largest level."""
    planes: tuple[Array | None, ...] = (None,) * 4
    """By `PARITIES`, (R, C, m, m) over fy and fx from 0 to `top`: what is added to the radial part.
    A wave cos(2 pi fx x) cos(2 pi fy y) becomes the sum of its cosines and sines times these."""
    order: int = 0
    """The radial part is times the cosine of `order` times the direction of f from x towards y,"""
    is_sine: bool = False
    """or times its sine, and has the parity that it thereby has."""
    factors: tuple[GeometricTransfer, ...] = ()
    """Blurs that multiply all of this, computed at each frequency that is read."""
    is_change: bool = False
    """Whether the radial part is subtracted in the end: what blurs with a direction change."""

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of mixtures R and colors C."""
        return self.radial.shape[0], self.radial.shape[1]

    @property
    def colors(self) -> int:
        """Number of colors."""
        return self.shape[1]

    @cached_property
    def is_seen(self) -> Array:
        """Which mixtures each color sees (R, C)."""
        parts = [part for part in (self.radial, *self.planes) if part is not None]
        seen = [part.reshape(*self.shape, -1).any(axis=2) for part in parts]
        return np.asarray(np.any(seen, axis=0))

    @property
    def pairs(self) -> list[Pair]:
        """Mixtures that a color sees together, and each with itself."""
        together = self.is_seen @ self.is_seen.T
        return [(r, s) for r, s in pairs(len(together)) if r == s or together[r, s]]

    @cached_property
    def planes_by_color(self) -> list[tuple[Array, slice]]:
        """Mixtures (n,) that consecutive colors see, and these colors; none that see nothing."""
        seen = self.is_seen
        starts = np.flatnonzero(np.append(True, (seen[:, 1:] != seen[:, :-1]).any(axis=0)))
        spans = zip(starts, np.append(starts[1:], self.colors), strict=True)
        found = ((np.flatnonzero(seen[:, a]), slice(int(a), int(b))) for a, b in spans)
        return [(planes, colors) for planes, colors in found if len(planes)]

    @cached_property
    def pair_numbers(self) -> Array:
        """Number (R, C) of a mixture and a color that sees it, in order, among all such pairs."""
        return np.asarray(np.cumsum(self.is_seen).reshape(self.shape) - 1)

    def of_pairs(self, every: Array) -> Array:
        """Return what is given for every mixture and color (R, C, ...) for those seen (P, ...)."""
        if self.is_seen.all():
            return every.reshape(-1, *every.shape[2:])
        return every[self.is_seen]

    def of_every(self, pairs: Array) -> Array:
        """Return what is given for pairs (P, ...) for every mixture and color, 0 where unseen."""
        if self.is_seen.all():
            return pairs.reshape(*self.shape, *pairs.shape[1:])
        every = np.zeros((*self.shape, *pairs.shape[1:]))
        every[self.is_seen] = pairs
        return every

    @cached_property
    def steps(self) -> tuple[Array, Array]:
        """Entries over |f| of each pair (P, entries), and steps to the next (P, entries - 1)."""
        entries = self.of_pairs(self.radial)
        return entries, np.diff(entries)

    @property
    def is_radial(self) -> bool:
        """Whether all tables are over |f|: such tables are small."""
        return all(plane is None for plane in self.planes)

    @property
    def nbytes(self) -> int:
        """Memory that they take [bytes]."""
        return sum(part.nbytes for part in (self.radial, *self.planes) if part is not None)

    def of_color(self, color: int) -> Tables:
        """Return the tables of a single color.

        Parameters
        ----------
        color : int
            Number of the color.

        Returns
        -------
        Tables
            Its tables.
        """
        only = slice(color, color + 1)
        return replace(
            self,
            radial=self.radial[:, only],
            planes=tuple(None if plane is None else plane[:, only] for plane in self.planes),
        )

    @property
    def parities(self) -> list[int]:
        """Indices of the `PARITIES` that occur."""
        own, factors = self.tabulated_parities, self.factor_parities
        return sorted({parity_of_product(one, other) for one in own for other in factors})

    @property
    def tabulated_parities(self) -> list[int]:
        """Indices of the `PARITIES` of the tables, without factors."""
        directed = {p for p, plane in enumerate(self.planes) if plane is not None}
        return sorted(directed | {self.radial_parity})

    @property
    def factor_parities(self) -> tuple[int, ...]:
        """Indices of the `PARITIES` of the factors."""
        if not self.factors:
            return (0,)
        return (0, 1) if all(blur.is_symmetric for blur in self.factors) else (0, 1, 2, 3)

    @property
    def radial_parity(self) -> int:
        """Index into `PARITIES` of the radial part: waves odd in fy change sign with it."""
        odd_y = self.is_sine
        return PARITIES.index((odd_y != bool(self.order % 2), odd_y))

    def factor(self, fx: Array, fy: Array) -> Array:
        """Return the product of the factors, by `PARITIES`.

        Parameters
        ----------
        fx, fy : Array
            Frequencies (n,) along x and (m,) along y [cycles/m].

        Returns
        -------
        Array
            Transfer (4, m, n) without unit.
        """
        both = np.ones((2 * len(fy), len(fx)), np.complex128)
        for blur in self.factors:
            both *= blur.otf_plane(fx, np.concatenate([fy, -fy]), ANY_WAVELENGTH)
        return split_by_parity(both[: len(fy)], both[len(fy) :])


def parity_of_product(one: int, other: int) -> int:
    """Return the parity of a product of transfer functions.

    Parameters
    ----------
    one, other : int
        Indices into `PARITIES` of the factors.

    Returns
    -------
    int
        Index into `PARITIES` of the product.
    """
    (x, y), (other_x, other_y) = PARITIES[one], PARITIES[other]
    return PARITIES.index((x != other_x, y != other_y))


@dataclass(frozen=True, eq=False)
class TableReader:
    """Transfer functions of one parity, at given frequencies along x."""

    tables: Tables
    parity: int
    fx: Array
    """(n,) rising [cycles/m]."""
    parts: dict[int, PartReader]
    """Tables of each parity that has a share in it."""

    def values(self, fy: Array, count: int | None = None) -> Array:
        """Return H_rc of mixtures and colors that see them at some frequencies along y.

        Of a layer half of all are 0: its light has none of its opacity.

        Parameters
        ----------
        fy : Array
            Frequencies (m,) along y [cycles/m].
        count : int, optional
            Number of the frequencies along x that are read; by default all.

        Returns
        -------
        Array
            Transfer (P, m, count) [e/s]; planes add nothing beyond the end of the tables.
        """
        fx = self.fx[:count]
        if self.tables.factors:
            total = self._product(fx, fy)
        else:
            total = self.parts[self.parity].values(fx, fy)
        if self.tables.is_change and self.parity == self.tables.radial_parity:
            total -= self.parts[self.parity].radial_values(fx, fy)
        return total

    def _product(self, fx: Array, fy: Array) -> Array:
        factor = self.tables.factor(fx, fy)
        total = np.zeros((self.tables.is_seen.sum(), len(fy), len(fx)))
        for own, part in self.parts.items():
            other = parity_of_product(own, self.parity)
            sign = (UNITS[own] * UNITS[other] / UNITS[self.parity]).real
            total += part.values(fx, fy) * (sign * factor[other])
        return total


@dataclass(frozen=True, eq=False)
class PartReader:
    """Tables of one parity, interpolated."""

    tables: Tables
    has_radial: bool
    """Whether this parity has the part over |f|."""
    plane: Array | None
    """Spline coefficients (P, m, m) over fy and fx, where there is such a part."""
    spline_x: Any
    """Sparse (n, m): what each of them counts at frequencies along x, four at a time."""

    def values(self, fx: Array, fy: Array) -> Array:
        """Return the tables at the first frequencies along x (n,) and at fy (m,): (P, m, n)."""
        if self.plane is None:
            return self.radial_values(fx, fy)
        along_y = spline_weights(self.plane.shape[-1], fy / self.tables.top)
        near = slice(along_y.indices.min(), along_y.indices.max() + 1)
        rows = along_y.toarray()[:, near] @ self.plane[..., near, :]
        flat = rows.reshape(-1, rows.shape[-1])
        total: Array = (self.spline_x[: len(fx)] @ flat.T).T.reshape(*rows.shape[:-1], len(fx))
        if self.has_radial:
            total += self.radial_values(fx, fy)
        total *= np.hypot(fx, fy[:, None]) <= self.tables.top
        return total

    def radial_values(self, fx: Array, fy: Array) -> Array:
        """Return the part over |f| at frequencies (n,) and (m,); its end holds beyond it."""
        tables, (entries, steps) = self.tables, self.tables.steps
        last = steps.shape[-1]
        position = np.add(np.square(fx), np.square(fy)[:, None]).ravel()
        np.sqrt(position, out=position)  # in a quarter of the time of `hypot`
        position *= last / tables.top
        np.minimum(position, last, out=position)
        index = np.minimum(position.astype(np.intp), last - 1)
        values = steps.take(index, axis=-1)
        values *= position - index
        values += entries.take(index, axis=-1)
        shaped: Array = values.reshape(-1, len(fy), len(fx))
        if tables.order:
            angle = tables.order * np.arctan2(fy[:, None], fx)
            shaped *= np.sin(angle) if tables.is_sine else np.cos(angle)
        return shaped


def reader(tables: Tables, parity: int, fx: Array) -> TableReader:
    """Return a reader of the transfer functions of one parity.

    Parameters
    ----------
    tables : Tables
        The tables.
    parity : int
        Number of the parity.
    fx : Array
        Rising frequencies (n,) along x [cycles/m].

    Returns
    -------
    TableReader
        The reader.
    """
    parts = {
        own: _part_reader(tables, own, fx)
        for own in tables.tabulated_parities
        if parity_of_product(own, parity) in tables.factor_parities
    }
    return TableReader(tables, parity, fx, parts)


def _part_reader(tables: Tables, parity: int, fx: Array) -> PartReader:
    plane, has_radial = tables.planes[parity], parity == tables.radial_parity
    if plane is None:
        return PartReader(tables, has_radial, None, None)
    spline = spline_weights(plane.shape[-1], fx / tables.top)
    return PartReader(tables, has_radial, _spline_coefficients(tables.of_pairs(plane)), spline)


def _spline_coefficients(plane: Array) -> Array:
    """Return the coefficients (P, m, m) of the cubic splines through tables over fy and fx."""
    from scipy.interpolate import make_interp_spline

    at = np.linspace(0, 1, plane.shape[-1])
    along_y = make_interp_spline(at, np.moveaxis(plane, -2, 0), k=3).c
    along_x = make_interp_spline(at, np.moveaxis(along_y, -1, 0), k=3).c
    return np.ascontiguousarray(np.moveaxis(along_x, (1, 0), (-2, -1)))


def spline_weights(entries: int, position: Array) -> Any:
    """Return what each coefficient of a table counts in a cubic spline.

    Parameters
    ----------
    entries : int
        Entries of the table.
    position : Array
        Positions (n,) as parts of the table's length; beyond 1 the value of the end holds.

    Returns
    -------
    sparse array
        Weights (n, entries).
    """
    from scipy.interpolate import BSpline

    at = np.linspace(0, 1, entries)
    knots = np.concatenate([[0.0] * 4, at[2:-2], [1.0] * 4])  # as `make_interp_spline` has them
    return BSpline.design_matrix(np.minimum(position, 1.0), knots, 3)


def tabulate(exact: Transfer, size: TableSize, mixing: Mixing) -> Tables:
    """Return the tables of a transfer function.

    Parameters
    ----------
    exact : Transfer
        The transfer of the components.
    size : TableSize
        Highest frequency and number of entries.
    mixing : Mixing
        Mixtures (R, K) of the components, and the error that they leave.

    Returns
    -------
    Tables
        The tables of the mixtures.
    """
    key = exact.key, size, mixing[0].tobytes(), mixing[1]
    return _TABLES.get(key, lambda: _tabulated(exact, size, mixing))


KEPT = 1 << 22
"""Bytes of tables that are kept."""
_TABLES: ByteCache[Tables] = ByteCache(KEPT, strict=True)
"""Tables of the last lenses. Those of one lens are the same object, so that what follows from them
is known, too: `strategies.picture_filter`."""


def _tabulated(exact: Transfer, size: TableSize, mixing: Mixing) -> Tables:
    mix, error = mixing
    mixed = exact.with_mixtures(mix)
    tables = Tables(mix, radial_table(mixed, size), size.top, error, factors=exact.geometric_blurs)
    if blurs := exact.tabulated_blurs:
        entries = size.plane_entries(blurs, math.prod(mixed.weights.shape[:2]))
        grid = plane_grid(mixed, size.top, entries)
        parts = grid.change(blurs)
        planes = tuple(part if np.any(part) else None for part in parts)
        tables = replace(tables, planes=planes)
    return tables


def radial_table(transfer: Transfer, size: TableSize) -> Array:
    """Return the radial part of a transfer function over |f|.

    Parameters
    ----------
    transfer : Transfer
        The transfer.
    size : TableSize
        Highest frequency and number of entries.

    Returns
    -------
    Array
        Table (K, C, entries) [e/s].
    """
    return transfer.radial_response(np.linspace(0, size.top, size.entries))


def bounding_tables(exact: Transfer, size: TableSize, mixing: Mixing) -> Tables:
    """Return tables that no lens exceeds whose radial part is this one.

    It is as if no light canceled.

    Parameters
    ----------
    exact : Transfer
        The transfer of the components.
    size : TableSize
        Highest frequency and number of entries.
    mixing : Mixing
        Mixtures (R, K) of the components, and the error that they leave.

    Returns
    -------
    Tables
        The tables, without directions.
    """
    mixed = exact.with_mixtures(mixing[0])
    bound = replace(mixed.with_effects(mixed.radial_blurs), weights=np.abs(mixed.weights))
    return Tables(mixing[0], radial_table(bound, size), size.top, mixing[1])


@dataclass(frozen=True, eq=False)
class PlaneGrid:
    """Frequencies at which blurs with a direction are computed."""

    radial_transfer: Transfer
    """The radial part at every second wavelength: what is added to it is small."""
    frequency: Array
    """(m,) from 0 [cycles/m]."""

    def change(self, blurs: Sequence[Blur]) -> Array:
        """Return what blurs add to the light, by parity.

        Parameters
        ----------
        blurs : sequence of Blur
            The blurs.

        Returns
        -------
        Array
            Transfer (4, K, C, m, m) [e/s].
        """
        m = len(self.frequency)
        components, colors, wavelengths = self.radial_transfer.weights.shape
        out = np.empty((len(PARITIES), components, colors, m, m))
        for rows in slices_within(slice(0, m), max(ROWS_VALUES // (2 * wavelengths * m), 1)):
            out[..., rows, :] = self._change_in_rows(blurs, rows)
        return out

    def _change_in_rows(self, blurs: Sequence[Blur], rows: slice) -> Array:
        """Return the same in some rows: (4, K, C, rows, m) [e/s]."""
        up = self.frequency[rows]
        fy = np.concatenate([up, -up])
        radial = self.radial_transfer.otf_radial(np.hypot(self.frequency, up[:, None]))
        radial = np.concatenate([radial, radial], axis=1)
        change = np.empty(radial.shape, np.complex128)
        wavelengths = self.radial_transfer.wavelengths
        for part, radial_part, wavelength in zip(change, radial, wavelengths, strict=True):
            otf = np.ones(part.shape, np.complex128)
            for blur in blurs:
                otf *= blur.smooth_otf_plane(self.frequency, fy, float(wavelength))
            np.multiply(otf - 1, radial_part, out=part)
        both = self.radial_transfer.spectral_sum(change)
        return split_by_parity(both[..., : len(up), :], both[..., len(up) :, :])


def split_by_parity(plus: Array, minus: Array) -> Array:
    """Return a transfer function by `PARITIES` from its values at (fx, fy) and at (fx, -fy).

    H(-f) = conj(H(f)), so a half-plane tells all.

    Parameters
    ----------
    plus : Array
        Complex values at (fx, fy), of any shape.
    minus : Array
        Complex values at (fx, -fy).

    Returns
    -------
    Array
        Real parts (4, *shape).
    """
    return np.array(
        [
            (plus.real + minus.real) / 2,
            (minus.real - plus.real) / 2,
            -(plus.imag + minus.imag) / 2,
            (minus.imag - plus.imag) / 2,
        ]
    )


def plane_grid(transfer: Transfer, top: float, entries: int) -> PlaneGrid:
    """Return a grid of frequencies from 0 along each axis.

    Parameters
    ----------
    transfer : Transfer
        The transfer.
    top : float
        Highest frequency [cycles/m].
    entries : int
        Frequencies along each axis.

    Returns
    -------
    PlaneGrid
        The grid.
    """
    radial_transfer = transfer.with_effects(transfer.radial_blurs).with_half_the_wavelengths()
    return PlaneGrid(radial_transfer, np.linspace(0, top, entries))


def mixtures(
    exact: Transfer, size: TableSize, more: Callable[[], Sequence[Array]] = list
) -> Mixing:
    """Return the fewest mixtures of a scene's components that keep its transfer functions.

    Where a scene has more components than colors can tell apart, singular vectors of H_kc over all
    colors and frequencies replace them, as many as keep every H_kc within `size.tolerance` of the
    largest level. Components that have no color in common, such as a layer's light and its
    opacity, are not mixed.

    Parameters
    ----------
    exact : Transfer
        Transfer of the components.
    size : TableSize
        Size of the tables.
    more : callable, optional
        Makes what else the mixtures have to serve, (K, any number) each [e/s].

    Returns
    -------
    Mixing
        Mixtures (R, K), and the largest relative error that they leave.
    """
    components, colors = exact.weights.shape[:2]
    every = np.eye(components)
    most = components if size.rank is None else size.rank
    if components <= min(max(colors, 3), most):
        return every[exact.weights.any(axis=(1, 2))], 0.0
    table = np.concatenate([*_samples(exact, size.top), *more()], axis=1)
    peak, mix, error = np.abs(exact.level).max() or 1.0, every[:0], 0.0
    for part in _separate_groups(exact.weights) if size.rank is None else [np.arange(components)]:
        own, lost = _fewest(table[part], size.tolerance * peak, most)
        mix, error = np.concatenate([mix, own @ every[part]]), max(error, lost / peak)
    return mix, error


def _separate_groups(weights: Array) -> list[Array]:
    """Return the components (n,) of each group that has no color in common with others.

    Those that no color sees are in none.
    """
    seen = weights.any(axis=2).astype(int)
    linked = np.eye(len(weights), dtype=bool)
    while (more := linked | ((linked @ seen @ seen.T) > 0)).sum() > linked.sum():
        linked = more
    lit = linked[seen.any(axis=1)]
    return [np.flatnonzero(row) for row in np.unique(lit, axis=0)[::-1]]


def _fewest(table: Array, allowed: float, most: int) -> Mixing:
    """Return the fewest mixtures (R, K) of a table (K, n) that err little enough, and their error.

    They are at most `most`, and else all of the K.
    """
    directions = np.linalg.eigh(product(table, table.T))[1].T[::-1]
    left = table.copy()
    for rank, direction in enumerate(directions[:-1], start=1):
        left -= np.outer(direction, direction @ left)
        error = float(max(left.max(), -left.min()))
        if error <= allowed or rank == most:
            return directions[:rank], error
    return np.eye(len(table)), 0.0


def _samples(transfer: Transfer, top: float) -> list[Array]:
    """Return H_kc at some frequencies: (K, any number) [e/s]."""
    components = len(transfer.weights)
    samples = [transfer.radial_response(np.linspace(0, top, JUDGED)).reshape(components, -1)]
    if transfer.plane_blurs:
        more = plane_grid(transfer, top, 9).change(transfer.plane_blurs)
        samples.append(np.moveaxis(more, 1, 0).reshape(components, -1))
    return samples
