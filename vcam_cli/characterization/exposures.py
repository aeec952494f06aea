"""The frames that a measurement takes on the bench, and what is kept of them, color by color."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.characterization import closed_form
from vcam_cli.characterization.bench import Bench, edge_rate, prepare_edge_bench
from vcam_cli.characterization.kept_frames import Keeper, Kind, NoFrames
from vcam_cli.errors import bad
from vcam_cli.progress import Stages
from vcam_cli.quality import mtf, nonuniformity
from vcam_cli.quality.nonuniformity import Nonuniformity
from vcam_cli.quality.photon_transfer import (
    DarkSignal,
    Linearity,
    PhotonTransfer,
    Series,
    dark_signal,
    linearity,
    pair_statistics,
    photon_transfer,
)
from vcam_cli.records import dataclass

EVEN_LEVELS = 50
"""Levels evenly spaced up to saturation: the minimum of EMVA 1288."""
FAINT_LEVELS = 10
"""Levels below them, for the curve of the signal-to-noise ratio."""
SATURATION_LEVELS = 31
"""Levels around saturation, so that it is located to a fraction of a percent."""
PLATEAU = 4.0
"""Light, over saturation, at which more of it makes no difference."""
PAIRS = 4
"""Pairs of dark frames, averaged."""
STACK = 64
"""Frames of a stack for the nonuniformity."""
DARK_TIMES = 8
"""Exposure times of dark frames; the standard requires six."""
DARK_LEVEL = 0.2
"""Dark signal in the longest of them, over saturation."""
EDGES = 128
"""Frames of the slanted edge that are averaged."""
REACH = 100
"""Distance from the edge up to which its profile is measured [pixels]."""


@dataclass(frozen=True)
class DarkMeasurement:
    """The dark signal of one color, and its temporal variance at no exposure time [DN^2]."""

    signal: DarkSignal
    variance: float


@dataclass(frozen=True)
class EdgeMeasurement:
    """The response of a slanted edge, and the model's MTF at its frequencies."""

    measured: mtf.EdgeResponse
    expected: Array


@dataclass(frozen=True)
class Channel:
    """All that was measured of one color.

    Parameters
    ----------
    color : str
        Name of the color.
    transfer : PhotonTransfer
        The photon transfer curve and what follows from it.
    linearity : Linearity
        Deviations from the straight line.
    dark : DarkMeasurement
        The dark signal.
    plateau : float
        Mean signal where more light makes no difference [DN].
    dsnu, prnu : Nonuniformity
        Dark signal and photo response nonuniformity.
    edge : EdgeMeasurement
        The response of the slanted edge.
    """

    color: str
    transfer: PhotonTransfer
    linearity: Linearity
    dark: DarkMeasurement
    plateau: float
    dsnu: Nonuniformity
    prnu: Nonuniformity
    edge: EdgeMeasurement

    @property
    def full_well(self) -> float:
        """Electrons from no charge up to the plateau [e]."""
        return (self.plateau - self.dark.signal.offset) / self.transfer.gain

    @property
    def dark_current(self) -> float:
        """Dark current mu_I, section 7 of EMVA 1288 [e/s]."""
        return self.dark.signal.current / self.transfer.gain


def measure_channels(
    bench: Bench, stages: Stages, keeper: Keeper | None = None
) -> tuple[Channel, ...]:
    """Take all frames, and measure every color.

    Parameters
    ----------
    bench : Bench
        The camera in even light.
    stages : Stages
        Told of the progress.
    keeper : Keeper, optional
        Shown the flat and dark frames.

    Raises
    ------
    BadInput
        If the photon transfer is no line.
    """
    keeper = keeper or NoFrames()
    numbers = iter(range(1 << 30))  # of the frames: none is taken twice
    with stages("flats"):
        series = _flat_series(bench, numbers, stages, keeper)
        bright = bench.flat_frame(PLATEAU * bench.saturation, next(numbers))
        plateau = _frame_means(bench, bright)
    with stages("darks"):
        dark = _dark_measurements(bench, numbers, keeper)
    with stages("stacks"):
        unlit, lit = (
            _stacks(bench, level * bench.saturation, numbers, keeper) for level in (0.0, 0.5)
        )
    keeper.finish()
    with stages("edge"):
        edges = measure_edges(bench, numbers, stages)
    channels = []
    for color in bench.colors:
        transfer, straight = _transfer_and_linearity(series[color], color)
        no_light, half = (nonuniformity.spatial_variance(stack[color]) for stack in (unlit, lit))
        above = lit[color].mean - unlit[color].mean
        channels.append(
            Channel(
                color=color,
                transfer=transfer,
                linearity=straight,
                dark=dark[color],
                plateau=plateau[color],
                dsnu=nonuniformity.dsnu(no_light, transfer.gain),
                prnu=nonuniformity.prnu(half, no_light, above),
                edge=edges[color],
            )
        )
    return tuple(channels)


def _transfer_and_linearity(series: Series, color: str) -> tuple[PhotonTransfer, Linearity]:
    try:
        return photon_transfer(series), linearity(series)
    except ValueError as error:
        message = f"the frames of {color} give no photon transfer: {error}"
        raise bad(("adc",), message, "look at the ADC's full scale and bits") from None


def flat_levels(bench: Bench) -> Array:
    """Return the photo-electrons of the flat frames, rising [e]."""
    full = bench.saturation
    variance = full + bench.dark + bench.noise_floor + bench.pattern_variance(full + bench.dark)
    half = min(max(0.06, 4 * (math.sqrt(variance) / full)), 0.9)
    parts = (
        np.geomspace(1e-4, 0.5 / EVEN_LEVELS, FAINT_LEVELS),
        np.arange(1, EVEN_LEVELS + 1) / EVEN_LEVELS,
        np.linspace(1 - half, 1 + half / 2, SATURATION_LEVELS),
    )
    return full * np.unique(np.concatenate(parts))


def _flat_series(
    bench: Bench, numbers: Iterator[int], stages: Stages, keeper: Keeper
) -> dict[str, Series]:
    """Take pairs of flat frames at all levels, and of dark ones."""
    electrons = flat_levels(bench)
    dark = _pair_statistics(bench, 0.0, numbers, PAIRS, keeper)
    levels = []
    for done, level in enumerate(electrons):
        stages.watch.step(done, len(electrons))
        levels.append(_pair_statistics(bench, float(level), numbers, 1, keeper))
    return {
        color: Series(
            photons=electrons / bench.efficiency(color),
            mean=np.array([level[color][0] for level in levels]),
            variance=np.array([level[color][1] for level in levels]),
            dark_mean=dark[color][0],
            dark_variance=dark[color][1],
        )
        for color in bench.colors
    }


def _pair_statistics(
    bench: Bench,
    electrons: float,
    numbers: Iterator[int],
    count: int,
    keeper: Keeper,
    time: float | None = None,
) -> dict[str, tuple[float, float]]:
    """Return mean and temporal variance of every color, averaged over pairs of frames.

    All are kept, the first at the bench's exposure time as the pair of its level.
    """
    time = bench.time if time is None else time
    pairs: dict[str, list[tuple[float, float]]] = {color: [] for color in bench.colors}
    for done in range(count):
        frames = [bench.flat_frame(electrons, next(numbers), time) for _ in range(2)]
        kind: Kind = "pair" if time == bench.time and done == 0 else "dark"
        for frame in frames:
            keeper.add(bench, kind, electrons, time, frame)
        for color, statistics in pairs.items():
            first, second = (bench.color_pixels(frame, color) for frame in frames)
            statistics.append(pair_statistics(first, second))
    return {c: (float(np.mean(p, 0)[0]), float(np.mean(p, 0)[1])) for c, p in pairs.items()}


def _frame_means(bench: Bench, frame: Array) -> dict[str, float]:
    """Return the mean of one frame, of every color."""
    pixels = {color: bench.color_pixels(frame, color) for color in bench.colors}
    return {color: float(values.mean(dtype=np.float64)) for color, values in pixels.items()}


def _dark_measurements(
    bench: Bench, numbers: Iterator[int], keeper: Keeper
) -> dict[str, DarkMeasurement]:
    """Take dark frames from no time up to one in which the dark is a good part of saturation.

    Without dark current, up to the exposure time. The noise at no time is that of reset and
    readout alone.
    """
    longest = bench.time
    if bench.ready.dark_rate > 0:
        longest = DARK_LEVEL * bench.ready.chain.saturation / bench.ready.dark_rate
    times = np.linspace(0, longest, DARK_TIMES)
    means = []
    for time in map(float, times):
        frame = bench.flat_frame(0.0, next(numbers), time)
        keeper.add(bench, "dark", 0.0, time, frame)
        means.append(_frame_means(bench, frame))
    shortest = _pair_statistics(bench, 0.0, numbers, PAIRS, keeper, 0.0)
    return {
        color: DarkMeasurement(dark_signal(times, [m[color] for m in means]), shortest[color][1])
        for color in bench.colors
    }


def _stacks(
    bench: Bench, electrons: float, numbers: Iterator[int], keeper: Keeper
) -> dict[str, nonuniformity.Stack]:
    """Return the statistics of many frames at one level."""
    running = {color: nonuniformity.RunningStack() for color in bench.colors}
    for _ in range(STACK):
        frame = bench.flat_frame(electrons, next(numbers))
        keeper.add(bench, "stack", electrons, bench.time, frame)
        for color, stack in running.items():
            stack.add(bench.color_pixels(frame, color))
    return {color: stack.result() for color, stack in running.items()}


def measure_edges(
    bench: Bench, numbers: Iterator[int], stages: Stages
) -> dict[str, EdgeMeasurement]:
    """Measure the slanted edge in each color, averaged over many frames.

    Parameters
    ----------
    bench : Bench
        The camera in even light.
    numbers : iterator of int
        Numbers of the frames.
    stages : Stages
        Told of the progress.

    Returns
    -------
    dict
        Measurements by color.
    """
    edge = prepare_edge_bench(bench, stages)
    ready = edge.ready
    rate = edge_rate(edge)
    total = np.zeros(rate.shape)
    for done in range(EDGES):
        stages.watch.step(done, EDGES)
        total += edge.take_frame(rate, next(numbers), edge.time)
    pitch = min(ready.geometry.pitch_x, ready.geometry.pitch_y)
    measurements = {}
    for color in bench.colors:
        response = mtf.slanted_edge_sfr(edge.lattices(total, color), pitch, REACH * pitch)
        direction = math.cos(response.angle), math.sin(response.angle)
        index = ready.mosaic.colors.index(color)
        expected = closed_form.system_mtf(ready, index, response.frequency, direction)
        measurements[color] = EdgeMeasurement(response, expected)
    return measurements
