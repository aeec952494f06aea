"""The mean signals of a measurement: those that it states, and the means of its raw frames."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.lattice import places
from vcam_cli.camera.derived.readouts import has_several
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import Collector
from vcam_cli.records import dataclass
from vcam_cli.verification import stack_quantities
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.frames import (
    Stack,
    color_block,
    color_planes,
    numbered_stacks,
    paths,
    raise_if_any,
)
from vcam_cli.verification.model import Measurement, Point, Signal

WINDOW = 256
"""Rows and columns in the middle of larger frames, whose noise is judged."""
Points = list[tuple[int, Point]]
"""Number of an entry of the measurement, and a signal of it."""


@dataclass(frozen=True)
class Taken:
    """Frames of an entry, for tests of their noise."""

    number: int
    """Of the entry."""
    point: Point
    """The conditions."""
    frames: Array
    """Codes in the middle (n, rows, columns) [DN]."""
    shape: tuple[int, int]
    """Rows and columns of the whole frames."""


def measured_points(
    camera: Camera, measurement: Measurement
) -> tuple[Points, list[Taken], list[str]]:
    """Return all mean signals, in the order of the entries, frames, and notes for the user.

    Of frames there is one signal a color, over the frames that are held out from fitting, or all
    of them where none are. Frames of edges have none.

    Parameters
    ----------
    camera : Camera
        The camera that predicts them.
    measurement : Measurement
        What was measured.

    Raises
    ------
    BadInput
        Frames cannot be read, are of another ADC than the camera's, or of light without a level.
    """
    points: Points = [
        (number, entry)
        for number, entry in enumerate(measurement.frames)
        if isinstance(entry, Point)
    ]
    taken: list[Taken] = []
    if not measurement.frame_sets:
        return points, taken, []
    _check(camera, measurement)
    notes: list[str] = []
    for number, stack in numbered_stacks(measurement, paths(measurement, held_out=True)):
        notes += stack.notes
        signals = _points(stack, measurement)
        points += [(number, point) for point in signals]
        inner, whole = middle(stack.frames, measurement), stack.frames.shape[1:]
        taken.append(Taken(number, signals[0], inner, (whole[0], whole[1])))
        if whole != inner.shape[1:] and len(taken) == 1:
            notes.append(f"noise is judged in the middle {WINDOW} x {WINDOW} pixels")
        if len(stack.frames) < 2:
            one = f"{stack.label}: one held-out frame does not determine temporal noise"
            notes.append(f"{one}, which is skipped; hold out more")
    return sorted(points, key=lambda each: each[0]), taken, notes


def middle(frames: Array, measurement: Measurement) -> Array:
    """Return the middle of frames, of whole blocks of the color filter array."""
    block = color_block(measurement)
    cuts = []
    for length, step in zip(frames.shape[1:], (len(block), len(block[0])), strict=True):
        kept = min(length, WINDOW) // step * step
        start = (length - kept) // 2 // step * step
        cuts.append(slice(start, start + kept))
    return frames[:, cuts[0], cuts[1]].copy()


def quantities_of_colors(
    measurement: Measurement, frames: Array
) -> dict[str, list[stack_quantities.Quantity]]:
    """Return what the middle of a stack is judged by, color by color; "" of the only one."""
    assert measurement.levels is not None
    frames = middle(frames, measurement)
    highest, planes = 2**measurement.levels.bits - 1, color_planes(measurement)
    found = {
        color: [stack_quantities.quantities(frames[:, *place], highest) for place in places]
        for color, places in planes.items()
    }
    return {
        color if len(planes) > 1 else "": stack_quantities.mean_of_planes(each)
        for color, each in found.items()
    }


def _check(camera: Camera, measurement: Measurement) -> None:
    problems = Collector()
    assert measurement.levels is not None
    bits, own = measurement.levels.bits, camera.adc.bits
    if has_several(camera) and not measurement.readout:
        own = electrical(camera).bits
    if bits != own:
        what = "ADC" if own == camera.adc.bits else "merged codes"
        message = f"the frames have {bits} bits, and the camera's {what} {own}"
        problems.add(("levels", "bits"), message, "correct one of them")
    taken, known = colors(measurement), set(camera.array.colors or places(camera).colors)
    if taken != known:
        message = (
            f"the frames have {', '.join(sorted(taken))}, the camera {', '.join(sorted(known))}"
        )
        problems.add(("pattern",), message, "correct one of them")
    for number, entry in enumerate(measurement.frames):
        if not isinstance(entry, FrameSet) or entry.light is None or entry.target != "flat":
            continue
        if entry.irradiance is None and entry.photons is None:
            remedy = "add irradiance: 0.12 W/m2, or photons: 4500"
            problems.add(("frames", number), "the amount of light is missing", remedy)
    raise_if_any(problems, measurement)


def colors(measurement: Measurement) -> set[str]:
    """Return the colors of the frames."""
    return set(color_planes(measurement))


def _points(stack: Stack, measurement: Measurement) -> list[Point]:
    entry = stack.entry
    codes = {
        color: np.concatenate([stack.frames[:, *place].ravel() for place in places])
        for color, places in color_planes(measurement).items()
    }
    return [
        Point.model_construct(
            name=entry.name,
            signal=Signal(float(each.mean()), "dn"),
            channel=color if len(codes) > 1 else "",
            exposure=entry.exposure,
            light=entry.light,
            irradiance=entry.irradiance,
            photons=entry.photons,
            temperature=entry.temperature,
        )
        for color, each in codes.items()
    ]
