"""Blur by the lens's aberrations: defocus, Zernike wavefronts, or a point spread function.

What diffraction leaves of contrast is `Diffraction`'s; here is the factor by which aberrations
make it less. With diffraction switched off it is the blur of rays. A point spread function, be it
measured or from a lens program, has both in it, and diffraction goes.

The kind depends on the wavefront: symmetric about the axis, the same everywhere, or changing over
the field. In the last case the file says what the wavefront is on the half-axis from the center to
the right; the lens is symmetric about its axis, so that elsewhere it is turned about it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry
from vcam_cli.effects.base import (
    Effect,
    FieldTransfer,
    PlaneTransfer,
    RadialTransfer,
    Zone,
    switched_off,
)
from vcam_cli.errors import bad
from vcam_cli.physics import aberration, diffraction, ray_blur, zernike
from vcam_cli.physics.cache import ByteCache
from vcam_cli.physics.zernike import Terms

PER_WAVE = 6.0
"""Places more for each wave (rms) that the wavefront changes by from center to corner: the transfer
turns by some radians then, and a polynomial needs a degree for each."""
MOST_PLACES = 13
"""Where that ends: of a wavefront of more waves what lies between two zones is known less well."""
GREEN = 550e-9
"""Wavelength that descriptions refer to [m]."""
MANY_WAVES = 0.18
"""Rms wavefront error from which the Strehl ratio says less than the blur's width [waves]."""
PSF = "optics.psf"
"""Under which the camera carries the samples of its point spread function."""


@dataclass(frozen=True)
class Lens:
    """How the light comes to the sensor, and whether as waves."""

    working_f_number: float
    """N (1 - m)"""
    diffracts: bool

    def cutoff(self, wavelength: float) -> float:
        """Of the aberrations' factor [cycles/m]."""
        if not self.diffracts:
            return math.inf
        return float(diffraction.cutoff_frequency(wavelength, self.working_f_number))

    def reach(self, terms: Terms) -> float:
        """How far from the ideal image point a wavefront throws almost all light [m]."""
        _, tilt = zernike.without_tilt(terms)
        moved = 2 * self.working_f_number * math.hypot(*tilt)
        airy = 2 * GREEN * self.working_f_number if self.diffracts else 0.0
        return moved + ray_blur.displacement(terms, self.working_f_number) + airy

    def describe(self, terms: Terms) -> str:
        """What a wavefront does, with numbers."""
        rest, tilt = zernike.without_tilt(terms)
        waves = zernike.rms(rest) / GREEN
        if not zernike.total(terms):
            return "no wavefront error, Strehl ratio 1"
        if not rest:
            moved = [2e6 * self.working_f_number * slope for slope in tilt]
            return f"moves the image by {moved[0]:.4g} um to the right and {moved[1]:.4g} um down"
        error = f"wavefront error of {waves:.3g} waves rms at 550 nm"
        if self.diffracts and waves < MANY_WAVES:
            return f"{error}: Strehl ratio {zernike.strehl(rest, GREEN):.2f}"
        width = 2e6 * ray_blur.displacement(rest, self.working_f_number)
        return f"{error}: points of light become up to {width:.4g} um wide"


class Aberration(Effect):
    """What makes the lens worse than a perfect one; the kind of blur depends on the wavefront."""

    name = "aberration"
    reference = "Hopkins 1955, doi:10.1098/rspa.1955.0158; Noll 1976, doi:10.1364/JOSA.66.000207"
    absent = "the file gives no defocus, no zernike and no psf"
    in_lens = True

    @classmethod
    def of(cls, camera: Camera, geometry: Geometry) -> Aberration | None:
        if camera.optics.psf is not None:
            return PointSpread.of_file(camera)
        places = wavefronts(camera, geometry)
        if not any(terms for _, terms in places):
            return None
        waves = camera.optics.diffraction and not switched_off(camera, "diffraction")
        lens = Lens(geometry.working_f_number, waves)
        same = all(terms == places[0][1] for _, terms in places)
        if same and (places[0][0] is None or zernike.is_symmetric(places[0][1])):
            kind = SymmetricBlur if zernike.is_symmetric(places[0][1]) else DirectedBlur
            return kind(lens, places[0][1])
        half_diagonal = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        listed = tuple((place or 0.0, terms) for place, terms in places)
        return FieldBlur(lens, listed, half_diagonal)


def wavefronts(camera: Camera, geometry: Geometry) -> tuple[tuple[float | None, Terms], ...]:
    """((place or None for everywhere, terms with defocus), ...) by rising place."""
    shift = zernike.defocus(camera.optics.defocus, geometry.working_f_number)
    places = camera.optics.zernike.at or ((None, ()),)
    return tuple(
        (place, zernike.total(terms, shift))
        for place, terms in sorted(places, key=lambda item: item[0] or 0.0)
    )


def check(camera: Camera, geometry: Geometry) -> None:
    """Raises BadInput for a wavefront too steep to be followed as a wave.

    Switched off or not: the plan says of what is left out how much it would do.
    """
    waves = camera.optics.diffraction and not switched_off(camera, "diffraction")
    if camera.optics.psf is not None or not waves:
        return
    shortest = camera.scene.wavelengths.start
    slopes = [
        aberration.slope_in_waves(terms, shortest) for _, terms in wavefronts(camera, geometry)
    ]
    if max(slopes) > aberration.STEEPEST:
        key = "zernike" if camera.optics.zernike.at else "defocus"
        raise bad(
            ("optics", key),
            f"gives a wavefront that rises by {max(slopes):.4g} wavelengths of"
            f" {shortest * 1e9:.4g} nm over a pupil radius; at most {aberration.STEEPEST:g} can be"
            " followed",
            "check the unit, or write diffraction: false for the blur of rays",
        )


@dataclass(frozen=True)
class SymmetricBlur(Aberration, RadialTransfer):
    """A wavefront that is symmetric about the axis, the same everywhere."""

    lens: Lens
    terms: Terms

    def describe(self) -> str:
        return self.lens.describe(self.terms)

    def otf(self, frequency, wavelength):
        if not self.lens.diffracts:
            return ray_blur.otf_symmetric(frequency, self.lens.working_f_number, self.terms)
        return aberration.otf_ratio_symmetric(
            frequency, wavelength, self.lens.working_f_number, self.terms
        )

    def cutoff(self, wavelength):
        return self.lens.cutoff(wavelength)

    def mean_error(self, outlook) -> float:
        otf = self.otf(np.linspace(0, _highest(self.lens, self.terms), 257), GREEN)
        return float(np.abs(1 - otf).max()) * outlook.full_signal


@dataclass(frozen=True)
class DirectedBlur(Aberration, PlaneTransfer):
    """Any wavefront, the same everywhere, turned about the axis by an angle [rad]."""

    lens: Lens
    terms: Terms
    angle: float = 0.0

    def describe(self) -> str:
        return self.lens.describe(self.terms)

    @property
    def reach(self) -> float:
        return self.lens.reach(self.terms)

    def otf_plane(self, fx, fy, wavelength):
        if not self.lens.diffracts:
            return self._rays(fx, fy)
        # Turned frequencies rather than a turned wavefront: one grid serves all angles.
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        x, y = fx[None, :], fy[:, None]
        return aberration.otf_ratio(
            cos * x + sin * y, cos * y - sin * x, wavelength, self.lens.working_f_number, self.terms
        )

    def keeps(self, wavelengths):
        return aberration.keeps(self.terms, wavelengths) if self.lens.diffracts else {}

    def _rays(self, fx, fy):
        def compute():
            turned = zernike.turned(self.terms, self.angle)
            return ray_blur.otf(fx, fy, self.lens.working_f_number, turned)

        return self._kept.get((fx.tobytes(), fy.tobytes()), compute)

    @cached_property
    def _kept(self) -> ByteCache:
        """The last transfer by rays: it is the same at all wavelengths."""
        return ByteCache(0)

    def cutoff(self, wavelength):
        return self.lens.cutoff(wavelength)

    @property
    def model(self) -> tuple[DirectedBlur, int, bool]:
        # Rounded, so that the same angle come by in two ways is one.
        quarters = math.floor(self.angle / (math.pi / 2) + 1e-9)
        rest = round(self.angle - quarters * (math.pi / 2), 12)
        even = all(zernike.noll(index)[1] >= 0 for index, _ in self.terms)
        if even and rest > math.pi / 4 + 1e-9:
            rest = round(math.pi / 2 - rest, 12)
            return replace(self, angle=rest), (quarters + 1) % 4, True
        return replace(self, angle=rest), quarters % 4, False

    def mean_error(self, outlook) -> float:
        return _worst(self, _highest(self.lens, self.terms)) * outlook.full_signal


@dataclass(frozen=True)
class FieldBlur(Aberration, FieldTransfer):
    """Wavefronts at places of the field, straight in between, turned with the azimuth."""

    lens: Lens
    places: tuple[tuple[float, Terms], ...]
    """((place from 0 center to 1 corner, terms), ...), rising"""
    half_diagonal: float
    """Of the sensor [m]."""

    def describe(self) -> str:
        center, corner = (self.lens.describe(self.at(place)) for place in (0.0, 1.0))
        return f"center: {center}; corner: {corner}"

    def at(self, place: float) -> Terms:
        """The wavefront at a distance from the center, 0 .. 1, on the half-axis to the right."""
        every = sorted({index for _, terms in self.places for index, _ in terms})
        where = [p for p, _ in self.places]
        listed = [dict(terms) for _, terms in self.places]
        return zernike.total(
            tuple(
                (i, float(np.interp(place, where, [t.get(i, 0.0) for t in listed]))) for i in every
            )
        )

    def zones(self, count):
        waves = sum(change for _, _, change in self._changes) / GREEN
        count = max(count, min(count + math.ceil(PER_WAVE * waves), MOST_PLACES))
        stretches = self._stretches(count)
        rings = sorted({place for nodes in stretches for place in nodes})
        orders = {zernike.noll(index)[1] for _, terms in self.places for index, _ in terms}
        most = max((abs(m) for m in orders), default=0)
        found = []
        for place in rings:
            terms = self.at(place)
            if not most:
                weight = Share(stretches, place, 0, 0, self.half_diagonal)
                found.append(Zone(SymmetricBlur(self.lens, terms), weight))
                continue
            # As many harmonics around as powers outwards; a multiple of 4 has its quarter turns.
            around = 4 * math.ceil((2 * most * (count - 1) + 1) / 4)
            for sector in range(around):
                angle = 2 * math.pi * sector / around
                weight = Share(stretches, place, sector, around, self.half_diagonal)
                found.append(Zone(DirectedBlur(self.lens, terms, angle), weight))
        return tuple(found)

    @property
    def _changes(self) -> list[tuple[float, float, float]]:
        """Ends of the stretches on which the wavefront changes evenly; by how much [m rms]."""
        edges = [0.0, *(place for place, _ in self.places if 0 < place < 1), 1.0]
        minus = [tuple((i, -c) for i, c in self.at(place)) for place in edges[:-1]]
        changes = [zernike.total(a, self.at(b)) for a, b in zip(minus, edges[1:], strict=True)]
        return [(*ends, zernike.rms(c)) for ends, c in zip(pairwise(edges), changes, strict=True)]

    def _stretches(self, count: int) -> tuple[tuple[float, ...], ...]:
        """Places in each stretch where the wavefront changes evenly; its ends are among them.

        Chebyshev's, between which polynomials are best; most of them where it changes most.
        """
        total = sum(change for _, _, change in self._changes) or 1.0
        found = []
        for low, high, change in self._changes:
            steps = 1 + math.ceil((max(count, 2) - 2) * change / total - 1e-9)
            at = (1 - np.cos(np.pi * np.arange(steps + 1) / steps)) / 2
            inner = (low + (high - low) * at[1:-1]).tolist()
            found.append((low, *inner, high))
        return tuple(found)

    def mean_error(self, outlook) -> float:
        # Wavefronts change evenly in between: none is worse than that of one of its ends.
        places = {0.0, 1.0, *(place for place, _ in self.places if 0 < place < 1)}
        return max(DirectedBlur(self.lens, self.at(p)).mean_error(outlook) for p in places)


@dataclass(frozen=True)
class Share:
    """Weight of a zone: 1 in its place, 0 in those of all others.

    Between them a polynomial of the distance, on every stretch where the wavefront changes evenly,
    and a sum of waves of the azimuth. Beyond the corner that of the corner holds.
    """

    stretches: tuple[tuple[float, ...], ...]
    """Places of the rings on each stretch from center 0 to corner 1."""
    place: float
    """Of this ring."""
    sector: int
    around: int
    """Sectors of a ring; 0 for a whole ring."""
    half_diagonal: float

    def __call__(self, x: NDArray, y: NDArray) -> NDArray:
        """At the positions x (columns,), y (rows,) [m]: (rows, columns), in the type of x."""
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


def _polynomial(at: NDArray, nodes: tuple[float, ...], own: float) -> NDArray:
    """The one that is 1 at its own node and 0 at the others (Lagrange's)."""
    out = np.ones_like(at)
    for node in nodes:
        if node != own:
            out *= (at - node) / (own - node)
    return out


def _waves(angle: NDArray, count: int) -> NDArray:
    """The sum of waves that is 1 at the angle 0 and 0 at the others of `count`, an even number."""
    half = angle / 2
    near = np.abs(np.sin(half)) < 1e-6
    return np.where(near, 1.0, np.sin(count * half) / (count * np.tan(np.where(near, 1.0, half))))


@dataclass(frozen=True)
class PointSpread(Aberration, PlaneTransfer):
    """A point spread function from a file: points of light, one on every sample.

    Its origin, where a perfect lens would put the light, is the middle of the file's grid, between
    two samples where their number is even.
    """

    file: str
    pitch: float
    """Distance of the samples [m]."""
    wavelengths: tuple[float, ...]
    """Of the channels [m]; empty where there is one for all wavelengths."""
    samples: NDArray | None = field(compare=False, repr=False)
    """(channels, rows, columns), each of sum 1; None before the file was read."""

    @classmethod
    def of_file(cls, camera: Camera) -> PointSpread:
        """The point spread function of the camera's file."""
        psf = camera.optics.psf
        assert psf is not None
        return cls(psf.file, psf.pitch, psf.wavelengths, camera.samples(PSF))

    def describe(self) -> str:
        text = f"point spread function sampled every {self.pitch * 1e6:.4g} um"
        if self.samples is None:
            return text
        return f"{text}: 90% of the light within {2e6 * self._within(0.9):.3g} um"

    @property
    def reach(self) -> float:
        return self._within(0.99)

    def _read(self) -> NDArray:
        if self.samples is None:
            raise RuntimeError(f"{self.file} has not been read")
        return self.samples

    def _within(self, share: float) -> float:
        """Radius around the origin that holds a share of the light [m]."""
        x, y = self._places
        radius = np.hypot(x[None, :], y[:, None]).ravel()
        order = np.argsort(radius)
        light = np.cumsum(self._read().mean(axis=0).ravel()[order])
        return float(radius[order][np.searchsorted(light, share * light[-1])])

    @property
    def _places(self) -> tuple[NDArray, NDArray]:
        _, rows, columns = self._read().shape
        x = (np.arange(columns) - (columns - 1) / 2) * self.pitch
        y = (np.arange(rows) - (rows - 1) / 2) * self.pitch
        return x, y

    def otf_plane(self, fx, fy, wavelength):
        key = (fx.tobytes(), fy.tobytes())
        channels = self._kept.get(key, lambda: self._of_channels(fx, fy))
        if len(self.wavelengths) < 2:
            return channels[0].copy()
        order = np.argsort(self.wavelengths)
        at = np.interp(wavelength, np.array(self.wavelengths)[order], np.arange(len(order)))
        low = min(int(at), len(order) - 2)
        part = at - low
        return (1 - part) * channels[order[low]] + part * channels[order[low + 1]]

    @cached_property
    def _kept(self) -> ByteCache:
        """The channels' last transfer, which the wavelengths share."""
        return ByteCache(0)

    def _of_channels(self, fx: NDArray, fy: NDArray) -> NDArray:
        """Fourier sums of the samples, 0 beyond what their pitch can tell: (channels, m, n)."""
        x, y = self._places
        along = np.exp(-2j * np.pi * np.outer(x, fx)) * (np.abs(fx) < 0.5 / self.pitch)
        down = np.exp(-2j * np.pi * np.outer(fy, y)) * (np.abs(fy) < 0.5 / self.pitch)[:, None]
        return np.array([down @ plane @ along for plane in self._read()])

    def cutoff(self, wavelength):
        return math.sqrt(0.5) / self.pitch

    def mean_error(self, outlook) -> float:
        if self.samples is None:
            return outlook.full_signal
        return _worst(self, 0.5 / self.pitch) * outlook.full_signal


def _highest(lens: Lens, terms: Terms) -> float:
    """Frequency up to which a factor is looked at for its largest effect [cycles/m]."""
    if lens.diffracts:
        return 0.999 * lens.cutoff(GREEN)
    return 2 / max(ray_blur.displacement(terms, lens.working_f_number), 1e-9)


def _worst(blur: PlaneTransfer, highest: float) -> float:
    """Largest |1 - H| at frequencies up to `highest`, every 32nd part of it.

    In green light; shorter waves lose up to twice as much, but a signal's rms about its mean is at
    most half of full signal.
    """
    f = np.linspace(-highest, highest, 65)
    return float(np.abs(1 - blur.otf_plane(f, f[32:], GREEN)).max())
