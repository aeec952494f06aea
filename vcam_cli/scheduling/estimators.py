"""The photocurrent of a pixel from several samples of one integration.

The sample at time t is the charge so far: Q(t) = (i + i_dc) t on average, with shot noise that
accumulates, reset noise common to all samples and readout noise new in each [electrons]:

    cov(Q_j, Q_l) = (i + i_dc) min(t_j, t_l) + read_variance delta_jl + reset_variance

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, sections 4.2 and 4.6 (last sample before saturation).
[2] X. Liu and A. El Gamal, "Synthesis of high dynamic range motion blur free image from multiple
    captures", IEEE Trans. Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815 (optimal
    linear estimate).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

PASSES = 3
"""Times the weights are found again from the estimate they gave: they depend on it weakly."""


def last_usable(saturated: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index of the last sample before the first saturated one: (...), -1 where there is none.

    saturated: (N, ...) of samples in the order of time.
    """
    clean = np.logical_and.accumulate(~saturated, axis=0)
    return clean.sum(axis=0) - 1


def last_sample_before_saturation(
    samples: ArrayLike, times: ArrayLike, saturated: NDArray[np.bool_], dark_rate: float = 0.0
) -> Floats:
    """Each pixel's last sample before saturation, less its dark charge, over its time [1].

    Parameters
    ----------
    samples : (N, ...) charge at each of the times [e]
    times : (N,) rising [s]
    saturated : (N, ...) whether a sample has reached the well or the ADC's end
    dark_rate : i_dc, mean dark current of a pixel [e/s]

    Returns
    -------
    (...) photocurrent [e/s]; of a pixel that is full in the first sample what that one says, a
    lower bound
    """
    values, when = np.asarray(samples, dtype=np.float64), np.asarray(times, dtype=np.float64)
    index = np.maximum(last_usable(saturated), 0)
    last = np.take_along_axis(values, index[None], axis=0)[0]
    return last / when[index] - dark_rate


def weighted(
    samples: ArrayLike,
    times: ArrayLike,
    saturated: NDArray[np.bool_],
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> Floats:
    """The best linear unbiased estimate from all samples before saturation [2].

    i = t' C^-1 (Q - i_dc t) / t' C^-1 t, C the covariance above for the pixel's own i, which is
    found from the estimate itself, begun with the last sample before saturation. Differences of
    samples have a tridiagonal covariance, so that each pixel takes one pass over its samples.

    Parameters
    ----------
    samples, times, saturated, dark_rate : as for `last_sample_before_saturation`
    read_variance : of one readout [e^2]
    reset_variance : of the reset, common to all samples [e^2]

    Returns
    -------
    (...) photocurrent [e/s]; of a pixel that is full in the first sample a lower bound
    """
    values, when = np.asarray(samples, dtype=np.float64), np.asarray(times, dtype=np.float64)
    clean = np.logical_and.accumulate(~saturated, axis=0)
    clean[0] = True
    found = last_sample_before_saturation(values, when, saturated, dark_rate)
    if read_variance == 0 and reset_variance == 0:
        return found  # the last sample holds all there is to know
    for _ in range(PASSES):
        rate = np.maximum(found, 0) + dark_rate
        precision, signal = _sums(
            values, when, clean, rate, dark_rate, read_variance, reset_variance
        )
        found = signal / precision
    return found


def variance(
    photocurrent: ArrayLike,
    times: ArrayLike,
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> Floats:
    """Variance of the weighted estimate from samples at all of the times, 1 / (t' C^-1 t).

    photocurrent: (...) [e/s]; the rest as for `weighted`. Returns (...) [(e/s)^2].
    """
    when = np.asarray(times, dtype=np.float64)
    rate = np.asarray(photocurrent, dtype=np.float64) + dark_rate
    shape = (len(when), *rate.shape)
    clean = np.ones(shape, bool)
    precision, _ = _sums(
        np.zeros(shape), when, clean, rate, dark_rate, read_variance, reset_variance
    )
    return 1 / precision


def _sums(
    values: Floats,
    when: Floats,
    clean: NDArray[np.bool_],
    rate: Floats,
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> tuple[Floats, Floats]:
    """t' C^-1 t and t' C^-1 (Q - i_dc t), by elimination in the tridiagonal covariance.

    Of differences, sample 1 and then each less the one before: variances rate dt + 2 read, the
    first rate t + read + reset; covariance of neighbors -read.
    """
    pivot = rate * when[0] + read_variance + reset_variance
    pivot = np.where(pivot > 0, pivot, np.finfo(float).tiny)
    time, charge = np.full_like(rate, when[0]), values[0] - dark_rate * when[0]
    precision, signal = time**2 / pivot, time * charge / pivot
    for k in range(1, len(when)):
        step = when[k] - when[k - 1]
        share = read_variance / pivot
        time = step + share * time
        charge = values[k] - values[k - 1] - dark_rate * step + share * charge
        pivot = rate * step + 2 * read_variance - share * read_variance
        pivot = np.where(pivot > 0, pivot, np.finfo(float).tiny)
        used = clean[k]
        precision = precision + np.where(used, time**2 / pivot, 0.0)
        signal = signal + np.where(used, time * charge / pivot, 0.0)
    return precision, signal
