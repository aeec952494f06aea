"""Blur of a lens that is traced: wavefronts by field and wavelength on its true pupils.

It is the full transfer function, diffraction in it. With diffraction switched off the same
wavefronts throw rays: a ray lands dW/dx beside the chief ray's point, x in direction cosines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.color_errors import WavelengthTable
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.prescription import lateral_color, wavefronts
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.effects.base import SignalLevels, switched_off
from vcam_cli.effects.blurs import INTERPOLATION, FieldTransfer, PlaneTransfer, Zone
from vcam_cli.effects.optics.field_blur import ZoneWeight
from vcam_cli.effects.optics.wavefront_blur import GREEN, AberrationBlur
from vcam_cli.effects.warps import Magnification
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.wavefronts import ORDER, PlaceWavefront
from vcam_cli.parallel import product
from vcam_cli.physics import shaped_pupil
from vcam_cli.physics.aberration import MAX_SLOPE
from vcam_cli.physics.interpolation import between_entries, lagrange
from vcam_cli.physics.pupil_harmonics import direction_harmonics
from vcam_cli.physics.shaped_pupil import OtfGrid
from vcam_cli.records import dataclass

FEWEST_PLACES, MOST_PLACES = 5, 9
"""Places from center to corner between which transfer functions are polynomials."""
PLACES_PER_WAVE = 3.0
"""Further places for each wave by which the rms of the wavefront changes."""
MOST_CYCLES = 16.0
"""Frequency times the blur's radius from which the transfer is 0: of an evenly filled
disk it is a thousandth."""
LEAST_RADIUS = 1e-8
"""Of such a blur [m]."""
FEWEST_NODES, NODES_PER_CYCLE, MOST_BLUR_CYCLES = 5, 3.0, 4.0
"""Wavelengths at which transfers are computed, and further ones for each cycle by which the blur's
radius changes over the band at the highest frequency; of more cycles little contrast is left."""
STEPS_PER_PERIOD = 16.0
"""Steps of tables of harmonics in one period of the phase of the blur's reach: polynomials through
six entries err by 2e-5 of the light that falls there."""
STENCIL = 6
"""Entries of such a table through which a polynomial goes."""
HARMONICS = 1 << 27
"""Memory of the tables of the last lenses [bytes]: 1 MB for each place of the shipped double Gauss
at f/8, 9 MB for one of the strongest blurs that are traced as waves. The former's are 0.9 of 1.7 s
of processor time of a slanted edge on 2 megapixels."""
GRID_SAMPLE = 25e-9
"""One sample of a padded pupil through its transforms, and harmonics from its grid [s]: 16 to 29 ns
were measured on double Gausses from f/2.8 to f/11."""
RAYS = 48
"""Rays across a pupil where they are traced without diffraction."""


@dataclass(frozen=True, eq=False)
class PlaceBlur(AberrationBlur, PlaneTransfer):
    """The blur of a traced lens in one place, turned about the axis by an angle [rad]."""

    wavefront: PlaceWavefront
    diffracts: bool
    longest: float
    shortest: float
    """Range of wavelengths at which it is computed [m]."""
    color: WavelengthTable | None
    """Magnification by wavelength, which `lateral_color` simulates; None where this blur does."""
    angle: float = 0.0
    kept: dict[float, OtfGrid] = field(default_factory=dict)
    """Grids by wavelength, shared by all angles."""
    lock: Lock = field(default_factory=Lock)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: neither the lock nor grids that can be computed again."""
        return {**self.__dict__, "kept": {}, "lock": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take a pickled state, with a lock of its own."""
        self.__dict__.update(state, lock=Lock())

    library_bytes = INTERPOLATION

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return None: a camera has `TracedBlur`."""
        return None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        waves = self.wavefront.deformation(GREEN) / GREEN
        known = self.wavefront.field
        nearest = int(np.abs(1 / known.wavenumbers - GREEN).argmin())
        width = 2 * float(known.typical[self.wavefront.place, nearest])
        return f"{waves:.3g} waves rms at 550 nm, blurs points to {width * 1e6:.3g} um"

    @property
    def typical(self) -> float:
        """Radius that 90 % of the rays land in, at the worst wavelength [m]."""
        return float(self.wavefront.field.typical[self.wavefront.place].max())

    @property
    def reach(self) -> float:
        """How far from its place it throws almost all of the light [m]."""
        airy = 2 * GREEN / self._width if self.diffracts else 0.0
        moved = max(abs(self._shift(w)) for w in (self.shortest, self.longest))
        return self.typical + airy + moved

    @property
    def _width(self) -> float:
        return float(2 * self.wavefront.half_frame(GREEN).min())

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) at wavelengths (J,) [m]."""
        known, place = self.wavefront.field, self.wavefront.place
        moved = np.array([abs(self._shift(w)) for w in wavelengths.tolist()])
        if not self.diffracts:
            return np.asarray(moved + float(known.farthest[place]))
        blurred = np.array([self.wavefront.spread(w) for w in wavelengths.tolist()])
        return np.asarray(moved + blurred)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or counts as zero [cycles/m]."""
        rays = self._blurred_out(wavelength)
        return min(self.wavefront.cutoff(wavelength), rays) if self.diffracts else rays

    def _blurred_out(self, wavelength: float) -> float:
        """Return the frequency from which rays of a wavelength leave nothing [cycles/m]."""
        known = self.wavefront.field
        widths = known.typical[self.wavefront.place]
        radius = float(np.interp(1 / wavelength, known.wavenumbers, widths))
        return MOST_CYCLES / max(radius, LEAST_RADIUS)

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n)."""
        return self._turned_otf(fx[None, :], fy[:, None], wavelength)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction."""
        return self._turned_otf(across[0] * frequency, across[1] * frequency, wavelength)

    def harmonics(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer (J, n, m) as harmonics of the direction, for the angle 0."""
        shares = lagrange(self._nodes, 1 / wavelengths)
        ends = [self.cutoff(w) for w in wavelengths.tolist()]
        nodes = self._harmonics_at_nodes(frequency)
        between = product(shares, nodes.reshape(len(nodes), -1).view(np.float64))
        between = between.view(np.complex128).reshape(len(shares), *nodes.shape[1:])
        for part, end in zip(between, ends, strict=True):
            part[frequency >= end] = 0
        return np.asarray(between)

    def _harmonics_at_nodes(self, frequency: Array) -> Array:
        """Return the harmonics (nodes, n, m), between the entries of a table up to their end.

        Light in parts of the spectrum, and further frames through the lens, share the table. Rays
        cost as much for each frequency: few are computed without one.
        """
        at = np.minimum(frequency, self._end)
        if self.diffracts:
            return between_entries(self._table(self._end), at / self._step, STENCIL, 1)
        inside = int(np.count_nonzero(frequency < self._end))
        if inside < self._entries(float(at.max())) // 2:
            few = self._kept_harmonics(frequency[:inside]).astype(np.complex128)
            return np.pad(few, ((0, 0), (0, len(frequency) - inside), (0, 0)))
        return between_entries(self._table(float(at.max())), at / self._step, STENCIL, 1)

    @property
    def _step(self) -> float:
        """Distance of a table's entries [cycles/m]."""
        return 1 / (STEPS_PER_PERIOD * self.reach)

    def _entries(self, highest: float) -> int:
        return math.ceil(highest / self._step) + STENCIL

    def _table(self, highest: float) -> Array:
        """Return the harmonics (nodes, entries, m) from 0 to a frequency [cycles/m]."""
        return self._kept_harmonics(self._step * np.arange(self._entries(highest)))

    def most_harmonics(self, wavelengths: Array) -> int:
        """Return the number of harmonics: of waves that of its table, which is made once."""
        if not self.diffracts:
            return super().most_harmonics(wavelengths)
        return int(self._table(self._end).shape[-1])

    def kept_bytes(self, wavelengths: Array, by_harmonics: bool = False) -> int:
        """Return the memory of its table, and of the grids that it is made from [bytes]."""
        if not self.diffracts:
            return 0
        return self._table(self._end).nbytes + sum(grid.nbytes for grid in self.kept.values())

    def _kept_harmonics(self, frequency: Array) -> Array:
        key = self.wavefront.field, self.wavefront.place, self.diffracts, self.color
        return _HARMONICS.get(
            (*key, frequency.tobytes(), self.shortest, self.longest),
            lambda: self._direct_harmonics(frequency).astype(np.complex64),
        )

    @property
    def _end(self) -> float:
        """Frequency from which the transfer is 0 at all wavelengths [cycles/m]."""
        radius = float(self.wavefront.field.typical[self.wavefront.place].min())
        rays = MOST_CYCLES / max(radius, LEAST_RADIUS)
        return min(self.wavefront.cutoff(self.shortest), rays) if self.diffracts else rays

    def _direct_harmonics(self, frequency: Array) -> Array:
        """Return the harmonics (nodes, n, m) at frequencies (n,) in even steps."""

        def values(angles: Array) -> Array:
            # A wavefront even in y: H(pi - theta) is the conjugate of H(theta).
            half = angles[angles < (1 + 1e-9) * np.pi / 2]
            nodes = range(len(self._nodes))
            if self.diffracts:
                fx, fy = (np.multiply.outer(frequency, along(half)) for along in (np.cos, np.sin))
                found = np.array([self._at_node(fx, fy, node) for node in nodes])
            else:
                found = np.array([self._harmonic_rays(frequency, half, node) for node in nodes])
            first = 1 if angles[0] == 0 else 0
            mirrored = found[..., first : first + len(angles) - len(half)]
            return np.concatenate([found, mirrored[..., ::-1].conj()], axis=-1)

        return direction_harmonics(values)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        # A wavefront even in y: a quarter of all frequencies has the losses of the others.
        f = np.linspace(0, 0.999 * self.cutoff(GREEN), 33)
        loss = np.abs(1 - self._upright_otf(f[None, :], f[:, None], GREEN)).max()
        return float(loss) * float(signal.full_signal)

    def _turned_otf(self, fx: Array, fy: Array, wavelength: float) -> Array:
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return self._upright_otf(cos * fx + sin * fy, cos * fy - sin * fx, wavelength)

    def _upright_otf(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at frequencies that broadcast, for the angle 0.

        At one frequency it is smooth in the wavelength: rays land where they do.
        """
        shares = lagrange(self._nodes, 1 / wavelength)
        total = sum(
            share * self._at_node(fx, fy, node) for node, share in enumerate(shares.tolist())
        )
        return np.where(np.hypot(fx, fy) < self.cutoff(wavelength), total, 0.0)

    @cached_property
    def _nodes(self) -> Array:
        """Wavenumbers at which it is computed: the more, the more the blur changes by color."""
        known = self.wavefront.field
        if len(known.wavenumbers) == 1:
            return known.wavenumbers
        widths = known.typical[self.wavefront.place]
        cycles = float(np.ptp(widths)) * self.wavefront.cutoff(self.longest)
        count = FEWEST_NODES + math.ceil(NODES_PER_CYCLE * min(cycles, MOST_BLUR_CYCLES))
        low, high = 1 / self.longest, 1 / self.shortest
        angle = (np.arange(count) + 0.5) * (math.pi / count)
        return np.asarray((low + high) / 2 - (high - low) / 2 * np.cos(angle))

    def _at_node(self, fx: Array, fy: Array, node: int) -> Array:
        """Return the transfer at a traced wavelength; 0 where rays leave nothing."""
        wavelength = 1 / float(self._nodes[node])
        inside = np.hypot(fx, fy) < self._blurred_out(wavelength)
        fx, fy = np.where(inside, fx, 0.0), np.where(inside, fy, 0.0)
        found = (self._by_waves if self.diffracts else self._by_rays)(fx, fy, wavelength)
        moved = np.exp(-2j * np.pi * fx * self._shift(wavelength))
        return np.where(inside, found * moved, 0.0)

    def _shift(self, wavelength: float) -> float:
        """Return how far outwards a color lies beside what `lateral_color` moves it to [m]."""
        known, place = self.wavefront.field, self.wavefront.place
        found = float(lagrange(known.wavenumbers, 1 / wavelength) @ known.shifts[place])
        if self.color is None:
            return found
        return found - float(self.color.at(wavelength)) * float(known.heights[place])

    def _by_waves(self, fx: Array, fy: Array, wavelength: float) -> Array:
        half = self.wavefront.half_frame(wavelength)
        sx, sy = wavelength * fx / half[0], wavelength * fy / half[1]
        farthest = max(float(np.abs(sx).max()), float(np.abs(sy).max()))
        return self._grid(wavelength, min(farthest, 2.0)).interpolate(sx, sy)

    def _grid(self, wavelength: float, farthest: float) -> OtfGrid:
        """Return the OTF at a wavelength, up to the longest lag requested before."""
        with self.lock:
            kept = self.kept.get(wavelength)
            if kept is None or kept.farthest < farthest:
                kept = self.wavefront.grid(wavelength, self._mask, min(1.05 * farthest, 2.0))
                self.kept[wavelength] = kept
            return kept

    @property
    def samples(self) -> int:
        """Samples of its pupil, padded, at all wavelengths of its grids."""
        across = shaped_pupil.samples_across(self.wavefront.slope / self.shortest)
        return len(self._nodes) * (2 * across) ** 2

    @cached_property
    def _mask(self) -> shaped_pupil.Mask:
        return self.wavefront.mask(
            shaped_pupil.samples_across(self.wavefront.slope / self.shortest)
        )

    def _by_rays(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the mean of exp(-2 pi i f . r) over rays that land at r."""
        x, y = self._landings(wavelength)
        fx, fy = np.broadcast_arrays(fx, fy)
        out = np.empty(fx.size, np.complex128)
        for i in range(0, fx.size, 256):
            some = slice(i, i + 256)
            turns = np.outer(fx.ravel()[some], x) + np.outer(fy.ravel()[some], y)
            out[some] = np.exp(-2j * np.pi * turns).mean(axis=1)
        return out.reshape(fx.shape)

    def _harmonic_rays(self, frequency: Array, angles: Array, node: int) -> Array:
        """Return what `_at_node` does by rays at frequencies (n,) in directions (d,): (n, d).

        Frequencies lie in even steps. The wave of the one in place a s + b is the product of those
        of two places: each ray has 2 sqrt(n) of them in place of n.
        """
        wavelength, count = 1 / float(self._nodes[node]), len(frequency)
        x, y = self._landings(wavelength)
        side = math.isqrt(max(count - 1, 0)) + 1
        start, step = float(frequency[0]), float(np.ptp(frequency)) / max(count - 1, 1)
        near, far = start + step * np.arange(side), step * side * np.arange(side)
        found = np.empty((count, len(angles)), np.complex128)
        for column, angle in enumerate(angles.tolist()):
            turns = -2j * np.pi * (math.cos(angle) * x + math.sin(angle) * y)
            waves = np.exp(np.outer(far, turns)) @ np.exp(np.outer(near, turns)).T
            found[:, column] = waves.ravel()[:count] / len(x)
        outwards = np.outer(frequency, np.cos(angles)) * self._shift(wavelength)
        found *= np.exp(-2j * np.pi * outwards)
        found[frequency >= self._blurred_out(wavelength)] = 0
        return found

    def _landings(self, wavelength: float) -> tuple[Array, Array]:
        at = np.linspace(-1, 1, RAYS + 1)[:-1] + 1 / RAYS
        x, y = (a.ravel() for a in np.meshgrid(at, at))
        inside = self.wavefront.contains(x, y)
        terms = self.wavefront.terms(wavelength)
        slopes = shaped_pupil.slopes(terms, ORDER, x[inside], y[inside])
        half = self.wavefront.half_frame(wavelength)
        return slopes[0] / half[0], slopes[1] / half[1]


@dataclass(frozen=True)
class TracedBlur(AberrationBlur, FieldTransfer):
    """A traced lens: its blur at places from the center to the corner."""

    view: View
    half_diagonal: float
    """Half the diagonal of the sensor [m]."""
    shortest: float
    longest: float
    """Range of wavelengths [m]."""
    diffracts: bool
    has_color: bool = False
    """Whether it displaces by the wavelength all that the lens does."""

    reference = "traced: Welford 1986, chapters 4 and 7; Hopkins 1985, doi:10.1364/AO.24.002491"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> TracedBlur | None:
        """Return the blur of a lens given by its prescription, else None."""
        view = traced_view(camera, geometry.object_distance)
        if view is None:
            return None
        half_diagonal = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        band = camera.scene.wavelengths
        diffracts = camera.optics.diffraction and not switched_off(camera, "diffraction")
        return cls(view, half_diagonal, band.start, band.stop, diffracts)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        center, *_, corner = self._places(FEWEST_PLACES)
        return (
            f"{self.view.lens.name}, traced: center {center.describe()}; corner {corner.describe()}"
        )

    @property
    def failing(self) -> tuple[tuple[float, float], ...]:
        """Share of the rays through the stop that fail, by image height [m], where any do."""
        places = self._places(FEWEST_PLACES)
        known = places[0].wavefront.field
        listed = zip(known.heights.tolist(), known.lost.tolist(), strict=True)
        return tuple((height, lost) for height, lost in listed if lost > 0)

    @property
    def table_seconds(self) -> float:
        """Core seconds of the grids of all places and wavelengths, in the first frame."""
        if not self.diffracts:
            return 0.0
        places = self._places(FEWEST_PLACES)
        return GRID_SAMPLE * sum(place.samples for place in places)

    @property
    def _color(self) -> WavelengthTable:
        return lateral_color(self.view, self.half_diagonal, self.shortest, self.longest)

    def magnifying(self, warps: Sequence[Magnification]) -> TracedBlur | None:
        """Return the blur with the lens's lateral color in it, where that is the plainer way."""
        if [warp.name for warp in warps] != ["lateral_color"] or self.has_color:
            return None
        values = [value for _, value in self._color.points]
        apart = self.half_diagonal * (max(values) - min(values))
        return self._magnifying if apart <= self.reach else None

    @cached_property
    def _magnifying(self) -> TracedBlur:
        return replace(self, has_color=True)

    @property
    def reach(self) -> float:
        """How far from its place the blur throws almost all of the light [m]."""
        return max(place.reach for place in self._places(FEWEST_PLACES))

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) at the places that are traced [m]."""
        places = self._places(MOST_PLACES)
        return np.asarray(np.max([place.spread(wavelengths) for place in places], axis=0))

    def check(self) -> None:
        """Raise BadInput where no image is formed, ValueError for too steep a wavefront."""
        if not self.diffracts:
            return
        steepest = max(p.wavefront.slope for p in self._places(FEWEST_PLACES)) / self.shortest
        if steepest > MAX_SLOPE:
            raise ValueError(
                f"gives a wavefront that rises by {steepest:.4g} wavelengths of"
                f" {self.shortest * 1e9:.4g} nm over a pupil radius; at most {MAX_SLOPE:g} can be"
                " followed"
            )

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return max(place.mean_error(signal) for place in self._places(FEWEST_PLACES))

    def rings(self, count: int) -> tuple[Zone, ...]:
        """Return blurs at Chebyshev's points from center to corner, whose weights sum to 1."""
        places = self._places(self._enough(count))
        nodes = tuple((p.wavefront.field.heights[p.wavefront.place] / self.half_diagonal)
                      for p in places)  # fmt: skip
        return tuple(
            Zone(place, ZoneWeight((nodes,), node, 0, 0, self.half_diagonal))
            for place, node in zip(places, nodes, strict=True)
        )

    def zones(self, count: int) -> tuple[Zone, ...]:
        """Return the rings cut into sectors; each turns the blur with its azimuth."""
        around = 4 * math.ceil((4 * (self._enough(count) - 1) + 1) / 4)
        return tuple(
            Zone(
                replace(ring.blur, angle=2 * math.pi * sector / around),  # type: ignore[type-var]
                replace(ring.weight, sector=sector, around=around),  # type: ignore[type-var]
            )
            for ring in self.rings(count)
            for sector in range(around)
        )

    def _enough(self, count: int) -> int:
        few = self._places(FEWEST_PLACES)
        rms = np.array([place.wavefront.deformation(GREEN) for place in few]) / GREEN
        waves = float(np.abs(np.diff(rms)).sum())
        wanted = max(count, FEWEST_PLACES) + math.ceil(PLACES_PER_WAVE * waves)
        return min(wanted, max(count, MOST_PLACES))

    def _places(self, count: int) -> tuple[PlaceBlur, ...]:
        """Return the blur at `count` places, traced once for each count."""
        if count not in self._kept_blurs:
            at = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
            self._kept_blurs[count] = self.at_heights(self.half_diagonal * at)
        return self._kept_blurs[count]

    def at_heights(self, heights: Array) -> tuple[PlaceBlur, ...]:
        """Return the blur at image heights.

        Parameters
        ----------
        heights : Array
            Distances from the axis (F,) [m].

        Returns
        -------
        tuple of PlaceBlur
            Blur at each of the F heights.

        Raises
        ------
        BadInput
            Where the lens forms no image.
        """
        found = wavefronts(self.view, tuple(heights.tolist()), self.shortest, self.longest)
        color = None if self.has_color else self._color
        return tuple(
            PlaceBlur(found.at(i), self.diffracts, self.longest, self.shortest, color)
            for i in range(len(heights))
        )

    @cached_property
    def _kept_blurs(self) -> dict[int, tuple[PlaceBlur, ...]]:
        return {}


_HARMONICS: ByteCache[Array] = ByteCache(HARMONICS, strict=True)
"""Harmonics at the nodes of a place, over evenly spaced frequencies from 0."""
