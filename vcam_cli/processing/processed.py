"""A frame after processing: computed when it is asked for, block of rows by block of rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vcam_cli.errors import bad
from vcam_cli.processing import tone
from vcam_cli.processing.base import Context, Operation, flow, map_blocks
from vcam_cli.processing.check import CANNOT_JUDGE, CANNOT_SHOW


@dataclass(frozen=True)
class Processed:
    """A frame after processing: linear light, codes of the render, and the ideal image's scale.

    dn: (rows, columns) [DN], or (C, rows, columns) where every pixel has all its colors.
    """

    dn: np.ndarray
    context: Context
    operations: tuple[Operation, ...]
    curve: tone.Curve
    colors: tuple[str, ...]  # of the picture: the camera's, or the display's after correction
    full_color: bool  # every pixel holds all colors: demosaiced, or monochrome
    workers: int = 1
    notes: tuple[str, ...] = ()  # what a user should know

    @property
    def channels(self) -> int:
        return len(self.colors) if self.full_color else 1

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture; BadInput where scattered pixels make none."""
        if self.context.layout is not None and not self.full_color:
            raise bad(("processing",), *CANNOT_SHOW)
        rows, columns = self.dn.shape[-2:]
        return rows, columns

    @cached_property
    def linear(self) -> np.ndarray:
        """(rows, columns, C) float32 linear light, perfect white = 1; C in the order of colors.

        (rows, columns, 1) for a monochrome array or a mosaic without demosaic. Neither clipped
        above 1 nor below 0.
        """
        linear = np.empty((*self.shape, self.channels), np.float32)

        def fill(start: int, stop: int) -> None:
            planes = flow(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                linear[start:stop, :, channel] = plane

        map_blocks(fill, self.shape, self.workers)
        return linear

    def encode(self, bits: int = 8) -> np.ndarray:
        """The render: codes after the tone curve, uint8 (8 bits) or uint16.

        (rows, columns, C), or (rows, columns) where `linear` has one channel.
        """
        render = np.empty((*self.shape, self.channels), np.uint8 if bits <= 8 else np.uint16)

        def fill(start: int, stop: int) -> None:
            planes = flow(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                render[start:stop, :, channel] = tone.encode(plane, self.curve, bits)

        map_blocks(fill, self.shape, self.workers)
        return render if self.channels > 1 else render[:, :, 0]

    def ideal(self, planes_dn: np.ndarray) -> np.ndarray:
        """The ideal image in the colors and scale of `linear`: (rows, columns, C) float32.

        planes_dn: (C, rows, columns) [DN] all colors at every pixel, free of noise and blur,
        black included. The gains are those found on the camera's picture. What black the steps
        leave in that (dark signal, offset) is the camera's fault and no part of the scene: there
        is none here.
        Raises BadInput for a mosaic without demosaic: it has no counterpart in full color.
        """
        if not self.full_color:
            raise bad(("quality",), *CANNOT_JUDGE)
        if planes_dn.ndim != 3 or planes_dn.shape[0] != len(self.context.colors):
            raise ValueError(f"one plane for each of {self.context.colors}, got {planes_dn.shape}")
        ideal = np.empty((*planes_dn.shape[1:], self.channels), np.float32)
        dark = through(self.operations, np.full(len(planes_dn), self.context.black_dn))

        def fill(start: int, stop: int) -> None:
            values = through(self.operations, planes_dn[:, start:stop])
            for channel, plane in enumerate(values):
                np.subtract(plane, dark[channel], out=ideal[start:stop, :, channel])

        map_blocks(fill, planes_dn.shape, self.workers)
        return ideal


def through(operations: Sequence[Operation], values: np.ndarray) -> np.ndarray:
    """Full-color values (C, ...) after all operations."""
    for operation in operations:
        values = operation.on_colors(values)
    return values
