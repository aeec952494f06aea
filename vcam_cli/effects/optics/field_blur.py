"""Blur by a wavefront error that changes over the field.

The file says what the wavefront is on the half-axis from the center to the right; the lens is
symmetric about its axis, so that elsewhere the wavefront is turned about it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.color_errors import WavelengthTable
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.blurs import FieldTransfer, Zone
from vcam_cli.effects.optics.wavefront_blur import (
    GREEN,
    AberrationBlur,
    DirectedBlur,
    Lens,
    SymmetricBlur,
    describe_focus,
    focus_table,
    uniform_wavefront,
    wavefronts,
)
from vcam_cli.physics import zernike
from vcam_cli.physics.zernike import Terms
from vcam_cli.records import dataclass

TYPICAL_CHANGE = 0.1
"""Change of a wavefront from center to corner [waves rms] for which the settings' number of places
is meant. Of other changes as many places are taken as err as little: see `places_needed`."""
MAX_PLACES = 33
"""Number of places on a stretch at which that ends; what more waves err by between them is stated.
With 13, defocus that grew by 1.2 and 2 um erred by 0.06 and 0.15 % of full signal."""


@dataclass(frozen=True)
class FieldBlur(AberrationBlur, FieldTransfer):
    """Wavefronts at places of the field, straight in between, turned with the azimuth."""

    lens: Lens
    places: tuple[tuple[float, Terms], ...]
    """((place from 0 center to 1 corner, terms), ...), rising"""
    half_diagonal: float
    """Half the diagonal of the sensor [m]."""
    focus: WavelengthTable | None = None
    """Shift of the image plane by wavelength [m]; None of one that is the same at all."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> FieldBlur | None:
        """Return the blur of a wavefront that changes over the field, else None."""
        if uniform_wavefront(camera, geometry) is not None:
            return None
        places = wavefronts(camera, geometry)
        listed = tuple((place or 0.0, terms) for place, terms in places)
        half_diagonal = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        lens = Lens.from_camera(camera, geometry)
        return cls(lens, listed, half_diagonal, focus_table(camera))

    @remembered(4)
    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        center, corner = (self.lens.describe(self.wavefront(place)) for place in (0.0, 1.0))
        found = f"center: {center}; corner: {corner}"
        return found if self.focus is None else f"{found}; {describe_focus(self.focus)}"

    @property
    def reach(self) -> float:
        """How far from its place the blur throws almost all of the light, diffraction aside [m]."""
        return max(self._blur(place).reach for place, _ in self.places)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) [m].

        Wavefronts change evenly between places, so that no slope exceeds those there.
        """
        spreads = [self._blur(place).spread(wavelengths) for place in self._ends]
        return np.asarray(np.max(spreads, axis=0))

    @property
    def _ends(self) -> tuple[float, ...]:
        """Places between which the wavefront changes evenly, center and corner among them."""
        return (0.0, *(place for place, _ in self.places if 0 < place < 1), 1.0)

    def _blur(self, place: float) -> DirectedBlur:
        """Return the blur on the half-axis to the right, at a place from 0 to 1."""
        return DirectedBlur(self.lens, self.wavefront(place), self.focus)

    @remembered(64)
    def wavefront(self, place: float) -> Terms:
        """Return the wavefront at a place on the half-axis to the right.

        Parameters
        ----------
        place : float
            Place from the center, 0, to the corner, 1.

        Returns
        -------
        Terms
            Coefficients by Noll index [m], interpolated linearly between the places of the file.
        """
        every = sorted({index for _, terms in self.places for index, _ in terms})
        where = [p for p, _ in self.places]
        listed = [dict(terms) for _, terms in self.places]
        return zernike.combine(
            tuple(
                (i, float(np.interp(place, where, [t.get(i, 0.0) for t in listed]))) for i in every
            )
        )

    @remembered(4)  # a plan prices an image through it a dozen times
    def rings(self, count: int) -> tuple[Zone, ...]:
        """Return `count` places from center to corner, or more, whose weights sum to 1.

        Each stretch on which the wavefront changes evenly has places of its own.
        """
        kind = DirectedBlur if self._azimuthal_order else SymmetricBlur
        found = self._rings(count)
        return tuple(Zone(kind(self.lens, terms, self.focus), weight) for terms, weight in found)

    def zones(self, count: int) -> tuple[Zone, ...]:
        """Return the rings cut into sectors; each turns the wavefront with its azimuth."""
        if not self._azimuthal_order:
            return self.rings(count)
        # As many harmonics around as powers outwards; a multiple of 4 has its quarter turns.
        most = max(map(len, self._stretches(count)))
        around = 4 * math.ceil((2 * self._azimuthal_order * (most - 1) + 1) / 4)
        return tuple(
            Zone(
                DirectedBlur(self.lens, terms, self.focus, angle=2 * math.pi * sector / around),
                replace(weight, sector=sector, around=around),
            )
            for terms, weight in self._rings(count)
            for sector in range(around)
        )

    def _rings(self, count: int) -> tuple[tuple[Terms, ZoneWeight], ...]:
        """Return the wavefront and the weight of each place on the half-axis, rising."""
        stretches = self._stretches(count)
        return tuple(
            (self.wavefront(place), ZoneWeight(stretches, place, 0, 0, self.half_diagonal))
            for place in sorted({place for nodes in stretches for place in nodes})
        )

    @property
    def _azimuthal_order(self) -> int:
        """The highest azimuthal order of the wavefronts; 0 where all are symmetric."""
        orders = {zernike.noll_orders(index)[1] for _, terms in self.places for index, _ in terms}
        return max((abs(m) for m in orders), default=0)

    @property
    def _changes(self) -> list[tuple[float, float, float]]:
        """Ends of the stretches on which the wavefront changes evenly, and the change [m rms]."""
        edges = self._ends
        minus = [tuple((i, -c) for i, c in self.wavefront(place)) for place in edges[:-1]]
        changes = [
            zernike.combine(a, self.wavefront(b)) for a, b in zip(minus, edges[1:], strict=True)
        ]
        return [(*ends, zernike.rms(c)) for ends, c in zip(pairwise(edges), changes, strict=True)]

    def _stretches(self, count: int) -> tuple[tuple[float, ...], ...]:
        """Return places in each stretch on which the wavefront changes evenly, with its ends.

        They are Chebyshev points, between which polynomials err least.
        """
        found = []
        for low, high, change in self._changes:
            steps = places_needed(change / GREEN, count) - 1
            at = (1 - np.cos(np.pi * np.arange(steps + 1) / steps)) / 2
            inner = (low + (high - low) * at[1:-1]).tolist()
            found.append((low, *inner, high))
        return tuple(found)

    def place_error(self, count: int) -> float:
        """Return what it errs by between places, where a stretch has more waves than they serve."""
        allowed = interpolation_error(TYPICAL_CHANGE, max(count, 2))
        waves = [change / GREEN for *_, change in self._changes]
        worst = max(interpolation_error(w, places_needed(w, count)) for w in waves)
        return min(worst, 1.0) if worst > allowed else 0.0

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        # Wavefronts change evenly in between: none is worse than that of one of its ends.
        return max(self._blur(place).mean_error(signal) for place in self._ends)


def places_needed(change: float, count: int) -> int:
    """Return the places between which an even change of the wavefront is interpolated well enough.

    Parameters
    ----------
    change : float
        Change of the wavefront along the stretch [waves rms].
    count : int
        Number of places whose error for a change of `TYPICAL_CHANGE` is allowed.

    Returns
    -------
    int
        Number of places, 2 to the larger of `MAX_PLACES` and `count`.
    """
    count = max(count, 2)
    most, allowed = max(MAX_PLACES, count), interpolation_error(TYPICAL_CHANGE, count)
    return next((n for n in range(2, most) if interpolation_error(change, n) <= allowed), most)


def interpolation_error(change: float, places: int) -> float:
    """Return the error of a transfer function between places of a stretch.

    Along it the transfer function turns like exp(i t theta), t from 0 to 1, by about twice the
    phase of the change. A polynomial through n Chebyshev points errs by 2 (theta / 4)^n / n!.

    Parameters
    ----------
    change : float
        Change of the wavefront along the stretch [waves rms].
    places : int
        Number of places, its ends among them.

    Returns
    -------
    float
        Error without unit.
    """
    return 2 * (math.pi * change) ** places / math.factorial(places)


@dataclass(frozen=True)
class ZoneWeight:
    """Weight of a zone: 1 in its place, 0 in those of all others.

    Between them a polynomial of the distance, on every stretch where the wavefront changes evenly,
    and a sum of waves of the azimuth. Beyond the corner that of the corner holds.
    """

    stretches: tuple[tuple[float, ...], ...]
    """Places of the rings on each stretch from center 0 to corner 1."""
    place: float
    """Place of this ring, from center 0 to corner 1."""
    sector: int
    """Index of the sector of the ring."""
    around: int
    """Number of sectors of a ring; 0 for a whole ring."""
    half_diagonal: float
    """Half the diagonal of the sensor [m]."""

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the weight at x (columns,), y (rows,) [m]: (rows, columns), in the type of x."""
        radius = np.minimum(np.hypot(x[None, :], y[:, None]) / self.half_diagonal, 1.0)
        weight = np.zeros(radius.shape)
        for nodes in self.stretches:
            if self.place in nodes:
                here = (radius >= nodes[0]) & (radius <= nodes[-1])
                weight[here] = _polynomial(radius[here], nodes, self.place)
        if self.around and weight.any():
            angle = np.arctan2(y[:, None], x[None, :]) - 2 * np.pi * self.sector / self.around
            weight *= _waves(angle, self.around)
        return weight.astype(x.dtype)


def _polynomial(place: Array, nodes: tuple[float, ...], own: float) -> Array:
    """Return Lagrange's polynomial, which is 1 at its own node and 0 at the others."""
    out = np.ones_like(place)
    for node in nodes:
        if node != own:
            out *= (place - node) / (own - node)
    return out


def _waves(angle: Array, count: int) -> Array:
    """Return the sum of waves that is 1 at angle 0 and 0 at the others of `count` (even)."""
    half = angle / 2
    near = np.abs(np.sin(half)) < 1e-6
    return np.where(near, 1.0, np.sin(count * half) / (count * np.tan(np.where(near, 1.0, half))))
