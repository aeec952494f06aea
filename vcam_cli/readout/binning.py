"""Pixels that are read as one: which they are, what of theirs is joined, where noise comes in.

Neighbors are joined where they are of one color. In a finer mosaic it is pixels of the same color,
one block of colors apart: a Bayer mosaic of 2 x 2 joins every second red of 4 x 4 pixels, and is a
Bayer mosaic again (its pixels then lie closer together in a block than from block to block).

    charge     flows together before it is read: light and dark add, and one node with its full
               well, one reset, one pixel's offset and gain and one readout hold and read the sum.
    voltage    every pixel holds its own charge, with its own shot noise, offset, gain, reset and
               full well; the voltages are averaged, and the mean is read once. Electrons are
               those of the mean.
    digital    every pixel is read and converted by itself; codes are added. Electrons are those
               of the sum, and so are black level and highest code.

Columns and rows of the readout: one of each for what is joined in charge or voltage; each pixel's
own where codes are added, shared by the pixels that are in the same column, or row.

Reference: Z. Zhou, B. Pain, E. Fossum, "Frame-transfer CMOS active pixel sensor with pixel
binning", IEEE Trans. Electron Devices 44(10), 1997.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.records import dataclass

Block = tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class BinningGroups:
    """Groups of pixels that are read as one."""

    binning: Binning
    step: tuple[int, int]
    """Rows and columns from one joined pixel to the next."""

    @property
    def count(self) -> int:
        """Number of pixels of a group."""
        return self.binning.count

    @property
    def summed_charges(self) -> int:
        """Number of pixels whose charge is collected as one."""
        return self.count if self.binning.kind == "charge" else 1

    @property
    def summed_codes(self) -> int:
        """Number of codes that are added."""
        return self.count if self.binning.kind == "digital" else 1

    @property
    def signal_ratio(self) -> int:
        """Ratio of the raw frame's electrons to those of one pixel, in even light."""
        return self.summed_charges * self.summed_codes

    @property
    def extent(self) -> tuple[int, int]:
        """Rows and columns of the smallest array that can be joined."""
        return self.binning.rows * self.step[0], self.binning.columns * self.step[1]

    def block(self, block: Block) -> Block:
        """Return the block of colors of binned pixels.

        Parameters
        ----------
        block : Block
            Colors of the array's smallest repeating block, row by row.

        Returns
        -------
        Block
            Colors of the raw frame's smallest repeating block.
        """
        if self.step != (1, 1):
            return block
        down, along = self.binning.rows, self.binning.columns
        rows = range(0, math.lcm(len(block), down), down)
        columns = range(0, math.lcm(len(block[0]), along), along)
        return tuple(
            tuple(block[row % len(block)][column % len(block[0])] for column in columns)
            for row in rows
        )

    def geometry(self, g: Geometry) -> Geometry:
        """Return the geometry of binned pixels; photodetectors are those of one pixel.

        Parameters
        ----------
        g : Geometry
            Geometry of the array, pixel by pixel.

        Returns
        -------
        Geometry
            Geometry of the raw frame.
        """
        if self.count == 1:
            return g
        down, along = self.binning.rows, self.binning.columns
        return replace(
            g,
            rows=g.rows // down,
            columns=g.columns // along,
            pitch_x=g.pitch_x * along,
            pitch_y=g.pitch_y * down,
        )

    def collect(self, light: Array) -> Array:
        """Return what each node collects of the light of all pixels.

        Parameters
        ----------
        light : Array
            Light of every pixel, (..., rows, columns), in any unit.

        Returns
        -------
        Array
            Sums over the groups where charges are added, else the light itself, in its unit.
        """
        return self.sums(light) if self.summed_charges > 1 else light

    def join(self, electrons: Array) -> Array:
        """Return the raw frame's signal from that of each node.

        Parameters
        ----------
        electrons : Array
            Signal of every node, (..., rows, columns) [electrons].

        Returns
        -------
        Array
            Signal of the raw frame [electrons]: the mean of joined voltages, the sum of added
            codes.
        """
        if self.binning.kind == "charge":
            return electrons
        total = self.sums(electrons)
        return total if self.summed_codes > 1 else total / total.dtype.type(self.count)

    def sums(self, values: Array, dtype: type | None = None) -> Array:
        """Return the sums over all groups.

        Parameters
        ----------
        values : Array
            Values of every pixel, (..., rows, columns), in any unit.
        dtype : type, optional
            Type of the sums, by default that of the values.

        Returns
        -------
        Array
            Sums of the groups, (..., rows, columns) of the raw frame.
        """
        dtype = values.dtype.type if dtype is None else dtype
        if self.count == 1:
            return values.astype(dtype, copy=False)
        total = _sums(values, self.binning.rows, self.step[0], values.ndim - 2, dtype)
        return _sums(total, self.binning.columns, self.step[1], values.ndim - 1, dtype)

    def centers(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the centers of gravity of the groups' columns and rows.

        Parameters
        ----------
        x, y : Array
            Centers of the array's columns (columns,) and rows (rows,) [m].

        Returns
        -------
        tuple of Array
            Centers of the raw frame's columns and rows [m].
        """
        down, along = self.binning.rows, self.binning.columns
        columns = _sums(x, along, self.step[1], 0, np.float64) / along
        return columns, _sums(y, down, self.step[0], 0, np.float64) / down


def _sums(values: Array, count: int, step: int, axis: int, dtype: type) -> Array:
    """Return the sums of every `count` values a `step` apart along an axis."""
    before, after = values.shape[:axis], values.shape[axis + 1 :]
    parts = np.moveaxis(values.reshape(*before, -1, count, step, *after), axis + 1, 0)
    total = parts[0].astype(dtype)
    for part in parts[1:]:
        total += part
    joined: Array = total.reshape(*before, -1, *after)
    return joined


ALONE = BinningGroups(Binning(rows=1, columns=1), (1, 1))
"""Every pixel read by itself."""
