"""Write the street in configs/scenes: houses behind a road, with a car on it, without, and it.

Run `.venv/bin/python scripts/make_street.py`. They are drawn by the formulas below, each pixel the
mean of 4 x 4 samples; they are no photographs. Lengths are in meters, x to the right from the
middle, y up from the road; colors are sRGB codes from 0 to 1, of reflectances. The car by itself
has a file of its opacity.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.files.images.png import write_png

SCENES = Path(__file__).resolve().parent.parent / "configs" / "scenes"
ROWS, COLUMNS, FINE = 480, 720, 4
WIDTH, BELOW = 14.4, 2.4
"""Width that the picture shows, and how much of the road in front [m]."""
CAR_ROWS, CAR_COLUMNS = slice(350, 425), slice(265, 475)
"""Where the car lies in it [pixels]."""
Floats = NDArray[np.float64]
Color = tuple[float, float, float]
PLASTER: tuple[Color, ...] = (
    (0.80, 0.70, 0.52),
    (0.62, 0.36, 0.28),
    (0.72, 0.74, 0.70),
    (0.50, 0.58, 0.52),
)
GLASS, FRAME, DOOR = (0.16, 0.20, 0.26), (0.88, 0.87, 0.82), (0.25, 0.16, 0.12)
SKY, ROAD, KERB, LINE = (0.30, 0.36, 0.50), (0.30, 0.30, 0.31), (0.62, 0.61, 0.58), (0.9,) * 3
BODY, TIRE, RIM, LAMP = (0.78, 0.10, 0.10), (0.07, 0.07, 0.07), (0.75, 0.76, 0.78), (1.0, 0.93, 0.7)
POLE = (0.14, 0.16, 0.15)


def grid() -> tuple[Floats, Floats]:
    """Return x and y of the samples [m]."""
    step = WIDTH / (COLUMNS * FINE)
    x = (np.arange(COLUMNS * FINE) + 0.5) * step - WIDTH / 2
    y = ROWS * FINE * step - BELOW - (np.arange(ROWS * FINE) + 0.5) * step
    return x[None, :], y[:, None]


def box(x: Floats, y: Floats, left: float, low: float, right: float, high: float) -> Array:
    """Return where samples lie in a rectangle."""
    return (x >= left) & (x < right) & (y >= low) & (y < high)


def disc(x: Floats, y: Floats, at: tuple[float, float], radius: float) -> Array:
    """Return where samples lie in a disc."""
    return (x - at[0]) ** 2 + (y - at[1]) ** 2 < radius**2


def fill(picture: Floats, where: Array, color: Color) -> None:
    """Paint a color where something is."""
    picture[where] = color


def houses(picture: Floats, x: Floats, y: Floats) -> None:
    """Paint four houses with windows and doors."""
    edges = (-7.2, -3.9, -0.2, 3.3, 7.2)
    for number, (left, right) in enumerate(pairwise(edges)):
        high = (5.6, 6.6, 5.2, 6.2)[number]
        fill(picture, box(x, y, left, 0.0, right, high), PLASTER[number])
        for column in range(3):
            middle = left + (right - left) * (column + 0.5) / 3
            for low in (1.0, 3.3, 5.3):
                if low + 1.3 < high and not (low < 2 and column == number % 3):
                    _window(picture, x, y, middle, low)
        middle = left + (right - left) * (number % 3 + 0.5) / 3
        fill(picture, box(x, y, middle - 0.45, 0.0, middle + 0.45, 2.1), DOOR)


def _window(picture: Floats, x: Floats, y: Floats, middle: float, low: float) -> None:
    fill(picture, box(x, y, middle - 0.42, low - 0.05, middle + 0.42, low + 1.25), FRAME)
    for side in (-0.2, 0.2):
        pane = box(x, y, middle + side - 0.17, low, middle + side + 0.17, low + 1.2)
        fill(picture, pane, GLASS)


def road(picture: Floats, x: Floats, y: Floats) -> None:
    """Paint the road, its kerb, the line along its middle, and two lamp posts."""
    fill(picture, box(x, y, -8, -BELOW, 8, 0.0), ROAD)
    fill(picture, box(x, y, -8, -0.25, 8, 0.0), KERB)
    fill(picture, box(x, y, -8, -1.75, 8, -1.62) & ((x + 7.2) % 2.4 < 1.4), LINE)
    for at in (-5.2, 4.6):
        fill(picture, box(x, y, at - 0.06, -0.1, at + 0.06, 4.6), POLE)
        fill(picture, box(x, y, at - 0.06, 4.5, at + 0.9, 4.6), POLE)
        fill(picture, box(x, y, at + 0.5, 4.38, at + 0.95, 4.5), LAMP)


def car(x: Floats, y: Floats, picture: Floats) -> None:
    """Paint a car of four meters on the road."""
    at_x, at_y = x - 0.2, y + 1.25
    roof = (at_y >= 0.85) & (at_y < 1.42) & (np.abs(at_x + 0.15) < 1.25 - 0.75 * (at_y - 0.85))
    glass = (at_y >= 0.9) & (at_y < 1.34) & (np.abs(at_x + 0.15) < 1.12 - 0.75 * (at_y - 0.85))
    post = (np.abs(at_x + 0.1) < 0.04) & (at_y < 1.4)
    fill(picture, box(at_x, at_y, -2.0, 0.25, 2.0, 0.88) | roof, BODY)
    fill(picture, glass & ~post, GLASS)
    fill(picture, box(at_x, at_y, 1.82, 0.6, 2.0, 0.75), LAMP)
    fill(picture, box(at_x, at_y, -0.35, 0.68, -0.15, 0.72), RIM)
    for wheel in (-1.25, 1.25):
        fill(picture, disc(at_x, at_y, (wheel, 0.32), 0.34), TIRE)
        fill(picture, disc(at_x, at_y, (wheel, 0.32), 0.2), RIM)
        for spoke in np.arange(5) * 2 * np.pi / 5:
            place = (wheel + 0.11 * np.cos(spoke), 0.32 + 0.11 * np.sin(spoke))
            fill(picture, disc(at_x, at_y, place, 0.05), TIRE)


def street(with_car: bool) -> Floats:
    """Return sRGB codes of the samples, from 0 to 1."""
    x, y = grid()
    picture = np.empty((ROWS * FINE, COLUMNS * FINE, 3))
    picture[:] = SKY
    houses(picture, x, y)
    road(picture, x, y)
    if with_car:
        car(x, y, picture)
    return picture


def car_alone() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return codes (rows, columns, 3) of the car, those of its color where it is, and opacity."""
    picture = np.full((ROWS * FINE, COLUMNS * FINE, 3), np.nan)
    car(*grid(), picture)
    there = ~np.isnan(picture[..., :1])
    light = pixel_means(np.where(there, linear(picture), 0.0))[CAR_ROWS, CAR_COLUMNS]
    opacity = pixel_means(there.astype(float))[CAR_ROWS, CAR_COLUMNS]
    color = codes(light / np.maximum(opacity, 1e-9))
    return eight_bits(color), eight_bits(opacity[..., 0])


def linear(picture: Floats) -> Floats:
    """Return the light of sRGB codes."""
    return np.where(picture > 0.04045, ((picture + 0.055) / 1.055) ** 2.4, picture / 12.92)


def codes(light: Floats) -> Floats:
    """Return the sRGB codes of light."""
    return np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light)


def pixel_means(samples: Floats) -> Floats:
    """Return the means over the samples of every pixel."""
    return samples.reshape(ROWS, FINE, COLUMNS, FINE, -1).mean(axis=(1, 3))


def eight_bits(values: Floats) -> NDArray[np.uint8]:
    """Return values from 0 to 1 as codes."""
    return np.rint(values * 255).astype(np.uint8)


def picture(with_car: bool) -> NDArray[np.uint8]:
    """Return codes (ROWS, COLUMNS, 3)."""
    return eight_bits(codes(pixel_means(linear(street(with_car)))))


def pictures() -> dict[str, NDArray[np.uint8]]:
    """Return the codes of every file, by its name."""
    color, opacity = car_alone()
    return {
        "street.png": picture(with_car=True),
        "street-empty.png": picture(with_car=False),
        "street-car.png": color,
        "street-car-opacity.png": opacity,
    }


if __name__ == "__main__":
    for name, image in pictures().items():
        write_png(SCENES / name, image)
        print(SCENES / name)
    sys.exit()
