"""Drawings of a run's report: noise, spectra, sharpness and codes, from what the frame knows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.signal_chain import noise_sources
from vcam_cli.files.plots import (
    COLORS,
    DASHES,
    GRAY,
    LIMIT,
    MARK,
    SMALL,
    add_scale,
    channel_series,
    color_of,
)
from vcam_cli.simulation.frame import Frame
from vcam_cli.spectra import Spectrum, photons

LEVELS = 200
"""Signals at which the noise is shown."""
FREQUENCIES = 161
BINS = 256
"""Bins of the histogram at most."""


def channel_style(frame: Frame) -> list[dict[str, Any]]:
    """Return color, dashes and label of each color's curves.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    list of dict
        Keyword arguments of matplotlib, one dict a color.
    """
    names = frame.mosaic.colors
    return [
        {
            "color": color_of(series),
            "ls": DASHES[series % len(DASHES)],
            "label": "all pixels" if name == "Y" else name,
        }
        for name, series in zip(names, channel_series(names), strict=True)
    ]


def noise_parts(frame: Frame) -> tuple[Array, dict[str, Array]]:
    """Return the variance that each noise source adds to a pixel, by signal.

    Sources are those that the plan has on, and the rounding of the ADC. Variances of pixels that
    are read as one are of their mean.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    tuple
        Signals (n,) [electrons], and variances (n,) by source [electrons squared].
    """
    binning, dark = frame.layout.binning_groups.binning, frame.dark_rate * frame.exposure_time
    signal = np.geomspace(1, max(frame.electrical.full_well, 10), LEVELS)
    parts: dict[str, Array] = {}
    for scope in ("frame", "sensor"):
        for source in noise_sources(frame.plan.active, scope):
            each = [source.binned_variance(level + dark, dark, binning) for level in signal]
            parts[source.name] = np.array(each)
    rounding = [frame.chain.noise(level + dark, dark).rounding for level in signal]
    return signal, parts | {"quantization": np.array(rounding)}


def draw_noise_budget(figure: Any, frame: Frame, names: Sequence[str]) -> None:
    """Draw the share of each noise source in the variance over the signal, stacked.

    Parameters
    ----------
    figure : Any
        Figure of matplotlib to draw on.
    frame : Frame
        Frame that was taken.
    names : sequence of str
        Labels of the sources, in the order of `noise_parts`.
    """
    signal, parts = noise_parts(frame)
    axes = figure.add_subplot()
    total = np.maximum(sum(parts.values()), 1e-300)
    shares = [100 * part / total for part in parts.values()]
    hatches = ("", "//", "..", "\\\\", "xx", "--", "++")
    areas = axes.stackplot(signal, shares, labels=names, alpha=0.75)
    for i, area in enumerate(areas):
        area.set(facecolor=COLORS[i % len(COLORS)], hatch=hatches[i % len(hatches)])
        area.set(edgecolor="white", linewidth=0)
    axes.set(xscale="log", xlim=(1, signal[-1]), ylim=(0, 100))
    axes.set(xlabel="signal of a pixel [e]", ylabel="share of the variance [%]")
    mark_scene(axes, frame)
    figure.legend(loc="outside upper left", ncols=3, fontsize=SMALL)


def draw_snr(figure: Any, frame: Frame) -> None:
    """Draw the SNR with temporal noise and with all noise, beside the shot-noise limit.

    Parameters
    ----------
    figure : Any
        Figure of matplotlib to draw on.
    frame : Frame
        Frame that was taken.
    """
    signal, parts = noise_parts(frame)
    temporal = [s.name for s in noise_sources(frame.plan.active, "frame")]
    of_time = sum(parts[name] for name in [*temporal, "quantization"])
    axes = figure.add_subplot()
    curves = (
        ("shot-noise limit", signal, GRAY, LIMIT),
        ("temporal noise", of_time, COLORS[0], "-"),
        ("with fixed pattern", sum(parts.values()), COLORS[1], DASHES[1]),
    )
    for label, variance, color, dashes in curves:
        snr = 20 * np.log10(signal / np.sqrt(np.maximum(variance, 1e-300)))
        axes.plot(signal, snr, label=label, color=color, ls=dashes, lw=1.3)
    axes.set(xscale="log", xlim=(1, signal[-1]))
    axes.set(xlabel="signal of a pixel [e]", ylabel="SNR [dB]")
    mark_scene(axes, frame)
    axes.legend(fontsize=SMALL, loc="upper left")


def mark_scene(axes: Any, frame: Frame) -> None:
    """Mark the range of the scene's own signals.

    Parameters
    ----------
    axes : Any
        Axes of matplotlib, with the signal along x.
    frame : Frame
        Frame that was taken.
    """
    dark = frame.dark_rate * frame.exposure_time
    levels = [level - dark for level in frame.plan.levels if level - dark > 1]
    if levels:
        axes.axvspan(min(levels), max(levels), ymax=0.03, color=GRAY, label="this scene")


def draw_spectra(figure: Any, frame: Frame) -> None:
    """Draw the light of white, the quantum efficiency with lens and filters, and the signal.

    Parameters
    ----------
    figure : Any
        Figure of matplotlib to draw on.
    frame : Frame
        Frame that was taken.
    """
    band = frame.solved.scene.wavelengths
    wavelengths = np.linspace(band.start, band.stop, 401)
    light, responses = photons(frame.scene.white), frame.solved.response.spectra
    above, middle, below = figure.subplots(3, sharex=True)
    _draw_spectrum(above, light, wavelengths, {"color": GRAY})
    above.set(ylabel="white [photons]", yticklabels=())
    white = frame.white_rate * frame.exposure_time
    for response, electrons, style in zip(responses, white, channel_style(frame), strict=True):
        middle.plot(wavelengths * 1e9, 100 * response.evaluate(wavelengths), lw=1.3, **style)
        seen = light.multiply(response)
        whole = _integral(seen, wavelengths)
        unit = electrons / whole / (1 if seen.lines else 1e9) if whole else 0.0
        _draw_spectrum(below, seen.scale_by(unit), wavelengths, style)
    middle.set_ylabel("QE [%]")
    below.set_ylabel("white [e]" if light.lines else "white [e/nm]")
    below.set_xlabel("wavelength [nm]")
    for axes in (above, middle, below):
        axes.set_ylim(bottom=0)
    if len(responses) > 1:
        middle.legend(fontsize=SMALL, ncols=len(responses), loc="upper right")


def _draw_spectrum(
    axes: Any, spectrum: Spectrum, wavelengths: Array, style: dict[str, Any]
) -> None:
    if spectrum.lines is not None:
        inside = [line for line in spectrum.lines if wavelengths[0] <= line[0] <= wavelengths[-1]]
        for wavelength, power in inside:
            axes.vlines(wavelength * 1e9, 0, power, color=style["color"], lw=1.5)
        return
    axes.plot(wavelengths * 1e9, spectrum.evaluate(wavelengths), lw=1.3, **style)


def _integral(spectrum: Spectrum, wavelengths: Array) -> float:
    if spectrum.lines is not None:
        inside = (p for w, p in spectrum.lines if wavelengths[0] <= w <= wavelengths[-1])
        return float(sum(inside))
    return float(np.trapezoid(spectrum.evaluate(wavelengths), wavelengths))


def mtf_parts(frame: Frame) -> tuple[Array, dict[str, Array]]:
    """Return the MTF of each effect along a row.

    They are those at the wavelength in the middle of the scene's light.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    tuple
        Frequencies (n,) [cycles/m], and MTFs (n,) by effect.
    """
    frequency = np.linspace(0, 1 / frame.geometry.pitch_x, FREQUENCIES)
    transfer = frame.transfer
    shares = np.abs(transfer.weights).sum(axis=(0, 1))
    middle = int(np.searchsorted(np.cumsum(shares), shares.sum() / 2))
    wavelength = float(transfer.wavelengths[min(middle, len(shares) - 1)])
    found = ((e.name, e.row_transfer(frequency, wavelength)) for e in frame.plan.active)
    return frequency, {name: contrast for name, contrast in found if contrast is not None}


def draw_mtf(figure: Any, frame: Frame, names: Sequence[str]) -> None:
    """Draw the MTF of each effect along a row, and their product.

    Parameters
    ----------
    figure : Any
        Figure of matplotlib to draw on.
    frame : Frame
        Frame that was taken.
    names : sequence of str
        Labels of the effects, in the order of `mtf_parts`.
    """
    frequency, parts = mtf_parts(frame)
    pitch = frame.geometry.pitch_x
    axes = figure.add_subplot()
    for i, (label, part) in enumerate(zip(names, parts.values(), strict=True)):
        color = COLORS[i % len(COLORS)]
        axes.plot(
            frequency * pitch, part, label=label, color=color, ls=DASHES[i % len(DASHES)], lw=1.3
        )
    whole = np.prod(list(parts.values()), axis=0)
    axes.plot(frequency * pitch, whole, label="product", color=GRAY, lw=2)
    axes.axvline(0.5, color=GRAY, lw=0.9, ls=MARK)
    axes.text(0.5, 1.02, " Nyquist", fontsize=SMALL, va="bottom", ha="center")
    axes.set(xlabel="spatial frequency [cycles/pixel]", ylabel="MTF")
    axes.set(xlim=(0, frequency[-1] * pitch), ylim=(0, 1.1))
    axes.legend(fontsize=SMALL)
    add_scale(axes, "spatial frequency on the sensor [lp/mm]", 1e-3 / pitch)


def histogram(frame: Frame) -> tuple[Array, list[Array]]:
    """Return the histogram of the codes of each color.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    tuple
        Edges (n + 1,) of the bins [DN], and numbers of pixels (n,) of each color.
    """
    top = frame.chain.highest_dn
    bins = min(BINS, top + 1)
    edges = np.linspace(-0.5, top + 0.5, bins + 1)
    dn, colors = frame.dn, range(len(frame.mosaic.colors))
    if frame.layout.full_color:
        each = list(dn)
    else:
        each = [dn[frame.layout.color == color] for color in colors]
    return edges, [np.histogram(values, edges)[0] for values in each]


def draw_histogram(figure: Any, frame: Frame) -> None:
    """Draw the histogram of the codes of each color.

    Parameters
    ----------
    figure : Any
        Figure of matplotlib to draw on.
    frame : Frame
        Frame that was taken.
    """
    edges, counts = histogram(frame)
    axes = figure.add_subplot()
    for count, style in zip(counts, channel_style(frame), strict=True):
        axes.stairs(count, edges, color=style["color"], ls=style["ls"], label=style["label"])
    axes.axvline(frame.black_dn, color=GRAY, lw=0.9, ls=MARK, label="black level")
    axes.set(xlabel="code of the raw frame [DN]", ylabel="pixels", yscale="symlog")
    axes.set(xlim=(edges[0], edges[-1]))
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=SMALL, ncols=2)
