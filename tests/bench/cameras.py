"""The cameras that are timed, and the picture that they look at: dead leaves on their own grid."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from vcam_cli import load
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.prescription import distortion
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.config import shipped
from vcam_cli.files.images.png import write_png
from vcam_cli.scenes.base import View
from vcam_cli.scenes.build import build

BAND = {"start": "400 nm", "stop": "700 nm"}
"""31 wavelengths in steps of 10 nm, 301 in steps of 1 nm."""
SOURCES: dict[str, dict[str, str]] = {
    "gray": {"kind": "image", "file": "gray.png", "model": "reflectance"},
    "color": {"kind": "image", "file": "leaves.png", "model": "mallett"},
    "laser": {"kind": "image", "file": "leaves.png", "model": "laser"},
    "chart": {"kind": "chart", "chart": "colorchecker"},
}
PLAIN: dict[str, Any] = {
    "name": "bench",
    "optics": {"use": "f2.8-normal", "focal_length": "8 mm"},
    "pixel": {"use": "aps-4um", "width": "2 um"},
    "exposure": {"auto": {"max": "100 ms"}},
    "adc": {"bits": 10, "offset": "16 DN"},
    "quality": [],
    "effects": "all",
}
"""A lens without aberrations, and every noise."""
BUSY: dict[str, Any] = {
    **PLAIN,
    "name": "busy",
    "optics": {
        "f_number": 2.8,
        "focal_length": "8 mm",
        "transmittance": [0.95, "ir-cut-650"],
        "off_axis": "exact",
        "stray_light": 0.01,
        "zernike": {4: "30 nm", 7: "20 nm", 11: "20 nm"},
    },
    "pixel": {
        "use": "aps-4um",
        "width": "2 um",
        "stack": {
            "passivation": {"thickness": "0.7 um", "index": 2.0},
            "oxide": {"thickness": "2 um", "index": 1.46},
        },
        "microlens": {"gain": 1.4, "shift": "optimal"},
        "photodetector": {
            "fill_factor": 0.4,
            "charge_diffusion": {
                "diffusion_length": "20 um",
                "depletion_width": "1 um",
                "substrate_depth": "5 um",
            },
        },
    },
}
"""Fifteen of the sixteen effects: charge transfer is a ccd's, which has no reset noise."""


LAYERED: dict[str, list[dict[str, Any]]] = {
    "dead leaves": [
        {"kind": "chart", "chart": "dead-leaves", "seed": seed} for seed in range(1, 9)
    ],
    "charts of rectangles": [
        {"kind": "chart", "chart": chart} for chart in ("colorchecker", "slanted-edge") * 4
    ],
    "photographs": [SOURCES["color"]] * 8,
}
"""Sources of eight layers, the nearest first."""
NEAREST, FURTHEST = 0.6, 3.0
"""Distance of the first and of the last layer [m]; the focus is amid them."""
FOCAL_LENGTH, PITCH = 8e-3, 2e-6
"""Of the bench's lens and pixels [m]."""


@dataclass(frozen=True)
class Studio:
    """A folder with the picture, of one size."""

    folder: Path
    rows: int
    columns: int
    always: dict[str, Any] = field(default_factory=dict)
    """Top-level keys laid over every camera."""

    def tree(self, scene: str, base: dict[str, Any], **changes: Any) -> dict[str, Any]:
        """A camera file as a mapping; changes are top-level keys laid over it."""
        looked_at = {"source": SOURCES[scene], "luminance": "200 cd/m2", "wavelengths": BAND}
        size = {"rows": self.rows, "columns": self.columns}
        array = {"use": "12mp-bayer", **size}
        return {**base, "scene": looked_at, "array": array, **self.always, **changes}

    def write(self, tree: dict[str, Any], name: str = "camera.yaml") -> Path:
        path = self.folder / name
        path.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        return path

    def camera(self, scene: str = "gray", base: dict[str, Any] = PLAIN, **changes: Any) -> Camera:
        """The camera looking at the picture (gray, color, laser) or at a chart."""
        return load(self.write(self.tree(scene, base, **changes)))

    def layered(self, kind: str, accuracy: str = "standard") -> tuple[Camera, Camera]:
        """The camera before the last of eight layers alone, and before all of them.

        Seven lie on a ring, each two fifths as wide as the frame, before the last, so that some of
        each is seen. Their distances are even in 1 / distance.
        """
        sources = LAYERED[kind]
        inverse = np.linspace(1 / NEAREST, 1 / FURTHEST, len(sources))
        focus = 1 / float(inverse.mean())
        layers: list[dict[str, Any]] = []
        for number, (source, distance) in enumerate(zip(sources, 1 / inverse, strict=True)):
            width = self.columns * PITCH * distance * (1 / FOCAL_LENGTH - 1 / focus)
            angle = 2 * np.pi * number / (len(sources) - 1)
            x, y = 0.3 * width * np.cos(angle), 0.3 * width * np.sin(angle)
            layers.append(
                {
                    "source": source,
                    "distance": f"{distance} m",
                    "width": f"{0.4 * width} m",
                    "position": [f"{x} m", f"{y} m"],
                }
            )
        del layers[-1]["width"], layers[-1]["position"]
        optics = {**PLAIN["optics"], "focus_distance": f"{focus} m"}
        cameras = []
        for name, source in (
            ("flat", sources[-1]),
            ("layers", {"kind": "layers", "layers": layers}),
        ):
            tree = self.tree("gray", PLAIN, optics=optics, effects="auto", accuracy=accuracy)
            lit = {"source": source, "luminance": "200 cd/m2", "distance": f"{focus} m"}
            if name == "layers":
                del lit["distance"]
            tree["scene"] = lit
            cameras.append(load(self.write(tree, f"{name}.yaml")))
        return cameras[0], cameras[1]

    def lenses(self, source: str) -> tuple[Camera, Camera]:
        """The shipped double Gauss before a scene, and one wavefront with its distortion.

        The wavefront has the rms of the double Gauss in its center, 0.2 waves at 550 nm.
        """
        sets = (
            f"scene.source={source}",
            f"array={{rows: {self.rows}, columns: {self.columns}, pattern: bayer-rggb}}",
            f"pixel.width={9.6e3 / self.columns:.6g} um",
        )
        traced = load("double-gauss", sets)
        solved = geometry(traced)
        corner = float(np.hypot(solved.sensor_width, solved.sensor_height)) / 2
        view = traced_view(traced, solved.object_distance)
        assert view is not None
        known = distortion(view, corner)
        lines = [f"{1e3 * h},{100 * v}" for h, v in zip(known.heights, known.values, strict=True)]
        table = self.folder / "distortion.csv"
        table.write_text("\n".join(["image_height_mm,distortion_percent", *lines[::8]]))
        tree = yaml.safe_load(shipped.find("cameras", "double-gauss").read_text())
        del tree["optics"]["prescription"]
        tree["optics"] |= {
            "f_number": 8,
            "focal_length": f"{1e3 * solved.focal_length} mm",
            "zernike": {4: "90 nm", 11: "60 nm"},
            "distortion": {"file": str(table)},
        }
        return traced, load(self.write(tree, "wavefront.yaml"), sets)


@lru_cache(maxsize=4)
def _leaves(rows: int, columns: int) -> NDArray[np.uint16]:
    """(3, rows, columns) Three mixtures of the leaves' colors."""
    view = View(rows, columns, 1e-6, 1e-6, dtype=np.float32)
    scene = build(load("still-life").scene, view, None)
    mix = np.random.default_rng(0).dirichlet(np.ones(len(scene.spectra)), 3)
    return np.clip(scene.planes(mix) * 4 * 65535, 0, 65535).astype(np.uint16)


@contextmanager
def studio(
    rows: int,
    columns: int,
    always: dict[str, Any] | None = None,
    of: tuple[int, int] | None = None,
) -> Iterator[Studio]:
    """A picture of dead leaves of that size in colors and in gray, for as long as it is needed.

    of: size of the picture that it is the middle of, and so has the same detail as; itself.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = _leaves(*(of or (rows, columns)))
        top, left = ((n - m) // 2 for n, m in zip(whole.shape[1:], (rows, columns), strict=True))
        planes = whole[:, top : top + rows, left : left + columns]
        write_png(folder / "leaves.png", np.ascontiguousarray(np.moveaxis(planes, 0, 2)))
        write_png(folder / "gray.png", np.ascontiguousarray(planes[1]))
        yield Studio(folder, rows, columns, always or {})
