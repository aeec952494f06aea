"""Archives of frames in NumPy's npz format, frame by frame: only one is in memory.

A member is an array of one frame, stored as it is: noise cannot be compressed much, and what is
not compressed can be read from its place. Equal arrays give equal bytes.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array


def archive_bytes(arrays: Mapping[str, Array]) -> bytes:
    """Return an archive of arrays by their names."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            add_array(archive, name, values)
    return data.getvalue()


def add_array(archive: zipfile.ZipFile, name: str, values: Array) -> None:
    """Add an array to an archive."""
    member = zipfile.ZipInfo(f"{name}.npy")  # of the year 1980
    with archive.open(member, "w", force_zip64=True) as file:
        np.lib.format.write_array(file, np.ascontiguousarray(values), allow_pickle=False)


def read_arrays(path: Path) -> dict[str, Array]:
    """Return the arrays of an archive. Raise OSError or ValueError for another file."""
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def write_archive(path: Path, frames: Iterable[tuple[str, Mapping[str, Array]]]) -> None:
    """Write the arrays of frames, each under the frame's name, a dot, and its own."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for frame, arrays in frames:
            for name, values in arrays.items():
                add_array(archive, f"{frame}.{name}", values)
