"""Other people's readers of raw.dng, and what a picture of theirs differs from ours by.

LibRaw (rawpy) and Adobe's DNG SDK (dngpy) share no code with vcam's writer, nor with each other.
Color after the specification is computed with colour-science from what tifffile finds in the file.
"""

from pathlib import Path

import numpy as np
import pytest

REASON = "the readers of DNG files are not installed here"
rawpy = pytest.importorskip("rawpy", reason=REASON)
dngpy = pytest.importorskip("dngpy", reason=REASON)
tifffile = pytest.importorskip("tifffile", reason=REASON)

BORDER, STEP = 4, 3
"""Pixels left out at the border, where demosaicing differs, and of the others every third row and
column: 3 is prime to the mosaic, so that all of its phases count."""


def libraw_codes(path: Path) -> np.ndarray:
    """The raw frame as LibRaw reads it, (rows, columns) or (rows, columns, 3)."""
    with rawpy.imread(str(path)) as file:
        codes = np.copy(file.raw_image)  # gone with the file
    return codes[..., :3] if codes.ndim == 3 else codes


def adobe_codes(path: Path) -> np.ndarray:
    """The raw frame as Adobe's SDK reads it, likewise."""
    return np.squeeze(dngpy.Dng(str(path)).raw_pixels)


def libraw_picture(path: Path) -> np.ndarray:
    """LibRaw's picture in linear sRGB, (rows, columns, 3), 1 = full scale."""
    with rawpy.imread(str(path)) as file:
        picture = file.postprocess(
            use_camera_wb=True,
            gamma=(1, 1),
            no_auto_bright=True,
            output_bps=16,
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
        )
    return picture / 65535


def median_difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Median CIEDE2000 of two pictures in linear sRGB, at the best of exposures."""
    import colour

    inside = (slice(BORDER, -BORDER, STEP),) * 2
    ours, theirs = np.clip(ours[inside], 0, 1), theirs[inside]

    def lab(picture):
        return colour.XYZ_to_Lab(colour.RGB_to_XYZ(np.clip(picture, 0, 1), "sRGB"))

    middle = np.median(ours[..., 1]) / max(np.median(theirs[..., 1]), 1e-6)
    wanted, scales = lab(ours), middle * np.linspace(0.97, 1.03, 13)
    return min(float(np.median(colour.delta_E(wanted, lab(s * theirs)))) for s in scales)


def specified_picture(path: Path, balanced: np.ndarray) -> np.ndarray:
    """Linear sRGB of balanced camera colors by chapter 6 of the DNG specification.

    White's chromaticity is where the matrix interpolated for its temperature maps it to
    AsShotNeutral; Bradford's transform takes it to D65.
    """
    import colour

    with tifffile.TiffFile(path) as file:
        tags = {tag.name: tag.value for tag in file.pages[0].tags}
    first, second = (_ratios(tags[f"ColorMatrix{n}"]).reshape(3, 3) for n in (1, 2))
    neutral = _ratios(tags["AsShotNeutral"])
    assert (tags["CalibrationIlluminant1"], tags["CalibrationIlluminant2"]) == (17, 21)  # A, D65
    xy = np.array([0.34567, 0.35850])  # D50, where the specification starts
    for _ in range(50):
        temperature = np.clip(colour.uv_to_CCT(colour.UCS_to_uv(colour.XYZ_to_UCS(
            colour.xy_to_XYZ(xy))), method="Robertson 1968")[0], 2850, 6500)  # fmt: skip
        share = (1 / temperature - 1 / 6500) / (1 / 2850 - 1 / 6500)
        to_xyz = np.linalg.inv(share * first + (1 - share) * second)
        white = to_xyz @ neutral
        xy = colour.XYZ_to_xy(white)
    d65 = colour.xy_to_XYZ((0.3127, 0.3290))
    seen = balanced @ (to_xyz @ np.diag(neutral / white[1])).T
    adapted = colour.chromatic_adaptation(
        seen, white / white[1], d65, method="Von Kries", transform="Bradford"
    )
    return np.asarray(colour.XYZ_to_RGB(adapted, "sRGB", (0.3127, 0.3290)))


def _ratios(pairs) -> np.ndarray:
    return np.divide(*np.reshape(pairs, (-1, 2)).T)
