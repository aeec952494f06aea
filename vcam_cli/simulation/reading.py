"""The files of a camera: its lens's, and its scene's; with them the camera is solved."""

from __future__ import annotations

from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.scene_layers import with_flat_scene
from vcam_cli.progress import Stages
from vcam_cli.scenes.depth_scene import DepthPicture
from vcam_cli.scenes.hyperspectral import Cube
from vcam_cli.simulation import scene_bands
from vcam_cli.simulation.checks import read_lens, read_maps
from vcam_cli.simulation.scene_files import read_scene
from vcam_cli.simulation.shared import Shared
from vcam_cli.solve.solved import Solved, solve


def read_camera(
    camera: Camera, stages: Stages, shared: Shared
) -> tuple[Solved, Any, tuple[str, ...]]:
    """Return a camera, solved with what the files of its lens hold, its scene's files, and notes.

    Parameters
    ----------
    camera : Camera
        The camera.
    stages : Stages
        Observer of the stages.
    shared : Shared
        What cameras before this one had in common with it: the pictures that were read.

    Returns
    -------
    solved : Solved
        The camera.
    picture : ScenePicture
        What the scene's files hold, the part that is the scene.
    notes : tuple of str
        What a user should know of them.
    """
    camera = with_flat_scene(camera)  # one layer alone is flat
    with stages("read"):
        camera = with_own_files(camera)
    found = shared.picture(camera, lambda: read_scene(camera, stages))
    solved = solve(camera)
    picture, notes = _completed(solved, *found)
    return solved, picture, notes


def with_own_files(camera: Camera) -> Camera:
    """Return a camera with what the files of its lens and of its pixels hold.

    Parameters
    ----------
    camera : Camera
        The camera.
    """
    samples = read_lens(camera) | read_maps(camera)
    return camera.with_samples(samples) if samples else camera


def _completed(solved: Solved, picture: Any, notes: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    """Return the part of the scene's file that is the scene, and notes.

    Spectra are dark where their file ends and the camera hardly sees.
    """
    if isinstance(picture, DepthPicture):
        own, more = _completed(solved, picture.picture, notes)
        crop = getattr(solved.scene.source, "crop", None)
        depth = picture.depth if crop is None else picture.depth[crop.window]
        return DepthPicture(own, depth), more
    if not isinstance(picture, Cube):
        crop = getattr(solved.scene.source, "crop", None)
        return picture if crop is None else picture[crop.window], notes
    cube, more = scene_bands.completed(solved, picture)
    return cube, (*notes, *more)
