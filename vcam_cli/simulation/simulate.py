"""One camera from its model to all its results, in memory: what `vcam run` writes to files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vcam_cli.arguments import brief, require_folder, require_whole
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.devices.choice import open_device
from vcam_cli.errors import BadInput
from vcam_cli.floats import own_float_errors
from vcam_cli.parallel import suitable_workers
from vcam_cli.progress import Callback, Observer, Stages, observer
from vcam_cli.simulation import pipeline, remarks
from vcam_cli.simulation.device_cost import device_note
from vcam_cli.simulation.photograph import Photograph, needs_picture
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.shared import RECENT, Shared


class Result(Photograph):
    """What `simulate` returns: a photograph that saves and labels itself.

    Writers know only `Photograph`, so that this class, which calls them, stands above them.
    """

    def save(self, folder: str | Path) -> Path:
        """Write the files of `vcam run`.

        Parameters
        ----------
        folder : str or Path
            Folder to write.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        BadInput
            Where something else has the folder's name.
        CannotDo
            Where a file cannot be written, or memory does not suffice.
        TypeError
            For what is no path.
        """
        from vcam_cli.simulation.output.outputs import save

        return save(self, require_folder(folder))

    def to_xarray(self) -> Any:
        """Return the raw frame as an `xarray.Dataset`: see `labeled_frame.frame_dataset`."""
        from vcam_cli.simulation.labeled_frame import frame_dataset

        return frame_dataset(self)


def threads(camera: Camera) -> int:
    """Return the threads for a frame: all processors, fewer for small frames.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    int
        Number of threads.

    Raises
    ------
    BadInput
        For a camera without a geometry.
    """
    g = geometry(camera)
    return suitable_workers(g.rows * g.columns)


@own_float_errors
def simulate(
    camera: Camera,
    workers: int | None = None,
    watch: Observer | Callback | None = None,
    shared: Shared | None = None,
    device: str = "cpu",
    before: Result | None = None,
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
        What cameras before this one had in common with it; results do not depend on it. By
        default the light of the last cameras, 64 MB of it, and their picture up to 64 MB.
    device : str, optional
        "gpu" computes light, noise and readout on a graphics processor: light that differs by
        rounding, and other random numbers of the same statistics. See `frames` for many pictures.
    before : Result, optional
        The frame before this one in a sequence, whose charge lags (`pixel.lag`); by default the
        pixels have seen the light of this one.

    Raises
    ------
    BadInput
        For a camera that contradicts itself, with positions in its file.
    CannotDo
        Where memory does not suffice, or there is no such device.
    TypeError
        For what is no camera, such as the name of a file, and other arguments of wrong types.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f'{brief(camera)} is no camera; write simulate(load("camera.yaml"))')
    if workers is not None:
        require_whole(workers, "workers", 1)
    stages = Stages(watch=observer(watch))
    try:
        shared = shared or RECENT.shared_with(camera)
        run = Run(workers or threads(camera), stages, shared.rate_cache, open_device(device))
        return _simulate(camera, run, shared, before)
    except BadInput as error:
        raise error.with_places(camera.locate) from None


@own_float_errors
def prepare(
    camera: Camera,
    workers: int | None = None,
    watch: Observer | Callback | None = None,
    is_estimated: bool = False,
) -> tuple[Prepared, remarks.Notes]:
    """Return the camera ready to take its frame, and notes, as `vcam plan` shows.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    workers : int or None, optional
        Number of threads, by default `threads`; results do not depend on it.
    watch : Observer or Callback or None, optional
        Follows the run: see `vcam_cli.progress.observer`.
    is_estimated : bool, optional
        Whether the light of few places of a large array suffices.

    Returns
    -------
    tuple
        Camera with its plan and light, and notes.

    Raises
    ------
    BadInput
        For a camera that contradicts itself, with positions in its file.
    CannotDo
        Where memory does not suffice.
    """
    try:
        shared = RECENT.shared_with(camera)
        stages = Stages(watch=observer(watch))
        run = Run(workers or threads(camera), stages, shared.rate_cache)
        ready, notes = pipeline.prepare(camera, run, shared, is_estimated)
        return ready, remarks.Notes(ready, notes)
    except BadInput as error:
        raise error.with_places(camera.locate) from None


def _simulate(camera: Camera, run: Run, shared: Shared, before: Result | None) -> Result:
    last = None if before is None else before.frame
    frame, steps, notes = pipeline.take(camera, run, shared, last)
    if run.device.whole:
        notes = (*notes, device_note(frame, frame.spectrum.computed_on))
    result = Result(frame, run.stages, run.workers, steps, remarks.Notes(frame, notes))
    if needs_picture(
        frame.solved
    ):  # what is wrong with its steps is said before anything is written
        _ = result.processed
    return result
