"""The numbers of a data sheet, each as measured and as the camera's model has it.

References
----------
.. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
.. [2] ISO 12233, "Photography - Electronic still picture imaging - Resolution and spatial frequency
   responses".
.. [3] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, eqs 3.1 and 3.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vcam_cli.characterization.bench import Bench
from vcam_cli.characterization.closed_form import saturation_capacity
from vcam_cli.characterization.exposures import Channel
from vcam_cli.physics import readout
from vcam_cli.quality.mtf import crossing_frequency
from vcam_cli.quality.nonuniformity import Nonuniformity
from vcam_cli.quality.photon_transfer import (
    MIN_DARK_VARIANCE,
    ROUNDING,
    electrons_of_variance,
    linearity,
    sensitivity_threshold,
)
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum, illuminant

COLUMNS = ("quantity", "channel", "measured", "expected", "unit", "definition")
_PARTS = ("", "_row", "_column", "_pixel")
UNITS = {
    "system_gain": "DN/e",
    "quantum_efficiency": "%",
    "responsivity": "DN/photon",
    **dict.fromkeys(("responsivity_a", "responsivity_green"), "V/(lx s)"),
    "temporal_dark_noise": "e",
    "read_noise": "e",
    "dark_current": "e/s",
    **dict.fromkeys(("linearity_error", "linearity_error_min", "linearity_error_max"), "%"),
    **dict.fromkeys(("full_well", "saturation_capacity", "threshold_electrons"), "e"),
    **dict.fromkeys(("saturation_photons", "threshold_photons"), "photons"),
    **dict.fromkeys(("snr_max_db", "emva_dynamic_range_db", "dynamic_range_db", "snr_db"), "dB"),
    **{f"dsnu{part}": "e" for part in _PARTS},
    **{f"prnu{part}": "%" for part in _PARTS},
    "mtf50": "lp/mm",
    "mtf50_per_pixel": "cycles/pixel",
    "mtf_nyquist": "",
}
"""Quantity that can be expected (`--expect`) -> its unit."""
SNR_LEVEL = 0.2
"""Signal at which the SNR of eq 3.2 is reported, over saturation."""
GREEN = 550e-9
"""Wavelength of the green light by which data sheets state responsivity [m]."""
R4 = "EMVA 1288 R4"

Row = tuple[str, float, float, str, str]
"""Name, measured, expected, unit and definition of a number."""
Pattern = tuple[float, float, float, float]
"""Standard deviations of all pixels, of rows, of columns, and of pixels alone."""


@dataclass(frozen=True)
class Quantity:
    """One number of the data sheet.

    Parameters
    ----------
    name, channel : str
        Name of the number and of the color.
    measured, expected : float
        The number as measured, and as the model has it.
    unit, definition : str
        Its unit, and how the standards define it.
    """

    name: str
    channel: str
    measured: float
    expected: float
    unit: str
    definition: str

    @property
    def row(self) -> tuple[str, str, float, float, str, str]:
        """The values in the order of `COLUMNS`."""
        return self.name, self.channel, self.measured, self.expected, self.unit, self.definition


def quantities(bench: Bench, channel: Channel) -> tuple[Quantity, ...]:
    """Return every number of one color.

    Parameters
    ----------
    bench : Bench
        The camera in even light.
    channel : Channel
        What was measured of the color.
    """
    rows = (
        *_response_rows(bench, channel),
        *_range_rows(bench, channel),
        *_pattern_rows(bench, channel),
        *_sharpness_rows(bench, channel),
    )
    return tuple(
        Quantity(name, channel.color, float(measured), float(expected), unit, definition)
        for name, measured, expected, unit, definition in rows
    )


def notes(bench: Bench, channels: tuple[Channel, ...]) -> Iterator[str]:
    """Yield what a reader of the numbers has to know."""
    blind = [color for color in bench.ready.mosaic.colors if color not in bench.colors]
    if blind:
        yield f"{', '.join(blind)}: not measured, does not respond to this light"
    if bench.pedestal:
        yield (
            f"the ADC's offset of {bench.ready.electrical.offset:g} DN cuts off noise in the dark;"
            f" measured with codes moved up by {bench.pedestal} DN, as EMVA 1288 asks"
        )
    curve = bench.ready.electrical.curve
    if curve is not None:
        yield (
            "the transfer curve deviates from a straight line by at most"
            f" {curve.nonlinearity:.2%} of its output: gain and electron counts are those of a"
            " linear camera"
        )
    if any(c.transfer.series.dark_variance < MIN_DARK_VARIANCE for c in channels):
        yield (
            "quantization masks the dark noise: temporal_dark_noise and read_noise are upper"
            " limits (EMVA 1288 R4 eq 54), and dsnu includes quantization noise"
        )


def _response_rows(bench: Bench, channel: Channel) -> Iterator[Row]:
    """Yield gain, efficiency and noise."""
    transfer, straight = channel.transfer, channel.linearity
    gain = bench.ready.chain.system_gain
    efficiency = bench.efficiency(channel.color)
    dark_noise = math.sqrt(bench.noise_floor + bench.dark)
    read_noise = electrons_of_variance(channel.dark.variance, transfer.gain)
    yield "system_gain", transfer.gain, gain, "DN/e", f"K, {R4} eq 50"
    definition = f"electrons per photon on the pixel, in this light; {R4} eq 52"
    yield "quantum_efficiency", 100 * transfer.quantum_efficiency, 100 * efficiency, "%", definition
    yield "responsivity", transfer.responsivity, gain * efficiency, "DN/photon", f"R, {R4} eq 49"
    yield from _photometric_rows(bench, channel)
    definition = f"sigma_d, {R4} eqs 53 and 54"
    yield "temporal_dark_noise", transfer.dark_noise, dark_noise, "e", definition
    definition = "noise of reset and readout: temporal dark noise at no exposure time"
    yield "read_noise", read_noise, math.sqrt(bench.noise_floor), "e", definition
    definition = f"mu_I.mean, {R4} section 7"
    yield "dark_current", channel.dark_current, bench.ready.dark_rate, "e/s", definition
    error, low, high = _expected_linearity(bench, channel)
    yield "linearity_error", 100 * straight.error, 100 * error, "%", f"LE, {R4} eq 63"
    definition = f"of the deviations, {R4} eq 62"
    yield "linearity_error_min", 100 * straight.min_deviation, 100 * low, "%", definition
    yield "linearity_error_max", 100 * straight.max_deviation, 100 * high, "%", definition


def _photometric_rows(bench: Bench, channel: Channel) -> Iterator[Row]:
    """Yield what data sheets state: volts of a pixel's output, at exposure.gain 1, by lux."""
    ready, camera = bench.ready, bench.ready.camera
    if not ready.electrical.has_volts:
        return
    volts = ready.electrical.conversion_gain * camera.pixel.readout.gain
    index = ready.mosaic.colors.index(channel.color)
    efficiency = channel.transfer.quantum_efficiency / bench.efficiency(channel.color)
    band = camera.scene.wavelengths
    lights = [("a", illuminant("A"), "illuminant A (2856 K)")]
    if band.start <= GREEN <= band.stop:
        lights.append(("green", Spectrum.line(GREEN), f"light of {GREEN * 1e9:.0f} nm"))
    for name, light, said in lights:
        per_exposure = ready.solved.electrons_per_exposure(light)
        expected = volts * float(per_exposure[index])
        definition = (
            f"of the pixel's output in {said}, light measured behind the lens;"
            " measured: by the measured quantum efficiency"
        )
        yield f"responsivity_{name}", efficiency * expected, expected, "V/(lx s)", definition


def _expected_linearity(bench: Bench, channel: Channel) -> tuple[float, float, float]:
    """Return the linearity error of the readout's curve, its least and its largest deviation."""
    if bench.ready.electrical.curve is None:
        return 0.0, 0.0, 0.0
    chain = bench.ready.chain
    series = channel.transfer.series
    electrons = series.photons * bench.efficiency(channel.color) + bench.dark
    black = chain.black_dn(bench.dark)
    without_noise = replace(series, mean=chain.to_dn(electrons), dark_mean=black)
    straight = linearity(without_noise)
    return straight.error, straight.min_deviation, straight.max_deviation


def _range_rows(bench: Bench, channel: Channel) -> Iterator[Row]:
    """Yield the range, from the least light that can be distinguished from none to the most."""
    transfer, chain = channel.transfer, bench.ready.chain
    efficiency = bench.efficiency(channel.color)
    floor, dark = bench.noise_floor, bench.dark
    capacity = saturation_capacity(chain.saturation, dark, floor, bench.pattern_variance)
    least = sensitivity_threshold(floor + dark + ROUNDING / chain.system_gain**2)
    definition = "electrons at saturation of the well or the ADC, whichever is lower"
    yield "full_well", channel.full_well, chain.saturation, "e", definition
    definition = f"mu_e.sat, {R4} eq 24"
    yield "saturation_capacity", transfer.saturation_capacity, capacity, "e", definition
    photons, definition = capacity / efficiency, f"mu_p.sat, {R4} section 6"
    yield "saturation_photons", transfer.saturation_photons, photons, "photons", definition
    definition = f"mu_e.min, {R4} eq 27"
    yield "threshold_electrons", transfer.threshold_electrons, least, "e", definition
    photons, definition = least / efficiency, f"mu_p.min, {R4} eq 26"
    yield "threshold_photons", transfer.threshold_photons, photons, "photons", definition
    yield "snr_max_db", _db(transfer.snr_max), _db(math.sqrt(capacity)), "dB", f"{R4} eq 55"
    expected, definition = _db(capacity / least), f"{R4} eq 28"
    yield "emva_dynamic_range_db", _db(transfer.dynamic_range), expected, "dB", definition
    measured = _db((channel.full_well - channel.dark_current * bench.time) / transfer.dark_noise)
    expected = float(readout.dynamic_range_db(chain.saturation, dark, floor))
    yield "dynamic_range_db", measured, expected, "dB", "Chen 2003 eq 3.1"
    signal = SNR_LEVEL * bench.saturation
    expected = float(readout.snr_db(signal, dark, floor))
    definition = f"Chen 2003 eq 3.2, at {SNR_LEVEL:.0%} of saturation"
    yield "snr_db", _db(transfer.measured_snr(signal)), expected, "dB", definition


def _pattern_rows(bench: Bench, channel: Channel) -> Iterator[Row]:
    """Yield what differs from pixel to pixel."""
    dark, bright = _expected_patterns(bench)
    kinds: tuple[tuple[str, Nonuniformity, Pattern, int, str, str, int], ...] = (
        ("dsnu", channel.dsnu, dark, 1, "e", "DSNU1288", 66),
        ("prnu", channel.prnu, bright, 100, "%", "PRNU1288", 67),
    )
    for name, pattern, model, scale, unit, symbol, equation in kinds:
        parts = (pattern.total, pattern.row, pattern.column, pattern.pixel)
        for part, measured, expected in zip(_PARTS, parts, model, strict=True):
            definition = f"{symbol}{part.replace('_', '.')}, {R4} eq {equation}"
            yield name + part, scale * measured, scale * expected, unit, definition


def _expected_patterns(bench: Bench) -> tuple[Pattern, Pattern]:
    """Return the model's pattern in the dark [e] and at half of saturation, relative."""
    half = 0.5 * bench.saturation
    dark, dark_column = bench.pattern_variance(bench.dark), bench.column_variance(bench.dark)
    bright = bench.pattern_variance(half + bench.dark) - dark
    column = bench.column_variance(half + bench.dark) - dark_column
    return _pattern(dark, dark_column, 1.0), _pattern(bright, column, half)


def _pattern(total: float, column: float, signal: float) -> Pattern:
    """Return standard deviations over a signal [e] from variances [e^2]: rows are all alike."""
    variances = total, 0.0, column, total - column
    whole, row, columns, pixel = (math.sqrt(max(v, 0.0)) / signal for v in variances)
    return whole, row, columns, pixel


def _sharpness_rows(bench: Bench, channel: Channel) -> Iterator[Row]:
    """Yield the system's transfer across the slanted edge."""
    edge, expected = channel.edge.measured, channel.edge.expected
    pitch = bench.ready.geometry.pitch_x
    half = crossing_frequency(edge.frequency, expected, 0.5)
    definition = "where the transfer is one half; e-SFR of ISO 12233, at the center"
    yield "mtf50", edge.mtf50 / 1e3, half / 1e3, "lp/mm", definition
    yield "mtf50_per_pixel", edge.mtf50 * pitch, half * pitch, "cycles/pixel", definition
    measured, model = (
        float(np.interp(0.5 / pitch, edge.frequency, mtf)) for mtf in (edge.mtf, expected)
    )
    definition = "transfer at half a cycle per pixel; e-SFR of ISO 12233"
    yield "mtf_nyquist", measured, model, "", definition


def _db(ratio: float) -> float:
    return 20 * math.log10(ratio) if ratio > 0 else -math.inf
