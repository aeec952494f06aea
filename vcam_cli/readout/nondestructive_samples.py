"""Several samples of one integration, and the photocurrent that they tell.

Charge goes on accumulating while it is looked at. Its mean, with dark current and defects, grows
by what each step between two samples adds; its shot noise is that of independent steps. Reset
noise and fixed pattern are the same in all samples of a pixel, readout noise is new in each. So
samples of a pixel with the rates i and i_dc [e/s] have the covariance [electrons squared]

    cov(Q_j, Q_l) = (i + i_dc) min(t_j, t_l) + read_variance delta_jl + reset_variance

A pixel that is full stays full: no later sample of it is below the full well.

Streams of random numbers are keyed by the index of the sample, so a sample does not depend on how
many follow; the first one is, byte by byte, the frame of a single exposure of its time.

References
----------
T. Chen, PhD thesis, Stanford University, 2003, chapter 4; X. Liu and A. El Gamal, IEEE Trans.
Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import (
    ElectronEffect,
    NoiseSource,
    Quantizer,
    Site,
    electron_effects,
    full_well,
    noise_sources,
)
from vcam_cli.parallel import each
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.exposure import (
    codes_type,
    mean_dark,
    mean_electrons,
    runs_of_rows,
    sites,
)
from vcam_cli.rng import blocks
from vcam_cli.scheduling import estimators


def samples(
    rate: Array,
    times: Sequence[float],
    effects: tuple[Effect, ...],
    adc: Quantizer,
    seeds: dict[str, int],
    workers: int,
    layer: int = 0,
    step_rates: Sequence[Array] = (),
    coarse_normals: bool = False,
) -> tuple[Array, Array]:
    """Return all samples of one integration.

    Parameters
    ----------
    rate, effects, adc, seeds, workers, layer, coarse_normals
        As those of `exposure.capture`.
    times : sequence of float
        Times of the N samples, rising [s].
    step_rates : sequence of Array, optional
        Mean rate between each sample and the one before, where it is not the same all the time:
        N times the shape of `rate` [e/s].

    Returns
    -------
    electrons : Array
        Samples (N, ...) in the shape of `rate`, clipped above at the full well [electrons].
    dn : Array
        Codes of the samples, uint16, or uint32 from 17 bits on [DN].

    References
    ----------
    T. Chen, PhD thesis, Stanford University, 2003, chapter 4.
    """
    if rate.ndim == 3:
        layers = [
            samples(
                *(plane, times, effects, adc, seeds, workers, number),
                [of_step[number] for of_step in step_rates],
                coarse_normals,
            )
            for number, plane in enumerate(rate)
        ]
        return np.stack([e for e, _ in layers], 1), np.stack([dn for _, dn in layers], 1)
    electrons = np.empty((len(times), *rate.shape), rate.dtype)
    dn = np.empty(electrons.shape, codes_type(adc.bits))
    well = full_well(effects)

    def shoot(block: slice) -> None:
        charge = np.zeros_like(rate[block])
        full = np.zeros(charge.shape, bool)
        before = 0.0
        for number, time in enumerate(times):
            step = time - before
            dark = mean_dark(step, effects)
            sample_sites = sites(rate, dark, seeds, layer, block, number, coarse_normals)
            common_sites = sites(rate, dark, seeds, layer, block, 0, coarse_normals)
            lit = step_rates[number] if step_rates else rate
            charge += _collect_charge(
                mean_electrons(lit[block], step, effects), effects, sample_sites, common_sites
            )
            read = _read_charge(charge.copy(), effects, sample_sites, common_sites)
            read[full] = well
            full = read >= well
            electrons[number, block] = read
            for effect in electron_effects(effects, behind_well=True):
                read = effect.apply(read, _site(effect, sample_sites, common_sites))
            dn[number, block] = adc.apply(read)
            before = time

    each(shoot, runs_of_rows(rate), workers)
    return electrons, dn


Sites = dict[str, Site]


def _collect_charge(
    mean: Array, effects: Sequence[Effect], sample_sites: Sites, common_sites: Sites
) -> Array:
    """Return the charge that one step adds, with its shot noise [electrons]."""
    sources = of_kind(effects, NoiseSource)
    for source in sources:
        mean = source.before_shot(mean, _site(source, sample_sites, common_sites))
    for source in sources:
        if source.sample_draws == "cumulative":
            mean = source.apply(mean, _site(source, sample_sites, common_sites))
    return mean


def _read_charge(
    charge: Array, effects: Sequence[Effect], sample_sites: Sites, common_sites: Sites
) -> Array:
    """Return one readout of the charge so far, which may reuse its array [electrons]."""
    for effect in electron_effects(effects, behind_well=False):
        if effect.sample_draws != "cumulative":
            charge = effect.apply(charge, _site(effect, sample_sites, common_sites))
    return charge


def _site(effect: ElectronEffect, sample_sites: Sites, common_sites: Sites) -> Site:
    return (common_sites if effect.sample_draws == "common" else sample_sites)[effect.scope]


def photocurrent(
    dn: Array,
    times: Sequence[float],
    estimator: str,
    chain: ReadoutChain,
    workers: int,
) -> Array:
    """Return the photocurrent of every pixel, estimated from the codes of its samples.

    Variances count the rounding of the ADC, q^2 / 12, of a logarithmic one its step in the dark.
    Offsets of the fixed pattern are in the estimate: no dark frame is subtracted.

    Parameters
    ----------
    dn : Array
        Codes of the samples (N, ..., rows, columns) [DN].
    times : sequence of float
        Times of the N samples, rising [s].
    estimator : str
        'lsbs' (last sample before saturation) or 'weighted' (the best linear estimate from all
        samples before saturation).
    chain : ReadoutChain
        The way from codes back to electrons, with the effects that run.
    workers : int
        Number of threads; results do not depend on it.

    Returns
    -------
    Array
        Photocurrents (..., rows, columns), float32 [e/s]; of a pixel that is full in the first
        sample a lower bound.

    References
    ----------
    X. Liu and A. El Gamal, IEEE Trans. Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815.
    """
    dark, saturated_dn = mean_dark(1.0, chain.effects), chain.saturated_dn
    read, reset = variances(chain)
    out = np.empty(dn.shape[1:], np.float32)

    def estimate(block: slice) -> None:
        here = dn[..., block, :]
        full = here >= saturated_dn
        charge = chain.to_electrons(here.astype(np.float64))
        if estimator == "weighted":
            found = estimators.weighted_estimate(charge, times, full, dark, read, reset)
        else:
            found = estimators.last_sample_before_saturation(charge, times, full, dark)
        out[..., block, :] = found

    each(estimate, blocks(dn.shape[-2]), workers)
    return out


def variances(chain: ReadoutChain) -> tuple[float, float]:
    """Return the variances of one readout and of what all samples have in common.

    Parameters
    ----------
    chain : ReadoutChain
        The ADC, and the effects that run; temporal noise is used.

    Returns
    -------
    read : float
        Variance of one readout, rounding included [electrons squared].
    reset : float
        Variance that is common to all samples [electrons squared].
    """
    sources = noise_sources(chain.effects, "frame")
    sample_sites = sum(e.variance(0.0) for e in sources if e.sample_draws == "independent")
    common = sum(e.variance(0.0) for e in sources if e.sample_draws == "common")
    return float(sample_sites + chain.adc.step(0.0) ** 2 / 12), float(common)
