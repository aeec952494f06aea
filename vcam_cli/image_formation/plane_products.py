"""A blur with a direction beside one that changes over the field: their transfers multiply.

Tables of the field are over |f| times a wave of the direction. What a further blur with a direction
takes from them (motion, a low-pass filter along a diagonal) is added over fx and fy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import PlaneTransfer, Zone
from vcam_cli.image_formation.transfer_tables import (
    LARGEST_PLANE,
    PARITIES,
    Tables,
    TableSize,
    joined_parities,
    reader,
    split_by_parity,
)


def product_entries(blurs: Sequence[PlaneTransfer], rings: Sequence[Zone], size: TableSize) -> int:
    """Return the entries along an axis of tables of blurs times those of a field.

    The reach of a product is the sum of both.

    Parameters
    ----------
    blurs : sequence of PlaneTransfer
        Blurs that are the same all over the field.
    rings : sequence of Zone
        The blur that changes over it.
    size : TableSize
        Size of the tables.

    Returns
    -------
    int
        Entries from 0 to the end of the tables.
    """
    directed = of_kind([ring.blur for ring in rings], PlaneTransfer)
    of_field = size.plane_entries(directed) if directed else 0
    return min(2 * size.plane_entries(blurs) + of_field - 1, LARGEST_PLANE)


def times_blurs(
    tables: Tables, blurs: Sequence[PlaneTransfer], entries: int, wavelength: float
) -> Tables:
    """Return tables times the transfers of blurs.

    Parameters
    ----------
    tables : Tables
        Tables over |f| alone, times a wave of the direction where they have an order.
    blurs : sequence of PlaneTransfer
        These blurs, which are of geometry: the same at every wavelength.
    entries : int
        Entries along an axis of a table over fx and fy.
    wavelength : float
        Any wavelength [m].

    Returns
    -------
    Tables
        The same radial part, and what the blurs add to it over fx and fy.
    """
    f = np.linspace(0, tables.top, entries)
    own = np.zeros((len(PARITIES), *tables.shape, entries, entries))
    own[tables.radial_parity] = reader(tables, tables.radial_parity, f).values(f)
    factor = np.ones((2 * entries, entries), np.complex128)
    for blur in blurs:
        factor *= blur.smooth_otf_plane(f, np.concatenate([f, -f]), wavelength)
    plus, minus = joined_parities(own)
    parts = split_by_parity(plus * (factor[:entries] - 1), minus * (factor[entries:] - 1))
    planes = tuple(part if np.any(part) else None for part in parts)
    return replace(tables, planes=planes)
