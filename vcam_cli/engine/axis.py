"""One axis of the image: scene samples on one side, pixel positions on the other, cosines between.

A scene of N samples of pitch D, mirrored at its borders, is a cosine series over S = N D,
    g(x) = a_0 + sum_k a_k cos(pi k x / S),   frequency of term k = k / (2 S),
whose coefficients come from one DCT-II of the samples, whatever the pixel pitch is. A filter with
an even kernel multiplies a_k, and the series is then evaluated at the pixels' centers:
exactly for any ratio of the pitches.

What lies between the samples:
- 'squares' (a picture): every sample is a uniform square of light. The series goes on beyond
  k = N: the coefficients repeat with alternating sign, times sinc(k / 2N).
- 'averages' (a chart): samples are means over cells of a continuous scene. The series ends at
  k = N, and dividing by sinc(k / 2N) undoes the mean.

Evaluation: where S is a whole number of pixel pitches, terms that the pixels cannot tell apart
are folded onto each other and one DCT-III does it. Anywhere else (a crop that is no whole number
of pixels, a photodetector off its pixel's center) it is a chirp-z transform, four times slower.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray


@dataclass(frozen=True)
class Axis:
    """Samples, pixels and cosine terms along x or y."""

    samples: int
    sample_pitch: float
    """[m]"""
    pixels: int
    pixel_pitch: float
    """[m]"""
    first: float
    """Position of the first photodetector's center, from the scene's edge [m]."""
    squares: bool
    bandwidth: float
    """Highest spatial frequency kept [cycles/m]."""

    @property
    def length(self) -> float:
        return self.samples * self.sample_pitch

    @cached_property
    def terms(self) -> int:
        """Number of cosine terms kept, the constant included."""
        most = int(self.bandwidth * 2 * self.length * (1 + 1e-12)) + 1
        return max(1, most if self.squares else min(most, self.samples))

    @cached_property
    def frequencies(self) -> NDArray:
        """Frequency of every term, (terms,) [cycles/m]."""
        return np.arange(self.terms) / (2 * self.length)

    @cached_property
    def weights(self) -> NDArray:
        """What turns a DCT-II coefficient into a DCT-III one for every term, (terms,)."""
        box = np.sinc(np.arange(self.terms) / (2 * self.samples))
        return (box if self.squares else 1 / box) / (2 * self.samples)

    @cached_property
    def virtual_pixels(self) -> int | None:
        """Whole number of pixels in the scene's length, where folding is exact; else None."""
        count = self.length / self.pixel_pitch
        start = self.first / self.pixel_pitch - 0.5
        near = 1e-7
        if abs(count - round(count)) > near or abs(start - round(start)) > near:
            return None
        return round(count)

    @property
    def folded(self) -> int:
        """Number of values along this axis after folding: what `evaluate` takes."""
        return self.virtual_pixels or self.terms

    def base(self, terms: NDArray) -> tuple[NDArray, NDArray]:
        """DCT-II coefficient behind every cosine term: its index, and its sign (0 for none)."""
        period = 2 * self.samples
        rest = terms % period
        sign = np.where(terms // period % 2 == 0, 1, -1)
        sign = np.where(rest > self.samples, -sign, sign) * (rest != self.samples)
        index = np.where(rest > self.samples, period - rest, rest)
        return np.minimum(index, self.samples - 1), sign

    def extend(self, coefficients: NDArray, terms: int) -> NDArray:
        """DCT-II coefficients (..., samples) continued to `terms` cosine terms."""
        if terms <= self.samples:
            return coefficients[..., :terms]
        out = np.empty((*coefficients.shape[:-1], terms), coefficients.dtype)
        for source, target, sign in segments(self.samples, terms):
            np.multiply(coefficients[..., source], sign, out=out[..., target])
        out[..., self.samples :: 2 * self.samples] = 0
        return out

    def sources(self, folded: slice) -> list[tuple[slice, NDArray, NDArray]]:
        """Where a piece of the folded axis comes from: (its part, cosine terms, weights)."""
        if self.virtual_pixels is None:
            terms = np.arange(folded.start, folded.stop)
            return [(folded, terms, np.ones(len(terms)))]
        out = []
        period = self.virtual_pixels
        for m in range(-(-self.terms // period)):
            targets = np.arange(folded.start, folded.stop)
            terms = m * period + targets if m % 2 == 0 else (m + 1) * period - targets
            inside = (terms < self.terms) & ((m % 2 == 0) | (targets > 0))
            if inside.any():
                targets, terms = targets[inside], terms[inside]
                # A DCT-III counts its constant once and every other term twice.
                weights = _sign(m) * np.where((targets == 0) & (terms > 0), 2.0, 1.0)
                out.append((slice(int(targets[0]), int(targets[-1]) + 1), terms, weights))
        return out

    def fold(self, terms: NDArray) -> NDArray:
        """Terms (..., n) folded onto the pixels' own cosines: (..., folded)."""
        n = terms.shape[-1]
        if self.virtual_pixels is None:
            out = np.zeros((*terms.shape[:-1], self.terms), terms.dtype)
            out[..., :n] = terms
            return out
        out = np.zeros((*terms.shape[:-1], self.virtual_pixels), terms.dtype)
        for target, source, sign in segments(self.virtual_pixels, n):
            if sign > 0:
                out[..., target] += terms[..., source]
            else:
                out[..., target] -= terms[..., source]
        # A DCT-III counts its constant once and every other term twice.
        out[..., 0] += out[..., 0] - terms[..., 0]
        return out

    def evaluate(self, values: NDArray, axis: int) -> NDArray:
        """Folded values -> values at the photodetectors along `axis` (0 or 1 of two)."""
        if self.virtual_pixels is None:
            return self._chirp(values, axis)
        full = scipy.fft.dct(values, type=3, axis=axis, overwrite_x=True)
        start = round(self.first / self.pixel_pitch - 0.5)
        window = slice(start, start + self.pixels)
        return full[window] if axis == 0 else full[:, window]

    @cached_property
    def _chirp_parts(self) -> tuple[int, NDArray, NDArray, NDArray]:
        """Transform length, chirp on the terms, kernel spectrum, chirp on the pixels."""
        k, i = np.arange(self.terms), np.arange(self.pixels)
        size = scipy.fft.next_fast_len(self.terms + self.pixels - 1)
        half = np.pi * self.pixel_pitch / self.length / 2
        before = np.exp(1j * (np.pi * k * (self.first / self.length) + half * k.astype(float) ** 2))
        before[0] *= 0.5
        lag = np.arange(size)
        lag = np.where(lag < self.pixels, lag, lag - size).astype(float)
        kernel = np.where(lag > -self.terms, np.exp(-1j * half * lag**2), 0)
        after = 2 * np.exp(1j * half * i.astype(float) ** 2)
        return size, before, scipy.fft.fft(kernel), after

    def _chirp(self, values: NDArray, axis: int) -> NDArray:
        """Bluestein's algorithm, for the real part of a sum of exponentials."""
        size, before, kernel, after = self._chirp_parts
        kind = np.complex64 if values.dtype == np.float32 else np.complex128
        shape = (-1, 1) if axis == 0 else (1, -1)
        work: NDArray = values * np.asarray(before, kind).reshape(shape)
        work = scipy.fft.fft(work, size, axis=axis)
        work *= kernel.astype(kind).reshape(shape)
        work = scipy.fft.ifft(work, axis=axis, overwrite_x=True)
        work = work[: self.pixels] if axis == 0 else work[:, : self.pixels]
        return (work * after.astype(kind).reshape(shape)).real


def _sign(segment: int) -> int:
    """Sign of the cosines of segment m, terms m L to (m + 1) L: + - - + + - - ..."""
    return 1 if (segment + 1) // 2 % 2 == 0 else -1


def segments(period: int, terms: int) -> list[tuple[slice, slice, int]]:
    """How cosine terms 0..terms-1 fold onto a basis of `period` samples.

    cos(pi k (i + 1/2) / L) repeats with k: k = 2L - j gives minus the cosine of j, k = 2L + j
    likewise minus it, k = L vanishes. Returns (slice of the basis, slice of the terms, sign);
    basis slices run backwards in odd segments, terms always forward.
    """
    out = []
    for m in range(-(-terms // period)):
        sign = _sign(m)
        if m % 2 == 0:
            n = min(period, terms - m * period)
            out.append((slice(0, n), slice(m * period, m * period + n), sign))
        else:
            n = min(period - 1, terms - m * period - 1)
            if n > 0:
                first = m * period + 1
                stop = period - 1 - n
                backwards = slice(period - 1, stop if stop >= 0 else None, -1)
                out.append((backwards, slice(first, first + n), sign))
    return out
