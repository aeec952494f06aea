"""A bracket: exposures one after the other, and the one picture that they make.

Every exposure is a frame of its own. It begins where the one before ends, so that what moves has
moved on; its noise is its own, its fixed pattern the sensor's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.line_times import line_times
from vcam_cli.camera.exposure import Exposure
from vcam_cli.readout.bracketing import BracketExposure, photocurrent
from vcam_cli.simulation.frame import Frame
from vcam_cli.units import render

APART = 64
"""Bits from the seed of one exposure to that of the next: no other frame has them."""


def bracket_cameras(camera: Camera) -> tuple[Camera, ...]:
    """Return the camera of every exposure of a bracket, in the order of time.

    Parameters
    ----------
    camera : Camera
        A camera whose file has a bracket.
    """
    given, lines = camera.exposure, line_times(camera, geometry(camera))
    reference = given.reference
    if reference is None:  # where the first exposure has it, all others do
        reference = given.bracket[0] / 2 + lines.last / 2
    found = []
    for number, exposure in enumerate(given.exposures()):
        seed = camera.seed.model_copy(update={"frame": camera.seed.frame + (number << APART)})
        timed = exposure.with_derived(reference=reference)
        found.append(camera.model_copy(update={"exposure": timed, "seed": seed}))
    return tuple(found)


def longest_of(camera: Camera) -> int:
    """Return the index of the longest exposure of a bracket.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    int
        Index from 0.
    """
    bracket = camera.exposure.bracket
    return bracket.index(max(bracket))


def bracket_note(exposure: Exposure) -> str:
    """Return the note that a bracket is planned by its longest exposure.

    Parameters
    ----------
    exposure : Exposure
        Exposure with a bracket.

    Returns
    -------
    str
        Note for the user.
    """
    listed = ", ".join(render(time, "time") for time in exposure.bracket)
    longest = render(max(exposure.bracket), "time")
    return (
        f"a bracket of {listed}: effects, noise and cost are those of the exposure of {longest}"
        " alone"
    )


def merged_bracket(
    longest: Frame, frames: Sequence[Frame], exposure: Exposure, workers: int
) -> Frame:
    """Return the longest exposure of a bracket, with all of them and their photocurrent in it.

    Parameters
    ----------
    longest : Frame
        The longest exposure.
    frames : sequence of Frame
        All exposures, in the order of time.
    exposure : Exposure
        What the file says of the exposure.
    workers : int
        Number of threads; results do not depend on it.
    """
    exposures = [BracketExposure(frame.dn, frame.exposure_time, frame.chain) for frame in frames]
    seed = longest.solved.seed.model_copy(update={"frame": frames[0].solved.seed.frame})
    return replace(
        longest,
        solved=longest.solved.with_exposure(exposure).with_seed(seed),
        times=tuple(frame.exposure_time for frame in frames),
        samples_electrons=np.stack([frame.electrons for frame in frames]),
        samples_dn=np.stack([frame.dn for frame in frames]),
        photocurrent=photocurrent(exposures, exposure.merge, workers),
    )
