"""Gain, noise, pattern, range and efficiency of a sensor from the statistics of its frames.

Gain and responsivity are those of EMVA 1288, by the estimators that `vcam characterize` uses
(`quality.photon_transfer`); the standard errors beside them follow from those of the variances.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.fitting.conditions import Condition, Conditions, photons_per_pixel
from vcam_cli.fitting.noise_shape import is_significant
from vcam_cli.fitting.straightness import slope_misfit
from vcam_cli.quality.photon_transfer import (
    GAIN_RANGE,
    MIN_DARK_VARIANCE,
    ROUNDING,
    PhotonTransfer,
    Series,
    linearity,
    photon_transfer,
)
from vcam_cli.quality.rounding import LIMIT
from vcam_cli.records import dataclass
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import Estimate, combine

LEAST_BEND = 0.005
"""Relative misfit of the responsivity from which it is said: lamps are steady to that."""
SURE = 5.0
"""Standard errors from which black levels of colors differ significantly."""
LEAST_STEP = 0.05
"""Difference of black levels that a camera file has no use for [DN]."""


@dataclass(frozen=True)
class Dark:
    """What dark frames say, in the mean over all colors."""

    black: Estimate
    """Mean code at no exposure time [DN]."""
    current: Estimate | None
    """[DN/s]; None where all dark frames have one exposure time."""

    def mean(self, seconds: float) -> float:
        """Return the mean dark signal in an exposure, black level left out [DN]."""
        return 0.0 if self.current is None else self.current.value * seconds


def dark_line(dark: tuple[Condition, ...], color: str = "") -> Dark:
    """Return black level and dark current, by a weighted straight line of the means over time.

    color: of this color alone; "" of all together.

    The fixed pattern is the same at all times, so that it is no error of the slope; of the black
    level it is.
    """
    times = np.array([c.entry.exposure for c in dark])
    means = [c.mean(color) if color else c.every("mean") for c in dark]
    first = dark[0]
    shortest = [first.patterns[color]] if color else list(first.patterns.values())
    rows, columns = next(iter(first.planes.values()))[0].average.shape
    if not color:
        rows, columns = rows * first.planes_in_line, columns * first.planes_in_line
    elif len(first.planes[color]) > 1:  # greens, which are in all columns and in half of the rows
        columns *= len(first.planes[color])
    patterns = [p.pixel.value / (rows * columns) + max(p.column.value, 0) / columns
                for p in shortest]  # fmt: skip
    fixed = math.sqrt(max(float(np.mean(patterns)), 0.0))
    if len(np.unique(times)) < 2:
        return Dark(replace(means[0], error=math.hypot(means[0].error, fixed)), None)
    weights = np.array([1 / (m.error**2 + m.reach**2) for m in means])
    design = np.stack([np.ones_like(times), times], 1)
    covariance = np.linalg.inv(design.T @ (weights[:, None] * design))
    lever = covariance @ design.T * weights
    level, slope = lever @ [m.value for m in means]
    errors = np.linalg.norm(lever * [m.error for m in means], axis=1)
    off = abs(lever) @ [m.reach for m in means]
    black = Estimate(float(level), math.hypot(float(errors[0]), fixed), off[0], off[0])
    return Dark(black, Estimate(float(slope), float(errors[1]), off[1], off[1]))


def black_levels(dark: tuple[Condition, ...], line: Dark) -> dict[str, Estimate]:
    """Return the black level of every color where they differ; else one of "" for all [DN].

    Columns of a color are not those of another, so that their patterns are no common error.
    """
    colors = list(dark[0].planes)
    levels = {color: dark_line(dark, color).black for color in colors}
    alike = all(
        abs(apart.value) <= max(SURE * apart.error, LEAST_STEP) + apart.reach
        for apart in (level - levels[colors[0]] for level in levels.values())
    )
    return {"": line.black} if alike else levels


def doubling(warm: tuple[Condition, ...], line: Dark, usual: float) -> Estimate | None:
    """Return the rise of temperature that doubles the dark current; None where it is not told.

    Parameters
    ----------
    warm : tuple of Condition
        Dark stacks at other temperatures.
    line : Dark
        What those at the usual temperature say.
    usual : float
        That temperature [K].

    Returns
    -------
    Estimate or None
        Rise [K], by a weighted straight line of the logarithm over the temperature.
    """
    currents = {usual: line.current}
    for temperature in {c.entry.temperature for c in warm}:
        assert temperature is not None
        group = tuple(c for c in warm if c.entry.temperature == temperature)
        currents[temperature] = dark_line(group).current
    told = {t: c for t, c in currents.items() if c is not None and is_significant(c)}
    if len(told) < 2:
        return None
    kelvin = np.array(sorted(told))
    weights = np.array([(told[t].value / told[t].error) ** 2 for t in kelvin])
    logs = np.log([told[t].value for t in kelvin])
    apart = kelvin - weights @ kelvin / weights.sum()
    spread = float(weights @ apart**2)
    slope = Estimate(float(weights @ (apart * logs)) / spread, spread**-0.5)
    return Estimate(math.log(2), 0.0) / slope if is_significant(slope) else None


@dataclass(frozen=True)
class Transfer:
    """The photon transfer of one color in one light."""

    color: str
    light: str
    result: PhotonTransfer
    gain: Estimate
    """System gain K [DN/e]."""
    alone: Estimate
    """The same without the error by the gains of these pixels, which the signal has, too."""
    responsivity: Estimate | None
    """Signal over light [DN/photon]; None where the photons are not known."""
    efficiency: Estimate | None
    """Quantum efficiency of the whole pixel, by the gain of all colors; None likewise."""
    linearity_error: float | None
    conditions: tuple[Condition, ...]
    """By signal, rising."""
    bend: float = 0.0
    """How far the slope of the signal over the light may be off for its curve, relative."""
    bends: tuple[str, ...] = ()
    """Notes on curves, for the user."""

    @property
    def saturated(self) -> Condition | None:
        """The brightest stack beyond saturation, whose noise is clipped; None without one."""
        last = self.conditions[-1]
        peak = float(self.result.series.variance.max())
        clipped = float(self.result.series.variance[-1]) < 0.2 * peak
        return last if clipped else None


def transfers(
    found: Conditions, measurement: Measurement, line: Dark
) -> tuple[list[Transfer], list[str]]:
    """Return the photon transfer of every color in every light, and what stands against some."""
    groups: dict[str, list[Condition]] = {}
    for condition in found.flat:
        lamp = condition.entry.light
        assert lamp is not None  # else the frames are dark
        named = str(lamp.to_yaml()).translate(str.maketrans("", "", "{}'"))
        groups.setdefault(named, []).append(condition)
    out, notes = [], []
    for light, conditions in groups.items():
        for color in found.colors:
            try:
                out.append(_transfer(color, light, conditions, found, measurement, line))
            except ValueError as error:
                notes.append(f"{light}, {color}: no photon transfer, {error}")
    if not out:
        return out, notes
    # All colors have one gain: each by its own would give their signals other ratios than measured.
    common = _pooled([transfer.alone for transfer in out])
    for number, transfer in enumerate(out):
        if transfer.responsivity is not None:
            out[number] = replace(transfer, efficiency=transfer.responsivity / common)
    return out, notes


def _transfer(
    color: str,
    light: str,
    conditions: list[Condition],
    found: Conditions,
    measurement: Measurement,
    line: Dark,
) -> Transfer:
    ordered = tuple(sorted(conditions, key=lambda c: c.mean(color).value))
    amounts = [photons_per_pixel(c.entry, measurement) for c in ordered]
    known = all(a is not None for a in amounts)
    unlit = [_dark_of(c, found.dark, color, line) for c in ordered]
    first = unlit[0]
    near = _nearest(found.dark, ordered[0].entry.exposure)
    # As if all had the exposure time of the first: the others' dark signal is taken out.
    mean = np.array(
        [c.mean(color).value - d[0] + first[0] for c, d in zip(ordered, unlit, strict=True)]
    )
    variance = np.array(
        [c.variance(color).value - d[1].value + first[1].value
         for c, d in zip(ordered, unlit, strict=True)]
    )  # fmt: skip
    signal = mean - first[0]
    scale = np.array([float(a or 0) for a in amounts]) if known else signal
    series = Series(scale, mean, variance, first[0], first[1].value)
    result = photon_transfer(series)
    used = (signal <= GAIN_RANGE * signal[series.saturation_index]) & (
        np.arange(len(signal)) <= series.saturation_index
    )
    spreads = np.array([c.variance(color).error for c in ordered])[used]
    is_free = series.dark_variance < MIN_DARK_VARIANCE
    misfit = slope_misfit(signal[used], series.noise[used], spreads, result.gain, is_free)
    bends = []
    if misfit:
        bends.append(
            f"{color}, {light}: the photon transfer is no straight line; the gain may be off by"
            f" {misfit / result.gain:.1%}, which the intervals include"
        )
    slope = _gain_error(
        result, [c.variance(color) for c in ordered], first[1], near.mean(color), used
    )
    spread, uneven = _gain_spread(ordered, signal, color, found, line)
    # Gains g of a mean of 1 leave the mean signal as it is, and multiply its variance by g^2.
    slope = replace(slope, below=slope.below + misfit, above=slope.above + misfit)
    alone = slope / Estimate(1 + uneven, 0.0)
    gain = replace(alone, error=math.hypot(alone.error, alone.value * spread))
    responsivity, bend = None, misfit / result.gain
    if known:
        photons = scale[used]
        dark = near.mean(color)
        off = dark.reach * float(photons.sum()) / float(photons @ photons)
        errors = np.array([math.hypot(c.mean(color).error, dark.error) for c in ordered])[used]
        errors += dark.reach
        curved = slope_misfit(photons, signal[used], errors, result.responsivity)
        bend = curved / result.responsivity
        if bend > LEAST_BEND:
            bends.append(
                f"{color}, {light}: the signal is not proportional to the light; the responsivity"
                f" may be off by {bend:.1%}, which the intervals include"
            )
        off += curved
        responsivity = Estimate(result.responsivity, result.responsivity * spread, off, off)
    try:
        deviation = linearity(series).error if known else None
    except ValueError:
        deviation = None
    return Transfer(
        *(color, light, result, gain, alone, responsivity, None, deviation, ordered),
        bend=bend,
        bends=tuple(bends),
    )


def _gain_error(
    result: PhotonTransfer,
    variances: list[Estimate],
    dark: Estimate,
    unlit: Estimate,
    used: Array,
) -> Estimate:
    """Return the slope of a photon transfer with the error and the bounds of its variances.

    dark, unlit: variance and mean without light, which count where the line goes through them.
    """
    s = result.series.signal[used]
    is_free = result.series.dark_variance < MIN_DARK_VARIANCE
    lever = s - s.mean() if is_free else s
    lever = lever / float(lever @ lever)
    lit = [each for each, counts in zip(variances, used, strict=True) if counts]
    error = float(np.linalg.norm(lever * [each.error for each in lit]))
    off = float(abs(lever) @ [each.reach for each in lit])
    if not is_free:
        total = float(lever.sum())
        error = math.hypot(error, total * dark.error)
        off += total * (dark.reach + result.gain * unlit.reach)
    return Estimate(result.gain, error, off, off)


def _gain_spread(
    ordered: tuple[Condition, ...],
    signal: np.ndarray,
    color: str,
    found: Conditions,
    line: Dark,
) -> tuple[float, float]:
    """Return the standard error of the mean gain of this number of pixels and columns.

    Beside it the relative variance of the gains of these pixels.
    """
    half = int(np.argmin(abs(signal - 0.5 * signal.max())))
    parts = gain_variances(ordered[half], found.dark[0], color, float(signal[half]), line)
    pixel, column, slow = (max(part.value, 0.0) for part in parts)
    rows, columns = ordered[half].planes[color][0].average.shape
    planes = len(ordered[half].planes[color])
    variance = pixel / (rows * columns * planes) + column / columns
    return math.sqrt(variance), pixel + column + (slow if is_significant(parts[2]) else 0.0)


def gain_variances(
    lit: Condition, dark: Condition, color: str, signal: float, line: Dark
) -> tuple[Estimate, Estimate, Estimate]:
    """Return the relative variances of gains, eq 67 of EMVA 1288: of pixels, columns, slow ones.

    A gain is that of all electrons, the dark current's too: what the two stacks have of these
    counts as signal. That of the light alone would be short by their share.
    """
    bright, unlit = lit.patterns[color], dark.patterns[color]
    dim, light = (line.mean(stack.entry.exposure) for stack in (dark, lit))
    scale = 1 / ((signal + light) ** 2 - dim**2)
    return (
        (bright.pixel - unlit.pixel) * scale,
        (bright.column - unlit.column) * scale,
        (bright.slow - unlit.slow) * scale,
    )


def _dark_of(
    flat: Condition, dark: tuple[Condition, ...], color: str, line: Dark
) -> tuple[float, Estimate]:
    """Return mean and variance without light at the exposure time of a flat stack [DN, DN^2].

    From dark frames of the nearest time, their mean carried along the line.
    """
    near = _nearest(dark, flat.entry.exposure)
    moved = line.mean(flat.entry.exposure) - line.mean(near.entry.exposure)
    return near.mean(color).value + moved, near.variance(color)


def _nearest(dark: tuple[Condition, ...], seconds: float) -> Condition:
    return min(dark, key=lambda c: abs(math.log(c.entry.exposure / seconds)))


def pooled_gain(found: list[Transfer]) -> Estimate:
    """Return the system gain in the mean over colors and lights, weighted by their errors."""
    return _pooled([t.gain for t in found])


def _pooled(found: list[Estimate]) -> Estimate:
    """Return the mean of estimates of one number, weighted by their errors."""
    weights = np.array([1 / max(each.error, 1e-12) ** 2 for each in found])
    off = float(weights @ [each.reach for each in found] / weights.sum())
    value = float(weights @ [each.value for each in found] / weights.sum())
    return Estimate(value, float(weights.sum() ** -0.5), off, off)


def read_variance(
    dark: Condition, line: Dark, gain: Estimate, core: Estimate | None = None
) -> Estimate:
    """Return the variance of a pixel's readout [DN^2], without rounding and dark current's shot.

    core: variance of pixels without traps, where some have them.
    """
    found = core or combine([dark.variance(color) for color in dark.planes])
    shot = gain.value * line.mean(dark.entry.exposure)
    shot_error = (
        0.0 if line.current is None else (gain.value * line.current.error * dark.entry.exposure)
    )
    value, error = found.value - ROUNDING - shot, math.hypot(found.error, shot_error)
    if is_hidden(dark):
        # eq 54 states the limit as the value; all below it looks the same
        value = max(LIMIT, found.value - ROUNDING)
        high = max(plane.hidden[1] for planes in dark.planes.values() for plane in planes)
        return Estimate(value, 0.0, value, max(high**2 - value, 0.0))
    return replace(found, value=value, error=error)


def is_hidden(dark: Condition) -> bool:
    """Return whether rounding may hide all of the temporal noise of a dark stack."""
    return any(plane.is_hidden for planes in dark.planes.values() for plane in planes)


def readout_excess(dark: Condition, line: Dark, gain: Estimate) -> Estimate:
    """Return the excess kurtosis of a dark stack without that of the dark current's shot noise.

    The fourth cumulant of a Poisson number is its mean, K^4 times that in codes.
    """
    fourth = gain.value**3 * max(line.mean(dark.entry.exposure), 0.0)
    square = dark.every("pixel").value ** 2
    return dark.every("excess") - Estimate(fourth / square if square else 0.0, 0.0)
