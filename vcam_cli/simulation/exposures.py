"""Several exposures of one light: frames of cameras that differ in nothing before the charge."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.processing_steps import Step
from vcam_cli.processing import ProcessedPicture
from vcam_cli.progress import Stages
from vcam_cli.simulation import pipeline
from vcam_cli.simulation.exposed_light import expose
from vcam_cli.simulation.frame import Frame, take_frame
from vcam_cli.simulation.photograph import Photograph
from vcam_cli.simulation.preparation import whole_frame
from vcam_cli.simulation.reading import read_camera
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_files import flattened
from vcam_cli.simulation.scene_light import (
    exposed_as,
    formed_light,
    rate_of_full,
    scene_for_exposure,
    scene_light,
)
from vcam_cli.simulation.shared import Shared


def exposures(
    cameras: Sequence[Camera], workers: int, shared: Shared, wanted: Collection[int] | None = None
) -> Iterator[Photograph]:
    """Yield a photograph of every camera, with all effects that are not switched off.

    Their light is formed once, as exactly as the camera needs it whose pixels fill first; so a
    frame does not depend on which of the others are wanted.

    Parameters
    ----------
    cameras : sequence of Camera
        Cameras of one `light_key`, each with a single exposure, and none that moves or focuses by
        itself: see `share_light`.
    workers : int
        Number of threads; the result does not depend on it.
    shared : Shared
        What cameras before these had in common with them.
    wanted : collection of int, optional
        Numbers of the cameras whose photographs are taken, from 0; by default all.

    Raises
    ------
    BadInput
        For a camera that contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    run = Run(workers, Stages(), shared.rate_cache)
    cameras = [_less_wishes(camera) for camera in cameras]
    first, picture, _ = read_camera(cameras[0], run.stages, shared)
    first, picture, _ = flattened(first, picture)
    solved = [first, *map(first.behind_light, cameras[1:])]
    seen = scene_light(first, picture, run)
    fills_first = min(solved, key=lambda each: rate_of_full(seen, each))
    if fills_first is not first:
        seen = exposed_as(seen, fills_first, picture)
    seen = replace(seen, path=replace(seen.path, optional=(), is_explained=False))
    seen, light = formed_light(seen, picture, run)
    for number, each in enumerate(solved):
        if wanted is not None and number not in wanted:
            continue
        path = replace(seen.path, effects=each.effects.mean_signal)
        own = replace(seen, solved=each, path=path)
        lit, exposed = light, expose(own, light, False)
        better = scene_for_exposure(exposed.settings, own, light, picture)
        if better is not own:
            own, lit = formed_light(better, picture, run)
            exposed = expose(own, lit, False)
        frame = take_frame(whole_frame(own, lit, exposed), workers)
        yield Photograph(frame, run.stages, workers, partial(_processed, frame, workers))


def _processed(frame: Frame, workers: int, steps: Sequence[Step]) -> ProcessedPicture:
    return pipeline.picture_of(frame, workers)(steps)


def _less_wishes(camera: Camera) -> Camera:
    """Return a camera whose file wants no effect, but for those that it switches off."""
    wishes = camera.effects if isinstance(camera.effects, dict) else {}
    off = {name: wish for name, wish in wishes.items() if wish == "off"}
    return camera.model_copy(update={"effects": off or "all"})


def share_light(camera: Camera) -> bool:
    """Return whether the light of a camera is the same whenever and however long it is exposed.

    Parameters
    ----------
    camera : Camera
        The camera.

    Returns
    -------
    bool
        False where something moves, or the lens is focused by trial exposures.
    """
    return not camera.scene.moves and camera.optics.focus == "fixed" and not camera.exposure.bracket
