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
from numpy.typing import NDArray

from vcam_cli.camera.electrical import Electrical
from vcam_cli.effects.base import Code, Draw, Effect, Limit, Site
from vcam_cli.effects.saturation import Saturation
from vcam_cli.engine.capture import codes_type, mean_dark, mean_electrons, sites
from vcam_cli.engine.parallel import each
from vcam_cli.rng import blocks
from vcam_cli.scheduling import estimators


def samples(
    rate: NDArray,
    times: Sequence[float],
    effects: tuple[Effect, ...],
    code: Code,
    seeds: dict[str, int],
    workers: int,
    layer: int = 0,
) -> tuple[NDArray, NDArray]:
    """All samples of one integration: (electrons, dn), each (N, ...) in the shape of `rate`.

    times: (N,) rising [s]; the rest as for `capture.capture`, and so are electrons and dn.
    """
    if rate.ndim == 3:
        layers = [
            samples(plane, times, effects, code, seeds, workers, number)
            for number, plane in enumerate(rate)
        ]
        return np.stack([e for e, _ in layers], 1), np.stack([dn for _, dn in layers], 1)
    electrons = np.empty((len(times), *rate.shape), rate.dtype)
    dn = np.empty(electrons.shape, codes_type(code.bits))
    well = next((e.full_well for e in effects if isinstance(e, Saturation)), np.inf)

    def shoot(block: slice) -> None:
        charge = np.zeros_like(rate[block])
        full = np.zeros(charge.shape, bool)
        before = 0.0
        for number, time in enumerate(times):
            step = time - before
            dark = mean_dark(step, effects)
            new = sites(charge, dark, seeds, layer, block, number)
            same = sites(charge, dark, seeds, layer, block)
            charge += _collected(mean_electrons(rate[block], step, effects), effects, new, same)
            read = _read(charge.copy(), effects, new, same)
            read[full] = well
            full = read >= well
            electrons[number, block] = read
            dn[number, block] = code.apply(read)
            before = time

    each(shoot, blocks(len(rate)), workers)
    return electrons, dn


Sites = dict[str, Site]


def _collected(mean: NDArray, effects: Sequence[Effect], new: Sites, same: Sites) -> NDArray:
    """Charge that one step adds, with its shot noise [electrons]."""
    draws = [e for e in effects if isinstance(e, Draw)]
    for draw in draws:
        mean = draw.before_shot(mean, _site(draw, new, same))
    for draw in draws:
        if draw.in_samples == "accumulates":
            mean = draw.apply(mean, _site(draw, new, same))
    return mean


def _read(charge: NDArray, effects: Sequence[Effect], new: Sites, same: Sites) -> NDArray:
    """What one readout makes of the charge so far [electrons]; may reuse the array."""
    for effect in effects:
        if isinstance(effect, Draw) and effect.in_samples != "accumulates":
            charge = effect.apply(charge, _site(effect, new, same))
        elif isinstance(effect, Limit):
            charge = effect.apply(charge)
    return charge


def _site(draw: Draw, new: Sites, same: Sites) -> Site:
    return (same if draw.in_samples == "same" else new)[draw.scope]


def photocurrent(
    dn: NDArray,
    times: Sequence[float],
    estimator: str,
    effects: tuple[Effect, ...],
    code: Code,
    electrical: Electrical,
    saturated_dn: float,
    workers: int,
) -> NDArray:
    """The photocurrent of every pixel from the codes of its samples, as a camera finds it [e/s].

    dn: (N, ..., rows, columns) [DN]; times: (N,) rising [s]; estimator: 'lsbs' (last sample before
    saturation) or 'weighted' (the best linear one of all samples before it); effects: those that
    run, of which the mean dark current and the variances are known; saturated_dn: the lowest code
    of a saturated pixel. Returns (..., rows, columns) float32; of a pixel that is full in the first
    sample what that one says, a lower bound.

    Variances count the rounding of the ADC, q^2 / 12, of a logarithmic one its step in the dark.
    Offsets of the fixed pattern are in the estimate: no dark frame is subtracted.
    """
    dark = mean_dark(1.0, effects)
    read, reset = variances(effects, code)
    out = np.empty(dn.shape[1:], np.float32)

    def estimate(block: slice) -> None:
        here = dn[..., block, :]
        full = here >= saturated_dn
        linear = code.linear(here.astype(np.float64))
        charge = (linear - electrical.offset) * electrical.electrons_per_dn
        if estimator == "weighted":
            found = estimators.weighted(charge, times, full, dark, read, reset)
        else:
            found = estimators.last_sample_before_saturation(charge, times, full, dark)
        out[..., block, :] = found

    each(estimate, blocks(dn.shape[-2]), workers)
    return out


def variances(effects: tuple[Effect, ...], code: Code) -> tuple[float, float]:
    """Of one readout, rounding included, and of what is common to all samples [e^2]."""
    draws = [e for e in effects if isinstance(e, Draw) and e.scope == "frame"]
    new = sum(e.variance(0.0) for e in draws if e.in_samples == "new")
    common = sum(e.variance(0.0) for e in draws if e.in_samples == "same")
    below, above = code.line(np.array([0.0, 1.0]))
    return float(new + (1 / (above - below)) ** 2 / 12), float(common)
