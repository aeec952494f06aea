"""The photocurrent of a pixel from several samples of one integration.

The sample at time t is the charge so far: Q(t) = (i + i_dc) t on average, with shot noise that
accumulates, reset noise common to all samples and readout noise new in each [electrons]:

    cov(Q_j, Q_l) = (i + i_dc) min(t_j, t_l) + read_variance delta_jl + reset_variance

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, sections 4.2 and 4.6 (last sample before saturation).
.. [2] X. Liu and A. El Gamal, "Synthesis of high dynamic range motion blur free image from multiple
   captures", IEEE Trans. Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815 (optimal
   linear estimate).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling.pdf import Floats, Indices

PASSES = 3
"""Times that the weights are computed again from the estimate, on which they depend weakly."""


def last_usable_sample(saturated: NDArray[np.bool_]) -> Indices:
    """Return the index of the last sample before the first saturated one.

    Parameters
    ----------
    saturated : (N, ...) array
        Whether each sample is saturated, in the order of time.

    Returns
    -------
    (...) array
        Indices; -1 where there is no such sample.
    """
    clean = np.logical_and.accumulate(~saturated, axis=0)
    last: Indices = clean.sum(axis=0) - 1
    return last


def last_sample_before_saturation(
    samples: ArrayLike, times: ArrayLike, saturated: NDArray[np.bool_], dark_rate: float = 0.0
) -> Floats:
    """Estimate photocurrents from the last samples before saturation, section 4.2 of [1]_.

    The estimate is the sample less its dark charge, over its time.

    Parameters
    ----------
    samples : (N, ...) array_like
        Charge at each of the times [e].
    times : (N,) array_like
        Rising sample times [s].
    saturated : (N, ...) array
        Whether a sample has reached the well or the ADC's end.
    dark_rate : float
        Mean dark current of a pixel, i_dc [e/s].

    Returns
    -------
    (...) array
        Photocurrents [e/s]. That of a pixel that is saturated in the first sample is taken from
        this sample, a lower bound.

    References
    ----------
    .. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
       University, 2003.
    """
    values, when = np.asarray(samples, dtype=np.float64), np.asarray(times, dtype=np.float64)
    index = np.maximum(last_usable_sample(saturated), 0)
    last = np.take_along_axis(values, index[None], axis=0)[0]
    rate: Floats = last / when[index] - dark_rate
    return rate


def weighted_estimate(
    samples: ArrayLike,
    times: ArrayLike,
    saturated: NDArray[np.bool_],
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> Floats:
    """Estimate photocurrents by the best linear unbiased estimate from all samples, [1]_.

    i = t' C^-1 (Q - i_dc t) / t' C^-1 t, over the samples before saturation, C their covariance for
    the pixel's own i. That is taken from the estimate itself, which begins with the last sample
    before saturation. Differences of samples have a tridiagonal covariance, so that each pixel
    takes one pass over its samples.

    Parameters
    ----------
    samples, times, saturated, dark_rate
        As those of `last_sample_before_saturation`.
    read_variance : float
        Variance of one readout [e^2].
    reset_variance : float
        Variance of the reset, common to all samples [e^2].

    Returns
    -------
    (...) array
        Photocurrents [e/s]; of a pixel that is saturated in the first sample a lower bound.

    References
    ----------
    .. [1] X. Liu and A. El Gamal, "Synthesis of high dynamic range motion blur free image from
       multiple captures", IEEE Trans. Circuits Syst. I 50(4), 2003,
       doi:10.1109/TCSI.2003.809815.
    """
    values, when = np.asarray(samples, dtype=np.float64), np.asarray(times, dtype=np.float64)
    clean = np.logical_and.accumulate(~saturated, axis=0)
    clean[0] = True
    estimate = last_sample_before_saturation(values, when, saturated, dark_rate)
    if read_variance == 0 and reset_variance == 0:
        return estimate  # the last sample is a sufficient statistic
    for _ in range(PASSES):
        rate = np.maximum(estimate, 0) + dark_rate
        precision, signal = _precision_and_signal(
            values, when, clean, rate, dark_rate, read_variance, reset_variance
        )
        estimate = signal / precision
    return estimate


def weighted_variance(
    photocurrent: ArrayLike,
    times: ArrayLike,
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> Floats:
    """Return the variance of the weighted estimate from samples at all times, 1 / (t' C^-1 t).

    Parameters
    ----------
    photocurrent : (...) array_like
        Photocurrents of the pixels [e/s].
    times : (N,) array_like
        Rising sample times [s].
    dark_rate : float
        Mean dark current of a pixel [e/s].
    read_variance, reset_variance : float
        Variances of one readout and of the reset [e^2].

    Returns
    -------
    (...) array
        Variances [(e/s)^2].
    """
    when = np.asarray(times, dtype=np.float64)
    rate = np.asarray(photocurrent, dtype=np.float64) + dark_rate
    shape = (len(when), *rate.shape)
    clean = np.ones(shape, bool)
    precision, _ = _precision_and_signal(
        np.zeros(shape), when, clean, rate, dark_rate, read_variance, reset_variance
    )
    return 1 / precision


def _precision_and_signal(
    values: Floats,
    when: Floats,
    clean: NDArray[np.bool_],
    rate: Floats,
    dark_rate: float,
    read_variance: float,
    reset_variance: float,
) -> tuple[Floats, Floats]:
    """Return t' C^-1 t and t' C^-1 (Q - i_dc t), by elimination in the tridiagonal covariance.

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
