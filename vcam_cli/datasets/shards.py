"""Shards: finished frames of a data set, packed together, with their records.

Frames are computed in parts of a shard, and a part is kept when it is finished, as a point of a
sweep is. As soon as all parts of a shard are there they are packed, one after the other, and kept
no longer: the disk holds each frame once, and one shard more. The record of a shard and its frames
is a point of its own.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.datasets.frame_work import NPZ, RECORDS, Record, read_records, write_records
from vcam_cli.errors import bad
from vcam_cli.files import frame_archive
from vcam_cli.files.atomic import write_whole
from vcam_cli.files.images import tiff
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.records import Fingerprint, Proofs, file_fingerprint, remember
from vcam_cli.files.report import hash_text, to_json
from vcam_cli.records import dataclass

Stored = tuple[frame_archive.Archive, str, str, str]
"""An array: the archive of its part and its name there, the name of its frame, its kind."""


@dataclass(frozen=True)
class Part:
    """Frames of a shard that are computed and kept together."""

    id: str
    """Hash of all that their arrays depend on, wherever files lie."""
    lit: tuple[range, ...]
    """Numbers of frames that share a light, all of them, for every light."""
    numbers: tuple[int, ...]
    """Those of the shard, as they are computed."""


@dataclass(frozen=True)
class Shard:
    """The frames of a shard."""

    number: int
    """From 0."""
    frames: range
    parts: tuple[Part, ...]
    digits: int
    """Of the frames' numbers in names."""

    def name(self, frame: int) -> str:
        """Return the name of a frame in files: its number from 0."""
        return f"{frame:0{self.digits}d}"

    def id(self, format: str, scale: int) -> str:
        """Return the hash of all that the shard depends on."""
        return hash_text(to_json([format, scale, self.digits, self.number, self.ids]))[:32]

    @property
    def ids(self) -> list[str]:
        """Those of its parts."""
        return [part.id for part in self.parts]


@dataclass(frozen=True)
class Packer:
    """Packs the shards of a data set into its folder."""

    folder: SweepFolder
    format: str
    scale: int
    """What `clean` and `ideal` are multiplied by in TIFF, which holds whole numbers."""
    former: Mapping[str, Any]
    """The record that the folder had: files that it proves may be replaced."""

    def content(self, shard: Shard) -> dict[str, Any] | None:
        """Return the record of a shard.

        It has its files, the number of frames that failed, the names of all labels, and the records
        of the frames as a text.
        """
        return self.folder.read(shard.id(self.format, self.scale))

    def files(self, shard: Shard) -> dict[str, Fingerprint] | None:
        """Return the files of a shard; None where it is not packed, or they are not as written."""
        content = self.content(shard)
        if content is None or not isinstance(content.get("files"), dict):
            return None
        files: dict[str, Fingerprint] = content["files"]
        proofs = Proofs(self.folder.path, {"files": list(files), "written": files})
        return files if all(map(proofs.holds, files)) else None

    def pack(self, shard: Shard) -> dict[str, Fingerprint]:
        """Pack a shard after all its frames are finished; return its files.

        Raises BadInput where a file of another program is in the way, CannotDo.
        """
        records: dict[str, Record] = {}
        write = self._write_archive if self.format == "npz" else self._write_files
        files = write(shard, self._arrays(shard, records))
        labels = dict.fromkeys(name for record in records.values() for name in record.labels)
        content = {
            "files": files,
            "failed": sum(bool(record.error) for record in records.values()),
            "labels": list(labels),
            "records": write_records(records),
        }
        self.folder.write(shard.id(self.format, self.scale), content)
        for part in shard.parts:
            self.folder.discard(part.id, (NPZ, "json"))
        return files

    def _arrays(self, shard: Shard, records: dict[str, Record]) -> Iterator[Stored]:
        """Yield the arrays of all frames that did not fail, in the order of parts.

        Fill in the records of all frames.
        """
        for part in shard.parts:
            with frame_archive.Archive(self.folder.file(part.id, NPZ)) as archive:
                own = read_records(archive.text(RECORDS))
                for number in part.numbers:
                    name, record = shard.name(number), own[str(number)]
                    records[name] = record
                    for kind in record.hashes:
                        yield archive, f"{number}.{kind}", name, kind

    def _write_archive(self, shard: Shard, arrays: Iterator[Stored]) -> dict[str, Fingerprint]:
        name = f"shard_{shard.number:04d}.npz"
        members = (
            (f"{frame}.{kind}", archive.stored(stored)) for archive, stored, frame, kind in arrays
        )
        return {name: self._write_whole(name, partial(frame_archive.write_archive, arrays=members))}

    def _write_files(self, shard: Shard, arrays: Iterator[Stored]) -> dict[str, Fingerprint]:
        files = {}
        for archive, stored, frame, kind in arrays:
            values = archive.array(stored)
            whole = values if kind == "raw" else whole_numbers(values, scale(kind, self.scale))
            file = f"shard_{shard.number:04d}/{frame}_{kind}.tif"
            (self.folder.path / file).parent.mkdir(exist_ok=True)
            put = partial(tiff.write_tiff, samples=whole, description=f"vcam {kind}")
            files[file] = self._write_whole(file, put)
        return files

    def _write_whole(self, name: str, write: Any) -> Fingerprint:
        """Write a file, whole, and return its fingerprint; see `pack` for what it raises."""
        path = self.folder.path / name
        with write_whole(path) as temporary:
            write(temporary)
            before, made = temporary.lstat(), file_fingerprint(temporary)
            proofs = Proofs(
                self.folder.path, self.former, {"files": [name], "written": {name: made}}
            )
            if os.path.lexists(path) and not proofs.holds(name):
                message = f"{path} is there already and was not written by vcam, or changed since"
                raise bad("--out", message, "move it away, or choose another folder")
        remember(path, before, made)
        return made


MILLIMETERS = 1000
"""Of depth in TIFF."""


def scale(kind: str, codes: int) -> int:
    """Return what the values of a kind are multiplied by in TIFF, where codes are by so much."""
    return {"raw": 1, "depth": MILLIMETERS}.get(kind, codes)


def whole_numbers(values: Array, factor: int) -> Array:
    """Return values times `factor`, rounded: uint16, or uint32 where that is too small.

    What is larger than that holds, as an infinite depth, is its largest number.
    """
    whole = np.rint(np.clip(values.astype(float) * factor, 0, 2**32 - 1))
    packed: Array = whole.astype(np.uint16 if whole.max(initial=0) < 1 << 16 else np.uint32)
    return packed
