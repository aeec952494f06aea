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

A filter whose kernel is not even turns cosines into sines of the same frequencies; they have their
own folding and transform (`odd=True`).

Evaluation: where S is a whole number of pixel pitches, terms that the pixels cannot tell apart
are folded onto each other and one DCT-III does it. Photodetectors off their pixels' centers see the
cosines turned: each is some of the pixels' own cosine and some of the sine, folded by themselves
(`pixel_waves`). Where S is no whole number of pixels, or far more than there are terms and pixels,
it is a chirp-z transform, four times slower, which takes as much memory as there are terms. Where
every row of pixels is displaced by its own distance, cosines and sines are one complex wave, which
is turned in each row: its real part is one transform of real numbers, of twice the length.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache, reduce

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import PROCESSOR, Processor
from vcam_cli.records import dataclass

NEAR = 1e-7
"""Distances below this are rounding errors [pixel pitches]."""
CHIRP = 4
"""Cost of a chirp-z transform over that of a cosine transform of its length."""
BLOCK = 64
"""Terms whose turns are products of few: of one within a block, and of one for each block."""


@dataclass(frozen=True, eq=False)
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
    row_shifts: Array | None = None
    """Displacement of the photodetectors of every row (rows,), where it is not the same [m]."""
    device: Processor = PROCESSOR
    """Where the arrays of terms lie that are folded and evaluated."""

    @property
    def length(self) -> float:
        """Length of the scene along the axis [m]."""
        return self.samples * self.sample_pitch

    @cached_property
    def terms(self) -> int:
        """Number of cosine terms kept, the constant included."""
        most = int(self.bandwidth * 2 * self.length * (1 + 1e-12)) + 1
        return max(1, most if self.squares else min(most, self.samples))

    @cached_property
    def frequencies(self) -> Array:
        """Frequency of every term, (terms,) [cycles/m]."""
        return np.arange(self.terms) / (2 * self.length)

    @cached_property
    def weights(self) -> Array:
        """Factors (terms,) that turn a DCT-II coefficient into a DCT-III one."""
        box = np.sinc(np.arange(self.terms) / (2 * self.samples))
        return (box if self.squares else 1 / box) / (2 * self.samples)

    @cached_property
    def virtual_pixels(self) -> int | None:
        """Whole number of pixels in the scene's length, where folding is exact; else None."""
        count = self._whole_pixels
        if count is None or self.row_shifts is not None:
            return None  # what one row cannot tell apart, another can
        return count if 0 <= round(self._start) <= count - self.pixels else None

    @cached_property
    def _whole_pixels(self) -> int | None:
        """Whole number of pixels in the scene's length, or None.

        It is None as well where so few of them are pixels that a chirp-z transform costs less.
        """
        count = round(self.length / self.pixel_pitch)
        whole = abs(self.length / self.pixel_pitch - count) <= NEAR
        return count if whole and count <= CHIRP * (self.terms + self.pixels) else None

    @property
    def _start(self) -> float:
        """Pixels before the first one, as its photodetector's center has it."""
        return self.first / self.pixel_pitch - 0.5

    @cached_property
    def shift(self) -> float:
        """Distance of photodetectors from the virtual pixels' centers [pixel pitches].

        It is 0 where there are no virtual pixels: what is evaluated is the photodetectors' place
        then.
        """
        shift = self._start - round(self._start)
        return 0.0 if self.virtual_pixels is None or abs(shift) <= NEAR else shift

    def pixel_waves(self, odd: bool = False) -> list[tuple[bool, Array | None]]:
        """Return the expansion of the scene's waves in the pixels' own waves.

        cos(a + b) = cos a cos b - sin a sin b, sin(a + b) = sin a cos b + cos a sin b.

        Parameters
        ----------
        odd : bool, optional
            Whether the scene's waves are sines.

        Returns
        -------
        list of tuple
            Whether the pixels' waves are sines, and how much of them is in every term (terms,);
            None for all.
        """
        if not self.shift:
            return [(odd, None)]
        angle = 2 * np.pi * self.frequencies * (self.shift * self.pixel_pitch)
        sine = np.sin(angle)
        return [(odd, np.cos(angle)), (not odd, sine if odd else -sine)]

    @property
    def folded_terms(self) -> int:
        """Number of values along this axis after folding: what `evaluate` takes."""
        return self.virtual_pixels or self.terms

    def coefficient_index(self, terms: Array) -> tuple[Array, Array]:
        """Return the DCT-II coefficient behind every cosine term.

        Parameters
        ----------
        terms : Array
            Indices (n,) of terms.

        Returns
        -------
        index : Array
            Indices (n,) of coefficients.
        sign : Array
            Signs (n,) of the coefficients, 0 for none.
        """
        period = 2 * self.samples
        rest = terms % period
        sign = np.where(terms // period % 2 == 0, 1, -1)
        sign = np.where(rest > self.samples, -sign, sign) * (rest != self.samples)
        index = np.where(rest > self.samples, period - rest, rest)
        return np.minimum(index, self.samples - 1), sign

    def extend(self, coefficients: Array, terms: int) -> Array:
        """Return DCT-II coefficients continued to more cosine terms.

        Parameters
        ----------
        coefficients : Array
            Coefficients (..., samples).
        terms : int
            Number of terms.

        Returns
        -------
        Array
            Coefficients (..., terms), which may be a view.
        """
        if terms <= coefficients.shape[-1]:
            return coefficients[..., :terms]
        out = np.empty_like(coefficients, shape=(*coefficients.shape[:-1], terms))
        for source, target, sign in segments(self.samples, terms):
            np.multiply(coefficients[..., source], sign, out=out[..., target])
        out[..., self.samples :: 2 * self.samples] = 0
        return out

    def folding(self, folded: slice, odd: bool = False) -> list[tuple[slice, Array, Array]]:
        """Return where a piece of the folded axis comes from.

        Parameters
        ----------
        folded : slice
            Piece of the folded axis.
        odd : bool, optional
            Whether the waves are sines.

        Returns
        -------
        list of tuple
            Part of the piece, the terms (n,) that are added to it, and their weights (n,).
        """
        if self.virtual_pixels is None:
            terms = np.arange(folded.start, folded.stop)
            return [(folded, terms, np.ones(len(terms)))]
        out = []
        period = self.virtual_pixels
        # The period's own terms: cosines 0 .. period - 1, sines 1 .. period.
        own = np.arange(folded.start, folded.stop) + odd
        alone = period if odd else 0
        for m in range(-(-self.terms // period)):
            terms = m * period + own if m % 2 == 0 else (m + 1) * period - own
            inside = (terms < self.terms) & ((own != alone) | ((m % 2 == 0) != odd))
            if inside.any():
                terms = terms[inside]
                # The transforms count one term once and every other twice.
                twice = (own[inside] == alone) & (terms > 0)
                weights = _sign(m, odd) * np.where(twice, 2.0, 1.0)
                at = np.flatnonzero(inside) + folded.start
                out.append((slice(int(at[0]), int(at[-1]) + 1), terms, weights))
        return out

    def fold(self, terms: Array, odd: bool = False, overwrite: bool = False) -> Array:
        """Fold terms onto the pixels' own cosines, or sines.

        Parameters
        ----------
        terms : Array
            Terms (..., n).
        odd : bool, optional
            Whether they are sines.
        overwrite : bool, optional
            Whether it may be done in the array of the terms.

        Returns
        -------
        Array
            Folded terms (..., folded_terms).
        """
        n = terms.shape[-1]
        if self.virtual_pixels is None:
            out = self.device.zeros((*terms.shape[:-1], self.terms), terms.dtype)
            out[..., :n] = terms
            return out
        parts, constant = segments(self.virtual_pixels, n, odd), terms[..., 0].copy()
        if overwrite and not odd and n >= self.virtual_pixels:
            out = terms[..., : self.virtual_pixels]  # the first part is where it belongs
            parts = parts[1:]
        else:
            out = self.device.zeros((*terms.shape[:-1], self.virtual_pixels), terms.dtype)
        for target, source, sign in parts:
            if sign > 0:
                out[..., target] += terms[..., source]
            else:
                out[..., target] -= terms[..., source]
        # A DCT-III counts its constant once and every other term twice, a DST-III its last term.
        if odd:
            out[..., -1] *= 2
        else:
            out[..., 0] += out[..., 0] - constant
        return out

    @property
    def window(self) -> slice | None:
        """The virtual pixels that are pixels; None where there are none."""
        if self.virtual_pixels is None:
            return None
        start = round(self._start)
        return slice(start, start + self.pixels)

    @property
    def transform(self) -> int:
        """Length of the transform that `evaluate` does."""
        if self.virtual_pixels is not None:
            return self.virtual_pixels
        return int(scipy.fft.next_fast_len(self.terms + self.pixels - 1))

    def evaluate(
        self, values: Array, axis: int, odd: bool = False, overwrite: bool = False
    ) -> Array:
        """Evaluate folded terms at the photodetectors.

        Each of their `pixel_waves` is evaluated by itself; the sum is the signal.

        Parameters
        ----------
        values : Array
            Folded terms of two dimensions.
        axis : int
            The axis of `values` to be evaluated, 0 or 1.
        odd : bool, optional
            Whether they are sines.
        overwrite : bool, optional
            Whether the result may be a view of `values`.

        Returns
        -------
        Array
            Values at the photodetectors in place of the terms.
        """
        if self.window is None:
            return self._chirp(values, axis, odd)
        full = self.device.dct3(values, axis, odd, overwrite)
        return full[self.window] if axis == 0 else full[:, self.window]

    def evaluate_rows(self, waves: Mapping[bool, Array], shifts: Array) -> Array:
        """Evaluate terms at photodetectors that are displaced along the axis, by row.

        A cosine and a sine are the real part of one complex wave, which a displacement turns.

        Parameters
        ----------
        waves : mapping
            Cosines (False) and sines (True), or one of them: (rows, terms).
        shifts : Array
            Displacement of the photodetectors of every row (rows,) [m].

        Returns
        -------
        Array
            Values at the photodetectors (rows, pixels).
        """
        count = self._whole_pixels
        first = 0.0 if count is None else self.first
        angle = (np.pi / self.length) * np.asarray(first + shifts)
        kind = np.result_type(next(iter(waves.values())).dtype, np.complex64)
        fine, coarse = (
            self.device.put(np.exp(1j * np.outer(angle, k)), kind)
            for k in (np.arange(BLOCK), np.arange(0, self.terms, BLOCK))
        )
        turns = (coarse[:, :, None] * fine[:, None]).reshape(len(shifts), -1)[:, : self.terms]
        parts = [turns * (-1j * wave if odd else wave) for odd, wave in waves.items()]
        turned: Array = reduce(np.add, parts)
        if count is None:
            return self._chirp(turned, axis=1, odd=False)
        # Waves beyond the pixels' Nyquist frequency fold onto the conjugate of others.
        turned[:, 0] /= 2
        half = self.device.zeros((len(turned), count + 1), turned.dtype)
        for number, start in enumerate(range(0, self.terms, count)):
            part = turned[:, start : start + count]
            if number % 2 == 0:
                half[:, : part.shape[1]] += part
            else:
                half[:, count : count - part.shape[1] : -1] += np.conjugate(part)
        half[:, ::count] *= 2  # these two count once, all others twice
        return self.device.irfft(half, 2 * count)[:, : self.pixels]

    @cached_property
    def _chirp_parts(self) -> tuple[int, Array, Array, Array]:
        """Transform length, chirp on the terms, kernel spectrum, chirp on the pixels."""
        k, i = np.arange(self.terms), np.arange(self.pixels)
        size = self.transform
        half = np.pi * self.pixel_pitch / self.length / 2
        before = np.exp(1j * (np.pi * k * (self.first / self.length) + half * k.astype(float) ** 2))
        before[0] *= 0.5
        lag = np.arange(size)
        lag = np.where(lag < self.pixels, lag, lag - size).astype(float)
        kernel = np.where(lag > -self.terms, np.exp(-1j * half * lag**2), 0)
        after = 2 * np.exp(1j * half * i.astype(float) ** 2)
        return size, before, scipy.fft.fft(kernel), after

    def _chirp(self, values: Array, axis: int, odd: bool) -> Array:
        """Evaluate a sum of exponentials by Bluestein's algorithm: its real or imaginary part."""
        size, before, kernel, after = self._chirp_parts
        kind = np.result_type(values.dtype, np.complex64)
        shape = (-1, 1) if axis == 0 else (1, -1)
        count, padded = values.shape[axis], list(values.shape)
        padded[axis] = size
        work = self.device.zeros(tuple(padded), kind)
        before, kernel, after = (
            self.device.put(part, kind).reshape(shape) for part in (before, kernel, after)
        )
        inside = work[:count] if axis == 0 else work[:, :count]
        np.multiply(values, before, out=inside)
        work = self.device.fft(work, axis)
        work *= kernel
        work = self.device.ifft(work, axis)
        work = work[: self.pixels] if axis == 0 else work[:, : self.pixels]
        work *= after
        return work.imag if odd else work.real


def _sign(segment: int, odd: bool = False) -> int:
    """Return the sign of segment m, terms m L to (m + 1) L.

    Cosines have + - - + + - -, sines + + - - + + ...
    """
    return 1 if (segment + (not odd)) // 2 % 2 == 0 else -1


@lru_cache(1 << 10)
def segments(period: int, terms: int, odd: bool = False) -> tuple[tuple[slice, slice, int], ...]:
    """Return how cosine terms, or sine terms, fold onto a basis of few samples.

    cos(pi k (i + 1/2) / L) repeats with k: k = 2L - j gives minus the cosine of j, k = 2L + j
    likewise minus it, k = L vanishes. Of sines, whose basis is 1..L, k = 2L - j gives the sine of
    j, k = 2L + j minus it, and k = 0 and 2L vanish.

    Parameters
    ----------
    period : int
        Number of samples L of the basis.
    terms : int
        Number of terms, from 0 on.
    odd : bool, optional
        Whether they are sines.

    Returns
    -------
    tuple of tuple
        Slice of the basis, slice of the terms, and sign. Basis slices run backwards in odd
        segments, terms always forward.
    """
    out = []
    for m in range(-(-terms // period)):
        # The segment's first term vanishes: of cosines in odd segments, of sines in even ones.
        skipped = int((m % 2 == 1) != odd)
        n = min(period - skipped, terms - m * period - skipped)
        if n <= 0:
            continue
        first = m * period + skipped
        if m % 2 == 0:
            basis = slice(0, n)
        else:
            stop = period - 1 - n
            basis = slice(period - 1, stop if stop >= 0 else None, -1)
        out.append((basis, slice(first, first + n), _sign(m, odd)))
    return tuple(out)
