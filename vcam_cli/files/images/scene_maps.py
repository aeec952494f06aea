"""Maps beside a scene's picture: how opaque, and how far away it is at every sample."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.errors import bad
from vcam_cli.files.file_checks import check_file, convert_errors
from vcam_cli.files.images.images import open_image, read_picture

YamlPath = tuple[str | int, ...]


def read_opacity(path: Path | str, yaml_path: YamlPath) -> NDArray:
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
