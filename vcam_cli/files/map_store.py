"""Arrays kept beside a finished point: an npz file of the same bytes for the same arrays."""

import io
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray

NAME = "maps.npz"


def packed(arrays: dict[str, NDArray]) -> bytes:
    """The bytes of an npz file."""
    text = io.BytesIO()
    np.savez_compressed(text, **arrays)  # type: ignore[arg-type]
    return text.getvalue()


def unpacked(data: bytes) -> dict[str, NDArray]:
    """The arrays of an npz file. Raises ValueError for what is none."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, OSError) as error:
        raise ValueError(str(error)) from None
