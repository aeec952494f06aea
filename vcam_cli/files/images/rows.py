"""Images written a few rows at a time through OpenImageIO, with every failure noticed.

Why so careful: OpenImageIO returns False instead of raising; its EXR writer waits forever when
asked to write again after a failed write; its PNG writer reports success on a full disk.
So a writer stops at its first failure, and the end of the file is read back before it
gets its name.
"""

import errno
import os
import shutil
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vcam_cli.errors import CannotDo
from vcam_cli.files.atomic import cannot_write, write_whole
from vcam_cli.files.images.image_library import oiio

Attribute = str | int | float | tuple[float, ...]
_FULL = 1 << 16  # bytes: a failed write on a disk with less room is the disk's fault


class RowWriter:
    """Context that writes one image, rows in order from the top; whole or not at all."""

    def __init__(
        self,
        path: Path | str,
        file_format: str,
        spec: oiio.ImageSpec,
        is_whole: Callable[[Path], bool],
    ) -> None:
        self._path = Path(path)
        self._file_format = file_format
        self._spec = spec
        self._is_whole = is_whole
        self._next_row = 0
        self._broken = False
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._temporary = stack.enter_context(write_whole(self._path))
            os.close(os.open(self._temporary, os.O_CREAT | os.O_WRONLY, 0o666))  # says why not
            output = oiio.ImageOutput.create(self._file_format)
            if output is None:
                raise self._failure(pending_error(oiio.geterror))
            if not output.open(str(self._temporary), self._spec):
                raise self._failure(pending_error(output.geterror))
            self._output = output
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        closed = self._output.close()
        if error is not None:
            self._stack.__exit__(kind, error, trace)
            return
        with self._stack:
            self._check_whole(closed)

    def write(self, first_row: int, block: np.ndarray) -> None:
        """Write the rows `block` (rows, width, channels), which start at `first_row`.

        Raise CannotDo (disk full), ValueError for a block of the wrong place, shape or type.
        """
        if first_row != self._next_row:
            raise ValueError(f"row {self._next_row} comes next, not {first_row}")
        expected = (self._spec.width, self._spec.nchannels)
        if block.ndim != 3 or block.shape[1:] != expected:
            raise ValueError(f"a block of shape {block.shape} in an image of {expected}")
        last = first_row + block.shape[0]
        if last > self._spec.height:
            raise ValueError(f"{last} rows in an image of {self._spec.height}")
        if self._broken:
            raise self._failure("an earlier write failed")
        if not block.shape[0]:
            return
        written = self._output.write_scanlines(first_row, last, 0, np.ascontiguousarray(block))
        reason = pending_error(self._output.geterror)
        if not written or reason:
            self._broken = True
            raise self._failure(reason)
        self._next_row = last

    def _check_whole(self, closed: bool) -> None:
        reason = pending_error(self._output.geterror)
        if self._next_row != self._spec.height:
            raise ValueError(f"{self._next_row} of {self._spec.height} rows were written")
        if not closed or reason or not self._is_whole(self._temporary):
            raise self._failure(reason or "the file is incomplete")

    def _failure(self, reason: str) -> CannotDo:
        with suppress(OSError):
            if shutil.disk_usage(self._path.parent).free < _FULL:
                return cannot_write(self._path, OSError(errno.ENOSPC, "disk full"))
        numbers = (errno.EFBIG, errno.EDQUOT, errno.EACCES, errno.EPERM, errno.EROFS, errno.EIO)
        number = next((n for n in numbers if os.strerror(n) in reason), 0)
        return cannot_write(self._path, OSError(number, "it could not be written completely"))


def image_spec(height: int, width: int, channels: int, sample: str) -> oiio.ImageSpec:
    """Return an ImageSpec without time or host; `sample` is OpenImageIO's name of the type."""
    if min(height, width, channels) < 1:
        raise ValueError(f"an image of {height} x {width} pixels, {channels} channels")
    spec = oiio.ImageSpec(width, height, channels, sample)
    spec.attribute("DateTime", "")  # empty: none is written, else OpenImageIO writes now
    return spec


def set_attributes(spec: oiio.ImageSpec, attributes: Mapping[str, Attribute]) -> None:
    """Set header attributes; whole numbers beyond 32 bits become text (EXR has none)."""
    for name, value in attributes.items():
        if isinstance(value, bool | int | np.integer):
            small = -(2**31) <= value < 2**31
            spec.attribute(name, int(value) if small else str(int(value)))
        elif isinstance(value, float | np.floating):
            spec.attribute(name, float(value))
        elif isinstance(value, tuple):
            spec.attribute(name, oiio.TypeDesc(f"float[{len(value)}]"), value)
        else:
            spec.attribute(name, str(value))


def pending_error(geterror: Callable[[], str]) -> str:
    """Return OpenImageIO's pending error, which clears it; "" without an error."""
    try:
        text = geterror()
    except UnicodeDecodeError:  # it quotes bytes of the file
        return "the file is damaged"
    return " ".join(text.split())
