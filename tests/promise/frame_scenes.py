"""Pictures and charts of random frames: what stands before the camera.

Pictures are samples (h, w) in 0..1, charts the scene's `source` of a camera file.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from frame import Draw

# --- pictures ------------------------------------------------------------------------------------


def lone(draw: Draw, h: int, w: int) -> np.ndarray:
    """Single samples, columns, rows or short lines of 1 on even, mostly dark ground."""
    out = np.full((h, w), draw.pick((0.0, 0.0, 0.0, 0.01, 0.02, 0.1, 0.4)))
    for _ in range(draw.pick((1, 1, 1, 2, 3))):
        row = draw.pick((0, h - 1, draw.whole(0, h - 1), draw.whole(0, h - 1)))
        column = draw.pick((0, w - 1, draw.whole(0, w - 1), draw.whole(0, w - 1)))
        value = draw.pick((1.0, 1.0, 1.0, draw.even(0.05, 1)))
        shape = draw.pick(("sample", "sample", "column", "row", "short"))
        if shape == "sample":
            out[row, column] = value
        elif shape == "column":
            out[:, column] = value
        elif shape == "row":
            out[row] = value
        else:
            out[row, column : column + draw.whole(2, 5)] = value
    return out


def noise(draw: Draw, h: int, w: int) -> np.ndarray:
    """Every sample by itself, evenly distributed or black and white."""
    out = draw.rng.random((h, w))
    return out if draw.chance(0.5) else (out < draw.even(0.02, 0.98)).astype(float)


def smooth(draw: Draw, h: int, w: int) -> np.ndarray:
    """A gradient, or the sum of few cosines of low frequency."""
    y, x = (np.arange(n)[:, None] + 0.5 for n in (h, w))
    y, x = y / h, x.T / w
    if draw.chance(0.4):
        out = 0.5 + draw.even(-0.5, 0.5) * (x - 0.5) + draw.even(-0.5, 0.5) * (y - 0.5)
        return np.broadcast_to(out, (h, w)).copy()
    out = np.full((h, w), 0.5)
    for _ in range(draw.whole(1, 4)):
        along, down = draw.whole(0, 6), draw.whole(0, 6)
        out += draw.even(0.005, 0.12) * np.cos(math.pi * along * x) * np.cos(math.pi * down * y)
    return out


def photograph(draw: Draw, h: int, w: int) -> np.ndarray:
    """The spectrum of natural pictures, 1 / f; or disks before each other; or both."""
    f = np.hypot(np.fft.fftfreq(h)[:, None], np.fft.rfftfreq(w))
    f[0, 0] = 1
    spectrum = np.fft.rfft2(draw.rng.standard_normal((h, w))) / f ** draw.even(0.8, 1.6)
    spectrum[0, 0] = 0
    field = np.fft.irfft2(spectrum, s=(h, w))
    out = 0.4 + 0.2 * field / max(field.std(), 1e-12)
    if draw.chance(0.5):
        y, x = np.indices((h, w))
        for _ in range(draw.whole(3, 40)):
            r = draw.log(0.5, 0.4 * max(h, w) + 1)
            cx, cy = draw.even(0, w), draw.even(0, h)
            out = np.where((x - cx) ** 2 + (y - cy) ** 2 < r * r, draw.even(0, 1), out)
    return np.clip(out, 0, 1)


def checks(draw: Draw, h: int, w: int) -> np.ndarray:
    """Checks, bars or a lattice of samples whose period is a few samples."""
    y, x = np.indices((h, w))
    down, along = (draw.pick((1, 1, 1, 2, 2, 3, 4, 5)) for _ in range(2))
    kind = draw.pick(("checks", "checks", "bars", "lattice"))
    if kind == "checks":
        on = (y // down + x // along) % 2
    elif kind == "bars":
        on = (x // along) % 2 if draw.chance(0.5) else (y // down) % 2
    else:
        on = (y % (down + 1) == 0) & (x % (along + 1) == 0)
    dark, bright = draw.pick(((0, 1), (0.2, 0.8), (0.45, 0.55), (0, 0.1)))
    return np.where(on, bright, dark).astype(float)


TEXTURES = (noise, smooth, photograph, checks)

# --- charts --------------------------------------------------------------------------------------

Source = dict[str, Any]


def edge(draw: Draw, size: tuple[float, float]) -> Source:
    """At 0, 45, 90 degrees, little or anyhow."""
    angle = draw.pick((0.0, 45.0, 90.0, 5.0, draw.even(-10, 10), draw.even(-180, 180)))
    contrast = draw.pick((0.6, 1.0, draw.even(0.02, 1)))
    return {"chart": "slanted-edge", "angle": f"{angle:g} deg", "contrast": contrast}


def wedge(draw: Draw, size: tuple[float, float]) -> Source:
    steps = draw.pick((2, 5, 20, 101, draw.whole(2, 60)))
    return {"chart": "step-wedge", "steps": steps, "density_range": draw.log(0.1, 4)}


def sinusoid(draw: Draw, size: tuple[float, float]) -> Source:
    return {
        "chart": "sinusoid",
        "frequency": f"{draw.log(5, 900):g} lp/mm",
        "contrast": draw.even(0, 1),
        "orientation": f"{draw.pick((0, 90, 45, draw.even(-90, 90)))} deg",
        "phase": f"{draw.even(0, 360)} deg",
    }


def points(draw: Draw, size: tuple[float, float]) -> Source:
    """Closer than the pixels and few on the array, smaller and larger than a pixel."""
    spacing = draw.pick((draw.log(2, 20), draw.log(10, 100)))
    diameter = spacing * draw.log(0.02, 0.98)
    return {"chart": "point-grid", "spacing": f"{spacing:g} um", "diameter": f"{diameter:.5g} um"}


def checker(draw: Draw, size: tuple[float, float]) -> Source:
    return {"chart": "colorchecker"}


def csf(draw: Draw, size: tuple[float, float]) -> Source:
    return {
        "chart": "csf",
        "max_frequency": f"{draw.log(20, 900):g} lp/mm",
        "phase": f"{draw.pick((0, 90, draw.even(0, 360)))} deg",
        "max_contrast": draw.even(0.2, 1),
    }


def star(draw: Draw, size: tuple[float, float]) -> Source:
    spokes = draw.pick((3, 8, 36, 72, 200))
    return {"chart": "siemens-star", "spokes": spokes, "contrast": draw.even(0.3, 1)}


def letters(draw: Draw, size: tuple[float, float]) -> Source:
    return {"chart": "eye-chart", "rows": draw.whole(1, 20)}


def leaves(draw: Draw, size: tuple[float, float]) -> Source:
    """One of two seeds: what is seen of the leaves takes seconds to find, once a seed."""
    return {"chart": "dead-leaves", "seed": draw.pick((4, 5))}


def patches(draw: Draw, size: tuple[float, float]) -> Source:
    return {
        "chart": "hdr-patches",
        "patches": draw.pick((2, 10, 24, 100)),
        "dynamic_range": draw.log(10, 1e5),
        "lamp": draw.log(0.5, 300),
    }


ENDLESS = (edge, wedge, sinusoid, points)
"""Charts whose truth does not become dearer with the array."""
CHARTS = (checker, csf, star, letters, patches, leaves)
