"""Maps of color differences as images."""

from pathlib import Path

import numpy as np

from vcam_cli.files.images.png import write_png
from vcam_cli.quality import error_map


def write_map(path: Path | str, delta_e: np.ndarray) -> None:
    """Write a map of Delta E (rows, columns) as a PNG, whose description has its scale.

    Raise CannotDo when the file cannot be written.
    """
    upper = error_map.scale_limit(delta_e)
    text = f"S-CIELAB Delta E: black is 0, light yellow {upper:g} or more"
    write_png(path, error_map.false_color(delta_e, upper), text)
