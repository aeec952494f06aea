"""A frame whose pixels are read several times: with two gains, or two photodiodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.signal_chain import ElectronEffect, NoiseSource, Site, electron_effects
from vcam_cli.parallel import each, slices_within
from vcam_cli.readout.chain import Branch, ReadoutChain
from vcam_cli.readout.exposure import (
    AT_ONCE,
    codes_type,
    mean_dark,
    mean_electrons,
    runs_of_rows,
    sites,
)
from vcam_cli.records import dataclass

Sites = dict[str, Site]


@dataclass(frozen=True)
class SeveralReadouts:
    """Codes of one exposure."""

    electrons: Array
    """Merged signal (rows, columns), in electrons of the large photodiode."""
    dn: Array
    """Merged codes (rows, columns) [DN]."""
    readouts: dict[str, Array]
    """Codes of every readout by its name (rows, columns) [DN]."""


def capture(
    rate: Array,
    time: float,
    chain: ReadoutChain,
    seeds: dict[str, int],
    workers: int,
    coarse_normals: bool = False,
) -> SeveralReadouts:
    """Return one frame of pixels that are read several times.

    Gains of one photodiode read one charge: shot noise, reset and pattern are the same in them,
    what is new in every readout is not. The small photodiode has draws of its own throughout.

    Parameters
    ----------
    rate : Array
        Rate of the large photodiode (rows, columns) [e/s].
    time : float
        Exposure time [s].
    chain : ReadoutChain
        The readouts, and how they are merged.
    seeds : dict
        Seeds of 'sensor' and 'frame'.
    workers : int
        Number of threads; results do not depend on it.
    coarse_normals : bool, optional
        Whether the normal numbers of pixels are `rng.coarse_normals`.
    """
    merge, whole = chain.merge, chain.whole
    assert merge is not None
    electrons = np.empty_like(rate)
    dn = np.empty(rate.shape, codes_type(whole.adc.bits))
    codes = {b.name: np.empty(rate.shape, codes_type(b.adc.bits)) for b in chain.branches}

    def shoot(block: slice) -> None:
        opened = {
            b.name: _sites(chain, b, rate, time, seeds, block, coarse_normals)
            for b in chain.branches
        }
        for rows in slices_within(block, max(1, AT_ONCE // rate.shape[1])):
            tiles = {}
            for branch in chain.branches:
                lit = rate[rows] * rate.dtype.type(branch.sensitivity)
                place = {"rows": len(lit), "first_row": rows.start}
                own, common = (
                    {scope: replace(site, **place) for scope, site in drawn.items()}
                    for drawn in opened[branch.name]
                )
                mean = mean_electrons(lit, time, branch.effects)
                tiles[branch.name] = _read(branch, mean, own, common)
                codes[branch.name][rows] = tiles[branch.name]
            merged = merge.electrons([tiles[name] for name in merge.names], time)
            dn[rows] = whole.adc.apply(merged)
            electrons[rows] = np.minimum(merged, rate.dtype.type(whole.circuit.full_well))

    each(shoot, runs_of_rows(rate), workers)
    return SeveralReadouts(electrons, dn, codes)


def _sites(
    chain: ReadoutChain,
    branch: Branch,
    rate: Array,
    time: float,
    seeds: dict[str, int],
    block: slice,
    coarse_normals: bool,
) -> tuple[Sites, Sites]:
    """Return where a readout's own noise is drawn, and what readouts of one charge share."""
    dark = mean_dark(time, branch.effects)
    own, common = (
        sites(rate, dark, seeds, branch.photodiode, block, sample, coarse_normals)
        for sample in (chain.branches.index(branch), 0)
    )
    return own, common


def _read(branch: Branch, tile: Array, own: Sites, common: Sites) -> Array:
    """Return the codes of one readout of a mean charge, in its float type [DN]."""

    def site(effect: ElectronEffect) -> Site:
        return (own if effect.sample_draws == "independent" else common)[effect.scope]

    for source in of_kind(branch.effects, NoiseSource):
        tile = source.before_shot(tile, site(source))
    for behind in (False, True):
        for effect in electron_effects(branch.effects, behind):
            tile = effect.apply(tile, site(effect))
    return branch.adc.apply(tile)
