"""Plots of a fit: photon transfer, dark signal, and confidence intervals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from vcam_cli.files.plots import (
    COLORS,
    DASHES,
    INK,
    MARKERS,
    SMALL,
    channel_series,
    color_of,
    plot_figure,
)
from vcam_cli.fitting.parameters import Parameter
from vcam_cli.fitting.result import Fit
from vcam_cli.quality.photon_transfer import GAIN_RANGE

MOST = 999.0
"""Relative half of an interval that is shown at most [%]."""


def plots(found: Fit) -> dict[str, Callable[[Path], None]]:
    """Return name of a file -> function that draws it, of all that the frames tell."""
    out: dict[str, Callable[[Path], None]] = {
        "photon_transfer.png": partial(draw_photon_transfer, found=found),
        "intervals.png": partial(draw_intervals, found=found),
    }
    if found.line is not None and found.line.current is not None:
        out["dark_signal.png"] = partial(draw_dark_signal, found=found)
    return out


def draw_photon_transfer(path: Path, found: Fit) -> None:
    """Draw temporal variance over signal for every color and light, and the line of the gain."""
    with plot_figure(path, (5.4, 3.6)) as figure:
        axes = figure.subplots()
        channels = channel_series([curve.color for curve in found.curves])
        for number, curve in enumerate(found.curves):
            series = curve.result.series
            color = color_of(channels[number])
            variance = series.variance - series.dark_variance
            name = f"{curve.color}, {curve.light}"
            marker = MARKERS[number % len(MARKERS)]
            axes.plot(series.signal, variance, marker, color=color, markersize=4, label=name)
            reach = GAIN_RANGE * series.signal[series.saturation_index]
            positive = series.signal[series.signal > 0]
            ends = np.array([positive.min(), reach])
            axes.plot(ends, curve.gain.value * ends, color=color, linewidth=1,
                      ls=DASHES[number % len(DASHES)])  # fmt: skip
        axes.set(xscale="log", yscale="log")
        axes.set_xlabel("mean signal above dark [DN]")
        axes.set_ylabel("temporal variance above dark [DN²]")
        axes.legend(fontsize=SMALL)
        axes.set_title("Photon transfer; lines: fitted gain, over the fitted range")


def draw_dark_signal(path: Path, found: Fit) -> None:
    """Draw what the means of dark frames are off their line, with their errors."""
    assert found.line is not None and found.line.current is not None
    times = np.array([stack.entry.exposure for stack in found.dark])
    means = [stack.every("mean") for stack in found.dark]
    values = np.array([each.value for each in means])
    with plot_figure(path, (5.4, 4.4)) as figure:
        upper, lower = figure.subplots(2, sharex=True, height_ratios=(2, 1))
        reach = np.array([0.0, float(times.max())])
        slope, level = found.line.current.value, found.line.black.value
        upper.plot(1e3 * reach, level + slope * reach, color=COLORS[1], linewidth=1)
        upper.plot(1e3 * times, values, MARKERS[0], color=COLORS[0], markersize=4)
        upper.set_ylabel("mean of dark frames [DN]")
        upper.set_title("Dark signal over exposure time")
        errors = [each.error for each in means]
        lower.errorbar(
            1e3 * times, values - level - slope * times, errors,
            fmt=MARKERS[0], color=COLORS[0], markersize=4, linewidth=1,
        )  # fmt: skip
        lower.axhline(0, color=COLORS[1], linewidth=1)
        lower.set_xlabel("exposure time [ms]")
        lower.set_ylabel("nonlinearity residual [DN]")


def draw_intervals(path: Path, found: Fit) -> None:
    """Draw the 90 % interval of every parameter, relative to its value."""
    known = [p for p in found.parameters if p.value > 0 and p.high > p.low]
    with plot_figure(path, (5.4, 0.8 + 0.2 * len(known))) as figure:
        axes = figure.subplots()
        for place, p in enumerate(known):
            ends = np.clip([100 * (end / p.value - 1) for end in (p.low, p.high)], -MOST, MOST)
            axes.plot(ends, (place, place), color=COLORS[0], linewidth=2.5)
        axes.axvline(0, color=INK, linewidth=0.7)
        axes.set_yticks(range(len(known)), [f"{p.name}  {p.value:.4g} {_unit(p)}" for p in known])
        axes.set_ylim(len(known) - 0.5, -0.5)
        axes.set_xscale("symlog", linthresh=1.0)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("deviation from the value [%]")
        axes.set_title("90 % confidence intervals")


def _unit(known: Parameter) -> str:
    return "" if known.unit == "1" else known.unit
