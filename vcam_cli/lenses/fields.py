"""Rays of a field point: aimed at the stop, their wavefront, and the true shape of the pupil.

The field lies along +x: rays of the field angle t come with the direction (sin t, 0, cos t) and
land at positive x. A ray is launched at (u, v) on the plane through the first vertex that stands
perpendicular to that direction, u along (cos t, 0, -sin t), v along y.

Pupil coordinates are direction cosines on the image side: a place of the reference sphere, seen
from the image point, over the sphere's radius, less that of the chief ray. There light of even
radiance has even power, and the transfer function is the overlap of two pupils
wavelength times frequency apart.

References
----------
.. [1] H. H. Hopkins, "Image formation by a general optical system", Applied Optics 24,
   2491-2505, 1985, doi:10.1364/AO.24.002491.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.paraxial import Paraxial, paraxial
from vcam_cli.lenses.prescription import Prescription
from vcam_cli.lenses.tracing import Rays, Trace, trace
from vcam_cli.records import dataclass

AIM_STEPS = 40
AIMED = 3e-13
"""Miss of the stop, over its radius, at which aiming ends: the wavefront is good to 1e-9 waves."""
FIELD_STEP = math.radians(6)
"""The chief ray of a wide field is found from that of a field so much narrower [rad]."""
FARTHEST_PUPIL = 1e3
"""Exit pupils further away, in focal lengths, are taken as there: wavefronts keep their digits."""


@dataclass(frozen=True, eq=False)
class Wavefront:
    """Rays of one or several field points on their reference spheres; arrays (..., rays)."""

    path: Array
    """What the ray's optical path is longer than the chief ray's [m]."""
    x: Array
    y: Array
    """Direction cosines from the chief ray's, x outwards."""
    alive: Array
    landing_x: Array
    landing_y: Array
    """Landing points from the chief ray's [m]."""
    clipped: Array
    """Whether an aperture that the file fixes stops the ray."""


@dataclass(frozen=True)
class View:
    """A lens before an object at a distance."""

    lens: Prescription
    distance: float = math.inf
    """From the object to the first vertex [m]."""

    @cached_property
    def paraxial(self) -> Paraxial:
        """First-order data at the primary wavelength."""
        return paraxial(self.lens, self.lens.primary)

    @cached_property
    def exit_pupil(self) -> float:
        """From the exit pupil to the image plane [m]."""
        away = self.lens.surfaces[-1].thickness - self.paraxial.exit_pupil
        most = FARTHEST_PUPIL * self.paraxial.focal_length
        return math.copysign(min(abs(away), most), away)

    def launch(self, angle: Array, u: Array, v: Array) -> Rays:
        """Return rays at the places (u, v) [m] for field angles [rad]; all broadcast."""
        angle, u, v = np.broadcast_arrays(angle, u, v)
        sine, cosine = np.sin(angle), np.cos(angle)
        x, y, z = u * cosine, v + 0.0, -u * sine
        alive = np.isfinite(u) & np.isfinite(v)
        if math.isinf(self.distance):
            return Rays(x, y, z, sine, np.zeros_like(y), cosine, np.zeros_like(x), alive)
        along = self.distance / cosine  # from the object's point to the first vertex
        length = np.sqrt(along**2 + u**2 + v**2)
        l, m, n = (x + along * sine) / length, y / length, (z + along * cosine) / length  # noqa: E741
        # Of the path the part to the vertex is the same for all rays: it would cost digits.
        path = (u**2 + v**2) / (length + along)
        return Rays(x, y, z, l, m, n, path, alive)

    def trace(self, angle: Array, wavelengths: Array, u: Array, v: Array) -> Trace:
        """Trace rays of shape (..., W, P) for angles (...,), u and v broadcasting to that."""
        rays = self.launch(np.asarray(angle)[..., None, None], u, v)
        return trace(self.lens.surfaces, self._indices(wavelengths), rays, self.lens.stop)

    def _indices(self, wavelengths: Array) -> Array:
        return self.lens.indices(wavelengths)[:, :, None]

    def _stop(self, angle: Array, wavelengths: Array, u: Array, v: Array) -> tuple[Array, Array]:
        """Return where rays meet the stop, over its semi-diameter; NaN where they do not."""
        surfaces, indices = self.lens.surfaces, self._indices(wavelengths)
        rays = self.launch(angle, u, v)
        found = trace(surfaces, indices, rays, self.lens.stop, to_stop=True)
        bad = np.where(found.rays.alive, 0.0, np.nan)
        radius = self.paraxial.stop_semi_diameter
        return (found.stop_x + bad) / radius, (found.stop_y + bad) / radius

    def chief(self, angle: Array, wavelengths: Array) -> Array:
        """Return u of the rays through the center of the stop.

        Parameters
        ----------
        angle : ndarray
            Field angles (F,) [rad].
        wavelengths : ndarray
            Wavelengths (W,) [m].

        Returns
        -------
        ndarray
            u (F, W) [m]; NaN where there is no such ray.
        """
        angle = np.asarray(angle, float)
        steps = max(1, math.ceil(float(np.abs(angle).max(initial=0.0)) / FIELD_STEP))
        shape = len(angle), len(wavelengths), 1
        ratio = np.full(shape, -self.paraxial.entrance_pupil)
        small = 1e-6 * self.lens.pupil_diameter
        for step in range(1, steps + 1):
            t = (angle * (step / steps))[:, None, None]
            sine = np.where(np.sin(t) == 0, 1.0, np.sin(t))
            u0 = ratio * np.sin(t)
            f0 = self._stop(t, wavelengths, u0, np.zeros(1))[0]
            u1 = u0 + small
            for _ in range(AIM_STEPS):
                f1 = self._stop(t, wavelengths, u1, np.zeros(1))[0]
                change = f1 - f0
                slope = np.where(change == 0, 1.0, change) / np.where(u1 == u0, 1.0, u1 - u0)
                ahead = np.where(np.abs(f1) < AIMED, u1, u1 - f1 / slope)
                u0, f0, u1 = u1, f1, ahead
                if not (np.abs(f0) >= AIMED).any():
                    break
            u0 = np.where(np.abs(f0) < 1e-9, u0, np.nan)
            ratio = u0 / sine
        return u0[..., 0]

    def aim(self, angle: Array, wavelengths: Array, px: Array, py: Array) -> tuple[Array, Array]:
        """Return where to launch rays that meet the stop at (px, py), in its semi-diameters.

        Parameters
        ----------
        angle : ndarray
            Field angles (F,) [rad].
        wavelengths : ndarray
            Wavelengths (W,) [m].
        px, py : ndarray
            Places in the stop (P,).

        Returns
        -------
        u, v : ndarray
            (F, W, P) [m]; NaN where no ray meets it there.

        References
        ----------
        C. G. Broyden, Mathematics of Computation 19, 577-593, 1965 (steps without derivatives).
        """
        t = np.asarray(angle, float)[:, None, None]
        center = self.chief(angle, wavelengths)[..., None]
        small = 1e-4 * self.lens.pupil_diameter
        along = self._stop(t, wavelengths, center + small, np.zeros(1))
        across = self._stop(t, wavelengths, center, np.full(1, small))
        # The inverse of d(stop) / d(launch), which is diagonal for the chief ray.
        a, d = (np.where(slope == 0, 1.0, small / slope) for slope in (along[0], across[1]))
        shape = np.broadcast_shapes(center.shape, px.shape)
        inverse = [np.broadcast_to(e, shape).copy() for e in (a, 0.0, 0.0, d)]
        u, v = center + inverse[0] * px, inverse[3] * py
        fx, fy = (f - p for f, p in zip(self._stop(t, wavelengths, u, v), (px, py), strict=True))
        for _ in range(AIM_STEPS):
            if not (np.hypot(fx, fy) >= AIMED).any() and not np.isnan(fx).any():
                break
            du = -(inverse[0] * fx + inverse[1] * fy)
            dv = -(inverse[2] * fx + inverse[3] * fy)
            lost = np.isnan(fx)  # went too far: back to half the way from the chief ray
            du, dv = np.where(lost, (center - u) / 2, du), np.where(lost, -v / 2, dv)
            done = np.hypot(fx, fy) < AIMED  # another step would be one of rounding
            du, dv = np.where(done, 0.0, du), np.where(done, 0.0, dv)
            u, v = u + du, v + dv
            gx, gy = (
                g - p for g, p in zip(self._stop(t, wavelengths, u, v), (px, py), strict=True)
            )
            _update(inverse, du, dv, gx - fx, gy - fy)
            fx, fy = gx, gy
        missed = ~(np.hypot(fx, fy) < 1e-9)
        return np.where(missed, np.nan, u), np.where(missed, np.nan, v)

    def wavefront(
        self, angle: Array, wavelengths: Array, u: Array, v: Array, chief: Array
    ) -> Wavefront:
        """Return the wavefronts of rays about the chief rays.

        Parameters
        ----------
        angle : ndarray
            Field angles (F,) [rad].
        wavelengths : ndarray
            Wavelengths (W,) [m].
        u, v : ndarray
            Launching places (F, W, P) [m].
        chief : ndarray
            u of the chief rays (F, W) [m].

        Returns
        -------
        Wavefront
            Arrays (F, W, P). The reference sphere is about the chief ray's point on the image plane
            and goes through the center of the paraxial exit pupil of the primary wavelength.
        """
        main = self.trace(angle, wavelengths, chief[..., None], np.zeros(1)).rays
        found = self.trace(angle, wavelengths, u, v)
        rays = found.rays
        x, y = rays.x - main.x, rays.y - main.y
        along = x * rays.l + y * rays.m
        sign = math.copysign(1.0, self.exit_pupil)
        radius = sign * np.sqrt(self.exit_pupil**2 + main.x**2)
        # Back to the sphere by along + radius - short, in a form that keeps its digits.
        off = x**2 + y**2 - along**2
        with np.errstate(invalid="ignore"):
            short = off / (radius + sign * np.sqrt(radius**2 - off))
        back = short - along - radius
        return Wavefront(
            path=rays.path - main.path + (short - along),
            x=(x + back * rays.l) / radius + main.l,
            y=(y + back * rays.m) / radius,
            alive=rays.alive & main.alive & np.isfinite(short),
            landing_x=x,
            landing_y=y,
            clipped=found.fullness > 1,
        )

    def angle_of(self, heights: Array) -> Array:
        """Return the field angles (F,) [rad] whose chief rays land at heights (F,) [m].

        At the primary wavelength; NaN where no chief ray lands so far out.
        """
        wave = np.array([self.lens.primary])
        scale = self.image_scale
        wanted = np.asarray(heights, float)
        low, high = np.zeros(len(wanted)), np.arctan(wanted / scale)
        at_low, at_high = low - wanted, self.heights(high, wave)[:, 0] - wanted
        for _ in range(AIM_STEPS):
            if not (np.abs(at_high) > 1e-13 + 1e-12 * wanted).any():
                break
            change = np.where(at_high == at_low, 1.0, at_high - at_low)
            ahead = high - at_high * (high - low) / change
            # A failing ray lies too far out.
            ahead = np.where(np.isnan(at_high), (low + high) / 2, ahead)
            ahead = np.clip(ahead, 0.0, math.radians(89.9))
            lost = np.isnan(at_high)
            low, at_low = np.where(lost, low, high), np.where(lost, at_low, at_high)
            high = np.where(np.abs(at_high) > 1e-13 + 1e-12 * wanted, ahead, high)
            at_high = self.heights(high, wave)[:, 0] - wanted
        return np.where(np.abs(at_high) < 1e-9 + 1e-6 * wanted, high, np.nan)

    @property
    def image_scale(self) -> float:
        """Image height over the tangent of the field angle near the axis [m].

        That of paraxial chief rays on the image plane, which may lie out of focus.
        """
        first = self.paraxial
        away = self.lens.surfaces[-1].thickness - first.exit_pupil
        pupil_angle = 1 / first.pupil_magnification  # of a chief ray, behind over before
        return away * pupil_angle * (self._object_angle if math.isfinite(self.distance) else 1.0)

    @property
    def _object_angle(self) -> float:
        """Chief ray's slope at the entrance pupil over that from the object to the first vertex."""
        return self.distance / (self.distance + self.paraxial.entrance_pupil)

    def heights(self, angle: Array, wavelengths: Array) -> Array:
        """Return where chief rays meet the image plane: (F, W) [m]; NaN where they do not."""
        chief = self.chief(angle, wavelengths)
        rays = self.trace(angle, wavelengths, chief[..., None], np.zeros(1)).rays
        return np.where(rays.alive, rays.x, np.nan)[..., 0]


def _update(inverse: list[Array], du: Array, dv: Array, dx: Array, dy: Array) -> None:
    """Change the inverse Jacobians so that (dx, dy) leads to (du, dv)."""
    with np.errstate(all="ignore"):
        a, b, c, d = inverse
        miss_u, miss_v = du - (a * dx + b * dy), dv - (c * dx + d * dy)
        row_x, row_y = du * a + dv * c, du * b + dv * d
        weight = row_x * dx + row_y * dy
        fine = np.isfinite(weight) & (np.abs(weight) > 0)
        weight = np.where(fine, weight, 1.0)
        for entry, (miss, row) in zip(
            inverse,
            ((miss_u, row_x), (miss_u, row_y), (miss_v, row_x), (miss_v, row_y)),
            strict=True,
        ):
            entry += np.where(fine, miss * row / weight, 0.0)


def reversed_lens(lens: Prescription) -> Prescription:
    """Return the lens as light meets it that goes back from the image plane.

    Its first vertex is the last one's; behind its last surface lies the object's space.
    """
    backwards = lens.surfaces[::-1]
    gaps = [surface.thickness for surface in backwards[1:]] + [0.0]
    media = [surface.glass for surface in backwards[1:]] + [lens.surfaces[-1].glass]
    turned = tuple(
        replace(
            surface,
            curvature=-surface.curvature,
            asphere=tuple(-a for a in surface.asphere),
            thickness=gap,
            glass=glass,
        )
        for surface, gap, glass in zip(backwards, gaps, media, strict=True)
    )
    return replace(lens, surfaces=turned, stop=len(backwards) - 1 - lens.stop)
