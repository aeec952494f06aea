"""Render three layers before a thin lens in Mitsuba 3, for a test of depth.

Run `pip install mitsuba`, then `.venv/bin/python scripts/render_layers_in_mitsuba.py`. It writes
tests/data/layers_mitsuba.npz for tests/scenes/test_layers_against_mitsuba.py: the picture of each
focus as a mean over independent renderings, its standard error, and the layers, lens and pixels
they are of. The layers are drawn by the formulas below. Mitsuba 3 is the renderer of W. Jakob and
others, https://mitsuba-renderer.org.

In Mitsuba a layer is a rectangle that emits its light times its opacity and lets the rest of the
light behind it pass (an area emitter, a `mask` around a black surface). Its lens (`thinlens`) is a
disc at the origin, and its field of view is the array's as seen from the middle of that disc: the
width of the array over the image distance of the focus. It weights all points of the lens alike,
and the box filter counts a ray in the one pixel that it falls on, so that each pixel is the
mean of the light over its area and over the lens.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

OUT = Path(__file__).resolve().parent.parent / "tests" / "data" / "layers_mitsuba.npz"
FOCAL_LENGTH, F_NUMBER, PITCH, SIDE = 5e-3, 2.0, 5e-6, 64
"""Of the lens, and of the pixels of the square array [m, 1, m, 1]."""
RENDERINGS, SAMPLES = 32, 1024
"""Independent renderings of one picture, and rays per pixel in each."""
CELLS = 48
"""Squares along a side of a layer's picture."""
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Layer:
    """A square that stands upright before the lens; positions are right of and below the axis."""

    distance: float
    """From the lens [m]."""
    width: float
    """Of the square [m]."""
    position: tuple[float, float]
    """Of its center [m]."""
    light: Floats
    """Of its squares (n, n), 1 is white."""
    opacity: Floats
    """Of its squares (n, n), from 0 to 1."""


def layers() -> tuple[Layer, ...]:
    """Return the layers, the nearest first: spokes and a disc, a half clear grid, steps of gray."""
    y, x = (np.mgrid[:CELLS, :CELLS] + 0.5) / CELLS - 0.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    spokes = (radius < 0.45) & (np.cos(5 * angle + 0.4) > 0) | (np.hypot(x + 0.3, y - 0.4) < 0.12)
    grid = 1.0 * ((x * 9 + 2 * y) % 1 < 0.5)
    grid[(y > 0.1) & (grid == 0)] = 0.4
    checks = 0.1 + 0.8 * ((np.floor(12 * x) + np.floor(12 * y)) % 2)
    drawn = (
        (0.25, 0.0135, (-2.5e-3, 1.5e-3), 0.55 + 0.4 * np.sin(7 * x + 3 * y), spokes),
        (0.5, 0.0240, (5.0e-3, -3.0e-3), 0.3 + 0.6 * (x > y), grid),
        (1.5, 0.1500, (0.0, 0.0), checks * (0.6 + 0.8 * x), np.ones_like(x)),
    )
    return tuple(
        Layer(distance, width, place, light.astype(np.float32), opacity.astype(np.float32))
        for distance, width, place, light, opacity in drawn
    )


def image_distance(focus: float) -> float:
    """Return how far behind the lens what lies at a distance is in focus [m]."""
    return 1 / (1 / FOCAL_LENGTH - 1 / focus)


def rectangle(mi: Any, layer: Layer) -> dict[str, Any]:
    """Return a layer as Mitsuba has it; the camera looks along +z, +y is up and +x to the left."""

    def squares(values: Floats) -> dict[str, Any]:
        # The first row of a bitmap lies at v = 0, which is below.
        bitmap = mi.Bitmap(np.ascontiguousarray(values[::-1, :, None]))
        return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest"}

    right, down = layer.position
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    place = mi.ScalarTransform4f
    return {
        "type": "rectangle",
        "to_world": place.translate([-right, -down, layer.distance])
        @ place.rotate([0, 1, 0], 180)
        @ place.scale([layer.width / 2, layer.width / 2, 1]),
        "bsdf": {"type": "mask", "opacity": squares(layer.opacity), "nested": black},
        "emitter": {"type": "area", "radiance": squares(layer.light * layer.opacity)},
    }


def scene(mi: Any, focus: float) -> Any:
    """Return the layers before a lens that is focused at a distance [m]."""
    half_field = math.atan(SIDE * PITCH / 2 / image_distance(focus))
    camera = {
        "type": "thinlens",
        "fov": 2 * math.degrees(half_field),
        "aperture_radius": FOCAL_LENGTH / F_NUMBER / 2,
        "focus_distance": focus,
        "near_clip": 1e-2,
        "far_clip": 10.0,
        "film": {
            "type": "hdrfilm",
            "width": SIDE,
            "height": SIDE,
            "pixel_format": "luminance",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": SAMPLES},
    }
    shown = {f"layer{number}": rectangle(mi, layer) for number, layer in enumerate(layers())}
    integrator = {"type": "path", "max_depth": 8, "rr_depth": 8}
    return mi.load_dict({"type": "scene", "integrator": integrator, "camera": camera, **shown})


def render(focus: float, seeds: Sequence[int]) -> tuple[Floats, Floats]:
    """Return the picture of a focus, the mean of renderings, and its standard error (n, n)."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    made = scene(mi, focus)
    found = [np.array(mi.render(made, seed=seed))[..., 0] for seed in seeds]
    error = np.std(found, axis=0, ddof=1) / math.sqrt(len(seeds))
    return np.mean(found, axis=0), error.astype(np.float32)


def main() -> None:
    """Render every focus and write the file."""
    shown = layers()
    pictures = [render(layer.distance, range(RENDERINGS)) for layer in shown]
    np.savez_compressed(
        OUT,
        focus=[layer.distance for layer in shown],
        mean=[mean for mean, _ in pictures],
        standard_error=[error for _, error in pictures],
        renderings=RENDERINGS,
        focal_length=FOCAL_LENGTH,
        f_number=F_NUMBER,
        pitch=PITCH,
        distance=[layer.distance for layer in shown],
        width=[layer.width for layer in shown],
        position=[layer.position for layer in shown],
        light=[layer.light for layer in shown],
        opacity=[layer.opacity for layer in shown],
    )


if __name__ == "__main__":
    main()
