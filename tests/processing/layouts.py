"""Arrays whose pixels fill no rows and columns, made here and not by the engine."""

from dataclasses import dataclass

import numpy as np

RGB = ("R", "G", "B")


@dataclass(frozen=True)
class Layout:
    """What processing asks of a layout; lengths in pixels."""

    x: np.ndarray
    y: np.ndarray
    color: np.ndarray
    picture_x: np.ndarray
    picture_y: np.ndarray

    @property
    def grid(self):
        """x and y of the picture's pixels: (rows, columns) each."""
        return np.meshgrid(self.picture_x, self.picture_y)

    def sampled(self, chart):
        """chart(x, y, color) at every pixel."""
        return chart(self.x, self.y, self.color)

    def ideal(self, chart, colors=3):
        """(C, rows, columns) chart(x, y, color) on the picture's grid."""
        x, y = self.grid
        return np.stack([chart(x, y, np.full(x.shape, c)) for c in range(colors)])


def centered(count, pitch=1.0):
    return (np.arange(count) - (count - 1) / 2) * pitch


def honeycomb(rows=40, columns=24):
    """A Bayer mosaic turned by 45 degrees; a unit is the distance of neighboring pixels."""
    row, column = np.mgrid[0:rows, 0:columns]
    x = (column + 0.5 * (row % 2)) * np.sqrt(2)
    y = row * np.sqrt(0.5)
    color = np.where(row % 2 == 1, 1, np.where((column + row // 2) % 2 == 0, 0, 2))
    wide, high = int(columns * np.sqrt(2)), int(rows * np.sqrt(0.5))
    return Layout(x - x.mean(), y - y.mean(), color, centered(wide), centered(high))


def moved(side=30, seed=0):
    """Bayer pixels, (1, N), each moved by up to 0.4 along x and y."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[0:side, 0:side]
    color = np.where((row + column) % 2 == 1, 1, np.where(row % 2 == 0, 0, 2))
    x, y = (at - (side - 1) / 2 + rng.uniform(-0.4, 0.4, at.shape) for at in (column, row))
    flat = [values.reshape(1, -1) for values in (x, y, color)]
    return Layout(*flat, centered(side), centered(side))


def square(side=24):
    """A Bayer mosaic in rows and columns."""
    row, column = np.mgrid[0:side, 0:side]
    color = np.where((row + column) % 2 == 1, 1, np.where(row % 2 == 0, 0, 2))
    at = centered(side)
    return Layout(at[column], at[row], color, at, at)


LAYOUTS = {"honeycomb": honeycomb, "moved": moved, "square": square}
