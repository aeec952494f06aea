"""What the frames of a data set are drawn from: scenes, crops, parameters, seeds.

Every draw has its own stream (`rng`), whose key is the seed and what is drawn, and whose counter is
the frame or the scene: a parameter more changes no other's values, and a frame's values do not
depend on how many frames there are. What changes the light on the sensor is drawn once a scene, so
that the light is computed once for all of its frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from vcam_cli import units
from vcam_cli.arrays import Array
from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.sections import with_sections
from vcam_cli.config.document import Document
from vcam_cli.config.yaml_tree import Node, Source, node_of, tree_at
from vcam_cli.datasets.model import Dataset, Distribution
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.records import dataclass
from vcam_cli.rng import stream
from vcam_cli.simulation.checks import CHECKS
from vcam_cli.solve.light_key import changes_light

SOURCE = ("scene", "source")
NOWHERE = Source("what is drawn", Path(), lines=False)
"""Where mistakes are said to be that have no place in a file."""
DIGITS = 9
"""Digits of a value that is drawn."""
MOST_TOGETHER, MOST_PIXELS = 64, 1 << 21
"""Frames, and their pixels, that share a light at most: they are computed at once."""


@dataclass(frozen=True)
class Scene:
    """A chart, or a picture to crop scenes from."""

    name: str
    source: dict[str, Any]
    """As scene.source has it."""
    file: Path | None = None
    size: tuple[int, int] = (0, 0)
    """Rows and columns of the picture."""
    place: Source = NOWHERE
    """Where mistakes in it are said to be, and relative names start."""


@dataclass(frozen=True)
class Frame:
    """A frame of a data set, as it was drawn."""

    number: int
    """From 0."""
    seed: int
    """Of its temporal noise."""
    values: dict[str, Any]
    """Path in the camera -> value as YAML has it."""
    scene: Scene | None = None
    """What it shows; None for the camera's own scene."""
    crop: dict[str, int] = field(default_factory=dict)
    """As scene.source.crop has it; empty of charts."""

    def camera(self, base: Document[Camera], places: Mapping[str, Node] | None = None) -> Camera:
        """Return its camera, validated, from the data set's camera file.

        places: path -> where mistakes of its value are said to be. Raises BadInput.
        """
        drawn = Source("what is drawn", base.file.parent, lines=False)
        tree = _with_values(self._frame_tree(drawn), self.values, drawn, places or {})
        return base.overlay(tree).validate(CHECKS)

    def camera_after(self, known: Frame, camera: Camera, base: Document[Camera]) -> Camera:
        """Return the same camera, sooner: with what it has in common with another frame's.

        Raises BadInput.
        """
        drawn = Source("what is drawn", base.file.parent, lines=False)
        differ = {path for path, value in self.values.items() if known.values[path] != value}
        sections = {"seed", *(str(split(path)[0]) for path in differ)}
        if (self.scene, self.crop) != (known.scene, known.crop):
            sections.add("scene")
        values = {path: v for path, v in self.values.items() if split(path)[0] in sections}
        try:
            document = base.overlay(_with_values(self._frame_tree(drawn), values, drawn, {}))
            found = with_sections(camera, document, sections, CHECKS)
        except BadInput:  # said with the whole file
            found = None
        return found or self.camera(base)

    def _frame_tree(self, drawn: Source) -> Node:
        """Return the tree of its seed and scene."""
        tree = tree_at(("seed", "frame"), node_of(self.seed, drawn))
        if self.scene is None:
            return tree
        source = self.scene.source | ({"crop": self.crop} if self.crop else {})
        return cameras.merge(tree, tree_at(SOURCE, node_of(source, self.scene.place)))

    @property
    def plain(self) -> dict[str, Any]:
        """All that was drawn, but for the name of the scene."""
        return {"seed": self.seed, "values": self.values, "crop": self.crop}


def _with_values(
    tree: Node, values: Mapping[str, Any], drawn: Source, places: Mapping[str, Node]
) -> Node:
    """Return a tree of a camera with values by their paths laid over it."""
    for path, value in values.items():
        place = places.get(path)
        node = node_of(value, drawn) if place is None else _placed(value, place)
        tree = cameras.merge(tree, tree_at(split(path), node))
    return tree


def _placed(value: Any, place: Node) -> Node:
    """Return a value as a tree, every part with the same place in the file."""
    if isinstance(value, Mapping):
        value = {key: _placed(item, place) for key, item in value.items()}
    elif isinstance(value, (list, tuple)):
        value = [_placed(item, place) for item in value]
    return replace(place, value=value, keys={})


def draw_frame(model: Dataset, scenes: tuple[Scene, ...], number: int) -> Frame:
    """Return a frame of a data set.

    Parameters
    ----------
    model : Dataset
        The data set.
    scenes : tuple of Scene
        What frames may show; () for the camera's own scene.
    number : int
        Number of the frame, from 0.
    """
    each = 1 if model.scenes is None else model.scenes.frames_each
    view = number // each
    values: dict[str, Any] = {}
    for path, drawn in model.vary.items():
        index = view if changes_light(path) else number
        values[path] = _draw(model, path, drawn, index, values)
    seed = int(stream(model.seed, "dataset frame", block=number).integers(2**63))
    if not scenes:
        return Frame(number, seed, values)
    turn, place = divmod(view, len(scenes))
    scene = scenes[_order(model.seed, turn, len(scenes))[place]]
    return Frame(number, seed, values, scene, _draw_crop(model, scene, view))


@lru_cache(2)
def _order(seed: int, turn: int, scenes: int) -> Array:
    """Return the order in which scenes come, each once a turn."""
    return stream(seed, "dataset scenes", block=turn).permutation(scenes)


def sharing_light(model: Dataset, number: int, pixels: int) -> range:
    """Return the numbers of the frames that share the light of a frame; it is one of them.

    They do not depend on how many frames the data set has, and may go beyond its last.

    Parameters
    ----------
    model : Dataset
        The data set.
    number : int
        Number of the frame, from 0.
    pixels : int
        Pixels of a frame.
    """
    most = max(1, min(MOST_TOGETHER, MOST_PIXELS // pixels))
    each = most  # of a scene that nothing changes
    if model.scenes is not None:
        each = model.scenes.frames_each
    elif any(map(changes_light, model.vary)):
        each = 1
    first = number - number % each
    start = number - (number - first) % most
    return range(start, min(start + most, first + each))


def _draw(model: Dataset, path: str, drawn: Distribution, index: int, above: dict[str, Any]) -> Any:
    """Return a value; above: path -> those of the keys above it."""
    generator = stream(model.seed, f"dataset {path}", block=index)
    if drawn.formula is not None:
        factor = math.exp(drawn.scatter * float(generator.standard_normal()))
        return _computed(model, path, above, factor)
    if drawn.choice is not None:
        return drawn.choice[int(generator.integers(len(drawn.choice)))]
    if drawn.integers is not None:
        return int(generator.integers(drawn.integers[0], drawn.integers[1], endpoint=True))
    share = float(generator.random())
    ends = drawn.uniform or drawn.log_uniform
    assert ends is not None
    low, high, unit = _ends(*ends)
    number = low + (high - low) * share
    if drawn.log_uniform is not None:
        number = math.exp(math.log(low) + (math.log(high) - math.log(low)) * share)
    number = float(f"{number:.{DIGITS}g}")
    return f"{number!r} {unit}" if unit else number


@lru_cache(1 << 6)
def _ends(first: str | float, last: str | float) -> tuple[float, float, str]:
    """Return the ends of an interval and their unit."""
    low, unit = units.split(first)
    return float(low), float(units.convert(*units.split(last), unit)), unit


def _computed(model: Dataset, path: str, values: dict[str, Any], factor: float = 1.0) -> Any:
    """Return what the formula of a key gives, of the values of those above it. Raises BadInput."""
    formula = model.vary[path].formula
    assert formula is not None
    known = {name: values[model.named(name)[0]] for name in formula.names}
    try:
        return formula.value(known, factor)
    except ValueError as error:
        key = ("vary", path, "from")
        said = ", ".join(f"{name} = {value}" for name, value in known.items())
        remedy = f"correct the formula{f' or its source ({said})' if said else ''}"
        raise BadInput([Problem(key, str(error), remedy, model.locate(key))]) from None


def crop_size(model: Dataset) -> tuple[int, int]:
    """Return rows and columns of a crop, in samples of its picture."""
    assert model.scenes is not None and model.size is not None
    scale = model.scenes.samples_per_pixel
    return max(1, round(model.size.rows * scale)), max(1, round(model.size.columns * scale))


def _draw_crop(model: Dataset, scene: Scene, view: int) -> dict[str, int]:
    if scene.file is None:
        return {}
    generator = stream(model.seed, "dataset crop", block=view)
    rows, columns = crop_size(model)
    row, column = (int(generator.integers(whole - part + 1))
                   for whole, part in zip(scene.size, (rows, columns), strict=True))  # fmt: skip
    return {"row": row, "column": column, "rows": rows, "columns": columns}


def extremes(model: Dataset, frame: Frame) -> Iterator[tuple[str, Frame]]:
    """Yield path and frame with each end, or each choice, of what is drawn.

    What formulas give follows, without scatter.
    """
    for path, drawn in model.vary.items():
        for value in drawn.values:
            values = frame.values | {path: value}
            for other, tied in model.vary.items():
                if tied.formula is not None:
                    values[other] = _computed(model, other, values)
            yield path, replace(frame, values=values)
