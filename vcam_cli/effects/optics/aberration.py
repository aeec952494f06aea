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

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.optics.field_blur import FieldBlur
from vcam_cli.effects.optics.lens_check import traced_blur
from vcam_cli.effects.optics.measured_mtf import FieldMtf, MeasuredMtf
from vcam_cli.effects.optics.point_spread import PointSpread
from vcam_cli.effects.optics.shaped_blur import ShapedBlur
from vcam_cli.effects.optics.wavefront_blur import AberrationBlur, DirectedBlur, SymmetricBlur

KINDS = (ShapedBlur, PointSpread, MeasuredMtf, FieldMtf, SymmetricBlur, DirectedBlur, FieldBlur)
"""Kinds of blur of a lens that is not traced; a camera has at most one of them."""


class Aberration(AberrationBlur):
    """Aberrations: the OTF of the lens divided by that of a perfect lens."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> AberrationBlur | None:
        """Return the kind of blur that the camera's lens has, or None for a perfect lens."""
        if traced := traced_blur(camera, geometry):
            return traced
        blurs = (kind.from_camera(camera, geometry) for kind in KINDS)
        return next((blur for blur in blurs if blur is not None), None)
