"""Wavefronts of field points on their true pupils, as polynomials, and the OTFs that follow.

They are those of the light of a point of the object. The edge is traced at the primary wavelength,
paths at a few wavelengths, between which polynomials in the wavenumber go.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.pupils import beam_edges
from vcam_cli.physics import shaped_pupil
from vcam_cli.physics.interpolation import lagrange
from vcam_cli.physics.shaped_pupil import Mask, OtfGrid
from vcam_cli.records import dataclass

ORDER = 12
"""Radial order of the polynomials: they leave 1e-3 waves of the lenses that ship, at full size."""
RINGS, SPOKES = 12, 14
"""Rays: Gauss's points of the radius squared, times angles over half of the stop."""
EDGE_ANGLES = 96
"""Directions of the pupil's edge."""
WAVELENGTHS = 5
"""Wavelengths that are traced: glasses are smooth."""
MARGIN = 1.02
"""Factor on the farthest ray: rays lie up to a hundredth of the pupil from its edge."""


class NoImage(ValueError):
    """Rays fail on their way, or none comes: what a message says."""


@dataclass(frozen=True, eq=False)
class FieldWavefronts:
    """Wavefronts of image points, all on the half-axis to the right of the center.

    The frame of a pupil is the box around it, -1 .. 1 on both sides.
    """

    heights: Array
    """Of the image points from the axis, at the primary wavelength (F,) [m]."""
    angles: Array
    """Field angles (F,) [rad]."""
    wavenumbers: Array
    """Traced (W,), rising [1/m]."""
    terms: Array
    """Coefficients (F, W, T) of the polynomials of `exponents(ORDER)` over the frame [m]."""
    half_frames: Array
    """Half width and half height of the frame (F, W, 2), direction cosines."""
    edges: Array
    """(F, 2, angles) of the edge in the frame, x and y."""
    farthest: Array
    """Landing point furthest from the chief ray's (F,) [m]."""
    typical: Array
    """Distance within which 90 % of the rays land (F, W) [m]."""
    shifts: Array
    """Chief ray's landing point behind the image point, outwards (F, W) [m]."""
    residual: Array
    """What the polynomials leave of the paths, rms (F,) [m]."""
    lost: Array
    """Share of the rays through the stop that fail (F,)."""

    @cached_property
    def areas(self) -> Array:
        """Area of the pupils (F,) at the primary wavelength [sr]."""
        x, y = self.edges[:, 0], self.edges[:, 1]
        box = (x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1) / 2
        middle = self.half_frames[:, self.half_frames.shape[1] // 2]
        return np.asarray(np.abs(box) * middle[:, 0] * middle[:, 1])

    def at(self, place: int) -> PlaceWavefront:
        """Return the wavefronts of one image point."""
        return PlaceWavefront(self, place)


@dataclass(frozen=True, eq=False)
class PlaceWavefront:
    """The wavefronts of one image point."""

    field: FieldWavefronts
    place: int

    def _between(self, values: Array, wavelength: float) -> Array:
        """Return values (W, ...) of the traced wavelengths at another one."""
        return np.asarray(np.tensordot(lagrange(self.field.wavenumbers, 1 / wavelength), values, 1))

    def terms(self, wavelength: float) -> Array:
        """Return the coefficients (T,) at a wavelength [m]."""
        return self._between(self.field.terms[self.place], wavelength)

    def half_frame(self, wavelength: float) -> Array:
        """Return half width and half height of the frame, direction cosines."""
        return self._between(self.field.half_frames[self.place], wavelength)

    @cached_property
    def slope(self) -> float:
        """Largest slope of the wavefronts, tilt among it [m per half frame]."""
        at = np.linspace(-1, 1, 41)
        x, y = (a.ravel() for a in np.meshgrid(at, at))
        inside = self.contains(x, y)
        found = (
            shaped_pupil.slopes(terms, ORDER, x[inside], y[inside])
            for terms in self.field.terms[self.place]
        )
        return max(float(np.hypot(*both).max()) for both in found)

    def deformation(self, wavelength: float) -> float:
        """Return the rms of the wavefront over the pupil, piston and tilt aside [m]."""
        at = np.linspace(-1, 1, 41)
        x, y = (a.ravel() for a in np.meshgrid(at, at))
        inside = self.contains(x, y)
        path = shaped_pupil.basis(x[inside], y[inside], ORDER) @ self.terms(wavelength)
        plane = np.stack([np.ones(len(path)), x[inside], y[inside]], axis=1)
        rest = path - plane @ np.linalg.lstsq(plane, path, rcond=None)[0]
        return float(np.sqrt(np.mean(rest**2)))

    def contains(self, x: Array, y: Array) -> Array:
        """Return whether places of the frame lie in the pupil."""
        edge_x, edge_y = self.field.edges[self.place]
        middle = (edge_x.max() + edge_x.min()) / 2
        angle = np.arctan2(edge_y, edge_x - middle)
        order = np.argsort(angle)
        radius = np.hypot(edge_x - middle, edge_y)[order]
        allowed = np.interp(np.arctan2(y, x - middle), angle[order], radius, period=2 * math.pi)
        return np.asarray(np.hypot(x - middle, y) < allowed)

    def mask(self, samples: int) -> Mask:
        """Return the pupil's shape on a grid of its frame."""
        return shaped_pupil.mask(self.contains, samples)

    def grid(self, wavelength: float, pupil: Mask, farthest: float = 2.0) -> OtfGrid:
        """Return the OTF at a wavelength over lags in half frames, up to one of them."""
        return shaped_pupil.otf_grid(pupil, self.terms(wavelength) / wavelength, ORDER, farthest)

    def cutoff(self, wavelength: float) -> float:
        """Return a frequency from which nothing is left [cycles/m]."""
        half = self.half_frame(wavelength)
        x, y = self.field.edges[self.place] * half[:, None]
        widths = np.hypot(x[:, None] - x, y[:, None] - y)
        return float(widths.max()) / wavelength

    def spread(self, wavelength: float) -> float:
        """Return a bound on |1 - H(f)| / (2 pi |f|) [m].

        Two pupils a lag s apart lose less than s times their largest width of their area; what
        they share differs in phase by 2 pi f times the landing points' distance at most.
        """
        half = self.half_frame(wavelength)
        area = math.pi * half[0] * half[1] * self._share
        return float(wavelength * 2 * half.max() / area / (2 * math.pi)) + float(
            self.field.farthest[self.place]
        )

    @cached_property
    def _share(self) -> float:
        """Area of the pupil over that of the frame's ellipse."""
        x, y = self.field.edges[self.place]
        return abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / (2 * math.pi)


def trace_field(
    view: View, heights: Array, shortest: float, longest: float, vignetted: bool = True
) -> FieldWavefronts:
    """Trace the wavefronts of image points.

    Parameters
    ----------
    view : View
        The lens before its object.
    heights : ndarray
        Distances of the image points from the axis (F,) [m].
    shortest, longest : float
        Range of wavelengths that will be evaluated [m].
    vignetted : bool
        Whether the apertures that the file fixes clip, besides the stop.

    Returns
    -------
    FieldWavefronts
        The wavefronts.

    Raises
    ------
    NoImage
        Where no chief ray lands at a height, or no light comes there.
    """
    heights = np.asarray(heights, float)
    angles = view.angle_of(heights)
    if np.isnan(angles).any():
        worst = float(heights[np.isnan(angles)].min())
        raise NoImage(f"no ray through the center of its stop lands {worst * 1e3:.4g} mm off axis")
    primary = np.array([view.lens.primary])
    beam = beam_edges(view, angles, view.lens.primary, EDGE_ANGLES, vignetted)
    if np.isnan(beam.center).any():
        worst = float(heights[np.isnan(beam.center[:, 0])].min())
        raise NoImage(f"its apertures let no light through {worst * 1e3:.4g} mm off axis")
    azimuth = 2 * np.pi * np.arange(EDGE_ANGLES) / EDGE_ANGLES
    rim_u = beam.center[..., None] + beam.radius * np.cos(azimuth)
    rim_v = beam.radius * np.sin(azimuth)
    rim = view.wavefront(angles, primary, rim_u, rim_v, view.chief(angles, primary))
    edge_x, edge_y = rim.x[:, 0], rim.y[:, 0]
    ends = edge_x.max(axis=1), edge_x.min(axis=1)
    middle, half_x = (ends[0] + ends[1]) / 2, (ends[0] - ends[1]) / 2
    half_y = edge_y.max(axis=1)
    wavenumbers = _nodes(1 / longest, 1 / shortest)
    wavelengths = 1 / wavenumbers
    px, py, weight = _stop_points()
    u, v = view.aim(angles, np.append(wavelengths, primary), px, py)
    starts = view.chief(angles, np.append(wavelengths, primary))
    front = view.wavefront(angles, np.append(wavelengths, primary), u, v, starts)
    alive = front.alive & np.isfinite(front.path)
    if not alive.any(axis=-1).all():
        worst = float(heights[~alive.any(axis=(1, 2))].min(initial=heights.max()))
        raise NoImage(f"all rays fail {worst * 1e3:.4g} mm off axis")
    # Other wavelengths have the shape of the primary one, as much wider as rays of the stop lie.
    wide = _extent(front.x, alive), _extent(front.y, alive)
    scale = np.stack([(w / w[:, -1:])[:, :-1] for w in wide], axis=-1)
    half_frames = np.stack([half_x, half_y], axis=-1)[:, None] * scale
    count = len(shaped_pupil.exponents(ORDER))
    terms = np.zeros((len(heights), len(wavelengths), count))
    left = np.zeros(len(heights))
    for f in range(len(heights)):
        for w in range(len(wavelengths)):
            own = alive[f, w]
            x = (front.x[f, w][own] - middle[f] * scale[f, w, 0]) / half_frames[f, w, 0]
            y = front.y[f, w][own] / half_frames[f, w, 1]
            terms[f, w], rest = _fit(x, y, front.path[f, w][own], weight[own])
            left[f] = max(left[f], rest)
    lands = np.where(alive & ~front.clipped, np.hypot(front.landing_x, front.landing_y), 0.0)
    edges = np.stack([(edge_x - middle[:, None]) / half_x[:, None], edge_y / half_y[:, None]], 1)
    return FieldWavefronts(
        heights,
        angles,
        wavenumbers,
        terms,
        half_frames,
        edges,
        MARGIN * lands.max(axis=(1, 2)),
        np.quantile(lands[:, :-1], 0.9, axis=2),
        (view.heights(angles, wavelengths) - heights[:, None]),
        left,
        1 - alive.mean(axis=1) @ (weight / weight.sum()),
    )


def _fit(x: Array, y: Array, path: Array, weight: Array) -> tuple[Array, float]:
    """Return the coefficients of the polynomials even in y, and the rms that they leave."""
    columns = shaped_pupil.basis(x, y, ORDER)
    root = np.sqrt(weight / weight.sum())[:, None]
    found = np.linalg.lstsq(columns * root, path * root[:, 0], rcond=1e-9)[0]
    return found, float(np.sqrt(((columns @ found - path) ** 2 * root[:, 0] ** 2).sum()))


def _stop_points() -> tuple[Array, Array, Array]:
    """Return points of the upper half of the stop, and their weights, in its semi-diameters."""
    node, weight = np.polynomial.legendre.leggauss(RINGS)
    angle = (np.arange(SPOKES) + 0.5) * (np.pi / SPOKES)
    radius = np.sqrt((node + 1) / 2)[:, None]
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return x.ravel(), y.ravel(), np.repeat(weight / 2, SPOKES)


def _extent(across: Array, alive: Array) -> Array:
    """Return the rms width (F, W) of rays."""
    count = np.maximum(alive.sum(axis=-1), 1)
    mean = np.where(alive, across, 0).sum(axis=-1) / count
    square = np.where(alive, across, 0) ** 2
    return np.asarray(np.sqrt(np.maximum(square.sum(axis=-1) / count - mean**2, 1e-300)))


def _nodes(low: float, high: float) -> Array:
    """Return the wavenumbers to trace: Chebyshev's points of the range, or one."""
    if high <= low * (1 + 1e-9):
        return np.array([low])
    angle = (np.arange(WAVELENGTHS) + 0.5) * (math.pi / WAVELENGTHS)
    return np.asarray((low + high) / 2 - (high - low) / 2 * np.cos(angle))
