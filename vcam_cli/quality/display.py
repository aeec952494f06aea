"""The display on which pictures are judged: what light its values make, how fine its pixels look.

Linear display values, where white is 1, become CIE 1931 XYZ by one matrix. The tone curve
(`display.gamma`) is no part of it: pictures are judged on linear values, and a display that shows
them is driven through the inverse of its curve. CIELAB measures relative to white, so the
luminance of white scales XYZ and changes no Delta E.

References
----------
.. [1] ASTM E308, Standard Practice for Computing the Colors of Objects by Using the CIE System.
.. [2] IEC 61966-2-1:1999, Default RGB colour space - sRGB.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.quality import Display
from vcam_cli.errors import BadInput, bad
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum, cmf, display_primaries, integral

Primaries = Literal["crt-brainard", "srgb"]
D65 = (95.047, 100.0, 108.883)
"""XYZ of CIE D65 for the 2 degree observer, Y = 100: the numbers of [1] that sRGB is used with."""
MAX_SAMPLES_PER_DEGREE = 1e6
"""Finest image that can be judged; the eye's own cones are 120 to a degree."""
BT709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
"""Chromaticities x, y of the red, green and blue of sRGB [2]."""


@dataclass(frozen=True)
class Screen:
    """Light and visual angle of an image (rows, columns, 3) as the eye gets it."""

    to_xyz: NDArray[np.float64]
    """Matrix (3, 3) from values to XYZ [cd/m2, or any unit: only ratios to white count]."""
    samples_per_degree: float
    """Pixels of the image in one degree of visual angle."""

    def __post_init__(self) -> None:
        """Raise BadInput for more samples per degree than can be judged."""
        if not 0 < self.samples_per_degree <= MAX_SAMPLES_PER_DEGREE:
            raise bad(
                (),
                f"{self.samples_per_degree:.3g} pixels in a degree of vision; at most"
                f" {MAX_SAMPLES_PER_DEGREE:.0e} can be judged",
                "check the display's dpi or width, and the viewing distance",
            )

    @property
    def white(self) -> NDArray[np.float64]:
        """XYZ of the values 1, 1, 1."""
        white: NDArray[np.float64] = self.to_xyz.sum(axis=1)
        return white


def display_screen(display: Display, columns: int) -> Screen:
    """Return the screen of a camera file's display with a picture on it.

    Parameters
    ----------
    display : Display
        Primaries, white, size and viewing distance.
    columns : int
        Width of the picture [pixels].

    Returns
    -------
    Screen
        Light and visual angle of the picture.

    Raises
    ------
    BadInput
        The pixels are too fine to be judged.
    """
    dpi = columns * 0.0254 / display.width if display.width is not None else display.dpi
    assert dpi is not None
    per_degree = samples_per_degree(dpi, display.viewing_distance)
    try:
        return Screen(rgb_to_xyz(display.primaries, display.white), per_degree)
    except BadInput as error:
        (problem,) = error.problems
        name = "width" if display.width is not None else "dpi"
        raise bad(("display", name), problem.message, problem.remedy) from None


def samples_per_degree(dpi: float, distance: float) -> float:
    """Return the pixels in one degree of visual angle at the center of a screen.

    Parameters
    ----------
    dpi : float
        Pixels of the screen [1/inch].
    distance : float
        Viewing distance [m].

    Returns
    -------
    float
        Samples per degree [1/degree].
    """
    return dpi * distance / 0.0254 * math.tan(math.radians(1.0))


def rgb_to_xyz(primaries: Primaries, white: float = 100.0) -> NDArray[np.float64]:
    """Return the matrix from linear display values to CIE 1931 XYZ.

    Parameters
    ----------
    primaries : {"crt-brainard", "srgb"}
        "crt-brainard" has the spectra of a cathode-ray tube's phosphors, each at its full power, so
        its white is bluish (x, y = 0.288, 0.313); "srgb" the chromaticities of BT.709, which add up
        to D65 [2].
    white : float
        Luminance of white [cd/m2].

    Returns
    -------
    ndarray
        Matrix (3, 3): XYZ of full red, green, blue in its columns, whose sum has Y = white.
    """
    if primaries == "srgb":
        chromaticity = np.array([(x / y, 1.0, (1.0 - x - y) / y) for x, y in BT709]).T
        matrix = chromaticity * np.linalg.solve(chromaticity, np.array(D65))
    else:
        matrix = _crt_matrix()
    scaled: NDArray[np.float64] = matrix * (white / matrix[1].sum())
    return scaled


@cache
def _crt_matrix() -> NDArray[np.float64]:
    """Return integrals (3, 3) of the phosphors (columns) with the CIE 1931 functions (rows)."""
    observer = [Spectrum(tables=(table,)) for table in cmf()]
    guns, _ = display_primaries("crt-brainard")
    start, stop = guns[0].tables[0].start, guns[0].tables[0].stop
    return np.array(
        [[integral(gun.multiply(eye), start, stop) for gun in guns] for eye in observer]
    )
