"""Layers and maps of depth of random frames: what hides what, how far it is, how it moves."""

from __future__ import annotations

from typing import Any

import frame_cameras as cameras
import frame_scenes as scenes
import numpy as np
from frame import Draw, Frame, picture_source

FOCAL = 5e-3
"""Focal length of the plain camera [m]."""
BLUR = 4.0
"""Largest radius of a point's image [pixels]."""


def optics(draw: Draw, size: tuple[int, int], diffraction: bool) -> tuple[dict, float, float]:
    """A camera, its focus [m], and what 1 / distance [1/m] makes of a blur's radius [pixels]."""
    made = cameras.plain(draw, size)
    pitch = float(made["pixel.width"].split()[0]) * 1e-6
    f_number = max(draw.log(1.4, 4), pitch / (2.5 * 550e-9) if diffraction else 0)
    focus = draw.log(0.5, 1.2)
    for gap in ("pixel.gap_x", "pixel.gap_y"):
        made.pop(gap, None)
    made |= {
        "optics.f_number": round(f_number, 4),
        "optics.focus_distance": f"{focus} m",
        "optics.diffraction": diffraction,
    }
    return made, focus, FOCAL**2 / (2 * round(f_number, 4)) * focus / (focus - FOCAL) / pitch


def distance(draw: Draw, focus: float, per_inverse: float) -> float:
    """In focus, or out of it by some pixels."""
    radius = draw.pick((0.0, draw.even(-BLUR, BLUR), draw.even(-BLUR, BLUR)))
    return float(f"{1 / max(1 / focus + radius / per_inverse, 0.05):.6g}")


def mask(draw: Draw) -> np.ndarray:
    """A rectangle, a half-transparent one, a ramp, discs and bars: opacity (n, n)."""
    n = draw.pick((4, 9, 16))
    kind = draw.pick(("all", "half", "ramp", "shapes", "bars"))
    y, x = (np.indices((n, n)) + 0.5) / n
    if kind == "all":
        return np.ones((n, n))
    if kind == "half":
        return np.full((n, n), draw.even(0.2, 0.8))
    if kind == "ramp":
        return x if draw.chance(0.5) else y
    if kind == "bars":
        return (np.indices((n, n))[1] // draw.whole(1, 3) % 2).astype(float)
    out = np.zeros((n, n))
    for _ in range(4):
        cx, cy, r = draw.even(0, 1), draw.even(0, 1), draw.even(0.05, 0.4)
        out[(x - cx) ** 2 + (y - cy) ** 2 < r * r] = draw.pick((1.0, 1.0, draw.even(0, 1)))
    return out


def layers(draw: Draw) -> Frame:
    """Two to four, in focus and not; now and then one moves."""
    diffraction = draw.chance(0.15)
    size = draw.pick(((4, 5), (6, 6)) if diffraction else ((5, 7), (8, 8), (12, 16)))
    made, focus, per_inverse = optics(draw, size, diffraction)
    count, files = draw.pick((2, 2, 3, 4)), {}
    far = sorted(distance(draw, focus, per_inverse) for _ in range(count))
    moving = draw.whole(0, count - 1) if size[1] <= 8 and draw.chance(0.3) else None
    listed: list[dict[str, Any]] = []
    pitch = float(made["pixel.width"].split()[0]) * 1e-6
    for number, away in enumerate(far):
        scale = FOCAL * focus / (focus - FOCAL) / away
        last = number == count - 1
        ratio = draw.pick((1, 2)) if last else 1
        h, w = (size[0] * ratio, size[1] * ratio) if last else (draw.whole(2, 12),) * 2
        maker = draw.pick((*scenes.TEXTURES, scenes.checks, scenes.lone))
        picture, own = picture_source(maker(draw, h, w))
        picture["file"] = f"light{number}.exr"
        files[picture["file"]] = own["picture.exr"]
        layer: dict[str, Any] = {"source": picture, "distance": f"{away!r} m"}
        if not last:
            files[f"mask{number}.exr"] = mask(draw)[:, :, None].astype(np.float32)
            wide = draw.even(0.3, 1.2) * size[1] * pitch / scale
            place = [f"{draw.even(-0.4, 0.4) * n * pitch / scale:.6g} m" for n in size[::-1]]
            layer |= {"mask": f"mask{number}.exr", "width": f"{wide:.6g} m", "position": place}
        if number == moving:
            layer["motion"] = {
                axis: f"{draw.even(-6, 6) * pitch / scale / 0.01:.5g} m/s" for axis in "xy"
            }
        listed.append(layer)
    return Frame({**made, "scene.source": {"kind": "layers", "layers": listed}}, files)


def depth(draw: Draw) -> Frame:
    """A picture that recedes evenly along one axis, from 0.8 m to 1.3 m or less."""
    size = draw.pick(((8, 8), (12, 16), (24, 24), (32, 32)))
    made, _, _ = optics(draw, size, diffraction=False)
    ratio = draw.pick((2, 4, 8))
    h, w = (n * ratio for n in size)
    source, files = picture_source(
        draw.pick((*scenes.TEXTURES, scenes.photograph))(draw, h, w), depth="depth.exr"
    )
    ends = draw.even(0.75, 0.8), draw.even(0.85, 1.3)
    ends = ends if draw.chance(0.5) else ends[::-1]
    along = (np.arange(h)[:, None] if draw.chance(0.5) else np.arange(w)[None, :]) + 0.5
    inverse = 1 / ends[0] + (1 / ends[1] - 1 / ends[0]) * along / along.size
    files["depth.exr"] = np.broadcast_to(1 / inverse, (h, w))[:, :, None].astype(np.float32)
    return Frame({**made, "scene.source": source}, files)
