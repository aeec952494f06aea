"""The picture after processing: computed on request, block of rows by block of rows."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from vcam_cli.errors import bad
from vcam_cli.processing import tone
from vcam_cli.processing.base import Context, Operation, map_blocks, process_rows
from vcam_cli.processing.check import CANNOT_JUDGE, CANNOT_SHOW
from vcam_cli.processing.jpeg import Compression
from vcam_cli.processing.tone_map import ToneMap
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ProcessedPicture:
    """A frame after processing: linear light, codes of the render, and the ideal image's scale."""

    dn: np.ndarray
    """Frame (rows, columns) [DN], or (C, rows, columns) where every pixel has all its colors."""
    context: Context
    """The camera's data."""
    operations: tuple[Operation, ...]
    """What is applied to the frame, in this order."""
    curve: tone.Curve
    """Tone curve of the render."""
    colors: tuple[str, ...]
    """Colors of the picture: the camera's, or the display's after correction."""
    full_color: bool
    """Whether every pixel holds all colors: demosaiced, or monochrome."""
    tone_map: ToneMap
    """Tone mapping of the render."""
    workers: int = 1
    """Number of threads."""
    notes: tuple[str, ...] = ()
    """What a user should know of the steps."""
    on_codes: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()
    """What is applied to the codes of the render, in this order."""

    @property
    def channels(self) -> int:
        """Number of channels of the picture."""
        return len(self.colors) if self.full_color else 1

    @property
    def is_shown(self) -> bool:
        """Whether a display can show it: in rows and columns, of one color or three."""
        on_grid = self.context.layout is None or self.full_color
        return on_grid and self.channels in (1, 3)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture; BadInput where scattered pixels make none."""
        if self.context.layout is not None and not self.full_color:
            raise bad(("processing",), *CANNOT_SHOW)
        rows, columns = self.dn.shape[-2:]
        return rows, columns

    @cached_property
    def linear(self) -> np.ndarray:
        """Linear light (rows, columns, C), float32, perfect white = 1; C in the order of colors.

        It is (rows, columns, 1) for a monochrome array or a mosaic without demosaic, and clipped
        neither above 1 nor below 0.
        """
        linear = np.empty((*self.shape, self.channels), np.float32)

        def fill(start: int, stop: int) -> None:
            planes = process_rows(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                linear[start:stop, :, channel] = plane

        map_blocks(fill, self.shape, self.workers)
        return linear

    def encode(self, bits: int = 8) -> np.ndarray:
        """Return the render: codes after the tone curve, and what steps make of them.

        Parameters
        ----------
        bits : int
            Resolution of the codes [bits].

        Returns
        -------
        ndarray
            Codes (rows, columns, C), or (rows, columns) where `linear` has one channel; uint8 up to
            8 bits, else uint16.
        """
        shown = self._coded(bits)
        for change in self.on_codes:
            shown = change(shown)
        return shown

    def jpeg(self) -> bytes | None:
        """Return the JPEG file of the render; None where compression is not its last step."""
        *before, last = self.on_codes or (None,)
        if not isinstance(last, Compression):
            return None
        shown = self._coded(8)
        for change in before:
            shown = change(shown)
        return last.file(shown)

    def _coded(self, bits: int) -> np.ndarray:
        """Return the codes after the tone curve."""
        render = np.empty((*self.shape, self.channels), np.uint8 if bits <= 8 else np.uint16)

        def fill(start: int, stop: int) -> None:
            planes = process_rows(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                shown = self.tone_map.apply(plane)
                render[start:stop, :, channel] = tone.encode(shown, self.curve, bits)

        map_blocks(fill, self.shape, self.workers)
        return render if self.channels > 1 else render[:, :, 0]

    def ideal(self, planes_dn: np.ndarray) -> np.ndarray:
        """Return the ideal image in the colors and scale of `linear`.

        The gains are those found on the camera's picture. The black that the steps leave in that
        (dark signal, offset) is an error of the camera, not of the scene, and is left out here.

        Parameters
        ----------
        planes_dn : ndarray
            All colors at every pixel (C, rows, columns) [DN], free of noise and blur, black
            included.

        Returns
        -------
        ndarray
            Ideal image (rows, columns, C), float32.

        Raises
        ------
        BadInput
            A mosaic without demosaic: it has no counterpart in full color.
        """
        if not self.full_color:
            raise bad(("quality",), *CANNOT_JUDGE)
        if planes_dn.ndim != 3 or planes_dn.shape[0] != len(self.context.colors):
            raise ValueError(f"one plane for each of {self.context.colors}, got {planes_dn.shape}")
        ideal = np.empty((*planes_dn.shape[1:], self.channels), np.float32)
        dark = apply_operations(self.operations, np.full(len(planes_dn), self.context.black_dn))

        def fill(start: int, stop: int) -> None:
            values = apply_operations(self.operations, planes_dn[:, start:stop])
            for channel, plane in enumerate(values):
                np.subtract(plane, dark[channel], out=ideal[start:stop, :, channel])

        map_blocks(fill, planes_dn.shape, self.workers)
        return ideal


def apply_operations(operations: Sequence[Operation], values: np.ndarray) -> np.ndarray:
    """Return full-color values after all operations.

    Parameters
    ----------
    operations : sequence of Operation
        What is applied, in this order.
    values : ndarray
        Full-color values (C, ...).

    Returns
    -------
    ndarray
        Values (C, ...), or of the display's colors after color correction.
    """
    for operation in operations:
        values = operation.process_colors(values)
    return values
