"""Which frames of a data set are computed together: the parts of its shards.

A part is some dozen small frames, or one large one. Frames of one scene, crop and light are in one
part where they are small, and those of one picture next to each other. Parts depend on the file
alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.datasets.dataset_file import DatasetFile
from vcam_cli.datasets.drawing import MOST_TOGETHER, Scene, sharing_light
from vcam_cli.datasets.shards import Part, Shard
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.sweeps.sweep_points import hash_of

PART_PIXELS, DEVICE_PIXELS = 1 << 20, 1 << 24
"""Pixels of a part, at most: a second of work of the processor, and a batch of a graphics
processor. A single light may have more."""


class Hasher:
    """Hashes parts: all that their arrays depend on, wherever files lie."""

    def __init__(self, file: DatasetFile, device: str = "cpu") -> None:
        form = file.camera.model_dump(mode="json")
        for name in ("name", "quality", "expect", "output", "seed"):
            form.pop(name, None)
        form["sensor"] = file.camera.seed.sensor
        self._file = file
        asked = {} if device == "cpu" else {"device": device}
        self._content = hash_of(file.camera, form, asked | {"write": sorted(file.model.write)})
        self.most_pixels = PART_PIXELS if device == "cpu" else DEVICE_PIXELS
        """Pixels of a part, at most."""
        self._scenes = {s.file: hash_file(s.file) for s in file.scenes if s.file is not None}

    def part(self, lit: tuple[range, ...], numbers: tuple[int, ...]) -> Part:
        """Return a part with its hash."""
        drawn = [self._plain(number) for frames in lit for number in frames]
        content = to_json({"frames": drawn, "numbers": numbers})
        return Part(hash_text(f"{self._content} {content}")[:32], lit, numbers)

    def _plain(self, number: int) -> dict[str, Any]:
        frame = self._file.frame(number)
        scene = frame.scene
        shown = None if scene is None else self._scenes[scene.file] if scene.file else scene.source
        return {"number": number, **frame.plain, "scene": shown}


def cut(file: DatasetFile, hasher: Hasher) -> list[Shard]:
    """Return the shards of a data set, of equal size, in the order of the frames."""
    frames, count = file.model.frames, file.model.shards
    ends = [frames * n // count for n in range(count + 1)]
    digits = max(6, len(str(frames - 1)))
    size = geometry(file.camera)
    pixels = size.rows * size.columns
    return [
        Shard(n, range(a, b), tuple(_parts(file, range(a, b), pixels, hasher)), digits)
        for n, (a, b) in enumerate(pairwise(ends))
    ]


def _parts(file: DatasetFile, frames: range, pixels: int, hasher: Hasher) -> Iterator[Part]:
    """Yield the parts of a shard of these frames."""
    most = max(1, min(MOST_TOGETHER, hasher.most_pixels // pixels))
    lit: list[range] = []
    numbers: list[int] = []
    for lights in _by_scene(file, frames, pixels):
        for light in lights:
            own = [number for number in light if number in frames]
            if numbers and len(numbers) + len(own) > most:
                yield hasher.part(tuple(lit), tuple(numbers))
                lit, numbers = [], []
            lit.append(light)
            numbers += own
    if numbers:
        yield hasher.part(tuple(lit), tuple(numbers))


def _by_scene(file: DatasetFile, frames: range, pixels: int) -> list[list[range]]:
    """Return frames that share their light, for every light of a shard, by what they show."""
    found: dict[int, list[range]] = {}
    number = frames.start
    while number < frames.stop:
        light = sharing_light(file.model, number, pixels)
        scene: Scene | None = file.frame(number).scene
        found.setdefault(id(scene), []).append(light)
        number = light.stop
    return list(found.values())
