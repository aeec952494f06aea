"""From the rate of electrons to a raw frame: charge, noise, saturation, codes.

Blocks of 64 rows flow through all of it, a few rows at a time, or several blocks of short rows
together, while they are in the cache. Every draw has its own stream per block, so the frame does
not depend on the number of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import Charge
from vcam_cli.effects.signal_chain import (
    ElectronEffect,
    NoiseSource,
    Quantizer,
    Site,
    electron_effects,
)
from vcam_cli.parallel import each, slices_within
from vcam_cli.records import dataclass
from vcam_cli.rng import (
    BLOCK_ROWS,
    KEPT_PIXELS,
    KeptNormals,
    Stream,
    runs_of_blocks,
    stream,
    streams,
)

AT_ONCE = 1 << 16
"""Pixels that flow together, about: a draw is made for them in the same order as for more."""
LAYER = 32
"""Bits of a block's number: those above are the layer's of stacked pixels."""


def mean_electrons(rate: Array, time: float, effects: tuple[Effect, ...]) -> Array:
    """Return the noise-free signal before saturation, photo-electrons and dark current.

    Parameters
    ----------
    rate : Array
        Photo-electrons per second, of any shape [e/s].
    time : float
        Exposure time [s].
    effects : tuple of Effect
        Effects of the camera; those of kind Charge are used.

    Returns
    -------
    Array
        Mean signal in the shape and float type of `rate` [electrons].
    """
    signal: Array = rate * rate.dtype.type(time) + rate.dtype.type(mean_dark(time, effects))
    return signal


def mean_dark(time: float, effects: tuple[Effect, ...]) -> float:
    """Return the mean dark signal of a pixel.

    Parameters
    ----------
    time : float
        Exposure time [s].
    effects : tuple of Effect
        Effects of the camera; those of kind Charge are used.

    Returns
    -------
    float
        Mean dark signal [electrons].
    """
    charges = of_kind(effects, Charge)
    return time * sum(charge.rate() for charge in charges)


def sites(
    rate: Array,
    dark: float,
    seeds: dict[str, int],
    layer: int,
    block: slice,
    sample: int = 0,
    coarse_normals: bool = False,
) -> dict[str, Site]:
    """Return the sites at which the noise of a block of rows, or of several, is drawn, by scope.

    Streams of random numbers that were opened go on.

    Parameters
    ----------
    rate : Array
        An array of the shape (rows, columns) and float type of the whole layer.
    dark : float
        Mean dark signal [electrons].
    seeds : dict
        Seeds of 'sensor' and 'frame'.
    layer : int
        Index of the layer of stacked pixels.
    block : slice
        Rows of the block, or of consecutive ones.
    sample : int, optional
        Index of the sample within one integration.
    coarse_normals : bool, optional
        Whether the normal numbers of pixels are `rng.coarse_normals`.

    Returns
    -------
    dict
        Site of each scope.
    """
    index = (layer << LAYER) + block.start // BLOCK_ROWS
    rows = block.stop - block.start
    sensor = _StreamCache(partial(streams, seeds["sensor"], block=index, rows=rows))
    is_kept = rate.size <= KEPT_PIXELS and not coarse_normals
    opened = {"sensor": KeptNormals if is_kept else streams, "frame": streams}
    return {
        scope: Site(
            rows=rows,
            columns=rate.shape[1],
            stream=_StreamCache(
                partial(opened[scope], seed, capture=sample, block=index, rows=rows)
            ),
            line_stream=partial(stream, seed, capture=sample, block=layer << LAYER),
            dtype=rate.dtype.type,
            dark=dark,
            first_row=block.start,
            array_rows=len(rate),
            sensor=sensor,
            coarse_normals=coarse_normals,
        )
        for scope, seed in seeds.items()
    }


def runs_of_rows(rate: Array) -> list[slice]:
    """Return the rows of an array (rows, columns) that flow together: whole blocks.

    Several blocks of short rows: a block costs some calls for each effect, which is 90 % of the
    time of two columns.
    """
    return runs_of_blocks(len(rate), AT_ONCE // rate.shape[1])


@dataclass(frozen=True)
class _StreamCache:
    """The streams of a block: each is opened once and then goes on."""

    make: Callable[[str], Stream]
    streams: dict[str, Stream] = field(default_factory=dict)

    def __call__(self, name: str) -> Stream:
        if name not in self.streams:
            self.streams[name] = self.make(name)
        return self.streams[name]


def codes_type(bits: int, count: int = 1) -> type[np.unsignedinteger]:
    """Return the smallest type of whole numbers that holds all codes of an ADC.

    Parameters
    ----------
    bits : int
        Resolution of the ADC.
    count : int, optional
        How many codes are added.

    Returns
    -------
    type
        `numpy.uint16` or `numpy.uint32`.
    """
    return np.uint16 if count * (2**bits - 1) < 1 << 16 else np.uint32


def capture(
    rate: Array,
    time: float,
    effects: tuple[Effect, ...],
    adc: Quantizer,
    seeds: dict[str, int],
    workers: int,
    layer: int = 0,
    coarse_normals: bool = False,
    full_charge: Array | None = None,
    pedestal: Array | None = None,
    settle: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Return one frame of an array whose rate of electrons is known.

    Parameters
    ----------
    rate : Array
        Rate (rows, columns), or (C, rows, columns) of stacked pixels, which are drawn one layer
        after the other [e/s].
    time : float
        Exposure time [s].
    effects : tuple of Effect
        Effects that run, in the order of action.
    adc : Quantizer
        The ADC.
    seeds : dict
        Seeds of 'sensor' and 'frame'.
    workers : int
        Number of threads; results do not depend on it.
    layer : int, optional
        Index of the layer of stacked pixels.
    coarse_normals : bool, optional
        Whether the normal numbers of pixels are `rng.coarse_normals`.
    full_charge : Array, optional
        Electrons, in the shape of `rate`, that full pixels are read with where that is less than
        the full well [electrons].
    pedestal : Array, optional
        What the ADC adds to each pixel beside its offset (rows, columns) [electrons].
    settle : callable, optional
        What sense nodes show of the charges of the whole array, whatever wells hold, in its shape
        [electrons].

    Returns
    -------
    electrons : Array
        Noisy signal in front of the ADC, clipped above at the full well, in the float type of
        `rate` [electrons]. Noise of the ADC is in the codes alone.
    dn : Array
        Codes as whole numbers, uint16, or uint32 from 17 bits on [DN].

    References
    ----------
    T. Chen, PhD thesis, Stanford University, 2003, eq 2.26.
    """
    if rate.ndim == 3:
        full = [None] * len(rate) if full_charge is None else full_charge
        layers = [
            capture(
                *(plane, time, effects, adc, seeds, workers, number, coarse_normals, most),
                settle=settle,
            )
            for number, (plane, most) in enumerate(zip(rate, full, strict=True))
        ]
        return np.array([e for e, _ in layers]), np.array([dn for _, dn in layers])
    dark = mean_dark(time, effects)
    electrons = np.empty_like(rate)
    dn = np.empty(rate.shape, codes_type(adc.bits))

    in_front = electron_effects(effects, behind_well=False)
    settled = (
        None
        if settle is None
        else settle(_charges(rate, time, effects, seeds, workers, layer, coarse_normals))
    )
    if settled is not None:
        in_front = tuple(effect for effect in in_front if not effect.in_charge)

    def shoot(block: slice) -> None:
        opened = sites(rate, dark, seeds, layer, block, coarse_normals=coarse_normals)
        for rows in slices_within(block, max(1, AT_ONCE // rate.shape[1])):
            here = _at_rows(opened, rows)
            if settled is None:
                tile = mean_charge(rate[rows], time, effects, here)
            else:
                tile = settled[rows]
            tile = in_wells(
                tile, in_front, here, None if full_charge is None else full_charge[rows]
            )
            electrons[rows] = tile
            dn[rows] = codes(tile, effects, adc, here, None if pedestal is None else pedestal[rows])

    each(shoot, runs_of_rows(rate), workers)
    return electrons, dn


def in_wells(
    mean: Array,
    effects: Sequence[ElectronEffect],
    here: Mapping[str, Site],
    full_charge: Array | None = None,
) -> Array:
    """Return the noisy signal that pixels hold, clipped above at the full well.

    Parameters
    ----------
    mean : Array
        Mean signal (..., rows, columns); it may be reused [electrons].
    effects : sequence of ElectronEffect
        Effects up to the well, in the order of action.
    here : mapping
        Site of each scope.
    full_charge : Array, optional
        As that of `capture` [electrons].

    Returns
    -------
    Array
        Signal in the shape of the mean [electrons].
    """
    for effect in effects:
        mean = effect.apply(mean, here[effect.scope])
    if full_charge is not None:
        np.minimum(mean, full_charge, out=mean)
    return mean


def codes(
    electrons: Array,
    effects: Iterable[Effect],
    adc: Quantizer,
    here: Mapping[str, Site],
    pedestal: Array | None = None,
) -> Array:
    """Return the codes of what pixels hold, with the noise behind the well.

    Parameters
    ----------
    electrons : Array
        Signal (..., rows, columns); it may be reused [electrons].
    effects : iterable of Effect
        Effects; those on electrons behind the well count.
    adc : Quantizer
        The ADC.
    here : mapping
        Site of each scope.
    pedestal : Array, optional
        As that of `capture` [electrons].

    Returns
    -------
    Array
        Whole codes in the shape and float type of the signal [DN].
    """
    for effect in electron_effects(effects, behind_well=True):
        electrons = effect.apply(electrons, here[effect.scope])
    return adc.apply(electrons if pedestal is None else electrons + pedestal)


def mean_charge(
    rate: Array, time: float, effects: tuple[Effect, ...], here: Mapping[str, Site]
) -> Array:
    """Return the mean signal whose shot noise is drawn.

    Parameters
    ----------
    rate : Array
        Photo-electrons per second (..., rows, columns) [e/s].
    time : float
        Exposure time [s].
    effects : tuple of Effect
        Effects that run, in the order of action.
    here : mapping
        Site of each scope.

    Returns
    -------
    Array
        Mean signal in the shape and float type of the rate [electrons].
    """
    return lifted(mean_electrons(rate, time, effects), effects, here)


def lifted(mean: Array, effects: tuple[Effect, ...], here: Mapping[str, Site]) -> Array:
    """Return mean signals with dark currents of pixels and defects in them.

    Parameters
    ----------
    mean : Array
        Mean signal (..., rows, columns); it may be reused [electrons].
    effects : tuple of Effect
        Effects that run, in the order of action.
    here : mapping
        Site of each scope.

    Returns
    -------
    Array
        Mean signal in the same shape [electrons].
    """
    for source in of_kind(effects, NoiseSource):
        mean = source.before_shot(mean, here[source.scope])
    return mean


def _at_rows(opened: Mapping[str, Site], rows: slice) -> dict[str, Site]:
    """Return the sites of a block for some of its rows."""
    place = {"rows": rows.stop - rows.start, "first_row": rows.start}
    return {scope: replace(site, **place) for scope, site in opened.items()}


def _charges(
    rate: Array,
    time: float,
    effects: tuple[Effect, ...],
    seeds: dict[str, int],
    workers: int,
    layer: int,
    coarse_normals: bool,
) -> Array:
    """Return the charges of all pixels with their noise, whatever wells hold [electrons]."""
    dark, out = mean_dark(time, effects), np.empty_like(rate)
    in_charge = [e for e in electron_effects(effects, behind_well=False) if e.in_charge]

    def collect(block: slice) -> None:
        opened = sites(rate, dark, seeds, layer, block, coarse_normals=coarse_normals)
        for rows in slices_within(block, max(1, AT_ONCE // rate.shape[1])):
            here = _at_rows(opened, rows)
            tile = mean_charge(rate[rows], time, effects, here)
            for effect in in_charge:
                tile = effect.apply(tile, here[effect.scope])
            out[rows] = tile

    each(collect, runs_of_rows(rate), workers)
    return out
