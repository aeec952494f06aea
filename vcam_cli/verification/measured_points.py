"""The mean signals of a measurement: those that it states, and the means of its raw frames."""

from __future__ import annotations

import itertools

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.lattice import places
from vcam_cli.errors import Collector
from vcam_cli.verification.frame_sets import FrameSet
from vcam_cli.verification.frames import Stack, color_block, numbered_stacks, paths, raise_if_any
from vcam_cli.verification.model import Measurement, Point, Signal

Points = list[tuple[int, Point]]
"""Number of an entry of the measurement, and a signal of it."""


def measured_points(camera: Camera, measurement: Measurement) -> tuple[Points, list[str]]:
    """Return all mean signals, in the order of the entries, and what the user is to be told.

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
    if not measurement.frame_sets:
        return points, []
    _check(camera, measurement)
    notes = [
        f"{measurement.label(number)}: frames of an edge are not predicted"
        for number, entry in enumerate(measurement.frames)
        if isinstance(entry, FrameSet) and entry.target == "slanted-edge"
    ]
    for number, stack in numbered_stacks(measurement, paths(measurement, held_out=True)):
        notes += stack.notes
        points += [(number, point) for point in _points(stack, measurement)]
    return sorted(points, key=lambda each: each[0]), notes


def _check(camera: Camera, measurement: Measurement) -> None:
    problems = Collector()
    assert measurement.levels is not None
    bits = measurement.levels.bits
    if bits != camera.adc.bits:
        message = f"the frames have {bits} bits, and the camera's ADC {camera.adc.bits}"
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
            problems.add(("frames", number), "how much light there is, is missing", remedy)
    raise_if_any(problems, measurement)


def colors(measurement: Measurement) -> set[str]:
    """Return the colors of the frames."""
    return set(itertools.chain(*color_block(measurement)))


def _points(stack: Stack, measurement: Measurement) -> list[Point]:
    entry, block = stack.entry, color_block(measurement)
    size = len(block), len(block[0])
    codes: dict[str, list[np.ndarray]] = {}
    for row, column in np.ndindex(size):
        codes.setdefault(block[row][column], []).append(stack.plane(row, column, size).ravel())
    return [
        Point.model_construct(
            name=entry.name,
            signal=Signal(float(np.concatenate(each).mean()), "dn"),
            channel=color if len(codes) > 1 else "",
            exposure=entry.exposure,
            light=entry.light,
            irradiance=entry.irradiance,
            photons=entry.photons,
        )
        for color, each in codes.items()
    ]
