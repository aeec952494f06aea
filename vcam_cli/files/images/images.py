"""Scene images: any file OpenImageIO reads -> linear light, float32, upright.

OpenImageIO expands palettes and small bit depths, and scales 10- and 12-bit samples to
16 bits. What it does not do, and is done here: turn the image upright, keep color apart
from alpha, map channels by name, manage colors (`color.py`), place an EXR's data window, notice
that a JPEG ends too early, and refuse what is no picture of light (CMYK, CIELAB, NaN, negative
values).
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import memory
from vcam_cli.files.file_checks import (
    UnusableFile,
    brief_reason,
    check_file,
    convert_errors,
    is_raw,
    too_large,
    truncated_file,
)
from vcam_cli.files.images.color import Coding, picture_coding
from vcam_cli.files.images.icc import converted_by_tables
from vcam_cli.files.images.image_library import oiio
from vcam_cli.files.images.rows import pending_error
from vcam_cli.records import dataclass

MOST_PIXELS = 10**9
MOST_LIGHT = 1e30
"""The largest light over `white`: float32 ends at 3.4e38, and a camera's units need some of it."""
_ALPHA = {"A", "ALPHA"}
_DEPTH = {"Z", "ZBACK"}
"""Names that OpenEXR gives to distances ("Technical Introduction to OpenEXR", channel names)."""
_RGB = ("R", "G", "B")
_LIGHT = {0, 1, 2, 3, 6}  # TIFF photometrics: gray (white or black is zero), RGB, palette, YCbCr
_READ_AS: dict[str, type[np.integer]] = {
    "uint8": np.uint8, "uint16": np.uint16, "uint": np.uint32, "uint32": np.uint32,
    "int8": np.int8, "int16": np.int16, "int": np.int32, "int32": np.int32,
}  # fmt: skip
_OIIO_NAMES: dict[type[np.integer], str] = {
    np.uint32: "uint",
    np.int32: "int",
}  # "uint32" would mean something else
_BLOCK = 64  # rows
MOST_NEGATIVE = 0.01
"""Part of the largest value that noise and resampling may leave below zero."""
_ROUNDING = 1e-3
"""Part of the largest color below which a negative one is a profile's rounding."""
_CONVERT = "convert it to a PNG, TIFF or EXR with one (gray) or three (R, G, B) channels"


@dataclass(frozen=True)
class LinearImage:
    """The linear light of an image file."""

    data: np.ndarray
    """Light over white (h, w, channels), float32; 1 or 3 channels (R, G, B), or those requested."""
    channels: tuple[str, ...]
    """The channels' names in the file."""
    notes: tuple[str, ...]
    """What was left aside, for the user."""
    coding: str = "linear-srgb"
    """How its codes were read: srgb, linear-srgb, or what the file says (`color.py`)."""


def read_picture(
    path: Path | str,
    encoding: str,
    white: float,
    yaml_path: tuple[str | int, ...] | str,
    channels: tuple[str, ...] = _RGB,
    signed: bool = False,
) -> LinearImage:
    """Return an image file as linear light divided by `white`.

    Light is in the primaries of Rec. 709. `encoding` is "auto" (what the file says, see
    `color.py`), "srgb" (decoded by IEC 61966-2-1) or "linear". Integer samples run from 0 to 1
    = the largest code; `white` is the linear value that becomes 1. Orientation tags are obeyed.
    Alpha is dropped (color values stay as stored); the first of several parts is
    read; both leave a note, as does anything else left aside. `channels`: the names of the color
    channels; others than R, G, B must be there by name. `signed`: values below 0 are allowed, as
    colors outside a display's gamut have them.

    Raise BadInput (with `yaml_path`) for a file that is missing, no regular file, no image,
    truncated, of a kind that is no light, with two color channels, negative or not finite;
    CannotDo when it may not be read or the memory does not suffice.
    """
    if encoding not in ("auto", "srgb", "linear") or not white > 0:
        raise ValueError(f"encoding {encoding!r}, white {white!r}")
    path = Path(path)
    with convert_errors(path, yaml_path, _CONVERT):
        _check_picture(path)
        with open_image(path) as source:
            return _read(path, source, encoding, white, channels, signed)


def color_channels(
    path: Path | str, yaml_path: tuple[str | int, ...] | str, channels: tuple[str, ...] = _RGB
) -> int:
    """Return the number of channels that `read_picture` gives, by the header; raise the same."""
    path = Path(path)
    with convert_errors(path, yaml_path, _CONVERT):
        return _shape(path, _check_picture(path), channels)[2]


def picture_size(path: Path | str, yaml_path: tuple[str | int, ...] | str) -> tuple[int, int]:
    """Return rows and columns of what `read_picture` gives, by the header; raise the same."""
    path = Path(path)
    with convert_errors(path, yaml_path, _CONVERT):
        return _shape(path, _check_picture(path), _RGB)[:2]


def _shape(path: Path, status: os.stat_result, channels: tuple[str, ...]) -> tuple[int, int, int]:
    """Return rows, columns and channels of a picture, by its header."""
    return _shape_in_state(path, status.st_size, status.st_ctime_ns, status.st_ino, channels)


@lru_cache(1024)  # crops of one picture: 2 % of a frame of 64 x 64 pixels of a data set
def _shape_in_state(
    path: Path, size: int, changed: int, inode: int, channels: tuple[str, ...]
) -> tuple[int, int, int]:
    """Return the shape of a picture; its header is read once in each state of the file."""
    del size, changed, inode
    with open_image(path) as source:
        spec = source.spec()
        count = len(_header(spec, channels)[0])
        shape = spec.height, spec.width
        if source.format_name() == "openexr":
            shape = spec.full_height, spec.full_width
        is_turned = 5 <= spec.get_int_attribute("Orientation", 1) <= 8
        return (*(shape[::-1] if is_turned else shape), count)


def _check_picture(path: Path) -> os.stat_result:
    """Return the state of a file; refuse what is no whole regular file, and raw files of cameras.

    Raise UnusableFile.
    """
    status = check_file(path)
    if is_raw(path):
        raise UnusableFile(
            "is a raw file: a camera's codes, not light",
            "develop it with a raw converter, and give a 16-bit TIFF with its color profile",
        )
    return status


@contextmanager
def open_image(path: Path) -> Iterator[Any]:
    """Open a file with OpenImageIO, colors not multiplied by alpha. Raise UnusableFile."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # else colors come multiplied by alpha
    source = oiio.ImageInput.open(str(path.absolute()), config)
    if source is None:
        reason = pending_error(oiio.geterror)
        raise _unsupported(path, reason) or UnusableFile(
            "cannot be read as an image: unknown format, or damaged"
        )
    try:
        if source.format_name() == "null":
            raise UnusableFile("is no image")
        yield source
    finally:
        source.close()
        pending_error(source.geterror)


def _unsupported(path: Path | None, reason: str) -> UnusableFile | None:
    """Return the error for a file that is whole, but of a kind that OpenImageIO cannot read."""
    if path is not None:
        with open(path, "rb") as file:
            if file.read(8)[4:] == b"ftyp":
                kinds = "HEIC, AVIF or a video"
                return UnusableFile(f"is of a kind that is not read ({kinds})", _CONVERT)
    if not re.search("not (supported|configured)|unsupported", reason.lower()):
        return None  # other words speak of places in the library's own code
    first = reason.partition(". ")[0].rpartition(": ")[2].rstrip(".")  # it says some things twice
    said = brief_reason(first, path or Path())
    return UnusableFile(f"cannot be read: {said}", "save it in another way: " + _CONVERT)


def _read(
    path: Path, source: Any, encoding: str, white: float, wanted: tuple[str, ...], signed: bool
) -> LinearImage:
    spec = source.spec()
    chosen, notes = _header(spec, wanted)
    if wanted != _RGB and len(wanted) == 3:  # X, Y, Z are no colors of a display
        coding, said = picture_coding(path, "linear", source, spec, 1)
    else:
        coding, said = picture_coding(path, encoding, source, spec, len(chosen))
    data, more = read_samples(source, spec, chosen)
    if source.seek_subimage(1, 0):
        more.append("only the first of several images in the file is used")
    pending_error(source.geterror)
    if source.format_name() == "openexr":
        data = extract_display_window(data, spec, more)
    light = _linear(data, coding, white, signed, more)
    light = np.ascontiguousarray(upright(light, spec, more))
    names = tuple(spec.channelnames[index] for index in chosen)
    more += [*said, *_remarks(spec), *(_unused_bits(data, spec) if white == 1 else [])]
    return LinearImage(light, names, (*notes, *more), coding.name)


def _header(spec: Any, wanted: tuple[str, ...]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the indices of the channels to read, and notes. Raise UnusableFile."""
    _check_kind(spec)
    chosen, notes = _choose_channels(tuple(spec.channelnames), spec.alpha_channel, wanted)
    check_size(spec, len(chosen))
    return chosen, notes


def _check_kind(spec: Any) -> None:
    if spec.deep:
        raise UnusableFile("is a deep image")
    if spec.depth > 1:
        raise UnusableFile("is a volume, not an image")
    kind = spec.get_string_attribute("jpeg:ColorSpace")
    photometric = spec.get_int_attribute("tiff:PhotometricInterpretation", 1)
    if kind in ("CMYK", "YCCK") or photometric == 5:
        raise UnusableFile("holds printing inks (CMYK), not light", "convert it to RGB")
    if photometric not in _LIGHT:
        raise UnusableFile(f"is a TIFF of photometric kind {photometric}, not gray or RGB")
    if photometric == 0 and str(spec.format) != "uint8":
        raise UnusableFile(
            "is a TIFF where white is 0, with more than 8 bits"
        )  # not turned by OIIO


def _choose_channels(
    names: tuple[str, ...], alpha: int, wanted: tuple[str, ...]
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the indices of the gray or the wanted channels, and notes on what is dropped."""
    upper = [name.upper() for name in names]
    color = [i for i, name in enumerate(upper) if name not in _ALPHA and i != alpha]
    depth = [] if "X" in upper else [i for i in color if upper[i].rpartition(".")[2] in _DEPTH]
    if depth and depth == color:
        shown = ", ".join(names[i] for i in depth)
        raise UnusableFile(f"holds depth (channel {shown}), not light", "use a file of light")
    listed, color = color, [i for i in color if i not in depth]
    layer = _layer(upper, wanted)
    if layer:
        chosen = tuple(upper.index(layer + name) for name in wanted)
    elif all(name in upper for name in wanted):
        chosen = tuple(upper.index(name) for name in wanted)
    elif wanted != _RGB:
        shown = ", ".join(names) or "none"
        raise UnusableFile(
            f"has no channels {', '.join(wanted)} but {shown}", "name the channels of the file so"
        )
    elif len(color) == 1:
        chosen = (color[0],)
    elif "Y" in upper and not {"RY", "BY"} & set(upper) and len(color) != 2:
        chosen = (upper.index("Y"),)
    elif len(color) == 2:
        shown = ", ".join(names[i] for i in color)
        raise UnusableFile(f"has two color channels ({shown}); one or three are needed")
    else:
        raise UnusableFile(f"has no channels R, G, B but {', '.join(names) or 'none'}")
    dropped = [names[i] for i in listed if i not in chosen]
    notes = ["alpha channel dropped"] if len(listed) < len(names) else []
    if dropped:
        notes.append(f"channels {', '.join(dropped)} dropped")
    return chosen, tuple(notes)


def _layer(names: list[str], wanted: tuple[str, ...]) -> str:
    """Return the prefix of the layer that holds the picture; "" without a layer.

    Renderers write channels such as ViewLayer.Combined.R, with other layers (Blender manual,
    "Output Properties", OpenEXR MultiLayer).
    """
    prefixes = {name[: -len(wanted[0])] for name in names if name.endswith("." + wanted[0])}
    whole = [layer for layer in prefixes if all(layer + name in names for name in wanted)]
    combined = [layer for layer in whole if layer.endswith("COMBINED.")]
    if all(name in names for name in wanted) or not whole:
        return ""
    if len(whole) > 1 and len(combined) != 1:
        shown = ", ".join(sorted(layer.rstrip(".") for layer in whole))
        raise UnusableFile(f"has several layers of color ({shown})", "save only the intended one")
    return (combined or whole)[0]


def check_size(spec: Any, channels: int) -> None:
    """Refuse a file by its header alone, before a byte of the image is unpacked."""
    pixels = max(spec.width * spec.height, spec.full_width * spec.full_height)
    if pixels > MOST_PIXELS:
        raise UnusableFile(
            f"claims {spec.width} x {spec.height} pixels; at most {MOST_PIXELS:.0e} are read",
            "crop it or reduce its size",
        )
    need = pixels * channels * (4 + 4) + spec.image_bytes(True)
    free = memory.available()
    if need > free:
        size = f"{spec.width} x {spec.height} pixels"
        raise too_large(
            f"an image of {size} needs {need / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are free"
        )


def read_samples(
    source: Any,
    spec: Any,
    chosen: tuple[int, ...],
    page: int = 0,
    rows: tuple[int, int] | None = None,
) -> tuple[np.ndarray, list[str]]:
    """Return the chosen channels as stored, integers as they are, else as float32; and notes.

    Whole numbers of an EXR are numbers as its others are, and no codes: they come as float32.
    spec: the header of the page, by default the first of several images in the file; rows: from
    one to another alone, of a file without tiles.
    """
    kinds = {_READ_AS.get(str(spec.channelformat(index))) for index in chosen}
    kind = kinds.pop() if len(kinds) == 1 else None
    name = "float" if kind is None else _OIIO_NAMES.get(kind, np.dtype(kind).name)
    first, last = min(chosen), max(chosen) + 1
    if source.format_name() == "openexr" and (kind or kinds):
        data = _read_numbers(source, spec, page, first, last, rows)
    else:
        data = _read_channels(source, spec, page, first, last, name, rows)
    reason = pending_error(source.geterror)
    if data is None or (reason and "extraneous bytes" not in reason):
        raise _unsupported(None, reason) or truncated_file()
    order = [index - first for index in chosen]
    notes = ["the file has stray bytes in it"] if reason else []
    return (data if order == list(range(last - first)) else data[:, :, order]), notes


def _read_channels(
    source: Any,
    spec: Any,
    page: int,
    first: int,
    last: int,
    name: str,
    rows: tuple[int, int] | None,
) -> np.ndarray | None:
    """Return channels as numbers of a type (n, w, channels); None where the file ends."""
    if rows is None:
        whole: np.ndarray | None = source.read_image(page, 0, first, last, name)
        return whole
    # Whole strips of a TIFF: to other rows OpenImageIO unpacks all those before.
    strip = _strip(spec)
    top, bottom = rows[0] // strip * strip, min(-(-rows[1] // strip) * strip, spec.height)
    ends = spec.y + top, spec.y + bottom
    found = source.read_scanlines(page, 0, *ends, 0, first, last, name)
    if found is None:
        return None
    shaped = np.asarray(found).reshape(bottom - top, spec.width, last - first)
    return shaped[rows[0] - top : rows[1] - top]


def _read_numbers(
    source: Any, spec: Any, page: int, first: int, last: int, rows: tuple[int, int] | None
) -> np.ndarray | None:
    """Return channels of an EXR, whole numbers not scaled to fractions; None where it ends."""
    height = spec.height if rows is None else rows[1] - rows[0]
    out = np.empty((height, spec.width, last - first), np.float32)
    for channel in range(first, last):
        name = "uint" if str(spec.channelformat(channel)) in _READ_AS else "float"
        data = _read_channels(source, spec, page, channel, channel + 1, name, rows)
        if data is None:
            return None
        out[:, :, channel - first] = data.reshape(height, spec.width)
    return out


def is_in_strips(spec: Any) -> bool:
    """Return whether rows of an image can be read by themselves: it has no tiles, and no window."""
    whole = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    has_window = whole != (spec.x, spec.y, spec.width, spec.height)
    return spec.tile_width == 0 and not has_window and _strip(spec) <= _BLOCK


def _strip(spec: Any) -> int:
    """Return the rows that a file packs together, where it matters which of them are read."""
    if spec.get_string_attribute("compression", "none") == "none":
        return 1
    return max(1, int(spec.get_int_attribute("tiff:RowsPerStrip", 1)))


def extract_display_window(data: np.ndarray, spec: Any, notes: list[str]) -> np.ndarray:
    """Return an EXR's display window, black where the file holds no data."""
    left, top = spec.x - spec.full_x, spec.y - spec.full_y
    shape = (spec.full_height, spec.full_width)
    if (left, top) == (0, 0) and shape == data.shape[:2]:
        return data
    rows = slice(max(top, 0), min(top + data.shape[0], shape[0]))
    columns = slice(max(left, 0), min(left + data.shape[1], shape[1]))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        raise UnusableFile("holds no pixel inside its display window")
    notes.append("the data window differs from the display window; the latter is used")
    window = np.zeros((*shape, data.shape[2]), data.dtype)
    window[rows, columns] = data[
        rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
    ]
    return window


def _linear(
    data: np.ndarray, coding: Coding, white: float, signed: bool, notes: list[str]
) -> np.ndarray:
    """Return linear light / white in Rec. 709, float32."""
    if coding.profile:
        try:
            found = converted_by_tables(coding.profile, _eight_bits(data))
        except ValueError as error:
            remedy = "convert it to sRGB, or write encoding: srgb to go without it"
            raise UnusableFile(f"{coding.name} {error}", remedy) from None
        data = found[:, :, : data.shape[2]]
    light = _decoded(data, coding, white, signed, notes)
    below = 0 if coding.to_rec709 is None else _to_rec709(light, coding.to_rec709, signed)
    _check_light(light, data, 0)
    said = coding.note(below / light[:, :, 0].size)
    notes += [said] if said else []
    return light


def _decoded(
    data: np.ndarray, coding: Coding, white: float, signed: bool, notes: list[str]
) -> np.ndarray:
    """Return linear light / white: by table up to 16 bits, else block by block."""
    if data.dtype.kind == "u" and data.dtype.itemsize <= 2:
        codes = np.arange(np.iinfo(data.dtype).max + 1) / np.iinfo(data.dtype).max
        codes = np.broadcast_to(codes[:, np.newaxis], (len(codes), len(coding.curves)))
        tables = _relative_to_white(codes, coding, white)
        if len(coding.curves) == 1:
            return np.asarray(tables[:, 0][data])
        return np.stack([tables[:, c][data[:, :, c]] for c in range(data.shape[2])], axis=2)
    full = 1.0 if data.dtype.kind == "f" else float(np.iinfo(data.dtype).max)
    light = np.empty(data.shape, np.float32)
    lowest, below, largest = 0.0, 0, 0.0
    for row in range(0, len(data), _BLOCK):
        block = data[row : row + _BLOCK]
        _check_finite(block, row)
        if not signed and block.min(initial=0.0) < 0:
            lowest = min(lowest, float(block.min()))
            below += int(np.count_nonzero(block < 0))
            block = np.maximum(block, 0)
        largest = max(largest, float(block.max(initial=0.0)))
        light[row : row + _BLOCK] = _relative_to_white(
            block.astype(np.float64) / full, coding, white
        )
        _check_light(light[row : row + _BLOCK], block, row)
    if lowest < -MOST_NEGATIVE * largest:
        y, x, channel = np.argwhere(data == data.min())[0]
        raise UnusableFile(
            f"holds a negative value ({data[y, x, channel]:g} at row {y}, column {x}; the largest"
            f" is {largest:g}); light is 0 or more",
            "replace such values, for example by 0",
        )
    if below:
        notes.append(
            f"{below} of {data.size} values are negative, down to {lowest:.3g}; they become 0"
        )
    return light


def _eight_bits(data: np.ndarray) -> np.ndarray:
    """Return codes of 8 bits; those of other kinds rounded, and clipped to 0 and 1."""
    if data.dtype == np.uint8:
        return data
    full = 1.0 if data.dtype.kind == "f" else float(np.iinfo(data.dtype).max)
    return np.rint(np.clip(np.nan_to_num(data / full), 0, 1) * 255).astype(np.uint8)


def _to_rec709(light: np.ndarray, matrix: np.ndarray, signed: bool) -> int:
    """Convert light in place; return how many samples are outside the gamut, and clip those.

    `signed`: they are kept.
    """
    outside = 0
    for row in range(0, len(light), _BLOCK):
        block = light[row : row + _BLOCK]
        found = block @ matrix.T.astype(np.float32)
        if not signed:
            limit = -_ROUNDING * np.maximum(block.max(axis=2), 0)
            outside += int(np.count_nonzero(found.min(axis=2) < limit))
            found = np.maximum(found, 0)
        block[:] = found
    return outside


def _relative_to_white(code: np.ndarray, coding: Coding, white: float) -> np.ndarray:
    """Return the light of codes (full scale = 1) over `white`, float32; infinite beyond that."""
    out = np.empty(code.shape, np.float32)
    with np.errstate(over="ignore"):
        if len(coding.curves) == 1:
            out[...] = coding.curves[0](code) / white
        else:
            for channel, curve in enumerate(coding.curves):
                out[..., channel] = curve(code[..., channel]) / white
    return out


def _check_light(light: np.ndarray, stored: np.ndarray, row: int) -> None:
    if light.max(initial=0.0) <= MOST_LIGHT and light.min(initial=0.0) >= -MOST_LIGHT:
        return
    y, x, channel = np.argwhere(~(np.abs(light) <= MOST_LIGHT))[0]
    raise UnusableFile(
        f"holds a value too large ({stored[y, x, channel]:g} at row {row + y}, column {x}): its "
        f"light over `white` is beyond {MOST_LIGHT:g}",
        "correct encoding and white, or scale the image",
    )


def _check_finite(block: np.ndarray, row: int) -> None:
    wrong = ~np.isfinite(block)
    if wrong.any():
        y, x, channel = np.argwhere(wrong)[0]
        raise UnusableFile(
            f"holds a value not finite ({block[y, x, channel]:g} at row {row + y}, column {x})",
            "replace such values, for example by 0",
        )


def _unused_bits(data: np.ndarray, spec: Any) -> list[str]:
    """Return a note where codes of 16 bits use fewer."""
    largest = int(data.max(initial=0)) if data.dtype == np.uint16 else 0
    bits = largest.bit_length()
    if not 8 <= bits <= 14 or spec.get_int_attribute("oiio:BitsPerSample", 16) < 16:
        return []
    return [
        f"its largest code is {largest} of 65535; if its samples are linear, of {bits} bits, write"
        f" encoding: linear and white: {(2**bits - 1) / 65535:.6g}"
    ]


def upright(data: np.ndarray, spec: Any, notes: list[str]) -> np.ndarray:
    """Return the image turned upright, by the EXIF / TIFF orientation 1 to 8."""
    orientation = spec.get_int_attribute("Orientation", 1)
    if not 2 <= orientation <= 8:
        return data
    notes.append(f"turned upright (orientation tag {orientation})")
    if orientation >= 5:
        data = data.transpose(1, 0, 2)  # 5 is exactly this
    if orientation in (2, 3, 6, 7):
        data = data[:, ::-1]
    if orientation in (3, 4, 7, 8):
        data = data[::-1]
    return data


def _remarks(spec: Any) -> list[str]:
    notes = []
    if abs(spec.get_float_attribute("PixelAspectRatio", 1.0) - 1) > 1e-3:
        notes.append("its pixels are not square; they are read as square")
    return notes
