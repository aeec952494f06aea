"""`vcam fit`: a camera file from raw frames, every number with its interval.

measurement file -> frames (`frames`) -> statistics of each stack (`conditions`, `statistics`)
-> gain, noise, pattern, range (`sensor`) sharpness (`edge`) -> parameters and camera (here)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import Collector, bad
from vcam_cli.fitting import camera_file, edge, sensor
from vcam_cli.fitting.conditions import (
    CLIPPED,
    Condition,
    Conditions,
    alien_columns,
    measure,
    shared,
    usual_temperature,
)
from vcam_cli.fitting.light_check import check_light
from vcam_cli.fitting.noise_shape import is_significant, neighbor_correlation, tail_shape
from vcam_cli.fitting.parameters import SIGMAS, Parameter, deviation, parameter
from vcam_cli.fitting.pattern import CYCLES
from vcam_cli.fitting.result import Fit
from vcam_cli.fitting.traps import LEAST_FRAMES, Traps, find_traps
from vcam_cli.progress import Observer, Silent
from vcam_cli.quality.mtf import EdgeResponse
from vcam_cli.verification.edges import edge_responses
from vcam_cli.verification.frame_files import readouts_in
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.frames import color_block, paths, raise_if_any, stacks
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import Estimate, combine

NEAR = 0.15
"""How far from half of saturation a stack may be that tells the spread of gains."""


def fit(measurement: Measurement, watch: Observer | None = None) -> Fit:
    """Estimate a sensor from its frames.

    Parameters
    ----------
    measurement : Measurement
        Files and conditions. Dark frames are needed, and flat frames of three levels or more.
    watch : Observer, optional
        Told of the progress.

    Returns
    -------
    Fit
        Parameters, notes, unknown quantities, and the camera file.

    Raises
    ------
    BadInput
        Frames are missing or unusable, or too few to tell the gain.
    """
    _check(measurement)
    out = Fit(measurement)
    found = measure(measurement, watch or Silent())
    out.notes += found.notes
    check_light(found, measurement)
    line = sensor.dark_line(found.dark)
    curves, against = sensor.transfers(found, measurement, line)
    out.notes += against
    if not curves:
        message = "; ".join(against) or "there are no flat frames"
        remedy = "add flat frames at five levels or more, and dark frames of the same exposure time"
        raise bad("frames", message, remedy).with_places(measurement.locate)
    gain = sensor.pooled_gain(curves)
    _of_dark(out, found, line, gain)
    _of_gain(out, curves, gain)
    _of_patterns(out, found, curves, line, gain)
    _of_range(out, curves, sensor.black_levels(found.dark, line), gain)
    _of_edge(out, measurement)
    out.dark, out.line, out.curves = found.dark, line, curves
    out.camera = camera_file.tree(out, found, curves)
    return out


def _check(measurement: Measurement) -> None:
    """Raise BadInput where a key is missing, or the frames of a kind."""
    problems = Collector()
    if measurement.levels is None:
        problems.add("levels", "the ADC's bits are missing", "add levels: {bits: 12}")
    if measurement.pixel is None:
        problems.add("pixel", "the size of the pixels is missing", "add pixel: {width: 3.45 um}")
    usual = usual_temperature(measurement)
    for number, entry in enumerate(measurement.frames):
        if not isinstance(entry, FrameSet) or entry.temperature in (None, usual):
            continue
        where = ("frames", number, "temperature")
        if usual is None:
            message = "the flat frames give no temperature"
            problems.add(where, message, "give temperature to one of them, too")
        elif not entry.is_dark:
            message = "flat frames are fitted at one temperature"
            problems.add(where, message, "leave the others out")
    if not any(e.is_dark and e.temperature in (None, usual) for e in measurement.frame_sets):
        remedy = "add {files: dark_*.tif, exposure: 10 ms, light: none}"
        problems.add("frames", "there are no dark frames", remedy)
    raise_if_any(problems, measurement)
    several = {name for pages in paths(measurement).values() for name in readouts_in(pages[0])}
    if several and not measurement.readout:
        listed = sorted(several)
        message = f"the frames hold merged codes, of {', '.join(listed)}: no one photon transfer"
        remedy = f"add readout: {listed[0]}, and fit the others likewise"
        raise bad("levels", message, remedy).with_places(measurement.locate)


def _of_dark(out: Fit, found: Conditions, line: sensor.Dark, gain: Estimate) -> None:
    first = found.dark[0]
    add = out.parameters.append
    method = "mean of dark frames at no exposure time"
    levels = sensor.black_levels(found.dark, line)
    for color, each in levels.items():
        add(parameter(f"black_level.{color}" if color else "black_level", each, "DN", method))
    if len(levels) > 1:
        listed = ", ".join(f"{color} {each.value:.2f}" for color, each in levels.items())
        out.notes.append(f"the black level differs from color to color: {listed} DN")
    stated = out.measurement.levels.black if out.measurement.levels else None
    for each in levels.values():
        if stated is not None and abs(stated - each.value) > 5 * each.error + 0.5:
            out.notes.append(f"levels.black is {stated:g}, but dark frames have {each.value:.2f}")
    if first.at_zero > CLIPPED:
        clipped = f"{first.label}: {first.at_zero:.1%} of the dark codes are clipped at 0"
        out.notes.append(f"{clipped}, which biases read noise and black level")
    if line.current is None:
        out.unknown.append("dark current: all dark frames have one exposure time; it is part of"
                           " black level and read noise")  # fmt: skip
    else:
        current = line.current / gain
        add(parameter("dark_current", current, "e/s", "EMVA 1288 R4 eq 57, slope of the means"))
    hidden = sensor.is_hidden(first)
    traps = None if hidden else find_traps(list(first.moments))
    _of_temperature(out, found, line, gain)
    read = sensor.read_variance(first, line, gain, traps.core if traps else None)
    method = (
        "EMVA 1288 R4 eq 53, without rounding and shot noise of the dark current, of pixels by"
        " themselves"
    )
    if hidden:
        method = "EMVA 1288 R4 eq 54, upper limit: rounding hides smaller noise"
        out.notes.append(
            "quantization masks the read noise: its upper limit by EMVA 1288 eq 54 is written, and "
            "the intervals of dark current, black level and dark patterns include the quantization "
            "error. Raise the gain or the bits to measure them"
        )
        out.unknown.append("tails, traps and row correlation of the noise: rounding hides them")
    add(deviation("read_noise", read, gain, "e", method))
    rows_apart = len(color_block(out.measurement))
    lag_one, excess = first.every("row_correlation"), sensor.readout_excess(first, line, gain)
    r = lag_one.value if is_significant(lag_one) else 0.0
    bands = ((1 + r**2) / (1 - min(r, 0.999) ** 2)) ** 0.5  # Bartlett: rows that tell the same
    for name, wider in (("row", bands), ("column", 1.0)):
        variance = first.lines(name)
        method = f"temporal variance of {name} means less the pixels' share"
        told = replace(variance, error=variance.error * wider)
        add(deviation(f"{name}_noise", told, gain, "e", method))
    if r:
        reach = SIGMAS * lag_one.error
        value, low, high = (
            neighbor_correlation(lag, rows_apart) for lag in (r, r - reach, r + reach)
        )
        method = "of neighboring rows, from their means"
        add(Parameter("row_correlation", value, low, high, "1", method))
    if traps is not None:
        _of_traps(out, traps, gain)
    elif is_significant(excess):
        lines = sum(max(first.lines(name).value, 0.0) for name in ("row", "column"))
        dark = max(line.mean(first.entry.exposure) / gain.value, 0.0)
        shape = tail_shape(_all_differences(first), lines, dark, gain.value)
        method = "Tukey's lambda, maximum likelihood of differences of dark frames; jackknife"
        add(parameter("read_noise_shape", shape, "1", method))
        if first.moments[0].frames < LEAST_FRAMES:
            out.notes.append(
                "read noise has heavy tails; more dark frames are needed to separate tails of"
                " all pixels from a few pixels with traps"
            )


def _all_differences(dark: Condition) -> Array:
    """Return how often pixels of all planes differ by a number of codes (groups, codes)."""
    most = max(counts.shape[1] for counts in dark.differences)
    total = np.zeros((max(len(counts) for counts in dark.differences), most))
    for counts in dark.differences:
        total[: len(counts), : counts.shape[1]] += counts
    return total


def _of_temperature(out: Fit, found: Conditions, line: sensor.Dark, gain: Estimate) -> None:
    """Add how dark current rises with temperature, where dark frames of others tell it."""
    usual = usual_temperature(out.measurement)
    if not found.warm or usual is None:
        return
    told = sensor.doubling(found.warm, line, usual)
    if told is None:
        out.unknown.append("dark current over temperature: dark frames of two exposure times are"
                           " needed at two temperatures, beyond their noise")  # fmt: skip
        return
    out.parameters.append(
        parameter("dark_current_doubling", told, "K", "straight line of ln(dark current) over T")
    )


def _of_traps(out: Fit, traps: Traps, gain: Estimate) -> None:
    add = out.parameters.append
    method = "maximum likelihood of the pixels' variances, shortest dark frames"
    add(parameter("telegraph_fraction", traps.fraction, "1", method))
    add(parameter("telegraph_amplitude", traps.amplitude / gain, "e", f"mean step, {method}"))
    told = parameter("telegraph_occupancy", traps.occupancy, "1", method)
    add(replace(told, low=max(told.low, 0.0), high=min(told.high, 1.0)))


def _of_gain(out: Fit, curves: list[sensor.Transfer], gain: Estimate) -> None:
    add = out.parameters.append
    add(parameter("system_gain", gain, "DN/e", "EMVA 1288 R4 eq 50, variance over mean"))
    for curve in curves:
        out.notes += curve.bends
        where = f"{curve.color}, {curve.light}"
        if curve.efficiency is None:
            out.unknown.append(f"quantum efficiency of {where}: no photons or irradiance given")
        else:
            method = f"EMVA 1288 R4 eq 52, whole pixel, {curve.light}"
            add(parameter(f"quantum_efficiency.{curve.color}", curve.efficiency, "1", method))
        if curve.linearity_error is not None:
            error = curve.linearity_error
            method = f"EMVA 1288 R4 eq 63, {curve.light}; no interval"
            add(Parameter(f"linearity_error.{curve.color}", error, error, error, "1", method))


def _of_patterns(
    out: Fit, found: Conditions, curves: list[sensor.Transfer], line: sensor.Dark, gain: Estimate
) -> None:
    add = out.parameters.append
    first = found.dark[0]
    dark = list(first.patterns.values())
    lines = (first.planes_in_line, found.shape[1] - 1)
    for name in ("pixel", "column", "total"):
        variance = combine([getattr(pattern, name) for pattern in dark])
        variance = shared(variance, *lines) if name == "column" else variance
        key = "dsnu" if name == "total" else f"offset_{name}"
        add(deviation(key, variance, gain, "e", "EMVA 1288 R4 eq 66, of dark frames"))
    chosen = [_near_half(curve, found, line) for curve in curves]
    gains = [
        _gain_variances(curve, i, found, line) for curve, i in zip(curves, chosen, strict=True)
    ]
    lights = len({curve.light for curve in curves})  # all of them show the same gains
    # The residual noise of a mean frame counts less, relative to gains, the brighter it is.
    weights = [
        float(curve.result.series.signal[i]) ** 2 for curve, i in zip(curves, chosen, strict=True)
    ]
    for number, name in enumerate(("gain_pixel", "gain_column")):
        variance = combine([each[number] for each in gains], weights)
        variance = replace(variance, error=variance.error * lights**0.5)
        variance = shared(variance, *lines) if name == "gain_column" else variance
        bent = max(variance.value, 0.0) * ((1 + max(curve.bend for curve in curves)) ** 2 - 1)
        variance = replace(variance, below=variance.below + bent, above=variance.above + bent)
        one = Estimate(1.0, 0.0)
        add(deviation(name, variance, one, "1", "EMVA 1288 R4 eq 67, near half of saturation"))
    lit = [(curve.conditions[i], curve.color) for curve, i in zip(curves, chosen, strict=True)]
    out.notes += alien_columns([*((first, color) for color in first.patterns), *lit])
    # Columns are most of what makes the slow part uncertain, and planes of a mosaic share them.
    alike = first.planes_in_line**0.5
    slow_dark = combine([pattern.slow for pattern in dark])
    slow_dark = replace(slow_dark, error=slow_dark.error * alike)
    slow_gain = combine([each[2] for each in gains], weights)
    slow_gain = replace(slow_gain, error=slow_gain.error * alike * lights**0.5)
    slow = {
        "shading_offset": (slow_dark, gain, "e"),
        "shading_gain": (slow_gain, Estimate(1.0, 0.0), "1"),
    }
    method = f"of cosines up to {CYCLES} cycles over the array"
    for key, (variance, scale, unit) in slow.items():
        if is_significant(variance):
            add(deviation(key, variance, scale, unit, method))
    if is_significant(slow["shading_gain"][0]):
        out.notes.append(
            "flat frames are not uniform: shading of the lamp, a lens and the pixels cannot be"
            " separated in them; all of it is written as shading of the pixels' gains"
        )
    defects, whole = found.defects, found.shape[0] * found.shape[1]
    for name, mask, n in (
        ("hot", defects.hot, whole),
        ("dead", defects.dead, int(defects.judged.sum())),
    ):
        if not n:
            out.unknown.append(f"{name} pixels: no flat frames are bright enough")
            continue
        share = float(mask.sum()) / n
        center = (share + SIGMAS**2 / (2 * n)) / (1 + SIGMAS**2 / n)
        reach = (
            SIGMAS / (1 + SIGMAS**2 / n) * ((share * (1 - share) + SIGMAS**2 / (4 * n)) / n) ** 0.5
        )
        ends = max(center - reach, 0.0) if share else 0.0, center + reach
        told = Parameter(name, share, *ends, "1", f"share of {n} pixels, Wilson's interval")
        add(told)


def _gain_variances(
    curve: sensor.Transfer, i: int, found: Conditions, line: sensor.Dark
) -> tuple[Estimate, Estimate, Estimate]:
    """Return the variances of gains from a stack of a photon transfer."""
    signal = float(curve.result.series.signal[i])
    return sensor.gain_variances(curve.conditions[i], found.dark[0], curve.color, signal, line)


def _near_half(curve: sensor.Transfer, found: Conditions, line: sensor.Dark) -> int:
    """Return the number of the stack near half of saturation that tells most of gains."""
    signal = curve.result.series.signal
    part = signal / signal[curve.result.series.saturation_index]
    near = np.flatnonzero(abs(part - 0.5) <= max(NEAR, float(abs(part - 0.5).min()))).tolist()
    return int(min(near, key=lambda i: _gain_variances(curve, i, found, line)[0].error))


def _of_range(
    out: Fit, curves: list[sensor.Transfer], black: dict[str, Estimate], gain: Estimate
) -> None:
    full = [curve for curve in curves if curve.saturated is not None]
    if not full:
        out.unknown.append("full well: no flat frames are saturated; it is set where the ADC is"
                           " full")  # fmt: skip
        return
    levels = []
    for curve in full:
        assert curve.saturated is not None
        mean = curve.saturated.mean(curve.color)
        if curve.saturated.at_most[curve.color] > 0.5:
            out.unknown.append("full well: the ADC is full before the pixel is")
            return
        code = replace(mean, error=max(mean.error, 12**-0.5))  # rounding of one code
        levels.append(code - (black.get(curve.color) or black[""]))
    well = combine(levels) / gain
    out.parameters.append(parameter("full_well", well, "e", "mean of saturated frames over K"))


def _of_edge(out: Fit, measurement: Measurement) -> None:
    tell: Callable[[str], None] = out.unknown.append
    edges = [stack for stack in stacks(measurement) if stack.entry.target == "slanted-edge"]
    if not edges:
        tell("sharpness: needs frames of an edge")
    seen: list[EdgeResponse] = []
    for stack in edges:
        try:
            found = edge_responses(stack.frames, measurement)
        except ValueError as error:
            tell(f"sharpness, {stack.label}: {error}")
            continue
        for color, responses in found.items():
            seen += responses
            value = edge.mtf50(responses)
            if value is None:
                tell(f"MTF50 of {color}: two frames of an edge at least, sharp enough, are needed")
                continue
            method = "ISO 12233 e-SFR, mean over the frames"
            out.parameters.append(parameter(f"mtf50.{color}", value * 1e-3, "lp/mm", method))
    if seen:
        out.lens = edge.lens_transfer(seen, measurement)
        if measurement.optics is None:
            tell("the lens of the edge: the measurement gives no optics (f_number, focal_length),"
                 " the camera is a bare sensor; mtf.csv is for its optics.mtf")  # fmt: skip
