"""Estimates of a pdf from the counts of a histogram, before few segments approximate it.

[1]_, section 4.5, names four: the histogram itself, the kernel estimator, the nearest-neighbor
estimator and maximum penalized likelihood. The last three smooth the chance of few pixels away;
they work on the histogram's bins, whatever their widths, so that of bins of equal ratio they are
estimates over the logarithm of light. At the ends of the histogram they are mirrored or free, and
no probability leaks out.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
.. [2] B. W. Silverman, "Density Estimation for Statistics and Data Analysis", Chapman and Hall,
   1986: eq 3.31 (bandwidth), section 2.5 (nearest neighbors).
.. [3] D. O. Loftsgaarden, C. P. Quesenberry, "A nonparametric estimate of a multivariate density
   function", Annals of Mathematical Statistics 36(3), 1965, doi:10.1214/aoms/1177700079.
.. [4] I. J. Good, R. A. Gaskins, "Nonparametric roughness penalties for probability densities",
   Biometrika 58(2), 1971, doi:10.1093/biomet/58.2.255.
.. [5] P. H. C. Eilers, B. D. Marx, "Flexible smoothing with B-splines and penalties", Statistical
   Science 11(2), 1996, doi:10.1214/ss/1038425655, section 7: densities from counts, lambda by AIC.
"""

from collections.abc import Callable

import numpy as np

from vcam_cli.scheduling.pdf import Floats

LAMBDAS = 10.0 ** np.arange(-2, 9)
"""Penalties that are tried [5]."""
NEWTON_STEPS, CONVERGED = 60, 1e-9
LEAST_MEAN = 1e-12
"""Least expected pixels of a bin, of all of them; fewer count as this number."""
BLOCK = 256
"""Columns of an inverse that are computed at once."""


def kernel(counts: Floats) -> Floats:
    """Return the Gaussian kernel estimate, its bandwidth by Silverman's rule [2].

    Parameters
    ----------
    counts : (K,) array
        Pixels of each bin.

    Returns
    -------
    (K,) array
        Probability of each bin, sum 1.
    """
    from scipy import ndimage

    total, place = counts.sum(), np.arange(counts.size)
    mean = counts @ place / total
    deviation = np.sqrt(counts @ (place - mean) ** 2 / total)
    quartiles = np.interp([0.25, 0.75], np.cumsum(counts) / total, place + 0.5)
    spread = min(deviation, float(np.diff(quartiles)[0]) / 1.34) or deviation
    width = 0.9 * spread * total**-0.2
    if width == 0:  # all pixels in one bin
        return np.asarray(counts / total)
    smooth = ndimage.gaussian_filter1d(counts.astype(float), width, mode="reflect", truncate=6)
    return np.asarray(smooth / smooth.sum())


def nearest_neighbor(counts: Floats) -> Floats:
    """Return the estimate by the distance of the sqrt(n)-th nearest of n pixels [3].

    The pixels of a bin are spread evenly over it.

    Parameters
    ----------
    counts : (K,) array
        Pixels of each bin.

    Returns
    -------
    (K,) array
        Probability of each bin, sum 1.
    """
    size = counts.size
    mirrored = np.concatenate([counts[::-1], counts, counts[::-1]]).astype(float)
    below = np.concatenate([[0.0], np.cumsum(mirrored)])
    wanted = np.sqrt(counts.sum())
    centers = size + np.arange(size) + 0.5
    low, high = np.zeros(size), np.full(size, float(size))
    edges = np.arange(below.size)
    for _ in range(60):  # halves the interval to rounding
        reach = (low + high) / 2
        inside = np.interp(centers + reach, edges, below) - np.interp(centers - reach, edges, below)
        enough = inside >= wanted
        high, low = np.where(enough, reach, high), np.where(enough, low, reach)
    return np.asarray((1 / high) / (1 / high).sum())


def penalized_likelihood(counts: Floats) -> Floats:
    """Return the density of the largest likelihood less a penalty on its roughness [4]_, [5]_.

    Counts are taken as Poisson numbers of mean exp(eta), and the penalty is lambda / 2 times the
    sum of the squared second differences of eta. Lambda is that of the least AIC among `LAMBDAS`.

    Parameters
    ----------
    counts : (K,) array
        Pixels of each bin.

    Returns
    -------
    (K,) array
        Probability of each bin, sum 1.
    """
    counts = counts.astype(float)
    if counts.size < 3:
        return np.asarray(counts / counts.sum())
    fits = [_penalized_fit(counts, strength) for strength in LAMBDAS]
    mean, _ = min(fits, key=lambda fit: fit[1])
    return np.asarray(mean / mean.sum())


def _penalized_fit(counts: Floats, strength: float) -> tuple[Floats, float]:
    """Return the fitted means (K,), and their AIC."""
    from scipy import linalg, ndimage

    penalty = strength * _second_differences(counts.size)
    least = LEAST_MEAN * counts.sum()
    smooth = np.maximum(ndimage.uniform_filter1d(counts, 5, mode="nearest"), 0.5)
    eta = np.log(smooth)

    def objective(values: Floats) -> float:
        rough = 0.5 * strength * float(np.square(np.diff(values, 2)).sum())
        return float(counts @ values - np.exp(values).sum()) - rough

    value = objective(eta)
    for _ in range(NEWTON_STEPS):
        mean = np.maximum(np.exp(eta), least)
        step = linalg.solveh_banded(
            _with_diagonal(penalty, mean), counts - mean - _times(penalty, eta)
        )
        share = 1.0
        while share > CONVERGED and not objective(eta + share * step) >= value:
            share /= 2
        eta, before = eta + share * step, value
        value = objective(eta)
        if value - before <= CONVERGED * abs(value):
            break
    mean = np.maximum(np.exp(eta), least)
    freedom = float(mean @ _inverse_diagonal(_with_diagonal(penalty, mean)))
    logarithm = np.where(counts > 0, counts * np.log(np.maximum(counts, 1e-300) / mean), 0.0)
    deviance = 2 * float((logarithm - (counts - mean)).sum())
    return mean, deviance + 2 * freedom


def _second_differences(size: int) -> Floats:
    """Return D'D of second differences as an upper band matrix (3, K)."""
    band = np.zeros((3, size))
    for shift, share in enumerate((1.0, -2.0, 1.0)):  # a second difference touches three bins
        for above in range(3 - shift):
            other = (1.0, -2.0, 1.0)[shift + above]
            band[2 - above, shift + above : size - 2 + shift + above] += share * other
    return band


def _with_diagonal(band: Floats, diagonal: Floats) -> Floats:
    whole = band.copy()
    whole[2] += diagonal
    return whole


def _times(band: Floats, values: Floats) -> Floats:
    """Return a symmetric band matrix times a vector."""
    out = band[2] * values
    for above in (1, 2):
        row = band[2 - above, above:]
        out[:-above] += row * values[above:]
        out[above:] += row * values[:-above]
    return np.asarray(out)


def _inverse_diagonal(band: Floats) -> Floats:
    """Return the diagonal of the inverse of a positive definite band matrix."""
    from scipy import linalg

    factor = linalg.cholesky_banded(band)
    size = band.shape[1]
    found = np.empty(size)
    for start in range(0, size, BLOCK):
        columns = np.arange(start, min(start + BLOCK, size))
        unit = np.zeros((size, columns.size))
        unit[columns, columns - start] = 1.0
        found[columns] = linalg.cho_solve_banded((factor, False), unit)[columns, columns - start]
    return found


ESTIMATORS: dict[str, Callable[[Floats], Floats]] = {
    "kernel": kernel,
    "nearest-neighbor": nearest_neighbor,
    "penalized-likelihood": penalized_likelihood,
}
"""What smooths counts, by the names of study files."""
HISTOGRAM = "histogram"
"""The counts as they are."""
