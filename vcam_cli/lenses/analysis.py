"""What an optical engineer looks at: rays, spots, distortion and color of a lens."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.tracing import points, sag
from vcam_cli.records import dataclass

SPOT_RINGS = 8
"""Rings of rays of a spot diagram."""
FAN = 7
"""Rays of a meridional fan that is drawn."""
OUTLINE = 65
"""Points of a surface that is drawn."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A section through the lens. Lengths in [m], z from the first vertex."""

    outlines: tuple[tuple[Array, Array], ...]
    """z and x of every surface."""
    glasses: tuple[bool, ...]
    """Whether glass lies behind each."""
    fans: tuple[tuple[Array, Array], ...]
    """z and x (S + 2, rays) of the rays of each field, from before the lens to the image."""
    stop: tuple[float, float]
    """z and semi-diameter of the stop."""


def drawing(view: View, angles: Array) -> Drawing:
    """Return a section through the lens with fans of rays of some fields (F,) [rad]."""
    lens, waves = view.lens, np.array([view.lens.primary])
    at = np.linspace(-1, 1, FAN)
    u, v = view.aim(angles, waves, at, 0 * at)
    rays = view.launch(np.asarray(angles)[:, None, None], u, v)
    x, z = points(lens.surfaces, lens.indices(waves)[:, :, None], rays)
    back = 0.15 * lens.length
    start_x, start_z = rays.x - (rays.z + back) / rays.n * rays.l, np.full(rays.x.shape, -back)
    x, z = np.concatenate([start_x[None], x]), np.concatenate([start_z[None], z])
    fans = tuple((z[:, f, 0], x[:, f, 0]) for f in range(len(angles)))
    heights = np.nanmax(np.abs(x), axis=(1, 2, 3))[1:-1]
    vertices = np.cumsum([0.0, *(s.thickness for s in lens.surfaces[:-1])])
    outlines = []
    for surface, used, vertex in zip(lens.surfaces, heights, vertices, strict=True):
        edge = surface.semi_diameter if np.isfinite(surface.semi_diameter) else 1.05 * used
        height = np.linspace(-edge, edge, OUTLINE)
        outlines.append((vertex + sag(surface, height), height))
    stop = float(vertices[lens.stop]), view.paraxial.stop_semi_diameter
    glasses = tuple(s.glass.name != "air" for s in lens.surfaces)
    return Drawing(tuple(outlines), glasses, fans, stop)


@dataclass(frozen=True, eq=False)
class Spots:
    """Where rays of field points land, about the chief ray of the primary wavelength [m]."""

    x: Array
    y: Array
    """(F, W, rays); NaN where an aperture stops the ray."""

    @property
    def rms(self) -> Array:
        """Rms distance (F,) from the centroid of all wavelengths."""
        x = self.x - np.nanmean(self.x, axis=(1, 2), keepdims=True)
        y = self.y - np.nanmean(self.y, axis=(1, 2), keepdims=True)
        return np.asarray(np.sqrt(np.nanmean(x**2 + y**2, axis=(1, 2))))


def spots(view: View, angles: Array, wavelengths: Array) -> Spots:
    """Return the spot diagrams of fields (F,) [rad] at wavelengths (W,) [m]."""
    px, py = [0.0], [0.0]
    for ring in range(1, SPOT_RINGS + 1):  # six more in every ring: even in area
        turn = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        px += (ring / SPOT_RINGS * np.cos(turn)).tolist()
        py += (ring / SPOT_RINGS * np.sin(turn)).tolist()
    u, v = view.aim(angles, wavelengths, np.array(px), np.array(py))
    found = view.trace(angles, wavelengths, u, v)
    chief = view.heights(angles, np.array([view.lens.primary]))
    lost = ~found.rays.alive | (found.fullness > 1)
    x = np.where(lost, np.nan, found.rays.x - chief[..., None])
    return Spots(x, np.where(lost, np.nan, found.rays.y))


def ideal_ratio(view: View, angles: Array, wavelengths: Array) -> Array:
    """Return chief rays' heights over those of an ideal lens (F, W), fields without 0.

    Ideal is the scale of paraxial chief rays of the primary wavelength on the image plane.
    """
    found = view.heights(angles, wavelengths)
    return np.asarray(found / (view.image_scale * np.tan(angles))[:, None])
