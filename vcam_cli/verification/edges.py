"""Frames of a slanted edge: how sharp they are, beside what a camera file with a lens predicts.

The camera looks at an edge of the measured angle and of the measured levels on both sides, so that
noise and rounding are those of the frames; its lens and pixels make the edge's profile.

References
----------
.. [1] ISO 12233:2017, Photography -- Electronic still picture imaging -- Resolution and spatial
   frequency responses, annex D (e-SFR).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli import units
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.quality.mtf import EdgeResponse, Lattice, slanted_edge_sfr
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare
from vcam_cli.sweeps.point_effects import with_every_effect
from vcam_cli.verification.frames import Stack, color_planes
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.prediction import of_readout
from vcam_cli.verification.stack_prediction import STACKS, Judged, compare, take_stack
from vcam_cli.verification.stack_quantities import Quantity

REACH = 16.0
"""Half the width of the window around the edge [pixels]."""
LOW, HIGH = 0.1, 0.9
"""Parts of the rise between which the profile's width is taken."""
MIDDLE = 0.25
"""Frequency at which the transfer is compared [cycles/pixel]."""


def edge_responses(frames: Array, measurement: Measurement) -> dict[str, list[EdgeResponse]]:
    """Return the response of the edge in every frame, color by color.

    Parameters
    ----------
    frames : Array
        Codes (n, rows, columns) [DN].
    measurement : Measurement
        Pitch and colors of the pixels.

    Raises
    ------
    ValueError
        No edge is found.
    """
    pixel = measurement.pixel
    assert pixel is not None
    assert pixel.width is not None
    pitch_x, pitch_y = pixel.width, pixel.height or pixel.width
    pitch = min(pitch_x, pitch_y)
    y, x = (np.arange(n) * p for n, p in zip(frames.shape[1:], (pitch_y, pitch_x), strict=True))
    found: dict[str, list[EdgeResponse]] = {}
    for color, places in color_planes(measurement).items():
        found[color] = []
        for frame in frames.astype(np.float64):
            lattices = [
                Lattice(frame[rows, columns], x[columns], y[rows]) for rows, columns in places
            ]
            found[color].append(slanted_edge_sfr(lattices, pitch, REACH * pitch))
    return found


def judge_edge(camera: Camera, stack: Stack, measurement: Measurement, number: int) -> list[Judged]:
    """Return the sharpness of an edge beside the prediction of a camera file with a lens.

    Parameters
    ----------
    camera : Camera
        The camera; its lens is focused as the file says.
    stack : Stack
        Measured frames.
    measurement : Measurement
        Pitch and colors of the pixels.
    number : int
        Number of the stack, which its seeds follow from.

    Raises
    ------
    BadInput
        The camera cannot be brought before an edge.
    ValueError
        No edge is found, in the measured frames or in those predicted.
    """
    measured = edge_responses(stack.frames, measurement)
    ready = _before_edge(camera, stack, measured, measurement.readout)
    predicted = []
    for turn in range(STACKS):
        frames = take_stack(ready, len(stack.frames), number * STACKS + turn)
        predicted.append(edge_responses(frames, measurement))
    found = []
    for color, responses in measured.items():
        channel = color if len(measured) > 1 else ""
        others = [_quantities(each[color]) for each in predicted]
        for place, quantity in enumerate(_quantities(responses)):
            found.append(compare(channel, quantity, [each[place] for each in others]))
    return found


def _quantities(responses: list[EdgeResponse]) -> list[Quantity]:
    """Return what frames of an edge are judged by, in the mean over the frames."""
    at = MIDDLE / responses[0].pitch
    listed = {
        "MTF50 [lp/mm]": [1e-3 * r.mtf50 for r in responses],
        f"MTF at {MIDDLE:g} c/px [1]": [
            float(np.interp(at, r.frequency, r.mtf)) for r in responses
        ],
        f"edge profile, {LOW:.0%} to {HIGH:.0%} [px]": [_width(r) for r in responses],
    }
    return [Quantity(name, float(np.mean(v)), float(np.mean(v))) for name, v in listed.items()]


def _levels(response: EdgeResponse) -> tuple[float, float]:
    """Return the mean codes of the dark and of the bright side [DN]."""
    profile, quarter = response.profile, len(response.profile) // 4
    ends = float(profile[:quarter].mean()), float(profile[-quarter:].mean())
    return min(ends), max(ends)


def _width(response: EdgeResponse) -> float:
    """Return the distance in which the profile rises [pixels]."""
    dark, bright = _levels(response)
    profile = (response.profile - dark) / (bright - dark)
    if profile[0] > profile[-1]:
        profile = profile[::-1]
    places = np.arange(len(profile)) * (response.distance[1] - response.distance[0])
    first = [int(np.argmax(profile >= part)) for part in (LOW, HIGH)]
    if 0 in first:
        raise ValueError("the edge is lost in noise")
    ends = [
        np.interp(part, profile[i - 1 : i + 1], places[i - 1 : i + 1])
        for i, part in zip(first, (LOW, HIGH), strict=True)
    ]
    return float(ends[1] - ends[0]) / response.pitch


def _before_edge(
    camera: Camera, stack: Stack, measured: dict[str, list[EdgeResponse]], readout: str
) -> Prepared:
    """Return the camera before an edge of the measured angle and levels, ready for frames."""
    first = next(iter(measured.values()))[0]
    slant = math.degrees(first.angle) % 180
    rows, columns = stack.frames.shape[1:]
    changes = {
        "scene.source": {"kind": "chart", "chart": "slanted-edge", "angle": f"{slant:.6g} deg"},
        "scene.extent": "sensor",
        "array": {"rows": rows, "columns": columns},
        "exposure": {"time": units.render(stack.entry.exposure, "time")},
        "quality": [],
        "output": {"render": "none"},
    }
    ready, _ = prepare(of_readout(with_every_effect(camera.with_(changes)), readout), 1)
    rate, dark = ready.rate.astype(np.float64), ready.dark_rate
    colors, gain = ready.mosaic.colors, ready.chain.system_gain
    for color, responses in measured.items():
        here = ... if len(colors) == 1 else ready.layout.color == colors.index(color)
        levels = np.mean([_levels(r) for r in responses], axis=0) - ready.electrical.offset
        wanted = levels / gain / ready.exposure_time - dark
        low, high = (float(np.quantile(rate[here], share)) for share in (0.05, 0.95))
        part = (rate[here] - low) / (high - low)
        rate[here] = np.maximum(wanted[0] + part * (wanted[1] - wanted[0]), 0)
    return replace(ready, rate=rate.astype(ready.rate.dtype))
