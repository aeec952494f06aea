"""A file of a schedule study: read with its places, overridden, checked, its tables read.

Its pdf may take a camera to simulate: that camera is loaded here, with all its mistakes told, and
brought its light only when the study runs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from vcam_cli import errors
from vcam_cli.camera import explain
from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.merge import merge
from vcam_cli.camera.parts import existing, locate
from vcam_cli.camera.pdf_source import MOST_PHOTOCURRENT, PdfSource
from vcam_cli.camera.schedule_study import ScheduleStudy
from vcam_cli.camera.yaml_tree import Node, read_file, shown
from vcam_cli.errors import BadInput, Problem
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.spectra.text import numbers_of, read_table
from vcam_cli.studies import checks, provenance
from vcam_cli.studies.study_file import refuse_others

HISTOGRAM, LEVELS = ("low", "high", "count"), ("level", "count")
"""Columns of the tables."""
MOST_LEVELS = 1 << 20
PDF = "pdf"
T = TypeVar("T")
_Read = tuple[tuple[Path, ...], Pdf | None, Camera | None, float]


@dataclass(frozen=True)
class ScheduleFile:
    """A schedule study as it was written, and what it means."""

    file: Path
    tree: Node
    model: ScheduleStudy
    known: Pdf | None
    """The photocurrents; None where a camera has to be simulated for them."""
    camera: Camera | None
    """Of the pdf."""
    pictured: Camera | None
    """That takes the pictures of `frames`."""
    pixels: float
    """That the photocurrents are counted of; 0 where they are not."""
    inputs: tuple[Path, ...]
    """Every file that was read, or will be."""

    @cached_property
    def places(self) -> dict[errors.Path, str]:
        return cameras.places(self.tree)

    def locate(self, path: errors.Path) -> str:
        """Where a key of the study stands, "study.yaml:5:3"."""
        return cameras.Origin(self.file, (), self.tree).locate(path)

    def wrong(self, path: errors.Path | str, message: str, remedy: str) -> BadInput:
        """The error about a key of this study."""
        return errors.bad(path, message, remedy).located(self.locate)


def read(
    study: str | Path,
    sets: Sequence[str] = (),
    accuracy: str | None = None,
    folder: Path | None = None,
) -> ScheduleFile:
    """A schedule study's file, or a shipped one's name, with overrides "PATH=VALUE" laid over it.

    accuracy: of the camera that its pdf may name; default the camera's. Raises BadInput with
    everything wrong, CannotDo.
    """
    start = folder or cameras.current_folder()
    file = cameras.find(study, start, "studies")
    tree = read_file(file)
    if tree.mapping is None:
        message, remedy = "a mapping is needed here", "write lines of `key: value`"
        raise BadInput([tree.problem((), message, remedy)])
    refuse_others(tree, "schedule")
    tree = merge(tree, cameras.overlay(sets, start))
    model = _validated(file, tree)
    given = _Sources(file, tree, model)
    files, known, camera, pixels = given.read(accuracy)
    pictured = given.pictured(accuracy, camera)
    if pictured is not None:
        files = (*files, *pictured.files, *provenance.data_files(pictured))
    inputs = tuple(dict.fromkeys((file, *files)))
    return ScheduleFile(file, tree, model, known, camera, pictured, pixels, inputs)


def _validated(file: Path, tree: Node) -> ScheduleStudy:
    value = tree.plain()
    assert isinstance(value, dict)
    if "name" not in value:
        value["name"] = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem)[:64] or "schedule"
    try:
        return ScheduleStudy.model_validate(value)
    except ValidationError as error:
        unnamed = explain.problems(error, ScheduleStudy, value)
        located = BadInput(unnamed).located(cameras.Origin(file, (file,), tree).locate).problems
        raise BadInput(sorted(located, key=cameras.by_place)) from None


@dataclass(frozen=True)
class _Sources:
    """Reads the pdf of a study, wherever it comes from."""

    file: Path
    tree: Node
    model: ScheduleStudy

    def read(self, accuracy: str | None) -> _Read:
        """Files that were read, the pdf, the camera in its place, pixels. Raises BadInput."""
        source: PdfSource = self.model.pdf
        if source.camera is not None:
            camera = self._camera(accuracy)
            files = (*camera.files, *provenance.data_files(camera))
            return tuple(dict.fromkeys(files)), None, camera, 0.0
        if source.uniform is not None:
            return (), self._made(Pdf.uniform, source.uniform.min, source.uniform.max), None, 0.0
        if source.segments is not None:
            ends = [
                [getattr(segment, name) for segment in source.segments]
                for name in ("min", "max", "probability")
            ]
            return (), self._made(Pdf.segments, *ends), None, 0.0
        table, columns_, make = (
            (source.histogram, HISTOGRAM, Pdf.segments)
            if source.histogram is not None
            else (source.levels, LEVELS, Pdf.levels)
        )
        assert table is not None
        path = self._named(table.file)
        columns = self._made(read_columns, Path(shown(path)), columns_)
        return (path,), self._made(make, *columns), None, float(columns[-1].sum())

    @property
    def _kind(self) -> str:
        return self.model.pdf.kind

    def _node(self, *keys: str) -> Node:
        found: Node | None = self.tree
        for name in keys:
            found = found.get(name) if found is not None else None
        assert found is not None
        return found

    def pictured(self, accuracy: str | None, of_pdf: Camera | None) -> Camera | None:
        """The camera that takes the pictures, where any are asked for."""
        asked = self.model.frames
        if asked is None or asked.camera is None:
            return None if asked is None else of_pdf
        return self._camera(accuracy, "frames")

    def _camera(self, accuracy: str | None, key: str = PDF) -> Camera:
        node = self._node(key, "camera")
        try:
            file = locate(node, "cameras")
        except BadInput as error:
            raise BadInput(
                replace(p, path=(key, "camera"), where=p.where or node.where)
                for p in error.problems
            ) from None
        return checks.load(file, [f"accuracy={accuracy}"] if accuracy else [])

    def _named(self, text: str) -> Path:
        node = self._node(PDF, self._kind, "file")
        try:
            return existing(node.source.folder / text, text)
        except BadInput as error:
            raise self._wrong(str(error.problems[0].message), error.problems[0].remedy) from None

    def _made(self, make: Callable[..., T], *columns: Any) -> T:
        """What `make` gives; what is wrong with it is an error about the place of the pdf."""
        try:
            return make(*columns)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise self._wrong(message, remedy) from None
        except OSError as error:
            message = f"{error.filename} cannot be read: {error.strerror}"
            raise self._wrong(message, "check the file") from None

    def _wrong(self, message: str, remedy: str) -> BadInput:
        path: errors.Path = (PDF, self._kind)
        if self.model.pdf.histogram is not None or self.model.pdf.levels is not None:
            path = (*path, "file")
        where = cameras.Origin(self.file, (), self.tree).locate(path)
        return BadInput([Problem(path, message, remedy, where)])


def read_columns(file: Path, columns: tuple[str, ...]) -> list[NDArray]:
    """The numbers of a histogram or of levels, column by column.

    Raises ValueError, with file, line and remedy, for anything that is no such table.
    """
    header, rows = read_table(file, MOST_LEVELS)
    wanted = ",".join(columns)
    if tuple(header) != columns:
        raise ValueError(f"{file}: the header is {','.join(header)!r}; write {wanted}")
    if not rows:
        raise ValueError(f"{file}: has no rows below its header; write rows of {wanted}")
    lines = [line for line, _ in rows]
    values = np.array([numbers_of(file, line, cells) for line, cells in rows]).T
    for mistake, message, remedy in _mistakes(values, columns):
        if mistake.any():
            row = int(np.argmax(mistake))
            cells = ",".join(f"{v:g}" for v in values[:, row])
            raise ValueError(f"{file}:{lines[row]}: {cells!r}: {message}; {remedy}")
    return list(values)


def _mistakes(
    values: NDArray, columns: tuple[str, ...]
) -> list[tuple[NDArray[np.bool_], str, str]]:
    """(rows, ) where a table is wrong, what is wrong, and what to do, of each possible mistake."""
    counts, light = values[-1], values[:-1]
    lit = np.where(light > 0, light, MOST_PHOTOCURRENT).min(axis=0)
    found = [
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
        found += [
            (high <= low, "high is not above low", "give every bin a width"),
            (behind, "begins below the end of the bin before it", "let bins ascend, none overlap"),
        ]
    return found
