"""JPEG compression of a render, as a camera's own files have it (ITU-T T.81, by libjpeg)."""

from io import BytesIO

import numpy as np

from vcam_cli.records import dataclass


def compress(codes: np.ndarray, quality: int) -> bytes:
    """Return the JPEG file of a render.

    Parameters
    ----------
    codes : ndarray
        Codes (rows, columns, 3) or (rows, columns), uint8.
    quality : int
        Quality, 1 to 100, that scales the tables of annex K of the standard as libjpeg does.

    Returns
    -------
    bytes
        A baseline JFIF file, colors at half the resolution (4:2:0).
    """
    from PIL import Image

    file = BytesIO()
    Image.fromarray(codes).save(file, "JPEG", quality=quality, subsampling="4:2:0")
    return file.getvalue()


def decompress(file: bytes) -> np.ndarray:
    """Return the codes of a JPEG file, in the shape of those that it was made of."""
    from PIL.JpegImagePlugin import JpegImageFile

    with JpegImageFile(BytesIO(file)) as picture:
        return np.array(picture)


@dataclass(frozen=True)
class Compression:
    """What a render is after compression, and the file that it is compressed to."""

    quality: int

    def __call__(self, codes: np.ndarray) -> np.ndarray:
        """Return a render's codes after compression."""
        return decompress(self.file(codes))

    def file(self, codes: np.ndarray) -> bytes:
        """Return the file of a render's codes."""
        return compress(codes, self.quality)
