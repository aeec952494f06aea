"""A study file: read with its places, checked, its values parsed into parameters and cases.

A parameter is a path of the camera and the values that it takes: each as the camera's YAML has it,
and as a cell of a table, a number in the unit of the first value where it is one. A case is one of
the study's camera files with the case's overrides.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from vcam_cli import errors, units
from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import FORMAT, Camera
from vcam_cli.camera.load import merge
from vcam_cli.config import validation_messages
from vcam_cli.config.document import Document, given_at, place_order
from vcam_cli.config.file_names import argument_file, current_folder, referenced_file
from vcam_cli.config.merge import Alternatives, MergeRules
from vcam_cli.config.study_overrides import lay_over
from vcam_cli.config.validation_messages import yaml_text
from vcam_cli.config.yaml_reader import read_file
from vcam_cli.config.yaml_tree import Node, Origin, PlacedKeys, Source, tree_at
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.records import dataclass
from vcam_cli.sweeps import study_hints
from vcam_cli.sweeps.model import VARY, Sweep, Variation
from vcam_cli.sweeps.quantities import QUALITY, symbol

Cell = float | str
MERGE_RULES = MergeRules(alternatives=(Alternatives.parse("start stop count spacing | values"),))
NOMINAL = "nominal"
"""The case of a study that names none."""
OTHERS = {
    "sweep": ("schedule", "this is a study of capture schedules"),
    "schedule": ("sweep", "this is a sweep study"),
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
        """The name of its column in points.csv: "pixel.width [um]"."""
        return f"{self.path} [{self.unit}]" if self.unit else self.path

    def text(self, cell: Cell) -> str:
        """Return a value as a plot writes it: "8 µm"."""
        return cell if isinstance(cell, str) else f"{cell:.6g} {symbol(self.unit)}".rstrip()


@dataclass(frozen=True)
class StudyCase:
    """A case of a study, of one of its cameras."""

    name: str
    """Its name in tables, with the camera's where there are several."""
    base: Document[Camera]
    """The camera file with the overrides of the case."""
    parameters: dict[str, Parameter]
    """What is varied in it, by path."""


@dataclass(frozen=True)
class StudyFile(PlacedKeys):
    """A sweep study as it was written, and what it means."""

    file: Path
    tree: Node
    model: Sweep

    def mistake(self, path: errors.Path, message: str, remedy: str) -> BadInput:
        """Return the error of a key of the study."""
        return BadInput([Problem(path, message, remedy, self.locate(path))])

    def node(self, *path: str) -> Node:
        """Return the value at a path that is there."""
        found: Node | None = self.tree
        for key in path:
            found = found.get(key) if found is not None else None
        assert found is not None
        return found

    def case_parameters(self, case: str | None) -> dict[str, Parameter]:
        """Return what is varied in a case, by path: the study's, or the case's in its place."""
        found = self._parameters(self.model.vary, VARY)
        if case is None or not self.model.cases[case].vary:
            return found
        own = self._parameters(self.model.cases[case].vary, "cases", case, VARY)
        for path, parameter in own.items():
            if path in found and parameter.unit != found[path].unit:
                own[path] = _convert_cells(parameter, found[path].unit)
        return found | own

    def averaged_parameters(self) -> dict[str, Parameter]:
        """Return what is averaged over, by path."""
        return {
            path: _cell_values(path, self.node("repeat", path), values)
            for path, values in self.model.repeat.items()
        }

    def cases(self) -> Iterator[StudyCase]:
        """Yield all cases, of one camera after the other."""
        place = self.node("metrics")
        asked = sorted({QUALITY[m] for m in self.model.metrics if m in QUALITY})
        quality = replace(place, value=[replace(place, value=q) for q in asked])
        for base in _camera_files(self):
            for case in self.model.cases or (None,):
                own = Node({}, place.source)
                for path in () if case is None else self.model.cases[case].overrides:
                    own = merge(own, tree_at(split(path), self.node("cases", case or "", path)))
                name = NOMINAL if case is None else case
                if len(self.model.camera) > 1:
                    camera = _camera_name(base)
                    name = camera if case is None else f"{camera}/{case}"
                judged = tree_at(("quality",), quality)
                yield StudyCase(name, base.overlay(own).overlay(judged), self.case_parameters(case))

    def word_values(self, over: Node) -> Iterator[Document[Camera]]:
        """Yield what the overrides, and each word among the values, lead to by themselves.

        Names of parts are looked up anew for every camera, so what they lead to may change with no
        change of a file.
        """
        nothing = Document(self.file, Node({}, Source("", self.file.parent)), FORMAT)
        yield nothing.overlay(over)
        for case in (None, *self.model.cases):
            for parameter in (self.case_parameters(case) | self.averaged_parameters()).values():
                if isinstance(parameter.cells[0], str):
                    for node in parameter.nodes:
                        yield nothing.overlay(tree_at(split(parameter.path), node))

    def values(self, parameter: Parameter, *at: str) -> Parameter:
        """Return values of a parameter, one or a list of them, that stand at a key of the study.

        Their cells are in the parameter's unit where they are of its kind.
        """
        path, unit = parameter.path, parameter.unit
        node = self.node(*at)
        nodes = node if isinstance(node.value, list) else replace(node, value=[node])
        plain = nodes.plain()
        assert isinstance(plain, list)
        found = _cell_values(path, nodes, tuple(plain))
        return _convert_cells(found, unit) if found.unit != unit else found

    def _parameters(self, vary: Mapping[str, Variation], *at: str) -> dict[str, Parameter]:
        out = {}
        for path, variation in vary.items():
            node = self.node(*at, path)
            if variation.values is not None:
                out[path] = _cell_values(path, self.node(*at, path, "values"), variation.values)
            else:
                try:
                    out[path] = _range(path, node, variation)
                except ValueError as error:
                    message, _, remedy = str(error).partition("; ")
                    raise BadInput([node.problem((*at, path), message, remedy)]) from None
        return out


def read(study: str | Path, folder: Path | None = None, sets: Sequence[str] = ()) -> StudyFile:
    """Read a study file, or a shipped study's. Raises BadInput with everything wrong, CannotDo.

    sets: overrides "PATH=VALUE" of keys of the study. The cameras that it makes are not looked at:
    see `sweep_points`.
    """
    start = folder or current_folder()
    file = argument_file(study, start, "studies")
    tree = read_file(file)
    if tree.mapping is None:
        raise BadInput(
            [tree.problem((), "a mapping is needed here", "write lines of `key: value`")]
        )
    refuse_others(tree, "sweep")
    tree = lay_over(tree, sets, start, MERGE_RULES)
    value = tree.plain()
    assert isinstance(value, dict)
    if "name" not in value:
        value["name"] = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem)[:64] or "sweep"
    try:
        found = StudyFile(file, tree, Sweep.model_validate(value))
    except ValidationError as error:
        bare = [_without_key_mark(p) for p in validation_messages.problems(error)]
        unnamed = [study_hints.advise(p, given_at(tree, p.path)) for p in bare]
        origin = Origin(file, (file,), tree)
        located = BadInput(unnamed).with_places(origin.locate).problems
        raise BadInput(sorted(located, key=place_order)) from None
    for case in (None, *found.model.cases):
        found.case_parameters(case)
    found.averaged_parameters()
    return found


def _camera_files(study: StudyFile) -> Iterator[Document[Camera]]:
    """Yield the study's camera files. Raises BadInput for another file, or two of one name."""
    node = study.node("camera")
    names: set[str] = set()
    for item in node.value if isinstance(node.value, list) else [node]:
        try:
            base = cameras.read(referenced_file(item, "cameras"), item.source.folder)
            name = _camera_name(base)
            if name in names:
                message = f"a second camera is called {name!r}"
                raise BadInput([Problem((), message, "give it another name", item.where)])
        except BadInput as error:
            places = [p if p.where else replace(p, path=("camera",)) for p in error.problems]
            where = item.where
            raise BadInput(replace(p, where=p.where or where) for p in places) from None
        names.add(name)
        yield base


def _camera_name(base: Document[Camera]) -> str:
    node = base.tree.get("name")
    return str(node.value) if node is not None else base.file.stem


def refuse_others(tree: Node, wanted: str) -> None:
    """Refuse a camera file, and a study of another kind than is wanted. Raises BadInput."""
    kind = tree.get("kind")
    if kind is None and (tree.get("optics") or tree.get("scene") or tree.get("extends")):
        message, remedy = "this is a camera file, not a study", "give it to vcam run"
        raise BadInput([tree.problem((), message, remedy)])
    other, message = OTHERS[wanted]
    if kind is not None and kind.value == "dataset":
        raise BadInput([kind.problem(("kind",), "this is a data set", "give it to vcam dataset")])
    if kind is not None and kind.value == other:
        raise BadInput([kind.problem(("kind",), message, f"give it to vcam {other}")])


def _without_key_mark(problem: Problem) -> Problem:
    """Return a problem without the path element by which pydantic marks a mistake in a key."""
    return replace(problem, path=tuple(p for p in problem.path if p != "[key]"))


def _range(path: str, node: Node, variation: Variation) -> Parameter:
    """Return values of equal steps or ratios, in the unit of the first.

    Steps are exact until they are written, ratios to twelve digits, so that decades are round
    numbers; both ends are as given. Of one value there is only the first.
    """
    count = variation.count
    assert count is not None  # as the file has no list of values
    start, unit = units.split(variation.start)
    stop = units.convert(*units.split(variation.stop), unit)
    if count > 1 and start == stop:
        raise ValueError("start and stop are the same; give one value, or two ends")
    steps = max(1, count - 1)
    numbers = [start + (stop - start) * Fraction(i, steps) for i in range(count)]
    if variation.spacing == "log":
        if start <= 0 or stop <= 0:
            raise ValueError("log spacing needs ends above zero; write spacing: linear")
        logs = np.linspace(math.log(start), math.log(stop), count)
        inner = [Fraction(f"{math.exp(log):.12g}") for log in logs[1:-1]]
        numbers = [start, *inner, stop][:count]
    whole = all(n.denominator == 1 for n in numbers)
    written: list[float] = [int(n) if whole else float(n) for n in numbers]
    place = node.get("start") or node
    texts = [f"{n!r} {unit}" if unit else n for n in written]
    nodes = tuple(replace(place, value=text) for text in texts)
    return Parameter(path, unit, nodes, tuple(float(n) for n in numbers))


def _cell_values(path: str, node: Node, values: tuple[Any, ...]) -> Parameter:
    """Return values as they were written; numbers where all are, words otherwise."""
    assert isinstance(node.value, list)
    nodes = tuple(node.value)
    try:
        first, unit = units.split(values[0])
        numbers = [first, *(units.convert(*units.split(v), unit) for v in values[1:])]
    except ValueError:
        return Parameter(path, "", nodes, tuple(yaml_text(v) for v in values))
    return Parameter(path, unit, nodes, tuple(float(n) for n in numbers))


def _convert_cells(parameter: Parameter, unit: str) -> Parameter:
    """Return the same values, with cells in another unit where they are numbers of that kind."""
    try:
        cells = tuple(
            float(units.convert(Fraction(repr(c)), parameter.unit, unit))
            for c in parameter.cells
            if isinstance(c, float)
        )
    except ValueError:
        return parameter
    return replace(parameter, unit=unit, cells=cells) if cells else parameter
