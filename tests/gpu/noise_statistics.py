"""Statistics of noise that a device draws, against closed forms, in standard errors."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import stats

from vcam_cli import load
from vcam_cli.batches.batch_camera import BatchCamera
from vcam_cli.batches.frames import solved_for
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.readout.batched_sites import SensorMaps, sites

Row = tuple[str, float]
"""What, and how many standard errors it is off."""
CAMERAS = ("starter", "everything", "imx477", "low-light", "street")


def moments(name: str, values: np.ndarray, law: Any) -> Iterator[Row]:
    """Compare mean, variance, skewness and kurtosis with those of a law of scipy.stats."""
    mean, variance, skew, kurtosis = (float(v) for v in law.stats(moments="mvsk"))
    count = values.size
    z = (values.astype(float).ravel() - mean) / np.sqrt(variance)
    yield f"{name} mean", z.mean() * np.sqrt(count)
    for order, expected in ((2, 1.0), (3, skew), (4, kurtosis + 3)):
        power = z**order
        yield f"{name} moment {order}", (power.mean() - expected) * np.sqrt(count) / power.std()


def correlations(name: str, values: np.ndarray) -> Iterator[Row]:
    """Judge the correlation of neighbors along each axis (B, rows, columns), and farther ones."""
    z = values.astype(float) - values.mean()
    z /= z.std()
    for axis in range(z.ndim):
        for apart in (1, 2, 4):
            if z.shape[axis] <= apart:
                continue
            some = np.moveaxis(z, axis, 0)
            products = some[apart:] * some[:-apart]
            yield (
                f"{name} correlation, axis {axis}, {apart} apart",
                products.mean() * np.sqrt(products.size),
            )


def generator(device: Processor, frames: int, side: int) -> Iterator[Row]:
    """Judge normal numbers, uniform numbers and Poisson numbers."""
    keys = device.keys([1, 2, 2**62 + 7, *range(100, 97 + frames)])
    shape = (frames, side, side)
    normal = device.get(device.normals(keys, "normal", 0, side * side, np.float32))
    normal = normal.reshape(shape)
    yield from moments("normal", normal, stats.norm())
    yield from correlations("normal", normal)
    other = device.get(device.normals(keys, "another", 0, side * side, np.float32)).reshape(shape)
    later = device.get(device.normals(keys, "normal", 1, side * side, np.float32)).reshape(shape)
    for name, found in (("streams", other), ("samples", later)):
        products = normal.astype(float) * found
        yield f"correlation of {name}", products.mean() * np.sqrt(products.size)
    uniform = device.get(device.uniforms(keys, "even", 0, side * side)).reshape(shape)
    yield from moments("uniform", uniform, stats.uniform())
    for mean in (0.01, 0.3, 3.3, 7.9, 8.1, 40.0, 1e4):
        means = device.put(np.full(shape, mean, np.float32))
        drawn = device.get(device.poisson(keys, "shot", 0, means))
        # The expansion's third moment is not that of the law: from 8 on its variance counts.
        judged = list(moments(f"Poisson {mean:g}", drawn, stats.poisson(float(np.float32(mean)))))
        yield from judged[: 4 if mean < 8 else 2]
        yield from correlations(f"Poisson {mean:g}", drawn)


def sources(device: Processor, frames: int, side: int) -> Iterator[Row]:
    """Judge every noise source of some cameras that is new in each frame: mean and variance."""
    seen = set()
    for name in CAMERAS:
        sets = [f"array.rows={side}", f"array.columns={side}", "exposure.time=10 ms"]
        solved = solved_for(load(name, sets))
        taker = BatchCamera(solved, device, np.float32)
        listed: list[NoiseSource] = []
        for effect in solved.effects.enabled:
            if isinstance(effect, NoiseSource) and effect.scope == "frame":
                parts = effect.split() if hasattr(effect, "column") else (effect,)
                listed += [part for part in parts if part is not None]
        for number, effect in enumerate(listed):
            if repr(effect) in seen:
                continue
            seen.add(repr(effect))
            yield from _source(taker, effect, frames, f"{name} {effect.name} {number}")


def _source(taker: BatchCamera, effect: NoiseSource, frames: int, name: str) -> Iterator[Row]:
    maps: SensorMaps = taker.maps
    device, mean = taker.device, 500.0
    here = sites(maps, range(frames), 0.0)["frame"]
    shape = (frames, maps.rows, maps.columns)
    start = device.put(np.full(shape, mean, np.float32))
    noise = device.get(effect.apply(start, here)).astype(float) - mean
    # Draws that columns or rows share count once.
    alone = noise
    for axis in (1, 2):
        if float(np.ptp(noise, axis=axis).max()) < 1e-3:
            alone = alone.mean(axis=axis, keepdims=True)
    expected = effect.variance(mean, 0.0)
    count = alone.size
    correlation = getattr(effect, "correlation", 0.0)
    spread = (1 + correlation) / (1 - correlation)
    yield f"{name}: mean", alone.mean() * np.sqrt(count / (expected * spread))
    square = alone**2
    spread = (1 + correlation**2) / (1 - correlation**2)
    error = square.std() * np.sqrt(spread / count)
    if hasattr(effect, "fraction"):  # which pixels have a trap stays: they are what is random
        own = square.mean(axis=0)
        error = own.std() / np.sqrt(own.size)
    yield f"{name}: variance", (square.mean() - expected) / error


def worst(rows: Iterator[Row]) -> tuple[list[Row], list[Row]]:
    """Return all rows, and those beyond five standard errors."""
    found = [(what, float(off)) for what, off in rows]
    return found, [row for row in found if not abs(row[1]) < 5]
