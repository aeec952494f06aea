"""A study file: read with its places, checked, its values taken apart into parameters.

A parameter is a path of the camera and the values that it takes: each as the camera's YAML has it,
and as a cell of a table, a number in the unit of the first value where it is one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

from pydantic import ValidationError

from vcam_cli import errors, units
from vcam_cli.camera import explain
from vcam_cli.camera import load as cameras
from vcam_cli.camera.explain import in_yaml
from vcam_cli.camera.study import VARY, Sweep
from vcam_cli.camera.yaml_tree import Node, read_file
from vcam_cli.errors import BadInput, Problem

Cell = float | str
OTHERS = {
    "sweep": ("schedule", "this is a study of capture schedules"),
    "schedule": ("sweep", "this is a study of a camera whose parameters change"),
}
"""Kind of study -> the other kind, and what such a one is."""


@dataclass(frozen=True)
class Parameter:
    """A path of the camera and the values it takes."""

    path: str
    unit: str
    """Of the cells; "" for bare numbers and words."""
    nodes: tuple[Node, ...]
    """The values as YAML."""
    cells: tuple[Cell, ...]

    @property
    def column(self) -> str:
        """As points.csv names it: "pixel.width [um]"."""
        return f"{self.path} [{self.unit}]" if self.unit else self.path


@dataclass(frozen=True)
class StudyFile:
    """A sweep study as it was written, and what it means."""

    file: Path
    tree: Node
    model: Sweep

    @cached_property
    def places(self) -> dict[errors.Path, str]:
        return cameras.places(self.tree)

    def locate(self, path: errors.Path) -> str:
        """Where a key of the study stands, "study.yaml:5:3"."""
        while path not in self.places and path:
            path = path[:-1]
        return self.places.get(path, "")

    def node(self, *path: str) -> Node:
        """The value at a path that is there."""
        found: Node | None = self.tree
        for key in path:
            found = found.get(key) if found is not None else None
        assert found is not None
        return found

    def varied(self, case: str | None) -> dict[str, Parameter]:
        """What is varied in a case, by path: the study's, with what the case has in its place."""
        found = self._parameters(self.model.vary, VARY)
        if case is None or not self.model.cases[case].vary:
            return found
        own = self._parameters(self.model.cases[case].vary, "cases", case, VARY)
        for path, parameter in own.items():
            if path in found and parameter.unit != found[path].unit:
                own[path] = _in_unit(parameter, found[path].unit)
        return found | own

    def repeated(self) -> dict[str, Parameter]:
        """What is averaged over, by path."""
        return {
            path: _listed(path, self.node("repeat", path), values)
            for path, values in self.model.repeat.items()
        }

    def values(self, path: str, unit: str, *at: str) -> Parameter:
        """Values of a parameter, one or a list of them, that stand at a key of the study.

        unit: of the cells, where the values are of its kind.
        """
        node = self.node(*at)
        nodes = node if isinstance(node.value, list) else replace(node, value=[node])
        plain = nodes.plain()
        assert isinstance(plain, list)
        found = _listed(path, nodes, tuple(plain))
        return _in_unit(found, unit) if found.unit != unit else found

    def _parameters(self, vary: Mapping, *at: str) -> dict[str, Parameter]:
        out = {}
        for path, variation in vary.items():
            node = self.node(*at, path)
            if variation.values is not None:
                out[path] = _listed(path, self.node(*at, path, "values"), variation.values)
            else:
                try:
                    out[path] = _range(path, node, variation)
                except ValueError as error:
                    message, _, remedy = str(error).partition("; ")
                    raise BadInput([node.problem((*at, path), message, remedy)]) from None
        return out


def read(study: str | Path, folder: Path | None = None) -> StudyFile:
    """A study file, or a shipped study's. Raises BadInput with everything wrong, CannotDo.

    The cameras that it makes are not looked at: see `sweep_points`.
    """
    file = cameras.find(study, folder or cameras.current_folder(), "studies")
    tree = read_file(file)
    if tree.mapping is None:
        raise BadInput(
            [tree.problem((), "a mapping is needed here", "write lines of `key: value`")]
        )
    refuse_others(tree, "sweep")
    value = tree.plain()
    assert isinstance(value, dict)
    if "name" not in value:
        value["name"] = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem)[:64] or "sweep"
    try:
        found = StudyFile(file, tree, Sweep.model_validate(value))
    except ValidationError as error:
        unnamed = [_without_key_mark(p) for p in explain.problems(error, Sweep, value)]
        places = cameras.Origin(file, (file,), tree)
        located = BadInput(unnamed).located(places.locate).problems
        raise BadInput(sorted(located, key=cameras.by_place)) from None
    for case in (None, *found.model.cases):
        found.varied(case)
    found.repeated()
    return found


def refuse_others(tree: Node, wanted: str) -> None:
    """Raises BadInput for a camera file, and for a study of another kind than is wanted."""
    kind = tree.get("kind")
    if kind is None and (tree.get("optics") or tree.get("scene") or tree.get("extends")):
        message, remedy = "this is a camera file, not a study", "give it to vcam run"
        raise BadInput([tree.problem((), message, remedy)])
    other, message = OTHERS[wanted]
    if kind is not None and kind.value == other:
        raise BadInput([kind.problem(("kind",), message, f"give it to vcam {other}")])


def _without_key_mark(problem: Problem) -> Problem:
    """Pydantic marks a mistake in a key itself with a path element of its own."""
    return replace(problem, path=tuple(p for p in problem.path if p != "[key]"))


def _range(path: str, node: Node, variation) -> Parameter:
    """Values of equal steps, in the unit of the first. The steps are exact until they are written.

    Of one value there is only the first.
    """
    start, unit = units.split(variation.start)
    stop = units.convert(*units.split(variation.stop), unit)
    if variation.count > 1 and start == stop:
        raise ValueError("start and stop are the same; give one value, or two ends")
    steps = max(1, variation.count - 1)
    numbers = [start + (stop - start) * Fraction(i, steps) for i in range(variation.count)]
    whole = all(n.denominator == 1 for n in numbers)
    written: list[float] = [int(n) if whole else float(n) for n in numbers]
    place = node.get("start") or node
    texts = [f"{n!r} {unit}" if unit else n for n in written]
    nodes = tuple(replace(place, value=text) for text in texts)
    return Parameter(path, unit, nodes, tuple(float(n) for n in numbers))


def _listed(path: str, node: Node, values: tuple) -> Parameter:
    """Values as they were written; numbers where all are, words otherwise."""
    assert isinstance(node.value, list)
    nodes = tuple(node.value)
    try:
        first, unit = units.split(values[0])
        numbers = [first, *(units.convert(*units.split(v), unit) for v in values[1:])]
    except ValueError:
        return Parameter(path, "", nodes, tuple(in_yaml(v) for v in values))
    return Parameter(path, unit, nodes, tuple(float(n) for n in numbers))


def _in_unit(parameter: Parameter, unit: str) -> Parameter:
    """The same values, with cells in another unit where they are numbers of that kind."""
    try:
        cells = tuple(
            float(units.convert(Fraction(repr(c)), parameter.unit, unit))
            for c in parameter.cells
            if isinstance(c, float)
        )
    except ValueError:
        return parameter
    return replace(parameter, unit=unit, cells=cells) if cells else parameter
