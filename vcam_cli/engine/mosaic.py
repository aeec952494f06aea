"""Which color each pixel sees."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from vcam_cli.camera.camera import Camera

BLOCKS: dict[str, tuple[tuple[str, ...], ...]] = {
    "monochrome": (("Y",),),
    "bayer-rggb": (("R", "G"), ("G", "B")),
    "bayer-grbg": (("G", "R"), ("B", "G")),
    "bayer-gbrg": (("G", "B"), ("R", "G")),
    "bayer-bggr": (("B", "G"), ("G", "R")),
}
"""The block of colors that repeats over the array, from its upper-left corner."""


@dataclass(frozen=True)
class Mosaic:
    """A block of colors that repeats over the array."""

    block: tuple[tuple[str, ...], ...]

    @property
    def colors(self) -> tuple[str, ...]:
        """The colors in the order of channels: R, G, B first, others by first appearance."""
        seen = dict.fromkeys(c for row in self.block for c in row)
        return tuple(sorted(seen, key=lambda c: ("RGB".find(c) % 4, list(seen).index(c))))

    def in_row(self, row: int) -> Iterator[tuple[int, slice]]:
        """(index of a color, columns of that color) for every color of an array row."""
        line = self.block[row % len(self.block)]
        for offset, color in enumerate(line):
            yield self.colors.index(color), slice(offset, None, len(line))


def mosaic(camera: Camera) -> Mosaic:
    """The camera's mosaic."""
    return Mosaic(BLOCKS[str(camera.array.pattern)])
