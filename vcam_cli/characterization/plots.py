"""Plots of a measured camera: photon transfer, signal to noise, linearity, sharpness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.characterization.characterize import Characterization
from vcam_cli.characterization.exposures import Channel
from vcam_cli.files.curves import Curve, Mark, Panel
from vcam_cli.files.plots import channel_series
from vcam_cli.quality.photon_transfer import GAIN_RANGE, ROUNDING

MTF_RANGE = 2.4
"""End of the axis of spatial frequencies, over the Nyquist frequency."""
LINE_START = 0.01
"""Start of the fitted line over saturation: below it the offset of the fit outweighs its slope."""
PHOTONS_LABEL = "photons per pixel"


def characterization_panels(result: Characterization) -> dict[str, tuple[str, list[Panel]]]:
    """Return title and panels of each plot, by the name of its file."""
    name = result.bench.camera.name
    return {
        "photon_transfer.png": (f"{name}: photon transfer", [_photon_transfer_panel(result)]),
        "snr.png": (f"{name}: signal to noise", [_snr_panel(result)]),
        "linearity.png": (f"{name}: linearity", _linearity_panels(result)),
        "mtf.png": (f"{name}: system MTF at the center", [_mtf_panel(result)]),
        **_merged_plot(result),
    }


def _merged_plot(result: Characterization) -> dict[str, tuple[str, list[Panel]]]:
    """Return the plot of the SNR of several readouts; none of pixels that are read once."""
    if not result.merged:
        return {}
    signal, measured, expected = np.array([point.row for point in result.merged]).T
    curves = [
        Curve("measured", signal, measured, "points", 0),
        Curve("model", signal, expected, "line", 0),
        Curve("shot-noise limit", signal, _decibels(np.sqrt(signal)), "dashed", -1),
    ]
    panel = Panel("signal of the large photodiode [e]", "temporal SNR [dB]", curves, log="x")
    return {"merged_snr.png": (f"{result.bench.camera.name}: SNR of all readouts", [panel])}


def _decibels(ratio: Array) -> Array:
    """Return 20 log10 of ratios of signals; -inf for 0."""
    with np.errstate(divide="ignore"):
        decibels: Array = 20 * np.log10(ratio)
    return decibels


def _styled_channels(result: Characterization) -> Iterator[tuple[Channel, int, str]]:
    """Yield each channel, its series in the plots, and the beginning of its labels."""
    numbers = channel_series([channel.color for channel in result.channels])
    for channel, series in zip(result.channels, numbers, strict=True):
        yield channel, series, f"{channel.color}: " if len(result.channels) > 1 else ""


def _photon_transfer_panel(result: Characterization) -> Panel:
    curves, ends = [], []
    for channel, color, prefix in _styled_channels(result):
        transfer, series = channel.transfer, channel.transfer.series
        ends.append(Mark(float(series.signal[series.saturation_index]), "saturation", color))
        line = np.geomspace(LINE_START * ends[-1].x, ends[-1].x, 100)
        fit = transfer.offset + transfer.gain * line
        curves += [
            Curve(f"{prefix}measured", series.signal, series.noise, "points", color),
            Curve(f"{prefix}K = {transfer.gain:.4g} DN/e", line, fit, "line", color),
        ]
    return Panel(
        "mean signal above dark [DN]",
        "temporal variance above dark [DN²]",
        curves,
        [Mark(GAIN_RANGE * ends[0].x, "end of the fit"), ends[0]],
        log="xy",
        legend="upper left",
    )


def _snr_panel(result: Characterization) -> Panel:
    curves: list[Curve] = []
    marks: list[Mark] = []
    unit = result.bench.photons_per_exposure
    is_visible = unit > 0
    unit = unit or 1.0  # infrared light: over photons
    for channel, color, prefix in _styled_channels(result):
        transfer, series = channel.transfer, channel.transfer.series
        used = np.arange(len(series.photons)) <= series.saturation_index
        photons = np.geomspace(transfer.threshold_photons / 3, transfer.saturation_photons, 200)
        measured = _decibels(series.snr[used])
        model = _decibels(_model_snr(result, channel, photons))
        curves += [
            Curve(f"{prefix}measured", series.photons[used] / unit, measured, "points", color),
            Curve(f"{prefix}model", photons / unit, model, "line", color),
        ]
        first = not marks  # the texts of one color are enough
        marks += [
            Mark(transfer.threshold_photons / unit, "threshold" if first else "", color),
            Mark(transfer.saturation_photons / unit, "saturation" if first else "", color),
        ]
    ends = [mark.x for mark in marks]
    light = np.geomspace(min(ends) / 3, max(ends), 50)
    limit = _decibels(np.sqrt(light * unit))
    curves.append(Curve("shot-noise limit", light, limit, "dashed", -1))
    above = (PHOTONS_LABEL, unit)
    return Panel(
        "luminous exposure of the sensor [lx s]" if is_visible else PHOTONS_LABEL,
        "temporal SNR [dB]",
        curves,
        marks,
        log="x",
        scale_above=above if is_visible else None,
        y_range=(-20.0, float(limit[-1]) + 15),
        legend="upper left",
    )


def _model_snr(result: Characterization, channel: Channel, photons: Array) -> Array:
    """Return the SNR of the camera's model at some photons on a pixel, rounding included."""
    bench = result.bench
    rounding = ROUNDING / bench.ready.chain.system_gain**2
    electrons = bench.efficiency(channel.color) * photons
    return electrons / np.sqrt(electrons + (bench.noise_floor + bench.dark + rounding))


def _linearity_panels(result: Characterization) -> list[Panel]:
    response, deviation = [], []
    for channel, color, prefix in _styled_channels(result):
        series, straight = channel.transfer.series, channel.linearity
        line = np.array([0.0, channel.transfer.saturation_photons])
        fit = straight.offset + straight.slope * line
        response += [
            Curve(f"{prefix}measured", series.photons, series.signal, "points", color),
            Curve(f"{prefix}line", line, fit, "line", color),
        ]
        inside = straight.in_range
        percent = 100 * straight.deviation[inside]
        label = f"{prefix}LE = {100 * straight.error:.2g} %"
        deviation.append(Curve(label, series.photons[inside], percent, "points", color))
    reach = 2 * max(float(np.abs(c.y).max()) for c in deviation) or 1.0  # room for the legend
    limits = (-reach, reach)
    return [
        Panel(PHOTONS_LABEL, "mean signal above dark [DN]", response, legend="lower right"),
        Panel(PHOTONS_LABEL, "linearity deviation [%]", deviation, height=0.5, y_range=limits,
              legend="upper right"),
    ]  # fmt: skip


def _mtf_panel(result: Characterization) -> Panel:
    pitch = result.bench.ready.geometry.pitch_x
    curves, marks = [], []
    for channel, color, prefix in _styled_channels(result):
        edge = channel.edge.measured
        shown = edge.frequency <= MTF_RANGE * result.nyquist
        frequency = edge.frequency[shown] * pitch
        curves += [
            Curve(f"{prefix}slanted edge", frequency[::2], edge.mtf[shown][::2], "points", color),
            Curve(f"{prefix}model", frequency, channel.edge.expected[shown], "line", color),
        ]
        if np.isfinite(edge.mtf50):
            mtf50 = edge.mtf50 * pitch
            marks.append(Mark(mtf50, f"{prefix}MTF50 {mtf50:.3g}", color))
    marks.append(Mark(result.nyquist * pitch, "Nyquist"))
    return Panel(
        "spatial frequency [cycles/pixel]",
        "MTF",
        curves,
        marks,
        scale_above=("spatial frequency on the sensor [lp/mm]", 1e-3 / pitch),
        x_range=(0, MTF_RANGE * result.nyquist * pitch),
        y_range=(0, 1.05),
        legend="upper right",
    )
