"""Readout of a pixel: electrons to volts and digital numbers, dynamic range and SNR.

Charge is counted in electrons [e], variances in [e^2].

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, sections 2.2.2 and 3.2.1.
.. [2] B. Fowler, M. Godfrey, J. Balicki, J. Canfield, "Low-noise readout using active reset for
   CMOS APS", Proc. SPIE 3965, 2000 (reset noise of a capacitance).
.. [3] ISO 12232:2019, Digital still cameras: determination of exposure index, ISO speed ratings,
   standard output sensitivity, and recommended exposure index (saturation-based speed).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.spectra import BOLTZMANN

Floats = NDArray[np.float64]

ELEMENTARY_CHARGE = 1.602176634e-19  # [C], exact in the SI of 2019


SATURATION_CONSTANT = 78.0
"""Of saturation-based ISO speed [lx s]."""


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def conversion_gain(capacitance: ArrayLike) -> Floats:
    """Return the conversion gain of a sense node, q / C, eq 2.32 of [1].

    Parameters
    ----------
    capacitance : array_like
        Capacitance of the sense node [F], positive.

    Returns
    -------
    ndarray
        Conversion gain [V/e].

    Examples
    --------
    >>> round(1e6 * float(conversion_gain(8e-15)), 2)  # uV/e
    20.03
    """
    return (ELEMENTARY_CHARGE / _float(capacitance))[()]


def sense_capacitance(conversion_gain: ArrayLike) -> Floats:
    """Return the sense capacitance of a conversion gain, q / g: eq 2.32 of [1] inverted.

    Parameters
    ----------
    conversion_gain : array_like
        Conversion gain g [V/e], positive.

    Returns
    -------
    ndarray
        Capacitance of the sense node [F].
    """
    return (ELEMENTARY_CHARGE / _float(conversion_gain))[()]


def voltage_swing(
    supply: ArrayLike,
    reset_threshold: ArrayLike,
    follower_gate_source: ArrayLike,
    bias: ArrayLike,
    bias_threshold: ArrayLike,
) -> Floats:
    """Return the voltage swing of a 3T pixel, eq 2.33 of [1].

    V_s = (V_DD - V_TR - V_GSF) - (V_bias - V_TB).

    Parameters
    ----------
    supply : array_like
        Supply voltage V_DD [V].
    reset_threshold : array_like
        Threshold of the reset transistor V_TR [V].
    follower_gate_source : array_like
        Gate-to-source voltage of the source follower V_GSF [V].
    bias : array_like
        Gate voltage of the bias transistor V_bias [V].
    bias_threshold : array_like
        Threshold of the bias transistor V_TB [V].

    Returns
    -------
    ndarray
        Voltage swing V_s [V]; not positive where the pixel could not work.
    """
    highest = _float(supply) - _float(reset_threshold) - _float(follower_gate_source)
    return (highest - (_float(bias) - _float(bias_threshold)))[()]


def well_capacity(voltage_swing: ArrayLike, conversion_gain: ArrayLike) -> Floats:
    """Return the full-well capacity of a voltage swing, q_max = V_s / g.

    Parameters
    ----------
    voltage_swing : array_like
        Voltage swing V_s [V].
    conversion_gain : array_like
        Conversion gain g [V/e], positive.

    Returns
    -------
    ndarray
        Electrons that fill the swing [e].

    Examples
    --------
    >>> round(float(well_capacity(1.0, 40e-6)))
    25000
    """
    return (_float(voltage_swing) / _float(conversion_gain))[()]


def reset_noise_variance(capacitance: ArrayLike, temperature: ArrayLike) -> Floats:
    """Return the variance of the charge that a reset leaves, k T C / q^2 [2].

    Parameters
    ----------
    capacitance : array_like
        Capacitance C that is reset [F].
    temperature : array_like
        Temperature T [K].

    Returns
    -------
    ndarray
        Variance of kTC noise [e^2].
    """
    thermal = BOLTZMANN * _float(temperature) * _float(capacitance)
    return (thermal / ELEMENTARY_CHARGE / ELEMENTARY_CHARGE)[()]


def codes_per_electron(
    conversion_gain: ArrayLike,
    gain: ArrayLike,
    full_scale: ArrayLike,
    bits: ArrayLike,
    offset: ArrayLike,
) -> Floats:
    """Return the slope of a linear ADC, g gain (2^bits - 1 - offset) / full_scale.

    Parameters
    ----------
    conversion_gain : array_like
        Conversion gain g [V/e].
    gain : array_like
        Analog gain between pixel and ADC [dimensionless].
    full_scale : array_like
        Volts above black that give the highest code [V], positive.
    bits : array_like
        Resolution of the ADC [bits].
    offset : array_like
        Code of black [DN].

    Returns
    -------
    ndarray
        Overall system gain [DN/e].
    """
    span = 2.0 ** _float(bits) - 1 - _float(offset)
    return (_float(conversion_gain) * _float(gain) / _float(full_scale) * span)[()]


def adc_full_scale(
    conversion_gain: ArrayLike,
    gain: ArrayLike,
    slope: ArrayLike,
    bits: ArrayLike,
    offset: ArrayLike,
) -> Floats:
    """Return the full scale of a linear ADC with a wanted slope: `codes_per_electron` inverted.

    Slope and full scale change places in it.

    Parameters
    ----------
    conversion_gain, gain, bits, offset
        As those of `codes_per_electron`.
    slope : array_like
        Overall system gain [DN/e], positive.

    Returns
    -------
    ndarray
        Volts above black that give the highest code [V].
    """
    return codes_per_electron(conversion_gain, gain, slope, bits, offset)


def saturation_speed(saturation_exposure: ArrayLike) -> Floats:
    """Return the saturation-based ISO speed, 78 / H_sat [3].

    At this speed, exposed as a light meter asks, a white of 100 % reflectance lies half a stop
    below saturation.

    Parameters
    ----------
    saturation_exposure : array_like
        Least exposure of the focal plane that saturates, H_sat [lx s].

    Returns
    -------
    ndarray
        ISO speed [dimensionless]; 0 where no exposure saturates.
    """
    return (SATURATION_CONSTANT / _float(saturation_exposure))[()]


def dynamic_range_db(
    well_capacity: ArrayLike, dark_electrons: ArrayLike, read_variance: ArrayLike
) -> Floats:
    """Return the dynamic range: largest unsaturated signal over the dark noise, eq 3.1 of [1].

    DR = 20 log10[(q_max - i_dc t) / sqrt(sigma_r^2 + i_dc t)], all in electrons.

    Parameters
    ----------
    well_capacity : array_like
        Full-well capacity q_max [e].
    dark_electrons : array_like
        Dark charge of the exposure i_dc t [e].
    read_variance : array_like
        Variance of reset and readout noise sigma_r^2 [e^2].

    Returns
    -------
    ndarray
        Dynamic range [dB]; -inf where dark current alone fills the well, inf where there is no
        noise.
    """
    dark = _float(dark_electrons)
    signal = np.maximum(_float(well_capacity) - dark, 0.0)
    return _ratio_db(signal, _float(read_variance) + dark)


def snr_db(
    photo_electrons: ArrayLike, dark_electrons: ArrayLike, read_variance: ArrayLike
) -> Floats:
    """Return the ratio of signal to temporal noise, eq 3.2 of [1].

    SNR = 20 log10[i_ph t / sqrt(sigma_r^2 + (i_ph + i_dc) t)], all in electrons.

    Parameters
    ----------
    photo_electrons : array_like
        Collected light of the exposure i_ph t [e].
    dark_electrons : array_like
        Dark charge of the exposure i_dc t [e].
    read_variance : array_like
        Variance of reset and readout noise sigma_r^2 [e^2].

    Returns
    -------
    ndarray
        Signal-to-noise ratio [dB]; -inf without light.

    Examples
    --------
    Ten thousand electrons with shot noise alone:

    >>> float(snr_db(10_000, 0, 0))
    40.0
    """
    light = _float(photo_electrons)
    return _ratio_db(light, _float(read_variance) + light + _float(dark_electrons))


def _ratio_db(signal: Floats, variance: Floats) -> Floats:
    """Return 20 log10(signal / sqrt(variance)); -inf for no signal, whatever the noise."""
    with np.errstate(divide="ignore"):
        ratio = 20 * np.log10(signal) - np.where(signal > 0, 10 * np.log10(variance), 0.0)
    return ratio[()]
