"""The eye's pattern filters of S-CIELAB: opponent planes, and what blurs each of them.

Each of three opponent planes (light-dark, red-green, blue-yellow) is seen through a weighted sum
of Gaussians, which on pixels are separable. Two programs read the same numbers differently, and
both in a way that jumps where another pixel comes into a degree; a third reading does not:

- `zhang-wandell-1996`, the authors' first code: the spread is the FULL width at half maximum, and
  kernels are sampled at 224 or more per degree, averaged over a pixel by a triangle, and decimated.
- `isetcam`: the spread is HALF the width, and kernels are sampled at the pixels.
- `continuous`: the spread is the full width, and pixels are squares of light: each counts with the
  integral of the kernel over it.

The first two are cut to about one degree, in whole pixels, the third to one degree exactly. Their
sum is 1: a uniform field stays as it is. (The 1996 code leaves its sum up to 0.8 % off.)

Why a third: a metric that is compared between pixels of many sizes must be smooth in their size.
At 14 pixels in a degree the jumps of the other two are 5 % of a mean Delta E.

References
----------
.. [1] X. Zhang, B. Wandell, "A spatial extension of CIELAB for digital color image reproduction",
   SID Symposium Digest 27, 731-734, 1996; Journal of the SID 5, 61-63, 1997,
   doi:10.1889/1.1985127.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vcam_cli.records import dataclass

Filters = Literal["zhang-wandell-1996", "isetcam", "continuous"]
Gaussian = tuple[float, float]

GAUSSIANS: tuple[tuple[Gaussian, ...], ...] = (
    ((0.05, 1.00327), (0.225, 0.114416), (7.0, -0.117686)),
    ((0.0685, 0.616725), (0.826, 0.383275)),
    ((0.092, 0.567885), (0.6451, 0.432115)),
)
"""Spread [degrees] and weight of every Gaussian of the light-dark, red-green, blue-yellow plane."""

_TWO_DEGREES = (
    (0.2787336, 0.7218031, -0.106552),
    (-0.4487736, 0.2898056, 0.0771569),
    (0.0859513, -0.5899859, 0.5011089),
)
OPPONENT: dict[str, tuple[tuple[float, float, float], ...]] = {
    "zhang-wandell-1996": _TWO_DEGREES,
    "continuous": _TWO_DEGREES,
    "isetcam": (
        (0.2885613, 0.6597617, -0.1305654),
        (-0.4648864, 0.3262702, 0.06242),
        (0.0798787, -0.5547976, 0.4814746),
    ),
}
"""Matrices from XYZ to opponent planes: for the 2 degree observer, and for the 10 degree one."""

MIN_1996_SAMPLES_PER_DEGREE = 224.0
"""Samples per degree at which the 1996 kernels are sampled, at least."""


@dataclass(frozen=True)
class Kernel:
    """A sum of separable kernels: weights[i] x the outer product of taps[i] with itself."""

    weights: NDArray[np.float64]
    """Weight of every Gaussian; they make the kernel's sum 1."""
    taps: NDArray[np.float64]
    """Symmetric samples of every Gaussian (Gaussians, 2 reach + 1)."""

    @property
    def reach(self) -> int:
        """Pixels that the kernel covers on either side."""
        return int(self.taps.shape[1] // 2)

    def response(self, rows: int, columns: int) -> NDArray[np.float64]:
        """Return the kernel's factors on the DCT-II of a picture that is mirrored at its borders.

        Parameters
        ----------
        rows, columns : int
            Size of the picture [pixels].

        Returns
        -------
        ndarray
            Factors (rows, columns) [dimensionless].
        """
        down, across = (_cosines(self.taps, count) for count in (rows, columns))
        kernel: NDArray[np.float64] = np.einsum("i,ir,ic->rc", self.weights, down, across)
        return kernel


def kernels(filters: Filters, samples_per_degree: float) -> tuple[Kernel, ...]:
    """Return the kernels of the light-dark, red-green and blue-yellow planes [1].

    Parameters
    ----------
    filters : {"zhang-wandell-1996", "isetcam", "continuous"}
        How the spreads are read.
    samples_per_degree : float
        Pixels in one degree of visual angle.

    Returns
    -------
    tuple of Kernel
        One kernel a plane.

    Raises
    ------
    ValueError
        Filters that are not known.
    """
    if filters not in OPPONENT:
        raise ValueError(f"filters {filters!r}; they must be one of {', '.join(OPPONENT)}")
    sampled = {
        "zhang-wandell-1996": _taps_1996,
        "isetcam": _taps_isetcam,
        "continuous": _taps_continuous,
    }[filters]
    return tuple(_kernel(plane, sampled(plane, samples_per_degree)) for plane in GAUSSIANS)


def _kernel(plane: tuple[Gaussian, ...], taps: NDArray[np.float64]) -> Kernel:
    weights = np.array([weight for _, weight in plane])
    return Kernel(weights / (weights @ taps.sum(axis=1) ** 2), taps)


def _taps_1996(plane: tuple[Gaussian, ...], per_degree: float) -> NDArray[np.float64]:
    """Return one row of taps a Gaussian, as the 1996 code makes them."""
    finer = max(1, math.ceil(MIN_1996_SAMPLES_PER_DEGREE / per_degree))
    fine = finer * per_degree
    half = math.ceil(fine / 2) - 1
    if half < finer:  # a pixel is half a degree or more: one tap is left
        return np.ones((len(plane), 1))
    place = np.arange(-half, half + 1)
    widths = np.array([spread for spread, _ in plane]) * fine - 1  # full, at half maximum
    sampled = _unit_sum(np.exp(-4 * math.log(2) * (place / widths[:, None]) ** 2))
    triangle = np.minimum(np.arange(1, 2 * finer), np.arange(2 * finer - 1, 0, -1)) / finer
    averaged = [np.convolve(row, triangle)[finer - 1 :][: place.size] for row in sampled]
    return np.array(averaged)[:, half % finer :: finer]


def _taps_isetcam(plane: tuple[Gaussian, ...], per_degree: float) -> NDArray[np.float64]:
    """Return one row of taps a Gaussian, as ISETCam makes them."""
    half = (math.ceil(per_degree) - 1) // 2
    place = np.arange(-half, half + 1)
    widths = np.array([spread for spread, _ in plane]) * per_degree  # half, at half maximum
    return _unit_sum(np.exp(-math.log(2) * (place / widths[:, None]) ** 2))


def _taps_continuous(plane: tuple[Gaussian, ...], per_degree: float) -> NDArray[np.float64]:
    """Return one row of taps a Gaussian: its integrals over pixels within half a degree."""
    from scipy.special import erf

    reach = math.ceil(per_degree / 2 - 0.5)
    edges = np.clip((np.arange(-reach, reach + 2) - 0.5) / per_degree, -0.5, 0.5)
    widths = np.array([[spread] for spread, _ in plane])
    return _unit_sum(np.diff(erf(2 * math.sqrt(math.log(2)) * edges / widths), axis=1))


def _unit_sum(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    normalized: NDArray[np.float64] = rows / rows.sum(axis=1, keepdims=True)
    return normalized


def _cosines(taps: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the sum over n of taps[n] cos(pi k n / count), k = 0 .. count - 1: (Gaussians, count).

    Taps beyond a period of the mirrored picture fold onto it: no kernel is too large.
    """
    reach = taps.shape[1] // 2
    place = np.arange(-reach, reach + 1) % (2 * count)
    period = np.array([np.bincount(place, tap, 2 * count) for tap in taps])
    return np.fft.rfft(period, axis=1).real[:, :count]
