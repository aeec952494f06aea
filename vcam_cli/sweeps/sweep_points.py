"""From a study to its points: every camera resolved and checked before anything runs.

The order is that of points.csv: cases, then the grid (the last parameter fastest), then what is
repeated, then seeds.

A point is known by the hash of all that its numbers depend on: the resolved camera with what its
files hold, what is measured, the program's own code, and the versions of its libraries. How the
study calls a point, and where files lie, is not in it: two machines agree, and a study that is
extended keeps what it has.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from pathlib import Path
from typing import Any

from vcam_cli.accuracy_study.ablation import wanted_effects
from vcam_cli.camera import load as cameras
from vcam_cli.camera import step_plugins
from vcam_cli.camera.camera import FILE_KEYS, Camera
from vcam_cli.camera.expectations import unmeasured
from vcam_cli.camera.load import merge
from vcam_cli.camera.sections import with_sections
from vcam_cli.camera.simulation import Seed
from vcam_cli.config.document import Document
from vcam_cli.config.file_format import names_file
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.validation_messages import NO_SUCH_KEY
from vcam_cli.config.yaml_tree import Node, Source, tree_at
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.records import dataclass
from vcam_cli.simulation.checks import CHECKS
from vcam_cli.simulation.output import provenance
from vcam_cli.solve.light_key import light_key
from vcam_cli.sweeps.model import Sweep, overlap
from vcam_cli.sweeps.sweep_file import Cell, Parameter, StudyCase, StudyFile

MOST_POINTS = 1_000_000
LIBRARIES = ("vcam", "code", "numpy", "scipy", "OpenImageIO")
"""What decides a point's numbers, among `provenance.versions`."""


@dataclass(frozen=True)
class Point:
    """One frame of the study, without its camera, which is made when it is needed.

    A study of a million points has none of them in memory.
    """

    case: str
    case_values: dict[str, Cell]
    """Path of a parameter -> its value here."""
    averaged_values: dict[str, Cell]
    """Path of what is averaged over -> its value here."""
    seed: int | None
    """The seed of the frame; None where the camera is refused."""
    id: str
    """The hash of the point; "" where the camera is refused."""
    content: str = ""
    """The hash of all but the seed, the same for all seeds of a camera."""
    light: str = ""
    """The hash of what its light depends on; "" where the camera is refused."""
    effects: tuple[str, ...] = ()
    """Names of the effects that the camera has and does not switch off."""
    problems: tuple[Problem, ...] = ()
    """Why the camera is refused."""
    inputs: tuple[Path, ...] = ()
    """The files of the camera."""
    made: tuple[CaseCameras, tuple[int, ...], int] | None = field(
        default=None, repr=False, compare=False
    )
    """What makes the camera, the numbers of the values, and by how much the seed is raised."""

    @property
    def camera(self) -> Camera | None:
        """The camera, made anew; None where it is refused."""
        if self.made is None:
            return None
        cameras, chosen, number = self.made
        return with_next_seed(cameras.camera(chosen), number)


class CaseCameras:
    """Makes the cameras of a case, each checked as by itself.

    What a camera has in common with the one before is not validated again.
    """

    def __init__(self, case: StudyCase, over: Node, parameters: Sequence[Parameter]) -> None:
        self._case, self._over, self._parameters = case, over, parameters
        self._last: tuple[dict[str, Node], Camera] | None = None

    def camera(self, chosen: tuple[int, ...]) -> Camera:
        """Return the camera with these of the parameters' values. Raises BadInput."""
        nodes = self._nodes(chosen)
        file = case_file(self._case, nodes, self._over)
        found = None
        if self._last is not None:
            last, camera = self._last
            differ = {str(split(path)[0]) for path in nodes if nodes[path] is not last[path]}
            found = with_sections(camera, file, differ, CHECKS)
        if found is None:
            found = file.validate(CHECKS)
        self._last = nodes, found
        return found.model_copy(update={"name": self._case.name.replace("/", "-")})

    def inputs(self, chosen: tuple[int, ...]) -> tuple[Path, ...]:
        """Return the files of a camera that is refused."""
        try:
            return case_file(self._case, self._nodes(chosen), self._over).inputs
        except BadInput:
            return self._case.base.inputs

    def _nodes(self, chosen: tuple[int, ...]) -> dict[str, Node]:
        pairs = zip(self._parameters, chosen, strict=True)
        return {parameter.path: parameter.nodes[number] for parameter, number in pairs}


@dataclass(frozen=True)
class Grid:
    """All points of a study."""

    study: StudyFile
    case_parameters: tuple[Parameter, ...]
    """The parameters of all cases together, each as the first case has it."""
    averaged_parameters: tuple[Parameter, ...]
    """What is averaged over."""
    cases: dict[str, StudyCase]
    """Name -> case."""
    points: tuple[Point, ...]
    inputs: tuple[Path, ...]
    """Every file that was read, or will be."""

    @property
    def hash(self) -> str:
        """The hash of all that the study's tables and figures show, wherever its files lie."""
        model = self.study.model.model_dump(mode="json", exclude={"camera"})
        return hash_text(to_json([model, [point.id for point in self.points]]))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """What is wrong with cameras of the study, each mistake once."""
        return tuple(dict.fromkeys(p for point in self.points for p in point.problems))


def grid(
    study: StudyFile,
    sets: Sequence[str] = (),
    folder: Path | None = None,
    device: str = "cpu",
) -> Grid:
    """Return the points of a study, with `--set` overrides laid over every camera.

    Raises BadInput where a path names nothing, and where no point at all has a valid camera.
    Cameras that are refused are points with `problems`.
    """
    over = cameras.overlay(sets, folder or current_folder())
    repeated = study.averaged_parameters()
    cases = {case.name: case for case in study.cases()}
    _refuse_sets(sets, {*repeated, *(path for case in cases.values() for path in case.parameters)})
    _refuse_too_many(study.model, repeated, [case.parameters for case in cases.values()])
    points: list[Point] = []
    for case in cases.values():
        points += _points(study.model, case, over, repeated, device)
    found = Grid(
        study=study,
        case_parameters=tuple(
            _parameters_by_path(case.parameters for case in cases.values()).values()
        ),
        averaged_parameters=tuple(repeated.values()),
        cases=cases,
        points=tuple(points),
        inputs=_inputs(study, points),
    )
    nameless = [p for p in found.problems if p.message.startswith(NO_SUCH_KEY)]
    if nameless:
        raise BadInput(nameless)
    if not any(point.id for point in points):
        raise BadInput(found.problems)
    return found


def _parameters_by_path(parameters: Iterable[dict[str, Parameter]]) -> dict[str, Parameter]:
    """Return the parameters of all cases together, each as the first case has it."""
    out: dict[str, Parameter] = {}
    for own in parameters:
        out |= {path: parameter for path, parameter in own.items() if path not in out}
    return out


def _refuse_sets(sets: Sequence[str], grid_paths: Collection[str]) -> None:
    """Refuse overrides that would make a column of the table untrue. Raises BadInput."""
    problems = []
    for item in sets:
        path = item.partition("=")[0].strip()
        for other in grid_paths:
            if overlap(path, other):
                message = f"the study varies {other}"
                problems.append(Problem(split(path), message, "set another key", "--set"))
    if problems:
        raise BadInput(problems)


def _refuse_too_many(
    model: Sweep, repeated: dict[str, Any], cases: list[dict[str, Parameter]]
) -> None:
    each = model.seeds
    for parameter in repeated.values():
        each *= len(parameter.nodes)
    total = 0
    for varied in cases:
        count = each
        for parameter in varied.values():
            count *= len(parameter.nodes)
        total += count
    if total > MOST_POINTS:
        message = f"the study has {total} points, more than {MOST_POINTS}"
        raise BadInput([Problem((), message, "vary less, or split it into several")])


def _points(
    model: Sweep, case: StudyCase, over: Node, repeated: dict[str, Parameter], device: str
) -> Iterator[Point]:
    """Yield the points of a case, in their order."""
    parameters = [*case.parameters.values(), *repeated.values()]
    made, forms = CaseCameras(case, over, parameters), _Forms()
    files: dict[tuple[Path, ...], tuple[Path, ...]] = {}
    for chosen in itertools.product(*(range(len(p.nodes)) for p in parameters)):
        cells = {p.path: p.cells[i] for p, i in zip(parameters, chosen, strict=True)}
        own = {path: cells[path] for path in case.parameters}
        here = Point(case.name, own, {path: cells[path] for path in repeated}, None, "")
        try:
            camera = made.camera(chosen)
            _require_metrics(camera, model)
        except BadInput as error:
            refused = replace(here, problems=error.problems, inputs=made.inputs(chosen))
            yield from itertools.repeat(refused, model.seeds)
            continue
        if camera.files not in files:
            files[camera.files] = (*camera.files, *provenance.data_files(camera))
        here = replace(
            here,
            content=_content(camera, forms.of(camera), model, device),
            light=hash_text(light_key(camera)),
            effects=_shared_names(tuple(wanted_effects(camera))),
            inputs=files[camera.files],
        )
        for i in range(model.seeds):
            seed = camera.seed.frame + i
            point = hash_text(f"{here.content} {seed}")[:32]
            yield replace(here, seed=seed, id=point, made=(made, chosen, i))


@cache
def _shared_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return one tuple for all that are equal: a sweep has millions of them."""
    return names


def _require_metrics(camera: Camera, model: Sweep) -> None:
    """Raise BadInput where a camera does not measure a metric of the study."""
    measures = camera.quality, camera.has_edge, camera.exposure.has_samples
    found = [(name, unmeasured(name, *measures)) for name in model.metrics]
    problems = [
        Problem(("metrics",), f"this camera does not measure {name}", remedy)
        for name, remedy in found
        if remedy is not None
    ]
    if problems:
        raise BadInput(problems)


def case_file(case: StudyCase, nodes: Mapping[str, Node], over: Node) -> Document[Camera]:
    """Return the camera file of a case with values by path, overrides laid over all of it."""
    tree = Node({}, Source("", case.base.file.parent))
    for path, node in nodes.items():
        tree = merge(tree, tree_at(split(path), node))
    return case.base.overlay(tree).overlay(over)


def with_next_seed(camera: Camera, number: int) -> Camera:
    """Return a camera with its frame seed raised by `number`."""
    seed = Seed(sensor=camera.seed.sensor, frame=camera.seed.frame + number)
    return camera.model_copy(update={"seed": seed})


class _Forms:
    """Writes cameras in their YAML form.

    Sections that are the same objects as those of the camera before are not written again: that
    takes two thirds of the time of a point's hash.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[object, dict[str, Any]]] = {}

    def of(self, camera: Camera) -> dict[str, Any]:
        """Return the YAML form of a camera."""
        form: dict[str, Any] = {}
        for name in type(camera).model_fields:
            section = getattr(camera, name)
            if name not in self._last or self._last[name][0] is not section:
                self._last[name] = section, camera.model_dump(mode="json", include={name})
            form |= self._last[name][1]
        return form


def _content(camera: Camera, form: dict[str, Any], model: Sweep, device: str) -> str:
    """Return the hash of all that a point's numbers depend on, but for the seed of its frame.

    form: the camera's YAML form.
    """
    for name in ("name", "quality", "expect", *(() if model.keep else ("output",))):
        form.pop(name, None)
    form["seed"] = form["seed"]["sensor"]
    asked = {"metrics": sorted(model.metrics), "keep": sorted(model.keep)}
    return hash_of(camera, form, asked | ({} if device == "cpu" else {"device": device}))


def hash_of(camera: Camera, form: dict[str, Any], asked: dict[str, Any]) -> str:
    """Return the hash of what is computed of a camera, wherever its files lie.

    form: what counts of its YAML form; asked: what is computed, by keys of its own.
    """
    whole = asked | {
        "camera": _embed_files(form),
        "files": sorted(_digest(path) for path in provenance.data_files(camera, form)),
        "versions": {name: _versions()[name] for name in LIBRARIES},
        **step_plugins.code(camera.processing),
    }
    return hash_text(json.dumps(whole, sort_keys=True))


def _embed_files(form: Any) -> Any:
    """Return a camera's YAML form with what files hold in place of where they lie."""
    if isinstance(form, dict):
        return {
            key: [_digest(Path(item)), Path(item).suffix.lower()]
            if names_file(FILE_KEYS, key, form.get("kind")) and isinstance(item, str)
            else _embed_files(item)
            for key, item in form.items()
        }
    return [_embed_files(item) for item in form] if isinstance(form, list) else form


def _digest(path: Path) -> str:
    """Return the hash of a file, computed once as long as it does not change."""
    status = path.stat()
    return _digest_of(str(path), status.st_mtime_ns, status.st_size, status.st_ino)


@cache
def _digest_of(path: str, changed: int, size: int, node: int) -> str:
    return hash_file(path)


@cache
def _versions() -> dict[str, str]:
    return provenance.versions()


def _inputs(study: StudyFile, points: Sequence[Point]) -> tuple[Path, ...]:
    found = {point.inputs for point in points}
    return tuple(sorted({study.file}.union(*found)))
