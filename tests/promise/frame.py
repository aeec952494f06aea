"""A random frame: a camera file as changes of the plain one, and the pictures that it names.

draw = Draw("lone", 17)                     # every kind and seed gives other numbers
frame = frames.KINDS["lone"].draw(draw)
camera = frame.load(folder, "standard")     # as a user's file gives it, effects on `auto`
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import making
import numpy as np

from vcam_cli.camera.camera import Camera

T = TypeVar("T")


class Draw:
    """Random numbers of one frame, rounded so that a camera file holds all their digits."""

    def __init__(self, kind: str, seed: int) -> None:
        self.rng = np.random.default_rng((zlib.crc32(kind.encode()), seed))
        self.seed = seed

    def log(self, low: float, high: float) -> float:
        """Evenly distributed in its logarithm, four digits."""
        return float(f"{math.exp(self.rng.uniform(math.log(low), math.log(high))):.4g}")

    def even(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 4)

    def whole(self, low: int, high: int) -> int:
        """From low to high, both included."""
        return int(self.rng.integers(low, high + 1))

    def pick(self, options: Sequence[T]) -> T:
        return options[int(self.rng.integers(len(options)))]

    def chance(self, part: float) -> bool:
        return bool(self.rng.random() < part)

    def um(self, low: float, high: float) -> str:
        return f"{self.log(low, high):g} um"


@dataclass(frozen=True)
class Frame:
    """A camera before a scene."""

    changes: Mapping[str, Any]
    """Keys of the plain camera of tests/making.py by their paths."""
    pictures: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Name of an .exr -> samples (h, w, channels) of 32-bit floats."""

    def load(self, folder: Path, accuracy: str | float, effects: str = "auto") -> Camera:
        """Write the files into a folder and read the camera from them."""
        for name, samples in self.pictures.items():
            write_exr(folder / name, samples)
        return making.camera(folder, {**self.changes, "effects": effects, "accuracy": accuracy})

    @property
    def samples(self) -> np.ndarray:
        """Of the scene's picture, as the file has them: (h, w, K), float64."""
        return self.pictures[self.changes["scene.source"]["file"]].astype(np.float64)


def write_exr(path: Path, samples: np.ndarray) -> None:
    """A float .exr of one or three channels."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(samples.shape[1], samples.shape[0], samples.shape[2], "float")
    spec.channelnames = ("Y",) if samples.shape[2] == 1 else ("R", "G", "B")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(np.ascontiguousarray(samples, np.float32))
    assert out.close()


def picture_source(samples: np.ndarray, **more: Any) -> tuple[dict[str, Any], dict]:
    """The scene's `source` for a picture (h, w) or (h, w, K), and the file that it names."""
    samples = np.atleast_3d(samples).astype(np.float32)
    model = "reflectance" if samples.shape[2] == 1 else "laser"
    source = {"kind": "image", "file": "picture.exr", "encoding": "linear", "model": model}
    return source | more, {"picture.exr": samples}
