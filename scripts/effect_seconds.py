"""Measure the seconds that effects on electrons take of a pixel: `Effect.pixel_seconds`.

    python scripts/effect_seconds.py [CAMERA...]

Each effect of a camera acts on one block of its rows, as it does in a frame, on one thread. The
least time of many turns counts, in seconds of the machine on which a normal number takes
`cost_model.NORMAL`. Without a camera: `everything` and `starter`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

from vcam_cli import load
from vcam_cli.accuracy_study import ablation
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import ElectronEffect, NoiseSource, Quantizer
from vcam_cli.readout.exposure import sites
from vcam_cli.simulation.cost_model import NORMAL
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare

TURNS = 60
SHAPE = (64, 800)
"""Rows and columns of the block: as many pixels as a frame of 800 columns computes at once."""
SET = (f"array.rows={SHAPE[0]}", f"array.columns={SHAPE[1]}", "quality=[]")


def measured(ready: Prepared) -> Iterator[tuple[Effect, float]]:
    """Yield each effect on electrons, and its seconds per pixel."""
    seeds = {"sensor": 1, "frame": 2}
    dark = ready.dark_rate * ready.exposure_time
    mean = (ready.rate * ready.exposure_time).astype(ready.rate.dtype)
    chosen = of_kind(ready.plan.active, ElectronEffect, Quantizer)
    acts = [work(effect) for effect in chosen]
    least = np.full(len(chosen) + 1, np.inf)
    generator = np.random.Generator(np.random.Philox(0))
    for _ in range(TURNS):
        here = sites(mean, dark, seeds, 0, slice(0, SHAPE[0]))
        for number, (effect, act) in enumerate(zip(chosen, acts, strict=True)):
            tile = mean.copy()
            start = time.thread_time()
            act(tile, here[getattr(effect, "scope", "frame")])
            least[number] = min(least[number], time.thread_time() - start)
        start = time.thread_time()
        generator.standard_normal(mean.shape, dtype=np.float32)
        least[-1] = min(least[-1], time.thread_time() - start)
    for effect, seconds in zip(chosen, least[:-1], strict=True):
        yield effect, float(seconds / least[-1]) * NORMAL


def work(effect: Effect) -> Callable:
    """Return what an effect does to a block at a site."""
    if isinstance(effect, Quantizer):
        return lambda tile, site: effect.apply(tile)
    if isinstance(effect, NoiseSource):
        return lambda tile, site: effect.apply(effect.before_shot(tile, site), site)
    assert isinstance(effect, ElectronEffect)
    return effect.apply


def main() -> None:
    """Print the seconds of every effect on electrons beside those that the plan foretells."""
    print(f"{'camera':<14} {'effect':<22} {'measured':>8} {'foretold':>8}  ns a pixel")
    for name in sys.argv[1:] or ("everything", "starter"):
        ready = prepare(ablation.with_effects(load(name, SET), "all"), 1)[0]
        for effect, seconds in measured(ready):
            foretold = effect.pixel_seconds
            print(f"{name:<14} {effect.name:<22} {1e9 * seconds:8.2f} {1e9 * foretold:8.2f}")


if __name__ == "__main__":
    main()
