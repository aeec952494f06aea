"""A file of a data set: read with its places, its camera and its scenes looked at."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.config import document
from vcam_cli.config.document import Document
from vcam_cli.config.file_format import FileFormat
from vcam_cli.config.file_names import current_folder, referenced_file
from vcam_cli.config.merge import NO_RULES
from vcam_cli.config.study_overrides import lay_over, split_sets
from vcam_cli.config.yaml_tree import Node, Source, node_of, tree_at
from vcam_cli.datasets.drawing import Frame, Scene, crop_size, draw_frame, extremes
from vcam_cli.datasets.model import Dataset
from vcam_cli.errors import BadInput, Collector, Problem
from vcam_cli.files.images.images import picture_size
from vcam_cli.floats import own_float_errors
from vcam_cli.records import dataclass
from vcam_cli.simulation.checks import CHECKS
from vcam_cli.sweeps.model import KINDS

FILES = ("scenes", "files")


def _refuse_others(root: Node) -> None:
    """Raise BadInput where the file is no data set."""
    kind = root.get("kind")
    if kind is not None and kind.value in KINDS:
        message, remedy = f"this is a study (kind: {kind.value})", f"give it to vcam {kind.value}"
        raise BadInput([kind.problem(("kind",), message, remedy)])
    if kind is None or kind.value != "dataset":
        message, remedy = "this is no data set", "write kind: dataset, or give another file"
        raise BadInput([(kind or root).problem(("kind",), message, remedy)])


FORMAT = FileFormat(model=Dataset, kind="studies", refuse=_refuse_others)
KEPT_FRAMES = 1 << 12
"""Drawn frames that are kept, 4 MB: work needs each when it is divided, done and listed."""


@dataclass(frozen=True)
class DatasetFile:
    """A data set as it was written, and what it means."""

    model: Dataset
    base: Document[Camera]
    """The camera file with size and overrides."""
    scenes: tuple[Scene, ...]
    inputs: tuple[Path, ...]
    """Every file that was read, or will be."""

    @cached_property
    def camera(self) -> Camera:
        """The camera before anything is drawn."""
        return self.base.validate(CHECKS)

    def frame(self, number: int) -> Frame:
        """Return a frame, by its number from 0."""
        drawn = self._drawn
        if number not in drawn:
            if len(drawn) >= KEPT_FRAMES:
                drawn.clear()
            drawn[number] = draw_frame(self.model, self.scenes, number)
        return drawn[number]

    @cached_property
    def _drawn(self) -> dict[int, Frame]:
        return {}

    def cameras(self) -> Iterator[Camera]:
        """Yield cameras with each end of what is drawn. Raises BadInput with all mistakes."""
        tree = _tree(self.model).get("vary") or Node({}, Source("", Path()))
        places = {str(path): node for path, node in (tree.mapping or {}).items()}
        problems = Collector()
        first = self.frame(0)
        for _, frame in (("", first), *extremes(self.model, first)):
            try:
                yield frame.camera(self.base, places)
            except BadInput as error:
                problems.extend(error)
        if problems.problems:
            raise BadInput(dict.fromkeys(problems.problems))


@own_float_errors
def read(
    study: str | Path,
    sets: Sequence[str] = (),
    seed: int | None = None,
    accuracy: str | None = None,
    folder: Path | None = None,
) -> DatasetFile:
    """Return a data set with its camera and scenes, all of it checked.

    sets: overrides "PATH=VALUE" of the file, and of the camera where PATH begins with no key of a
    data set; seed: in place of the file's. Raises BadInput with
    what is wrong, CannotDo.
    """
    start = folder or current_folder()
    own, sets = split_sets(sets, Dataset.model_fields)
    written = document.read(study, start, FORMAT)
    model = replace(written, tree=lay_over(written.tree, own, start, NO_RULES)).validate()
    if seed is not None:
        model = model.model_copy(update={"seed": seed})
    words = [*sets, *([f"accuracy={accuracy}"] if accuracy else [])]
    base = _camera_file(model, start).overlay(_size(model)).overlay(cameras.overlay(words, start))
    scenes = tuple(_scenes(model))
    pictures = sorted({scene.file for scene in scenes if scene.file is not None})
    inputs = tuple(dict.fromkeys((*model.files, *base.inputs, *pictures)))
    found = DatasetFile(model, base, scenes, inputs)
    for camera in found.cameras():
        _check_camera(model, camera)
    return found


def _tree(model: Dataset) -> Node:
    origin = model.source_tree
    assert origin is not None
    return origin.tree


def _node(model: Dataset, *path: str) -> Node:
    node: Node | None = _tree(model)
    for key in path:
        node = node.get(key) if node is not None else None
    assert node is not None
    return node


def _problem(model: Dataset, path: tuple[str, ...], message: str, remedy: str) -> Problem:
    return Problem(path, message, remedy, model.locate(path))


def _check_camera(model: Dataset, camera: Camera) -> None:
    """Refuse a camera whose frames have no rows and columns, or take several samples."""
    if camera.array.is_scattered:
        message = "its pixels are not on a grid of rows and columns"
        raise BadInput([_problem(model, ("camera",), message, "take another pattern")])
    if camera.exposure.has_samples:
        message = "it has several samples of one integration, or a bracket"
        raise BadInput([_problem(model, ("camera",), message, "give exposure.time")])
    if "depth" in model.write and camera.scene.moves:
        message = "the scene moves, so its depth is not unique"
        raise BadInput([_problem(model, ("write",), message, "leave depth out")])


def _camera_file(model: Dataset, start: Path) -> Document[Camera]:
    node = _node(model, "camera")
    try:
        return cameras.read(referenced_file(node, "cameras"), start)
    except BadInput as error:
        where = node.where
        raise BadInput(
            p if p.where else replace(p, path=("camera",), where=where) for p in error.problems
        ) from None


def _size(model: Dataset) -> Node:
    """Return the tree of the array's size; nothing where that is the camera's."""
    source = Source("size", Path(), lines=False)
    if model.size is None:
        return Node({}, source)
    size = {"rows": model.size.rows, "columns": model.size.columns}
    return tree_at(("array",), node_of(size, source))


def _scenes(model: Dataset) -> Iterator[Scene]:
    """Yield what the frames may show; nothing where that is the camera's own scene."""
    if model.scenes is None:
        return
    key = ("scenes", "charts") if model.scenes.charts else FILES
    place = Source(model.locate(key), _tree(model).source.folder, lines=False)
    for chart in model.scenes.charts:
        source = chart if not isinstance(chart, str) else {"kind": "chart", "chart": chart}
        name = str(source.get("chart", source.get("kind", "")))
        yield Scene(name, dict(source), place=place)
    problems: list[Problem] = []
    refuse = partial(_problem, model, FILES)
    folder = _node(model, *FILES).source.folder if model.scenes.files else Path()
    for pattern in model.scenes.files:
        names = sorted(glob.glob(str(folder / pattern), recursive=True))
        if not names:
            problems.append(refuse(f"no files in {folder} are {pattern}", "correct the pattern"))
        for name in names:
            try:
                yield replace(_picture(model, Path(name).absolute()), place=place)
            except BadInput as error:
                problems += [refuse(p.message, p.remedy) for p in error.problems]
    if problems:
        raise BadInput(problems)


def _picture(model: Dataset, file: Path) -> Scene:
    """Return a picture, which must be as large as a crop. Raises BadInput."""
    size, crop = picture_size(file, FILES), crop_size(model)
    if crop[0] > size[0] or crop[1] > size[1]:
        message = f"{file.name} has {size[0]} x {size[1]} samples, a crop {crop[0]} x {crop[1]}"
        remedy = "give larger pictures, or a smaller size or samples_per_pixel"
        raise BadInput([Problem((), message, remedy)])
    return Scene(file.name, {"kind": "image", "file": str(file)}, file, size)
