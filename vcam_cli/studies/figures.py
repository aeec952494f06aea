"""The figures of a sweep: which cameras each of them shows, found and checked before anything runs.

Figures of numbers that points have (`lines`, `optima`) need nothing but these. The others have
cameras of their own: a case of the study, a value of its parameter, overrides of the figure. What
is known of them in closed form is computed when the figure is written; what needs frames is kept
like points are, see `figure_maps`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.explain import one_of
from vcam_cli.camera.load import nested
from vcam_cli.camera.merge import merge
from vcam_cli.camera.settings import Seed
from vcam_cli.camera.study_figures import (
    Lines,
    Mtf,
    OffAxis,
    Optima,
    Properties,
    SpectralResponse,
    StudyFigure,
)
from vcam_cli.camera.yaml_tree import Node, Source
from vcam_cli.errors import BadInput, Collector, Problem, split
from vcam_cli.studies import properties
from vcam_cli.studies.cases import cases_of
from vcam_cli.studies.checks import CHECKS
from vcam_cli.studies.study_file import Cell, Parameter
from vcam_cli.studies.sweep_points import Grid

FIGURES = "figures"
"""The key of the study file."""
JUDGED = "s-cielab"
"""What a camera is asked for whose picture is compared."""


@dataclass(frozen=True)
class View:
    """A camera of a figure."""

    case: str
    cell: Cell
    """Value of the parameter."""
    cameras: tuple[Camera, ...]
    """One; where frames are needed one for every repeat and seed of the study, seeds fastest."""
    seeds: int = 1

    @property
    def camera(self) -> Camera:
        return self.cameras[0]


@dataclass(frozen=True)
class Planned:
    """A figure, and what it shows."""

    name: str
    figure: StudyFigure
    parameter: Parameter
    cases: tuple[str, ...]
    views: tuple[View, ...]

    @property
    def title(self) -> str:
        return self.figure.title or self.name


def plan(grid: Grid, planner: Planner) -> tuple[Planned, ...]:
    """The figures of a study, in its order.

    Raises BadInput with everything wrong: cases and parameters that the study does not have,
    cameras that are refused, quantities that they do not have.
    """
    if not grid.study.model.figures:
        return ()
    problems, found = Collector(), []
    for name, figure in grid.study.model.figures.items():
        try:
            found.append(planner.planned(name, figure))
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return tuple(found)


class Planner:
    """Makes cameras of a study that are not among its points."""

    def __init__(self, grid: Grid, sets: Sequence[str] = (), folder: Path | None = None) -> None:
        """sets and folder as for `sweep_points.grid`."""
        over = cameras.overlay(sets, folder or cameras.current_folder())
        self._grid, self._over = grid, over
        self._bases = {name: base for name, base, _ in cases_of(grid.study, over)}
        self._known: dict[tuple[str, str, Cell], Camera] = {}
        for point in grid.points:
            if point.camera is not None:
                for path, cell in point.varied.items():
                    self._known.setdefault((point.case, path, cell), point.camera)

    def planned(self, name: str, figure: StudyFigure) -> Planned:
        """A figure with its cameras. Raises BadInput."""
        parameter = self._parameter(name, figure)
        cases = self._cases(name, figure, parameter.path)
        self._refuse_open(name, figure, parameter.path, cases)
        if isinstance(figure, Lines):
            return Planned(name, figure, parameter, cases, ())
        if isinstance(figure, Optima):
            views = tuple(self._any(case) for case in cases)
        elif isinstance(figure, Properties):
            views = tuple(v for case in cases for v in self._grid_views(name, parameter, case))
        else:
            views = tuple(self._own_views(name, figure, parameter, cases))
        found = Planned(name, figure, parameter, cases, views)
        self._try(found)
        return found

    def _wrong(self, key: tuple[str | int, ...], message: str, remedy: str) -> BadInput:
        path = (FIGURES, *key)
        return BadInput([Problem(path, message, remedy, self._grid.study.locate(path))])

    def _parameter(self, name: str, figure: StudyFigure) -> Parameter:
        varied = {p.path: p for p in self._grid.varied}
        if not figure.over:
            return max(varied.values(), key=lambda p: len(p.nodes))
        if figure.over not in varied:
            message, remedy = one_of(figure.over, varied)
            raise self._wrong((name, "over"), message, remedy)
        return varied[figure.over]

    def _cases(self, name: str, figure: StudyFigure, path: str) -> tuple[str, ...]:
        known = tuple(self._grid.cases)
        every = known if isinstance(figure, Lines | Optima | Properties) else known[:1]
        chosen = figure.named or every
        key = "case" if getattr(figure, "case", None) else "cases"
        for i, case in enumerate(chosen):
            place = (name, key) if key == "case" else (name, key, i)
            if case not in known:
                message, remedy = one_of(case, known)
                raise self._wrong(place, message, remedy)
            if path not in self._grid.cases[case]:
                message = f"the case {case} does not vary {path}"
                raise self._wrong(place, message, "name another one")
        return chosen

    def _refuse_open(self, name: str, figure: StudyFigure, path: str, cases: Sequence[str]) -> None:
        """Refuses overrides of what is varied, and what else varies where it is not overridden."""
        for repeated in (path, *(p.path for p in self._grid.repeated)):
            if repeated in figure.overrides:
                message = "is varied by the study"
                raise self._wrong((name, "set", repeated), message, "set another key")
        if isinstance(figure, Lines | Optima):
            return
        for case in cases:
            for other in self._grid.cases[case]:
                if other != path and other not in figure.overrides:
                    cell = self._grid.cases[case][other].nodes[0].value
                    message = f"the study varies {other} as well"
                    raise self._wrong((name,), message, f"add set: {{{other}: {cell}}}")

    def _any(self, case: str) -> View:
        """A camera of a case that has one."""
        for (named, _, cell), camera in self._known.items():
            if named == case:
                return View(case, cell, (camera,))
        message = f"no camera of the case {case} is valid"
        raise self._wrong((), message, "correct the case, or leave it out of the figure")

    def _grid_views(self, name: str, parameter: Parameter, case: str) -> Iterator[View]:
        """The cameras of a case at the study's values, those that are refused left out."""
        figure = self._grid.study.model.figures[name]
        own = self._grid.cases[case][parameter.path]
        for node, cell in zip(own.nodes, own.cells, strict=True):
            known = self._known.get((case, parameter.path, cell))
            if known is None:
                continue
            if figure.overrides:
                known = self._camera(name, figure, case, parameter.path, node, 0)
            yield View(case, cell, (known,))

    def _own_views(
        self, name: str, figure: StudyFigure, parameter: Parameter, cases: Sequence[str]
    ) -> Iterator[View]:
        """The cameras at the figure's own values."""
        at = self._grid.study.values(parameter.path, parameter.unit, FIGURES, name, "at")
        repeats = range(self._repeats if figure.needs_frames else 1)
        for case, (node, cell) in itertools.product(cases, zip(at.nodes, at.cells, strict=True)):
            made = [self._camera(name, figure, case, parameter.path, node, i) for i in repeats]
            seeds = self._grid.study.model.seeds if figure.needs_frames else 1
            frames = tuple(_seeded(c, i) for c, i in itertools.product(made, range(seeds)))
            yield View(case, cell, frames, seeds)

    @property
    def _repeats(self) -> int:
        count = 1
        for parameter in self._grid.repeated:
            count *= len(parameter.nodes)
        return count

    def _camera(
        self, name: str, figure: StudyFigure, case: str, path: str, node: Node, repeat: int
    ) -> Camera:
        """The camera of a figure: a case with a value of the parameter, the repeat of a number."""
        place, judged = (FIGURES, name), figure.needs_frames
        return self.camera(place, figure.overrides, case, path, node, repeat, judged)

    def camera(
        self,
        place: tuple[str, ...],
        overrides: Iterable[str],
        case: str,
        path: str,
        node: Node,
        repeat: int = 0,
        judged: bool = False,
    ) -> Camera:
        """The camera of a case with a value of the parameter `path`, the repeat of a number.

        overrides: paths, whose values stand at `set` of a place in the study file. judged: whether
        its picture is to be compared. Raises BadInput where it is refused.
        """
        base = self._bases[case]
        tree = nested(split(path), node)
        tree = replace(tree, source=Source("", base.file.parent))
        for parameter in reversed(self._grid.repeated):
            repeat, number = divmod(repeat, len(parameter.nodes))
            tree = merge(tree, nested(split(parameter.path), parameter.nodes[number]))
        if judged:
            tree = merge(
                tree, nested(("quality",), replace(node, value=[replace(node, value=JUDGED)]))
            )
        base = base.overlaid(tree).overlaid(self._over)
        for own in overrides:
            base = base.overlaid(nested(split(own), self._grid.study.node(*place, "set", own)))
        try:
            made = base.camera(CHECKS)
        except BadInput as error:
            raise BadInput(self._named(p, place) for p in error.problems) from None
        return made.model_copy(update={"name": case.replace("/", "-")})

    def _named(self, problem: Problem, place: tuple[str, ...]) -> Problem:
        """With the key of the study that asks for the camera, where it stands in another file."""
        if problem.where.startswith(f"{self._grid.study.file}:"):
            return problem
        return replace(problem, message=f"{problem.message} ({'.'.join(place)} of the study)")

    def _try(self, found: Planned) -> None:
        """Refuses what the closed forms do not know of the figure's cameras."""
        figure = found.figure
        tried = {view.case: view for view in found.views}.values()
        for view in tried:
            try:
                match figure:
                    case Properties():
                        self._try_properties(found.name, figure.of, "of", view)
                    case Optima():
                        self._try_properties(found.name, (figure.against,), "against", view)
                    case Mtf():
                        properties.scene_white(view.camera)
                    case OffAxis():
                        properties.varying_gains(view.camera)
                    case SpectralResponse():
                        properties.spectral_response(view.camera)
            except BadInput as error:
                where = self._grid.study.locate((FIGURES, found.name, "show"))
                raise BadInput(replace(p, where=p.where or where) for p in error.problems) from None

    def _try_properties(self, name: str, wanted: tuple[str, ...], key: str, view: View) -> None:
        for i, word in enumerate(wanted):
            (value,) = properties.values(view.camera, (word,))
            if value != value:
                message = f"the case {view.case} has no {word}"
                place = (name, key, i) if key == "of" else (name, key)
                raise self._wrong(place, message, "leave one of the two out of the figure")


def _seeded(camera: Camera, number: int) -> Camera:
    seed = Seed(sensor=camera.seed.sensor, frame=camera.seed.frame + number)
    return camera.model_copy(update={"seed": seed})
