"""How much memory tables over fx and fy will take: known before they are computed.

What counts: the transfer at all wavelengths while it is summed, the finer tables of all parities,
the pupils' grids that stay for other frames, and of a blur that changes what every zone adds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vcam_cli.effects.base import PlaneTransfer, Zone
from vcam_cli.engine.transfer import (
    FINER,
    MOST_OF_FIELD,
    PARITIES,
    Fineness,
    Tables,
    Transfer,
    finer,
    plane_size,
)
from vcam_cli.physics.aberration import MOST_GRIDS

MIXTURES = 6
"""Of all the spectra of a scene, about, however many they are."""
PUPIL = 15
"""What computing a pupil's grid takes, in such grids."""
COMPLEX, DOUBLE, SINGLE = 16, 8, 4
"""Bytes of a number."""


@dataclass(frozen=True)
class Room:
    """Memory of tables [bytes]."""

    most: int = 0
    """While they are computed."""
    kept: int = 0
    """From then on."""


def of_tables(exact: Transfer, fine: Fineness) -> Room:
    """Memory of what `transfer.tabulate` makes."""
    if not exact.plane:
        return Room()
    size = plane_size(exact.plane, fine)
    grids, work = _grids(exact, exact.plane)
    final = _final(exact, fine, size, len(PARITIES))
    most = max(_summed(exact, fine, size), _refined(exact, fine, size) + final)
    return Room(grids + work + most, grids + final)


def of_zones(exact: Transfer, zones: Sequence[Zone], fine: Fineness) -> Room:
    """Memory of what `field.tabulate` makes."""
    blurs = [zone.blur for zone in zones if isinstance(zone.blur, PlaneTransfer)]
    if not blurs:  # tables over |f| of every zone, and once more while they are compared
        entries = len(zones) * exact.weights[..., 0].size * fine.computed * DOUBLE
        return Room(2 * entries, entries)
    models = list(dict.fromkeys(blur.model[0] for blur in blurs))
    size = plane_size(models, fine, MOST_OF_FIELD)
    known = len(models) * _tables(exact, fine) * len(PARITIES) * size**2 * SINGLE
    # The mean has few parities, a mode has one.
    final = _final(exact, fine, size, 2)
    compared = 3 * len(zones) * size**2 * DOUBLE
    most = max(_summed(exact, fine, size), _refined(exact, fine, size) + final, compared)
    grids, work = _grids(exact, models)
    return Room(grids + known + max(most, work), grids + known + final)


def table_values(exact: Transfer, zones: Sequence[Zone], tables: Tables) -> int:
    """At how many places, wavelengths and zones the transfer of fx and fy was computed."""
    plane = next((plane for plane in tables.planes if plane is not None), None)
    if plane is None:
        return 0
    steps = plane.shape[-1] // FINER + 1  # or up to twice as many
    blurs = {zone.blur.model[0] for zone in zones if isinstance(zone.blur, PlaneTransfer)}
    return 2 * steps**2 * len(exact.thinned().wavelengths) * max(len(blurs), 1)


def _tables(exact: Transfer, fine: Fineness) -> int:
    """Mixtures times colors."""
    components, colors, _ = exact.weights.shape
    return min(components, max(fine.rank or MIXTURES, 3)) * colors


def _grids(exact: Transfer, blurs: Sequence[PlaneTransfer]) -> tuple[int, int]:
    """Pupils' grids of all blurs and wavelengths; what computing the largest takes."""
    wavelengths = exact.thinned().wavelengths
    kept = {key: size for blur in blurs for key, size in blur.keeps(wavelengths).items()}
    return min(sum(kept.values()), MOST_GRIDS), PUPIL * max(kept.values(), default=0)


def _summed(exact: Transfer, fine: Fineness, size: int) -> int:
    """While one blur's transfer is summed over the wavelengths: see `Plane.on_top`.

    Of every wavelength the radial transfer and what is on top; of one, what a blur is made of; in
    the end the sum, and its parities twice while they are put together.
    """
    plane = 2 * size**2
    parities = 2 * len(PARITIES) * size**2 * DOUBLE
    count = len(exact.thinned().wavelengths)
    last = max(6 * plane * COMPLEX, _tables(exact, fine) * (plane * COMPLEX + parities))
    return count * plane * (DOUBLE + COMPLEX) + last


def _refined(exact: Transfer, fine: Fineness, size: int) -> int:
    """While tables are made finer, beside those: all parities, and one half way."""
    parities = len(PARITIES) * size**2 * DOUBLE
    return _tables(exact, fine) * (parities + size * _finer(size) * SINGLE)


def _final(exact: Transfer, fine: Fineness, size: int, parities: int) -> int:
    return _tables(exact, fine) * parities * _finer(size) ** 2 * SINGLE


def _finer(size: int) -> int:
    """Entries along an axis of a table."""
    return finer(size) * (size - 1) + 1
