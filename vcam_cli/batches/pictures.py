"""Pictures of batches: read ahead, cut, stacked on the device, in linear light."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arguments import brief
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.devices.processor import Processor
from vcam_cli.errors import bad
from vcam_cli.files.images.color import decode_srgb
from vcam_cli.parallel import ThreadPool

Places = Sequence[tuple[int, int]] | Callable[[int], tuple[int, int]] | None
"""Top row and left column of each picture's crop, or what gives them by its number; None: in the
middle."""


def stacks(
    pictures: Iterable[Any],
    count: int,
    camera: Camera,
    device: Processor,
    crop: tuple[int, int] | None,
    places: Places,
) -> Iterator[Any]:
    """Yield arrays (n, rows, columns, channels) of pictures.

    Parameters
    ----------
    pictures : iterable
        As those of `frames`.
    count : int
        Most pictures of an array.
    camera : Camera
        Its scene's source says white and encoding of files.
    device : Processor
        The device.
    crop : tuple of int or None
        Rows and columns of the crop; None for all of a picture.
    places : Places
        Places of the crops.
    """

    def window(picture: Any, number: int) -> Any:
        if crop is None:
            return picture
        rows, columns = picture.shape[:2]
        top, left = (rows - crop[0]) // 2, (columns - crop[1]) // 2
        if places is not None:
            top, left = places(number) if callable(places) else places[number]
        if not (0 <= top <= rows - crop[0] and 0 <= left <= columns - crop[1]):
            raise ValueError(f"picture {number}: no crop of {crop} at {(top, left)} lies inside")
        return picture[top : top + crop[0], left : left + crop[1]]

    if getattr(pictures, "ndim", 0) == 4:
        whole: Any = pictures
        for start in range(0, len(whole), count):
            some = whole[start : start + count]
            if crop is None:
                yield some
            else:
                yield _stacked([window(p, start + n) for n, p in enumerate(some)], device)
        return
    held: list[Any] = []
    for number, picture in enumerate(_read_ahead(pictures, camera, count)):
        held.append(window(picture, number))
        if len(held) == count:
            yield _stacked(held, device)
            held = []
    if held:
        yield _stacked(held, device)


def _stacked(pictures: Sequence[Any], device: Processor) -> Any:
    """Return pictures of one shape as an array (n, rows, columns, channels)."""
    shaped = [p if p.ndim == 3 else p[:, :, None] for p in pictures]
    if len({p.shape for p in shaped}) > 1:
        raise ValueError("pictures differ in shape; write one shape, or crop")
    return device.stacked(shaped)


def _read_ahead(pictures: Iterable[Any], camera: Camera, count: int) -> Iterator[Any]:
    """Yield pictures; files are decoded ahead by threads."""
    from vcam_cli.files.images.images import read_picture

    source = camera.scene.source
    encoding, white = "auto", 1.0
    if isinstance(source, ImageFile):
        encoding, white = source.encoding, source.white

    def read(picture: Any) -> Any:
        if isinstance(picture, str | Path):
            return read_picture(picture, encoding, white, ("scene", "source", "file")).data
        if not hasattr(picture, "ndim") or picture.ndim not in (2, 3):
            message = f"{brief(picture)} is no picture"
            raise TypeError(f"{message}; give file names or arrays (rows, columns, channels)")
        return picture

    coming = iter(pictures)
    with ThreadPool(max(1, min(8, count))) as pool:
        waiting = [pool.submit(read, picture) for picture in islice(coming, 2 * count)]
        while waiting:
            yield waiting.pop(0).result()
            waiting += [pool.submit(read, picture) for picture in islice(coming, 1)]


def linear_pictures(stack: Any, device: Processor, camera: Camera) -> Array:
    """Return pictures in linear light on the device, 1 = white.

    Parameters
    ----------
    stack : array
        Pictures (n, rows, columns, channels), of the processor or of the device.
    device : Processor
        The device.
    camera : Camera
        Its scene's source says white and encoding.
    """
    source = camera.scene.source
    white = source.white if isinstance(source, ImageFile) else 1.0
    values = device.put(stack)
    if values.dtype.kind == "u":
        levels = np.iinfo(str(values.dtype)).max
        codes = np.arange(levels + 1) / levels
        linear = isinstance(source, ImageFile) and source.encoding == "linear"
        table = codes if linear else decode_srgb(codes)
        return np.take(device.put(table / white, np.float32), values)
    if values.dtype.kind != "f":
        raise bad(
            "scene.source", f"pictures of type {values.dtype}", "write uint8, uint16 or floats"
        )
    return values
