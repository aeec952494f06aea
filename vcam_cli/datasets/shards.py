"""Shards: finished frames of a data set, packed together, with their records.

A frame is kept by itself when it is finished, as a point of a sweep is. When all frames of a shard
are there they are packed, one after the other, and kept no longer: the disk holds each frame once,
and one shard more. The record of a shard and its frames is a point of its own.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.datasets.frame_work import NPZ
from vcam_cli.errors import bad
from vcam_cli.files import frame_archive
from vcam_cli.files.atomic import write_whole
from vcam_cli.files.images import tiff
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.records import Fingerprint, Proofs, file_fingerprint
from vcam_cli.files.report import hash_text, to_json
from vcam_cli.sweeps.sweep_result import read_outcome

NamedArrays = tuple[str, dict[str, Array]]
"""The name of a frame, and its arrays by kind."""


@dataclass(frozen=True)
class Shard:
    """The frames of a shard."""

    number: int
    """From 0."""
    frames: range
    ids: tuple[str, ...]
    """Of its frames."""
    digits: int
    """Of the frames' numbers in names."""

    def name(self, frame: int) -> str:
        """Return the name of a frame in files: its number from 0."""
        return f"{frame:0{self.digits}d}"

    def id(self, format: str, scale: int) -> str:
        """Return the hash of all that the shard depends on."""
        return hash_text(to_json([format, scale, self.digits, self.number, list(self.ids)]))[:32]


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
        """Return the record of a shard: its files, and hashes, labels, errors of its frames."""
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
        content: dict[str, Any] = {"hashes": {}, "labels": {}, "errors": {}}
        frames = self._frames(shard, content)
        write = self._write_archive if self.format == "npz" else self._write_files
        content["files"] = write(shard, frames)
        self.folder.write(shard.id(self.format, self.scale), content)
        for point in shard.ids:
            self.folder.discard(point, (NPZ, "json"))
        files: dict[str, Fingerprint] = content["files"]
        return files

    def _frames(self, shard: Shard, content: dict[str, Any]) -> Iterator[NamedArrays]:
        """Yield name and arrays of all frames that did not fail; fill in their records."""
        for number, point in zip(shard.frames, shard.ids, strict=True):
            name, known = shard.name(number), self.folder.read(point)
            outcome = read_outcome(point, known or {})
            content["labels"][name] = outcome.metrics
            if outcome.error:
                content["errors"][name] = outcome.error
                continue
            arrays = frame_archive.read_arrays(self.folder.file(point, NPZ))
            content["hashes"][name] = {kind: _hash(values) for kind, values in arrays.items()}
            yield name, arrays

    def _write_archive(self, shard: Shard, frames: Iterator[NamedArrays]) -> dict[str, Fingerprint]:
        name = f"shard_{shard.number:04d}.npz"
        return {name: self._put(name, partial(frame_archive.write_archive, frames=frames))}

    def _write_files(self, shard: Shard, frames: Iterator[NamedArrays]) -> dict[str, Fingerprint]:
        files = {}
        for name, arrays in frames:
            for kind, values in arrays.items():
                whole = values if kind == "raw" else whole_numbers(values, scale(kind, self.scale))
                file = f"shard_{shard.number:04d}/{name}_{kind}.tif"
                (self.folder.path / file).parent.mkdir(exist_ok=True)
                put = partial(tiff.write_tiff, samples=whole, description=f"vcam {kind}")
                files[file] = self._put(file, put)
        return files

    def _put(self, name: str, write: Any) -> Fingerprint:
        """Write a file, whole, and return its fingerprint; see `pack` for what it raises."""
        path = self.folder.path / name
        with write_whole(path) as temporary:
            write(temporary)
            made = file_fingerprint(temporary)
            proofs = Proofs(
                self.folder.path, self.former, {"files": [name], "written": {name: made}}
            )
            if os.path.lexists(path) and not proofs.holds(name):
                message = f"{path} is there already and was not written by vcam, or changed since"
                raise bad("--out", message, "move it away, or choose another folder")
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


def _hash(values: Array) -> str:
    """Return the SHA-256 of values in C order, little-endian."""
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return hashlib.sha256(np.ascontiguousarray(little).tobytes()).hexdigest()


def shards(frames: int, count: int, ids: Sequence[str]) -> list[Shard]:
    """Return the shards of `frames`, of equal size, in the order of the frames."""
    ends = [frames * n // count for n in range(count + 1)]
    digits = max(6, len(str(frames - 1)))
    return [
        Shard(n, range(a, b), tuple(ids[a:b]), digits) for n, (a, b) in enumerate(pairwise(ends))
    ]
