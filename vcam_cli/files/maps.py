"""Maps of differences as pictures."""

from pathlib import Path

import numpy as np

from vcam_cli.files.png import write_png
from vcam_cli.quality import error_map


def write_map(path: Path | str, delta_e: np.ndarray) -> None:
    """Writes the PNG of a map of Delta E (rows, columns); the file's description has its scale.

    Raises CannotDo when the file cannot be written.
    """
    upper = error_map.top(delta_e)
    text = f"S-CIELAB Delta E: black is 0, light yellow {upper:g} or more"
    write_png(path, error_map.picture(delta_e, upper), text)
