"""Cameras of random frames: pixels, lenses, arrays, exposures, as changes of the plain camera.

Every function returns keys of a camera file by their paths. Sizes are such that a truth takes
less than a second: `terms` are the harmonics of a mirrored picture below the lens's cut-off.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from frame import Draw
from making import GONE
from periodic_cameras import radiance_for

Changes = dict[str, Any]
WELL = 100e3
"""Full well of the plain camera [electrons]."""
SIZES = (
    (1, 1), (1, 2), (2, 2), (2, 3), (3, 5), (5, 7), (8, 8), (11, 13), (15, 15), (16, 16),
    (13, 24), (24, 16), (24, 32), (33, 31),
)  # fmt: skip
"""Rows and columns."""
THIN = (
    (1, 40), (40, 1), (60, 3), (3, 60), (1, 200), (200, 1), (8, 300), (570, 1), (1, 560),
)  # fmt: skip
BAYER = ("bayer-rggb", "bayer-grbg", "bayer-gbrg", "bayer-bggr")
LAMPS = ("D65", "A", "FL2", "FL11")
SHORTEST = 450e-9
"""Of the light that colored pictures have, 550 nm of most others [m]."""


def plain(
    draw: Draw, size: tuple[int, int], terms: float = 4e5, white: float | None = None
) -> Changes:
    """Pixels of any size, photodetectors anywhere in them, a lens of any f-number, some noise.

    white: electrons of the perfect white; default a tenth to nine tenths of the full well.
    """
    width = draw.log(1.5, 9) * 1e-6
    fill = draw.pick((1.0, draw.even(0.1, 1), draw.even(0.1, 1)))
    gaps = [draw.log(0.1, 1) * 1e-6 if draw.chance(0.15) else 0.0 for _ in "xy"]
    area = math.prod(n * (width + gap) for n, gap in zip(size, reversed(gaps), strict=True))
    slowest = float(f"{math.sqrt(8 * area / terms) / SHORTEST:.4g}")
    f_number = max(draw.log(1.2, 11), slowest)
    white = WELL * draw.log(0.1, 0.9) if white is None else white
    return {
        "scene.radiance": radiance_for(white, width, f_number, fill),
        "optics.f_number": f_number,
        "pixel.width": f"{width * 1e6:.6g} um",
        **{f"pixel.gap_{a}": f"{g * 1e6:.6g} um" for a, g in zip("xy", gaps, strict=True) if g},
        **photodetector(draw, width, fill),
        **noises(draw),
        "array.rows": size[0],
        "array.columns": size[1],
    }


def photodetector(draw: Draw, width: float, fill: float) -> Changes:
    """Square and centered, or now and then an upright rectangle anywhere in the pixel [m]."""
    if fill == 1.0 or draw.chance(0.7):
        return {"pixel.photodetector.fill_factor": fill}
    wide = fill ** draw.even(0.35, 0.65)
    sides = width * wide, width * fill / wide
    # As many digits as are written of it may be more than there is room for.
    corner = (draw.even(0, 1 - 1e-4) * (width - side) for side in sides)
    named = zip(("width", "height", "x", "y"), (*sides, *corner), strict=True)
    own = {f"pixel.photodetector.{name}": f"{value * 1e6:.6g} um" for name, value in named}
    return {"pixel.photodetector.fill_factor": GONE, **own}


def noises(draw: Draw) -> Changes:
    """Dark current, and noise both temporal and fixed, each in every second camera."""
    possible = {
        "pixel.photodetector.dark_current": f"{draw.log(1, 1e5):g} e/s",
        "pixel.readout.read_noise": f"{draw.log(0.3, 100):g} e",
        "pixel.readout.reset_noise": f"{draw.log(0.3, 100):g} e",
        "pixel.readout.heavy_tailed_noise": {"rms": f"{draw.log(0.3, 30):g} e", "shape": -0.1},
        "pixel.fpn": {
            "offset_pixel": f"{draw.log(0.3, 100):g} e",
            "gain_pixel": f"{draw.log(0.03, 3):g} %",
        },
    }
    return {key: value for key, value in possible.items() if draw.chance(0.5)}


# --- light and colors ----------------------------------------------------------------------------


def one_light(draw: Draw) -> Changes:
    """A line of the spectrum, on a monochrome array or on a mosaic."""
    lamp = {"monochromatic": f"{draw.pick((550, 550, draw.whole(450, 680)))} nm"}
    pattern = draw.pick(("monochrome",) * 5 + BAYER + ("quad-bayer",))
    return {"scene.illuminant": lamp, "array.pattern": pattern}


def lamp_light(draw: Draw) -> Changes:
    """A lamp with a continuous spectrum before a mosaic or a monochrome array."""
    pattern = draw.pick(("monochrome", *BAYER, "quad-bayer"))
    return {"scene.illuminant": draw.pick(LAMPS), "array.pattern": pattern}


def three_lights() -> Changes:
    """The lines of a picture in laser light."""
    return {"scene.illuminant": GONE}


# --- lenses --------------------------------------------------------------------------------------


def aberrated(draw: Draw, f_number: float) -> Changes:
    """Defocus by up to a wave, coma, astigmatism, spherical aberration, or some of each."""
    kind = draw.pick(("defocus", "coma", "astigmatism", "spherical", "all"))
    if kind == "defocus":
        return {"optics.defocus": f"{_signed(draw, 0.3, 4) * f_number**2:.4g} um"}
    terms = {"coma": (7, 8), "astigmatism": (5, 6), "spherical": (4, 11)}.get(kind, range(4, 12))
    return {"optics.zernike": {n: f"{_signed(draw, 2, 90):g} nm" for n in terms}}


def field_dependent(draw: Draw) -> Changes:
    """Coma and curvature of the field that grow from the center to the corner."""
    near, far = ({n: f"{_signed(draw, 5, 80):g} nm" for n in (4, 8)} for _ in range(2))
    middle = [{"field": draw.even(0.3, 0.7), **far}] if draw.chance(0.5) else []
    last = {n: f"{2 * float(v.split()[0]):g} nm" for n, v in far.items()}
    return {"optics.zernike": [{"field": 0, **near}, *middle, {"field": 1, **last}]}


def _signed(draw: Draw, low: float, high: float) -> float:
    return draw.log(low, high) * draw.pick((-1, 1))


def diffusion(draw: Draw) -> Changes:
    """Charge that walks in the silicon."""
    return {
        "pixel.photodetector.charge_diffusion": {
            "diffusion_length": draw.um(5, 50),
            "depletion_width": draw.um(0.3, 3),
            "substrate_depth": draw.um(3, 10),
        }
    }


def slow_optics(draw: Draw) -> Changes:
    """Stray light, and a falloff over the array."""
    return {
        "optics.stray_light": draw.log(0.001, 0.2),
        "optics.off_axis": draw.pick(("none", "exact", "cos4")),
    }


def spread_samples(draw: Draw) -> np.ndarray:
    """A measured point spread: a head and a tail, (h, w)."""
    h, w = draw.whole(3, 17), draw.whole(3, 17)
    y, x = np.indices((h, w)) - np.array([(h - 1) / 2, (w - 1) / 2])[:, None, None]
    width, tail = draw.log(0.5, 3), draw.even(0, 2)
    head = np.exp(-(x**2 + y**2) / (2 * width**2))
    return head + 0.2 * np.exp(-((x - tail) ** 2 + (y + tail) ** 2) / (8 * width**2))


# --- arrays and exposures ------------------------------------------------------------------------


def array(draw: Draw) -> Changes:
    """Mosaics, stacked and turned ones, pixels that are read as one; rows and columns."""
    kind = draw.pick(("bayer", "quad", "stacked", "honeycomb", "binned"))
    rows, columns = draw.pick(SIZES[5:])
    found: Changes = {"array.pattern": draw.pick(BAYER)}
    if kind == "binned":
        rows, columns = 8 * draw.whole(1, 3), 12 * draw.whole(1, 2)
        found["array.pattern"] = draw.pick(("monochrome", "quad-bayer", *BAYER))
        binning = {"rows": 2, "columns": draw.pick((2, 3))}
        found["array.binning"] = binning | {"kind": draw.pick(("charge", "voltage", "digital"))}
    elif kind != "bayer":
        found["array.pattern"] = "quad-bayer" if kind == "quad" else kind
    if kind == "honeycomb":
        found["output.render"] = "none"
    return {**found, "array.rows": rows, "array.columns": columns}


def rolling(draw: Draw, width: float) -> tuple[Changes, dict]:
    """A shutter that rolls, or not, and how a scene at 1 m moves: some pixels an exposure."""
    scale = 5e-3 / (1 - 5e-3)
    speed = {
        axis: f"{_signed(draw, 0.05, 12) * width / scale / 0.01:.4g} m/s"
        for axis in draw.pick(("x", "y", "xy"))
    }
    if draw.chance(0.4):
        return {}, speed
    line, direction = f"{draw.log(5, 500):g} us", draw.pick(("down", "up"))
    return {"exposure.shutter": {"rolling": {"line_time": line, "direction": direction}}}, speed


def exposed(draw: Draw) -> Changes:
    """Automatic by the white or the pixels' percentile; or so much light that pixels are full."""
    method = draw.pick(("white", "percentile", "mean"))
    target = draw.even(0.3, 0.95) if method != "mean" else draw.even(0.05, 0.4)
    auto = {"max": "1 s", "method": method, "target": target}
    return {"exposure": {"auto": auto}}
