"""The frames that a measurement takes on the bench, and what is kept of them, color by color."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.stages import Stages
from vcam_cli.errors import bad
from vcam_cli.quality import mtf, nonuniformity
from vcam_cli.quality.nonuniformity import Nonuniformity
from vcam_cli.quality.photon_transfer import (
    DarkSignal,
    Linearity,
    PhotonTransfer,
    Series,
    dark_signal,
    linearity,
    pair,
    photon_transfer,
)
from vcam_cli.studies import closed_form
from vcam_cli.studies.bench import Bench, edge, edge_rate

EVEN = 50
"""Levels evenly spaced up to saturation: the least that EMVA 1288 asks for."""
FAINT = 10
"""Levels below them, for the curve of the signal-to-noise ratio."""
AROUND = 31
"""Levels around saturation, so that its place is found to a fraction of a percent."""
PLATEAU = 4.0
"""Times saturation: light that makes no difference any more."""
PAIRS = 4
"""Pairs of dark frames, averaged."""
STACK = 64
"""Frames of a stack for the nonuniformity."""
DARK_TIMES = 8
"""Exposure times of dark frames; the standard asks for six."""
DARK_LEVEL = 0.2
"""Of saturation, that the dark reaches in the longest of them."""
EDGES = 128
"""Frames of the slanted edge that are averaged."""
REACH = 100
"""Pixels from the edge out to which its profile is followed."""


@dataclass(frozen=True)
class Dark:
    """The dark of one color."""

    signal: DarkSignal
    variance: float
    """Temporal, at no exposure time [DN^2]."""


@dataclass(frozen=True)
class Edge:
    """A slanted edge, and the transfer that the description has at its frequencies."""

    measured: mtf.EdgeResponse
    expected: NDArray


@dataclass(frozen=True)
class Channel:
    """All that was measured of one color."""

    color: str
    transfer: PhotonTransfer
    linearity: Linearity
    dark: Dark
    plateau: float
    """Mean where light makes no difference any more [DN]."""
    dsnu: Nonuniformity
    prnu: Nonuniformity
    edge: Edge

    @property
    def full_well(self) -> float:
        """Electrons from no charge up to the plateau [e]."""
        return (self.plateau - self.dark.signal.offset) / self.transfer.gain

    @property
    def dark_current(self) -> float:
        """mu_I, section 7 of EMVA 1288 [e/s]."""
        return self.dark.signal.current / self.transfer.gain


def channels(on: Bench, stages: Stages) -> tuple[Channel, ...]:
    """Measures every color. Raises BadInput where the photon transfer is no line."""
    numbers = iter(range(1 << 30))  # of the frames: none is taken twice
    with stages("flats"):
        series = _flats(on, numbers, stages)
        plateau = _means(on, PLATEAU * on.saturation, numbers)
    with stages("darks"):
        dark = _darks(on, numbers)
    with stages("stacks"):
        unlit, lit = (_stacks(on, level * on.saturation, numbers) for level in (0.0, 0.5))
    with stages("edge"):
        sharp = edges(on, numbers, stages)
    found = []
    for color in on.colors:
        transfer, straight = _judged(series[color], color)
        no_light, half = (nonuniformity.spatial(stack[color]) for stack in (unlit, lit))
        above = lit[color].mean - unlit[color].mean
        found.append(
            Channel(
                color=color,
                transfer=transfer,
                linearity=straight,
                dark=dark[color],
                plateau=plateau[color],
                dsnu=nonuniformity.dsnu(no_light, transfer.gain),
                prnu=nonuniformity.prnu(half, no_light, above),
                edge=sharp[color],
            )
        )
    return tuple(found)


def _judged(series: Series, color: str) -> tuple[PhotonTransfer, Linearity]:
    try:
        return photon_transfer(series), linearity(series)
    except ValueError as error:
        message = f"the frames of {color} give no photon transfer: {error}"
        raise bad(("adc",), message, "look at the ADC's full scale and bits") from None


def levels(on: Bench) -> NDArray:
    """Photo-electrons of the flat frames, rising [e]."""
    full = on.saturation
    spread = math.sqrt(full + on.dark + on.floor + on.pattern(full + on.dark)) / full
    half = min(max(0.06, 4 * spread), 0.9)
    parts = (
        np.geomspace(1e-4, 0.5 / EVEN, FAINT),
        np.arange(1, EVEN + 1) / EVEN,
        np.linspace(1 - half, 1 + half / 2, AROUND),
    )
    return full * np.unique(np.concatenate(parts))


def _flats(on: Bench, numbers: Iterator[int], stages: Stages) -> dict[str, Series]:
    """Pairs of flat frames at all levels, and of dark ones."""
    at = levels(on)
    dark = _pairs(on, 0.0, numbers, PAIRS)
    told = []
    for done, electrons in enumerate(at):
        stages.watch.step(done, len(at))
        told.append(_pairs(on, float(electrons), numbers, 1))
    return {
        color: Series(
            photons=at / on.efficiency(color),
            mean=np.array([level[color][0] for level in told]),
            variance=np.array([level[color][1] for level in told]),
            dark_mean=dark[color][0],
            dark_variance=dark[color][1],
        )
        for color in on.colors
    }


def _pairs(
    on: Bench, electrons: float, numbers: Iterator[int], count: int, time: float | None = None
) -> dict[str, tuple[float, float]]:
    """Mean and temporal variance of every color, averaged over pairs of frames."""
    found: dict[str, list[tuple[float, float]]] = {color: [] for color in on.colors}
    for _ in range(count):
        first, second = (on.flat(electrons, next(numbers), time) for _ in range(2))
        for color, pairs in found.items():
            pairs.append(pair(on.sites(first, color), on.sites(second, color)))
    return {c: (float(np.mean(p, 0)[0]), float(np.mean(p, 0)[1])) for c, p in found.items()}


def _means(
    on: Bench, electrons: float, numbers: Iterator[int], time: float | None = None
) -> dict[str, float]:
    """Mean of one frame, every color."""
    frame = on.flat(electrons, next(numbers), time)
    return {color: float(on.sites(frame, color).mean(dtype=np.float64)) for color in on.colors}


def _darks(on: Bench, numbers: Iterator[int]) -> dict[str, Dark]:
    """Dark frames from no time up to one in which the dark is a good part of saturation.

    Without dark current, up to the exposure time. The noise of no time is that of reset and
    readout alone.
    """
    longest = on.time
    if on.ready.dark_rate > 0:
        longest = DARK_LEVEL * on.ready.electrical.saturation / on.ready.dark_rate
    times = np.linspace(0, longest, DARK_TIMES)
    means = [_means(on, 0.0, numbers, float(time)) for time in times]
    shortest = _pairs(on, 0.0, numbers, PAIRS, 0.0)
    return {
        color: Dark(dark_signal(times, [m[color] for m in means]), shortest[color][1])
        for color in on.colors
    }


def _stacks(on: Bench, electrons: float, numbers: Iterator[int]) -> dict[str, nonuniformity.Stack]:
    """Statistics of many frames at one level."""
    running = {color: nonuniformity.Running() for color in on.colors}
    for _ in range(STACK):
        frame = on.flat(electrons, next(numbers))
        for color, stack in running.items():
            stack.add(on.sites(frame, color))
    return {color: stack.result() for color, stack in running.items()}


def edges(on: Bench, numbers: Iterator[int], stages: Stages) -> dict[str, Edge]:
    """The slanted edge as each color sees it, averaged over many frames."""
    before = edge(on, stages)
    ready = before.ready
    rate = edge_rate(before)
    total = np.zeros(rate.shape)
    for done in range(EDGES):
        stages.watch.step(done, EDGES)
        total += before.take(rate, next(numbers), before.time)
    pitch = min(ready.geometry.pitch_x, ready.geometry.pitch_y)
    found = {}
    for color in on.colors:
        seen = mtf.slanted_edge(before.lattices(total, color), pitch, REACH * pitch)
        direction = math.cos(seen.angle), math.sin(seen.angle)
        index = ready.mosaic.colors.index(color)
        expected = closed_form.system_mtf(ready, index, seen.frequency, direction)
        found[color] = Edge(seen, expected)
    return found
