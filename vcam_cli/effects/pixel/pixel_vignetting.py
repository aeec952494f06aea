"""Pixel vignetting: the tunnel above each photodetector shades it, more toward the corners.

    share = mean over the exit pupil of overlap T,   overlap = (1 - |d_x| / w) (1 - |d_y| / h)

d is the lateral displacement of a ray in the layers (Snell's law), w and h are the sides of tunnel
and photodetector, and T is the transmission of the interfaces (Fresnel's equations).

The loss depends on where the pixel lies only, by the angle of its chief ray; it is the same in
all four quadrants of the field, for photodetectors off their pixel's center as well, since the
tunnel stands above the photodetector.

Why a series: the pupil is integrated for few pixels, at Chebyshev points of a quadrant, and the
product of polynomials through them costs a matrix product for all others. They stand close near the
axis, where the loss bends most. Their number is doubled until the series has converged.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import pixel_layout
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import NeutralGain
from vcam_cli.floats import rms
from vcam_cli.physics import vignetting
from vcam_cli.records import dataclass

POINTS = (17, 33, 65)
"""Along each axis of the quadrant, as many as are needed."""
OF_TOLERANCE = 1 / 20
"""How much of the tolerance the last terms of the series may be."""
ROWS = 8
"""Of points, integrated at once: few enough for the cache."""
LEAST = 1e-6
"""Share of light below which a pixel counts as dark."""
NARROWEST = 1e-6
"""Tangent of a cone of light that is as good as parallel: what falls on a bare sensor."""


@dataclass(frozen=True)
class PixelVignetting(NeutralGain):
    """Share of the light that reaches the photodetectors through their tunnels. Lengths in [m]."""

    layers: tuple[tuple[float, float], ...]
    """Thickness and refractive index, from the air down."""
    width: float
    height: float
    """Of tunnel and photodetector."""
    cone: float
    """Tangent of the half-angle of the image-side cone."""
    pupil_distance: float
    half_width: float
    half_height: float
    """Half the sensor's width and height."""
    follows: bool
    """Whether microlenses send the chief ray to the photodetector's center."""
    internal: bool
    """Whether the quantum efficiency is that of light in the silicon, without reflection."""
    tolerance: float
    """Of the mean signal, relative to full signal."""
    points: int | None = None
    """Along each axis of the quadrant; None: as many of `POINTS` as are needed."""

    name = "pixel_vignetting"
    reference = "Catrysse, Liu and El Gamal 2000, doi:10.1117/12.385460; Chen 2003, section 2.2.2"
    absent = "pixel.stack has the value none"
    seconds_per_pixel = 3e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the loss in the pixel's tunnel, or None where no layers are described."""
        layers = pixel_layout.layers(camera)
        if not layers:
            return None
        return cls(
            layers,
            geometry.detector_width,
            geometry.detector_height,
            max(1 / (2 * geometry.working_f_number), NARROWEST),
            geometry.exit_pupil_distance,
            geometry.sensor_width / 2,
            geometry.sensor_height / 2,
            pixel_layout.follows_chief_ray(camera),
            camera.pixel.photodetector.quantum_efficiency.given is None,
            camera.accuracy.tolerance,
            camera.accuracy.vignetting_points,
        )

    @remembered(4)
    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        ends = np.array([0, self.half_width]), np.array([0, self.half_height])
        loss = 1 - np.diag(self.gain(*ends))
        center, corners = (f"{100 * share:.3g} %" for share in loss)
        return f"blocks {center} of the light in the center, {corners} in the corners"

    def exact_gain(self, x: Array, y: Array) -> Array:
        """Return the gain, integrated over the whole pupil.

        Parameters
        ----------
        x, y : Array
            Positions of pixels (rows, columns) [m].

        Returns
        -------
        Array
            Gain (rows, columns) without unit.
        """
        share = vignetting.collected_fraction(
            x / self.pupil_distance,
            y / self.pupil_distance,
            self.cone,
            self.layers,
            self.width,
            self.height,
            self.follows,
        )
        return share if self.internal else share / vignetting.stack_transmission(1.0, self.layers)

    def gain(self, x: Array, y: Array) -> Array:
        """Return the factor at the positions x (columns,), y (rows,) [m]: (rows, columns)."""
        series = _series(self)
        order = len(series) - 1
        across, down = (
            np.polynomial.chebyshev.chebvander(
                2 * np.minimum(np.abs(at.astype(float)) / half, 1) - 1, order
            )
            for at, half in ((x, self.half_width), (y, self.half_height))
        )
        rows, columns = (down @ series).astype(x.dtype), across.T.astype(x.dtype)
        # No BLAS: its threads would wait for each other in the threads that compute blocks.
        out = np.einsum("ik,kj->ij", rows, columns)
        gain: Array = np.maximum(out, 0, out=out)
        return gain

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        # A field at full signal everywhere, the brightest pixel at full signal behind its tunnel:
        # rms of the loss over a quadrant by the midpoint rule.
        at = (np.arange(64) + 0.5) / 64
        gain = self.gain(at * self.half_width, at * self.half_height)
        brightest = max(float(gain.max()), LEAST)
        return 1.002 * rms(1 - gain) / brightest * signal.full_signal


@lru_cache(maxsize=16)
def _series(effect: PixelVignetting) -> Array:
    """Coefficients (y, x) of T_i(2 |y| / half - 1) T_j(2 |x| / half - 1).

    The gain is good to a few 1e-5 where the light fades slowly. In cones so narrow and tunnels so
    deep that it ends within the field, to half of the tolerance, a tenth of it rms.
    """
    for count in (effect.points,) if effect.points else POINTS:
        points = np.polynomial.chebyshev.chebpts1(count)
        x, y = (half * (1 + points) / 2 for half in (effect.half_width, effect.half_height))
        rows = (slice(i, i + ROWS) for i in range(0, count, ROWS))
        values = np.concatenate([effect.exact_gain(x[None, :], y[some, None]) for some in rows])
        invert = np.linalg.inv(np.polynomial.chebyshev.chebvander(points, count - 1))
        series = invert @ values @ invert.T
        last = max(np.abs(series[-3:]).sum(0).max(), np.abs(series[:, -3:]).sum(1).max())
        if last < OF_TOLERANCE * effect.tolerance:
            break
    series.flags.writeable = False
    return np.asarray(series)
