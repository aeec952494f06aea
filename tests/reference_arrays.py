"""Arrays of the slow camera that are no rectangular Bayer mosaic: where pixels are, what they see.

A pixel is a place and a color; its photodetector is an upright rectangle at that place, however
the pixels around it lie. Lengths in meters, x to the right, y down, 0 at the sensor's center.
"""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from reference_collect import centers
from reference_silicon import depths


@dataclass(frozen=True)
class Pixels:
    """Pixels at places of their own, on a sensor of width x height."""

    x: np.ndarray  # centers: (rows, columns), or (1, N) of pixels without rows
    y: np.ndarray
    color: np.ndarray  # the same shape; (C, rows, columns) where a place has all colors
    width: float
    height: float
    even: bool = True  # whether each color's pixels cover the sensor evenly

    def everywhere(self, count: int = 40) -> "Pixels":
        """Places evenly over the same sensor, each with all colors of this one."""
        x, y = (centers(count, side / count) for side in (self.width, self.height))
        x, y = np.meshgrid(x, y)
        colors = np.arange(self.color.max() + 1)[:, None, None]
        return Pixels(x, y, colors * np.ones((1, *x.shape), int), self.width, self.height)


def tiled(
    block: Sequence[str], names: str, rows: int, columns: int, pitch_x: float, pitch_y: float
) -> Pixels:
    """A block of colors (a string a row) laid over rows and columns, one cell after another."""
    x, y = np.meshgrid(centers(columns, pitch_x), centers(rows, pitch_y))
    color = np.empty((rows, columns), int)
    for i in range(rows):
        for j in range(columns):
            line = block[i % len(block)]
            color[i, j] = names.index(line[j % len(line)])
    return Pixels(x, y, color, columns * pitch_x, rows * pitch_y)


def turned(rows: int, columns: int, pitch_x: float, pitch_y: float) -> Pixels:
    """A Bayer mosaic in rows and columns turned by 45 degrees: pixel (i, j) goes to the place

    ((j - i) pitch_x, (j + i) pitch_y) / sqrt(2). Of these as many rows and columns as are asked
    for are kept, the red pixel (0, 0) half a step from the sensor's left and upper edges.
    """
    half_x, half_y = pitch_x / math.sqrt(2), pitch_y / math.sqrt(2)
    found = []
    for i in range(-2 * columns, rows + 1):
        for j in range(rows + 2 * columns + 1):
            across, down = j - i, j + i
            if 0 <= down < rows and 0 <= across < 2 * columns:
                found.append((down, across, "RGB".index(("RG", "GB")[i % 2][j % 2])))
    down, across, color = np.array(sorted(found)).T.reshape(3, rows, columns)
    width, height = 2 * columns * half_x, rows * half_y
    x, y = (across + 0.5) * half_x - width / 2, (down + 0.5) * half_y - height / 2
    return Pixels(x, y, color, width, height)


def told(file: Path, names: str, pitch_x: float, pitch_y: float) -> Pixels:
    """Pixels of a file with the columns x_um,y_um,color, centered on the axis: (1, N)."""
    with file.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    x = np.array([[float(row["x_um"]) * 1e-6 for row in rows]])
    y = np.array([[float(row["y_um"]) * 1e-6 for row in rows]])
    color = np.array([[names.index(row["color"]) for row in rows]])
    width, height = 2 * np.abs(x).max() + pitch_x, 2 * np.abs(y).max() + pitch_y
    return Pixels(x, y, color, float(width), float(height), even=False)


def stacked(count: int, rows: int, columns: int, pitch_x: float, pitch_y: float) -> Pixels:
    """Rows and columns of `count` photodetectors each, one below the other."""
    flat = tiled("Y", "Y", rows, columns, pitch_x, pitch_y)
    color = np.arange(count)[:, None, None] + 0 * flat.color
    return Pixels(flat.x, flat.y, color, flat.width, flat.height)


def layer(top: float, bottom: float, alpha: np.ndarray) -> np.ndarray:
    """Part of the light absorbed between two depths: what each sheet dz takes, added up."""
    z, weight = depths(bottom - top)
    return (alpha[:, None] * np.exp(-np.outer(alpha, top + z))) @ weight


def binned(values: np.ndarray, rows: int, columns: int, apart: tuple[int, int]) -> np.ndarray:
    """Sums over rows x columns pixels of a frame, those of one sum `apart` from one another."""
    down, along = rows * apart[0], columns * apart[1]
    out = np.zeros((values.shape[0] // rows, values.shape[1] // columns))
    for i, j in np.ndindex(values.shape):
        to_row = i // down * apart[0] + i % apart[0]
        to_column = j // along * apart[1] + j % apart[1]
        out[to_row, to_column] += values[i, j]
    return out
