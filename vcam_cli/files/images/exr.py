"""OpenEXR files: raw frames and linear images, float32, lossless.

Why zip at level 1: 12 megapixels of noisy codes and electrons, two threads, take 0.7 times
the time of OpenImageIO's default level for 1.02 times the bytes. Codes alone are better
off with piz (0.3 times the time, 0.93 times the bytes), which takes 1.4 times the time once
electrons are there. Float32 holds codes of up to 24 bits exactly.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vcam_cli.errors import BadInput, bad
from vcam_cli.files.images.image_library import oiio
from vcam_cli.files.images.rows import (
    Attribute,
    RowWriter,
    image_spec,
    pending_error,
    set_attributes,
)

ZIP = "zip:1"  # lossless
oiio.attribute("limits:resolution", 1 << 28)  # a million by default; scattered pixels are one row
_NOT_OURS = ("oiio:", "openexr:", "screenWindow", "compression", "PixelAspectRatio", "DateTime")


class ExrWriter(RowWriter):
    """Context that writes an EXR progressively, so that later rows can be computed meanwhile.

        with ExrWriter(path, (rows, columns), ["dn", "electrons"], {"name": "x"}) as raw:
            raw.write_rows(0, {"dn": dn[:64], "electrons": electrons[:64]})

    `shape` is (height, width); every row must be written, in order, in blocks of any height
    (multiples of 16 rows are fastest). Float attributes are stored as float32. The file appears
    under its name, whole, when the context ends without an error.

    Raises CannotDo (disk full, permission), ValueError for misuse.
    """

    def __init__(
        self,
        path: Path | str,
        shape: tuple[int, int],
        channels: Sequence[str],
        attributes: Mapping[str, Attribute] | None = None,
        compression: str = ZIP,
    ) -> None:
        if len(set(channels)) != len(channels):
            raise ValueError(f"channel names must differ: {channels}")
        self._channels = tuple(channels)
        spec = image_spec(*shape, len(channels), "float")
        spec.channelnames = self._channels
        set_attributes(spec, {**(attributes or {}), "compression": compression})
        super().__init__(path, "openexr", spec, _is_whole)

    def write_rows(self, first_row: int, blocks: Mapping[str, np.ndarray]) -> None:
        """Write a block (n, width) of every channel, rows first_row .. first_row + n - 1."""
        if set(blocks) != set(self._channels):
            raise ValueError(f"channels {sorted(blocks)} given, {self._channels} expected")
        rows = len(blocks[self._channels[0]])
        together = np.empty((rows, self._spec.width, len(self._channels)), np.float32)
        for index, name in enumerate(self._channels):
            if blocks[name].shape != together.shape[:2]:
                raise ValueError(f"channel {name}: shape {blocks[name].shape}")
            together[:, :, index] = blocks[name]
        self.write(first_row, together)


def write_exr(
    path: Path | str,
    channels: Mapping[str, np.ndarray],
    attributes: Mapping[str, Attribute] | None = None,
    compression: str = ZIP,
) -> None:
    """Write arrays (h, w) as channels of an EXR file, as float32, see `ExrWriter`."""
    shape = next(iter(channels.values())).shape
    with ExrWriter(path, shape, list(channels), attributes, compression) as writer:
        for row in range(0, shape[0], 256):
            writer.write_rows(row, {name: a[row : row + 256] for name, a in channels.items()})


def read_exr(path: Path | str) -> tuple[dict[str, np.ndarray], dict[str, Attribute]]:
    """Return the channels (h, w), float32, by name, and the attributes of an EXR file's first part.

    Raise BadInput when it cannot be read whole.
    """
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise _unreadable(path, pending_error(oiio.geterror))
    try:
        spec = source.spec()
        data = source.read_image(0, 0, 0, spec.nchannels, "float")
        reason = pending_error(source.geterror)
        if data is None or reason or source.format_name() != "openexr":
            raise _unreadable(path, reason or "it is no EXR file")
        names = spec.channelnames
    finally:
        source.close()
    channels = {name: np.ascontiguousarray(data[:, :, i]) for i, name in enumerate(names)}
    return channels, _attributes(spec)


def _attributes(spec: oiio.ImageSpec) -> dict[str, Attribute]:
    found = {item.name: item.value for item in spec.extra_attribs}
    return {
        name: value
        for name, value in found.items()
        if isinstance(value, str | int | float) and not name.startswith(_NOT_OURS)
    }


def _is_whole(path: Path) -> bool:
    """Tell whether the last row can be read, which takes the header, all offsets and its bytes."""
    source = oiio.ImageInput.open(str(path))
    if source is None:
        pending_error(oiio.geterror)
        return False
    try:
        spec = source.spec()
        row = source.read_scanlines(0, 0, spec.height - 1, spec.height, 0, 0, 1, "float")
        return row is not None and not pending_error(source.geterror)
    finally:
        source.close()


def _unreadable(path: Path | str, reason: str) -> BadInput:
    return bad((), f"cannot read {path}: {reason}", "give a complete OpenEXR file")
