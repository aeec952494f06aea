"""What is measured of every frame: its metrics, and how it was exposed.

References
----------
T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
section 3.2.1; EMVA Standard 1288, release 4.0; ISO 12232:2019.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.physics import readout
from vcam_cli.processing.tone_map import sensor_white
from vcam_cli.records import dataclass
from vcam_cli.simulation.frame import Frame
from vcam_cli.simulation.pixel_figures import pixel_figures

GRAY = 0.18
"""Reflectance of the gray card that exposure meters are set to."""
EDGE_REACH = 32
"""Distance from the edge up to which its profile is measured [pixels]: half of the 64 x 64 regions
that ISO 12233 takes at least."""


def figures(frame: Frame) -> list[tuple[str, float, str]]:
    """Return the metrics that every run has: (metric, value, unit).

    `pixel_figures` computes dynamic ranges (eq 3.1), SNR (eq 3.2) and well capacity. Of several
    samples of one integration, all but the last two are of the last sample.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    list of tuple
        Metric, value and unit; the unit is empty for numbers without one.
    """
    known = pixel_figures(frame.solved, frame.exposure_time)
    listed = [
        ("exposure_time", frame.exposure_time, "s"),
        ("mean_electrons", float(frame.electrons.mean(dtype=np.float64)), "e"),
        ("saturated_fraction", float(saturated_pixels(frame).mean()), ""),
        ("snr_db", known.snr_db, "dB"),
        ("dynamic_range_db", known.dynamic_range_db, "dB"),
        ("well_capacity", known.well_capacity, "e"),
        ("quantized_dynamic_range_db", known.quantized_dynamic_range_db, "dB"),
        ("picture_snr_db", picture_snr_db(frame), "dB"),
        ("gray_snr_db", gray_snr_db(frame), "dB"),
        ("base_iso", frame.base_iso, ""),
        ("digital_gain", digital_gain(frame), ""),
    ]
    mtf50 = edge_mtf50(frame) if frame.solved.has_edge else math.nan
    if math.isfinite(mtf50):
        listed.append(("mtf50", mtf50, "cycles/pixel"))
    return listed + _sample_figures(frame, known.dark, known.draws) if frame.times else listed


def _sample_figures(
    frame: Frame, dark: float, draws: Sequence[NoiseSource]
) -> list[tuple[str, float, str]]:
    """Return what several samples add: dynamic range of the photocurrent, and where it is unknown.

    Eq 3.1 for the photocurrent: the largest that does not fill the first sample, over the noise of
    the estimate in the dark. `dark` is of the last sample [electrons]; `draws` are new in every
    frame.
    """
    first, last = min(frame.times), max(frame.times)
    floor = sum(x.variance(0.0) for x in draws)
    if frame.solved.exposure.estimator == "weighted" and not frame.solved.exposure.bracket:
        from vcam_cli.scheduling import estimators

        read = sum(x.variance(0.0) for x in draws if x.sample_draws == "independent")
        noise = estimators.weighted_variance(0.0, frame.times, dark / last, read, floor - read)
        floor = float(noise) * last**2 - dark
    well = frame.chain.full_well * last / first
    nowhere = frame.picture_dn >= frame.picture_saturated_dn
    return [
        ("hdr_saturated_fraction", float(nowhere.mean()), ""),
        ("hdr_dynamic_range_db", float(readout.dynamic_range_db(well, dark, floor)), "dB"),
    ]


def saturated_pixels(frame: Frame) -> Array:
    """Return the mask of saturated pixels of the raw frame.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    Array
        Mask in the shape of `dn`.
    """
    e, groups = frame.electrical, frame.layout.binning_groups
    alone = groups.count == groups.summed_charges and frame.chain.merge is None
    if alone and not frame.chain.noise_of_full:
        full = e.full_well if frame.full_charge is None else frame.full_charge
        return np.asarray((frame.electrons >= full) | (frame.dn >= frame.chain.highest_dn))
    return np.asarray(frame.dn >= frame.chain.saturated_dn)


def picture_snr_db(frame: Frame) -> float:
    """Return the SNR of a picture: its mean signal over its temporal noise.

    Both are of the pixels whose mean signal does not saturate: the mean of their light, and the
    root of their mean temporal variance, the ADC's rounding included. Temporal variances are
    straight lines of the signal, so that the mean variance is that of the mean signal.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    float
        SNR [dB]; -inf without light, or where all pixels saturate.
    """
    groups = frame.layout.binning_groups
    signal = groups.join(frame.rate) * frame.exposure_time / groups.summed_codes
    usable = signal + frame.dark_rate * frame.exposure_time < frame.chain.saturation
    count = int(usable.sum())
    return _snr_db(frame, float(signal.sum(where=usable, dtype=np.float64)) / max(count, 1))


def gray_snr_db(frame: Frame) -> float:
    """Return the SNR of 18 % gray on the axis, as exposed, over its temporal noise.

    The signal is the mean over the pixels of those colors that do not saturate.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    float
        SNR [dB]; -inf without light, or where all colors saturate.
    """
    layout, colors = frame.layout, len(frame.mosaic.colors)
    counts = np.ones(colors)
    if not layout.full_color:
        counts = np.array([np.count_nonzero(layout.color == color) for color in range(colors)])
    signal = GRAY * frame.white_rate * frame.exposure_time
    usable = signal + frame.dark_rate * frame.exposure_time < frame.chain.saturation
    weights = counts * usable
    return _snr_db(frame, float((weights * signal).sum() / max(weights.sum(), 1)))


def _snr_db(frame: Frame, light: float) -> float:
    """Return a mean signal [electrons] over its temporal noise, rounding included [dB]."""
    if light <= 0:
        return -math.inf
    dark = frame.dark_rate * frame.exposure_time
    return 20 * math.log10(light / math.sqrt(frame.chain.noise(light + dark, dark).total))


def edge_mtf50(frame: Frame) -> float:
    """Return the MTF50 of the raw frame of a slanted edge: the e-SFR of ISO 12233.

    It is that of the color with the most pixels, the brightest of these.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    float
        Frequency [cycles/pixel]; nan where no edge is found, inf where the MTF stays above one
        half.
    """
    from vcam_cli.quality import mtf

    layout, plane = frame.layout, frame.picture_dn
    if layout.full_color:
        plane = plane[int(frame.white_rate.argmax())]
        parts = [(slice(None), slice(None))]
    else:
        mosaic = layout.raw_mosaic
        block = np.array(mosaic.block)
        counts = [int((block == name).sum()) for name in mosaic.colors]
        color = max(zip(counts, frame.white_rate, mosaic.colors, strict=True))[2]
        rows, columns = block.shape
        parts = [
            (slice(int(i), None, rows), slice(int(j), None, columns))
            for i, j in np.argwhere(block == color)
        ]
    x, y = layout.centers
    lattices = [
        mtf.Lattice(frame.chain.linear(plane[rows, columns]), x[columns], y[rows])
        for rows, columns in parts
    ]
    pitch = min(layout.geometry.pitch_x, layout.geometry.pitch_y)
    try:
        return mtf.slanted_edge_sfr(lattices, pitch, EDGE_REACH * pitch).mtf50 * pitch
    except ValueError:
        return math.nan


def digital_gain(frame: Frame) -> float:
    """Return the factor between the raw frame and the render.

    The raw is 1 where it saturates, the render at its white. A gain of 1 shows that saturation as
    white, as `tone: {white: sensor}` does.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    float
        Factor without unit; 0 where white gives no signal.
    """
    tone = next((s.value for s in frame.solved.processing if s.name == "tone"), None)
    stops = 2.0**tone.exposure if tone else 1.0
    codes = np.array([*frame.white_dn, frame.black_dn, frame.picture_saturated_dn])
    *white, black, saturated = frame.chain.linear(codes)
    needed = sensor_white(np.array(white), black, saturated)
    return stops if tone and tone.white == "sensor" and needed > 0 else needed * stops


@dataclass(frozen=True)
class ExposureReport:
    """How a frame was exposed, and how well that used the sensor."""

    time: float
    """Exposure time [s]."""
    gain: float
    """Analog gain before the ADC."""
    iso: float
    """ISO speed at this gain."""
    automatic: bool
    """Whether the camera chose it."""
    stopped_by: str
    """Limit that an automatic exposure ran into, as in `ExposureSettings`."""
    raw_peak: float
    """Mean signal of the brightest pixel, neither noise nor defects in it, as a fraction of full
    scale; 1 where it saturates."""
    clipped: dict[str, float]
    """Color -> fraction of its pixels that are saturated."""

    def report(self) -> dict[str, Any]:
        """Return it as `run.json` has it."""
        return asdict(self)


def exposure_report(frame: Frame) -> ExposureReport:
    """Return the exposure of a frame.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    ExposureReport
        Exposure; of several samples of one integration that of the last.
    """
    gain = frame.solved.gain
    return ExposureReport(
        time=frame.exposure_time,
        gain=gain,
        iso=frame.base_iso * gain,
        automatic=frame.solved.exposure.auto is not None,
        stopped_by=frame.exposure_limit,
        raw_peak=_raw_peak(frame),
        clipped=_clipped(frame),
    )


def _raw_peak(frame: Frame) -> float:
    """Return the brightest pixel's mean code above the offset, as a fraction of full scale."""
    groups, e = frame.layout.binning_groups, frame.electrical
    summed = groups.summed_codes
    brightest = (float(groups.join(frame.rate).max()) / summed + frame.dark_rate) * (
        frame.exposure_time
    )
    black, level = frame.chain.adc.response(np.array([0.0, min(brightest, e.full_well)]))
    return min(float((level - black) / (frame.chain.adc.highest_code - black)), 1.0)


def _clipped(frame: Frame) -> dict[str, float]:
    full, colors = saturated_pixels(frame), frame.mosaic.colors
    if frame.layout.full_color:
        return {name: float(plane.mean()) for name, plane in zip(colors, full, strict=True)}
    shares = {}
    for number, name in enumerate(colors):  # numbers of 64 bits for all pixels would be the peak
        own = frame.layout.color == number
        shares[name] = int(np.count_nonzero(full & own)) / max(int(np.count_nonzero(own)), 1)
    return shares
