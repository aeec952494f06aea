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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.array import Binning
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry
from vcam_cli.effects.base import Draw, Effect, Limit
from vcam_cli.engine.capture import codes_type
from vcam_cli.errors import Collector, bad

Block = tuple[tuple[str, ...], ...]
SURE = 3
"""Standard deviations of the readout by which a pixel of full wells may read less than they hold,
where noise comes behind the wells."""
SUM_BITS = 32
"""Of the whole numbers that a raw frame is made of, at most."""
Take = Callable[[NDArray, float, tuple[Effect, ...]], tuple[NDArray, NDArray]]
"""A frame of a rate [e/s] in a time [s] with effects: (electrons, dn)."""


@dataclass(frozen=True)
class Joining:
    """Groups of pixels that are read as one."""

    binning: Binning
    step: tuple[int, int]
    """Rows and columns from one joined pixel to the next."""

    @property
    def count(self) -> int:
        """Pixels of a group."""
        return self.binning.count

    @property
    def charges(self) -> int:
        """Pixels whose charge is counted as one."""
        return self.count if self.binning.kind == "charge" else 1

    @property
    def summed(self) -> int:
        """Codes that are added."""
        return self.count if self.binning.kind == "digital" else 1

    @property
    def gathered(self) -> int:
        """The raw frame's electrons over those of one pixel, in even light."""
        return self.charges * self.summed

    @property
    def whole(self) -> tuple[int, int]:
        """Rows and columns of the smallest array that can be joined."""
        return self.binning.rows * self.step[0], self.binning.columns * self.step[1]

    def block(self, block: Block) -> Block:
        """The block of colors of joined pixels."""
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
        """Geometry of the joined pixels of an array; photodetectors are those of one pixel."""
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

    def collected(self, light: NDArray) -> NDArray:
        """What each node collects of the light (..., rows, columns) of all pixels, its unit."""
        return self.sums(light) if self.charges > 1 else light

    def joined(self, electrons: NDArray) -> NDArray:
        """The raw frame's signal of what each node has (..., rows, columns), in its unit."""
        if self.binning.kind == "charge":
            return electrons
        total = self.sums(electrons)
        return total if self.summed > 1 else total / total.dtype.type(self.count)

    def sums(self, values: NDArray, dtype: type | None = None) -> NDArray:
        """Sums (..., rows, columns) of all groups, in the type of the values or another."""
        dtype = values.dtype.type if dtype is None else dtype
        if self.count == 1:
            return values.astype(dtype, copy=False)
        total = _sums(values, self.binning.rows, self.step[0], values.ndim - 2, dtype)
        return _sums(total, self.binning.columns, self.step[1], values.ndim - 1, dtype)

    def centers(self, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray]:
        """Centers of gravity of the groups' columns and rows, from those of the pixels [m]."""
        down, along = self.binning.rows, self.binning.columns
        columns = _sums(x, along, self.step[1], 0, np.float64) / along
        return columns, _sums(y, down, self.step[0], 0, np.float64) / down


def _sums(values: NDArray, count: int, step: int, axis: int, dtype: type) -> NDArray:
    """Of every `count` values a `step` apart along an axis."""
    before, after = values.shape[:axis], values.shape[axis + 1 :]
    parts = np.moveaxis(values.reshape(*before, -1, count, step, *after), axis + 1, 0)
    total = parts[0].astype(dtype)
    for part in parts[1:]:
        total += part
    return total.reshape(*before, -1, *after)


ALONE = Joining(Binning(rows=1, columns=1), (1, 1))
"""Every pixel read by itself."""


def joining(camera: Camera, block: Block, g: Geometry) -> Joining:
    """Which pixels a camera joins; `block`: ((color,),) where all have the same colors.

    Raises BadInput for an array that is not a whole number of groups, and for sums of codes beyond
    what a raw frame holds.
    """
    binning = camera.array.binning
    if binning is None or binning.count == 1:
        return ALONE
    _require_single(camera, binning)
    _require_codes(camera, binning)
    alike = _neighbors_are_alike(block, binning)
    found = Joining(binning, (1, 1) if alike else (len(block), len(block[0])))
    _require_whole(camera, found, g)
    return found


def _neighbors_are_alike(block: Block, binning: Binning) -> bool:
    """Whether every group of neighbors is of one color."""
    height, width = len(block), len(block[0])
    return all(
        block[row % height][column % width]
        == block[row // binning.rows * binning.rows % height][
            column // binning.columns * binning.columns % width
        ]
        for row in range(math.lcm(height, binning.rows))
        for column in range(math.lcm(width, binning.columns))
    )


def _require_single(camera: Camera, binning: Binning) -> None:
    if camera.exposure.captures and binning.kind != "charge":
        raise bad(
            "exposure.captures",
            f"several samples of one integration cannot be joined as {binning.kind}",
            "write kind: charge in array.binning, or one exposure time",
        )


def _require_codes(camera: Camera, binning: Binning) -> None:
    bits = camera.adc.bits
    if binning.kind != "digital" or binning.count * (2**bits - 1) < 1 << SUM_BITS:
        return
    most = SUM_BITS - math.ceil(math.log2(binning.count))
    raise bad(
        "adc.bits",
        f"{binning.count} codes of {bits} bits add up to more than {SUM_BITS} bits hold",
        f"write at most bits: {most}, or join fewer pixels (array.binning)",
    )


def _require_whole(camera: Camera, found: Joining, g: Geometry) -> None:
    problems = Collector()
    sides = (("rows", "height", g.rows, g.pitch_y), ("columns", "width", g.columns, g.pitch_x))
    for (name, side, count, pitch), whole in zip(sides, found.whole, strict=True):
        if count % whole == 0:
            continue
        why = f"{count} {name} cannot be joined in groups of {whole}"
        if whole > getattr(found.binning, name):
            why += f", {getattr(found.binning, name)} of each color"
        near = [n * whole for n in (count // whole, count // whole + 1) if n]
        if camera.array.die is None:
            remedy = f"write {name}: {' or '.join(str(n) for n in near)}"
            problems.add(("array", name), why, remedy)
        else:
            sizes = " or ".join(f"{n * pitch * 1e3:.6g} mm" for n in near)
            problems.add(("array", "die", side), why, f"write {side}: {sizes}")
    problems.raise_if_any()


def variance(draw: Draw, mean: float, dark: float, binning: Binning | None) -> float:
    """Variance that a draw adds to the mean of a group's pixels [electrons squared].

    mean, dark: of one of them [electrons]. Charges that are joined are one pixel: `draw.variance`.
    """
    if binning is None or binning.kind == "charge":
        return draw.variance(mean, dark)
    parts = (0.0 if p is None else p.variance(mean, dark) for p in draw.split())
    own, column, row = parts
    if binning.kind == "digital":
        return own / binning.count + column / binning.columns + row / binning.rows
    return (own if draw.of_readout else own / binning.count) + column + row


def conversions(binning: Binning | None) -> int:
    """Numbers that the ADC makes for one pixel of the raw frame."""
    return binning.count if binning is not None and binning.kind == "digital" else 1


def read(
    joining: Joining,
    rate: NDArray,
    time: float,
    effects: Sequence[Effect],
    take: Take,
    bits: int,
) -> tuple[NDArray, NDArray]:
    """One frame of joined pixels: (electrons, dn).

    rate: of every pixel, of every node where charges are joined [e/s]; effects: in the order of
    action; bits: of the ADC. Voltages are held by the pixels, joined, and read: two frames, one
    after the other.
    """
    kind, effects = joining.binning.kind, tuple(effects)
    if kind == "charge":
        return take(rate, time, effects)
    if kind == "digital":
        electrons, dn = take(rate, time, effects)
        return joining.joined(electrons), joining.sums(dn, codes_type(bits, joining.count))
    held, _ = take(rate, time, held_by_pixels(effects))
    return take(joining.joined(held), 1.0, read_together(effects))


def held_by_pixels(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """What acts in the pixels: of draws, the part that every pixel has to itself."""
    parts = (e.split()[0] if isinstance(e, Draw) else e for e in effects if not _of_readout(e))
    return tuple(e for e in parts if e is not None)


def read_together(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """What acts on joined voltages: the readout's noise, what columns and rows do, and clamps."""
    out: list[Effect] = []
    for effect in effects:
        if _of_readout(effect) or isinstance(effect, Limit):
            out.append(effect)
        elif isinstance(effect, Draw):
            out += [part for part in effect.split()[1:] if part is not None]
    return tuple(out)


def _of_readout(effect: Effect) -> bool:
    return isinstance(effect, Draw) and effect.of_readout
