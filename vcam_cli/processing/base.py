"""What processing works on: the context of a frame, blocks of its rows, operations on them.

A frame is worked on in blocks of some rows that pass through all operations while they are in the
cache; an operation on neighbors declares a `halo` of rows above and below. Blocks are
the same whatever the number of workers, and so are the bytes that come out.

Why an operation has two faces: the ideal image has all colors at every pixel and no mosaic, but
must go through the very same color transform as the camera's picture. `process_block` acts on the
picture, `process_colors` on full-color values: the ideal image, and the white that sets the scale.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

import numpy as np

from vcam_cli.parallel import results
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum

ROW_STEP, MAX_BLOCK_ROWS = 16, 64
"""Rows of a block: a multiple of the one, at most the other."""
BLOCK_PIXELS = 1 << 17
"""Pixels of a block, about: three colors of them and temporary arrays stay in the cache."""

Pattern = tuple[tuple[str, ...], ...]
Result = TypeVar("Result")


@dataclass(frozen=True)
class Patches:
    """A ColorChecker in the light of the scene."""

    dn: np.ndarray
    """Signal of each patch on axis in each color (C, 24) [DN], as `Context.white_dn`."""
    light: Spectrum
    """Spectral radiance of the scene's perfect white, in any scale."""
    start: float
    """First wavelength that is simulated [m]."""
    stop: float
    """Last wavelength that is simulated [m]."""


class Correction(Protocol):
    """Where a corrected picture takes its pixels from."""

    @property
    def halo(self) -> int:
        """Rows above and below that a row looks at, at most."""

    def sources(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns in the distorted picture of rows of the corrected one."""


class Shading(Protocol):
    """What makes even light even that falls off toward the corners."""

    def correction(self, color: str, rows: np.ndarray, columns: slice) -> np.ndarray:
        """Return the factors of a color at some rows and columns of the picture (M, N)."""


class Layout(Protocol):
    """Positions of pixels that fill no rows and columns of squares.

    Arrays have the frame's shape; the picture is shown on a square grid.
    """

    @property
    def x(self) -> np.ndarray:
        """Centers of the pixels to the right [m]."""

    @property
    def y(self) -> np.ndarray:
        """Centers of the pixels down [m]."""

    @property
    def color(self) -> np.ndarray:
        """Index of each pixel's color."""

    @property
    def picture_x(self) -> np.ndarray:
        """Places of the picture's columns [m]."""

    @property
    def picture_y(self) -> np.ndarray:
        """Places of the picture's rows [m]."""


@dataclass(frozen=True)
class Context:
    """What processing must know of the camera that took the frame."""

    pattern: Pattern
    """Repeating block of colors, e.g. (("R", "G"), ("G", "B")), row 0 first."""
    colors: tuple[str, ...]
    """Order of the color planes, e.g. ("R", "G", "B"); ("Y",) for monochrome."""
    white_dn: np.ndarray
    """Signal of the scene's perfect white on axis in each color (C,) [DN].

    It is free of noise and not clipped, and black is included.
    """
    black_dn: float
    """Mean dark signal and offset [DN]."""
    linearize: Callable[[np.ndarray], np.ndarray] | None = None
    """Gives the codes of a linear ADC [DN] for those of this one; None where it is linear."""
    saturated_dn: float = np.inf
    """Code above which a pixel is saturated [DN]."""
    patches: Callable[[], Patches] | None = None
    """Gives the ColorChecker as this camera sees it; called only where a step needs it."""
    primaries: Callable[[], np.ndarray] | None = None
    """Gives the signal (C, 3) of the primaries of a picture that emits, as `white_dn` [DN]."""
    planes: bool = False
    """Whether every raw pixel has all its colors: the frame is (C, rows, columns), no mosaic."""
    layout: Layout | None = None
    """Positions of pixels that are scattered; None where they fill rows and columns."""
    black_steps: np.ndarray | None = None
    """How far the black level of each color is from `black_dn` (C,) [DN]; None where all are alike.

    It is in the codes of pixels alone: signals that are free of noise have the level `black_dn`.
    """

    correction: Correction | None = None
    """Where a picture without its lens's distortion takes its pixels from; None where the lens has
    none."""
    shading: Shading | None = None
    """How the light of each color falls off; None where it does not."""

    @property
    def mosaic(self) -> bool:
        """Whether a raw pixel holds one color of several."""
        return len(self.colors) > 1 and not self.planes


@dataclass(frozen=True)
class Block:
    """Some rows of a picture."""

    planes: np.ndarray
    """Values (C, rows, columns) float32; (1, rows, columns) for a mosaic."""
    first_row: int
    """Row of the array that planes[:, 0] belongs to; -1 is the mirror of row 1."""


class Operation(Protocol):
    """One linear step. It may overwrite the planes of the block it is given."""

    @property
    def halo(self) -> int:
        """Rows that the operation needs above and below, and takes away."""

    def process_block(self, block: Block) -> Block:
        """Return the block after this step."""

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return full-color values (C, ...) of the last step after the same transform."""


def blocks(rows: int, columns: int) -> Iterator[tuple[int, int]]:
    """Yield the first row and the end of every block of a picture.

    Parameters
    ----------
    rows, columns : int
        Size of the picture [pixels].

    Yields
    ------
    start, stop : int
        Rows of the block.
    """
    size = max(ROW_STEP, min(BLOCK_PIXELS // columns // ROW_STEP * ROW_STEP, MAX_BLOCK_ROWS))
    for start in range(0, rows, size):
        yield start, min(start + size, rows)


def map_blocks(
    work: Callable[[int, int], Result], shape: Sequence[int], workers: int
) -> list[Result]:
    """Return work(start, stop) for every block of a picture.

    Parameters
    ----------
    work : callable
        Function of the first row and the end of a block.
    shape : sequence of int
        Shape of the picture, with its rows and columns last.
    workers : int
        Number of threads.

    Returns
    -------
    list
        Results in the order of rows.
    """
    return results(lambda span: work(*span), blocks(*shape[-2:]), workers)


def mirrored_index(index: np.ndarray, count: int) -> np.ndarray:
    """Return indices reflected about the first and last element: -1 becomes 1.

    Two elements of the same parity stay so: a mirrored Bayer mosaic is a Bayer mosaic.

    Parameters
    ----------
    index : ndarray of int
        Indices, some beyond 0 .. count - 1.
    count : int
        Number of elements.

    Returns
    -------
    ndarray of int
        Indices in 0 .. count - 1, in the same shape.
    """
    period = max(2 * (count - 1), 1)
    folded = np.abs(index) % period
    mirrored: np.ndarray = np.minimum(folded, period - folded)
    return mirrored


def padded_block(dn: np.ndarray, start: int, stop: int, halo: int) -> Block:
    """Return a copy of some rows of a raw frame with their halo, mirrored beyond its border.

    Parameters
    ----------
    dn : ndarray
        Raw frame (rows, columns) [DN], or (C, rows, columns) where every pixel has all its colors.
    start, stop : int
        Rows of the block.
    halo : int
        Rows added above and below.

    Returns
    -------
    Block
        Rows start - halo .. stop + halo.
    """
    first, last = start - halo, stop + halo
    height = dn.shape[-2]
    if first >= 0 and last <= height:
        rows = dn[..., first:last, :]
    else:
        rows = dn[..., mirrored_index(np.arange(first, last), height), :]
    block = np.array(rows, dtype=np.float32)
    return Block(block if dn.ndim == 3 else block[np.newaxis], first)


def process_rows(dn: np.ndarray, operations: tuple[Operation, ...], start: int, stop: int) -> Block:
    """Return some rows of a raw frame after all operations.

    Parameters
    ----------
    dn : ndarray
        Raw frame (rows, columns) [DN], or (C, rows, columns) where every pixel has all its colors.
    operations : tuple of Operation
        What is applied, in this order.
    start, stop : int
        Rows of the block.

    Returns
    -------
    Block
        Rows start .. stop.
    """
    block = padded_block(dn, start, stop, sum(operation.halo for operation in operations))
    for operation in operations:
        block = operation.process_block(block)
    return block
