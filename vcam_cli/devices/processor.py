"""The processor as a device: NumPy's arrays, and what they do not share with other libraries.

Code of the hot path takes arrays of either kind: NumPy hands its functions to the library of the
array (NEP 13 and NEP 18), so that an effect is written once. What that does not cover is a
`Device`: new arrays, copies, random numbers, transforms, splines. `Processor` has NumPy's,
`cuda.py` CuPy's. A copy between both is always written out, as `put`, `get` or `fetch`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import DTypeLike

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.devices import counter_noise
from vcam_cli.errors import CannotDo

SPLINES: Final = 5
"""Order of the splines through an image."""
SHARE = 0.8
"""Part of the free memory of a device that batches may take."""


class Processor:
    """The processor of this machine, with NumPy's arrays."""

    name: ClassVar[str] = "cpu"
    whole: ClassVar[bool] = False
    """Whether arrays are computed whole by one thread, and not in pieces for caches and threads."""

    def describe(self) -> str:
        """Return the device and its library, for `run.json`."""
        return f"cpu, NumPy {np.__version__}"

    @property
    def label(self) -> str:
        """Return what records say of results: "cpu", or the device and its library."""
        return self.describe() if self.whole else self.name

    @property
    def key(self) -> str:
        """Return what tells results of this device from those of others; "" of the processor."""
        return f" {self.name}" if self.whole else ""

    def put(self, values: Any, dtype: DTypeLike | None = None) -> Array:
        """Return values of the processor as an array of the device.

        Parameters
        ----------
        values : array_like
            Values, of any shape.
        dtype : dtype, optional
            Type of the array; by default that of the values.
        """
        return np.ascontiguousarray(values, dtype)

    def get(self, array: Array) -> Array:
        """Return an array of the device as one of NumPy."""
        return array

    def fetch(self, array: Array) -> Callable[[], Array]:
        """Begin to copy an array to the processor; return what waits for the copy.

        Meanwhile the device computes, and the array must not be changed.
        """
        return partial(self.get, array)

    def zeros(self, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return an array of zeros on the device."""
        return np.zeros(shape, dtype)

    def free_memory(self) -> int:
        """Return the memory that batches may take [bytes]."""
        return int(SHARE * memory.available())

    def wait(self) -> None:
        """Return when all that was asked of the device is done."""

    def errors(self) -> AbstractContextManager[None]:
        """Return what raises failures of the device as `CannotDo`."""
        return nullcontext()

    def keys(self, seeds: Sequence[int]) -> Array:
        """Return the keys (B,) of seeds, uint64, for the random numbers of frames."""
        return self.put(np.array([counter_noise.seed_key(seed) for seed in seeds], np.uint64))

    def normals(self, keys: Array, name: str, sample: int, count: int, dtype: DTypeLike) -> Array:
        """Return standard normal numbers (B, count) of the words of `counter_noise`.

        Parameters
        ----------
        keys : Array
            Keys (B,) of the frames' seeds.
        name : str
            Name of the stream.
        sample : int
            Index of the sample of an exposure.
        count : int
            Numbers of a frame.
        dtype : dtype
            Floating-point type.
        """
        word = counter_noise.words(keys, name, sample, count)
        return counter_noise.normals(word).astype(dtype, copy=False)

    def uniforms(self, keys: Array, name: str, sample: int, count: int) -> Array:
        """Return numbers (B, count) between 0 and 1, float64; parameters as those of `normals`."""
        return counter_noise.uniforms(counter_noise.words(keys, name, sample, count))

    def poisson(self, keys: Array, name: str, sample: int, mean: Array) -> Array:
        """Return Poisson numbers of means (B, ...); it may reuse their array [electrons]."""
        word = counter_noise.words(keys, name, sample, mean[0].size)
        return counter_noise.poisson(mean, word.reshape(mean.shape))

    def add_normals(self, values: Array, rms: float, keys: Array, name: str, sample: int) -> Array:
        """Return values (B, ...) plus normal numbers of a standard deviation, in their array."""
        z = self.normals(keys, name, sample, values[0].size, values.dtype)
        z *= rms
        values += z.reshape(values.shape)
        return values

    def on_line(
        self,
        values: Array,
        most: float,
        line: tuple[float, float],
        highest: int,
        dtype: DTypeLike | None = None,
    ) -> Array:
        """Return min(values, most) on a line, clipped to 0 and a highest level.

        Parameters
        ----------
        values : Array
            Signal, of any shape [electrons].
        most : float
            Most that counts [electrons].
        line : tuple of float
            Slope [DN/e] and offset [DN].
        highest : int
            Highest level [DN].
        dtype : dtype, optional
            Type of whole codes; by default levels are not rounded.
        """
        kind = values.dtype.type
        level = np.minimum(values, kind(most)) * kind(line[0])
        level += kind(line[1])
        if dtype is not None:
            np.rint(level, out=level)
        found: Array = np.clip(level, 0, highest, out=level)
        return found if dtype is None else found.astype(dtype)

    def dct3(self, values: Array, axis: int, odd: bool, overwrite: bool = False) -> Array:
        """Return the DCT-III along an axis, of sines (`odd`) the DST-III, unnormalized.

        It may reuse the array (`overwrite`).
        """
        transform = scipy.fft.dst if odd else scipy.fft.dct
        found: Array = transform(values, type=3, axis=axis, overwrite_x=overwrite)
        return found

    def fft(self, values: Array, axis: int) -> Array:
        """Return the Fourier transform of complex numbers along an axis, in their array."""
        found: Array = scipy.fft.fft(values, axis=axis, overwrite_x=True)
        return found

    def ifft(self, values: Array, axis: int) -> Array:
        """Return the inverse of `fft`, in the array of the values."""
        found: Array = scipy.fft.ifft(values, axis=axis, overwrite_x=True)
        return found

    def irfft(self, values: Array, count: int) -> Array:
        """Return the sums (rows, count) of real waves whose spectra are (rows, count // 2 + 1)."""
        found: Array = scipy.fft.irfft(values, count, axis=1, norm="forward", overwrite_x=True)
        return found

    def splines(self, values: Array) -> Array:
        """Return the coefficients (rows, columns) of splines through an image that is mirrored."""
        from scipy import ndimage

        found: Array = ndimage.spline_filter(
            values, order=SPLINES, output=values.dtype, mode="mirror"
        )
        return found

    def interpolated(self, coefficients: Array, row: Array, column: Array) -> Array:
        """Return the image of `splines` at rows and columns of one shape, between its samples."""
        from scipy import ndimage

        found: Array = ndimage.map_coordinates(
            coefficients,
            [row, column],
            order=SPLINES,
            prefilter=False,
            mode="mirror",
            output=coefficients.dtype,
        )
        return found

    def stacked(self, pictures: Sequence[Any]) -> Array:
        """Return pictures of one shape as one array (n, ...) of the device."""
        return self.put(np.stack([np.asarray(picture) for picture in pictures]))

    def spectrum(
        self, pictures: Array, mix: Array, shape: tuple[int, int], black: tuple[int, int]
    ) -> Array:
        """Return the DCT-II of mixtures of the channels of pictures, unnormalized.

        Parameters
        ----------
        pictures : Array
            Pictures (n, height, width, channels).
        mix : Array
            Mixtures (R, channels), in the float type of the pictures.
        shape : tuple of int
            Rows and columns of the scene.
        black : tuple of int
            Black samples above and left of the picture.

        Returns
        -------
        Array
            Coefficients (n, R, rows, columns).
        """
        planes = np.zeros((len(pictures), len(mix), *shape), pictures.dtype)
        height, width = pictures.shape[1:3]
        inside = (slice(black[0], black[0] + height), slice(black[1], black[1] + width))
        # Channel by channel: the same sums however many pictures there are.
        for number, weights in enumerate(mix):
            for channel in np.flatnonzero(weights):
                planes[:, number, *inside] += weights[channel] * pictures[..., channel]
        found: Array = scipy.fft.dctn(planes, type=2, axes=(-2, -1), overwrite_x=True)
        return found

    def filtered(self, spectrum: Array, transfer: Array, from_y: Array, from_x: Array) -> Array:
        """Return the terms of every color: coefficients times transfer, summed over mixtures.

        Parameters
        ----------
        spectrum : Array
            Coefficients (n, R, rows, columns).
        transfer : Array
            Factors (R, C, terms along y, terms along x).
        from_y, from_x : Array
            Coefficient behind every term, int32.

        Returns
        -------
        Array
            Terms (n, C, terms along y, terms along x).
        """
        some = spectrum[:, :, from_y][..., from_x]
        total: Array = some[:, 0, None] * transfer[0]
        for plane in range(1, len(transfer)):
            total += some[:, plane, None] * transfer[plane]
        return total

    def evaluated(
        self,
        terms: Array,
        size: tuple[int, int],
        window: tuple[slice, slice],
        color: Array | None,
    ) -> Array:
        """Return the DCT-III of terms at the pixels.

        Parameters
        ----------
        terms : Array
            The first terms (n, C, terms along y, terms along x).
        size : tuple of int
            Length of the transforms along y and x.
        window : tuple of slice
            Rows and columns that are pixels.
        color : Array or None
            Index of the color of every pixel (rows, columns), int32; None for all colors of all.

        Returns
        -------
        Array
            Signal (n, rows, columns), not below 0, or (n, C, rows, columns).
        """
        whole = np.zeros((*terms.shape[:2], *size), terms.dtype)
        whole[..., : terms.shape[2], : terms.shape[3]] = terms
        whole = scipy.fft.dctn(whole, type=3, axes=(-2, -1), overwrite_x=True)[..., *window]
        if color is None:
            return whole
        found: Array = np.take_along_axis(whole, color[None, None], axis=1)[:, 0]
        return np.maximum(found, 0, out=found)


PROCESSOR = Processor()
"""The processor: the device unless another is chosen."""


def require(device: Processor, needed: int, what: str, others: str = "") -> None:
    """Raise CannotDo where a device has too little memory.

    Parameters
    ----------
    device : Processor
        The device.
    needed : int
        Memory that is needed [bytes].
    what : str
        What needs it, as a message begins.
    others : str, optional
        What helps beside fewer pixels, as in a list: "smaller batches, ".

    Raises
    ------
    CannotDo
        Where it does not fit.
    """
    free = device.free_memory()
    if needed > free:
        raise CannotDo(
            f"{what} need about {needed / 1e9:.3g} GB of the device's memory; {free / 1e9:.3g} GB"
            f" ({100 * SHARE:g} % of what is free) may be used",
            f"use {others}fewer pixels (array), or --device cpu",
        )
