"""Demosaicing of any repeating pattern: normalized convolution.

Each color's samples, zero where there is none, and the map of where there are some are convolved
with the same tent; their ratio is the mean of the samples around, the near ones weighing most.
Each color's tent reaches from sample to sample. Of a Bayer mosaic this is bilinear interpolation.
Measured values are left as they are; beyond the border there is nothing.

Reference: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

from dataclasses import dataclass, field

import numpy as np

from vcam_cli.processing.base import Block, Pattern

NOTHING = 1e-30
"""Less than any weight of a tent."""


def half_width(pattern: Pattern, color: str) -> int:
    """Half the width of a color's tent [pixels], at least 2.

    As wide as finds a sample in each quarter of the tent: every pixel lies between samples, and
    in a corner of the frame, where one quarter is all there is, it still has one.
    """
    here = np.array([[name == color for name in row] for row in pattern])
    if not here.any():
        raise ValueError(f"the pattern has no {color}")
    width = 2
    while not _in_every_window(here, width):
        width += 1
    return width


def _in_every_window(here: np.ndarray, width: int) -> bool:
    """Whether every square window of so many pixels has a site."""
    shifts = [(i, j) for i in range(width) for j in range(width)]
    return bool(np.any([np.roll(here, shift, axis=(0, 1)) for shift in shifts], axis=0).all())


@dataclass(frozen=True)
class Sites:
    """Where a frame of `shape` (rows, columns) has samples of each color, and means over them."""

    pattern: Pattern
    shape: tuple[int, int]
    _weights: dict = field(default_factory=dict, compare=False, repr=False)

    def of(self, color: str | None, rows: np.ndarray) -> np.ndarray:
        """1 where the frame has a sample of the color, or of any: (rows, columns) float32."""
        block = np.array(
            [[color in (name, None) for name in row] for row in self.pattern], np.float32
        )
        there = ((rows >= 0) & (rows < self.shape[0])).astype(np.float32)
        columns = np.arange(self.shape[1]) % block.shape[1]
        return block[rows % block.shape[0]][:, columns] * there[:, None]

    def mean(
        self,
        values: np.ndarray,
        color: str | None,
        width: int,
        rows: np.ndarray,
        axes: tuple[int, ...] = (0, 1),
    ) -> np.ndarray:
        """The mean of the values at a color's samples in a tent of half a width of `width`.

        values: (rows, columns) of the frame's `rows`; axes: along which the tent extends. 0 where
        the tent holds no sample. color: None for all pixels.
        """
        total = tent(values * self.of(color, rows), width, axes)
        total /= self.weight(color, width, rows, axes)
        return total

    def weight(
        self, color: str | None, width: int, rows: np.ndarray, axes: tuple[int, ...] = (0, 1)
    ) -> np.ndarray:
        """The tent over the samples' map; kept, since most blocks of a frame have the same.

        `NOTHING` where it holds no sample.
        """
        phase = int(rows[0]) % len(self.pattern)
        cut = max(0, -int(rows[0])), max(0, int(rows[-1]) - self.shape[0] + 1)
        key = color, width, axes, phase, len(rows), cut
        if key not in self._weights:
            weight = tent(self.of(color, rows), width, axes)
            self._weights[key] = np.maximum(weight, np.float32(NOTHING))
        return np.asarray(self._weights[key])


@dataclass(frozen=True)
class NormalizedConvolution:
    """Mosaic blocks become full-color blocks."""

    pattern: Pattern
    colors: tuple[str, ...]
    sites: Sites

    @property
    def widths(self) -> tuple[int, ...]:
        """Half the width of each color's tent [pixels]."""
        return tuple(half_width(self.pattern, color) for color in self.colors)

    @property
    def halo(self) -> int:
        return max(self.widths) - 1

    def on_block(self, block: Block) -> Block:
        mosaic, halo = block.planes[0], self.halo
        rows = block.first_row + np.arange(mosaic.shape[0])
        inside = slice(halo, mosaic.shape[0] - halo)
        planes = np.empty(
            (len(self.colors), mosaic.shape[0] - 2 * halo, mosaic.shape[1]), np.float32
        )
        for plane, color, width in zip(planes, self.colors, self.widths, strict=True):
            plane[:] = self.sites.mean(mosaic, color, width, rows)[inside]
            np.copyto(plane, mosaic[inside], where=self.sites.of(color, rows)[inside] > 0)
        return Block(planes, block.first_row + halo)

    def on_colors(self, values: np.ndarray) -> np.ndarray:
        return values


def tent(values: np.ndarray, width: int, axes: tuple[int, ...] = (0, 1)) -> np.ndarray:
    """Convolution with the tent (1 .. width .. 1) along columns (0), rows (1); nothing beyond."""
    for axis in axes:
        total = values * np.float32(width)
        for shift in range(1, width):
            weight = np.float32(width - shift)
            ahead = [slice(None), slice(None)]
            behind = [slice(None), slice(None)]
            ahead[axis], behind[axis] = slice(shift, None), slice(None, -shift)
            total[tuple(behind)] += weight * values[tuple(ahead)]
            total[tuple(ahead)] += weight * values[tuple(behind)]
        values = total
    return values
