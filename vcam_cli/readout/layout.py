"""From a rectangular lattice, on which light is computed, to the pixels of the raw frame.

Most arrays are rectangular themselves. A honeycomb is every second place of a lattice with twice
its columns. Pixels at places of their own read the light from a lattice several times finer than
they are, between whose points it is a polynomial; every color is computed on all of it. So it is
for stacked pixels, which have all their colors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.lattice import Places
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.image_formation.settings import Settings
from vcam_cli.readout.binning import ALONE, BinningGroups
from vcam_cli.records import dataclass

REACH = 8
"""Points a side of the polynomial between a lattice's points."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the pixels of the raw frame are, and the lattice on which their light is computed."""

    geometry: Geometry
    """Of the raw frame."""
    mosaic: Mosaic
    """The colors of the lattice's places."""
    lattice: Geometry
    planes: bool = False
    """Whether every color is computed everywhere on the lattice."""
    places: Places | None = None
    binning_groups: BinningGroups = ALONE
    """Which places of the lattice are read as one."""
    seen: Mapping[str, float] = field(default_factory=dict)
    """Numbers of the geometry that a lens changes by distortion."""

    @property
    def is_scattered(self) -> bool:
        """Whether the pixels form no rectangular lattice of their own."""
        alone = self.binning_groups.count == 1
        return self.places is not None or (alone and self.lattice is not self.geometry)

    @property
    def full_color(self) -> bool:
        """Whether every pixel has all its colors."""
        return self.planes and self.places is None

    @property
    def raw_mosaic(self) -> Mosaic:
        """Mosaic of the raw frame's pixels."""
        if self.planes:
            return self.mosaic
        return Mosaic(self.binning_groups.block(self.mosaic.block))

    @property
    def charge_pixels(self) -> tuple[Geometry, Mosaic]:
        """Pixels that collect charge: the lattice's, or those whose charges are joined."""
        if self.binning_groups.summed_charges > 1:
            return self.geometry, self.raw_mosaic
        return self.lattice, self.mosaic

    def report(self, oversampling: float) -> dict[str, float | int]:
        """Return the raw frame's geometry, for `run.json`.

        Parameters
        ----------
        oversampling : float
            Samples per point of the lattice along each axis.

        Returns
        -------
        dict
            Names and numbers of the geometry.
        """
        finer = self.geometry.pitch_x / self.lattice.pitch_x
        return self.geometry.report(oversampling * finer) | dict(self.seen)

    def settings(self, settings: Settings) -> Settings:
        """Return the settings for the lattice; a fine one is sampled finely enough.

        Parameters
        ----------
        settings : Settings
            Settings for an array of pixels.

        Returns
        -------
        Settings
            Settings for the lattice.
        """
        if self.places is None:
            return settings
        return replace(settings, oversampling=1.0)

    def select_pixels(self, light: Array) -> Array:
        """Return the raw frame's pixels from the lattice's light.

        Parameters
        ----------
        light : Array
            Light (rows, columns) of the lattice, or (C, rows, columns) where all colors are
            computed.

        Returns
        -------
        Array
            Light (rows, columns) of the pixels, of stacked pixels (C, rows, columns), in the same
            unit.
        """
        if self.places is not None:
            return self._interpolate_at_places(light)
        if not self.is_scattered:
            return light
        out = np.empty((self.geometry.rows, self.geometry.columns), light.dtype)
        for row in (0, 1):
            out[row::2] = light[row::2, row::2]
        return out

    @cached_property
    def x(self) -> Array:
        """Centers of all pixels, right of the axis, in the frame's shape [m]."""
        return self._pixel_positions(0)

    @cached_property
    def y(self) -> Array:
        """Centers of all pixels, below the axis, in the frame's shape [m]."""
        return self._pixel_positions(1)

    @cached_property
    def centers(self) -> tuple[Array, Array]:
        """Centers of the raw frame's columns and rows, where it has any [m].

        Of joined pixels the center of gravity: those of a mosaic are not evenly spaced.
        """
        if self.binning_groups.count > 1:
            return self.binning_groups.centers(*pixel_centers(self.lattice))
        return self._picture

    @cached_property
    def color(self) -> Array:
        """Index of each pixel's color, in the frame's shape."""
        if self.places is not None:
            index = [self.mosaic.colors.index(c) for c in self.places.colors]
            return np.array(index, np.int32)[None]
        joined = self.binning_groups.count > 1
        grid, mosaic = (self.geometry if joined else self.lattice), self.raw_mosaic
        out = np.zeros((grid.rows, grid.columns), np.int32)
        period = len(mosaic.block)
        for row in range(period):
            for color, columns in mosaic.row_colors(row):
                for part in columns:
                    out[row::period, part] = color
        return self.select_pixels(out)

    def color_at(self, rows: slice, columns: slice) -> Array:
        """Return the indices of the colors of some pixels of the raw frame.

        Parameters
        ----------
        rows, columns : slice
            Rows and columns of the frame.

        Returns
        -------
        Array
            Indices (rows, columns).
        """
        if self.is_scattered:
            return self.color[rows, columns]
        g = self.geometry
        return self.raw_mosaic.color_at(np.arange(g.rows)[rows], np.arange(g.columns)[columns])

    @property
    def picture_shape(self) -> tuple[int, int]:
        """Rows and columns of the picture."""
        g = self.geometry
        if not self.is_scattered:
            return g.rows, g.columns
        pitch_y, pitch_x = self._square_pitches
        return max(1, round(g.sensor_height / pitch_y)), max(1, round(g.sensor_width / pitch_x))

    @cached_property
    def picture_x(self) -> Array:
        """Centers of the picture's columns, a square grid of the pixels' own width and gap [m]."""
        return self._picture[0]

    @cached_property
    def picture_y(self) -> Array:
        """Centers of the picture's rows [m]."""
        return self._picture[1]

    @property
    def _picture(self) -> tuple[Array, Array]:
        g = self.geometry
        if not self.is_scattered:
            return pixel_centers(g)
        (rows, columns), (pitch_y, pitch_x) = self.picture_shape, self._square_pitches
        x = (np.arange(columns) + 0.5 - columns / 2) * pitch_x
        return x, (np.arange(rows) + 0.5 - rows / 2) * pitch_y

    @property
    def _square_pitches(self) -> tuple[float, float]:
        """Pitches along y and x of the picture of pixels that are scattered [m]."""
        stretch = 1.0 if self.places is not None else math.sqrt(2)
        return self.geometry.pitch_y * stretch, self.geometry.pitch_x / stretch

    @property
    def grid(self) -> Geometry:
        """A rectangular array of the picture's rows and columns on the same sensor."""
        if not self.is_scattered:
            return self.geometry
        rows, columns = self.picture_shape
        return replace(
            self.geometry,
            rows=rows,
            columns=columns,
            pitch_x=self.geometry.sensor_width / columns,
            pitch_y=self.geometry.sensor_height / rows,
        )

    def _pixel_positions(self, axis: int) -> Array:
        if self.places is not None:
            return (self.places.x, self.places.y)[axis][None]
        x, y = pixel_centers(self.lattice)
        return self.select_pixels(np.broadcast_arrays(x[None, :], y[:, None])[axis])

    def _interpolate_at_places(self, light: Array) -> Array:
        assert self.places is not None
        g = self.lattice
        out = np.empty((1, len(self.places.x)), light.dtype)
        for color, plane in enumerate(light):
            mine = np.flatnonzero(self.color[0] == color)
            column = self.places.x[mine] / g.pitch_x + (g.columns - 1) / 2
            row = self.places.y[mine] / g.pitch_y + (g.rows - 1) / 2
            out[0, mine] = interpolate(plane, row, column)
        return np.maximum(out, 0, out=out)


def interpolate(plane: Array, row: Array, column: Array) -> Array:
    """Return a plane between its points, by Lagrange's polynomial through 8 x 8 of them.

    Parameters
    ----------
    plane : Array
        Values of the points (rows, columns), in any unit.
    row, column : Array
        Positions (n,), counted in points from that of index 0.

    Returns
    -------
    Array
        Values (n,) in the unit and float type of the plane.
    """
    top, down = _weights(row, plane.shape[0])
    left, along = _weights(column, plane.shape[1])
    flat, width = plane.ravel(), plane.shape[1]
    out = np.zeros(len(row))
    for i in range(REACH):
        line = (top + i) * width + left
        part = np.zeros(len(row))
        for j in range(REACH):
            part += along[j] * flat[line + j]
        out += down[i] * part
    return out.astype(plane.dtype)


def _weights(position: Array, count: int) -> tuple[Array, Array]:
    """Return the first point around each position (n,), and the points' weights (REACH, n)."""
    first = np.clip(np.floor(position).astype(int) - REACH // 2 + 1, 0, count - REACH)
    t = position - first
    weights = np.ones((REACH, len(position)))
    for i in range(REACH):
        for j in range(REACH):
            if j != i:
                weights[i] *= (t - j) / (i - j)
    return first, weights
