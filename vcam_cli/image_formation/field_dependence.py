"""Blur that changes over the field: few tables, and how much of each there is in every place.

A lens's blur is known at some places, its zones, and is a weighted mean of theirs in between.
Filtering the picture once for each of dozens of zones would cost dozens of times one filter; but
zones are much alike. The mean of all of them and a few singular vectors of what is left stand for
them within a known error (as eigen-images of point spread functions do: Lauer, Proc. SPIE 4847,
2002), and each is one filter whose result is weighted by a smooth map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Blur, PlaneTransfer, Zone, of_kind
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.image_formation.optical_path import Layer
from vcam_cli.image_formation.scene_spectrum import SceneSpectrum
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import (
    LARGEST_OF_FIELD,
    PARITIES,
    Mixing,
    Tables,
    TableSize,
    mixtures,
    plane_grid,
    radial_table,
    turn_table,
)

PLACES = 97
"""Points of a map along each side of the sensor; between them it is straight."""
SMALL = 0.1
"""Part of the tolerance below which a parity of the mean transfer is left out: of zones all around
the axis only rounding is there."""


@dataclass(frozen=True)
class Map:
    """A smooth function on the sensor."""

    values: NDArray
    """(PLACES, PLACES) from edge to edge"""
    half_width: float
    half_height: float

    def __call__(self, x: NDArray, y: NDArray) -> NDArray:
        """Return the values (rows, columns) at the positions x (columns,), y (rows,) [m].

        They have the type of x.
        """
        last = PLACES - 1
        along_y = np.clip((y / self.half_height + 1) * (last / 2), 0, last)
        along_x = np.clip((x / self.half_width + 1) * (last / 2), 0, last)
        rows = _linear(self.values, along_y).astype(x.dtype)
        return _linear(rows.T, along_x).T

    @property
    def mean_square(self) -> float:
        """Mean square over the sensor."""
        return float(np.mean(self.values**2))


def _linear(values: NDArray, position: NDArray) -> NDArray:
    """Return rows of a table at positions between them (n,), by linear interpolation."""
    index = np.minimum(position.astype(int), len(values) - 2)
    part = (position - index).astype(values.dtype)[:, None]
    return np.asarray(values[index] * (1 - part) + values[index + 1] * part)


@dataclass(frozen=True)
class Mode:
    """A table that is added, as much of it as its map says."""

    tables: Callable[[], Tables]
    """Makes the table when it is needed: all of them together take much memory."""
    map: Map


def field_mixtures(uniform_transfer: Transfer, zones: Sequence[Zone], size: TableSize) -> Mixing:
    """Return the fewest mixtures of the components that serve all zones.

    Parameters
    ----------
    uniform_transfer : Transfer
        Transfer without the blur that has zones.
    zones : sequence of Zone
        Zones of the blur.
    size : TableSize
        Size of the tables.

    Returns
    -------
    Mixing
        Mixtures, and the error that they leave.
    """
    return mixtures(_zone_transfers(uniform_transfer, zones)[:: max(1, len(zones) // 6)], size)


def _zone_transfers(uniform_transfer: Transfer, zones: Sequence[Zone]) -> list[Transfer]:
    return [
        replace(uniform_transfer, effects=(*uniform_transfer.effects, zone.blur)) for zone in zones
    ]


def tabulate_field(
    uniform_transfer: Transfer,
    zones: Sequence[Zone],
    geometry: Geometry,
    size: TableSize,
    mixing: Mixing,
) -> tuple[Tables, tuple[Mode, ...]]:
    """Return the mean transfer function of all zones, and what differs from it by place.

    Parameters
    ----------
    uniform_transfer : Transfer
        Transfer without the blur that has zones.
    zones : sequence of Zone
        Zones of the blur.
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
    blurs = [zone.blur for zone in zones]
    directed = bool(of_kind(blurs, PlaneTransfer))
    if directed:
        stack = _stack_planes(uniform_transfer, blurs, size)
    else:
        each = [radial_table(t, size)[None] for t in _zone_transfers(uniform_transfer, zones)]
        stack = Stack(each, [(i, 0, False) for i in range(len(each))])
    level = np.abs(uniform_transfer.level).max() or 1.0
    power = _expected_power(stack.tables[0].shape, directed) / uniform_transfer.weights.shape[1]
    shares, left = _shares(stack, power, size.tolerance * level)
    maps = zone_maps(zones, geometry)
    weights = np.array([m.values for m in maps])
    error += left / level

    def tables(share: NDArray, parity: int) -> Tables:
        mixed = stack.weighted_sum(parity, share - share.mean())
        if not directed:
            return Tables(mix, mixed, size.top, error)
        planes = tuple(mixed if parity == p else None for p in range(len(PARITIES)))
        return Tables(mix, None, size.top, error, planes)

    modes = tuple(
        Mode(partial(tables, share, p), replace(maps[0], values=np.tensordot(share, weights, 1)))
        for p, share in shares
    )
    even = np.full(len(zones), 1 / len(zones))
    means = [stack.weighted_sum(p, even) for p in range(stack.parities)]
    if not directed:
        return Tables(mix, means[0], size.top, error), modes
    small = SMALL * size.tolerance * level
    planes = (mean if _rms(mean, power) > small else None for mean in means)
    return Tables(mix, base, size.top, error, tuple(planes)), modes


@dataclass(frozen=True, eq=False)
class Stack:
    """Tables of all zones, made of those of fewer blurs when they are asked for."""

    tables: list[NDArray]
    """(parities, R, C, ...) each"""
    zones: list[tuple[int, int, bool]]
    """Of each zone: index into them, quarter turns, whether y is mirrored before."""

    @property
    def parities(self) -> int:
        """Number of parities of the tables."""
        return len(self.tables[0])

    def rows(self, parity: int, at: tuple[int, ...]) -> NDArray:
        """Return the tables of all zones of a component and color, (zones, ...), in 64 bits."""
        found = [self._zone_table(zone, parity, (slice(None), *at)) for zone in self.zones]
        return np.array(found, dtype=np.float64)

    def weighted_sum(self, parity: int, shares: NDArray) -> NDArray:
        """Return the sum of all zones' tables, each with its share: (R, C, ...)."""
        total = np.zeros(self.tables[0].shape[1:])
        for zone, share in zip(self.zones, shares, strict=True):
            total += share * self._zone_table(zone, parity, slice(None))
        return total

    def _zone_table(self, zone: tuple[int, int, bool], parity: int, at: Any) -> NDArray:
        model, quarters, mirrored = zone
        return turn_table(self.tables[model][at], parity, quarters, mirrored)


def _stack_planes(uniform_transfer: Transfer, blurs: Sequence[Blur], size: TableSize) -> Stack:
    """Return what the zones' blurs add to the transfer.

    Those that are others turned are computed once.
    """
    directed = of_kind(blurs, PlaneTransfer)
    grid = plane_grid(uniform_transfer, size.top, size.plane_entries(directed, LARGEST_OF_FIELD))
    models = [blur.model for blur in blurs]
    known = list(dict.fromkeys(blur for blur, _, _ in models))
    return Stack(
        [grid.change([blur]).astype(np.float32) for blur in known],
        [(known.index(blur), quarters, mirrored) for blur, quarters, mirrored in models],
    )


def _shares(
    stack: Stack, power: NDArray, allowed: float
) -> tuple[list[tuple[int, NDArray]], float]:
    """Return the modes, strongest first, and the error of what is left.

    A mode is its parity, and its share in each zone. The error of a zone is the rms of its tables',
    each entry weighed by its expected power, in the mean over colors. Singular vectors come from
    the zones' products with each other, of which there are few; by parity, so that a mode has only
    one.
    """
    found, left = [], np.zeros(len(stack.zones))
    for parity in range(stack.parities):
        products = np.zeros((len(left), len(left)))
        for at in np.ndindex(stack.tables[0].shape[1:3]):
            rows = stack.rows(parity, at)
            rows = ((rows - rows.mean(axis=0)) * np.sqrt(power)).reshape(len(left), -1)
            products += rows @ rows.T
        left += np.diag(products)
        strengths, vectors = np.linalg.eigh(products)
        found += [(s, parity, v) for s, v in zip(strengths, vectors.T, strict=True)]
    found.sort(key=lambda mode: -mode[0])
    for count, (strength, _, share) in enumerate(found):
        error = float(np.sqrt(max(left.max(), 0.0)))
        if error <= allowed:
            return [mode[1:] for mode in found[:count]], error
        left -= max(strength, 0.0) * share**2
    return [mode[1:] for mode in found], 0.0


def _rms(table: NDArray, power: NDArray) -> float:
    """Return what a table adds to a picture, relative to the light that it is for."""
    return float(np.sqrt((table**2 * power).sum()))


def _expected_power(shape: tuple[int, ...], directed: bool) -> NDArray:
    """Return how much of a picture's variance lies at each entry of a table.

    It is as much in each octave: its power falls with the square of the frequency (D. L. Ruderman,
    Network 5, 1994). The sum is 1.
    """
    count = shape[-1]
    at = np.arange(count)
    length = np.hypot(at[None, :], at[:, None]) if directed else at
    power = np.maximum(length, 1.0) ** (-2.0 if directed else -1.0)
    return np.asarray(power / power.sum())


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
        yield Layer(series.signal, None if mode is None else mode.map)
