"""TIFF files of whole numbers, such as raw frames, written by tifffile.

tifffile writes any tag of any type, which OpenImageIO does not; it comes with
`pip install 'vcam-cli[dng]'`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vcam_cli
from vcam_cli.files.atomic import write_whole
from vcam_cli.files.optional_library import optional_library

Tag = tuple[int, str, int, Any]
"""Number, type as `struct` writes it, count, and value of a tag; rationals are flat pairs "2I",
and "x" is bytes without a meaning in TIFF."""

COLORS = {"R": 0, "G": 1, "B": 2, "C": 3, "M": 4, "W": 6}
"""Color -> its number in the tag CFAPattern of TIFF/EP (ISO 12234-2). Y is 5 there, yellow; here it
may be the luminance of a pixel without filter, which is none of the tag's colors."""
_TYPES = {"B": 1, "s": 2, "H": 3, "I": 4, "2I": 5, "x": 7, "2i": 10, "d": 12}


def write_tiff(
    path: Path | str, samples: NDArray, description: str, tags: Sequence[Tag] = ()
) -> None:
    """Write whole numbers (rows, columns) or (rows, columns, C), uncompressed.

    They are uint16, or uint32 where one of `samples` is larger than that holds. Three channels are
    RGB, fewer or more are gray and what is beside it: programs that know no mosaic show that as it
    is. Raise CannotDo (disk full, permission, tifffile missing).
    """
    rgb = samples.shape[2:] == (3,)
    with write_whole(path) as temporary:
        library("tifffile").imwrite(
            temporary,
            samples,
            photometric="rgb" if rgb else "minisblack",
            planarconfig="contig" if samples.ndim == 3 else None,
            description=description,
            software=SOFTWARE,
            metadata=None,
            extratags=extra(tags),
        )


SOFTWARE = f"vcam {vcam_cli.__version__}"


def extra(tags: Sequence[Tag]) -> list[tuple[int, int, int, Any, bool]]:
    """Return tags as tifffile takes them."""
    return [(code, _TYPES[kind], count, value, True) for code, kind, count, value in tags]


def mosaic_tags(block: Sequence[Sequence[str]]) -> list[Tag]:
    """Return the tags CFARepeatPatternDim and CFAPattern of TIFF/EP; () where a color has none."""
    names = [name for row in block for name in row]
    if not names or not set(names) <= set(COLORS):
        return []
    size = (len(block), len(block[0]))
    numbers = bytes(COLORS[name] for name in names)
    return [(33421, "H", 2, size), (33422, "B", len(numbers), numbers)]


def whole_numbers(values: NDArray, highest: float) -> NDArray:
    """Return codes as uint16, or uint32 where the highest one asks for it."""
    return values.astype(np.uint16 if highest < 1 << 16 else np.uint32)


def library(name: str) -> Any:
    """Return a library that writes raw files. Raise CannotDo where it is not installed."""
    return optional_library(name, "TIFF and DNG files", "dng")
