"""Blur by the lens's aberrations: defocus, Zernike wavefronts, or a measured blur.

    H(f) = mean of exp(2 pi i (W(p + s / 2) - W(p - s / 2)) / lambda)

over the points p that two pupils share which lie s = lambda N (1 - m) f diameters apart, W the
wavefront. For a measured PSF, H is its Fourier transform; a measured MTF is H itself.

`Diffraction` is the transfer function of a perfect lens; an aberration is a further factor. The
camera file determines the class:

    point_spread.py     a point spread function, measured or from a lens program
    traced_blur.py      wavefronts of a lens that is given by its prescription
    shaped_blur.py      a wavefront in an opening that is no circle
    measured_mtf.py     a measured modulation transfer, the same everywhere or over the field
    field_blur.py       a wavefront that changes over the field, or turns with the azimuth
    wavefront_blur.py   a wavefront that is the same everywhere, symmetric about the axis or not
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.optics.field_blur import FieldBlur
from vcam_cli.effects.optics.measured_mtf import FieldMtf, MeasuredMtf
from vcam_cli.effects.optics.point_spread import PointSpread
from vcam_cli.effects.optics.shaped_blur import ShapedBlur
from vcam_cli.effects.optics.wavefront_blur import (
    AberrationBlur,
    DirectedBlur,
    Lens,
    SymmetricBlur,
    focus_table,
    wavefronts,
)
from vcam_cli.errors import bad
from vcam_cli.physics import aberration, zernike

if TYPE_CHECKING:
    from vcam_cli.effects.optics.traced_blur import TracedBlur

KINDS = (ShapedBlur, PointSpread, MeasuredMtf, FieldMtf, SymmetricBlur, DirectedBlur, FieldBlur)
"""Kinds of blur of a lens that is not traced; a camera has at most one of them."""


def _traced(camera: Camera, geometry: Geometry) -> TracedBlur | None:
    """Return the blur of a lens given by its prescription, else None.

    The tracer is imported only then, as in `camera/derived/traced.py`.
    """
    if camera.optics.prescription is None:
        return None
    from vcam_cli.effects.optics.traced_blur import TracedBlur

    return TracedBlur.from_camera(camera, geometry)


class Aberration(AberrationBlur):
    """Aberrations: the OTF of the lens divided by that of a perfect lens."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> AberrationBlur | None:
        """Return the kind of blur that the camera's lens has, or None for a perfect lens."""
        if traced := _traced(camera, geometry):
            return traced
        blurs = (kind.from_camera(camera, geometry) for kind in KINDS)
        return next((blur for blur in blurs if blur is not None), None)


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
    if traced := _traced(camera, geometry):
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
