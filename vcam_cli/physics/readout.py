"""From collected electrons to volts and codes, and the two figures of merit of a pixel.

Charge is counted in electrons [e], variances in [e^2].

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, sections 2.2.2 and 3.2.1.
[2] B. Fowler, M. Godfrey, J. Balicki, J. Canfield, "Low noise readout using active reset for CMOS
    APS", Proc. SPIE 3965, 2000 (reset noise of a capacitance).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.spectra import BOLTZMANN

Floats = NDArray[np.float64]

ELEMENTARY_CHARGE = 1.602176634e-19  # [C], exact in the SI of 2019


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def conversion_gain(capacitance: ArrayLike) -> Floats:
    """Volts per electron, q / C, eq 2.32 of [1]: [V/e] from the sense capacitance [F]."""
    return (ELEMENTARY_CHARGE / _float(capacitance))[()]


def sense_capacitance(conversion_gain: ArrayLike) -> Floats:
    """The capacitance [F] behind a conversion gain [V/e]: q / g, 2.32 inverted."""
    return (ELEMENTARY_CHARGE / _float(conversion_gain))[()]


def voltage_swing(
    supply: ArrayLike,
    reset_threshold: ArrayLike,
    follower_gate_source: ArrayLike,
    bias: ArrayLike,
    bias_threshold: ArrayLike,
) -> Floats:
    """Voltage swing of a 3T pixel, (V_DD - V_TR - V_GSF) - (V_bias - V_TB), eq 2.33 of [1].

    Parameters
    ----------
    supply : V_DD [V]
    reset_threshold : threshold of the reset transistor, V_TR [V]
    follower_gate_source : gate to source of the follower, V_GSF [V]
    bias, bias_threshold : gate voltage and threshold of the bias transistor, V_bias, V_TB [V]

    Returns
    -------
    [V]; not positive where the pixel could not work
    """
    highest = _float(supply) - _float(reset_threshold) - _float(follower_gate_source)
    return (highest - (_float(bias) - _float(bias_threshold)))[()]


def well_capacity(voltage_swing: ArrayLike, conversion_gain: ArrayLike) -> Floats:
    """Electrons that fill the swing, q_max = V_s / g [e], from [V] and [V/e]."""
    return (_float(voltage_swing) / _float(conversion_gain))[()]


def reset_noise_variance(capacitance: ArrayLike, temperature: ArrayLike) -> Floats:
    """Variance of the charge left by a reset, k T C / q^2 [e^2], from [F] and [K] [2]."""
    thermal = BOLTZMANN * _float(temperature) * _float(capacitance)
    return (thermal / ELEMENTARY_CHARGE / ELEMENTARY_CHARGE)[()]


def codes_per_electron(
    conversion_gain: ArrayLike,
    gain: ArrayLike,
    full_scale: ArrayLike,
    bits: ArrayLike,
    offset: ArrayLike,
) -> Floats:
    """Slope of a linear ADC, g gain (2^bits - 1 - offset) / full_scale [DN/e].

    Parameters
    ----------
    conversion_gain : g [V/e]
    gain : analog gain between pixel and ADC [dimensionless]
    full_scale : volts above black that give the highest code [V]
    bits : of the ADC
    offset : code of black [DN]
    """
    span = 2.0 ** _float(bits) - 1 - _float(offset)
    return (_float(conversion_gain) * _float(gain) / _float(full_scale) * span)[()]


def full_scale_of(
    conversion_gain: ArrayLike,
    gain: ArrayLike,
    codes_per_electron: ArrayLike,
    bits: ArrayLike,
    offset: ArrayLike,
) -> Floats:
    """Full scale [V] of a linear ADC with a wanted slope [DN/e]; see `codes_per_electron`."""
    span = 2.0 ** _float(bits) - 1 - _float(offset)
    return (_float(conversion_gain) * _float(gain) / _float(codes_per_electron) * span)[()]


def code(
    electrons: ArrayLike, codes_per_electron: ArrayLike, bits: int, offset: ArrayLike = 0.0
) -> Floats:
    """Output of a linear ADC, clip(round(offset + electrons x slope), 0, 2^bits - 1) [DN].

    Halves are rounded to the even code. Whole numbers, as floats, in the shape of `electrons`.
    """
    level = _float(offset) + _float(electrons) * _float(codes_per_electron)
    return np.clip(np.rint(level), 0.0, 2.0**bits - 1)[()]


def quantization_variance(codes_per_electron: ArrayLike) -> Floats:
    """Variance of rounding to codes, seen in electrons: a twelfth of a code squared [e^2]."""
    return (1 / (12 * _float(codes_per_electron) ** 2))[()]


def dynamic_range_db(
    well_capacity: ArrayLike, dark_electrons: ArrayLike, read_variance: ArrayLike
) -> Floats:
    """Largest unsaturated signal over the noise in the dark, eq 3.1 of [1].

    DR = 20 log10[(q_max - i_dc t) / sqrt(sigma_r^2 + i_dc t)], all in electrons.

    Parameters
    ----------
    well_capacity : q_max [e]
    dark_electrons : i_dc t, dark charge of the exposure [e]
    read_variance : sigma_r^2, reset and readout noise [e^2]

    Returns
    -------
    [dB]; -inf where dark current alone fills the well, inf where there is no noise
    """
    dark = _float(dark_electrons)
    signal = np.maximum(_float(well_capacity) - dark, 0.0)
    return _ratio_db(signal, _float(read_variance) + dark)


def snr_db(
    photo_electrons: ArrayLike, dark_electrons: ArrayLike, read_variance: ArrayLike
) -> Floats:
    """Signal over temporal noise, eq 3.2 of [1].

    SNR = 20 log10[i_ph t / sqrt(sigma_r^2 + (i_ph + i_dc) t)], all in electrons.

    Parameters
    ----------
    photo_electrons : i_ph t, collected light of the exposure [e]
    dark_electrons : i_dc t [e]
    read_variance : sigma_r^2, reset and readout noise [e^2]

    Returns
    -------
    [dB]; -inf without light
    """
    light = _float(photo_electrons)
    return _ratio_db(light, _float(read_variance) + light + _float(dark_electrons))


def _ratio_db(signal: Floats, variance: Floats) -> Floats:
    """20 log10(signal / sqrt(variance)); -inf for no signal, whatever the noise."""
    with np.errstate(divide="ignore"):
        ratio = 20 * np.log10(signal) - np.where(signal > 0, 10 * np.log10(variance), 0.0)
    return ratio[()]
