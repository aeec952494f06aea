"""Whether a lens can be computed: what refuses a camera file without the classes of its blurs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.optics.wavefront_blur import Lens, focus_table, wavefronts
from vcam_cli.errors import bad
from vcam_cli.physics import aberration, zernike

if TYPE_CHECKING:
    from vcam_cli.effects.optics.traced_blur import TracedBlur


def traced_blur(camera: Camera, geometry: Geometry) -> TracedBlur | None:
    """Return the blur of a lens given by its prescription, else None.

    The tracer is imported only then, as in `camera/derived/traced.py`.
    """
    if camera.optics.prescription is None:
        return None
    from vcam_cli.effects.optics.traced_blur import TracedBlur

    return TracedBlur.from_camera(camera, geometry)


def check(camera: Camera, geometry: Geometry) -> None:
    """Refuse a wavefront too steep to be followed as a wave.

    An effect that is switched off is refused, too: the plan states the error of skipping it.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    geometry : Geometry
        Geometry of the array.

    Raises
    ------
    BadInput
        For a wavefront that rises by too many wavelengths over a pupil radius.
    """
    if camera.optics.measured_blur and geometry.focus_shift:
        raise bad(
            ("optics", "focus_distance"),
            "a measured blur holds for the distance in focus, and is unknown at others",
            "write psf: none and mtf: none, or put the scene in focus",
        )
    if traced := traced_blur(camera, geometry):
        try:
            traced.check()
        except ValueError as error:
            remedy = (
                "stop down by {use: NAME, f_number: 8}, use a smaller scale, or write"
                " diffraction: false for the blur of rays"
            )
            raise bad(("optics", "prescription"), str(error), remedy) from None
        return
    if camera.optics.measured_blur or not Lens.from_camera(camera, geometry).diffracts:
        return
    shortest = camera.scene.wavelengths.start
    table = focus_table(camera)
    moved = [shift for _, shift in table.points] if table else [0.0]
    slopes = [
        aberration.slope_in_waves(
            zernike.combine(terms, zernike.defocus(shift, geometry.working_f_number)), shortest
        )
        for _, terms in wavefronts(camera, geometry)
        for shift in {min(moved), max(moved)}
    ]
    if max(slopes) > aberration.MAX_SLOPE:
        key = "zernike" if camera.optics.zernike.terms else "focus_shift" if table else "defocus"
        key = "focus_distance" if geometry.focus_shift else key
        raise bad(
            ("optics", key),
            f"gives a wavefront that rises by {max(slopes):.4g} wavelengths of"
            f" {shortest * 1e9:.4g} nm over a pupil radius; at most {aberration.MAX_SLOPE:g} can be"
            " followed",
            "check the unit, or write diffraction: false for the blur of rays",
        )
