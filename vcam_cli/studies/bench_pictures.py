"""Pictures of a measured camera: photon transfer, signal to noise, linearity, sharpness."""

from __future__ import annotations

import numpy as np

from vcam_cli.files.curves import Curve, Mark, Panel
from vcam_cli.quality.photon_transfer import GAIN_RANGE, ROUNDING
from vcam_cli.studies.characterize import Characterization
from vcam_cli.studies.exposures import Channel

PALETTE = {"R": 1, "G": 2, "B": 0, "Y": 0}
"""Colors of the house for the colors of filters; others take what is left."""


def pictures(found: Characterization) -> dict[str, tuple[str, list[Panel]]]:
    """File name -> title and panels."""
    name = found.bench.camera.name
    return {
        "photon_transfer.png": (f"{name}: photon transfer", [_photon_transfer(found)]),
        "snr.png": (f"{name}: signal to noise", [_snr(found)]),
        "linearity.png": (f"{name}: linearity", _linearity(found)),
        "mtf.png": (f"{name}: system MTF at the center", [_mtf(found)]),
    }


def _colors(found: Characterization) -> list[tuple[int, Channel]]:
    others = iter((3, 4, 5, 6, 7))
    return [(PALETTE[c.color] if c.color in PALETTE else next(others), c) for c in found.channels]


def _named(channel: Channel, text: str, found: Characterization) -> str:
    """With the color's name where there are several."""
    return f"{channel.color}: {text}" if len(found.channels) > 1 else text


def _photon_transfer(found: Characterization) -> Panel:
    curves, marks = [], []
    for color, channel in _colors(found):
        m = channel.transfer
        s = m.series
        gain = f"K = {m.gain:.4g} DN/e"
        end = float(s.signal[s.saturated])
        line = np.array([0.0, end])
        curves += [
            Curve(_named(channel, "measured", found), s.signal, s.noise, "points", color),
            Curve(_named(channel, gain, found), line, m.offset + m.gain * line, "line", color),
        ]
        marks.append(Mark(end, "saturation", color))
    marks = [Mark(GAIN_RANGE * marks[0].x, "end of the fit"), marks[0]]
    return Panel(
        "mean above the dark [DN]", "temporal variance above the dark [DN²]", curves, marks,
        legend="upper left",
    )  # fmt: skip


def _snr(found: Characterization) -> Panel:
    curves, on = [], found.bench
    e = on.ready.electrical
    floor = on.floor + on.dark + ROUNDING * e.electrons_per_dn**2
    marks: list[Mark] = []
    for color, channel in _colors(found):
        m = channel.transfer
        s = m.series
        used = np.arange(len(s.photons)) <= s.saturated
        photons = np.geomspace(m.threshold_photons / 3, m.saturation_photons, 200)
        electrons = on.efficiency(channel.color) * photons
        described = electrons / np.sqrt(electrons + floor)
        curves += [
            Curve(
                _named(channel, "measured", found), s.photons[used], s.snr[used], "points", color
            ),
            Curve(_named(channel, "described", found), photons, described, "line", color),
        ]
        marks += [
            Mark(m.threshold_photons, "threshold" if not marks else "", color),
            Mark(m.saturation_photons, "saturation" if len(marks) < 2 else "", color),
        ]
    every = np.geomspace(min(mark.x for mark in marks) / 3, max(mark.x for mark in marks), 50)
    curves.append(Curve("the light's own noise", every, np.sqrt(every), "dashed", -1))
    return Panel(
        "photons on a pixel", "signal over temporal noise", curves, marks, log=True,
        y_range=(0.1, 6 * float(np.sqrt(every[-1]))), legend="upper left",
    )  # fmt: skip


def _linearity(found: Characterization) -> list[Panel]:
    response, deviation = [], []
    for color, channel in _colors(found):
        s, straight = channel.transfer.series, channel.linearity
        line = np.array([0.0, channel.transfer.saturation_photons])
        fitted = straight.offset + straight.slope * line
        error = _named(channel, f"LE = {100 * straight.error:.2g} %", found)
        response += [
            Curve(_named(channel, "measured", found), s.photons, s.signal, "points", color),
            Curve(_named(channel, "line", found), line, fitted, "line", color),
        ]
        inside = straight.inside
        deviation.append(
            Curve(error, s.photons[inside], 100 * straight.deviation[inside], "points", color)
        )
    reach = 2 * max(float(np.abs(c.y).max()) for c in deviation) or 1.0  # room for the legend
    label = "photons on a pixel"
    return [
        Panel(label, "mean above the dark [DN]", response, legend="lower right"),
        Panel(
            label, "deviation [%]", deviation, height=0.5, y_range=(-reach, reach),
            legend="upper right",
        ),
    ]  # fmt: skip


def _mtf(found: Characterization) -> Panel:
    curves, marks = [], []
    for color, channel in _colors(found):
        edge = channel.edge.measured
        shown = edge.frequency <= 2.4 * found.nyquist
        f = edge.frequency[shown] / 1e3
        measured = _named(channel, "slanted edge", found)
        curves += [
            Curve(measured, f[::2], edge.mtf[shown][::2], "points", color),
            Curve(
                _named(channel, "described", found), f, channel.edge.expected[shown], "line", color
            ),
        ]
        if np.isfinite(edge.mtf50):
            text = _named(channel, f"MTF50 {edge.mtf50 / 1e3:.4g}", found)
            marks.append(Mark(edge.mtf50 / 1e3, text, color))
    marks.append(Mark(found.nyquist / 1e3, "Nyquist"))
    return Panel(
        "spatial frequency on the sensor [lp/mm]", "transfer", curves, marks,
        x_range=(0, 2.4 * found.nyquist / 1e3), y_range=(0, 1.05), legend="upper right",
    )  # fmt: skip
