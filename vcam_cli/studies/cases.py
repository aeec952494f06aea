"""The cameras that a study starts from: its files, and what each case lays over them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from vcam_cli.camera import load as cameras
from vcam_cli.camera.load import Base, nested
from vcam_cli.camera.merge import merge
from vcam_cli.camera.parts import Findings, locate
from vcam_cli.camera.study import QUALITY
from vcam_cli.camera.yaml_tree import Node, Source
from vcam_cli.errors import BadInput, Problem, split
from vcam_cli.studies.study_file import StudyFile

NOMINAL = "nominal"
"""The case of a study that names none."""


def cases_of(study: StudyFile, over: Node) -> Iterator[tuple[str, Base, str | None]]:
    """Name, camera file with its overrides, and the study's name of every case."""
    model = study.model
    asked = sorted({QUALITY[m] for m in model.metrics if m in QUALITY})
    place = study.node("metrics")
    judged = nested(("quality",), replace(place, value=[replace(place, value=q) for q in asked]))
    for base in _bases(study):
        for case in model.cases or (None,):
            own = Node({}, place.source)
            for path in () if case is None else model.cases[case].overrides:
                own = merge(own, nested(split(path), study.node("cases", case or "", path)))
            name = NOMINAL if case is None else case
            if len(model.camera) > 1:
                label = _name(base)
                name = label if case is None else f"{label}/{case}"
            yield name, base.overlaid(own).overlaid(judged), case


def values_of(study: StudyFile, over: Node) -> Iterator[Base]:
    """What each word among the values of a study, and the overrides, lead to by themselves.

    Names of parts are looked up anew for every camera, so what they lead to may change with no
    change of a file.
    """
    nothing = Base(study.file, Node({}, Source("", study.file.parent)), (), Findings())
    yield nothing.overlaid(over)
    for case in (None, *study.model.cases):
        for parameter in (study.varied(case) | study.repeated()).values():
            if isinstance(parameter.cells[0], str):
                for node in parameter.nodes:
                    yield nothing.overlaid(nested(split(parameter.path), node))


def _bases(study: StudyFile) -> Iterator[Base]:
    """The study's camera files. Raises BadInput for one that is none, or two of one name."""
    node = study.node("camera")
    seen: set[str] = set()
    for item in node.value if isinstance(node.value, list) else [node]:
        try:
            base = cameras.read(locate(item, "cameras"), item.source.folder)
            name = _name(base)
            if name in seen:
                message = f"a second camera is called {name!r}"
                raise BadInput([Problem((), message, "give it another name", item.where)])
        except BadInput as error:
            places = [p if p.where else replace(p, path=("camera",)) for p in error.problems]
            where = item.where
            raise BadInput(replace(p, where=p.where or where) for p in places) from None
        seen.add(name)
        yield base


def _name(base: Base) -> str:
    node = base.tree.get("name")
    return str(node.value) if node is not None else base.file.stem
