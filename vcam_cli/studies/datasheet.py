"""The numbers of a data sheet, each as measured and as the camera's description has it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vcam_cli.physics import readout
from vcam_cli.quality.mtf import crossing
from vcam_cli.quality.photon_transfer import (
    LEAST_DARK,
    ROUNDING,
    electrons_of_variance,
    sensitivity_threshold,
)
from vcam_cli.studies.bench import Bench
from vcam_cli.studies.closed_form import saturation_capacity
from vcam_cli.studies.exposures import Channel

COLUMNS = ("quantity", "channel", "measured", "expected", "unit", "definition")
SNR_LEVEL = 0.2
"""Part of saturation at which the signal-to-noise ratio of eq 3.2 is told."""
R4 = "EMVA 1288 R4"


@dataclass(frozen=True)
class Quantity:
    """One number: as measured, and as the description has it."""

    name: str
    channel: str
    measured: float
    expected: float
    unit: str
    definition: str

    @property
    def row(self) -> tuple[str, str, float, float, str, str]:
        """In the order of `COLUMNS`."""
        return self.name, self.channel, self.measured, self.expected, self.unit, self.definition


def quantities(on: Bench, seen: Channel) -> tuple[Quantity, ...]:
    """Every number of one color."""
    told = (*_response(on, seen), *_range(on, seen), *_patterns(on, seen), *_sharpness(on, seen))
    return tuple(
        Quantity(name, seen.color, float(measured), float(expected), unit, definition)
        for name, measured, expected, unit, definition in told
    )


Told = Iterator[tuple[str, float, float, str, str]]


def _response(on: Bench, seen: Channel) -> Told:
    """Gain, efficiency and noise."""
    m, gain = seen.transfer, 1 / on.ready.electrical.electrons_per_dn
    efficiency = on.efficiency(seen.color)
    straight = seen.linearity
    dark = math.sqrt(on.floor + on.dark)
    at_no_time = electrons_of_variance(seen.dark.variance, m.gain)
    yield "system_gain", m.gain, gain, "DN/e", f"K, {R4} eq 50"
    yield (
        "quantum_efficiency",
        100 * m.quantum_efficiency,
        100 * efficiency,
        "%",
        (f"electrons per photon on the pixel, in this light; {R4} eq 52"),
    )
    yield "responsivity", m.responsivity, gain * efficiency, "DN/photon", f"R, {R4} eq 49"
    yield "temporal_dark_noise", m.dark_noise, dark, "e", f"sigma_d, {R4} eqs 53 and 54"
    yield (
        "read_noise",
        at_no_time,
        math.sqrt(on.floor),
        "e",
        ("noise of reset and readout: temporal dark noise at no exposure time"),
    )
    yield "dark_current", seen.dark_current, on.ready.dark_rate, "e/s", f"mu_I.mean, {R4} section 7"
    yield "linearity_error", 100 * straight.error, 0.0, "%", f"LE, {R4} eq 63"
    yield "linearity_error_min", 100 * straight.least, 0.0, "%", f"of the deviations, {R4} eq 62"
    yield "linearity_error_max", 100 * straight.largest, 0.0, "%", f"of the deviations, {R4} eq 62"


def _range(on: Bench, seen: Channel) -> Told:
    """From the least light that can be told from none to the most."""
    m, e = seen.transfer, on.ready.electrical
    efficiency = on.efficiency(seen.color)
    rounding = ROUNDING * e.electrons_per_dn**2
    capacity = saturation_capacity(e.saturation, on.dark, on.floor, on.pattern)
    least = sensitivity_threshold(on.floor + on.dark + rounding)
    dark = seen.dark_current * on.time
    half = SNR_LEVEL * on.saturation
    yield (
        "full_well",
        seen.full_well,
        e.saturation,
        "e",
        ("electrons that the well or the ADC holds, whichever is full first"),
    )
    yield "saturation_capacity", m.saturation_capacity, capacity, "e", f"mu_e.sat, {R4} eq 24"
    yield (
        "saturation_photons",
        m.saturation_photons,
        capacity / efficiency,
        "photons",
        (f"mu_p.sat, {R4} section 6"),
    )
    yield "threshold_electrons", m.threshold_electrons, least, "e", f"mu_e.min, {R4} eq 27"
    yield (
        "threshold_photons",
        m.threshold_photons,
        least / efficiency,
        "photons",
        (f"mu_p.min, {R4} eq 26"),
    )
    yield "snr_max_db", _db(m.snr_max), _db(math.sqrt(capacity)), "dB", f"{R4} eq 55"
    yield "emva_dynamic_range_db", _db(m.dynamic_range), _db(capacity / least), "dB", f"{R4} eq 28"
    yield (
        "dynamic_range_db",
        _db((seen.full_well - dark) / m.dark_noise),
        float(readout.dynamic_range_db(e.saturation, on.dark, on.floor)),
        "dB",
        "Chen 2003 eq 3.1",
    )
    yield (
        "snr_db",
        _db(m.snr_at(half)),
        float(readout.snr_db(half, on.dark, on.floor)),
        "dB",
        f"Chen 2003 eq 3.2, at {SNR_LEVEL:.0%} of saturation",
    )


def _patterns(on: Bench, seen: Channel) -> Told:
    """What differs from pixel to pixel."""
    column = on.columns
    dark, half = on.pattern(on.dark), 0.5 * on.saturation
    bright = on.pattern(half + on.dark) - dark
    column_dark = column[0] ** 2 + (column[1] * on.dark) ** 2
    expected = (
        (math.sqrt(dark), 0.0, math.sqrt(column_dark), math.sqrt(max(dark - column_dark, 0.0))),
        (
            math.sqrt(max(bright, 0.0)) / half,
            0.0,
            column[1],
            math.sqrt(max(bright / half**2 - column[1] ** 2, 0)),
        ),
    )
    kinds = (
        ("dsnu", seen.dsnu, expected[0], 1, "e", "DSNU1288", 66),
        ("prnu", seen.prnu, expected[1], 100, "%", "PRNU1288", 67),
    )
    for name, found, described, scale, unit, symbol, equation in kinds:
        parts = (found.total, found.row, found.column, found.pixel)
        for part, measured, known in zip(
            ("", "_row", "_column", "_pixel"), parts, described, strict=True
        ):
            definition = f"{symbol}{part.replace('_', '.')}, {R4} eq {equation}"
            yield name + part, scale * measured, scale * known, unit, definition


def _sharpness(on: Bench, seen: Channel) -> Told:
    """The system's transfer across the slanted edge."""
    edge, expected = seen.edge.measured, seen.edge.expected
    pitch = on.ready.geometry.pitch_x
    half = crossing(edge.frequency, expected, 0.5)
    definition = "where the transfer is one half; e-SFR of ISO 12233, at the center"
    yield "mtf50", edge.mtf50 / 1e3, half / 1e3, "lp/mm", definition
    yield "mtf50_per_pixel", edge.mtf50 * pitch, half * pitch, "cycles/pixel", definition
    at = 0.5 / pitch
    yield (
        "mtf_nyquist",
        float(np.interp(at, edge.frequency, edge.mtf)),
        float(np.interp(at, edge.frequency, expected)),
        "",
        "transfer at half a cycle per pixel; e-SFR of ISO 12233",
    )


def _db(ratio: float) -> float:
    return 20 * math.log10(ratio) if ratio > 0 else -math.inf


def notes(on: Bench, channels: tuple[Channel, ...]) -> Iterator[str]:
    """What a reader of the numbers has to know."""
    blind = [color for color in on.ready.mosaic.colors if color not in on.colors]
    if blind:
        yield f"{', '.join(blind)}: not measured, sees nothing of this light"
    if on.pedestal:
        yield (
            f"the ADC's offset of {on.ready.electrical.offset:g} DN cuts off noise in the dark;"
            f" measured with codes moved up by {on.pedestal} DN, as EMVA 1288 asks"
        )
    if any(c.transfer.series.dark_variance < LEAST_DARK for c in channels):
        yield (
            "the noise in the dark drowns in the ADC's rounding: temporal_dark_noise and read_noise"
            " are the most that they can be (EMVA 1288 R4 eq 54), dsnu holds rounding as well"
        )
