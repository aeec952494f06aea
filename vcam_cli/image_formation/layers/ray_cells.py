"""Cells of a window on which rays meet layers, and what sharp lens and pixels make of an image.

Cells divide pixels evenly where lens or silicon blur the image on them. Where a pixel sees its own
photodetector alone, they divide that, and apart from it the gap to the next one: a cell astride the
rim of a photodetector would mix light inside with light beside it, and halves and thirds of a pixel
may err alike (by 4.4 % of full signal in a pixel, where edges of layers lie in the gap).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, SeparableTransfer
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.layers.occlusion import Place, Sums
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.records import dataclass

BORDER = 4
"""Pixels around a window from which diffraction and diffusion bring light."""
KNOWN = 1 << 23
"""Bytes of transfers that are kept for windows of a size: small ones are many of few sizes."""
TINY = 1e-9
"""Width of a photodetector that is a point [cells]."""
NARROWEST = 1e-3
"""Part of a pixel that rays come from, at least: layers are even on so little."""
ENTRIES = 1024
"""Frequencies at which a round transfer function is tabulated."""
POINTS = 4
"""Rays of a group for which what diffraction passes is computed, about."""


@dataclass(frozen=True)
class Window:
    """Rows and columns of pixels."""

    rows: slice
    columns: slice

    @property
    def pixels(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    def geometry(self, g: Geometry) -> Geometry:
        """Return the geometry of its pixels, as if the array had no others.

        Parameters
        ----------
        g : Geometry
            Geometry of the array.

        Returns
        -------
        Geometry
            Geometry of the window.
        """
        rows, columns = self.pixels
        size = columns * g.pitch_x, rows * g.pitch_y
        return replace(g, rows=rows, columns=columns, sensor_width=size[0], sensor_height=size[1])

    def center(self, g: Geometry) -> tuple[float, float]:
        """Return its center, as its pixels see it.

        Parameters
        ----------
        g : Geometry
            Geometry of the array.

        Returns
        -------
        tuple of float
            Position right of and below the array's center [m].
        """
        x = (self.columns.start + self.columns.stop - g.columns) / 2 * g.pitch_x
        y = (self.rows.start + self.rows.stop - g.rows) / 2 * g.pitch_y
        return x * g.sampling_scale, y * g.sampling_scale


@dataclass(frozen=True)
class Cells:
    """The cells of a window, and those around it."""

    geometry: Geometry
    window: Window
    per_pixel: int
    """Along either side of a pixel's part that rays come from."""
    border: tuple[int, int]
    """Rows and columns of cells around the window that sharp lens and silicon blur into it."""
    reach: tuple[int, int]
    """Rows and columns of pixels around those, on which rays meet layers."""
    single: bool = True
    """Whether light is in 32-bit numbers."""
    divided: tuple[float, float] = (1.0, 1.0)
    """Part of a pixel along x and y that rays come from; the rest has cells of its own."""

    @cached_property
    def sides(self) -> tuple[float, float]:
        """Of a cell along x and y [m]."""
        g, (x, y) = self.geometry, self.divided
        return g.pitch_x * x / self.per_pixel, g.pitch_y * y / self.per_pixel

    @cached_property
    def inner(self) -> tuple[int, int]:
        """Rows and columns of cells of the window and its border."""
        (rows, columns), (down, right) = self.window.pixels, self.border
        return rows * self.per_pixel + 2 * down, columns * self.per_pixel + 2 * right

    @property
    def middle(self) -> float:
        """Of the window, below that of the array [m]."""
        rows = self.window.rows
        middle: float = ((rows.start + rows.stop - self.geometry.rows) / 2) * self.geometry.pitch_y
        return middle

    def together(self, count: int) -> Cells:
        """Return larger cells.

        Parameters
        ----------
        count : int
            Cells of these along either side of a larger one.

        Returns
        -------
        Cells
            Cells of the same window.
        """
        border = self.border[0] // count, self.border[1] // count
        return replace(self, per_pixel=self.per_pixel // count, border=border)

    def edges(self) -> tuple[Array, Array]:
        """Return the edges of columns and of rows of all cells [m]."""
        g = self.geometry
        x, y = pixel_centers(g, detector=True)
        centers, pitches = (x[self.window.columns], y[self.window.rows]), (g.pitch_x, g.pitch_y)
        found = []
        for axis, (center, pitch) in enumerate(zip(centers, pitches, strict=True)):
            beyond = self.border[1 - axis] // self.per_pixel + self.reach[1 - axis]
            side = self.sides[axis]
            first = center[0] - pitch * self.divided[axis] / 2
            pixels = first + pitch * np.arange(-beyond, len(center) + beyond)
            gap = np.linspace(self.divided[axis] * pitch, pitch, self._in_gap(axis) + 1)[:-1]
            inside = np.append(side * np.arange(self.per_pixel), gap)
            edges = (pixels[:, None] + inside).ravel()
            found.append(np.append(edges, pixels[-1] + pitch))
        return found[0], found[1]

    def met(self, offsets: Array) -> list[Place]:
        """Return the rows and columns of all cells at which each of some rays meets a layer.

        Parameters
        ----------
        offsets : Array
            Offsets (n, 2), right and down, of where they meet the layer from the beginning of the
            ray's own cell [cells].

        Returns
        -------
        list of Place
            Rows and columns of the inner cells, in their order: slices, or indices (rows, 1) and
            (columns,).
        """
        if self.divided != (1.0, 1.0):
            return [self._met_divided(offset) for offset in offsets]
        (down, right), (rows, columns) = self.reach, self.inner
        whole = np.floor(offsets).astype(int) + self.per_pixel * np.array([right, down])
        return [
            (slice(top, top + rows), slice(left, left + columns)) for left, top in whole.tolist()
        ]

    def _met_divided(self, offset: Array) -> Place:
        found = []
        for axis in (1, 0):
            count, gaps = self.per_pixel, self._in_gap(axis)
            at, period = np.arange(count) + offset[axis], count / self.divided[axis]
            pixel = np.floor(at / period)
            cell = at - pixel * period
            if gaps:
                beyond = count + (cell - count) * (gaps / (period - count))
                cell = np.where(cell < count, cell, beyond)
            cell = np.minimum(np.floor(cell), count + gaps - 1)
            index = ((count + gaps) * (self.reach[1 - axis] + pixel) + cell).astype(int)
            pixels = np.arange(self.window.pixels[1 - axis])[:, None]
            found.append(((count + gaps) * pixels + index).ravel())
        return found[0][:, None], found[1]

    def _in_gap(self, axis: int) -> int:
        """Return the cells along the gap between two pixels' parts, no larger than even ones."""
        return math.ceil(self.per_pixel * (1 - self.divided[axis]))


class SharpImage:
    """What the lens in focus, silicon and photodetectors do to an image on cells.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    """

    def __init__(self, path: OpticalPath) -> None:
        lens = of_kind(path.layers[0].effects, Diffraction) if path.layers else ()
        self._lens = lens[0] if lens else None
        behind = tuple(e for e in path.effects if e.origin != "lens")
        separable = of_kind(behind, SeparableTransfer)
        self._apertures = tuple(e.box for e in separable if e.box is not None)
        self._separable = tuple(e for e in separable if e.box is None)
        white = path.transfer.weights.sum(axis=0, keepdims=True)
        blurs = (*lens, *of_kind(behind, Blur))
        self._transfer = Transfer(path.transfer.wavelengths, white, blurs)
        self._known: ByteCache[Array] = ByteCache(KNOWN)
        self._tables: dict[tuple[float, float], tuple[float, Array]] = {}

    @property
    def diffracts(self) -> bool:
        """Whether the lens diffracts, so that few of the rays count at each frequency."""
        return self._lens is not None

    def groups(self, rays: Array, rings: int, sectors: int) -> list[Array]:
        """Return rays in groups; in a group about the same waves diffract.

        Parameters
        ----------
        rays : Array
            Rays (n, 5).
        rings : int
            Rings of equal area of the pupil.
        sectors : int
            Sectors of each; opposite ones are one.

        Returns
        -------
        list of Array
            Groups (k, 5); one of all where there is one part of the pupil, or no diffraction.
        """
        if self._lens is None or rings * sectors == 1:
            return [rays]
        x, y = rays[:, 0], rays[:, 1]
        ring = (rings * (x**2 + y**2)).astype(int)
        sector = (sectors * (np.arctan2(y, x) / np.pi % 1)).astype(int) % sectors
        number = ring * sectors + sector
        return [rays[number == own] for own in np.unique(number)]

    @property
    def nbytes(self) -> int:
        """Memory of the transfers that are known [bytes]."""
        return self._known.nbytes

    @property
    def is_local(self) -> bool:
        """Whether pixels see their own area alone."""
        return not (self._transfer.effects or self._separable)

    def divided(self, g: Geometry) -> tuple[float, float]:
        """Return the part of a pixel along x and y that rays come from.

        Parameters
        ----------
        g : Geometry
            Geometry of the array.

        Returns
        -------
        tuple of float
            The photodetector's where pixels see their own area alone, else 1.
        """
        if not self.is_local:
            return 1.0, 1.0
        x, y = (
            min(max(sum(box[axis] for box in self._apertures) / pitch, NARROWEST), 1.0)
            for axis, pitch in enumerate((g.pitch_x, g.pitch_y))
        )
        return x, y

    def at_pixels(self, cells: Cells, count: int, groups: Iterable[Sums]) -> tuple[Array, Array]:
        """Return the means over rays in every color at the pixels.

        Parameters
        ----------
        cells : Cells
            Cells of a window.
        count : int
            Number of groups; they are summed up one by one.
        groups : iterable of Sums
            Groups of rays, and sums over them of images on the inner cells: of light (n, C, h, w)
            and of opacity (m, h, w).

        Returns
        -------
        light, cover : Array
            Values (n, C, rows, columns) and (m, C, rows, columns) at the pixels.
        """
        if count > 1:
            spectra = self._waves(cells, groups)
        elif self.is_local:
            ((rays, light, cover),) = groups
            images = (image / len(rays) for image in (light, cover[:, None]))
            light, cover = (self._collected(cells, image, (-2, -1)) for image in images)
            return light, np.broadcast_to(cover, (len(cover), *light.shape[1:]))
        else:
            spectra = self._means(cells, *groups)
        light, cover = (self._on_pixels(cells, spectrum) for spectrum in spectra)
        return light, np.broadcast_to(cover, (len(cover), *light.shape[1:]))

    def _means(self, cells: Cells, group: Sums) -> tuple[Array, Array]:
        """Return spectra (n, C, h, k) and (m, C, h, k) where every ray counts alike."""
        rays, light, cover = group
        transfer = self._on(cells) / len(rays)
        spectrum = scipy.fft.rfft2(light)
        spectrum *= transfer
        return spectrum, scipy.fft.rfft2(cover[:, None]) * transfer

    def _waves(self, cells: Cells, groups: Iterable[Sums]) -> tuple[Array, Array]:
        """Return the same of several groups: at each frequency of the rays that it passes."""
        light: Array | float = 0.0
        cover: Array | float = 0.0
        passed: Array | float = 0.0
        for rays, own_light, own_cover in groups:
            share = self._passed(cells, rays)
            passed = passed + len(rays) * share
            light = light + scipy.fft.rfft2(own_light) * share
            cover = cover + scipy.fft.rfft2(own_cover[:, None]) * share
            del own_light, own_cover  # they are not held beside the next group's
        transfer = self._on(cells)
        # How many pairs of points there are is that of the lens's own transfer, exactly.
        transfer = np.divide(
            transfer, passed, out=np.zeros_like(transfer), where=np.asarray(passed) > 0
        )
        return light * transfer, cover * transfer

    def _passed(self, cells: Cells, rays: Array) -> Array:
        """Return the part (C, h, w) of the light that pairs of points around rays diffract.

        Two points of the pupil, 2 s apart in its radii and with the middle u, are both on it where
        s^2 + 2 |u s| <= 1 - u^2; waves of the frequency f come from s = wavelength N f.
        """
        assert self._lens is not None
        fx, fy = self._frequencies(cells)
        wavelengths, (weights,) = self._transfer.wavelengths, self._transfer.weights
        number = 1 / (self._lens.cutoff(1.0))  # N, of the light that has a wavelength of 1
        squares = np.square(number * fx)[None, :] + np.square(number * fy)[:, None]
        below = np.concatenate([np.zeros((len(weights), 1)), np.cumsum(weights, axis=1)], axis=1)
        below /= np.where(below[:, -1:] > 0, below[:, -1:], 1)
        total: Array | float = 0.0
        for x, y in _spread(rays[:, :2]):
            along = np.abs(x * number * fx[None, :] + y * number * fy[:, None])
            room = 1 - x**2 - y**2
            # The longest wavelength for which there are such pairs.
            longest = room / (along + np.sqrt(np.square(along) + room * squares) + TINY)
            total = total + below[:, np.searchsorted(wavelengths, longest, side="right")]
        kind = np.float32 if cells.single else np.float64
        return np.asarray(total / len(_spread(rays[:, :2])), kind)

    def _on_pixels(self, cells: Cells, spectrum: Array) -> Array:
        """Return the means over the collecting areas of images, of their spectra (..., h, k).

        The spectra have passed `_on`, and so the mean over what a pixel collects along y: pixels
        are `per_pixel` cells apart, which folds the spectrum. Along x it is taken of cells.
        """
        n, (rows, columns) = cells.per_pixel, cells.inner
        folded = spectrum[..., : rows // n, :]
        for k in range(1, n):
            folded = folded + spectrum[..., k * rows // n : (k + 1) * rows // n, :]
        lines = scipy.fft.ifft(folded, axis=-2)[..., : cells.window.pixels[0], :]
        return self._collected(cells, scipy.fft.irfft(lines, columns), (-1,))

    def _collected(self, cells: Cells, image: Array, axes: Iterable[int]) -> Array:
        """Return the means over the collecting areas of an image, exactly on its even cells."""
        n = cells.per_pixel
        for axis in axes:
            pixels, shares = cells.window.pixels[axis], self._shares(cells, axis)
            start = cells.border[axis]
            total: Array | float = 0.0
            for k in np.flatnonzero(shares):
                part = slice(start + int(k), start + int(k) + n * pixels, n)
                cut = image[..., part, :] if axis == -2 else image[..., part]
                total = total + cut * image.dtype.type(shares[k])
            image = np.asarray(total)
        return image

    def _shares(self, cells: Cells, axis: int) -> Array:
        """Return what part of a pixel's light each of its cells (n,) collects along an axis."""
        key = "collected", cells.per_pixel, axis
        return self._known.get(key, lambda: self._new_shares(cells, axis))

    def _new_shares(self, cells: Cells, axis: int) -> Array:
        n = cells.per_pixel
        half = sum(box[-1 - axis] for box in self._apertures) / cells.sides[-1 - axis] / 2
        low, high = (min(max(n / 2 + end, 0.0), n) for end in (-half, half))
        edges = np.arange(n + 1)
        share = np.minimum(edges[1:], max(high, low + TINY)) - np.maximum(edges[:-1], low)
        share = np.maximum(share, 0)
        return np.asarray(share / share.sum())

    def _on(self, cells: Cells) -> Array:
        """Return the transfer (C, h, k) of all but what pixels collect along x.

        From cells to pixels along y: their first one's mean lies where the first cell of all does.
        """
        key = cells.per_pixel, cells.border, cells.inner
        return self._known.get(key, lambda: self._new_transfer(cells))

    def _new_transfer(self, cells: Cells) -> Array:
        blur, n = self._transfer, cells.per_pixel
        fx, fy = self._frequencies(cells)
        real, whole = (np.float32, np.complex64) if cells.single else (np.float64, np.complex128)
        found: Array = np.ones((1, len(fy), len(fx)), real)
        if blur.effects:
            level = blur.level[0][:, None, None]
            found = self._blur(cells, fx, fy, real)
            found /= np.where(level > 0, level, 1.0).astype(real)
        for effect in self._separable:
            found *= np.outer(effect.along_y(fy), effect.along_x(fx)).astype(real)
        waves = np.outer(scipy.fft.fftfreq(len(fy)), cells.border[0] + np.arange(n))
        collected = np.exp(2j * np.pi * waves) @ self._shares(cells, -2) / n
        return np.asarray(found * collected[:, None].astype(whole))

    def _frequencies(self, cells: Cells) -> tuple[Array, Array]:
        """Return the frequencies along x and y of transforms of images [cycles/m]."""
        (side_x, side_y), shape = cells.sides, cells.inner
        return scipy.fft.rfftfreq(shape[1]) / side_x, scipy.fft.fftfreq(shape[0]) / side_y

    def _blur(self, cells: Cells, fx: Array, fy: Array, kind: type) -> Array:
        """Return the response (C, m, n) of lens and silicon at pairs of frequencies [e/s]."""
        if self._transfer.plane_blurs:
            response: Array = self._transfer.plane_response(fx, fy)[0]
            return response.astype(kind)
        top, known = self._radial(cells.sides)
        half = len(fy) // 2 + 1  # the other half has the same lengths, in reverse
        found: Array = np.empty((len(known), len(fy), len(fx)), kind)
        place = np.sqrt(np.add(np.square(fx), np.square(fy[:half, None]))) * ((ENTRIES - 1) / top)
        first = np.minimum(place.astype(np.intp), ENTRIES - 2)
        beyond: Array = (place - first).astype(kind)
        for plane, one in zip(found, known.astype(kind), strict=True):
            here = plane[:half]
            np.multiply(np.diff(one).take(first), beyond, out=here)
            here += one.take(first)
            plane[half:] = plane[len(fy) - half : 0 : -1]
        return found

    def _radial(self, sides: tuple[float, float]) -> tuple[float, Array]:
        """Return the highest frequency on cells [cycles/m], and the response (C, n) up to it [e/s].

        It is at even steps from 0.
        """
        if sides not in self._tables:
            top = math.hypot(0.5 / sides[0], 0.5 / sides[1])
            lengths = np.linspace(0, top, ENTRIES)
            self._tables[sides] = top, self._transfer.radial_response(lengths)[0]
        return self._tables[sides]


def _spread(points: Array) -> Array:
    """Return a few points of a group: with more their mean share hardly changes."""
    return points[:: -(-len(points) // POINTS)]
