"""From the rate of electrons to a raw frame: charge, noise, saturation, codes.

Blocks of 64 rows flow through all of it while they are in the cache. Every draw has its own
stream per block, so the frame does not depend on the number of workers.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import Charge, Code, Draw, Effect, Limit, Site
from vcam_cli.engine.parallel import each
from vcam_cli.rng import BLOCK_ROWS, blocks, stream


def mean_electrons(rate: NDArray, time: float, effects: tuple[Effect, ...]) -> NDArray:
    """Noise-free signal before saturation, photo + dark: same shape as `rate` [electrons]."""
    dark = sum(e.rate() for e in effects if isinstance(e, Charge))
    return rate * rate.dtype.type(time) + rate.dtype.type(dark * time)


def capture(
    rate: NDArray,
    time: float,
    effects: tuple[Effect, ...],
    code: Code,
    seeds: dict[str, int],
    workers: int,
    done: Callable[[slice], None] | None = None,
) -> tuple[NDArray, NDArray]:
    """One frame: (electrons, dn).

    rate: (rows, columns) [e/s]; effects: those that run, in the order of action; code: the ADC;
    seeds: of 'sensor' and 'frame'; done: called with every block of rows that is finished.
    electrons: same float type as `rate`, noisy, clipped above at the full well [electrons];
    dn: whole numbers, uint16, or uint32 from 17 bits on [DN].
    """
    rows, columns = rate.shape
    electrons = np.empty_like(rate)
    dn = np.empty(rate.shape, np.uint16 if code.bits <= 16 else np.uint32)

    def shoot(block: slice) -> None:
        tile = mean_electrons(rate[block], time, effects)
        index = block.start // BLOCK_ROWS
        for effect in effects:
            if isinstance(effect, Draw):
                seed = seeds[effect.scope]
                site = Site(
                    rows=len(tile),
                    columns=columns,
                    stream=partial(stream, seed, block=index),
                    line_stream=partial(stream, seed),
                    dtype=rate.dtype.type,
                )
                tile = effect.apply(tile, site)
            elif isinstance(effect, Limit):
                tile = effect.apply(tile)
        electrons[block] = tile
        dn[block] = code.apply(tile)
        if done is not None:
            done(block)

    each(shoot, blocks(rows), workers)
    return electrons, dn
