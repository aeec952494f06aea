"""The lens of a camera that is given by its prescription, where one is.

Why the tracer is imported here, inside the functions: few cameras have a prescription, and without
these imports other commands start 50 ms sooner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vcam_cli.camera.model import CameraModel

if TYPE_CHECKING:
    from vcam_cli.camera.derived.prescription import TracedLens
    from vcam_cli.lenses.fields import View


def traced_lens(camera: CameraModel) -> TracedLens | None:
    """Return the lens of a camera with a prescription, else None.

    Raises BadInput for a lens that cannot be had, CannotDo where its file may not be read.
    """
    if camera.optics.prescription is None:
        return None
    from vcam_cli.camera.derived import prescription

    return prescription.read_lens(camera, camera.optics.prescription)


def traced_view(camera: CameraModel, distance: float) -> View | None:
    """Return the traced lens before an object at a distance [m], else None; raises as the lens."""
    lens = traced_lens(camera)
    if lens is None:
        return None
    from vcam_cli.camera.derived import prescription

    return prescription.sensor_view(lens, distance, camera.optics.defocus)
