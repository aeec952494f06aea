"""Color correction: a matrix from the camera's colors to linear display RGB (ITU-R BT.709).

`fit_matrix` finds the matrix that brings the 24 patches of a ColorChecker, as this camera sees them
under the light of this scene, closest to their colors: free of noise and blur, above black, and
with white balanced. Their colors are those a CIE 1931 observer sees under the same light, adapted
to the display's white D65 by the linear Bradford transform [1].

White stays neutral exactly: every row maps the camera's white to 1, and least squares runs over
the free coefficients [2]. The residual is the difference in CIELAB [3], linearized at each patch's
color: a linear problem, solved at once. Why not in linear light: there bright patches count most.
Over seven lights and the two filter sets that ship, the mean CIEDE2000 is 0.85 (largest of a patch,
mean over these: 2.8), against 0.88 (3.2) in linear light; iterating to the least CIELAB
differences themselves gives 0.85 (2.8) again.

Where colors cannot be distinguished (monochromatic light, two equal filters) the patches leave
part of the matrix undetermined. A weak pull towards the identity, worth half a unit of Delta E a
patch, decides there and nowhere else, and keeps the coefficients, which amplify noise, from
growing without bound. Where a color sees no light at all, the matrix is the identity.

References
----------
.. [1] K. M. Lam, "Metamerism and colour constancy", thesis, University of Bradford, 1985 (as used
   by ICC.1:2022 annex E).
.. [2] G. D. Finlayson, M. S. Drew, "Constrained least-squares regression in color spaces",
   Journal of Electronic Imaging 6(4), 1997, doi:10.1117/12.278080.
.. [3] CIE 015:2018, Colorimetry, 4th edition, doi:10.25039/TR.015.2018.
"""

from functools import lru_cache

import numpy as np

from vcam_cli.processing.base import Block, Patches
from vcam_cli.processing.white_balance import MIN_COLOR_SHARE
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum, cmf, colorchecker, pair_weights

DISPLAY = ("R", "G", "B")
"""Colors of the display, which come out."""
RIDGE = 0.5
"""Cost of a coefficient that is 1 off the identity [Delta E of one patch]."""
MIN_COLOR_DIFFERENCE = 1e-3
"""Rms difference of patches, as a fraction of white, below which two colors are the same."""

_XY = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])  # BT.709 primaries, and white D65
_D65 = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
CHROMATICITIES = (*map(float, _XY.ravel()), 0.3127, 0.3290)
"""x, y of red, green, blue and white of the colors that come out, as OpenEXR has them."""
_PRIMARIES = np.array([_XY[:, 0] / _XY[:, 1], np.ones(3), (1 - _XY.sum(axis=1)) / _XY[:, 1]])
RGB_TO_XYZ = _PRIMARIES * np.linalg.solve(_PRIMARIES, _D65)
"""Matrix from linear BT.709 to XYZ; white (1, 1, 1) has Y = 1."""
BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
"""Matrix from XYZ to the sharpened cone responses in which adaptation is a gain for each."""


@dataclass(frozen=True)
class ColorCorrection:
    """Multiplies full color by a matrix."""

    matrix: tuple[tuple[float, ...], ...]
    """Coefficients: rows for display R, G, B, columns for the camera's colors."""
    halo: int = 0

    def process_block(self, block: Block) -> Block:
        # Sums written out: a product of matrices would start threads of its own in every block.
        """Return the block in the display's colors."""
        planes = block.planes
        out = np.empty((len(self.matrix), *planes.shape[1:]), np.float32)
        term = np.empty(planes.shape[1:], np.float32)
        for target, row in zip(out, np.asarray(self.matrix, np.float32), strict=True):
            np.multiply(planes[0], row[0], out=target)
            for plane, weight in zip(planes[1:], row[1:], strict=True):
                target += np.multiply(plane, weight, out=term)
        return Block(out, block.first_row)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return the values in the display's colors."""
        matrix = np.asarray(self.matrix, dtype=values.dtype)
        corrected: np.ndarray = np.einsum("ij,j...->i...", matrix, values)
        return corrected


@dataclass(frozen=True)
class Fit:
    """A fitted matrix, and what a user should know of it."""

    matrix: np.ndarray
    """Coefficients (3, C)."""
    note: str = ""
    """Warning for the user; "" where all is well."""

    @property
    def operation(self) -> ColorCorrection:
        """The step that applies the matrix."""
        return ColorCorrection(tuple(tuple(row) for row in self.matrix.tolist()))


def fit_matrix(signals: np.ndarray, white: np.ndarray, balanced: bool, patches: Patches) -> Fit:
    """Return the matrix that brings a camera's ColorChecker closest to its colors [2], [3].

    Parameters
    ----------
    signals : ndarray
        Patches (C, 24) above black, as the steps before leave them.
    white : ndarray
        Perfect white (C,) above black, in the same unit.
    balanced : bool
        Whether a step before has balanced white, well or not. The matrix is then made for a white
        that is balanced well, so that a wrong balance shows; else it balances `white` itself.
    patches : Patches
        The light under which the patches are seen.

    Returns
    -------
    Fit
        The matrix; the identity where the light gives a color no signal or is too far from white.
    """
    identity = np.eye(3, len(white))
    if not white.max() > 0 or white.min() <= MIN_COLOR_SHARE * white.max():
        return Fit(identity, "color correction left out: not every color sees this light")
    target = chart_colors(patches.light, patches.start, patches.stop)
    if target is None:
        return Fit(identity, "color correction left out: this light is too far from white")
    matrix, rank = fit_relative((signals / white[:, np.newaxis]).T, target)
    note = "" if rank == len(white) else "color correction is weak: " + _FILTERS_ALIKE
    return Fit(matrix if balanced else matrix * (white.max() / white), note)


def fit_primaries(signals: np.ndarray, balanced: bool) -> Fit:
    """Return the matrix that brings the primaries of a picture back to R, G and B of the display.

    A picture that emits is a sum of three lights, and three colors of a camera that differ tell
    each pixel's shares exactly, whatever colors the lights have. Laser light of 450, 550 and 650 nm
    is more saturated than any display of BT.709 can show; fitted to a ColorChecker, whose colors
    are seen as they are, half of such a picture's colors would be clipped.

    Parameters
    ----------
    signals : ndarray
        Signals of the three primaries (C, 3) above black, as the steps before leave them; their
        sum is white.
    balanced : bool
        See `fit_matrix`.

    Returns
    -------
    Fit
        The matrix; of more than three colors the one that amplifies noise least, and of colors
        that cannot tell the primaries apart the closest.
    """
    white = signals.sum(axis=1)
    identity = np.eye(3, len(white))
    if not white.max() > 0 or white.min() <= MIN_COLOR_SHARE * white.max():
        return Fit(identity, "color correction left out: not every color sees this light")
    relative = signals / white[:, np.newaxis]
    rank = int(np.linalg.matrix_rank(relative, MIN_COLOR_DIFFERENCE))
    matrix = np.linalg.pinv(relative, MIN_COLOR_DIFFERENCE)
    note = "" if rank == 3 else "color correction is weak: " + _FILTERS_ALIKE
    return Fit(matrix if balanced else matrix * (white.max() / white), note)


_FILTERS_ALIKE = "under this light these filters distinguish too few colors"


def fit_relative(signals: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the matrix that maps white to white and patches closest to their colors.

    Parameters
    ----------
    signals : ndarray
        Patches (24, C) as fractions of white.
    target : ndarray
        Their linear display RGB (24, 3), white = 1.

    Returns
    -------
    matrix : ndarray
        Coefficients (3, C) with rows that sum to 1.
    rank : int
        Number of colors that can be distinguished.
    """
    count = signals.shape[1]
    start = np.eye(3, count)
    start += (1 - start.sum(axis=1, keepdims=True)) / count
    free = np.linalg.svd(np.ones((1, count)))[2][1:].T  # (C, C - 1): what leaves white alone
    chroma = signals @ free
    spread = np.linalg.svd(chroma, compute_uv=False) / np.sqrt(len(signals))

    slope = lab_slope(target)
    wanted = np.einsum("pai,pi->pa", slope, target - signals @ start.T).ravel()
    unknown = 3 * (count - 1)
    design = np.einsum("pai,pk->paik", slope, chroma).reshape(-1, unknown)
    pulled = np.vstack([design, RIDGE * np.eye(unknown)])
    weights = np.linalg.lstsq(pulled, np.append(wanted, np.zeros(unknown)), rcond=None)[0]
    matrix = start + weights.reshape(3, count - 1) @ free.T
    return matrix, 1 + int(np.count_nonzero(spread > MIN_COLOR_DIFFERENCE))


@lru_cache(maxsize=16)
def chart_colors(light: Spectrum, start: float, stop: float) -> np.ndarray | None:
    """Return the display colors of a ColorChecker under a light, seen adapted to it [1].

    Parameters
    ----------
    light : Spectrum
        Spectral radiance of the light, in any scale.
    start, stop : float
        Range of wavelengths [m].

    Returns
    -------
    ndarray or None
        Linear display RGB (24, 3), white = 1; read-only. None where the light has no counterpart
        among display whites: adaptation would need a gain that is infinite or negative, as for deep
        red or violet light.
    """
    lit = [light, *(light.multiply(reflectance) for _, reflectance in colorchecker())]
    observer = [Spectrum(tables=(table,)) for table in cmf()]
    white, *patches = pair_weights(lit, observer, [start, stop]).sum(axis=-1)
    cones = BRADFORD @ white
    if cones.min() <= MIN_COLOR_DIFFERENCE * cones.max():
        return None
    adapted = (BRADFORD @ np.array(patches).T) * ((BRADFORD @ _D65) / cones)[:, np.newaxis]
    colors = np.linalg.solve(BRADFORD @ RGB_TO_XYZ, adapted).T
    colors.flags.writeable = False  # it is kept
    return colors


_OPPONENT = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])
_TO_RELATIVE = RGB_TO_XYZ / _D65[:, np.newaxis]
_LINEAR_BELOW = (6 / 29) ** 3


def lab_slope(rgb: np.ndarray) -> np.ndarray:
    """Return the derivative of CIELAB by linear display RGB, white D65.

    CIE 015:2018, eqs 8.3 to 8.11; straight below 216/24389 of white, as the standard has it.

    Parameters
    ----------
    rgb : ndarray
        Linear R, G, B (n, 3).

    Returns
    -------
    ndarray
        Derivative (n, 3, 3) of L*, a*, b*.
    """
    t = np.maximum(rgb @ _TO_RELATIVE.T, _LINEAR_BELOW)
    slope = np.cbrt(t) ** -2 / 3
    return np.asarray(_OPPONENT @ (slope[:, :, np.newaxis] * _TO_RELATIVE))
