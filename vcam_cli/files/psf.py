"""Point spread functions from image files: any that OpenImageIO reads, as linear light.

The file is taken as it lies, its first row on top; an EXR by its display window. Its values are
light in any unit, integers too, and never a coded gray.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files.file_checks import UnusableFile, check_file, convert_errors
from vcam_cli.files.images import check_size, extract_display_window, open_image, read_samples

ROUNDING = 1e-3
"""Part of the largest value below which a negative one is the rounding of a lens program."""
_REMEDY = "give an EXR or TIFF file with one channel, or one for each of psf.wavelengths"
_ALPHA = ("A", "ALPHA")


def read_psf(
    path: Path | str, channels: int, yaml_path: tuple[str | int, ...] | str
) -> NDArray[np.float64]:
    """Return a point spread function (channels, rows, columns), each channel of sum 1.

    channels: as many as the file must have, alpha aside. Raise BadInput (with `yaml_path`) for a
    file that is missing, no image, damaged, of another number of channels, with a value that is
    not finite or clearly negative, or all zero; CannotDo where it may not be read or does not fit
    the memory.
    """
    path = Path(path)
    with convert_errors(path, yaml_path, _REMEDY):
        check_file(path)
        with open_image(path) as source:
            stored = _read_channels(source, channels)
        return np.array([_normalize(stored[:, :, k]) for k in range(channels)])


def _read_channels(source: Any, channels: int) -> NDArray:
    """Return the channels as they are in the file, (rows, columns, channels)."""
    spec = source.spec()
    if spec.deep or spec.depth > 1:
        raise UnusableFile("is a deep image or a volume, not an image")
    names = spec.channelnames
    chosen = tuple(
        k for k, name in enumerate(names) if name.upper() not in _ALPHA and k != spec.alpha_channel
    )
    if len(chosen) != channels:
        raise UnusableFile(_wrong_channel_count(len(chosen), channels))
    check_size(spec, channels)
    data, notes = read_samples(source, spec, chosen)
    if source.format_name() == "openexr":
        data = extract_display_window(data, spec, notes)
    return data


def _wrong_channel_count(found: int, wanted: int) -> str:
    has = f"has {found} channel{'s' * (found != 1)}"
    if wanted == 1:
        return f"{has}, where one for all wavelengths is needed"
    return f"{has}, but psf.wavelengths lists {wanted}"


def _normalize(plane: NDArray) -> NDArray[np.float64]:
    """Return a plane of light with the sum 1."""
    light = plane.astype(np.float64)
    if not np.isfinite(light).all():
        raise UnusableFile("holds a value that is not finite; light is 0 or more")
    top, least = float(light.max()), float(light.min())
    if least < -ROUNDING * max(top, 0.0):
        row, column = np.unravel_index(np.argmin(light), light.shape)
        raise UnusableFile(
            f"holds a negative value ({least:g} at row {row}, column {column}); light is 0 or more",
            "replace such values, for example by 0",
        )
    if not top > 0:
        raise UnusableFile("is zero everywhere, which is no point spread function")
    light = np.maximum(light, 0.0) / top  # so that the sum of large numbers does not overflow
    return light / light.sum()
