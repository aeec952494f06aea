"""Readout of pixels that are read as one: where each effect acts, and the noise after it.

`binning.py` says which pixels these are and what of theirs is joined.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect
from vcam_cli.readout.binning import BinningGroups
from vcam_cli.readout.exposure import codes_type

Take = Callable[..., tuple[Array, Array]]
"""A frame of a rate [e/s] in a time [s] with effects: (electrons, dn)."""


def read(
    binning_groups: BinningGroups,
    rate: Array,
    time: float,
    effects: Sequence[Effect],
    take: Take,
    bits: int,
    full_charge: Array | None = None,
    settle: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Return one frame of binned pixels.

    Voltages are held by the pixels, joined, and read: two frames, one after the other.

    Parameters
    ----------
    binning_groups : BinningGroups
        Groups of pixels that are read as one.
    rate : Array
        Rate of every pixel, or of every node where charges are joined [e/s].
    time : float
        Exposure time [s].
    effects : sequence of Effect
        Effects in the order of action.
    take : Take
        What makes a frame of a rate, a time and effects.
    bits : int
        Resolution of the ADC.
    full_charge : Array, optional
        As that of `exposure.capture`, in the shape of `rate` [electrons].
    settle : callable, optional
        As that of `exposure.capture`: it acts in the pixels.

    Returns
    -------
    electrons : Array
        Signal of the raw frame [electrons].
    dn : Array
        Codes of the raw frame [DN].

    References
    ----------
    Z. Zhou, B. Pain, E. Fossum, "Frame-transfer CMOS active pixel sensor with pixel binning", IEEE
    Trans. Electron Devices 44(10), 1997.
    """
    kind, effects = binning_groups.binning.kind, tuple(effects)
    in_array = {"full_charge": full_charge, "settle": settle}
    take_pixels = partial(take, **{n: given for n, given in in_array.items() if given is not None})
    if kind == "charge":
        return take_pixels(rate, time, effects)
    if kind == "digital":
        electrons, dn = take_pixels(rate, time, effects)
        return binning_groups.join(electrons), binning_groups.sums(
            dn, codes_type(bits, binning_groups.count)
        )
    in_pixels = tuple(part for effect in effects for part in effect.parts_in_pixels())
    electrons, _ = take_pixels(rate, time, in_pixels)
    return take(binning_groups.join(electrons), 1.0, effects_in_readout(effects))


def effects_in_readout(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects that act on joined voltages.

    Parameters
    ----------
    effects : sequence of Effect
        Effects in the order of action.

    Returns
    -------
    tuple of Effect
        The readout's noise, the noise of columns and rows, and clamps, in the same order.
    """
    return tuple(part for effect in effects for part in effect.parts_in_readout())
