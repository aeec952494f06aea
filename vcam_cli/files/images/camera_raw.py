"""Raw files of cameras, read by LibRaw: DNG, CR2, CR3, NEF, ARW, RAF and others.

`pip install 'vcam-cli[raw]'` brings LibRaw as rawpy, and tifffile, which reads the one tag of DNG
that LibRaw leaves to its user: BaselineExposure.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.files.file_checks import (
    UnusableFile,
    check_file,
    convert_errors,
    too_large,
    truncated_file,
)
from vcam_cli.files.images.images import LinearImage
from vcam_cli.files.optional_library import optional_library

BYTES_PER_PIXEL = 32
"""Memory that developing takes: LibRaw's four channels of 16 bits twice, its picture, and ours."""
MOST_STOPS = 32
"""Largest baseline exposure; a larger one in a file is ignored [EV]."""
_BASELINE_EXPOSURE = 50730
_REMEDY = "give a complete raw file of a camera that LibRaw supports"


def develop(path: Path, yaml_path: tuple[str | int, ...] | str) -> LinearImage:
    """Return a raw file as LibRaw develops it: linear sRGB (h, w, 3), 1 = the file's white level.

    The camera's own white balance and color matrix, bilinear interpolation, no other brightness
    than a DNG's BaselineExposure. Raise BadInput (with `yaml_path`) for what is no raw file, and
    CannotDo where LibRaw is not installed or memory does not suffice.
    """
    with convert_errors(path, yaml_path, _REMEDY), open_raw(path) as file:
        rawpy, stops = library("rawpy"), _baseline_exposure(path)
        need = BYTES_PER_PIXEL * file.sizes.raw_width * file.sizes.raw_height
        if need > memory.available():
            raise too_large(f"developing {path} takes {need / 1e9:.1f} GB of memory")
        try:
            picture = file.postprocess(
                use_camera_wb=True,
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,  # else the brightest pixel may decide the exposure
                output_bps=16,
                demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
            )
        except rawpy.LibRawError as error:
            raise UnusableFile(f"cannot be developed: {_words(error)}") from None
    light = picture.astype(np.float32) * np.float32(2.0**stops / 65535)
    said = "developed by LibRaw, with the camera's white balance and color matrix"
    more = f", brightened by the file's {stops:+.2f} EV" if stops else ""
    return LinearImage(light, ("R", "G", "B"), (said + more,))


def read_codes(path: Path) -> tuple[Array, str]:
    """Return the codes of a raw file, and the colors of its first 2 x 2 pixels.

    Codes are uint16 (rows, columns), or (rows, columns, 3) where every pixel has all colors,
    without what a camera masks at the borders; with a linearization table they are linear.
    Colors are four letters row by row; "" for gray and for full color. Raise UnusableFile for what
    is no raw file, and CannotDo where LibRaw is not installed.
    """
    _baseline_exposure(path)  # refuses a DNG that is cut off
    with open_raw(path) as file:
        codes = np.array(file.raw_image_visible)
        if codes.ndim == 3:
            return codes[:, :, :3], ""
        colors = file.color_desc.decode("ascii", "replace")
        is_gray = file.num_colors == 1 or file.raw_pattern is None
        corner = np.ravel(file.raw_colors_visible[: 0 if is_gray else 2, :2])
    return codes, "".join(colors[number] for number in corner)


@contextmanager
def open_raw(path: Path) -> Iterator[Any]:
    """Open a raw file with LibRaw. Raise UnusableFile, and CannotDo where rawpy is not there."""
    rawpy = library("rawpy")
    check_file(path)
    try:
        file = rawpy.imread(str(path))
    except rawpy.LibRawError as error:
        raise UnusableFile(f"is no raw file that LibRaw reads: {_words(error)}") from None
    with file:
        yield file


def library(name: str) -> Any:
    """Return a library that reads raw files. Raise CannotDo where it is not installed."""
    return optional_library(name, "raw files of cameras", "raw")


def _words(error: Exception) -> str:
    """Return what LibRaw says: its messages are bytes."""
    said = error.args[0] if error.args else ""
    return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)


def _baseline_exposure(path: Path) -> float:
    """Return a DNG's BaselineExposure, 0 of other files [EV].

    Raise UnusableFile for a DNG that is cut off, which LibRaw develops as if it were dark there.
    """
    if path.suffix.lower() != ".dng":
        return 0.0
    tifffile = library("tifffile")
    log = logging.getLogger("tifffile")
    was, log.disabled = log.disabled, True  # what is wrong with a file is said once, by us
    try:
        with tifffile.TiffFile(path) as file:
            first = file.pages[0]
            pages, size = [first, *(first.pages or ())], path.stat().st_size
            ends = (
                start + count
                for page in pages
                for start, count in zip(page.dataoffsets, page.databytecounts, strict=False)
            )
            if max(ends, default=0) > size:
                raise truncated_file()
            tag = first.tags.get(_BASELINE_EXPOSURE)
            top, bottom = (0, 1) if tag is None else tag.value
    except (tifffile.TiffFileError, ValueError, TypeError, IndexError):
        raise UnusableFile("is a damaged DNG") from None
    finally:
        log.disabled = was
    stops = top / bottom if bottom else 0.0
    return stops if abs(stops) < MOST_STOPS else 0.0
