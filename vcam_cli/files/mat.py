"""MATLAB 5 files, written by SciPy; the reader for hostile ones is `spectral/matlab.py`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vcam_cli.files.atomic import write_whole
from vcam_cli.files.images.tiff import SOFTWARE

LARGEST = 2**31 - 2**16
"""Bytes of a variable that the format holds."""
_TEXT = 116
"""Bytes of text at the start of the file."""


def write_mat(path: Path | str, variables: Mapping[str, Any]) -> None:
    """Write arrays and mappings of them, which become structures. Raise CannotDo (disk full)."""
    from scipy.io import savemat

    with write_whole(path) as temporary:
        savemat(str(temporary), dict(variables), appendmat=False, oned_as="column")
        with open(temporary, "r+b") as file:  # SciPy writes the time there
            file.write(f"MATLAB 5.0 MAT-file, written by {SOFTWARE}".encode().ljust(_TEXT))
