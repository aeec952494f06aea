"""From a study to its points: every camera resolved and checked before anything runs.

The order is that of points.csv: cases, then the grid (the last parameter fastest), then what is
repeated, then seeds.

A point is known by the hash of all that its numbers depend on: the resolved camera with what its
files hold, what is measured, and the versions of what computes. How the study calls a point, and
where files lie, is not in it: two machines agree, and a study that is extended keeps what it has.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.explain import NO_SUCH_KEY
from vcam_cli.camera.load import FILE_KEYS, Base, nested
from vcam_cli.camera.merge import merge
from vcam_cli.camera.settings import Seed
from vcam_cli.camera.study import Sweep
from vcam_cli.camera.yaml_tree import Node, Source
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.files.report import hash_file, hash_text
from vcam_cli.studies import provenance
from vcam_cli.studies.cases import cases_of
from vcam_cli.studies.checks import CHECKS
from vcam_cli.studies.study_file import Cell, Parameter, StudyFile

MOST_POINTS = 1_000_000
LIBRARIES = ("vcam", "numpy", "scipy", "OpenImageIO")
"""Whose versions decide a point's numbers."""


@dataclass(frozen=True)
class Point:
    """One frame of the study."""

    case: str
    varied: dict[str, Cell]
    """Path -> its value here."""
    repeated: dict[str, Cell]
    seed: int | None
    """Of the frame; None where the camera is refused."""
    camera: Camera | None
    id: str
    """Its hash; "" where the camera is refused."""
    content: str = ""
    """The same for all seeds of a camera: the hash of all but the seed."""
    problems: tuple[Problem, ...] = ()
    """Why the camera is refused."""
    inputs: tuple[Path, ...] = ()
    """The files of a camera that is refused."""

    @property
    def label(self) -> str:
        """What distinguishes it, for messages."""
        named = [f"{path} = {cell}" for path, cell in (self.varied | self.repeated).items()]
        return ", ".join([f"case {self.case}", *named, f"seed {self.seed}"])


@dataclass(frozen=True)
class Grid:
    """All points of a study."""

    study: StudyFile
    varied: tuple[Parameter, ...]
    """Of all cases together, each as it was first met."""
    repeated: tuple[Parameter, ...]
    cases: dict[str, dict[str, Parameter]]
    """Case -> what is varied in it, by path."""
    points: tuple[Point, ...]
    inputs: tuple[Path, ...]
    """Every file that was read, or will be."""

    @property
    def refused(self) -> tuple[Problem, ...]:
        """What is wrong with cameras of the study, each mistake once."""
        return tuple(dict.fromkeys(p for point in self.points for p in point.problems))


def grid(study: StudyFile, sets: Sequence[str] = (), folder: Path | None = None) -> Grid:
    """The points of a study, with `--set` overrides "PATH=VALUE" laid over every camera.

    Raises BadInput where a path names nothing, and where no point at all has a valid camera.
    Cameras that are refused are points with `problems`.
    """
    over = cameras.overlay(sets, folder or cameras.current_folder())
    repeated = study.repeated()
    cases = {name: (base, case, study.varied(case)) for name, base, case in cases_of(study, over)}
    _refuse_taken(sets, {*repeated, *(p for _, _, varied in cases.values() for p in varied)})
    _refuse_too_many(study.model, repeated, [varied for _, _, varied in cases.values()])
    points: list[Point] = []
    for name, (base, _, varied) in cases.items():
        points += _points(study.model, name, base, over, varied, repeated)
    found = Grid(
        study=study,
        varied=tuple(_first_met(varied for _, _, varied in cases.values()).values()),
        repeated=tuple(repeated.values()),
        cases={name: varied for name, (_, _, varied) in cases.items()},
        points=tuple(points),
        inputs=_inputs(study, points),
    )
    nameless = [p for p in found.refused if p.message.startswith(NO_SUCH_KEY)]
    if nameless:
        raise BadInput(nameless)
    if all(point.camera is None for point in points):
        raise BadInput(found.refused)
    return found


def _first_met(parameters: Iterable[dict[str, Parameter]]) -> dict[str, Parameter]:
    out: dict[str, Parameter] = {}
    for own in parameters:
        out |= {path: parameter for path, parameter in own.items() if path not in out}
    return out


def _refuse_taken(sets: Sequence[str], grid_paths: Iterable[str]) -> None:
    """Raises BadInput where `--set` would make a column of the table untrue."""
    problems = []
    taken = [split(path) for path in grid_paths]
    for item in sets:
        path = split(item.partition("=")[0].strip())
        for other in taken:
            n = min(len(path), len(other))
            if path[:n] == other[:n]:
                message = f"the study varies {'.'.join(map(str, other))}"
                problems.append(Problem(path, message, "set another key", "--set"))
    if problems:
        raise BadInput(problems)


def _refuse_too_many(model: Sweep, repeated: dict, cases: list[dict[str, Parameter]]) -> None:
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
    model: Sweep,
    case: str,
    base: Base,
    over: Node,
    varied: dict[str, Parameter],
    repeated: dict[str, Parameter],
) -> Iterator[Point]:
    """The points of a case, in their order."""
    parameters = [*varied.values(), *repeated.values()]
    for chosen in itertools.product(*(range(len(p.nodes)) for p in parameters)):
        cells = {p.path: p.cells[i] for p, i in zip(parameters, chosen, strict=True)}
        here = Point(
            case,
            {path: cells[path] for path in varied},
            {path: cells[path] for path in repeated},
            None,
            None,
            "",
        )
        overlaid = base
        try:
            tree = Node({}, Source("", base.file.parent))
            for p, i in zip(parameters, chosen, strict=True):
                tree = merge(tree, nested(split(p.path), p.nodes[i]))
            overlaid = base.overlaid(tree).overlaid(over)
            camera = overlaid.camera(CHECKS)
            camera = camera.model_copy(update={"name": case.replace("/", "-")})
        except BadInput as error:
            refused = replace(here, problems=error.problems, inputs=overlaid.inputs)
            yield from itertools.repeat(refused, model.seeds)
            continue
        content = _content(camera, model)
        for i in range(model.seeds):
            seed = camera.seed.frame + i
            own = camera.model_copy(update={"seed": Seed(sensor=camera.seed.sensor, frame=seed)})
            point = hash_text(f"{content} {seed}")[:32]
            yield replace(here, seed=seed, camera=own, id=point, content=content)


def _content(camera: Camera, model: Sweep) -> str:
    """The hash of all that the numbers of a point depend on, but for the seed of its frame."""
    form = camera.model_dump(mode="json")
    for name in ("name", "quality") if model.keep else ("name", "quality", "output"):
        form.pop(name, None)
    form["seed"] = form["seed"]["sensor"]
    return hash_of(camera, form, {"metrics": sorted(model.metrics), "keep": sorted(model.keep)})


def hash_of(camera: Camera, form: dict[str, Any], asked: dict[str, Any]) -> str:
    """The hash of what is computed of a camera: wherever its files lie, whoever computes it.

    form: what counts of its YAML form; asked: what is computed, by keys of its own.
    """
    whole = asked | {
        "camera": _with_contents(form),
        "files": sorted(_digest(path) for path in provenance.data_files(camera, form)),
        "versions": {name: _versions()[name] for name in LIBRARIES},
    }
    return hash_text(json.dumps(whole, sort_keys=True))


def _with_contents(form: Any) -> Any:
    """A camera's YAML form with what files hold in place of where they lie."""
    if isinstance(form, dict):
        return {
            key: [_digest(Path(item)), Path(item).suffix.lower()]
            if key in FILE_KEYS and isinstance(item, str)
            else _with_contents(item)
            for key, item in form.items()
        }
    return [_with_contents(item) for item in form] if isinstance(form, list) else form


def _digest(path: Path) -> str:
    """The hash of a file, computed once as long as it does not change."""
    status = path.stat()
    return _digest_of(str(path), status.st_mtime_ns, status.st_size, status.st_ino)


@cache
def _digest_of(path: str, changed: int, size: int, node: int) -> str:
    return hash_file(path)


@cache
def _versions() -> dict[str, str]:
    return provenance.versions()


def _inputs(study: StudyFile, points: Sequence[Point]) -> tuple[Path, ...]:
    files = {study.file}
    seen: set[tuple[Path, ...]] = set()
    for point in points:
        if point.camera is None:
            files.update(point.inputs)
        elif point.camera.files not in seen:
            seen.add(point.camera.files)
            files |= {*point.camera.files, *provenance.data_files(point.camera)}
    return tuple(sorted(files))
