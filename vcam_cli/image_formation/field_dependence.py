"""Blur that changes over the field: few tables, and how much of each there is in every place.

A lens's blur is known at some places from center to corner, its rings, and is a weighted mean of
theirs in between. Filtering the picture once for each place would cost dozens of times one filter;
but a lens that is symmetric about its axis only turns with the azimuth. By harmonics of the
direction of the frequency that is a factor: cos m(theta - phi) = cos m theta cos m phi + sin m
theta sin m phi. So the mean of all places, and of each harmonic a few singular vectors over the
rings, represent the field within a known error (as eigen-images of point spread functions do:
Lauer, Proc. SPIE 4847, 2002). Each is one table over |f| and one filter, whose result is weighted
by a smooth map.

Modes are found at few frequencies, since transfer functions are smooth; those that a picture needs
are resampled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, PlaneTransfer, Zone
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.image_formation.optical_path import Layer
from vcam_cli.image_formation.scene_spectrum import SceneSpectrum
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import (
    Mixing,
    Tables,
    TableSize,
    mixtures,
    radial_table,
)
from vcam_cli.physics.interpolation import between_entries
from vcam_cli.records import dataclass

CUBIC = 4
"""Entries that a polynomial between those of a coarse table goes through."""
PLACES = 97
"""Points of a map along each side of the sensor; between them it is straight."""
LEFT_ALONG = 1e-3
"""Rms error of a ring's transfer along one direction, by the modes that are left out, relative to
the level: what edges change errs by 0.2 % of itself, and by 0.7 % with four times as much."""
JUDGED_HERE = 33
"""Frequencies at which mixtures of spectra are judged in some rings."""


@dataclass(frozen=True)
class Map:
    """A smooth function on the sensor, or several of them."""

    values: Array
    """(PLACES, PLACES) from edge to edge, or (M, PLACES, PLACES) of several; a call takes one."""
    half_width: float
    half_height: float

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the values (rows, columns) at the positions x (columns,), y (rows,) [m].

        They have the type of x.
        """
        rows = linear(self.values, map_position(y, self.half_height)).astype(x.dtype)
        return linear(rows.T, map_position(x, self.half_width)).T

    def along(self, places: Array, in_rows: bool) -> Array:
        """Return the maps' own rows at places x, or their columns at places y.

        Parameters
        ----------
        places : Array
            Places (n,) [m].
        in_rows : bool
            Whether they lie along x.

        Returns
        -------
        Array
            Values (..., PLACES, n); between rows they are straight.
        """
        half = self.half_width if in_rows else self.half_height
        sides = np.ascontiguousarray(np.moveaxis(self.values, -1 if in_rows else -2, 0))
        return np.moveaxis(linear(sides, map_position(places, half)), 0, -1)

    def at(self, x: Array, y: Array) -> Array:
        """Return the values at points x, y of one shape [m], of every map."""
        column, row = map_position(x, self.half_width), map_position(y, self.half_height)
        left, above = (np.minimum(a.astype(int), PLACES - 2) for a in (column, row))
        right, below = column - left, row - above
        upper, lower = (
            self.values[..., line, left] * (1 - right) + self.values[..., line, left + 1] * right
            for line in (above, above + 1)
        )
        return np.asarray(upper * (1 - below) + lower * below)

    @property
    def azimuth(self) -> Array:
        """The azimuth of its places, from x towards y [rad]."""
        at = np.linspace(-1, 1, PLACES)
        return np.arctan2(at[:, None] * self.half_height, at * self.half_width)

    @property
    def mean_square(self) -> float:
        """Mean square over the sensor."""
        return float(np.mean(self.values**2))


def map_position(place: Array, half: float) -> Array:
    """Return where places lie along a side of a map, from 0 to PLACES - 1.

    Parameters
    ----------
    place : Array
        Distances from the middle, of any shape [m].
    half : float
        Half the side [m].

    Returns
    -------
    Array
        Positions, in the shape and type of `place`.
    """
    last = PLACES - 1
    return np.clip((place / half + 1) * (last / 2), 0, last)


def linear(values: Array, position: Array) -> Array:
    """Return rows of a table at positions between them, by linear interpolation.

    Parameters
    ----------
    values : Array
        Table (rows, ...).
    position : Array
        Positions (n,), from 0 to the last row.

    Returns
    -------
    Array
        Rows (n, ...).
    """
    index = np.minimum(position.astype(int), len(values) - 2)
    part = (position - index).astype(values.dtype).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[index] * (1 - part) + values[index + 1] * part)


@dataclass(frozen=True)
class Mode:
    """A table that is added, as much of it as its map says."""

    tables: Callable[[], Tables]
    """Makes the table when it is needed: all of them together take much memory."""
    map: Map


def field_mixtures(uniform_transfer: Transfer, rings: Sequence[Zone], size: TableSize) -> Mixing:
    """Return the fewest mixtures of the components that serve the whole field.

    Parameters
    ----------
    uniform_transfer : Transfer
        Transfer without the blur that changes over the field.
    rings : sequence of Zone
        That blur on the half-axis to the right.
    size : TableSize
        Size of the tables.

    Returns
    -------
    Mixing
        Mixtures, and the error that they leave.
    """

    def changes() -> list[Array]:
        frequency = np.linspace(0, size.top, JUDGED_HERE)
        count = len(uniform_transfer.weights)
        found = _changes(uniform_transfer, rings[:: max(1, len(rings) // 4)], frequency)
        return [np.moveaxis(c, 1, 0).reshape(count, -1).view(np.float64) for c in found]

    return mixtures(uniform_transfer, size, changes)


def _changes(uniform_transfer: Transfer, rings: Sequence[Zone], frequency: Array) -> list[Array]:
    """Return what the blur of each ring adds to a transfer, by harmonics of the direction.

    They are complex (m, K, C, n) [e/s], see `direction_harmonics`. What depends on the direction is
    small: it is computed at every second wavelength. The transfer is its radial part; its blurs
    with a direction are `Tables.factors`.
    """
    light = uniform_transfer.with_half_the_wavelengths()
    before = light.otf_radial(frequency)

    def change(blur: Blur) -> Array:
        directed = of_kind([blur], PlaneTransfer)
        if not directed:
            whole = replace(uniform_transfer, effects=(*uniform_transfer.effects, blur))
            added = whole.radial_response(frequency) - uniform_transfer.radial_response(frequency)
            return added[None].astype(np.complex128)
        harmonics = np.moveaxis(directed[0].harmonics(frequency, light.wavelengths), -1, 1)
        added = np.multiply(harmonics, before[:, None], order="C")
        del harmonics  # both are large
        added[:, 0] -= before
        parts = added.view(np.float64).reshape(*added.shape, 2)
        return np.moveaxis(light.spectral_sum(parts), 2, 0).copy().view(np.complex128)[..., 0]

    return [change(ring.blur) for ring in rings]


def tabulate_field(
    uniform_transfer: Transfer,
    rings: Sequence[Zone],
    geometry: Geometry,
    size: TableSize,
    mixing: Mixing,
) -> tuple[Tables, tuple[Mode, ...]]:
    """Return the mean transfer function of all places, and what differs from it by place.

    Parameters
    ----------
    uniform_transfer : Transfer
        Transfer without the blur that changes over the field.
    rings : sequence of Zone
        That blur on the half-axis to the right.
    geometry : Geometry
        Geometry of the array.
    size : TableSize
        Size of the tables.
    mixing : Mixing
        Mixtures of the scene's components, and the error that they leave.

    Returns
    -------
    mean : Tables
        Tables of the mean.
    modes : tuple of Mode
        Modes that are added to it, the strongest first.

    References
    ----------
    T. R. Lauer, Proc. SPIE 4847, 2002 (eigen-images of point spread functions).
    """
    mix, error = mixing
    uniform_transfer = uniform_transfer.with_mixtures(mix)
    base = radial_table(uniform_transfer, size)
    frequency = np.linspace(0, size.top, ring_entries(rings, size))
    changes = _changes(uniform_transfer, rings, frequency)
    level = np.abs(uniform_transfer.level).max() or 1.0
    families, left = _families(changes, size.tolerance * level)
    error += left / level
    maps = zone_maps(rings, geometry)
    weights = np.array([m.values for m in maps])
    azimuth = maps[0].azimuth

    table = partial(
        Tables, mix, top=size.top, error=error, factors=uniform_transfer.geometric_blurs
    )

    def tables(family: Family, is_sine: bool, share: Array) -> Tables:
        radial = _resampled(family.table(changes, share), base.shape[-1])
        sign = -1 if family.order % 2 or is_sine else 1  # of a wave, by `split_by_parity`
        return table(sign * radial, order=family.order, is_sine=is_sine)

    modes = []
    for family, share in families:
        around = np.tensordot(share, weights, 1)
        modes += [
            Mode(partial(tables, family, is_sine, share), replace(maps[0], values=around * turned))
            for is_sine, turned in family.turned(azimuth)
        ]
    mean = _resampled(np.mean([change[0].real for change in changes], axis=0), base.shape[-1])
    return table(base + mean), tuple(modes)


def field_along(
    light: Transfer,
    rings: Sequence[Zone],
    geometry: Geometry,
    frequency: Array,
    across: tuple[float, float],
) -> tuple[Array, Map]:
    """Return what a blur that changes over the field adds to waves in one direction, by place.

    Parameters
    ----------
    light : Transfer
        Light of one component.
    rings : sequence of Zone
        The blur on the half-axis to the right.
    geometry : Geometry
        Geometry of the array.
    frequency : Array
        Spatial frequencies (n,), rising [cycles/m].
    across : tuple of float
        Unit vector (x, y) along which the waves change.

    Returns
    -------
    changes : Array
        Changes of the transfer (M, C, n), whose sum over all M is that at a place [e/s].
    weights : Map
        How much there is of each: M maps.
    """
    top = float(frequency[-1])
    coarse = np.linspace(0, top, len(frequency))
    changes = _changes(light.with_effects(()), rings, coarse)
    families, _ = _families(changes, LEFT_ALONG * float(np.abs(light.level).max()))
    maps = zone_maps(rings, geometry)
    weights, azimuth = np.array([m.values for m in maps]), maps[0].azimuth
    direction = math.atan2(across[1], across[0])

    def at_frequencies(table: Array) -> Array:
        return between_entries(table[0], frequency / top * (len(coarse) - 1), CUBIC, -1)

    mean = np.mean([change[0].real for change in changes], axis=0)
    tables, shares = [at_frequencies(mean)], [np.ones_like(azimuth)]
    for family, share in families:
        angle = family.order * direction
        turned = sum(
            (math.sin(angle) if is_sine else math.cos(angle)) * part
            for is_sine, part in family.turned(azimuth)
        )
        table = family.table(changes, share) * (1j if family.order % 2 else 1)
        tables.append(at_frequencies(table))
        shares.append(np.tensordot(share, weights, 1) * turned)
    return np.array(tables), replace(maps[0], values=np.array(shares))


def ring_entries(rings: Sequence[Zone], size: TableSize) -> int:
    """Return the entries over |f| at which the blurs of a field are computed.

    Twice as many steps in a period as tables over fx and fy have: they follow the phase of the
    outermost rays, whose light is little: behind f/4 a quarter of them served coma of 2 waves.

    Parameters
    ----------
    rings : sequence of Zone
        The blurs on the half-axis to the right.
    size : TableSize
        Size of the tables.

    Returns
    -------
    int
        Entries from 0 to the end of the tables.
    """
    directed = of_kind([ring.blur for ring in rings], PlaneTransfer)
    if not directed:
        return size.entries
    return min(2 * size.wanted_entries(directed) - 1, size.entries)


@dataclass(frozen=True)
class Family:
    """The real or the imaginary parts of one harmonic of the direction, in all rings.

    A lens turned by the azimuth phi has A exp(-i m phi) for A: each part has a cosine and a sine of
    the direction, times one of the azimuth.
    """

    order: int
    is_imaginary: bool

    def table(self, changes: Sequence[Array], share: Array) -> Array:
        """Return the sum of all rings' tables, each with its share.

        Parameters
        ----------
        changes : sequence of Array
            Harmonics (m, R, C, n) of each ring [e/s].
        share : Array
            Share of each ring.

        Returns
        -------
        Array
            Table (R, C, n) [e/s].
        """
        total: Array = np.zeros(changes[0].shape[1:])
        for change, part in zip(changes, share, strict=True):
            total += part * self.of_ring(change)
        return total

    def of_ring(self, change: Array) -> Array:
        """Return the table of a ring.

        Parameters
        ----------
        change : Array
            Its harmonics (m, R, C, n) [e/s].

        Returns
        -------
        Array
            Table (R, C, n) [e/s].
        """
        if self.order >= len(change):
            return np.zeros(change.shape[1:])
        harmonic = change[self.order]
        return np.asarray(harmonic.imag if self.is_imaginary else harmonic.real)

    def turned(self, azimuth: Array) -> list[tuple[bool, Array]]:
        """Return whether the direction has a sine, and the factor by azimuth, of both parts.

        Parameters
        ----------
        azimuth : Array
            Azimuths of places of the field [rad].

        Returns
        -------
        list of tuple
            (has a sine, factor in the shape of `azimuth`) of each part.
        """
        if not self.order:
            return [(False, np.ones_like(azimuth))]
        cosine, sine = np.cos(self.order * azimuth), np.sin(self.order * azimuth)
        # Re(A exp(im(theta - phi))) of even orders, Im(A exp(im(theta - phi))) of odd ones.
        if self.order % 2 == 0:
            return (
                [(False, sine), (True, -cosine)]
                if self.is_imaginary
                else [(False, cosine), (True, sine)]
            )
        return (
            [(False, cosine), (True, sine)]
            if self.is_imaginary
            else [(False, -sine), (True, cosine)]
        )


def _families(changes: Sequence[Array], allowed: float) -> tuple[list[tuple[Family, Array]], float]:
    """Return the modes, strongest first, and the error of leaving out the others.

    A mode is its family, and its share in each ring. The error of a ring is the rms of its tables,
    each entry weighed by its expected power, in the mean over colors. Singular vectors come from
    the few products of the rings with each other. Means over all azimuths are 0 but
    of order 0, whose mean over the rings is no mode.
    """
    power = _expected_power(changes[0].shape[-1]) / changes[0].shape[2]
    found, left = [], np.zeros(len(changes))
    for order in range(max(len(change) for change in changes)):
        for is_imaginary in (False, True) if order else (False,):
            family = Family(order, is_imaginary)
            rows = np.array([family.of_ring(change) for change in changes])
            # the mean square of a cosine is 1/2
            rows = rows / math.sqrt(2) if order else rows - rows.mean(axis=0)
            rows = (rows * np.sqrt(power)).reshape(len(changes), -1)
            products = rows @ rows.T
            left += np.diag(products)
            strengths, vectors = np.linalg.eigh(products)
            found += [(s, family, v) for s, v in zip(strengths, vectors.T, strict=True)]
    found.sort(key=lambda mode: -mode[0])
    for count, (strength, _, share) in enumerate(found):
        error = float(np.sqrt(max(left.max(), 0.0)))
        if error <= allowed:
            return [mode[1:] for mode in found[:count]], error
        left -= max(strength, 0.0) * share**2
    return [mode[1:] for mode in found], 0.0


def _expected_power(count: int) -> Array:
    """Return how much of a picture's variance lies at each of the entries over |f|.

    It is as much in each octave: its power falls with the square of the frequency (D. L. Ruderman,
    Network 5, 1994). The sum is 1.
    """
    power = 1 / np.maximum(np.arange(count), 1.0)
    return np.asarray(power / power.sum())


def _resampled(table: Array, entries: int) -> Array:
    """Return a table over |f| (..., n) at more entries, by cubics through four neighbors."""
    count = table.shape[-1]
    if count == entries:
        return table
    return between_entries(table, np.linspace(0, count - 1, entries), CUBIC, -1)


def zone_maps(zones: Sequence[Zone], geometry: Geometry) -> list[Map]:
    """Return the zones' weights as maps.

    Parameters
    ----------
    zones : sequence of Zone
        Zones of a blur, whose weights sum to 1.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    list of Map
        A map for each zone, without unit.
    """
    half = geometry.sensor_width / 2, geometry.sensor_height / 2
    at = np.linspace(-1, 1, PLACES)
    return [Map(zone.weight(at * half[0], at * half[1]), *half) for zone in zones]


def filtered_layers(
    image_filter: Filter, modes: Sequence[Mode], spectrum: SceneSpectrum, workers: int
) -> Iterator[Layer]:
    """Yield the light through a filter, and through one more for each mode of the field.

    Parameters
    ----------
    image_filter : Filter
        Filter with the mean transfer function of all zones.
    modes : sequence of Mode
        Modes that are added to it.
    spectrum : SceneSpectrum
        Spectrum of the mixtures that the tables are for.
    workers : int
        Number of threads; the result does not depend on it.

    Yields
    ------
    Layer
        Share of the signal [e/s].
    """
    for mode in (None, *modes):
        chosen = image_filter if mode is None else replace(image_filter, tables=mode.tables())
        series = chosen.apply(spectrum, workers)
        yield Layer(series.on_processor(), None if mode is None else mode.map)
