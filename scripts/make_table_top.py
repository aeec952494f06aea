"""Write the pictures of the scene table-top in configs/scenes: a mug, fruit, and a shelf behind.

Run `.venv/bin/python scripts/make_table_top.py`. They are drawn by the formulas below, each pixel
the mean of 4 x 4 samples; they are no photographs. Codes are linear in light; mug and fruit have
an alpha channel, which is their opacity.
"""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from vcam_cli.arrays import Array

SCENES = Path(__file__).resolve().parent.parent / "configs" / "scenes"
FINE = 4
Floats = NDArray[np.float64]


class Canvas:
    """Samples of color (h, w, 3) and of opacity (h, w), painted over from the back."""

    def __init__(self, width: int, height: int) -> None:
        self.x = (np.arange(width * FINE) + 0.5)[None, :] / FINE
        self.y = (np.arange(height * FINE) + 0.5)[:, None] / FINE
        self.color = np.zeros((height * FINE, width * FINE, 3))
        self.opacity = np.zeros((height * FINE, width * FINE))

    def paint(self, where: Array, color: tuple[float, float, float], light: Floats | float = 1.0):
        """Paint a color in a light (h, w) where samples are."""
        where = np.broadcast_to(where, self.opacity.shape)
        shade = np.broadcast_to(light, self.opacity.shape)[where, None]
        self.color[where] = np.clip(shade * np.array(color), 0, 1)
        self.opacity[where] = 1

    def write(self, name: str, transparent: bool) -> None:
        """Write the means over the pixels as 8 bits; colors are those of the opaque parts."""
        rows, columns = (n // FINE for n in self.opacity.shape)
        parts = (rows, FINE, columns, FINE)
        opacity = self.opacity.reshape(parts).mean(axis=(1, 3))
        color = (self.color * self.opacity[..., None]).reshape(*parts, 3).mean(axis=(1, 3))
        color /= np.maximum(opacity, 1e-9)[..., None]
        image = np.dstack([color, opacity]) if transparent else color
        codes = np.round(255 * image).astype(np.uint8)
        spec = oiio.ImageSpec(columns, rows, codes.shape[2], "uint8")
        spec.attribute("oiio:UnassociatedAlpha", 1)
        out = oiio.ImageOutput.create(str(SCENES / name))
        out.open(str(SCENES / name), spec)
        out.write_image(np.ascontiguousarray(codes))
        out.close()


def ellipse(c: Canvas, x: float, y: float, a: float, b: float) -> Floats:
    """Squared distance from a center in half axes: 1 on the ellipse."""
    return ((c.x - x) / a) ** 2 + ((c.y - y) / b) ** 2


def round_light(c: Canvas, x: float, radius: float) -> Floats:
    """Light on an upright cylinder from the left."""
    u = np.clip((c.x - x) / radius, -1, 1)
    return 0.35 + 0.75 * np.maximum(0, np.cos(np.arcsin(u) + 0.7))


def mug() -> None:
    """Draw a red mug with white bands."""
    c = Canvas(260, 240)
    ring = ellipse(c, 192, 118, 52, 62)
    c.paint((ring < 1) & (ring > 0.42), (0.45, 0.05, 0.04), 0.8)
    light = round_light(c, 110, 88)
    body = (abs(c.x - 110) < 88) & (c.y > 30) & (ellipse(c, 110, 205, 88, 22) < 1) | (
        (abs(c.x - 110) < 88) & (c.y > 30) & (c.y < 205)
    )
    c.paint(body, (0.55, 0.06, 0.05), light)
    for top in (70, 100, 130):
        bent = c.y - 22 * np.sqrt(np.maximum(0, 1 - ((c.x - 110) / 88) ** 2))
        c.paint(body & (bent > top) & (bent < top + 12), (0.85, 0.85, 0.8), light)
    c.paint(ellipse(c, 110, 30, 88, 20) < 1, (0.5, 0.08, 0.06), 0.9)
    c.paint(ellipse(c, 110, 31, 80, 16) < 1, (0.09, 0.05, 0.03))
    c.write("table-top-mug.png", True)


def fruit() -> None:
    """Draw an orange, a lemon and a pear in a row."""
    c = Canvas(420, 200)

    def ball(x: float, y: float, a: float, b: float, color: tuple[float, float, float]) -> None:
        inside = ellipse(c, x, y, a, b)
        height = np.sqrt(np.maximum(0, 1 - inside))
        light = 0.25 + 0.8 * np.maximum(
            0, -0.45 * (c.x - x) / a - 0.5 * (c.y - y) / b + 0.74 * height
        )
        c.paint(inside < 1, color, light)
        spot = ellipse(c, x - 0.35 * a, y - 0.4 * b, 0.09 * a, 0.07 * b)
        c.paint(spot < 1, (0.9, 0.9, 0.85))

    ball(80, 120, 72, 70, (0.85, 0.33, 0.03))
    ball(215, 140, 66, 50, (0.85, 0.75, 0.08))
    ball(345, 135, 58, 56, (0.45, 0.6, 0.12))
    ball(345, 75, 34, 46, (0.45, 0.6, 0.12))
    stalk = (abs(c.x - 347 - 0.15 * (30 - c.y)) < 3) & (c.y > 8) & (c.y < 36)
    c.paint(stalk, (0.2, 0.1, 0.04))
    c.write("table-top-fruit.png", True)


def shelf() -> None:
    """Draw a wall with a lamp, books on a shelf, and the table below."""
    c, random = Canvas(640, 480), np.random.default_rng(7)
    glow = 0.35 + 0.65 / (1 + ellipse(c, 520, 60, 190, 170))
    c.paint(c.x > 0, (0.5, 0.46, 0.4), glow)
    for place in (150, 290):
        c.paint((c.y > place) & (c.y < place + 14) & (c.x < 430), (0.3, 0.18, 0.09), 0.9)
        left = 8.0
        while left < 400:
            width, height = random.uniform(14, 34), random.uniform(80, 122)
            color = tuple(random.uniform(0.05, 0.75, 3))
            book = (c.x > left) & (c.x < left + width) & (c.y > place - height) & (c.y < place)
            c.paint(book, color, 0.55 + 0.45 * glow)
            title = book & (abs(c.y - place + 0.7 * height) < 8)
            c.paint(title, (0.85, 0.8, 0.6), 0.8)
            left += width + random.uniform(0, 5)
    c.paint(ellipse(c, 530, 75, 46, 46) < 1, (1.0, 0.95, 0.8))
    c.paint((abs(c.x - 530) < 4) & (c.y > 120) & (c.y < 330), (0.12, 0.12, 0.13))
    grain = 0.8 + 0.2 * np.sin(0.35 * c.y + 3 * np.sin(0.012 * c.x))
    c.paint(c.y > 330, (0.42, 0.25, 0.12), grain)
    c.write("table-top-shelf.png", False)


if __name__ == "__main__":
    mug()
    fruit()
    shelf()
