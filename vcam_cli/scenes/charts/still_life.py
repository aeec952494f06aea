"""A ColorChecker lying on dead leaves, in the middle of the picture.

Leaves under the card are not painted, but in the cells that the card covers in part: there, what
lies under it is painted by itself and taken away.
"""

from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart
from vcam_cli.scenes.cells import clip_cells
from vcam_cli.scenes.charts.colorchecker import Card, ColorChecker
from vcam_cli.scenes.charts.dead_leaves import PIGMENTS, DeadLeaves, PlacedLeaves
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region
from vcam_cli.spectra import colorchecker


@dataclass(frozen=True)
class LeavesWithColorChecker(Chart):
    """The chart; `mix` is (R, 25), as for the card."""

    leaves: DeadLeaves | PlacedLeaves
    card: Card
    edge_seconds = property(lambda self: self.leaves.edge_seconds)
    painted = property(lambda self: self.leaves)
    undivided = property(lambda self: self.leaves.undivided)

    @property
    def darkest(self) -> float:
        """Least reflectance of leaves and card at any wavelength."""
        return min(self.leaves.darkest, self.card.darkest)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of leaves all over, and of the card on them."""
        card = ColorChecker(self.card).edge_energy(region, level, ceiling)
        return self.leaves.edge_energy(region, level[_patches_of_pigments()], ceiling) + card

    def crop_to_cells(self, x_edges: Array, y_edges: Array) -> "LeavesWithColorChecker":
        """Return the chart with only those leaves that may be seen beside the card."""
        if isinstance(self.leaves, PlacedLeaves):
            return self
        across, down = (
            _CardCells(self.card.half_width, x_edges),
            _CardCells(self.card.half_height, y_edges),
        )
        hidden = (down.whole, across.whole)
        return replace(self, leaves=self.leaves.crop_to_cells(x_edges, y_edges, hidden))

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells into `out`."""
        across, down = (
            _CardCells(self.card.half_width, x_edges),
            _CardCells(self.card.half_height, y_edges),
        )
        of_leaves = mix[:, _patches_of_pigments()]
        self.leaves.paint(x_edges, y_edges, of_leaves, out, (down.whole, across.whole))
        if not (across.any and down.any):
            return
        strips = [(row, across.cells) for row in down.ends]
        strips += [(down.whole, column) for column in across.ends]
        for rows, columns in strips:
            (x, cover_x), (y, cover_y) = across.part(columns), down.part(rows)
            if len(cover_x) and len(cover_y):
                under = self.leaves.averages(x, y, of_leaves) * np.outer(cover_y, cover_x)
                out[:, rows, columns] -= under  # a mixture's light may be negative
        cover = self.card.cell_cover(across.edges, down.edges)
        self.card.add_light(cover, mix, out[:, down.cells, across.cells])

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        cover = self.card.point_cover(x, y)
        leaves = self.leaves.values(x, y, mix[:, _patches_of_pigments()])
        light: Array = leaves * (1 - np.outer(cover.down, cover.across)) + self.card.light(
            cover, mix
        )
        return light


def _patches_of_pigments() -> list[int]:
    names = [name for name, _ in colorchecker()]
    return [names.index(name) for name in PIGMENTS]


class _CardCells:
    """Cells that the card reaches into, along one axis."""

    def __init__(self, half: float, edges: Array) -> None:
        """Find the cells between `edges` that lie within `half` of 0.

        `cells` are those that the card reaches into, between `edges` [m]; `whole` those wholly
        under it, and `ends` the first and last where they are not.
        """
        self.cells, self._cover, self._inside = clip_cells(edges, half)
        start, stop = self.cells.start, self.cells.stop
        self.any = stop > start
        self.edges = edges[start : stop + 1]
        partial = {
            number for number in (start, stop - 1) if self.any and self._cover_of(number) < 1.0
        }
        self.ends = [slice(number, number + 1) for number in sorted(partial)]
        self.whole = slice(start + (start in partial), stop - (stop - 1 in partial))

    def part(self, cells: slice) -> tuple[Array, Array]:
        """Return edges of some cells, cut to the card, and how much of each cell lies under it."""
        start, stop = (number - self.cells.start for number in (cells.start, cells.stop))
        return self._inside[start : stop + 1], self._cover[start:stop]

    def _cover_of(self, number: int) -> float:
        return float(self._cover[number - self.cells.start])
