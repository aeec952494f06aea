"""How far up the spectrum goes: as far as the tolerance asks, no further than the lens.

Pixels fold every frequency that reaches them into the picture; leaving out those above
`oversampling` pixel Nyquist frequencies loses detail that would have been folded. By Parseval's
theorem the rms of what is lost is known from the spectrum itself. A picture's spectrum goes on
for ever and is at hand; a chart's ends with its sampling, and the part beyond is extrapolated from
the top octave: the power of edges halves from octave to octave, times what the lens lets through.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.geometry import Geometry
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import Tables

SHARE = 0.1
"""Part of the tolerance that the truncation of the spectrum may use up.

Why no more: at standard accuracy every camera is to be within 0.1 % of full signal with all effects
on, and there are other errors. And what is lost of a painted chart is a guess: where all edges lie
along the rows and columns of a few dozen pixels it was found up to eleven times too low, for they
do not add up at random.
"""
AT_HAND, MOST = 0.5, 8e-4
"""The same of a spectrum that is at hand, of which it is known what is lost; and the part of full
signal that it is at most, unless `SHARE` is more. Of full signal as it is behind the lens: of
sparse points that is much less than they were before it."""
KNOWN = 64.0
"""Pixel Nyquist frequencies up to which the spectrum of a chart of rectangles is looked at."""
LOOKED = 1 << 14
"""Terms along x that are looked at for little, where the spectrum costs nothing else."""
FREE_SAMPLES = 1 << 22
"""Samples of a plane that cost little beside the rest of a run."""
CHEAP_SAMPLES = 1 << 24
"""Samples of a plane that any tolerance may take when it needs them."""
MOST_SAMPLES = 1 << 26
"""Samples of one plane beyond which a chart is not sampled more finely."""
AHEAD = 1.05
"""How much finer than its error asks for a chart is sampled next."""


@dataclass(frozen=True)
class Spread:
    """What the signal's spectrum holds: frequencies and the mean squares they add."""

    frequency: NDArray
    """(n,) larger of |fx| and |fy|, in pixel Nyquist frequencies, rising."""
    power: NDArray
    """(C, n) mean square of the signal [(electrons / s) squared]"""

    def beyond(self, frequency: float) -> float:
        """Rms that all higher frequencies add, in the color where it is most [electrons / s]."""
        first = int(np.searchsorted(self.frequency, frequency, side="right"))
        return math.sqrt(float(self.power[:, first:].sum(axis=1).max(initial=0.0)))

    def of_sampling(
        self, highest: float, cutoff: float, passes: Callable[[NDArray], NDArray]
    ) -> float:
        """Rms error of a chart sampled up to `highest`, as its spectrum foretells.

        cutoff: of the lens; passes: transfer of lens and pixel at frequencies (n,), all in pixel
        Nyquist frequencies. For edges, whose amplitude falls as 1/f, there are two parts
        [electrons / s]:
        - beyond f_N = highest: each octave has half the power of the last, all of them together
          at most as much as the top one here, passed as its double is;
        - folded: cell means take 2 f_N - f for f, weakened by f / (2 f_N - f). With v half of
          2 f_N - f, in the top octave, that is half its power times ((f_N - v) / v)^2, passed as
          f. Where v is beyond the cut-off its power is not seen: then from that at f itself,
          (f / (2 f_N - f))^4 of it.
        """
        first = int(np.searchsorted(self.frequency, highest / 2, side="right"))
        v = self.frequency[first:]
        here = passes(v)
        beyond = passes(2 * v) ** 2
        folded = passes(np.maximum(2 * highest - 2 * v, 0)) ** 2 * 0.5 * (highest / v - 1) ** 2
        # Where the lens lets nothing through, nothing is known: at most a thousandfold.
        share = (beyond + folded) / np.maximum(here, 1e-3) ** 2
        seen = (self.power[:, first:] * share * (v < cutoff)).sum(axis=1)
        f = self.frequency
        unseen = (f < 2 * (highest - cutoff)) & (f < highest)
        guess = np.where(unseen, (f / np.maximum(2 * highest - f, highest)) ** 4, 0.0)
        return math.sqrt(float((seen + (self.power * guess).sum(axis=1)).max(initial=0.0)))

    def enough(self, budget: float) -> float:
        """Lowest frequency beyond which an rms of at most `budget` is left."""
        tail = np.cumsum(self.power[:, ::-1], axis=1)[:, ::-1].max(axis=0)
        kept = np.flatnonzero(tail > budget**2)
        return float(self.frequency[kept[-1]]) if len(kept) else 0.0


def at_hand(tolerance: float) -> float:
    """Part of full signal that may be lost of a spectrum that is at hand."""
    return max(SHARE * tolerance, min(AT_HAND * tolerance, MOST))


def first_guess(geometry: Geometry, knobs: Settings) -> int:
    """Oversampling to begin with: more where the array is small and it costs nothing."""
    pixels = geometry.rows * geometry.columns
    free = round(math.sqrt(FREE_SAMPLES / pixels))
    return max(knobs.oversampling, min(free, 4, knobs.most_oversampling))


def least(knobs: Settings) -> int:
    """Lowest frequency at which a spectrum at hand may end; above it the tolerance decides."""
    return knobs.oversampling if _is_users(knobs) else 1


def _is_users(knobs: Settings) -> bool:
    """Whether the user has said how far a spectrum is followed."""
    return knobs.most_oversampling <= knobs.oversampling


def most(pixels: float, knobs: Settings) -> int:
    """Highest oversampling to be tried: what the settings say, and more on a small array.

    pixels: of the scene, with the margin that a chart has.
    """
    if _is_users(knobs):
        return knobs.most_oversampling
    cheap = int(math.sqrt(CHEAP_SAMPLES / pixels))
    return max(knobs.most_oversampling, min(cheap, 64))


def limit(geometry: Geometry, cutoff: float) -> float:
    """Oversampling at which the lens's cut-off [cycles/m] is reached along both axes."""
    return cutoff * 2 * max(geometry.pitch_x, geometry.pitch_y)


def top(geometry: Geometry, oversampling: float, cutoff: float) -> float:
    """Highest |f| of a spectrum cut at `oversampling` [cycles/m]."""
    corner = math.hypot(0.5 / geometry.pitch_x, 0.5 / geometry.pitch_y)
    return min(cutoff, oversampling * corner)


def finer(now: int, lost: float, budget: float, pixels: float, knobs: Settings) -> int:
    """Oversampling a chart needs when `now` loses `lost`; `now` itself where it will do.

    What is lost of edges falls with the square of the oversampling: with more than the power 3/2
    of what is beyond the sampling, since the lens lets less and less of that through. A twentieth
    on top saves most second tries.
    """
    if lost <= budget:
        return now
    affordable = max(now, int(math.sqrt(MOST_SAMPLES / pixels)))
    needed = most(pixels, knobs)
    if budget > 0:
        needed = min(needed, math.ceil(AHEAD * now * math.sqrt(lost / budget)))
    return max(now, min(max(needed, now + 1), most(pixels, knobs), affordable))


def brightest(planes: NDArray, tables: Tables) -> float:
    """Bound on the signal of the brightest sample of a scene [electrons / s]."""
    level = np.abs(tables.values[:, :, 0])
    most = np.array([max(float(plane.max()), -float(plane.min())) for plane in planes])
    return float((level.T @ most).max())


def peak(planes: NDArray, tables: Tables) -> float:
    """Largest signal of samples (R, ny, nx) of a scene before blur [electrons / s]."""
    samples = planes.reshape(len(planes), -1).astype(np.float64)
    return float((tables.values[:, :, 0].T @ samples).max())
