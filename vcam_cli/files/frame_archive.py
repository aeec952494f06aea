"""Archives of frames in NumPy's npz format, frame by frame: only one is in memory.

A member is an array of one frame, stored as it is: noise cannot be compressed much, and what is
not compressed can be read from its place. Equal arrays give equal bytes.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Self

import numpy as np

from vcam_cli.arrays import Array


def archive_bytes(arrays: Mapping[str, Array], texts: Mapping[str, bytes]) -> bytes:
    """Return an archive of arrays by their names, and of texts by the names of their members."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            add_array(archive, name, values)
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(name), text)
    return data.getvalue()


def add_array(archive: zipfile.ZipFile, name: str, values: Array) -> None:
    """Add an array to an archive."""
    member = zipfile.ZipInfo(f"{name}.npy")  # of the year 1980
    with archive.open(member, "w", force_zip64=True) as file:
        np.lib.format.write_array(file, np.ascontiguousarray(values), allow_pickle=False)


class Archive:
    """An archive that is read member by member. OSError or ValueError for another file."""

    def __init__(self, path: Path) -> None:
        try:
            self._archive = zipfile.ZipFile(path)
        except zipfile.BadZipFile as error:
            raise ValueError(str(error)) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def array(self, name: str) -> Array:
        """Return an array by its name."""
        with self._archive.open(f"{name}.npy") as file:
            values: Array = np.lib.format.read_array(file, allow_pickle=False)
        return values

    def stored(self, name: str) -> bytes:
        """Return an array as it is stored."""
        return self._archive.read(f"{name}.npy")

    def text(self, name: str) -> bytes:
        """Return a member that is no array."""
        return self._archive.read(name)


def array_hash(values: Array) -> str:
    """Return the SHA-256 of values in C order, little-endian."""
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return hashlib.sha256(np.ascontiguousarray(little).data).hexdigest()


def write_archive(path: Path, arrays: Iterable[tuple[str, bytes]]) -> None:
    """Write arrays as other archives store them, by their names."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in arrays:
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                file.write(data)
