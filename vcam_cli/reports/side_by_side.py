"""Several runs side by side, from what their folders hold: pictures, settings, metrics, plans."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from vcam_cli.errors import bad
from vcam_cli.files.records import Proofs, read_record
from vcam_cli.reports import pictures
from vcam_cli.reports.page import Page, Part, Picture, Section, Table, number_columns
from vcam_cli.reports.run_facts import exposure_rows, geometry_rows, number, spoken

SHOWN = {"render.png": "Renders", "delta_e.png": "Errors"}
"""File of a run -> its heading."""
Runs = Sequence[tuple[str, Path, Mapping[str, Any]]]
"""Label, folder and record of each run."""


def read_runs(folders: Sequence[Path]) -> Runs:
    """Return the runs of these folders with labels that tell them apart.

    Raise BadInput where a folder holds no run of vcam.
    """
    runs = []
    for folder in folders:
        record = read_record(folder / "run.json")
        if record is None or not isinstance(record.get("metrics"), dict):
            message = f"{folder} holds no run.json of `vcam run`"
            raise bad("DIR", message, "give the folder that a run wrote, such as out/still-life")
        runs.append((folder, record))
    names = [folder.name or str(folder) for folder, _ in runs]
    labels = [
        name if names.count(name) == 1 else str(folder)
        for name, (folder, _) in zip(names, runs, strict=True)
    ]
    return [(label, *run) for label, run in zip(labels, runs, strict=True)]


def side_by_side(runs: Runs) -> Page:
    """Return a report of several runs, from their folders.

    Raise BadInput where a folder is not as its run wrote it.
    """
    try:
        return _page(runs)
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError):
        names = ", ".join(str(folder) for _, folder, _ in runs)
        message = f"a run.json of {names} is not as this version of vcam writes it"
        raise bad("DIR", message, "run the cameras again") from None


def _page(runs: Runs) -> Page:
    labels = [label for label, _, _ in runs]
    return Page(
        title=" and ".join(labels) if len(labels) < 4 else f"{len(labels)} runs",
        about="Runs side by side. Differences are highlighted.",
        notes=list(_notes(runs)),
        sections=(
            *(Section(title, list(_pictures(runs, name))) for name, title in SHOWN.items()),
            Section("Settings that differ", list(_settings(runs))),
            Section(
                "Findings",
                [
                    _table("Metrics", labels, [_metrics(record) for _, _, record in runs]),
                    _table("Exposure", labels, [_exposure(record) for _, _, record in runs]),
                    _table("Geometry", labels, [_geometry(record) for _, _, record in runs]),
                ],
            ),
            Section("Effects", [_table("Effects", labels, [_effects(r) for _, _, r in runs])]),
        ),
    )


def _notes(runs: Runs) -> Iterator[str]:
    """Yield each note once, with the labels of its runs where it is not of all."""
    labels: dict[str, list[str]] = {}
    for label, _, record in runs:
        for note in dict.fromkeys(record["notes"]):
            labels.setdefault(note, []).append(label)
    for note, own in labels.items():
        yield note if len(own) == len(runs) else f"{', '.join(own)}: {note}"


def _pictures(runs: Runs, name: str) -> Iterator[Part]:
    for label, folder, record in runs:
        if name not in record["files"]:
            continue
        if not Proofs(folder, record).holds(name):
            raise bad("DIR", f"{folder / name} is not as its run wrote it", "run it again")
        source = pictures.png((folder / name).read_bytes())
        yield Picture(label, source, f"{name} of {label}", group="runs")


def _settings(runs: Runs) -> Iterator[Part]:
    cameras = [{k: v for k, v in r["camera"].items() if k != "output"} for _, _, r in runs]
    each = [dict(_flat(camera)) for camera in cameras]
    differing = {key for keys in each for key in keys if len({keys.get(key) for keys in each}) > 1}
    if differing:
        ordered = [{k: v for k, v in keys.items() if k in differing} for keys in each]
        yield _table("Keys of the cameras", [label for label, _, _ in runs], ordered)


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the keys of a camera's YAML form as `--set` writes them, with their values."""
    if isinstance(value, Mapping) and value:
        for key, item in value.items():
            yield from _flat(item, f"{path}.{key}" if path else str(key))
    else:
        yield path, str(value)


def _metrics(record: Mapping[str, Any]) -> dict[str, str]:
    return {name: number(value) for name, value in record["metrics"].items()}


def _exposure(record: Mapping[str, Any]) -> dict[str, str]:
    return dict(exposure_rows(record["exposure"]))


def _geometry(record: Mapping[str, Any]) -> dict[str, str]:
    return dict(geometry_rows(record["geometry"]))


def _effects(record: Mapping[str, Any]) -> dict[str, str]:
    """Return what became of each effect, and how much it contributes."""
    found = {}
    for effect in record["plan"]["effects"]:
        share = effect["contribution"]
        much = "" if not isinstance(share, float) else f", {100 * share:.2g} % {effect['unit']}"
        found[spoken(effect["name"])] = f"{effect['state']}{much}"
    return found


def _table(title: str, labels: Sequence[str], each: Sequence[Mapping[str, str]]) -> Table:
    """Return a table of what runs say by name; rows in which they differ are marked."""
    names = list(dict.fromkeys(name for one in each for name in one))
    rows = [(name, *(one.get(name, "") for one in each)) for name in names]
    marked = frozenset(i for i, row in enumerate(rows) if len(set(row[1:])) > 1)
    return Table(title, ("", *labels), rows, numbers=number_columns(rows), marked=marked)
