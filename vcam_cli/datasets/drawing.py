"""What the frames of a data set are drawn from: scenes, crops, parameters, seeds.

Every draw has its own stream (`rng`), whose key is the seed and what is drawn, and whose counter is
the frame or the scene: a parameter more changes no other's values, and a frame's values do not
depend on how many frames there are. What changes the light on the sensor is drawn once a scene, so
that the light is computed once for all of its frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vcam_cli import units
from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.config.yaml_tree import Node, Source, node_of, tree_at
from vcam_cli.datasets.model import Dataset, Distribution
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.rng import stream
from vcam_cli.simulation.checks import CHECKS
from vcam_cli.solve.light_key import changes_light

SOURCE = ("scene", "source")
NOWHERE = Source("what is drawn", Path(), lines=False)
"""Where mistakes are said to be that have no place in a file."""
DIGITS = 9
"""Digits of a value that is drawn."""


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
        tree = tree_at(("seed", "frame"), node_of(self.seed, drawn))
        if self.scene is not None:
            source = self.scene.source | ({"crop": self.crop} if self.crop else {})
            tree = cameras.merge(tree, tree_at(SOURCE, node_of(source, self.scene.place)))
        for path, value in self.values.items():
            place = (places or {}).get(path)
            node = node_of(value, drawn) if place is None else _placed(value, place)
            tree = cameras.merge(tree, tree_at(split(path), node))
        return base.overlay(tree).validate(CHECKS)

    @property
    def plain(self) -> dict[str, Any]:
        """All that was drawn, but for the name of the scene."""
        return {"seed": self.seed, "values": self.values, "crop": self.crop}


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
    order = stream(model.seed, "dataset scenes", block=turn).permutation(len(scenes))
    scene = scenes[order[place]]
    return Frame(number, seed, values, scene, _draw_crop(model, scene, view))


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
    first, unit = units.split(ends[0])
    low, high = float(first), float(units.convert(*units.split(ends[1]), unit))
    number = low + (high - low) * share
    if drawn.log_uniform is not None:
        number = math.exp(math.log(low) + (math.log(high) - math.log(low)) * share)
    number = float(f"{number:.{DIGITS}g}")
    return f"{number!r} {unit}" if unit else number


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
