"""From the rate of electrons to a raw frame: charge, noise, saturation, codes.

Blocks of 64 rows flow through all of it, a few rows at a time, while they are in the cache. Every
draw has its own stream per block, so the frame does not depend on the number of workers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import Charge, Code, Draw, Effect, Limit, Site
from vcam_cli.engine.parallel import each, within
from vcam_cli.rng import BLOCK_ROWS, blocks, stream

AT_ONCE = 1 << 16
"""Pixels that flow together, about: a draw is made for them in the same order as for more."""
LAYER = 32
"""Bits of a block's number: those above are the layer's of stacked pixels."""


def mean_electrons(rate: NDArray, time: float, effects: tuple[Effect, ...]) -> NDArray:
    """Noise-free signal before saturation, photo + dark: same shape as `rate` [electrons]."""
    return rate * rate.dtype.type(time) + rate.dtype.type(mean_dark(time, effects))


def mean_dark(time: float, effects: tuple[Effect, ...]) -> float:
    """Mean dark signal of a pixel [electrons]."""
    return time * sum(e.rate() for e in effects if isinstance(e, Charge))


def sites(
    tile: NDArray, dark: float, seeds: dict[str, int], layer: int, block: slice, sample: int = 0
) -> dict[str, Site]:
    """Where draws happen in a block of rows, by their scope. Streams that were opened go on.

    tile: (rows, columns) of the block's shape and float type; dark: mean dark signal [electrons];
    sample: index of the sample within one integration.
    """
    index = (layer << LAYER) + block.start // BLOCK_ROWS
    return {
        scope: Site(
            rows=len(tile),
            columns=tile.shape[1],
            stream=_Opened(partial(stream, seed, capture=sample, block=index)),
            line_stream=partial(stream, seed, capture=sample, block=layer << LAYER),
            dtype=tile.dtype.type,
            dark=dark,
        )
        for scope, seed in seeds.items()
    }


@dataclass(frozen=True)
class _Opened:
    """The streams of a block: each is opened once and then goes on."""

    make: Callable[[str], np.random.Generator]
    known: dict[str, np.random.Generator] = field(default_factory=dict)

    def __call__(self, name: str) -> np.random.Generator:
        if name not in self.known:
            self.known[name] = self.make(name)
        return self.known[name]


def codes_type(bits: int, count: int = 1) -> type[np.unsignedinteger]:
    """The smallest whole numbers that hold all codes of an ADC, or sums of so many of them."""
    return np.uint16 if count * (2**bits - 1) < 1 << 16 else np.uint32


def capture(
    rate: NDArray,
    time: float,
    effects: tuple[Effect, ...],
    code: Code,
    seeds: dict[str, int],
    workers: int,
    done: Callable[[slice], None] | None = None,
    layer: int = 0,
) -> tuple[NDArray, NDArray]:
    """One frame: (electrons, dn).

    rate: (rows, columns) [e/s], or (C, rows, columns) of stacked pixels, which are drawn one layer
    after the other; effects: those that run, in the order of action; code: the ADC;
    seeds: of 'sensor' and 'frame'; done: called with every block of rows that is finished.
    electrons: same float type as `rate`, noisy, clipped above at the full well [electrons];
    dn: whole numbers, uint16, or uint32 from 17 bits on [DN].
    """
    if rate.ndim == 3:
        layers = [
            capture(plane, time, effects, code, seeds, workers, layer=number)
            for number, plane in enumerate(rate)
        ]
        return np.array([e for e, _ in layers]), np.array([dn for _, dn in layers])
    draws = [e for e in effects if isinstance(e, Draw)]
    dark = mean_dark(time, effects)
    electrons = np.empty_like(rate)
    dn = np.empty(rate.shape, codes_type(code.bits))

    def shoot(block: slice) -> None:
        opened = sites(rate[block], dark, seeds, layer, block)
        for rows in within(block, max(1, AT_ONCE // rate.shape[1])):
            tile = mean_electrons(rate[rows], time, effects)
            here = {scope: replace(site, rows=len(tile)) for scope, site in opened.items()}
            for draw in draws:
                tile = draw.before_shot(tile, here[draw.scope])
            for effect in effects:
                if isinstance(effect, Draw):
                    tile = effect.apply(tile, here[effect.scope])
                elif isinstance(effect, Limit):
                    tile = effect.apply(tile)
            electrons[rows] = tile
            dn[rows] = code.apply(tile)
        if done is not None:
            done(block)

    each(shoot, blocks(len(rate)), workers)
    return electrons, dn
