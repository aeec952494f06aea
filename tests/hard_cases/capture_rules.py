"""Hard cases of capture rules: what decides by a hair, and estimates from several samples."""

from __future__ import annotations

from fractions import Fraction

import mpmath as mp
import numpy as np

from vcam_cli.scheduling import comparison_schedules, histogram_binning, objective
from vcam_cli.scheduling.estimators import weighted_variance
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Constraints, Sensor, first_capture_time
from vcam_cli.scheduling.weighted_snr import weighted_expected_snr

from .hard_case import Case

# --- saturation ----------------------------------------------------------------------------------

BRINK = ((12345.6, 19.0), (12345.6, 84.0), (10000.0, 145.0), (10000.0, 303.0))
"""Wells w and levels i with (w / i) i > w in float64."""


def _brink_ours() -> list[float]:
    out = []
    for well, level in BRINK:
        pdf = Pdf.levels([level], [1.0])
        out.append(objective.expected_snr(pdf, [well / level], Sensor(well=well)))
    return out


def _brink_naive() -> list[float]:
    return [
        0.0 if level * (well / level) > well else level * (well / level) for well, level in BRINK
    ]


EDGE_OF_WELL = Case(
    "a capture that just fills the well, t = well / i",
    "(w / i) i is one unit above w: the pixel would count as saturated",
    "exactly the well",
    lambda: [well for well, _ in BRINK],
    _brink_ours,
    _brink_naive,
    "saturated where i t > well",
    1e-15,
    "a time is rounded",
)

FRAME_TIMES = ((0.3, 0.1, 3), (0.6, 0.2, 3), (0.7, 0.1, 7), (1.1, 0.1, 11))
"""The longest time that does not saturate, the frame's, and how many frames fit."""


def _whole_frames() -> list[float]:
    one = Pdf.levels([1.0], [1.0])
    return [
        round(first_capture_time(one, Sensor(well=time), Constraints(frame_time=frame)) / frame, 9)
        for time, frame, _ in FRAME_TIMES
    ]


FRAMES = Case(
    "whole frames in 0.3 s of 0.1 s each",
    "0.3 / 0.1 is 2.9999999999999996",
    "exactly, in decimals",
    lambda: [count for *_, count in FRAME_TIMES],
    _whole_frames,
    lambda: [time // frame for time, frame, _ in FRAME_TIMES],
    "floor(time / frame)",
    0.0,
    "every frame",
)

# --- rules that decide by a hair -----------------------------------------------------------------

PARTS = (([0.07, 0.93], 100), ([0.14, 0.86], 50), ([0.29, 0.71], 100), ([0.57, 0.43], 100))


def _captures_exact(share: str, count: int) -> list[int]:
    first = -(-Fraction(share) * count // 1)
    return [int(first), count - int(first)]


def _ceilings() -> list[object]:
    firsts = [int(np.ceil(np.float64(share) * count)) for (share, _), count in PARTS]
    return [[first, count - first] for first, (_, count) in zip(firsts, PARTS, strict=True)]


HEURISTIC = Case(
    "heuristic schedule: ceil(0.07 x 100) captures",
    "0.07 x 100 is 7.000000000000001",
    "exactly, in fractions",
    lambda: [_captures_exact(str(shares[0]), count) for shares, count in PARTS],
    lambda: [comparison_schedules.captures_per_segment(np.array(s), count) for s, count in PARTS],
    _ceilings,
    "ceil(p N)",
    0.0,
    "every capture",
)

TIES = ([0.1, 0.2, 1.0, 0.3, 0.2], [0.4, 0.7, 3.0, 0.8, 0.5], [1.1, 1.3, 9.0, 0.9, 0.7])
"""Counts whose first two and last two bins differ by the same, in decimals."""


def _first_merge(counts: list[float]) -> int:
    _, merges = histogram_binning.merge_bins((np.arange(6.0), counts), 4)
    return merges[0].first


BINNING = Case(
    "histogram binning: merges that are equally good",
    "0.2 - 0.1 and 0.3 - 0.2 differ in the last digit, and decide all that follows",
    "exactly, in decimals",
    lambda: [0] * len(TIES),
    lambda: [_first_merge(counts) for counts in TIES],
    lambda: [np.argmin(np.abs(np.diff(counts))) for counts in TIES],
    "the least |difference|",
    0.0,
    "the first of equal pairs",
    absolute=True,
)

HUGE = [1e308, 1e308, 1e308, 1e308]

NORMALIZED = Case(
    "pdf of counts whose sum overflows",
    "four counts of 1e308 add up to infinity",
    "exactly 1/4 each",
    lambda: [0.25] * 4,
    lambda: Pdf.histogram(np.arange(5.0), HUGE).probability,
    lambda: np.array(HUGE) / np.sum(HUGE),
    "counts / sum(counts)",
    0.0,
    "a property",
)

DOUBLED = Case(
    "exponential schedule of 2000 captures",
    "2^1999 is no float64",
    "exactly min(2^k t1, T)",
    lambda: [min(mp.mpf(2) ** k / 1024, mp.mpf(8)) for k in range(2000)],
    lambda: comparison_schedules.exponential_times(1 / 1024, 8.0, 2000),
    lambda: [min(2.0**k / 1024, 8.0) for k in range(2000)],
    "min(2.0**k t1, T)",
    0.0,
    "powers of 2",
)

# --- several samples of one pixel ----------------------------------------------------------------

SAMPLED = (
    ((1.0, 1 + 2.0**-40, 1 + 2.0**-39, 2.0), 2.0**-20, 2.0**20, 1.0),
    ((2.0**-30, 2.0**-15, 1.0, 1024.0), 2.0**-20, 128.0, 2.0**-10),
    ((1.0, 1.0, 1.0, 2.0), 4.0, 2.0**27, 2.0**-30),
)
"""Times [s], read noise, reset noise [e] and photocurrent [e/s]."""


def _covariance(times, read, reset, rate) -> list[list[mp.mpf]]:
    return [
        [
            rate * min(s, t) + mp.mpf(reset) ** 2 + (mp.mpf(read) ** 2 if j == k else 0)
            for k, t in enumerate(times)
        ]
        for j, s in enumerate(times)
    ]


def _weighted_exact() -> list[mp.mpf]:
    out = []
    for times, read, reset, rate in SAMPLED:
        t = mp.matrix([mp.mpf(time) for time in times])
        inverse = mp.lu_solve(mp.matrix(_covariance(list(t), read, reset, mp.mpf(rate))), t)
        out.append(mp.mpf(rate) ** 2 * (t.T * inverse)[0])
    return out


def _weighted_ours() -> list[float]:
    return [
        weighted_expected_snr(
            Pdf.levels([rate], [1.0]), times, Sensor(well=1e30, read=read, reset=reset)
        )
        for times, read, reset, rate in SAMPLED
    ]


def _weighted_by_matrix() -> list[float]:
    out = []
    for times, read, reset, rate in SAMPLED:
        t = np.array(times)
        noise = rate * np.minimum(t, t[:, None]) + reset**2 + read**2 * np.eye(len(t))
        out.append(rate**2 * (t @ np.linalg.solve(noise, t)))
    return out


WEIGHTED = Case(
    "4.7 SNR of the best weights, samples that coincide",
    "covariances of almost equal rows, conditions up to 1e24",
    "t' C^-1 t",
    _weighted_exact,
    _weighted_ours,
    _weighted_by_matrix,
    "t' C^-1 t with C solved in float64",
    1e-14,
    "one pass over four samples",
)

VARIANCE = Case(
    "variance of a photocurrent from such samples",
    "covariances of almost equal rows, conditions up to 1e24",
    "1 / (t' C^-1 t)",
    lambda: [mp.mpf(s[3]) ** 2 / snr for s, snr in zip(SAMPLED, _weighted_exact(), strict=True)],
    lambda: [
        weighted_variance(rate, times, 0.0, read**2, reset**2)
        for times, read, reset, rate in SAMPLED
    ],
    lambda: [s[3] ** 2 / snr for s, snr in zip(SAMPLED, _weighted_by_matrix(), strict=True)],
    "1 / (t' C^-1 t) with C solved in float64",
    1e-14,
    "one pass over four samples",
)

CASES = (
    EDGE_OF_WELL, FRAMES, HEURISTIC, BINNING, NORMALIZED, DOUBLED, WEIGHTED, VARIANCE,
)  # fmt: skip
