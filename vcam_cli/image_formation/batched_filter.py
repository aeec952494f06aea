"""A filter as one factor a coefficient, for many pictures of a size on one device.

`Filter.apply` computes transfer functions as it goes, which suits one picture. Where many follow,
they are computed once: terms that neither samples nor pixels distinguish are summed first.
With S samples and V pixels along an axis these are the terms up to the least common multiple of
both; so a picture of as many samples as pixels has one factor a sample, mixture and color.
"""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.image_formation.cosine_series import Axis, segments
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.records import dataclass


def _distinguished(axis: Axis) -> int:
    """Return the number of terms along an axis that samples and pixels distinguish."""
    assert axis.virtual_pixels is not None
    return math.lcm(axis.samples, axis.virtual_pixels)


def _sources(axis: Axis) -> Array:
    """Return the coefficient behind each distinguished term, int32."""
    count = min(axis.terms, _distinguished(axis))
    index, _ = axis.coefficient_index(np.arange(count))
    return index.astype(np.int32)


def _fold_weights(axis: Axis) -> Array:
    """Return the factor on every term (terms,) by the fold onto the pixels' own, with its sign."""
    assert axis.virtual_pixels is not None
    weights = np.zeros(axis.terms)
    for _, terms, factors in axis.folding(slice(0, axis.virtual_pixels)):
        weights[terms] = factors
    return weights


def _transfer(image_filter: Filter, dtype: type) -> Array:
    """Return the factors of all distinguished terms, (R, C, along y, along x).

    Terms of the same coefficient and the same wave at the pixels are summed; where one of both
    vanishes a term counts nothing.
    """
    x, y = image_filter.x, image_filter.y
    counts = tuple(min(axis.terms, _distinguished(axis)) for axis in (y, x))
    out: Array = np.zeros((*image_filter.tables.shape, *counts), dtype)
    weights, period_x, period_y = _fold_weights(x), _distinguished(x), _distinguished(y)
    for mixture, color, terms, factors in image_filter.factors():
        width = factors.shape[-1]
        factors *= weights[:width]
        merged = factors[..., :period_x]
        if width > period_x:
            merged = np.zeros((*factors.shape[:-1], period_x))
            for target, source, _ in segments(period_x, width):
                merged[..., target] += factors[..., source]
        rest = terms % (2 * period_y)
        rows = np.minimum(rest, 2 * period_y - rest)
        kept = rows < period_y
        of_color = out[mixture, color]
        of_color[..., rows[kept], : merged.shape[-1]] += merged[..., kept, :]
    return out


@dataclass(frozen=True)
class BatchedFilter:
    """A filter of pictures of one size, on a device."""

    device: Processor
    mix: Array
    """(R, K) mixtures of the pictures' channels, without unit."""
    transfer: Array
    """(R, C, terms along y, terms along x) [e/s]."""
    sources: tuple[Array, Array]
    """Coefficient behind every term along y and x, int32."""
    shape: tuple[int, int]
    """Rows and columns of samples."""
    size: tuple[int, int]
    """Virtual pixels along y and x."""
    window: tuple[slice, slice]
    """Those of them that are pixels."""
    color: Array | None
    """Index of the color of every pixel (rows, columns), int32; None for all of every pixel."""

    @classmethod
    def of(
        cls, image_filter: Filter, color: Array | None, dtype: type, device: Processor
    ) -> BatchedFilter:
        """Return the filter on a device.

        Parameters
        ----------
        image_filter : Filter
            A filter that `is_even`.
        color : Array or None
            Index of the color of every pixel (rows, columns); None for all of every pixel.
        dtype : type
            Floating-point type.
        device : Processor
            Where it acts.
        """
        x, y = image_filter.x, image_filter.y
        assert x.virtual_pixels and y.virtual_pixels and x.window and y.window
        return cls(
            device=device,
            mix=device.put(image_filter.tables.mix, dtype),
            transfer=device.put(_transfer(image_filter, dtype)),
            sources=(device.put(_sources(y)), device.put(_sources(x))),
            shape=(y.samples, x.samples),
            size=(y.virtual_pixels, x.virtual_pixels),
            window=(y.window, x.window),
            color=None if color is None else device.put(color, np.int32),
        )

    def apply(self, pictures: Array, black: tuple[int, int]) -> Array:
        """Return the light at the photodetectors.

        Parameters
        ----------
        pictures : Array
            Pictures (n, height, width, channels) in linear light, on the device.
        black : tuple of int
            Black samples above and left of each.

        Returns
        -------
        Array
            Rates (n, rows, columns), not below 0, or (n, C, rows, columns) [e/s].
        """
        spectrum = self.device.spectrum(pictures, self.mix, self.shape, black)
        terms = self.device.filtered(spectrum, self.transfer, *self.sources)
        return self.device.evaluated(self._folded(terms), self.size, self.window, self.color)

    def _folded(self, terms: Array) -> Array:
        """Return terms on the pixels' own ones: factors have their signs already."""
        for axis, size in ((-2, self.size[0]), (-1, self.size[1])):
            count = terms.shape[axis]
            if count <= size:
                continue
            shape = list(terms.shape)
            shape[axis] = size
            out = self.device.zeros(tuple(shape), terms.dtype)
            for target, source, _ in segments(size, count):
                if axis == -1:
                    out[..., target] += terms[..., source]
                else:
                    out[..., target, :] += terms[..., source, :]
            terms = out
        return terms

    def bytes_per_picture(self, channels: int) -> int:
        """Return the memory that one picture takes meanwhile [bytes]."""
        mixtures, colors, *terms = self.transfer.shape
        samples, pixels = math.prod(self.shape), math.prod(self.size)
        values = samples * (channels + 3 * mixtures) + colors * (math.prod(terms) + 4 * pixels)
        return int(values * self.transfer.dtype.itemsize)
