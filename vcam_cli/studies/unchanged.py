"""A sweep that is finished: where nothing has changed since, its findings are read, not made again.

What was asked, each file that was read and each that was written are compared by their hashes, as
`make` would by their times. A sweep says what was asked only where another run would find nothing
to do: no point or figure missing, none that might end otherwise tomorrow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from vcam_cli.camera import load as cameras
from vcam_cli.camera.load import Base
from vcam_cli.errors import CannotDo
from vcam_cli.files.folder import record_of
from vcam_cli.files.hyperspectral import companions
from vcam_cli.files.points import RECORD, SweepFolder, record_check
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.studies import cases, provenance, sweep_result
from vcam_cli.studies.outcome import FRAMES
from vcam_cli.studies.study_file import StudyFile
from vcam_cli.studies.sweep_result import SweepResult


def asked(study: StudyFile, sets: Sequence[str], folder: Path | None = None) -> str:
    """The hash of what is asked, but for the contents of the files that it names.

    sets, folder: as for `sweep_points.grid`. Raises BadInput for overrides that are none.
    """
    start = folder or cameras.current_folder()
    over = cameras.overlay(sets, start)
    bases = [[name, _found(base)] for name, base, _ in cases.cases_of(study, over)]
    values = [_found(base) for base in cases.values_of(study, over)]
    places = [str(study.file), str(start) if sets else ""]
    versions = provenance.versions() | {"matplotlib": version("matplotlib")}
    return hash_text(to_json([study.tree.plain(), over.plain(), bases, values, places, versions]))


def _found(base: Base) -> list[Any]:
    """What names lead to: what the files say, and which there are, with those read beside them."""
    named = base.inputs
    beside = [companion for path in named for companion in companions(path)]
    return [base.tree.plain(), [str(path) for path in (*named, *beside)]]


def result(place: Path, study: StudyFile, asked: str) -> SweepResult | None:
    """What a finished sweep found of which nothing has changed; None where something has."""
    try:
        record = record_of(place / RECORD)
        if record is None or record["asked"] != asked or record["check"] != record_check(record):
            return None
        files = {**record["hashes"], **{place / n: h for n, h in record["written"].items()}}
        if not _same(files) or not _kept(place, record, study):
            return None
        return sweep_result.read(record, place, study)
    except (KeyError, TypeError, ValueError, AttributeError):  # not as vcam writes it
        return None


def _same(hashes: Mapping[str | Path, str]) -> bool:
    try:
        return all(hash_file(path) == digest for path, digest in hashes.items())
    except CannotDo:
        return False


def _kept(place: Path, record: dict[str, Any], study: StudyFile) -> bool:
    """Whether all points, and what figures need, are there and whole."""
    folder, frames = SweepFolder(place), tuple(FRAMES[what] for what in study.model.keep)
    points = all(folder.is_whole(point, frames) for point in record["points"] if point)
    return points and all(map(folder.is_whole, record["kept"]))
