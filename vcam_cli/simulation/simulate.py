"""One camera from its model to all its results, in memory: what `vcam run` writes to files."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from vcam_cli.arguments import brief, require_folder, require_whole
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.scene_layers import with_flat_scene
from vcam_cli.errors import BadInput
from vcam_cli.floats import own_float_errors
from vcam_cli.parallel import suitable_workers
from vcam_cli.processing import Context, Patches, process
from vcam_cli.progress import Callback, Observer, Stages, observer
from vcam_cli.scenes.depth_scene import DepthPicture
from vcam_cli.scenes.hyperspectral import Cube
from vcam_cli.simulation import remarks, scene_bands
from vcam_cli.simulation.autofocus import focused
from vcam_cli.simulation.checks import read_lens
from vcam_cli.simulation.frame import Frame, expose
from vcam_cli.simulation.photograph import Photograph, needs_picture
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.preparation import prepare as bring_light
from vcam_cli.simulation.scene_files import flattened, read_scene
from vcam_cli.simulation.shared import Shared


class Result(Photograph):
    """What `simulate` returns: a photograph that saves and labels itself.

    Writers know only `Photograph`, so that this class, which calls them, stands above them.
    """

    def save(self, folder: str | Path) -> Path:
        """Write what `vcam run` writes, and return the folder. Raises BadInput, CannotDo."""
        from vcam_cli.simulation.output.outputs import save

        return save(self, require_folder(folder))

    def to_xarray(self) -> Any:
        """Return the raw frame as an `xarray.Dataset`: see `labeled_frame.frame_dataset`."""
        from vcam_cli.simulation.labeled_frame import frame_dataset

        return frame_dataset(self)


def threads(camera: Camera) -> int:
    """Return the threads for a frame: all processors, fewer for small ones. Raises BadInput."""
    g = geometry(camera)
    return suitable_workers(g.rows * g.columns)


@own_float_errors
def simulate(
    camera: Camera,
    workers: int | None = None,
    watch: Observer | Callback | None = None,
    shared: Shared | None = None,
) -> Result:
    """Simulate `camera` looking at its scene.

    Parameters
    ----------
    camera : Camera
        The camera and its scene.
    workers : int, optional
        Number of threads, by default `threads`; results do not depend on it.
    watch : callable or Observer, optional
        Follows the run, and later the result's properties: see `vcam_cli.progress.observer`.
    shared : Shared, optional
        What cameras before this one had in common with it; results do not depend on it.

    Raises
    ------
    BadInput
        For a camera that contradicts itself, with positions in its file.
    CannotDo
        Where memory does not suffice.
    TypeError
        For what is no camera, such as the name of a file, and other arguments of wrong types.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f'{brief(camera)} is no camera; write simulate(load("camera.yaml"))')
    if workers is not None:
        require_whole(workers, "workers", 1)
    stages = Stages(watch=observer(watch))
    try:
        return _simulate(camera, workers or threads(camera), stages, shared or Shared())
    except BadInput as error:
        raise error.with_places(camera.locate) from None


@own_float_errors
def prepare(
    camera: Camera, workers: int | None = None, watch: Observer | Callback | None = None
) -> tuple[Prepared, remarks.Notes]:
    """Return the camera ready to take its frame, and notes: what `vcam plan` shows."""
    try:
        stages, workers = Stages(watch=observer(watch)), workers or threads(camera)
        camera, picture, notes, seconds = _in_focus(camera, workers, stages, Shared())
        ready = bring_light(camera, picture, workers, stages, earlier=seconds)
        return ready, remarks.Notes(ready, notes)
    except BadInput as error:
        raise error.with_places(camera.locate) from None


def _load_lens(camera: Camera, stages: Stages) -> Camera:
    """Return the camera with what its lens's file holds, checked; one layer alone is flat."""
    camera = with_flat_scene(camera)
    with stages("read"):
        samples = read_lens(camera)
    return camera.with_samples(samples) if samples else camera


def _completed(camera: Camera, picture: Any, notes: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    """Return the part of the scene's file that is the scene, and notes.

    Spectra are dark where their file ends and the camera hardly sees.
    """
    if isinstance(picture, DepthPicture):
        own, more = _completed(camera, picture.picture, notes)
        crop = getattr(camera.scene.source, "crop", None)
        depth = picture.depth if crop is None else picture.depth[crop.window]
        return DepthPicture(own, depth), more
    if not isinstance(picture, Cube):
        crop = getattr(camera.scene.source, "crop", None)
        return picture if crop is None else picture[crop.window], notes
    cube, more = scene_bands.completed(camera, picture)
    return cube, (*notes, *more)


def _in_focus(
    camera: Camera, workers: int, stages: Stages, shared: Shared
) -> tuple[Camera, Any, tuple[str, ...], float]:
    """Return the camera in focus, its picture file's samples, notes, and the focusing's time [s].

    The time is estimated; the plan counts it.
    """
    camera = _load_lens(camera, stages)
    picture, notes = _completed(camera, *shared.picture(camera, lambda: read_scene(camera, stages)))
    camera, picture, flat = flattened(camera, picture)
    camera, told, seconds = focused(camera, picture, workers, stages)
    return camera, picture, notes + flat + told, seconds


def _simulate(camera: Camera, workers: int, stages: Stages, shared: Shared) -> Result:
    camera, picture, notes, seconds = _in_focus(camera, workers, stages, shared)
    frame = expose(camera, picture, workers, stages, shared.rate_cache, seconds)
    context = Context(
        pattern=frame.mosaic.block,
        colors=frame.mosaic.colors,
        white_dn=frame.white_dn,
        black_dn=frame.black_dn,
        black_steps=frame.black_steps if frame.electrical.black_steps else None,
        linearize=frame.linear if frame.electrical.linearized else None,
        saturated_dn=frame.picture_saturated_dn,
        patches=partial(_patches, frame),
        primaries=frame.primaries_dn if camera.scene.emits else None,
        planes=frame.layout.full_color,
        layout=frame.layout if frame.layout.is_scattered else None,
    )
    steps = partial(process, frame.picture_dn, context, workers=workers)
    result = Result(frame, stages, workers, steps, remarks.Notes(frame, notes))
    if needs_picture(camera):  # what is wrong with its steps is said before anything is written
        _ = result.processed
    return result


def _patches(frame: Frame) -> Patches:
    """Return the ColorChecker that color correction is fitted to."""
    band = frame.camera.scene.wavelengths
    return Patches(frame.patches_dn(), frame.scene.white, band.start, band.stop)
