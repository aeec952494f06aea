"""What flows through processing: a context, blocks of rows, operations on them.

A frame is worked on in blocks of some rows that pass through all operations while they are in the
cache; an operation that looks at neighbors asks for a `halo` of rows above and below. Blocks are
the same whatever the number of workers, and so are the bytes that come out.

Why an operation has two faces: the ideal image has all colors at every pixel and no mosaic, but
must go through the very same color transform as the camera's picture. `on_block` acts on the
picture, `on_colors` on full-color values: the ideal image, and the white that sets the scale.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from vcam_cli.spectra import Spectrum

STEP, MOST = 16, 64
"""Rows of a block: a multiple of the one, at most the other."""
PIXELS = 1 << 17
"""Of a block, about: three colors of them and what is made of them stay in the cache."""

Pattern = tuple[tuple[str, ...], ...]
Result = TypeVar("Result")


@dataclass(frozen=True)
class Patches:
    """A ColorChecker in the light of the scene.

    dn: (C, 24) [DN] what each patch would give on axis in each color, as `Context.white_dn`.
    light: spectral radiance of the scene's perfect white, any scale; start, stop: the wavelengths
        simulated [m].
    """

    dn: np.ndarray
    light: Spectrum
    start: float
    stop: float


class Layout(Protocol):
    """Where the pixels of an array stand that has no rows and columns of squares.

    Arrays of the frame's shape: x, y: centers [m]; color: index into the colors. The picture is
    shown on a square grid, its columns at picture_x and its rows at picture_y [m].
    """

    @property
    def x(self) -> np.ndarray: ...

    @property
    def y(self) -> np.ndarray: ...

    @property
    def color(self) -> np.ndarray: ...

    @property
    def picture_x(self) -> np.ndarray: ...

    @property
    def picture_y(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Context:
    """What processing must know of the camera that took the frame.

    pattern: the repeating block of colors, e.g. (("R", "G"), ("G", "B")), row 0 first.
    colors: the order of the color planes, e.g. ("R", "G", "B"); ("Y",) for monochrome.
    white_dn: (C,) [DN] what the scene's perfect white would give on axis in each color, free
        of noise, black included, not clipped.
    black_dn: [DN] mean dark signal and offset.
    linearize: the codes of a linear ADC [DN] for those of this one; None where it is linear.
    saturated_dn: [DN] from which on a pixel is saturated.
    patches: gives the ColorChecker as this camera sees it; called only where a step asks for it.
    planes: every raw pixel has all its colors: the frame is (C, rows, columns), without a pattern.
    layout: where pixels stand that are scattered; None where they fill rows and columns.
    """

    pattern: Pattern
    colors: tuple[str, ...]
    white_dn: np.ndarray
    black_dn: float
    linearize: Callable[[np.ndarray], np.ndarray] | None = None
    saturated_dn: float = np.inf
    patches: Callable[[], Patches] | None = None
    planes: bool = False
    layout: Layout | None = None

    @property
    def mosaic(self) -> bool:
        """Whether a raw pixel holds one color of several."""
        return len(self.colors) > 1 and not self.planes


@dataclass(frozen=True)
class Block:
    """Some rows of a picture: planes (C, rows, columns) float32, (1, rows, columns) for a mosaic.

    `first_row` is the array's row that planes[:, 0] belongs to; -1 is the mirror of row 1.
    """

    planes: np.ndarray
    first_row: int


class Operation(Protocol):
    """One linear step. It may overwrite the planes of the block it is given."""

    @property
    def halo(self) -> int:
        """Rows it needs above and below, and takes away."""

    def on_block(self, block: Block) -> Block: ...

    def on_colors(self, values: np.ndarray) -> np.ndarray:
        """The same transform of full-color values (C, ...) [as they come out of the last step]."""


def blocks(rows: int, columns: int) -> Iterator[tuple[int, int]]:
    """(start, stop) of every block of a picture of so many rows and columns."""
    size = max(STEP, min(PIXELS // columns // STEP * STEP, MOST))
    for start in range(0, rows, size):
        yield start, min(start + size, rows)


def map_blocks(
    work: Callable[[int, int], Result], shape: Sequence[int], workers: int
) -> list[Result]:
    """work(start, stop) for every block of a picture, on `workers` threads.

    shape: its rows and columns last. Returns the results in the order of rows.
    """
    spans = list(blocks(*shape[-2:]))
    if workers <= 1 or len(spans) == 1:
        return [work(*span) for span in spans]
    with ThreadPoolExecutor(min(workers, len(spans))) as pool:
        return list(pool.map(lambda span: work(*span), spans))


def mirror(index: np.ndarray, count: int) -> np.ndarray:
    """Indices beyond 0 .. count-1 reflected about the first and last element: -1 -> 1.

    Two elements of the same parity stay so: a mirrored Bayer mosaic is a Bayer mosaic.
    """
    period = max(2 * (count - 1), 1)
    folded = np.abs(index) % period
    return np.minimum(folded, period - folded)


def cut(dn: np.ndarray, start: int, stop: int, halo: int) -> Block:
    """A copy of rows start - halo .. stop + halo of a raw frame, mirrored beyond its border.

    dn: (rows, columns), or (C, rows, columns) where every pixel has all its colors.
    """
    first, last = start - halo, stop + halo
    height = dn.shape[-2]
    if first >= 0 and last <= height:
        rows = dn[..., first:last, :]
    else:
        rows = dn[..., mirror(np.arange(first, last), height), :]
    block = np.array(rows, dtype=np.float32)
    return Block(block if dn.ndim == 3 else block[np.newaxis], first)


def flow(dn: np.ndarray, operations: tuple[Operation, ...], start: int, stop: int) -> Block:
    """Rows start .. stop of a raw frame after all `operations`."""
    block = cut(dn, start, stop, sum(operation.halo for operation in operations))
    for operation in operations:
        block = operation.on_block(block)
    return block
