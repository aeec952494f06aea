"""Cameras of a study that are not among its points: those of its figures and expectations.

Such a camera is a case of the study with a value of the parameter, which need not be one of the
study's, and with overrides of the figure. All are made and checked before anything runs.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from vcam_cli.camera import load
from vcam_cli.camera.camera import Camera
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.validation_messages import one_of
from vcam_cli.config.yaml_tree import Node, tree_at
from vcam_cli.errors import BadInput, split
from vcam_cli.records import dataclass
from vcam_cli.simulation.checks import CHECKS
from vcam_cli.sweeps.figure_model import Figure
from vcam_cli.sweeps.quantities import is_measured
from vcam_cli.sweeps.sweep_file import Cell, Parameter
from vcam_cli.sweeps.sweep_points import Grid, case_file, with_next_seed

FIGURES = "figures"
"""The key of the study file."""
JUDGED = "s-cielab"
"""The quality that is asked of a camera whose picture is compared."""


@dataclass(frozen=True)
class FigureCamera:
    """A camera of a figure."""

    case: str
    cell: Cell
    """The value of the parameter."""
    frames: tuple[Camera, ...]
    """One camera; for a rendered figure one for every repeat and seed, seeds fastest."""

    @property
    def camera(self) -> Camera:
        """The camera of the first frame."""
        return self.frames[0]


@dataclass(frozen=True)
class PlannedFigure:
    """A figure and its cameras."""

    name: str
    figure: Figure
    parameter: Parameter
    cases: tuple[str, ...]
    measured: tuple[str, ...]
    """The quantities that are taken from the points."""
    cameras: tuple[FigureCamera, ...] = ()

    @property
    def title(self) -> str:
        """The text above the figure."""
        return self.figure.title or self.name

    @property
    def head(self) -> tuple[str, str]:
        """The columns of a table that name a camera."""
        return ("case", self.parameter.column)

    def label(self, camera: FigureCamera) -> str:
        """Return what tells a camera from the others in a legend."""
        value = self.parameter.text(camera.cell)
        has_cases = len({c.case for c in self.cameras}) > 1
        has_values = len({c.cell for c in self.cameras}) > 1
        return ", ".join([camera.case] * has_cases + [value] * (has_values or not has_cases))


class StudyCameras:
    """Makes cameras of a study that are not among its points."""

    def __init__(self, grid: Grid, sets: Sequence[str] = (), folder: Path | None = None) -> None:
        """Take a grid with what it was made of, see `sweep_points.grid`."""
        self.grid = grid
        self._over = load.overlay(sets, folder or current_folder())

    def frames(
        self, place: tuple[str, ...], case: str, nodes: dict[str, Node], is_rendered: bool = False
    ) -> tuple[Camera, ...]:
        """Return the camera of a case with values by path, and the overrides at `set` of a place.

        place: in the study file. Rendered, there is one for every repeat and seed of the study,
        whose pictures are compared; else one, of the first repeat. Raises BadInput.
        """
        repeated, found = self.grid.averaged_parameters, list[Camera]()
        for chosen in itertools.product(*(p.nodes for p in repeated)):
            repeat = {p.path: node for p, node in zip(repeated, chosen, strict=True)}
            camera = self._camera(place, case, nodes | repeat, is_rendered)
            if not is_rendered:
                return (camera,)
            found += [with_next_seed(camera, i) for i in range(self.grid.study.model.seeds)]
        return tuple(found)

    def _camera(
        self, place: tuple[str, ...], case: str, nodes: dict[str, Node], is_judged: bool
    ) -> Camera:
        study = self.grid.study
        file = case_file(self.grid.cases[case], nodes, self._over)
        if is_judged:
            node = study.node("metrics")
            quality = replace(node, value=[replace(node, value=JUDGED)])
            file = file.overlay(tree_at(("quality",), quality))
        overrides = study.node(*place).get("set")
        for path, node in (overrides.mapping or {}).items() if overrides else ():
            file = file.overlay(tree_at(split(str(path)), node))
        try:
            camera = file.validate(CHECKS)
        except BadInput as error:
            elsewhere = f" ({'.'.join(place)} of the study)"
            is_here = [p.where.startswith(f"{study.file}:") for p in error.problems]
            raise BadInput(
                problem if here else replace(problem, message=problem.message + elsewhere)
                for problem, here in zip(error.problems, is_here, strict=True)
            ) from None
        return camera.model_copy(update={"name": case.replace("/", "-")})

    def figure(self, name: str, figure: Figure) -> PlannedFigure:
        """Return a figure with its cameras.

        Raises BadInput for cases and parameters that the study does not have, and for cameras that
        are refused.
        """
        metrics = self.grid.study.model.metrics
        measured = tuple(q for q in figure.quantities if is_measured(q, metrics, figure.set))
        varied = {p.path: p for p in self.grid.case_parameters}
        if figure.over and figure.over not in varied:
            raise self._wrong((name, "over"), *one_of(figure.over, varied))
        widest = max(varied.values(), key=lambda p: len(p.nodes))
        parameter = varied.get(figure.over, widest)
        cases, cameras = self._cases(name, figure, parameter.path), tuple[FigureCamera, ...]()
        if figure.show != "curves" or len(measured) < len(figure.quantities):
            made = (self._cameras(name, figure, case, parameter) for case in cases)
            cameras = tuple(camera for own in made for camera in own)
        return PlannedFigure(name, figure, parameter, cases, measured, cameras)

    def _wrong(self, key: tuple[str | int, ...], message: str, remedy: str) -> BadInput:
        return self.grid.study.mistake((FIGURES, *key), message, remedy)

    def _cases(self, name: str, figure: Figure, path: str) -> tuple[str, ...]:
        known = tuple(self.grid.cases)
        cases = figure.cases or (known if figure.is_over_parameter else known[:1])
        for i, case in enumerate(cases):
            if case not in known:
                raise self._wrong((name, "cases", i), *one_of(case, known))
            if path not in self.grid.cases[case].parameters:
                message = f"the case {case} does not vary {path}"
                raise self._wrong((name, "cases"), message, "name another one")
        return cases

    def _cameras(
        self, name: str, figure: Figure, case: str, parameter: Parameter
    ) -> Iterator[FigureCamera]:
        """Yield the cameras of a case: at the figure's values, or at those that the study has."""
        values = self.grid.cases[case].parameters[parameter.path]
        if figure.at:
            values = self.grid.study.values(parameter, FIGURES, name, "at")
        nodes, has_camera = self._first_values(name, figure, case, parameter.path), False
        for node, cell in zip(values.nodes, values.cells, strict=True):
            try:
                nodes[parameter.path] = node
                frames = self.frames((FIGURES, name), case, nodes, figure.is_rendered)
            except BadInput:
                if figure.at:
                    raise
                continue
            has_camera = True
            yield FigureCamera(case, cell, frames)
            if figure.show == "optima":
                return
        if not has_camera:
            message = f"no camera of the case {case} is valid"
            raise self._wrong((name,), message, "correct the case, or leave it out of the figure")

    def _first_values(self, name: str, figure: Figure, case: str, path: str) -> dict[str, Node]:
        """Return the first values of the other parameters, which the figure has to set itself."""
        for varied in (path, *(p.path for p in self.grid.averaged_parameters)):
            if varied in figure.set:
                raise self._wrong(
                    (name, "set", varied), "is varied by the study", "set another key"
                )
        others = {p: v for p, v in self.grid.cases[case].parameters.items() if p != path}
        for other, values in others.items():
            if other not in figure.set and figure.show != "optima":
                remedy = f"add set: {{{other}: {values.nodes[0].value}}}"
                raise self._wrong((name,), f"the study varies {other} as well", remedy)
        return {other: values.nodes[0] for other, values in others.items()}
