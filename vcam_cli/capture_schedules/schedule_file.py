"""A file of a schedule study: read with its places, overridden, checked, its tables read.

Its pdf may take a camera to simulate: that camera is loaded here, so that all its mistakes are
reported at once, and its light is simulated only when the study runs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from vcam_cli import errors
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.capture_schedules import pdf_scale
from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.capture_schedules.pdf_source import MOST_PHOTOCURRENT, PdfSource
from vcam_cli.config import validation_messages
from vcam_cli.config.document import given_at, place_order
from vcam_cli.config.file_names import argument_file, current_folder, existing_file, referenced_file
from vcam_cli.config.merge import Alternatives, MergeRules
from vcam_cli.config.study_overrides import lay_over, split_sets
from vcam_cli.config.yaml_reader import display_path, read_file
from vcam_cli.config.yaml_tree import Node, Origin
from vcam_cli.errors import BadInput, Problem
from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.simulation import checks
from vcam_cli.simulation.output import provenance
from vcam_cli.spectra.text import parse_numbers, read_table
from vcam_cli.sweeps import study_hints
from vcam_cli.sweeps.sweep_file import refuse_others

HISTOGRAM, LEVELS = ("low", "high", "count"), ("level", "count")
"""Columns of the tables."""
MOST_LEVELS = 1 << 20
PDF = "pdf"
MERGE_RULES = MergeRules(
    alternatives=(
        Alternatives.parse("uniform | segments | histogram | levels | camera bins", path=(PDF,)),
    )
)
T = TypeVar("T")
_PdfInputs = tuple[tuple[Path, ...], Pdf | None, Camera | None, float]
"""Files that were read, the pdf, the camera in its place, the pixels that the pdf counts."""


@dataclass(frozen=True)
class ScheduleFile:
    """A schedule study as it was written, and what it means.

    Parameters
    ----------
    file : Path
        The study's file.
    tree : Node
        Its content with the place of every key, overrides included.
    model : ScheduleStudy
        The checked content.
    known : Pdf or None
        The photocurrents; None where a camera has to be simulated for them.
    camera : Camera or None
        The camera of the pdf.
    frames_camera : Camera or None
        The camera that takes the pictures of `frames`.
    pixels : float
        Number of pixels that the pdf counts; 0 where it counts none.
    inputs : tuple of Path
        Every file that was read, or will be.
    """

    file: Path
    tree: Node
    model: ScheduleStudy
    known: Pdf | None
    camera: Camera | None
    frames_camera: Camera | None
    pixels: float
    inputs: tuple[Path, ...]

    def locate(self, path: errors.Path) -> str:
        """Return where a key of the study stands, as in "study.yaml:5:3"."""
        return Origin(self.file, (), self.tree).locate(path)

    def error(self, path: errors.Path | str, message: str, remedy: str) -> BadInput:
        """Return the error about a key of this study."""
        return errors.bad(path, message, remedy).with_places(self.locate)


def read(
    study: str | Path,
    sets: Sequence[str] = (),
    accuracy: str | None = None,
    folder: Path | None = None,
) -> ScheduleFile:
    """Read a schedule study, its tables and its cameras.

    Parameters
    ----------
    study : str or Path
        The study's file, or the name of a shipped one.
    sets : sequence of str
        Overrides "PATH=VALUE" of the study, and of its cameras where PATH begins with no key of a
        study.
    accuracy : str, optional
        Accuracy of the cameras that it names; by default their own.
    folder : Path, optional
        Where relative paths begin; by default the current folder.

    Raises
    ------
    BadInput
        With everything that is wrong.
    CannotDo
        If a file cannot be read.
    """
    start = folder or current_folder()
    file = argument_file(study, start, "studies")
    tree = read_file(file)
    if tree.mapping is None:
        message, remedy = "a mapping is needed here", "write lines of `key: value`"
        raise BadInput([tree.problem((), message, remedy)])
    refuse_others(tree, "schedule")
    own, others = split_sets(sets, ScheduleStudy.model_fields)
    if others and not _names_camera(lay_over(tree, own, start, MERGE_RULES)):
        own, others = tuple(sets), ()  # what is no key of the study is said
    tree = lay_over(tree, own, start, MERGE_RULES)
    model = _validate(file, tree)
    reader = _SourceReader(file, tree, model)
    over = [*others, *([f"accuracy={accuracy}"] if accuracy else [])]
    files, known, camera, pixels = reader.read_pdf(over)
    known = None if known is None else reader.scale(known)
    frames_camera = reader.read_frames_camera(over, camera)
    if frames_camera is not None:
        files = (*files, *frames_camera.files, *provenance.data_files(frames_camera))
    inputs = tuple(dict.fromkeys((file, *files)))
    return ScheduleFile(file, tree, model, known, camera, frames_camera, pixels, inputs)


def _names_camera(tree: Node) -> bool:
    """Return whether a study takes its photocurrents or its frames from a camera."""
    sections = (tree.get(PDF), tree.get("frames"))
    return any(section is not None and section.get("camera") is not None for section in sections)


def _validate(file: Path, tree: Node) -> ScheduleStudy:
    value = tree.plain()
    assert isinstance(value, dict)
    if "name" not in value:
        value["name"] = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem)[:64] or "schedule"
    try:
        return ScheduleStudy.model_validate(value)
    except ValidationError as error:
        bare = validation_messages.problems(error)
        unnamed = [study_hints.advise(p, given_at(tree, p.path)) for p in bare]
        located = BadInput(unnamed).with_places(Origin(file, (file,), tree).locate).problems
        raise BadInput(sorted(located, key=place_order)) from None


@dataclass(frozen=True)
class _SourceReader:
    """Reads what a study names: its pdf, wherever it comes from, and its cameras."""

    file: Path
    tree: Node
    model: ScheduleStudy

    def read_pdf(self, over: Sequence[str]) -> _PdfInputs:
        """Read the pdf, or the camera to simulate for it, with overrides."""
        source: PdfSource = self.model.pdf
        if source.camera is not None:
            camera = self._camera(over)
            files = (*camera.files, *provenance.data_files(camera))
            return tuple(dict.fromkeys(files)), None, camera, 0.0
        if source.uniform is not None:
            ends = source.uniform.min, source.uniform.max
            return (), self._convert(Pdf.uniform, *ends), None, 0.0
        if source.segments is not None:
            values = [
                [getattr(segment, name) for segment in source.segments]
                for name in ("min", "max", "probability")
            ]
            return (), self._convert(Pdf.segments, *values), None, 0.0
        table, names, convert = (
            (source.histogram, HISTOGRAM, Pdf.segments)
            if source.histogram is not None
            else (source.levels, LEVELS, Pdf.levels)
        )
        assert table is not None
        path = self._table_path(table.file)
        columns = self._convert(read_columns, Path(display_path(path)), names)
        return (path,), self._convert(convert, *columns), None, float(columns[-1].sum())

    def scale(self, pdf: Pdf) -> Pdf:
        """Return the pdf in e/s where there is a sensor. Raises BadInput for arbitrary units."""
        wrong = pdf_scale.mistake(pdf, self.model)
        if wrong is not None:
            raise self._error(*wrong)
        return pdf_scale.scaled(pdf, self.model)

    @property
    def _kind(self) -> str:
        return self.model.pdf.kind

    def _node(self, *keys: str) -> Node:
        node: Node | None = self.tree
        for name in keys:
            node = node.get(name) if node is not None else None
        assert node is not None
        return node

    def read_frames_camera(self, over: Sequence[str], pdf_camera: Camera | None) -> Camera | None:
        """Read the camera that takes the pictures, where the study requests any."""
        frames = self.model.frames
        if frames is None or frames.camera is None:
            return None if frames is None else pdf_camera
        return self._camera(over, "frames")

    def _camera(self, over: Sequence[str], key: str = PDF) -> Camera:
        node = self._node(key, "camera")
        try:
            file = referenced_file(node, "cameras")
        except BadInput as error:
            raise BadInput(
                replace(p, path=(key, "camera"), where=p.where or node.where)
                for p in error.problems
            ) from None
        return checks.load(file, over)

    def _table_path(self, text: str) -> Path:
        node = self._node(PDF, self._kind, "file")
        try:
            return existing_file(node.source.folder / text, text)
        except BadInput as error:
            raise self._error(str(error.problems[0].message), error.problems[0].remedy) from None

    def _convert(self, convert: Callable[..., T], *columns: Any) -> T:
        """Call a converter; turn its errors into ones about the place of the pdf."""
        try:
            return convert(*columns)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise self._error(message, remedy) from None
        except OSError as error:
            message = f"{error.filename} cannot be read: {error.strerror}"
            raise self._error(message, "check the file") from None

    def _error(self, message: str, remedy: str) -> BadInput:
        path: errors.Path = (PDF, self._kind)
        if self.model.pdf.histogram is not None or self.model.pdf.levels is not None:
            path = (*path, "file")
        where = Origin(self.file, (), self.tree).locate(path)
        return BadInput([Problem(path, message, remedy, where)])


def read_columns(file: Path, columns: tuple[str, ...]) -> list[Array]:
    """Read the numbers of a histogram or of levels, column by column.

    Raises
    ------
    ValueError
        With file, line and remedy, for anything that is no such table.
    """
    header, rows = read_table(file, MOST_LEVELS)
    wanted = ",".join(columns)
    if tuple(header) != columns:
        raise ValueError(f"{file}: the header is {','.join(header)!r}; write {wanted}")
    if not rows:
        raise ValueError(f"{file}: has no rows below its header; write rows of {wanted}")
    lines = [line for line, _ in rows]
    values = np.array([parse_numbers(file, line, cells) for line, cells in rows]).T
    for mistake, message, remedy in _table_mistakes(values, columns):
        if mistake.any():
            row = int(np.argmax(mistake))
            cells = ",".join(f"{v:g}" for v in values[:, row])
            raise ValueError(f"{file}:{lines[row]}: {cells!r}: {message}; {remedy}")
    return list(values)


def _table_mistakes(
    values: Array, columns: tuple[str, ...]
) -> list[tuple[NDArray[np.bool_], str, str]]:
    """Return each possible mistake of a table: (rows,) where it is, what it is, what to do."""
    counts, light = values[-1], values[:-1]
    lit = np.where(light > 0, light, MOST_PHOTOCURRENT).min(axis=0)
    mistakes = [
        (values[0] < 0, f"a {columns[0]} is negative", "photocurrents are 0 or more"),
        (
            light.max(axis=0) > MOST_PHOTOCURRENT,
            f"a photocurrent is above {MOST_PHOTOCURRENT:g}",
            "write it in a larger unit",
        ),
        (
            lit < 1 / MOST_PHOTOCURRENT,
            f"a photocurrent is below {1 / MOST_PHOTOCURRENT:g}",
            "write 0, or use a smaller unit",
        ),
        (counts < 0, "a count is negative", "counts are 0 or more"),
        (np.full(len(counts), not counts.any()), "all counts are zero", "give one that is not"),
    ]
    if columns == HISTOGRAM:
        low, high = values[0], values[1]
        before = np.concatenate([[-np.inf], high[:-1]])
        behind = low < before
        mistakes += [
            (high <= low, "high is not above low", "give every bin a width"),
            (behind, "begins below the end of the bin before it", "let bins ascend, none overlap"),
        ]
    return mistakes
