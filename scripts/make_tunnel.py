"""Write configs/scenes/tunnel.exr: a road out of a tunnel, in cd/m2, seven decades of light.

Run `.venv/bin/python scripts/make_tunnel.py`. It is drawn by the formulas below, 320 x 480, each
pixel the mean of 4 x 4 samples; it is no photograph. The luminances are round numbers of their
kind: a sunny landscape 3 000 to 8 000 cd/m2, a tunnel's wall 0.2 to 20, a dark car before the exit
0.1, tail lights 2 000, lamps 20 000, headlamps seen in their beam 250 000.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files.images.exr import write_exr

SCENES = Path(__file__).resolve().parent.parent / "configs" / "scenes"
ROWS, COLUMNS, FINE = 320, 480, 4
Floats = NDArray[np.float64]
HORIZON = (0.78, 0.46)
"""Where the road ends, to the right and down, in heights of the picture."""
SKY, FIELD, WALL = (0.8, 0.95, 1.25), (0.8, 1.1, 0.4), (1.05, 1.0, 0.85)
LAMP, RED, WHITE = (1.3, 0.98, 0.5), (4.0, 0.15, 0.1), (1.0, 1.0, 1.0)


def color(rgb: tuple[float, float, float]) -> Floats:
    """Return linear RGB of Rec. 709 whose luminance is 1."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    return np.array(rgb) / (weights @ np.array(rgb))


def put(picture: Floats, where: NDArray[np.bool_], luminance: Floats | float, rgb: tuple) -> None:
    """Give places a luminance [cd/m2] and a color."""
    light = np.broadcast_to(luminance, where.shape)[where]
    picture[where] = light[:, None] * color(rgb)


def tunnel() -> Floats:
    """Return linear RGB (rows, columns, 3) whose luminance is in cd/m2."""
    x = (np.arange(COLUMNS * FINE) + 0.5)[None, :] / (ROWS * FINE)
    y = (np.arange(ROWS * FINE) + 0.5)[:, None] / (ROWS * FINE)
    dx, dy = x - HORIZON[0], y - HORIZON[1]
    arch = np.hypot(dx / 0.16, np.minimum(dy, 0) / 0.17)
    outside = (arch < 1) & (dy < 0.055)
    near = np.maximum(arch, np.abs(dy) / 0.17)  # 1 at the exit, rising toward the camera
    joints = 1 + 0.12 * np.sign(np.sin(40 / np.maximum(near, 0.2)))
    rough = 1 + 0.08 * np.sin(91 * x + 37 * y) * np.sin(67 * y - 53 * x)
    picture = np.zeros((ROWS * FINE, COLUMNS * FINE, 3))
    everywhere = np.ones(outside.shape, bool)
    put(picture, everywhere, (20 / near**2.5 + 0.2) * joints * rough, WALL)
    road = (dy > 0.03) & (np.abs(dx) < 0.9 * dy + 0.12)
    put(picture, road, (8 / (1 + 12 * np.maximum(dy, 0)) ** 2 + 0.15) * rough, WHITE)
    lane = np.abs(dx + 0.25 * dy + 0.02) < 0.012 * (1 + 8 * np.maximum(dy, 0))
    dashes = np.sin(3 / np.maximum(dy, 1e-3)) > 0
    put(picture, road & lane & dashes, 25 / (1 + 12 * np.maximum(dy, 0)) ** 2 + 0.6, WHITE)
    put(picture, outside, 8000 - 3000 * np.clip(-dy / 0.17, 0, 1), SKY)
    hills = dy > -0.03 + 0.012 * np.sin(40 * x)
    put(picture, outside & hills, 3000 * rough, FIELD)
    put(picture, outside & (dy > 0.02), 5000, WHITE)
    for number in range(6):  # lamps below the roof, ever nearer
        depth = 1.35 * 1.45**number
        for side in (-1, 1):
            u, v = dx - side * 0.08 * depth, dy + 0.17 * depth
            put(picture, np.hypot(u / 2.2, v) < 0.006 * depth, 20_000, LAMP)
    _car(picture, dx, dy)
    _person(picture, x, y)
    for side in (-1, 1):  # a car that comes toward us
        put(picture, np.hypot(dx - 0.085 + side * 0.012, dy - 0.045) < 0.006, 250_000, WHITE)
    return picture.reshape(ROWS, FINE, COLUMNS, FINE, 3).mean(axis=(1, 3))


def _car(picture: Floats, dx: Floats, dy: Floats) -> None:
    """Draw a dark car before the exit: body, window, tail lights, a plate of bars."""
    u, v = (dx + 0.1) / 0.13, (dy - 0.13) / 0.1
    body = (np.abs(u) < 1) & (np.abs(v) < 0.75) | (np.abs(u) < 0.75) & (v > -1.5) & (v < 0)
    put(picture, body, 0.1 + 0 * u * v, WHITE)
    put(picture, (np.abs(u) < 0.62) & (v > -1.35) & (v < -0.6), 1.5 + 0 * u * v, SKY)
    put(picture, (np.abs(np.abs(u) - 0.82) < 0.12) & (np.abs(v + 0.2) < 0.1), 2000, RED)
    plate = (np.abs(u) < 0.3) & (np.abs(v - 0.3) < 0.16)
    put(picture, plate, 0.6 + 0 * u * v, WHITE)
    put(picture, plate & (np.abs(v - 0.3) < 0.11) & (np.sin(75 * u) > 0.2), 0.06, WHITE)


def _person(picture: Floats, x: Floats, y: Floats) -> None:
    """Draw a person by the wall, in the dark."""
    head = np.hypot(x - 0.2, y - 0.56) < 0.02
    trunk = (np.abs(x - 0.2) < 0.03) & (y > 0.585) & (y < 0.7)
    legs = (np.abs(np.abs(x - 0.2) - 0.014) < 0.011) & (y >= 0.7) & (y < 0.82)
    put(picture, head | trunk | legs, 0.05, WHITE)
    put(picture, trunk & (np.abs(y - 0.64) < 0.006), 0.8, (1.0, 1.2, 0.3))


def main() -> None:
    """Write the scene."""
    mantissa, exponent = np.frexp(tunnel())
    # Steps of 0.4 to 0.8 %: what compresses, and no step is seen.
    planes = np.ldexp(np.rint(mantissa * 128) / 128, exponent).astype(np.float32)
    channels = {name: planes[..., i] for i, name in enumerate("RGB")}
    write_exr(SCENES / "tunnel.exr", channels, {"comments": "drawn by scripts/make_tunnel.py"})


if __name__ == "__main__":
    main()
