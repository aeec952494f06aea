"""Maps beside a scene's picture: how opaque, and how far away it is at every sample."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import bad
from vcam_cli.files.file_checks import UnusableFile, check_file, convert_errors
from vcam_cli.files.images.images import (
    check_size,
    extract_display_window,
    open_image,
    read_picture,
    read_samples,
    upright,
)

YamlPath = tuple[str | int, ...]
LARGEST = 1e9
"""Of the values of a map of pixels: more electrons than any well holds."""


def read_opacity(path: Path | str, yaml_path: YamlPath) -> Array:
    """Return the opacity (h, w) of an image file, 0 to 1: its alpha, or its only channel.

    Codes are opacity, and no light: full scale is 1, whatever their encoding.

    Raises
    ------
    BadInput
        As `read_picture` does, and for a file of colors without alpha or values above 1.
    """
    with convert_errors(Path(path), yaml_path, "save it as a gray PNG"):
        check_file(Path(path))
        with open_image(Path(path)) as source:
            spec = source.spec()
            alpha = spec.channelnames[spec.alpha_channel] if spec.alpha_channel >= 0 else None
    wanted = ("R", "G", "B") if alpha is None else (alpha.upper(),)
    data = read_picture(path, "linear", 1.0, yaml_path, wanted).data
    if data.shape[2] != 1:
        message = "the mask has three channels and no alpha; opacity is one number"
        raise bad(yaml_path, message, "save it as a gray image, or with an alpha channel")
    if float(data.max()) > 1:
        message = f"the mask has an opacity of {data.max():.4g}, more than 1"
        raise bad(yaml_path, message, "scale it to 0 to 1")
    return np.ascontiguousarray(data[:, :, 0])


def read_depth(
    path: Path | str,
    unit: float,
    yaml_path: YamlPath,
    size: tuple[int, int],
    channel: str | None = None,
) -> tuple[Array, tuple[str, ...]]:
    """Return the distances (h, w) that a file has for every sample of a picture, and notes.

    Parameters
    ----------
    path : Path or str
        An image with one channel, or with a channel Z; or a .npy of rows x columns.
    unit : float
        Length represented by a value of 1 [m]; codes of whole numbers are values, too.
    yaml_path : tuple
        Key that names the file.
    size : tuple of int
        Rows and columns of the picture.
    channel : str, optional
        Name of the channel; by default the only one, or that named Z or depth.

    Returns
    -------
    depth : Array
        Distances [m], above 0; infinite for the sky.
    notes : tuple of str
        What was taken for granted, for the user.

    Raises
    ------
    BadInput
        For a file that is no such map, of another size than the picture, or with a distance that is
        none.
    """
    path, notes = Path(path), list[str]()
    remedy = "save it as an .exr with one channel of distances in m"
    with convert_errors(path, yaml_path, remedy):
        check_file(path)
        stored = (
            _numpy_map(path)
            if path.suffix.lower() == ".npy"
            else _image_map(path, partial(_depth_channel, wanted=channel))
        )
        if stored.shape != size:
            raise UnusableFile(
                f"has {stored.shape[0]} x {stored.shape[1]} distances for a picture of {size[0]} x"
                f" {size[1]} samples",
                "give one distance for every sample of the picture",
            )
        if stored.dtype.kind in "ui" and unit == 1.0:
            notes.append(
                f"{path.name} holds whole numbers, read as meters; for millimeters write"
                f" depth: {{file: {path.name}, unit: 1 mm}}"
            )
        depth = np.asarray(stored * unit, np.float32)
        wrong = ~(depth > 0)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise UnusableFile(
                f"holds {stored[row, column]:g} at row {row}, column {column}, one of {wrong.sum()}"
                " values that are no distance above 0",
                "fill them in; write inf for the sky",
            )
    return depth, tuple(notes)


def read_pixels(
    path: Path | str, yaml_path: YamlPath, least: tuple[int, int], positive: bool
) -> Array:
    """Return one number for every pixel (h, w) from an image or NPY file of one channel.

    Parameters
    ----------
    path : Path or str
        An image with one channel, or a .npy of rows x columns; its values as they are stored.
    yaml_path : tuple
        Key that names the file.
    least : tuple of int
        Rows and columns that it has at least.
    positive : bool
        Whether negative values, and a mean of 0, are refused.

    Raises
    ------
    BadInput
        For a file that is no such map, is smaller, or has a value that is not allowed.
    """
    path = Path(path)
    with convert_errors(path, yaml_path, "save it as an .exr with one channel, or as .npy"):
        check_file(path)
        stored = _numpy_map(path) if path.suffix.lower() == ".npy" else _image_map(path, _only)
        if any(have < want for have, want in zip(stored.shape, least, strict=True)):
            raise UnusableFile(
                f"has {stored.shape[0]} x {stored.shape[1]} values for an array of {least[0]} x"
                f" {least[1]} pixels",
                "give one value for every pixel",
            )
        found = np.asarray(stored, np.float32)
        wrong = ~np.isfinite(found) | (np.abs(found) > LARGEST) | (positive & (found < 0))
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            kind = f"numbers from 0 to {LARGEST:g}" if positive else f"within +-{LARGEST:g}"
            raise UnusableFile(
                f"holds {stored[row, column]:g} at row {row}, column {column}, one of {wrong.sum()}"
                f" values that are not {kind}",
                "replace them, for example by the mean",
            )
        if positive and not found.any():
            raise UnusableFile("is 0 everywhere", "give values relative to a mean above 0")
    return found


def _only(names: tuple[str, ...]) -> int:
    """Return the index of the only channel."""
    if len(names) != 1:
        raise UnusableFile(f"has {len(names)} channels", "save it with one channel")
    return 0


def _numpy_map(path: Path) -> Array:
    found = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(found, np.ndarray) or found.ndim != 2 or found.dtype.kind not in "fui":
        raise UnusableFile("is no array of rows x columns of numbers")
    return found


def _image_map(path: Path, choose: Callable[[tuple[str, ...]], int]) -> Array:
    with open_image(path) as source:
        spec = source.spec()
        if spec.deep or spec.depth > 1:
            raise UnusableFile("is a deep image or a volume")
        index = choose(tuple(spec.channelnames))
        check_size(spec, 1)
        bits = spec.get_int_attribute("oiio:BitsPerSample", 8)
        if bits not in (8, 16, 32, 64):
            raise UnusableFile(f"has codes of {bits} bits, which would be read as others")
        notes: list[str] = []
        data, _ = read_samples(source, spec, (index,))
        if source.format_name() == "openexr":
            data = extract_display_window(data, spec, notes)
        return np.asarray(upright(data, spec, notes)[:, :, 0])


def _depth_channel(names: tuple[str, ...], wanted: str | None) -> int:
    """Return the index of the channel of distances."""
    if wanted is None and len(names) == 1:
        return 0
    ends = [name.rpartition(".")[2].upper() for name in names]
    found = [i for i, end in enumerate(ends) if end in ("Z", "DEPTH")]
    if wanted is not None:
        found = [i for i, name in enumerate(names) if name == wanted]
    if len(found) != 1:
        shown = ", ".join(names[:20]) + (" ..." if len(names) > 20 else "")
        what = f"has no channel {wanted}" if wanted else "has no single channel Z"
        raise UnusableFile(f"{what}; it has {shown}", "name the one that holds the distances")
    return found[0]
