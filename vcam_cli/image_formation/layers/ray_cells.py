"""Cells of a window on which rays meet layers, and what sharp lens and pixels make of an image."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, SeparableTransfer
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.transfer_functions import Transfer

BORDER = 4
"""Pixels around a window from which diffraction and diffusion bring light."""
TINY = 1e-9
"""Width of a photodetector that is a point [cells]."""
ENTRIES = 1024
"""Frequencies at which a round transfer function is tabulated."""


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
    """Along either side of a pixel."""
    border: int
    """Cells around the window that sharp lens and silicon blur into it."""
    reach: tuple[int, int]
    """Rows and columns of cells around those that rays meet."""
    single: bool = True
    """Whether light is in 32-bit numbers."""

    @property
    def sides(self) -> tuple[float, float]:
        """Of a cell along x and y [m]."""
        return self.geometry.pitch_x / self.per_pixel, self.geometry.pitch_y / self.per_pixel

    @property
    def inner(self) -> tuple[int, int]:
        """Rows and columns of cells of the window and its border."""
        rows, columns = (n * self.per_pixel + 2 * self.border for n in self.window.pixels)
        return rows, columns

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
        down, right = self.reach
        reach, border = (down // count, right // count), self.border // count
        return replace(self, per_pixel=self.per_pixel // count, border=border, reach=reach)

    def edges(self) -> tuple[Array, Array]:
        """Return the edges of columns and of rows of all cells [m]."""
        g, (side_x, side_y) = self.geometry, self.sides
        x, y = pixel_centers(g, detector=True)
        left = x[self.window.columns.start] - g.pitch_x / 2
        top = y[self.window.rows.start] - g.pitch_y / 2
        (rows, columns), (down, right) = self.inner, self.reach
        return (
            left + (np.arange(columns + 2 * right + 1) - self.border - right) * side_x,
            top + (np.arange(rows + 2 * down + 1) - self.border - down) * side_y,
        )


class SharpImage:
    """What the lens in focus, silicon and photodetectors do to an image on cells.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    """

    def __init__(self, path: OpticalPath) -> None:
        lens = of_kind(path.layers[0].effects, Diffraction) if path.layers else ()
        behind = tuple(e for e in path.effects if e.origin != "lens")
        separable = of_kind(behind, SeparableTransfer)
        self._apertures = tuple(e.box for e in separable if e.box is not None)
        self._separable = tuple(e for e in separable if e.box is None)
        white = path.transfer.weights.sum(axis=0, keepdims=True)
        blurs = (*lens, *of_kind(behind, Blur))
        self._transfer = Transfer(path.transfer.wavelengths, white, blurs)
        self._known: dict[tuple[int, tuple[int, int]], Array] = {}

        self.inner_part = 1.0
        """Radius of the disc that is as large as all middles of pairs of points of the pupil from
        which waves of half the pixels' Nyquist frequency come [radii of the pupil]."""
        if lens:
            g = path.geometry
            middle = np.array([0.25 / max(g.pitch_x, g.pitch_y)])
            passed = np.mean([lens[0].otf(middle, w) for w in path.transfer.wavelengths])
            self.inner_part = math.sqrt(float(passed))

    @property
    def is_local(self) -> bool:
        """Whether pixels see their own area alone."""
        return not (self._transfer.effects or self._separable)

    def at_pixels(self, cells: Cells, light: Array, cover: Array) -> tuple[Array, Array]:
        """Return the values of images on the inner cells in every color at the pixels.

        Parameters
        ----------
        cells : Cells
            Cells of a window.
        light, cover : Array
            Images of light (n, C, h, w) and of opacity (m, h, w).

        Returns
        -------
        light, cover : Array
            Values (n, C, rows, columns) and (m, C, rows, columns) at the pixels.
        """
        cover, shape = cover[:, None], light.shape[-2:]
        if not self.is_local:
            transfer = self._on(cells, shape)
            light, cover = (
                scipy.fft.irfft2(scipy.fft.rfft2(image) * transfer, shape)
                for image in (light, cover)
            )
        light, cover = (self._collected(cells, image) for image in (light, cover))
        return light, np.broadcast_to(cover, (len(cover), *light.shape[1:]))

    def _collected(self, cells: Cells, image: Array) -> Array:
        """Return the means over the collecting areas of an image, exactly on its even cells."""
        n, start = cells.per_pixel, cells.border
        pitches = cells.geometry.pitch_y, cells.geometry.pitch_x
        for axis, pitch, pixels in zip((-2, -1), pitches, cells.window.pixels, strict=True):
            half = sum(box[-1 - axis] for box in self._apertures) / pitch * n / 2
            low, high = (min(max(n / 2 + end, 0.0), n) for end in (-half, half))
            edges = np.arange(n + 1)
            share = np.minimum(edges[1:], max(high, low + TINY)) - np.maximum(edges[:-1], low)
            share = np.maximum(share, 0)
            total: Array | float = 0.0
            for k in np.flatnonzero(share):
                part = slice(start + int(k), start + int(k) + n * pixels, n)
                cut = image[..., part, :] if axis == -2 else image[..., part]
                total = total + cut * image.dtype.type(share[k] / share.sum())
            image = np.asarray(total)
        return image

    def _on(self, cells: Cells, shape: tuple[int, int]) -> Array:
        """Return the transfer (C, h, w) of all but the photodetectors."""
        key = cells.per_pixel, shape
        if key in self._known:
            return self._known[key]
        (side_x, side_y), blur = cells.sides, self._transfer
        fx, fy = scipy.fft.rfftfreq(shape[1]) / side_x, scipy.fft.fftfreq(shape[0]) / side_y
        found: Array = np.ones((1, len(fy), len(fx)))
        if blur.effects:
            level = blur.level[0][:, None, None]
            found = self._blur(fx, fy) / np.where(level > 0, level, 1.0)
        for effect in self._separable:
            found = found * np.outer(effect.along_y(fy), effect.along_x(fx))
        kind = np.complex64 if cells.single else np.complex128
        self._known[key] = found.astype(kind if np.iscomplexobj(found) else kind(0).real.dtype)
        return self._known[key]

    def _blur(self, fx: Array, fy: Array) -> Array:
        """Return the response (C, m, n) of lens and silicon at pairs of frequencies [e/s]."""
        if self._transfer.plane_blurs:
            response: Array = self._transfer.plane_response(fx, fy)[0]
            return response
        table = np.linspace(0, np.hypot(fx.max(), np.abs(fy).max()), ENTRIES)
        radial, length = self._transfer.radial_response(table)[0], np.hypot(fx[None], fy[:, None])
        return np.stack([np.interp(length, table, one) for one in radial])
