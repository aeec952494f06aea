"""Demosaicing of any repeating pattern by normalized convolution.

Each color's samples, zero at other sites, and the mask of its sites are convolved
with the same tent; their ratio is the mean of the samples around, the near ones weighing most [1].
Each color's tent reaches from sample to sample. Of a Bayer mosaic this is bilinear interpolation.
Measured values are left as they are; beyond the border there is nothing.

References
----------
.. [1] H. Knutsson, C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
   doi:10.1109/CVPR.1993.341081.
"""

from collections.abc import Hashable
from dataclasses import field
from functools import lru_cache

import numpy as np

from vcam_cli.processing.base import Block, Pattern
from vcam_cli.records import dataclass

MIN_WEIGHT = 1e-30
"""Less than any weight of a tent."""


@lru_cache
def half_width(pattern: Pattern, color: str) -> int:
    """Return half the width of a color's tent, at least 2.

    As wide as finds a sample in each quarter of the tent: every pixel lies between samples, and
    in a corner of the frame, where one quarter is all there is, it still has one.

    Parameters
    ----------
    pattern : Pattern
        Repeating block of colors.
    color : str
        Name of the color.

    Returns
    -------
    int
        Half width [pixels].

    Raises
    ------
    ValueError
        The pattern has no such color.
    """
    here = np.array([[name == color for name in row] for row in pattern])
    if not here.any():
        raise ValueError(f"the pattern has no {color}")
    width = 2
    while not _every_window_has_site(here, width):
        width += 1
    return width


def _every_window_has_site(here: np.ndarray, width: int) -> bool:
    """Return whether every square window of `width` pixels has a site."""
    shifts = [(i, j) for i in range(width) for j in range(width)]
    return bool(np.any([np.roll(here, shift, axis=(0, 1)) for shift in shifts], axis=0).all())


@dataclass(frozen=True)
class Sites:
    """Sites of the samples of each color in a frame, and means over them."""

    pattern: Pattern
    """Repeating block of colors."""
    shape: tuple[int, int]
    """Rows and columns of the frame."""
    _weights: dict[Hashable, np.ndarray] = field(default_factory=dict, compare=False, repr=False)

    def mask(self, color: str | None, rows: np.ndarray) -> np.ndarray:
        """Return where the frame has a sample of a color.

        Parameters
        ----------
        color : str or None
            Name of the color; None for any.
        rows : ndarray of int
            Rows of the frame.

        Returns
        -------
        ndarray
            1 where there is a sample, else 0 (rows, columns), float32.
        """
        block = np.array(
            [[color in (name, None) for name in row] for row in self.pattern], np.float32
        )
        there = ((rows >= 0) & (rows < self.shape[0])).astype(np.float32)
        columns = np.arange(self.shape[1]) % block.shape[1]
        mask: np.ndarray = block[rows % block.shape[0]][:, columns] * there[:, None]
        return mask

    def mean(
        self,
        values: np.ndarray,
        color: str | None,
        width: int,
        rows: np.ndarray,
        axes: tuple[int, ...] = (0, 1),
    ) -> np.ndarray:
        """Return the mean of the values at a color's samples, weighted by a tent.

        Parameters
        ----------
        values : ndarray
            Values (rows, columns) of some rows of the frame.
        color : str or None
            Name of the color; None for all pixels.
        width : int
            Half the width of the tent [pixels].
        rows : ndarray of int
            The frame's rows.
        axes : tuple of int
            Axes along which the tent extends.

        Returns
        -------
        ndarray
            Means (rows, columns); 0 where the tent holds no sample.
        """
        total = tent(values * self.mask(color, rows), width, axes)
        total /= self.weight(color, width, rows, axes)
        return total

    def weight(
        self, color: str | None, width: int, rows: np.ndarray, axes: tuple[int, ...] = (0, 1)
    ) -> np.ndarray:
        """Return the tent over the map of the samples.

        It is kept, since most blocks of a frame have the same.

        Parameters
        ----------
        color, width, rows, axes
            As those of `mean`.

        Returns
        -------
        ndarray
            Weights (rows, columns); `MIN_WEIGHT` where the tent holds no sample.
        """
        phase = int(rows[0]) % len(self.pattern)
        cut = max(0, -int(rows[0])), max(0, int(rows[-1]) - self.shape[0] + 1)
        key = color, width, axes, phase, len(rows), cut
        if key not in self._weights:
            weight = tent(self.mask(color, rows), width, axes)
            self._weights[key] = np.maximum(weight, np.float32(MIN_WEIGHT))
        return np.asarray(self._weights[key])


@dataclass(frozen=True)
class NormalizedConvolution:
    """Takes blocks of any mosaic to full color by the means of the samples around."""

    pattern: Pattern
    colors: tuple[str, ...]
    sites: Sites

    @property
    def widths(self) -> tuple[int, ...]:
        """Half the width of each color's tent [pixels]."""
        return tuple(half_width(self.pattern, color) for color in self.colors)

    @property
    def halo(self) -> int:
        """Rows that the widest tent reaches above and below."""
        return max(self.widths) - 1

    def process_block(self, block: Block) -> Block:
        """Return the block in full color."""
        mosaic, halo = block.planes[0], self.halo
        rows = block.first_row + np.arange(mosaic.shape[0])
        inside = slice(halo, mosaic.shape[0] - halo)
        planes = np.empty(
            (len(self.colors), mosaic.shape[0] - 2 * halo, mosaic.shape[1]), np.float32
        )
        for plane, color, width in zip(planes, self.colors, self.widths, strict=True):
            plane[:] = self.sites.mean(mosaic, color, width, rows)[inside]
            np.copyto(plane, mosaic[inside], where=self.sites.mask(color, rows)[inside] > 0)
        return Block(planes, block.first_row + halo)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values as they are: they have all their colors."""
        return values


def tent(values: np.ndarray, width: int, axes: tuple[int, ...] = (0, 1)) -> np.ndarray:
    """Return the convolution with a tent (1 .. width .. 1); beyond the border there is nothing.

    A tent is an even mean of even means, which take half of the additions.

    Parameters
    ----------
    values : ndarray
        Values (rows, columns).
    width : int
        Half the width of the tent [pixels].
    axes : tuple of int
        Axes along which the tent extends: 0 along columns, 1 along rows.

    Returns
    -------
    ndarray
        Sums (rows, columns).
    """
    for axis in axes:
        padding = [(0, 0), (0, 0)]
        padding[axis] = (width - 1, width - 1)
        values = _sums(_sums(np.pad(values, padding), width, axis), width, axis)
    return values


def _sums(values: np.ndarray, count: int, axis: int) -> np.ndarray:
    """Return the sums of consecutive values along an axis."""
    lines = values if axis == 0 else values.T
    size = len(lines) - count + 1
    out = lines[:size].copy() if count == 1 else lines[:size] + lines[1 : size + 1]
    for shift in range(2, count):
        out += lines[shift : shift + size]
    return out if axis == 0 else out.T
