"""Plots of a measured camera: photon transfer, signal to noise, linearity, sharpness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.characterization.characterize import Characterization
from vcam_cli.characterization.exposures import Channel
from vcam_cli.files.curves import Curve, Mark, Panel
from vcam_cli.quality.photon_transfer import GAIN_RANGE, ROUNDING

PALETTE = {"R": 1, "G": 2, "B": 0, "Y": 0}
"""Indices of the colors of the plots' palette for the colors of filters; others get the rest."""
MTF_RANGE = 2.4
"""End of the axis of spatial frequencies, over the Nyquist frequency."""
PHOTONS_LABEL = "photons on a pixel"


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
        Curve("measured", signal, 10 ** (measured / 20), "points", 0),
        Curve("model", signal, 10 ** (expected / 20), "line", 0),
        Curve("shot-noise limit", signal, np.sqrt(signal), "dashed", -1),
    ]
    panel = Panel(
        "signal of the large photodiode [e]", "signal over temporal noise", curves, log=True
    )
    return {"merged_snr.png": (f"{result.bench.camera.name}: SNR of all readouts", [panel])}


def _styled_channels(result: Characterization) -> Iterator[tuple[Channel, int, str]]:
    """Yield each channel, its color in the plots, and the beginning of its labels."""
    others = iter((3, 4, 5, 6, 7))
    for channel in result.channels:
        color = PALETTE[channel.color] if channel.color in PALETTE else next(others)
        yield channel, color, f"{channel.color}: " if len(result.channels) > 1 else ""


def _photon_transfer_panel(result: Characterization) -> Panel:
    curves, ends = [], []
    for channel, color, prefix in _styled_channels(result):
        transfer, series = channel.transfer, channel.transfer.series
        ends.append(Mark(float(series.signal[series.saturation_index]), "saturation", color))
        line = np.array([0.0, ends[-1].x])
        fit = transfer.offset + transfer.gain * line
        curves += [
            Curve(f"{prefix}measured", series.signal, series.noise, "points", color),
            Curve(f"{prefix}K = {transfer.gain:.4g} DN/e", line, fit, "line", color),
        ]
    return Panel(
        "mean above the dark [DN]",
        "temporal variance above the dark [DN²]",
        curves,
        [Mark(GAIN_RANGE * ends[0].x, "end of the fit"), ends[0]],
        legend="upper left",
    )


def _snr_panel(result: Characterization) -> Panel:
    curves: list[Curve] = []
    marks: list[Mark] = []
    for channel, color, prefix in _styled_channels(result):
        transfer, series = channel.transfer, channel.transfer.series
        used = np.arange(len(series.photons)) <= series.saturation_index
        photons = np.geomspace(transfer.threshold_photons / 3, transfer.saturation_photons, 200)
        model = _model_snr(result, channel, photons)
        curves += [
            Curve(f"{prefix}measured", series.photons[used], series.snr[used], "points", color),
            Curve(f"{prefix}model", photons, model, "line", color),
        ]
        first = not marks  # the texts of one color are enough
        marks += [
            Mark(transfer.threshold_photons, "threshold" if first else "", color),
            Mark(transfer.saturation_photons, "saturation" if first else "", color),
        ]
    ends = [mark.x for mark in marks]
    photons = np.geomspace(min(ends) / 3, max(ends), 50)
    curves.append(Curve("shot-noise limit", photons, np.sqrt(photons), "dashed", -1))
    return Panel(
        PHOTONS_LABEL,
        "signal over temporal noise",
        curves,
        marks,
        log=True,
        y_range=(0.1, 6 * float(np.sqrt(photons[-1]))),
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
        Panel(PHOTONS_LABEL, "mean above the dark [DN]", response, legend="lower right"),
        Panel(PHOTONS_LABEL, "deviation [%]", deviation, height=0.5, y_range=limits,
              legend="upper right"),
    ]  # fmt: skip


def _mtf_panel(result: Characterization) -> Panel:
    curves, marks = [], []
    for channel, color, prefix in _styled_channels(result):
        edge = channel.edge.measured
        shown = edge.frequency <= MTF_RANGE * result.nyquist
        frequency = edge.frequency[shown] / 1e3
        curves += [
            Curve(f"{prefix}slanted edge", frequency[::2], edge.mtf[shown][::2], "points", color),
            Curve(f"{prefix}model", frequency, channel.edge.expected[shown], "line", color),
        ]
        if np.isfinite(edge.mtf50):
            mtf50 = edge.mtf50 / 1e3
            marks.append(Mark(mtf50, f"{prefix}MTF50 {mtf50:.4g}", color))
    marks.append(Mark(result.nyquist / 1e3, "Nyquist"))
    return Panel(
        "spatial frequency on the sensor [lp/mm]",
        "transfer",
        curves,
        marks,
        x_range=(0, MTF_RANGE * result.nyquist / 1e3),
        y_range=(0, 1.05),
        legend="upper right",
    )
