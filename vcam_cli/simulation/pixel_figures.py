"""SNR and dynamic range of a pixel without a frame: eqs 3.1 and 3.2.

Reference: T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
University, 2003, section 3.2.1.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.effects.signal_chain import NoiseSource, noise_sources
from vcam_cli.physics import readout
from vcam_cli.readout.exposure import mean_dark
from vcam_cli.records import dataclass
from vcam_cli.solve.solved import Solved

SHARE = 0.2
"""Signal at which the SNR is stated, over the well."""


@dataclass(frozen=True)
class PixelFigures:
    """Of one pixel of the camera that the file describes, whatever a plan leaves out of frames.

    Of pixels that are read as one they are of one such pixel in even light, SNR where each well is
    a fifth full, and well capacity is in the unit of the raw frame's electrons: one node's well
    where charges are joined, the mean of the wells of voltages, the sum of those whose codes are
    added.
    """

    snr_db: float
    """At a fifth of the well."""
    dynamic_range_db: float
    quantized_dynamic_range_db: float
    """With the ADC: up to the end of its codes, and with their rounding as noise."""
    well_capacity: float
    """[electrons]"""
    dark: float
    """Mean dark signal of a node [electrons]."""
    draws: tuple[NoiseSource, ...]
    """What is new in every frame."""


def pixel_figures(solved: Solved, time: float) -> PixelFigures:
    """Return the SNR and dynamic range of a pixel.

    Parameters
    ----------
    solved : Solved
        Solved camera.
    time : float
        Exposure time [s].

    Returns
    -------
    PixelFigures
        SNR and dynamic range [dB], and charges [electrons].
    """
    chain, groups = solved.chain, solved.layout.binning_groups
    # In electrons of all wells together, in which shot noise is Poisson's.
    wells = groups.count // groups.summed_charges
    floor = chain.noise(0.0).analog * wells**2
    dark = mean_dark(time, chain.effects)
    well, all_dark = chain.full_well * wells, dark * wells
    most = chain.saturation * wells
    conversions = groups.binning.conversions
    one = chain.adc.rounding(dark, conversions * floor / wells**2)
    rounding = wells**2 * one / conversions
    if chain.merge is not None:
        rounding += chain.merge.rounding(dark)
    snr = readout.snr_db(SHARE * well, all_dark, floor)
    if chain.merge is not None:  # the readout that holds so much decides, and its light
        noise = chain.noise(SHARE * well + dark, dark).analog
        snr = 20 * np.log10(SHARE * well / np.sqrt(noise))
    return PixelFigures(
        snr_db=float(snr),
        dynamic_range_db=float(readout.dynamic_range_db(well, all_dark, floor)),
        quantized_dynamic_range_db=float(
            readout.dynamic_range_db(most, all_dark, floor + rounding)
        ),
        well_capacity=chain.full_well * groups.summed_codes,
        dark=dark,
        draws=noise_sources(chain.effects, "frame"),
    )
