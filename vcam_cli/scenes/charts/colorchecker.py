"""The ColorChecker Classic: 24 patches, six by four, on a black card.

Proportions of the printed chart: patches of 40 mm, 5 mm of black between them, 7.5 mm around.
As large as fits the frame, never stretched; the rest of the frame is a dark surround.
Reflectances: N. Ohta's measurement (1997), `spectra.colorchecker`.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import product
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.cells import overlap
from vcam_cli.spectra import Spectrum, colorchecker

ROWS, COLUMNS = 4, 6
PATCH, GAP, BORDER = 40.0, 5.0, 7.5
WIDTH = COLUMNS * PATCH + (COLUMNS - 1) * GAP + 2 * BORDER
HEIGHT = ROWS * PATCH + (ROWS - 1) * GAP + 2 * BORDER

CARD = 0.03
"""Reflectance of the black card."""
SURROUND = 0.08
"""Reflectance of what is behind the card."""

BLACK = 24
"""Index of the flat spectrum, after the 24 patches."""


def reflectances() -> tuple[Spectrum, ...]:
    """Return the 24 patches row by row, then the flat spectrum that card and surround share."""
    return (*(spectrum for _, spectrum in colorchecker()), Spectrum.flat(1.0))


def largest_card(frame: Frame) -> "Card":
    """Return the largest card that fits, in the middle of the frame.

    Parameters
    ----------
    frame : Frame
        Size of the frame [m].

    Returns
    -------
    Card
        The card.
    """
    return Card(min(frame.width / WIDTH, frame.height / HEIGHT))


def card_of_height(part: float, frame: Frame) -> "Card":
    """Return a card of a part of the frame's height, or what fits its width.

    Parameters
    ----------
    part : float
        Height of the card over that of the frame, 0 to 1.
    frame : Frame
        Size of the frame [m].

    Returns
    -------
    Card
        The card.
    """
    return Card(min(part * frame.height / HEIGHT, frame.width / WIDTH))


@dataclass(frozen=True)
class Card:
    """A card centered on the array; `mix` is (R, 25) in the order of `reflectances`."""

    scale: float
    """Length on the sensor of one millimeter of the card [m]."""

    @property
    def half_width(self) -> float:
        """Half the width on the sensor [m]."""
        return self.scale * WIDTH / 2

    @property
    def half_height(self) -> float:
        """Half the height on the sensor [m]."""
        return self.scale * HEIGHT / 2

    @property
    def darkest(self) -> float:
        """Least reflectance of patches and card at any wavelength."""
        return min(CARD, *(spectrum.least for _, spectrum in colorchecker()))

    def light(self, cover: "Cover", mix: Array) -> Array:
        """Return the light of card and patches times their cover, 0 around them.

        It is a product of matrices, since x and y separate.

        Parameters
        ----------
        cover : Cover
            Parts of cells, or points, that card and patches cover.
        mix : Array
            Mixtures (R, K) of the components: a patch each.

        Returns
        -------
        Array
            Light (R, rows, columns), in the unit of `mix`.
        """
        card = CARD * mix[:, BLACK]
        patches = mix[:, :BLACK].reshape(-1, ROWS, COLUMNS) - card[:, None, None]
        # the card as one more row and column of patches: one product for all
        block = np.zeros((len(mix), ROWS + 1, COLUMNS + 1), mix.dtype)
        block[:, :ROWS, :COLUMNS] = patches
        block[:, ROWS, COLUMNS] = card
        down = np.concatenate([cover.rows, cover.down[None]]).astype(mix.dtype)
        across = np.concatenate([cover.columns, cover.across[None]]).astype(mix.dtype)
        out = np.empty((len(mix), down.shape[1], across.shape[1]), mix.dtype)
        for light, plane in zip(out, block, strict=True):  # a stack would hold all of it twice
            light[:] = product(product(down.T, plane), across)
        return out

    def add_light(self, cover: "Cover", mix: Array, out: Array) -> None:
        """Add the light of card and patches to `out`.

        Parameters
        ----------
        cover : Cover
            Parts of cells that card and patches cover.
        mix : Array
            Mixtures (R, K) of the components.
        out : Array
            Planes (R, rows, columns) that it is added to.
        """
        alike = cover.row_runs()
        light = self.light(cover.select_rows([rows.start for rows in alike]), mix)
        for number, rows in enumerate(alike):
            out[:, rows] += light[:, number, None]

    def cell_cover(self, x_edges: Array, y_edges: Array) -> "Cover":
        """Return the parts of cells that card and patches cover: exact, for they are rectangles.

        Parameters
        ----------
        x_edges, y_edges : Array
            Rising edges of the cells [m].

        Returns
        -------
        Cover
            Parts from 0 to 1.
        """
        return Cover(
            overlap(x_edges, -self.half_width, self.half_width),
            overlap(y_edges, -self.half_height, self.half_height),
            np.stack([overlap(x_edges, *ends) for ends in self._patches(COLUMNS)]),
            np.stack([overlap(y_edges, *ends) for ends in self._patches(ROWS)]),
        )

    def point_cover(self, x: Array, y: Array) -> "Cover":
        """Return whether card and patches cover points.

        Parameters
        ----------
        x, y : Array
            Places along the rows and columns [m].

        Returns
        -------
        Cover
            0 or 1.
        """
        return Cover(
            _is_between(x, -self.half_width, self.half_width),
            _is_between(y, -self.half_height, self.half_height),
            np.stack([_is_between(x, *ends) for ends in self._patches(COLUMNS)]),
            np.stack([_is_between(y, *ends) for ends in self._patches(ROWS)]),
        )

    def edges(self) -> tuple[Array, Array]:
        """Return where card and patches start and stop, x and y [m]."""
        x = [-self.half_width, *sum(self._patches(COLUMNS), ()), self.half_width]
        y = [-self.half_height, *sum(self._patches(ROWS), ()), self.half_height]
        return np.array(x), np.array(y)

    def _patches(self, count: int) -> Iterator[tuple[float, float]]:
        """Yield where the patches of a row (count 6) or column (4) start and stop [m]."""
        for number in range(count):
            start = (number - count / 2) * (PATCH + GAP) + GAP / 2
            yield start * self.scale, (start + PATCH) * self.scale


@dataclass(frozen=True)
class Cover:
    """Parts of columns and rows that the card covers; a cell's cover is their product."""

    across: Array
    """Part of each column that the card covers (n,)."""
    down: Array
    """Part of each row that the card covers (m,)."""
    columns: Array
    """Part of each column that each column of patches covers (6, n)."""
    rows: Array
    """Part of each row that each row of patches covers (4, m)."""

    def row_runs(self) -> list[slice]:
        """Return runs of rows that are covered alike: few, for what lies on them are rectangles."""
        last = np.diff(self.down) != 0
        last |= np.diff(self.rows).any(axis=0)
        bounds = [0, *(np.flatnonzero(last) + 1).tolist(), len(self.down)]
        return [slice(*ends) for ends in pairwise(bounds)]

    def select_rows(self, index: list[int]) -> "Cover":
        """Return the cover of some rows alone.

        Parameters
        ----------
        index : list of int
            The rows.

        Returns
        -------
        Cover
            Their cover.
        """
        return replace(self, down=self.down[index], rows=self.rows[:, index])


@dataclass(frozen=True)
class ColorChecker(Chart):
    """The chart: the card before its surround."""

    card: Card

    @property
    def darkest(self) -> float:
        """Least reflectance of card and surround at any wavelength."""
        return min(self.card.darkest, SURROUND)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells into `out`."""
        cover = self.card.cell_cover(x_edges, y_edges)
        alike = cover.row_runs()
        light = self._add_surround(cover.select_rows([rows.start for rows in alike]), mix)
        for number, rows in enumerate(alike):
            out[:, rows] = light[:, number, None]

    def edges(self) -> tuple[Array, Array]:
        """Return where card and patches start and stop, x and y [m]."""
        return self.card.edges()

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        return self._add_surround(self.card.point_cover(x, y), mix)

    def _add_surround(self, cover: Cover, mix: Array) -> Array:
        surround = SURROUND * mix[:, BLACK, None, None]
        out = self.card.light(cover, mix)
        covered = np.outer(cover.down, cover.across).astype(mix.dtype)
        for plane, level in zip(out, surround, strict=True):
            plane += level * (1 - covered)
        return out


def _is_between(position: Array, low: float, high: float) -> Array:
    return ((position >= low) & (position <= high)).astype(float)
