"""A frame from its camera to its picture. Read this first.

    stage         in                        out            what happens
    ------------  ------------------------  -------------  -------------------------------------
    read          Camera                    ReadCamera     files of the lens and of the scene
    solve         Camera                    Solved         geometry, circuit, effects, settings
    focus         Solved                    Solved         autofocus, where the file has it
    scene         Solved, files             SceneLight     scene on the lattice, white, transfer
    light         SceneLight                Rate           mean light on the lattice [e/s]
    exposure      SceneLight, Rate          ExposedLight   time and gain; mean light of nodes [e/s]
    plan          ... and ExposedLight      Prepared       which effects run
    charge, DN    Prepared                  Frame          time x light + dark current, before_shot,
                                                           noise, full well, ADC
    picture       Frame                     processing     demosaic to tone, when it is used

Every stage takes records and returns one; none of them is changed. What each effect does in its
stage, `before_shot` among them, is in the table of `effects/order.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.processing_steps import Step
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.effects.shading import ArrayShading
from vcam_cli.processing import Context, Patches, ProcessedPicture, process
from vcam_cli.simulation import autofocus, cost_model
from vcam_cli.simulation.coarse_light import coarse_camera, estimated_light
from vcam_cli.simulation.exposed_light import expose
from vcam_cli.simulation.frame import Frame, take_frame
from vcam_cli.simulation.preparation import Prepared, plan_frame, whole_frame
from vcam_cli.simulation.reading import read_camera
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_files import ScenePicture, flattened
from vcam_cli.simulation.scene_light import formed_light, scene_for_exposure, scene_light
from vcam_cli.simulation.shared import Shared
from vcam_cli.solve.solved import Solved


def prepare(
    camera: Camera, run: Run, shared: Shared, is_estimated: bool = False
) -> tuple[Prepared, tuple[str, ...]]:
    """Bring the light of a camera's scene to its pixels, time the exposure, plan what will run.

    Parameters
    ----------
    camera : Camera
        The camera.
    run : Run
        How it is computed.
    shared : Shared
        What cameras before this one had in common with it.
    is_estimated : bool, optional
        Whether the light of few places suffices, as for a plan.

    Returns
    -------
    ready : Prepared
        The camera, ready to take its frame.
    notes : tuple of str
        What a user should know of its files, and of its focus.

    Raises
    ------
    BadInput
        Where the camera contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    of_bracket: tuple[str, ...] = ()
    if camera.exposure.bracket:
        from vcam_cli.simulation.bracket import bracket_cameras, bracket_note, longest_of

        of_bracket = (bracket_note(camera.exposure),)
        camera = bracket_cameras(camera)[longest_of(camera)]
    solved, picture, notes = read_camera(camera, run.stages, shared)
    solved, picture, flat = flattened(solved, picture)
    trial = partial(_prepare, picture=picture, run=run.unseen(), is_planned=False)
    solved, focused, seconds = autofocus.focused(solved, trial, run.workers, run.stages)
    ready = prepare_light(solved, picture, run.after(seconds), is_estimated)
    return ready, of_bracket + notes + flat + focused


def prepare_light(
    solved: Solved, picture: ScenePicture, run: Run, is_estimated: bool = False
) -> Prepared:
    """Return a camera in focus, ready to take its frame of the scene.

    A camera that times its exposure by a scene that moves meters the scene at rest.

    Parameters
    ----------
    solved : Solved
        The camera.
    picture : ScenePicture
        What the scene's files hold.
    run : Run
        How it is computed.
    is_estimated : bool, optional
        As that of `prepare`.

    Returns
    -------
    Prepared
        The camera, ready to take its frame.
    """
    form = _estimate if is_estimated else _prepare
    if not (solved.scene.moves and solved.exposure.is_timed_by_scene):
        return form(solved, picture, run)
    with run.stages("metering"):
        metered = form(solved.standing_still(), picture, run.unseen(run.rate_cache), False)
    once = cost_model.light_seconds(metered.layout, metered.spectrum, run.workers)
    timed = solved.timed(metered.exposure_time, metered.solved.gain, metered.times)
    ready = form(timed, picture, run.after(once, lights=1))
    written = ready.solved.with_exposure(solved.exposure)
    return replace(ready, solved=written, exposure_limit=metered.exposure_limit)


def _prepare(solved: Solved, picture: ScenePicture, run: Run, is_planned: bool = True) -> Prepared:
    """Return the same where times are given, or nothing moves.

    Its light and its time are known before it is planned: metering and focus need no more.
    """
    seen = scene_light(solved, picture, run)
    seen, light = formed_light(seen, picture, run)
    with run.stages("exposure"):
        exposed = expose(seen, light, is_planned)
        if not is_planned:
            return whole_frame(seen, light, exposed)
        better = scene_for_exposure(exposed.settings, seen, light, picture)
    if better is not seen:
        once = cost_model.light_seconds(solved.layout, light.spectrum, run.workers)
        run = run.after(once, lights=1)
        seen, light = formed_light(better, picture, run)
        with run.stages("exposure"):
            exposed = expose(seen, light)
    with run.stages("exposure"):
        return plan_frame(seen, light, exposed, run)


def _estimate(solved: Solved, picture: ScenePicture, run: Run, is_planned: bool = True) -> Prepared:
    """Return a plan's camera: its light is that of few places where the array is large."""
    coarse = coarse_camera(solved)
    if coarse is None:
        return _prepare(solved, picture, run, is_planned)
    seen = scene_light(solved, picture, run)
    with run.stages("exposure"):
        light, exposed = estimated_light(seen, coarse, picture, run, is_planned)
        if not is_planned:
            return whole_frame(seen, light, exposed)
        ready = plan_frame(seen, light, exposed, run)
    g = coarse.layout.lattice
    return replace(ready, estimated_places=g.rows * g.columns)


def take(
    camera: Camera, run: Run, shared: Shared, before: Prepared | None = None
) -> tuple[Frame, Callable[[Sequence[Step]], ProcessedPicture], tuple[str, ...]]:
    """Take a frame of a camera.

    Parameters
    ----------
    camera, run, shared
        As those of `prepare`.
    before : Prepared, optional
        The frame before it in a sequence.

    Returns
    -------
    frame : Frame
        The raw frame.
    process : callable
        Function that prepares steps of processing for its picture.
    notes : tuple of str
        As those of `prepare`.
    """
    if camera.exposure.bracket:
        frame, notes = _take_bracket(camera, run, shared)
    else:
        ready, notes = prepare(camera, run, shared)
        ready = ready if before is None else ready.after(before)
        frame = take_frame(ready, run.workers, run.stages, run.device)
    return frame, picture_of(frame, run.workers), notes


def _take_bracket(camera: Camera, run: Run, shared: Shared) -> tuple[Frame, tuple[str, ...]]:
    """Take the exposures of a bracket, and merge them: the longest, with all in it, and its notes.

    Each is a frame of its own: with noise of its own, and with what has moved on meanwhile.
    """
    from vcam_cli.simulation.bracket import bracket_cameras, longest_of, merged_bracket

    taken = []
    for single in bracket_cameras(camera):
        ready, notes = prepare(single, run, shared)
        taken.append((take_frame(ready, run.workers, run.stages, run.device), notes))
    frame, notes = taken[longest_of(camera)]
    with run.stages("reconstruction"):
        merged = merged_bracket(frame, [each for each, _ in taken], camera.exposure, run.workers)
    return merged, notes


def picture_of(frame: Frame, workers: int) -> Callable[[Sequence[Step]], ProcessedPicture]:
    """Return what makes a picture of a frame by some steps.

    Parameters
    ----------
    frame : Frame
        The raw frame.
    workers : int
        Number of threads.

    Returns
    -------
    callable
        Function of steps.
    """
    steps = frame.chain.black_steps(frame.mosaic.colors)
    context = Context(
        pattern=frame.mosaic.block,
        colors=frame.mosaic.colors,
        white_dn=frame.white_dn,
        black_dn=frame.black_dn,
        black_steps=steps if steps.any() else None,
        linearize=frame.chain.linear if frame.chain.linearized else None,
        saturated_dn=frame.picture_saturated_dn,
        patches=partial(_patches, frame),
        primaries=frame.primaries_dn if frame.solved.scene.emits else None,
        planes=frame.layout.full_color,
        layout=frame.layout if frame.layout.is_scattered else None,
        correction=frame.solved.lens_correction,
        shading=_shading(frame),
    )
    return partial(process, frame.picture_dn, context, workers=workers)


def _shading(frame: Frame) -> ArrayShading | None:
    """Return how the simulated light falls off; None where it does not."""
    places = (np.asarray(at, np.float32) for at in (frame.layout.picture_x, frame.layout.picture_y))
    found = ArrayShading(of_kind(frame.plan.active, Gain), *places)
    return found if found.falls(frame.mosaic.colors) else None


def _patches(frame: Frame) -> Patches:
    """Return the ColorChecker that color correction is fitted to."""
    band = frame.solved.scene.wavelengths
    return Patches(frame.patches_dn(), frame.scene.white, band.start, band.stop)
