"""The statistics of all stacks of a measurement, color by color, and which pixels are defective."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.fitting.noise_shape import difference_counts
from vcam_cli.fitting.pattern import Pattern, pattern
from vcam_cli.fitting.traps import PixelMoments, pixel_moments
from vcam_cli.progress import Observer
from vcam_cli.records import dataclass
from vcam_cli.spectra import integral, photons
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.frames import color_planes, stacks
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import (
    Estimate,
    StackStatistics,
    combine,
    stack_statistics,
)

DEAD, HOT = 0.1, 0.5
"""Signal of a dead pixel, over the others' in light, is less; that of a hot one, over saturation in
the dark, is more."""
LEAST_LIGHT = 0.1
"""Signal of a color, over saturation, in which its dead pixels are found."""
CLIPPED = 0.005
"""Share of pixels at the ends of the codes above which a stack counts as clipped (EMVA 1288)."""
DRIFT = 0.01
"""Relative change of the light within a stack from which it is said."""
BAND = 300e-9, 1100e-9
"""Wavelengths over which a lamp's photons are counted [m]."""


@dataclass(frozen=True)
class Condition:
    """A stack of flat or dark frames, color by color."""

    entry: FrameSet
    label: str
    planes: dict[str, tuple[StackStatistics, ...]]
    """Color -> statistics of each of its places in the block."""
    patterns: dict[str, Pattern]
    at_zero: float
    """Share of the codes that are 0."""
    at_most: dict[str, float]
    """Color -> share of its codes that are the highest."""
    moments: tuple[PixelMoments, ...] = ()
    """Of the pixels of each plane, of the dark frames of the shortest exposure time."""
    differences: tuple[Array, ...] = ()
    """Of each plane of these, how often pixels differ by a number of codes (groups, codes)."""

    def mean(self, color: str) -> Estimate:
        """Return the mean of a color [DN]."""
        return combine([plane.mean for plane in self.planes[color]])

    def variance(self, color: str) -> Estimate:
        """Return the temporal variance of a color's pixels by themselves [DN^2]."""
        return combine([plane.pixel for plane in self.planes[color]])

    def every(self, name: str) -> Estimate:
        """Return a statistic in the mean over all planes."""
        listed = [plane for planes in self.planes.values() for plane in planes]
        return combine([getattr(plane, name) for plane in listed])

    def lines(self, name: str) -> Estimate:
        """Return the temporal variance of rows or columns in the mean over all planes."""
        first = next(iter(self.planes.values()))[0]
        lines = first.average.shape[0 if name == "row" else 1] * self.planes_in_line
        return shared(self.every(name), self.planes_in_line, (first.frames - 1) * (lines - 1))

    @property
    def planes_in_line(self) -> int:
        """Number of planes that have pixels in one row, or column, of the array."""
        return math.isqrt(sum(map(len, self.planes.values())))


def shared(found: Estimate, planes: int, freedom: int) -> Estimate:
    """Return the variance of lines in the mean over `planes` planes that share each line.

    What a line has of its own is the same in all of these: its error is that of the array's lines,
    however many planes there are. What the pixels add is independent.
    """
    own = max(found.value, 0.0) * math.sqrt(2 / max(freedom, 1))
    return replace(found, error=math.hypot(found.error, own * math.sqrt(1 - 1 / planes)))


@dataclass(frozen=True)
class Defects:
    """Pixels that do not work, each (rows, columns)."""

    hot: Array
    dead: Array
    judged: Array
    """Pixels that some light is bright enough for to tell whether they are dead."""

    @property
    def good(self) -> Array:
        """The pixels that work."""
        return ~(self.hot | self.dead)


@dataclass(frozen=True)
class Conditions:
    """All stacks of a measurement."""

    dark: tuple[Condition, ...]
    """By exposure time."""
    warm: tuple[Condition, ...]
    """Dark frames at other temperatures than that of the flat frames."""
    flat: tuple[Condition, ...]
    defects: Defects
    shape: tuple[int, int]
    notes: tuple[str, ...]

    @property
    def colors(self) -> tuple[str, ...]:
        """The colors of the array."""
        return tuple(self.dark[0].planes)


def measure(measurement: Measurement, watch: Observer) -> Conditions:
    """Return the statistics of all dark and flat stacks.

    The files are read twice: what pixels are defective has to be known before variances are.

    Raises BadInput where a file is no frame.
    """
    assert measurement.levels is not None
    highest = 2**measurement.levels.bits - 1
    averages: list[tuple[FrameSet, Array]] = []
    notes: list[str] = []
    for stack in stacks(measurement):
        if stack.entry.target == "flat":
            averages.append((stack.entry, stack.frames.mean(axis=0)))
        notes += stack.notes
        if stack.drift > DRIFT and not stack.entry.is_dark:
            notes.append(
                f"{stack.label}: the light drifts by {stack.drift:.1%}, which is corrected"
            )
    usual = usual_temperature(measurement)
    here = [(entry, mean) for entry, mean in averages if entry.temperature in (None, usual)]
    defects = _defects(here, highest, measurement)
    good = defects.good
    found: list[Condition] = []
    flats = len(averages)
    shortest = min(entry.exposure for entry, _ in here if entry.is_dark)
    for stack in stacks(measurement):
        if stack.entry.target == "flat":
            watch.step(len(found), flats)
            condition = _condition(stack.entry, stack.label, stack.frames, good, measurement)
            is_usual = stack.entry.temperature in (None, usual)
            if stack.entry.is_dark and is_usual and stack.entry.exposure == shortest:
                places = [p for each in color_planes(measurement).values() for p in each]
                planes = [(stack.frames[:, *p], good[p]) for p in places]
                condition = replace(
                    condition,
                    moments=tuple(pixel_moments(*plane) for plane in planes),
                    differences=tuple(difference_counts(*plane) for plane in planes),
                )
            found.append(condition)
    dark = sorted((c for c in found if c.entry.is_dark), key=lambda c: c.entry.exposure)
    return Conditions(
        tuple(c for c in dark if c.entry.temperature in (None, usual)),
        tuple(c for c in dark if c.entry.temperature not in (None, usual)),
        tuple(c for c in found if not c.entry.is_dark),
        defects,
        good.shape,
        tuple(notes),
    )


def usual_temperature(measurement: Measurement) -> float | None:
    """Return the temperature of the flat frames [K]; None where they give none."""
    flats = (e for e in measurement.frame_sets if e.target == "flat" and not e.is_dark)
    return next((e.temperature for e in flats if e.temperature is not None), None)


def _defects(
    averages: Iterable[tuple[FrameSet, Array]], highest: int, measurement: Measurement
) -> Defects:
    """Return which pixels do not work, each beside the others of its color."""
    listed = list(averages)
    dark = [(entry.exposure, mean) for entry, mean in listed if entry.is_dark]
    unlit = min(dark, key=lambda each: each[0])[1]
    black = float(np.median(unlit))
    places = [place for each in color_planes(measurement).values() for place in each]
    full = max(float(np.median(mean[place])) for _, mean in listed for place in places) - black
    hot = unlit > black + HOT * full
    dead, judged = np.zeros(unlit.shape, bool), np.zeros(unlit.shape, bool)
    lit = [mean - black for entry, mean in listed if not entry.is_dark]
    if not lit or full < 0.05 * highest:
        return Defects(hot, dead, judged)
    for place in places:
        light = max((mean[place] for mean in lit), key=np.median)
        usual = float(np.median(light))
        if usual > LEAST_LIGHT * full:
            judged[place] = True
            dead[place] = light < DEAD * usual
    return Defects(hot, dead, judged)


def _condition(
    entry: FrameSet, label: str, frames: Array, good: Array, measurement: Measurement
) -> Condition:
    assert measurement.levels is not None
    highest = 2**measurement.levels.bits - 1
    planes: dict[str, tuple[StackStatistics, ...]] = {}
    patterns: dict[str, Pattern] = {}
    at_most: dict[str, float] = {}
    for color, places in color_planes(measurement).items():
        planes[color] = tuple(stack_statistics(frames[:, *place], good[place]) for place in places)
        told = zip(planes[color], places, strict=True)
        found = [pattern(plane, good[place]) for plane, place in told]
        patterns[color] = _mean_pattern(found, [columns for _, columns in places])
        full = [float(np.mean(frames[:, *p][:, good[p]] == highest)) for p in places]
        at_most[color] = float(np.mean(full))
    return Condition(
        entry,
        label,
        planes,
        patterns,
        float(np.mean(frames[:, good] == 0)),
        at_most,
    )


def alien_columns(listed: list[tuple[Condition, str]]) -> list[str]:
    """Return what is said of columns unlike all others, stack by stack: (stack, color), ..."""
    notes = []
    for stack in {id(stack): stack for stack, _ in listed}.values():
        seen = [stack.patterns[color] for each, color in listed if each is stack]
        numbers = sorted({number for pattern in seen for number in pattern.alien})
        if numbers:
            largest = max((pattern.largest for pattern in seen), key=abs)
            notes.append(
                f"{stack.label}: columns {_ranges(numbers)} are unlike the others, by up to"
                f" {largest:+.3g} DN; they count in no spread of columns, and the camera file has"
                " no place for them"
            )
    return notes


def _ranges(numbers: list[int]) -> str:
    """Return rising numbers in words: 0 to 9, 312."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ", ".join(f"{p[0]}" if len(p) == 1 else f"{p[0]} to {p[-1]}" for p in parts)


def _mean_pattern(patterns: list[Pattern], columns: list[slice]) -> Pattern:
    """Return the mean over planes, which have these columns of the array."""
    names = ("total", "pixel", "column", "row", "slow")
    alien = {
        (place.start or 0) + column * (place.step or 1)
        for each, place in zip(patterns, columns, strict=True)
        for column in each.alien
    }
    every = {name: combine([getattr(p, name) for p in patterns]) for name in names}
    largest = max((p.largest for p in patterns), key=abs)
    return Pattern(**every, alien=tuple(sorted(alien)), largest=largest)


def photons_per_pixel(entry: FrameSet, measurement: Measurement) -> float | None:
    """Return the photons on the whole area of a pixel in the exposure; None where not known."""
    if entry.photons is not None:
        return entry.photons
    if entry.irradiance is None or entry.light is None or measurement.pixel is None:
        return None
    pixel = measurement.pixel
    assert pixel.width is not None
    area = pixel.width * (pixel.height or pixel.width)
    lamp = entry.light.resolve()
    per_joule = integral(photons(lamp), *BAND) / integral(lamp, *BAND)
    return entry.irradiance * area * entry.exposure * per_joule
