"""The manifest of a data set: a row a frame, with all that was drawn and every label."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vcam_cli import units
from vcam_cli.datasets.dataset_file import DatasetFile
from vcam_cli.datasets.frame_work import Record, read_records
from vcam_cli.datasets.shards import Packer, Shard
from vcam_cli.files import tables
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Packed:
    """The shards that are packed, their labels and failures."""

    shards: list[Shard]
    labels: list[str]
    """Names of all labels that any frame has."""
    failed: int
    """Number of frames that failed."""


def packed(packer: Packer, shards: list[Shard]) -> Packed:
    """Return shards that are packed, their labels and failures."""
    labels: dict[str, None] = {}
    failed = 0
    for shard in shards:
        content = packer.content(shard) or {"labels": (), "failed": 0}
        labels |= dict.fromkeys(content["labels"])
        failed += content["failed"]
    return Packed(shards, list(labels), failed)


def write(file: DatasetFile, packer: Packer, found: Packed, path: Path) -> None:
    """Write a row for every frame of the shards that are packed."""
    drawn = {name: _unit(file, name) for name in file.model.vary}
    kinds = file.model.write
    columns = [
        *("frame", "shard", "scene", "crop_row", "crop_column", "seed_frame"),
        *(f"{name} [{unit}]" if unit else name for name, unit in drawn.items()),
        *found.labels,
        *(f"sha256_{kind}" for kind in kinds),
        "error",
    ]

    def rows() -> Iterator[tuple[tables.Cell, ...]]:
        for shard in found.shards:
            content = packer.content(shard)
            records = read_records(content["records"]) if content else {}
            for number in shard.frames:
                name, frame = shard.name(number), file.frame(number)
                known = records.get(name, Record())
                yield (
                    name,
                    shard.number,
                    frame.scene.name if frame.scene else "",
                    frame.crop.get("row", ""),
                    frame.crop.get("column", ""),
                    frame.seed,
                    *(_cell(frame.values[key], unit) for key, unit in drawn.items()),
                    *(known.labels.get(label, "") for label in found.labels),
                    *(known.hashes.get(kind, "") for kind in kinds),
                    known.error,
                )

    tables.write_table(path, columns, rows())


def _unit(file: DatasetFile, path: str) -> str:
    """Return the unit of a parameter's column: that of the first value written or computed."""
    first = (file.model.vary[path].values or (file.frame(0).values[path],))[0]
    try:
        return units.split(first)[1]
    except ValueError:
        return ""


def _cell(value: Any, unit: str) -> tables.Cell:
    try:
        number, own = units.split(value)
        return float(units.convert(number, own, unit))
    except ValueError:
        return str(value)
