"""DNG files: raw frames for raw converters.

A TIFF with the tags of Adobe's Digital Negative specification 1.7.1. The first directory is the raw
frame; within it are a small JPEG picture for programs that do not develop, and a directory of EXIF
with what the camera was set to.

Where imagecodecs is installed, samples are lossless JPEG (ITU-T T.81, process 14) in tiles, else
uncompressed. Neighbors in a row are two components, as they are in other cameras' files, so that
each is predicted from one of its own color: 12 megapixels of a noisy mosaic are 0.6 to 0.9 times as
large with it as without. Tiles are encoded by as many threads as there are processors, 12
megapixels in 0.30 to 0.37 s of one.

Every reader knows predictor 1. liblj92 encodes in two thirds of the time with predictor 6, which
darktable 4.2 refuses; deflate is for floating point alone (specification, tag Compression).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.images.dng_opcodes import gain_maps, warp_rectilinear
from vcam_cli.files.images.tiff import (
    GRAY,
    SOFTWARE,
    YCBCR,
    Directory,
    Tag,
    image_tags,
    mosaic_tags,
    raw_bytes,
    text,
    write_directory,
)
from vcam_cli.parallel import available_workers, results
from vcam_cli.records import dataclass

TILE = 256
"""Most rows and columns of a tile."""
TILE_STEP = 16
"""Rows and columns of tiles are multiples of it (TIFF 6.0)."""
MARGIN = 4
"""Pixels of a mosaic beside the picture, from which its border is interpolated; Adobe's reader
warns of less than 2."""
LEAST_SIZE = 22
"""Rows and columns below which LibRaw reads no raw file."""
MOST_BITS = 16
"""Bits of a code that raw converters read."""
CODES: dict[str, tuple[int, str]] = {
    "Make": (271, "s"),
    "Model": (272, "s"),
    "Orientation": (274, "H"),
    "DNGVersion": (50706, "B"),
    "DNGBackwardVersion": (50707, "B"),
    "UniqueCameraModel": (50708, "s"),
    "LinearizationTable": (50712, "H"),
    "BlackLevel": (50714, "2I"),
    "WhiteLevel": (50717, "I"),
    "DefaultCropOrigin": (50719, "I"),
    "DefaultCropSize": (50720, "I"),
    "ColorMatrix1": (50721, "2i"),
    "ColorMatrix2": (50722, "2i"),
    "AsShotNeutral": (50728, "2I"),
    "BaselineExposure": (50730, "2i"),
    "CalibrationIlluminant1": (50778, "H"),
    "CalibrationIlluminant2": (50779, "H"),
    "ActiveArea": (50829, "I"),
    "OpcodeList2": (51009, "x"),
    "OpcodeList3": (51022, "x"),
    "NoiseProfile": (51041, "d"),
}
"""Tag -> its number, and its type as `files.tiff` has them."""
EXIF_CODES: dict[str, tuple[int, str]] = {
    "ExposureTime": (33434, "2I"),
    "FNumber": (33437, "2I"),
    "ISOSpeedRatings": (34855, "H"),
    "SensitivityType": (34864, "H"),
    "ISOSpeed": (34867, "I"),
    "ExifVersion": (36864, "x"),
    "DateTimeOriginal": (36867, "s"),
    "FocalLength": (37386, "2I"),
}
"""The same of tags in the directory of EXIF 2.3."""
MOST_ISO = (1 << 16) - 1
"""The highest number of ISOSpeedRatings: it says there that ISOSpeed has the speed (EXIF 2.3)."""
DATE = "2000:01:01 00:00:00"
"""Date of all frames: a scene that is simulated has none, and a camera gives the same bytes."""
LIGHT_SOURCES = {"A": 17, "D65": 21}
"""Illuminant -> its number in EXIF 2.3."""
LEAST_DELTA = 1e-3
"""Part of a code below which a black level counts as whole [DN]."""
_BLACK_LEVEL_DELTA = (50716, "2i")
"""Tag BlackLevelDeltaV, a level of every row beside BlackLevel."""
_EXIF, _SUB_DIRECTORY = 34665, 330
_CFA, _LINEAR_RAW, _NO_COMPRESSION, _JPEG = 32803, 34892, 1, 7
_ISO_SPEED = 3
"""SensitivityType: the speed is an ISO speed of ISO 12232."""
PREVIEW_QUALITY = 85
"""Of JPEG, from 0 to 95."""


@dataclass(frozen=True)
class Colors:
    """How a camera sees colors."""

    matrices: Mapping[str, Array]
    """Illuminant -> matrix (3, 3) from XYZ to the camera's R, G, B, colder light last."""
    neutral: Array
    """The camera's R, G, B of the scene's white, 1 the largest."""


@dataclass(frozen=True)
class RawImage:
    """A raw frame, and what a raw converter must know to develop it."""

    codes: Array
    """Whole numbers (rows, columns), or (rows, columns, 3) where every pixel has all colors; of
    any type."""
    block: Sequence[Sequence[str]]
    """Block of colors that repeats over a mosaic; () for gray and for full color."""
    colors: Colors | None
    """None for gray."""
    black: float
    """Level of no light, behind `table` [DN]."""
    white: int
    """Level of a saturated pixel, behind `table` [DN]."""
    table: Array | None
    """Level of every code (N,), uint16; None where codes are levels."""
    baseline_exposure: float
    """Stops that bring the scene's white to the brightest of the picture [EV]."""
    warp: Array | None
    """Coefficients of WarpRectilinear (N, 6); None where the lens does not distort."""
    shading: Array | None
    """Factors that make even light even, as `dng_opcodes.gain_maps` takes them; None for 1."""
    noise: tuple[float, float]
    """Variance of a level from 0 (black) to 1 (white): so much times the level, and so much
    more."""
    name: str
    """Name of the camera."""
    exposure_time: float
    """[s]"""
    f_number: float
    """Of the lens; inf without one."""
    focal_length: float
    """[m]"""
    iso: float
    """ISO speed; 0 where it has none."""
    description: str
    preview: Array
    """A small picture in sRGB, uint8 (rows, columns) or (rows, columns, 3)."""


def write_dng(path: Path | str, image: RawImage) -> None:
    """Write a DNG file. Raise CannotDo (disk full, permission)."""
    codes, compressed = image.codes, find_spec("imagecodecs") is not None
    described = image_tags(
        codes.shape,
        _CFA if image.block else _LINEAR_RAW,
        MOST_BITS,
        _JPEG if compressed else _NO_COMPRESSION,
        tile=_tile_size(*codes.shape[:2]) if compressed else None,
    )
    described += [
        text(270, image.description),
        text(305, SOFTWARE),
        text(306, DATE),
        *mosaic_tags(image.block),
    ]
    first = Directory(
        [*described, *_tags(image)],
        _tiles(codes) if compressed else [raw_bytes(codes.astype(np.uint16))],
        tiled=compressed,
        within={_EXIF: Directory(_exif_tags(image)), _SUB_DIRECTORY: _preview(image.preview)},
    )
    write_directory(path, first)


def _preview(picture: Array) -> Directory:
    """Return a small picture as a JPEG."""
    from PIL import Image

    data = BytesIO()
    Image.fromarray(picture).save(data, "JPEG", quality=PREVIEW_QUALITY, subsampling=0)
    color = picture.ndim == 3
    tags = image_tags(picture.shape, YCBCR if color else GRAY, 8, _JPEG, reduced=True)
    sampling: list[Tag] = [(530, "H", 2, (1, 1))] if color else []
    return Directory([*tags, *sampling, (50970, "I", 1, 2 if color else 1)], [data.getvalue()])


def _tiles(codes: Array) -> list[bytes]:
    """Return all tiles, compressed, row by row."""
    encode = import_module("imagecodecs").jpeg8_encode
    rows, columns = codes.shape[:2]
    height, width = _tile_size(rows, columns)

    def tile(corner: tuple[int, int]) -> bytes:
        row, column = corner
        part = codes[row : row + height, column : column + width].astype(np.uint16)
        missing = [(0, height - part.shape[0]), (0, width - part.shape[1])]
        part = np.pad(part, missing + [(0, 0)] * (part.ndim - 2), mode="edge")
        if part.ndim == 2:
            return bytes(
                encode(part.reshape(height, width // 2, 2), lossless=True, bitspersample=16)
            )
        same = {"colorspace": "rgb", "outcolorspace": "rgb"}
        return bytes(encode(part, lossless=True, bitspersample=16, **same))

    corners = product(range(0, rows, height), range(0, columns, width))
    return results(tile, corners, available_workers())


def _tile_size(rows: int, columns: int) -> tuple[int, int]:
    """Return rows and columns of a tile: LibRaw gets one wrong that is wider than its picture."""
    height, width = (min(TILE, count // TILE_STEP * TILE_STEP) for count in (rows, columns))
    return height, width


def _tags(image: RawImage) -> list[Tag]:
    """Return the tags of a frame, those of its mosaic aside."""
    rows, columns, *planes = image.codes.shape
    count = planes[0] if planes else 1
    margin = MARGIN if image.block else 0
    # LibRaw cuts off fractions of BlackLevel. The delta, which other readers add, is at most half
    # a code, which LibRaw rounds to 0, so that it comes to the nearest whole level.
    level = round(image.black)
    rest = image.black - level
    said: dict[str, Any] = {
        "Make": "vcam",
        "Model": image.name,
        "UniqueCameraModel": f"vcam {image.name}",
        "Orientation": [1],
        "DNGVersion": [1, 4, 0, 0],
        "DNGBackwardVersion": [1, 3, 0, 0],
        "BlackLevel": [level] * count,
        "WhiteLevel": [image.white] * count,
        "ActiveArea": [0, 0, rows, columns],
        "DefaultCropOrigin": [margin, margin],
        "DefaultCropSize": [columns - 2 * margin, rows - 2 * margin],
        "BaselineExposure": [image.baseline_exposure],
    }
    if image.noise[0] > 0:  # else Adobe's reader warns of it
        said["NoiseProfile"] = [*image.noise] * (count if image.colors is None else 3)
    if image.warp is not None:
        said["OpcodeList3"] = warp_rectilinear(image.warp)
    if image.shading is not None:
        said["OpcodeList2"] = gain_maps(image.codes.shape, image.shading)
    if image.table is not None:
        said["LinearizationTable"] = image.table
    if image.colors is not None:
        said["AsShotNeutral"] = image.colors.neutral
        for number, (name, matrix) in enumerate(image.colors.matrices.items(), start=1):
            said[f"CalibrationIlluminant{number}"] = [LIGHT_SOURCES[name]]
            said[f"ColorMatrix{number}"] = matrix
    tags = [_tag(*CODES[name], value) for name, value in said.items()]
    if abs(rest) > LEAST_DELTA:
        tags.append(_tag(*_BLACK_LEVEL_DELTA, [rest] * rows))
    return tags


def _exif_tags(image: RawImage) -> list[Tag]:
    """Return the tags of what the camera was set to."""
    said: dict[str, Any] = {
        "ExifVersion": b"0230",
        "DateTimeOriginal": DATE,
        "ExposureTime": [image.exposure_time],
    }
    if np.isfinite(image.f_number):
        said |= {"FNumber": [image.f_number], "FocalLength": [image.focal_length * 1e3]}
    iso = round(min(image.iso, (1 << 32) - 1))
    if iso > 0:
        said |= {"ISOSpeedRatings": [min(iso, MOST_ISO)], "SensitivityType": [_ISO_SPEED]}
        said["ISOSpeed"] = [iso]
    return [_tag(*EXIF_CODES[name], value) for name, value in said.items()]


def _tag(code: int, kind: str, value: Any) -> Tag:
    """Return a tag; a text, bytes, or numbers in any shape."""
    if kind == "x":
        return code, kind, len(value), value
    if kind == "s":
        return text(code, value)
    numbers = np.ravel(value).tolist()
    if not kind.startswith("2"):
        return code, kind, len(numbers), tuple(numbers) if len(numbers) > 1 else numbers[0]
    most = (1 << 31 if kind == "2i" else 1 << 32) - 1
    pairs = [_rational(number, most) for number in numbers]
    return code, kind, len(pairs), tuple(part for pair in pairs for part in pair)


def _rational(number: float, most: int) -> tuple[int, int]:
    """Return the nearest fraction of whole numbers up to `most`."""
    largest = int(most / max(1.0, abs(number)))
    found = Fraction(number).limit_denominator(max(1, largest))
    return max(-most, min(found.numerator, most)), found.denominator
