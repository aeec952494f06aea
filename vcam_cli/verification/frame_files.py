"""Files of raw frames as instruments write them -> codes as the ADC gave them.

OpenImageIO scales samples of fewer bits than their container to its full range: packed 12-bit TIFF
by 65535/4095, PGM by 65535 over its maximum. Here they are scaled back, which is exact.
"""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.errors import BadInput
from vcam_cli.files.file_checks import UnusableFile, check_file, check_regular, is_raw
from vcam_cli.files.images.camera_raw import read_codes
from vcam_cli.files.images.exr import read_exr
from vcam_cli.files.images.images import check_size, open_image, read_samples
from vcam_cli.records import dataclass

MOST_PIXELS = 500_000_000
"""Of a frame; the largest sensors have 400 million pixels."""
_NETPBM_START = re.compile(
    rb"(P[25])(?:\s|#[^\n]*\n)+\d+(?:\s|#[^\n]*\n)+\d+(?:\s|#[^\n]*\n)+(\d+)\s"
)
_PAGED = (".tif", ".tiff")
_THUMBNAIL = 1
"""Bit of the TIFF tag NewSubfileType of a smaller copy of another page."""


@dataclass(frozen=True)
class Page:
    """A frame in a file."""

    path: Path
    number: int = 0
    """Of the page, from 0."""
    count: int = 1
    """Pages of the file."""

    @property
    def name(self) -> str:
        """Notes on it, for the user."""
        more = f", page {self.number + 1}" if self.count > 1 else ""
        return f"{self.path.name}{more}"


def pages(path: Path) -> list[Page]:
    """Return the frames in a file, by its header alone; smaller copies of pages left out.

    Raise UnusableFile for what is no file of frames.
    """
    check_regular(path)
    if path.suffix.lower() not in _PAGED:
        return [Page(path)]
    check_file(path)
    numbers = []
    with open_image(path) as source:
        for number in itertools.count():
            if not source.seek_subimage(number, 0):
                break
            kind = source.spec().get_int_attribute("tiff:subfiletype", 0)
            if not kind & _THUMBNAIL:
                numbers.append(number)
        source.geterror()  # that there is no further page
    return [Page(path, number, len(numbers)) for number in numbers]


def read_page(page: Page, colors: str, readout: str = "") -> Array:
    """Return the codes of a frame as they are stored, (rows, columns) where it has one channel.

    Parameters
    ----------
    page : Page
        The frame.
    colors : str
        Colors of the smallest block that repeats, row by row, as the measurement has them.
    readout : str, optional
        Readout whose codes an EXR file holds beside others, in the channel dn.READOUT.

    Raises
    ------
    UnusableFile
        The file holds no numbers, or is too large.
    CannotDo
        It does not fit the memory.
    """
    path = page.path
    check_regular(path)
    if is_raw(path):
        codes, found = read_codes(path)
        if found and found != colors:
            raise UnusableFile(f"its pixels are {found}, and pattern says {colors}")
        return codes
    if path.suffix == ".npy":
        return _read_array(path)
    check_file(path)
    with open_image(path) as source:
        if page.number and not source.seek_subimage(page.number, 0):
            raise UnusableFile(f"has no page {page.number + 1}")
        spec = source.spec()
        _check_pixels(spec.width * spec.height)
        check_size(spec, spec.nchannels)
        if source.format_name() == "openexr":
            return _read_exr(path, source, readout)
        data, _ = read_samples(source, spec, tuple(range(spec.nchannels)), page.number)
        data = data[:, :, 0] if data.shape[2] == 1 else data
        return _unscaled(data, _highest(path, spec, source.format_name()))


def readouts_in(page: Page) -> tuple[str, ...]:
    """Return the names of readouts whose codes a frame of vcam holds beside the merged ones."""
    if page.path.suffix.lower() != ".exr":
        return ()
    with open_image(page.path) as source:
        names = source.spec().channelnames
    return tuple(name.removeprefix("dn.") for name in names if name.startswith("dn."))


def _check_pixels(count: int, each: int = 8) -> None:
    if count > MOST_PIXELS:
        raise UnusableFile(f"claims {count:.2g} pixels; a frame has at most {MOST_PIXELS:.0e}")
    if count * each > memory.available():
        raise UnusableFile(f"its {count:.2g} pixels do not fit the memory")


def _read_array(path: Path) -> Array:
    header = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(header, np.ndarray):
        header.close()
        raise UnusableFile("holds several arrays (npz)", "save each frame by numpy.save")
    if header.dtype.kind not in "uif":
        raise UnusableFile(f"holds {_KINDS.get(header.dtype.kind, header.dtype.name)}, not codes")
    _check_pixels(header.size)
    return np.array(header)


_KINDS = {
    "U": "text", "S": "bytes", "V": "structures", "c": "complex numbers", "b": "truth values",
    "M": "dates", "m": "durations", "O": "Python objects",
}  # fmt: skip


def _read_exr(path: Path, source: Any, readout: str) -> Array:
    if source.seek_subimage(1, 0):
        raise UnusableFile("is an EXR of several parts", "save each frame as a separate file")
    try:
        channels, _ = read_exr(path)
    except BadInput as error:
        raise UnusableFile(error.problems[0].message) from None
    several = [name.removeprefix("dn.") for name in channels if name.startswith("dn.")]
    if readout in several:
        return channels[f"dn.{readout}"]
    if readout and several:
        raise UnusableFile(
            f"has no codes of {readout}, but of {', '.join(several)}",
            f"write levels.readout: {several[0]}",
        )
    if "dn" in channels:
        return channels["dn"]
    return next(iter(channels.values())) if len(channels) == 1 else np.zeros((1, 1, 2))


def _highest(path: Path, spec: Any, kind: str) -> int:
    """Return the code that OpenImageIO gives as the largest of its type; 0 where it scales none."""
    if kind == "pnm":
        with path.open("rb") as file:
            found = _NETPBM_START.match(file.read(4096))
        return int(found[2]) if found else 0
    bits = spec.get_int_attribute("oiio:BitsPerSample", 0)
    return 2**bits - 1 if bits else 0


def _unscaled(data: Array, highest: int) -> Array:
    """Return codes whose largest was scaled to that of their type."""
    if data.dtype.kind != "u" or not highest or highest >= np.iinfo(data.dtype).max:
        return data
    scale = highest / float(np.iinfo(data.dtype).max)
    return np.rint(data * scale).astype(data.dtype)
