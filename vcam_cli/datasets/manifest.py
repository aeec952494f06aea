"""The manifest of a data set: a row a frame, with all that was drawn and every label."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vcam_cli import units
from vcam_cli.datasets.dataset_file import DatasetFile
from vcam_cli.datasets.shards import Packer, Shard
from vcam_cli.files import tables


def write(file: DatasetFile, packer: Packer, found: list[Shard], path: Path) -> None:
    """Write a row for every frame of the shards that are packed."""
    drawn = {name: _unit(file, name) for name in file.model.vary}
    labels = _label_columns(packer, found)
    kinds = file.model.write
    columns = [
        *("frame", "shard", "scene", "crop_row", "crop_column", "seed_frame"),
        *(f"{name} [{unit}]" if unit else name for name, unit in drawn.items()),
        *labels,
        *(f"sha256_{kind}" for kind in kinds),
        "error",
    ]

    def rows() -> Iterator[tuple[tables.Cell, ...]]:
        for shard in found:
            content = packer.content(shard) or {}
            for number in shard.frames:
                name, frame = shard.name(number), file.frame(number)
                known, hashes = (content[key].get(name, {}) for key in ("labels", "hashes"))
                yield (
                    name,
                    shard.number,
                    frame.scene.name if frame.scene else "",
                    frame.crop.get("row", ""),
                    frame.crop.get("column", ""),
                    frame.seed,
                    *(_cell(frame.values[key], unit) for key, unit in drawn.items()),
                    *(known.get(label, "") for label in labels),
                    *(hashes.get(kind, "") for kind in kinds),
                    content["errors"].get(name, ""),
                )

    tables.write_table(path, columns, rows())


def failures(packer: Packer, found: list[Shard]) -> int:
    """Return the number of frames that failed, among the shards that are packed."""
    return sum(len((packer.content(shard) or {}).get("errors", {})) for shard in found)


def _label_columns(packer: Packer, found: list[Shard]) -> list[str]:
    """Return the names of all labels that any frame has."""
    names: dict[str, None] = {}
    for shard in found:
        for labels in (packer.content(shard) or {}).get("labels", {}).values():
            names |= dict.fromkeys(labels)
    return list(names)


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
