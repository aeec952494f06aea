"""Frames one after the other: each with noise of its own, all with the same sensor.

A frame is a camera whose exposure begins later and whose frame seed is another: what moves has
moved on, and a lamp that flickers is at another phase. An automatic exposure follows from frame to
frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.line_times import line_times
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import Retention
from vcam_cli.errors import bad
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.images.png import write_png
from vcam_cli.files.images.video import VideoWriter, ffmpeg
from vcam_cli.files.tables import write_table
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.progress import Observer
from vcam_cli.simulation import cost_model, exposure_control
from vcam_cli.simulation.output import outputs
from vcam_cli.simulation.planned import PlannedRun
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.solve.idle_keys import sequence_notes
from vcam_cli.solve.solved import solve
from vcam_cli.units import render

NO_VIDEO = (
    "no sequence.mp4 is written, since there is no ffmpeg on the PATH; frames/render_*.png and"
    " strip.png show the sequence"
)
LIGHT = 1 << 24
"""Bytes of light that are kept of what stands still, which has one light, or a few where exposures
of a bracket overexpose it. Of what moves only the last is: it is never seen in that light again."""
STRIP = 8
"""Frames of a strip, at most."""
STRIP_WIDTH = 240
"""Columns of each of them, at most."""


def frame_cameras(camera: Camera, count: int, rate: float) -> Iterator[Camera]:
    """Yield the camera of every frame of a sequence.

    Parameters
    ----------
    camera : Camera
        The camera of the first frame.
    count : int
        Number of frames.
    rate : float
        Frames per second [Hz].

    Raises
    ------
    BadInput
        For exposures that do not fit between frames.
    """
    _require_room(camera, rate)
    exposure, seed = camera.exposure, camera.seed
    for number in range(count):
        later = exposure.model_copy(update={"start": exposure.start + number / rate})
        drawn = seed.model_copy(update={"frame": seed.frame + number})
        yield camera.model_copy(update={"exposure": later, "seed": drawn})


def _require_room(camera: Camera, rate: float) -> None:
    auto, last = camera.exposure.auto, line_times(camera, geometry(camera)).line_time
    longest = auto.max if auto is not None else camera.exposure.longest
    if camera.exposure.bracket:
        longest = sum(camera.exposure.bracket)
    assert longest is not None
    if longest + last > (1 + 1e-9) / rate:
        key = "auto.max" if auto is not None else "time"
        for several in ("captures", "bracket"):
            key = several if getattr(camera.exposure, several) else key
        raise bad(
            f"exposure.{key}",
            f"{render(longest, 'time')} do not fit {rate:g} frames a second",
            f"make it shorter than {render(float(f'{1 / rate - last:.3g}'), 'time')},"
            " or --fps lower",
        )


def frames(
    camera: Camera,
    count: int,
    rate: float,
    workers: int | None,
    watch: Observer,
    device: str = "cpu",
) -> Iterator[tuple[Camera, Result]]:
    """Yield the camera of every frame of a sequence, and what it takes.

    An automatic exposure follows: the first frame is exposed for its own scene, in the mean light
    of its lamp, every other by what the one before metered (`exposure_control`).

    Parameters
    ----------
    camera, count, rate
        As those of `frame_cameras`.
    workers : int or None
        Number of threads; results do not depend on it.
    watch : Observer
        Observer of stages.
    device : str, optional
        As that of `simulate`.
    """
    settings, reference = None, camera.exposure.reference
    shared = Shared(RateCache(0 if camera.scene.moves else LIGHT))
    solved = solve(camera)
    lags, before = bool(of_kind(solved.effects.enabled, Retention)), None
    for each in frame_cameras(camera, count, rate):
        if settings is not None:
            each = exposure_control.set_exposure(each, settings)
            timed = each.exposure.model_copy(update={"reference": reference})
            each = each.model_copy(update={"exposure": timed})
        result = simulate(each, workers, watch, shared, device, before)
        if camera.exposure.auto is not None:
            if reference is None:  # where the first frame has it, all others do
                reference = result.exposure_time / 2 + solved.lines.last / 2
            settings = exposure_control.next_exposure(solved, result.frame)
        yield each, result
        # What is not read again is not held beside the next frame.
        before = result if lags else None
        del result


def planned_seconds(planned: PlannedRun, count: int) -> tuple[float, float]:
    """Return the estimated time of a sequence, and that of each frame after the first.

    What stands still has one light for all frames; of what moves an automatic exposure meters the
    first frame alone.

    Parameters
    ----------
    planned : PlannedRun
        Plan of the first frame.
    count : int
        Number of frames.

    Returns
    -------
    whole, later : float
        Seconds on this machine.
    """
    ready = planned.ready
    light = cost_model.light_seconds(ready.layout, ready.spectrum, planned.workers)
    first, scene = ready.plan.seconds, ready.solved.scene
    once = not scene.moves or ready.solved.exposure.is_timed_by_scene
    later = max(first - light, 0.0) if once else first
    return first + (count - 1) * later, later


def planned_memory(first: PlannedRun, last: PlannedRun) -> int:
    """Return the estimated memory of a sequence: the larger of that of its ends.

    Parameters
    ----------
    first, last : PlannedRun
        Plans of the first frame, and of the last; the same where all see the same light.

    Returns
    -------
    int
        Memory [bytes], without the pictures that are held of the first frame.
    """
    ends = (each.ready.plan.memory_bytes for each in (first, last))
    return max(ends) + memory_model.LATER


def write_sequence(
    camera: Camera,
    count: int,
    rate: float,
    folder: OutputFolder,
    workers: int | None,
    watch: Observer,
    device: str = "cpu",
) -> tuple[Result, int]:
    """Write frames/raw_0001.exr, frames/render_0001.png and so on, frames.csv and strip.png.

    Where ffmpeg is installed sequence.mp4 shows the renders, too.

    Parameters
    ----------
    camera, count, rate
        As those of `frame_cameras`.
    folder : OutputFolder
        Folder that they go to.
    workers : int or None
        Number of threads; results do not depend on it.
    watch : Observer
        Observer of stages.
    device : str, optional
        As that of `simulate`.

    Returns
    -------
    first : Result
        The first frame, with a note where there is no video.
    needed : int
        Largest estimated memory of a frame, beside what is held of the first [bytes].
    """
    rows, shown, needed = list[tuple[float, ...]](), list[Array](), 0
    chosen = set(np.linspace(0, count - 1, min(count, STRIP)).round().astype(int).tolist())
    first: Result | None = None
    program = ffmpeg()
    with ExitStack() as stack:
        video: VideoWriter | None = None
        for each, result in frames(camera, count, rate, workers, watch, device):
            number = len(rows)  # `enumerate` would hold a frame beside the next one
            if first is None:
                missing = bool(camera.output.render) and program is None
                told = sequence_notes(result.remarks) + ((NO_VIDEO,) if missing else ())
                result = first = replace(result, remarks=told)
            # Later frames begin with all libraries, and beside what is held of the first.
            held = 0 if result is first else first.nbytes + memory_model.LATER
            needed = max(needed, result.frame.plan.memory_bytes + held)
            name = f"{number + 1:04d}"
            outputs.write_raw(result, folder.new(f"frames/raw_{name}.exr"))
            if camera.output.render:
                render = result.render
                outputs.write_render(result, folder.new(f"frames/render_{name}.png"), render)
                if program is not None:
                    if video is None:
                        path, shape = folder.new("sequence.mp4"), render.shape[:2]
                        video = stack.enter_context(VideoWriter(path, program, shape, rate))
                    video.write(render)
                if number in chosen:
                    step = -(-render.shape[1] // STRIP_WIDTH)
                    shown.append(render[::step, ::step].copy())
            columns = ("frame", "start [s]", "gain", "seed", *result.metrics)
            gain = result.frame.solved.gain
            facts = (number + 1, each.exposure.start, gain, each.seed.frame)
            rows.append((*facts, *result.metrics.values()))
            del result
    assert first is not None
    if shown:
        write_png(
            folder.new("strip.png"), np.concatenate(shown, axis=1), f"{rate:g} frames a second"
        )
    write_table(folder.new("frames.csv"), columns, rows)
    return first, needed
