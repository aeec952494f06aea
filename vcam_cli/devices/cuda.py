"""A graphics processor of NVIDIA as a device: CuPy's arrays, and the kernels of `kernels.cu`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import DTypeLike

from vcam_cli.arrays import Array
from vcam_cli.devices import counter_noise
from vcam_cli.devices.processor import SHARE, SPLINES, Processor
from vcam_cli.errors import CannotDo

THREADS, MOST_BLOCKS = 256, 1 << 16
"""Threads of a block, and blocks of a kernel: a thread goes on with further elements."""
PINNED = 1 << 20
"""Bytes from which copies go through pinned memory."""
OPTIONS = ("--std=c++17", "--fmad=false")
"""No fused products: sums round as those of NumPy."""
SOURCE = Path(__file__).parent / "kernels.cu"
REMEDY = "pip install 'vcam-cli[gpu]' on a machine with an NVIDIA driver, or use --device cpu"


class Cuda(Processor):
    """The current graphics processor."""

    name: ClassVar[str] = "gpu"
    whole: ClassVar[bool] = True

    def __init__(self, cupy: Any) -> None:
        self._cupy = cupy

    def describe(self) -> str:
        """Return the device and its library, for `run.json`."""
        cupy = self._cupy
        found = cupy.cuda.runtime.getDeviceProperties(cupy.cuda.Device().id)["name"]
        return f"gpu, {found.decode()}, CuPy {cupy.__version__}"

    def put(self, values: Any, dtype: DTypeLike | None = None) -> Array:
        """Return values as a contiguous array of the device."""
        if isinstance(values, np.ndarray) and values.nbytes >= PINNED:
            staged = self._pinned(values.shape, values.dtype if dtype is None else dtype)
            staged[...] = values
            return self._copied(staged)
        array: Array = self._cupy.ascontiguousarray(self._cupy.asarray(values, dtype))
        return array

    def stacked(self, pictures: Sequence[Any]) -> Array:
        """Return pictures of one shape as one array (n, ...) of the device."""
        cupy, first = self._cupy, pictures[0]
        if any(hasattr(picture, "__cuda_array_interface__") for picture in pictures):
            array: Array = cupy.stack([cupy.asarray(picture) for picture in pictures])
            return array
        staged = self._pinned((len(pictures), *first.shape), np.result_type(*pictures))
        for target, picture in zip(staged, pictures, strict=True):
            target[...] = picture
        return self._copied(staged)

    def _pinned(self, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return an array of the processor in memory from which copies are ten times as fast."""
        import cupyx  # type: ignore[import-not-found]

        array: Array = cupyx.empty_pinned(shape, dtype)
        return array

    def _copied(self, staged: Array) -> Array:
        array: Array = self._cupy.empty(staged.shape, staged.dtype)
        array.set(staged)  # type: ignore[attr-defined]
        self._cupy.cuda.get_current_stream().synchronize()  # `staged` is used again
        return array

    def get(self, array: Array) -> Array:
        """Return an array of the device as one of NumPy."""
        out = self._pinned(array.shape, array.dtype) if array.nbytes >= PINNED else None
        host: Array = self._cupy.asnumpy(array, out=out)
        return host

    def fetch(self, array: Array) -> Callable[[], Array]:
        """Begin to copy an array on a second stream, to pinned memory."""
        array = self._cupy.ascontiguousarray(array)
        host = self._pinned(array.shape, array.dtype)
        stream = self._second_stream
        stream.wait_event(self._cupy.cuda.get_current_stream().record())
        array.get(stream=stream, out=host, blocking=False)  # type: ignore[attr-defined]
        copied = stream.record()

        def wait(held: Array = array) -> Array:  # it is not freed before
            copied.synchronize()
            return host

        return wait

    @cached_property
    def _second_stream(self) -> Any:
        return self._cupy.cuda.Stream(non_blocking=True)

    def zeros(self, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return an array of zeros on the device."""
        array: Array = self._cupy.zeros(shape, dtype)
        return array

    def dct3(self, values: Array, axis: int, odd: bool, overwrite: bool = False) -> Array:
        """Return the DCT-III along an axis, of sines the DST-III."""
        from cupyx.scipy import fft  # type: ignore[import-not-found]

        transform = fft.dst if odd else fft.dct
        found: Array = transform(values, type=3, axis=axis, overwrite_x=overwrite)
        return found

    def fft(self, values: Array, axis: int) -> Array:
        """Return the Fourier transform of complex numbers along an axis."""
        found: Array = self._cupy.fft.fft(values, axis=axis)
        return found

    def ifft(self, values: Array, axis: int) -> Array:
        """Return the inverse of `fft`."""
        found: Array = self._cupy.fft.ifft(values, axis=axis)
        return found

    def irfft(self, values: Array, count: int) -> Array:
        """Return the sums (rows, count) of real waves whose spectra are (rows, count // 2 + 1)."""
        found: Array = self._cupy.fft.irfft(values, count, axis=1, norm="forward")
        return found

    def splines(self, values: Array) -> Array:
        """Return the coefficients of splines through an image that is mirrored."""
        from cupyx.scipy import ndimage

        wide = values.astype(np.float64)  # recursions in 64 bits, as SciPy's
        found: Array = ndimage.spline_filter(wide, order=SPLINES, mode="mirror")
        return found.astype(values.dtype)

    def interpolated(self, coefficients: Array, row: Array, column: Array) -> Array:
        """Return the image of `splines` between its samples."""
        from cupyx.scipy import ndimage

        places = self._cupy.stack([row, column])
        found: Array = ndimage.map_coordinates(
            coefficients,
            places,
            order=SPLINES,
            prefilter=False,
            mode="mirror",
            output=coefficients.dtype,
        )
        return found

    def free_memory(self) -> int:
        """Return the memory that batches may take: a share of the free, kept pools included."""
        cupy = self._cupy
        free, _ = cupy.cuda.Device().mem_info
        return int(SHARE * (free + cupy.get_default_memory_pool().free_bytes()))

    def wait(self) -> None:
        """Return when all that was asked of the device is done."""
        self._cupy.cuda.Device().synchronize()

    def errors(self) -> AbstractContextManager[None]:
        """Return what raises failures of the device as `CannotDo`."""
        return _device_errors()

    def normals(self, keys: Array, name: str, sample: int, count: int, dtype: DTypeLike) -> Array:
        """Return standard normal numbers (B, count)."""
        out: Array = self._cupy.empty((len(keys), count), dtype)
        self._draw("normals", out, keys, name, sample)
        return out

    def uniforms(self, keys: Array, name: str, sample: int, count: int) -> Array:
        """Return numbers (B, count) between 0 and 1, float64."""
        out: Array = self._cupy.empty((len(keys), count), np.float64)
        self._draw("uniforms", out, keys, name, sample)
        return out

    def poisson(self, keys: Array, name: str, sample: int, mean: Array) -> Array:
        """Return Poisson numbers of means (B, ...); it reuses their array where it can."""
        mean = self._cupy.ascontiguousarray(mean)
        self._draw("poisson", mean, keys, name, sample)
        return mean

    def add_normals(self, values: Array, rms: float, keys: Array, name: str, sample: int) -> Array:
        """Return values (B, ...) plus normal numbers of a standard deviation."""
        values = self._cupy.ascontiguousarray(values)
        self._draw("add_normals", values, keys, name, sample, np.float64(rms))
        return values

    def on_line(
        self,
        values: Array,
        most: float,
        line: tuple[float, float],
        highest: int,
        dtype: DTypeLike | None = None,
    ) -> Array:
        """Return min(values, most) on a line, clipped to 0 and a highest level."""
        values = self._cupy.ascontiguousarray(values)
        out: Array = self._cupy.empty(values.shape, values.dtype if dtype is None else dtype)
        kernel = "levels" if dtype is None else f"codes{8 * out.dtype.itemsize}"
        numbers = (np.float64(number) for number in (most, *line, highest))
        self._launch(kernel, values.dtype, out.size, values, out, *numbers, np.int64(out.size))
        return out

    def _draw(
        self, kernel: str, out: Array, keys: Array, name: str, sample: int, *more: Any
    ) -> None:
        count, batch = out[0].size, len(out)
        low, high = (np.uint32(word) for word in counter_noise.stream_words(name))
        arguments = (keys, low, high, np.uint32(sample), np.int64(count), np.int64(batch))
        groups = -(-count // counter_noise.WORDS)
        # Uniform numbers have 64 bits in both.
        self._launch(kernel, out.dtype, groups * batch, out, *arguments, *more)

    def _launch(self, kernel: str, dtype: np.dtype, elements: int, *arguments: Any) -> None:
        function = _kernels(np.dtype(dtype).itemsize).get_function(kernel)
        blocks = min(max(-(-elements // THREADS), 1), MOST_BLOCKS)
        function((blocks,), (THREADS,), arguments)

    def spectrum(
        self, pictures: Array, mix: Array, shape: tuple[int, int], black: tuple[int, int]
    ) -> Array:
        """Return the DCT-II of mixtures of the channels of pictures: one Fourier transform."""
        cupy, (rows, columns) = self._cupy, shape
        pictures, mix = cupy.ascontiguousarray(pictures), cupy.ascontiguousarray(mix)
        count, height, width, channels = pictures.shape
        planes = cupy.empty((count, len(mix), rows, columns), pictures.dtype)
        sizes = (height, width, rows, columns, *black)
        self._launch(
            *("mixed", planes.dtype, count * rows * columns, pictures, mix, planes),
            *(np.int64(count), np.int32(channels), np.int32(len(mix))),
            *(*map(np.int64, sizes), np.int32(1)),
        )
        half = cupy.fft.rfft2(planes)
        out: Array = planes  # of the same size
        turns = (self._turns(length, planes.dtype) for length in shape)
        self._launch(
            *("cosines", out.dtype, out.size, half, *turns, out),
            *map(np.int64, (count * len(mix), rows, columns)),
        )
        return out

    def filtered(self, spectrum: Array, transfer: Array, from_y: Array, from_x: Array) -> Array:
        """Return the terms of every color."""
        count, mixtures, rows, columns = spectrum.shape
        _, colors, terms_y, terms_x = transfer.shape
        out: Array = self._cupy.empty((count, colors, terms_y, terms_x), spectrum.dtype)
        self._launch(
            *("filtered", out.dtype, count * terms_y * terms_x),
            *(spectrum, transfer, from_y, from_x, out),
            *(np.int64(count), np.int32(mixtures), np.int32(colors)),
            *map(np.int64, (terms_y, terms_x, rows, columns)),
        )
        return out

    def evaluated(
        self,
        terms: Array,
        size: tuple[int, int],
        window: tuple[slice, slice],
        color: Array | None,
    ) -> Array:
        """Return the DCT-III of terms at the pixels: one Fourier transform."""
        cupy, (rows, columns) = self._cupy, size
        terms = cupy.ascontiguousarray(terms)
        count, colors, terms_y, terms_x = terms.shape
        kind = np.complex64 if terms.dtype == np.float32 else np.complex128
        half = cupy.empty((count, colors, rows, columns // 2 + 1), kind)
        turns = (self._turns(length, terms.dtype) for length in size)
        self._launch(
            *("half_spectrum", terms.dtype, half.size, terms, *turns, half),
            *map(np.int64, (count * colors, rows, columns, terms_y, terms_x)),
        )
        planes = cupy.fft.irfft2(half, s=size, norm="forward")
        top, left = window[0].start, window[1].start
        height, width = window[0].stop - top, window[1].stop - left
        shape = (count, height, width) if color is not None else (count, colors, height, width)
        out: Array = cupy.empty(shape, terms.dtype)
        self._launch(
            *("placed", out.dtype, count * height * width, cupy.ascontiguousarray(planes)),
            *(np.uint64(0) if color is None else color, out, np.int64(count), np.int32(colors)),
            *map(np.int64, (rows, columns, top, left, height, width)),
        )
        return out

    @lru_cache(maxsize=32)  # noqa: B019  one device in a process
    def _turns(self, length: int, dtype: np.dtype) -> Array:
        """Return exp(-i pi k / (2 length)) of k from 0 to the length."""
        turns = np.exp(-0.5j * np.pi * np.arange(length + 1) / length)
        return self.put(turns, np.complex64 if dtype == np.float32 else np.complex128)


@lru_cache(maxsize=2)
def _kernels(width: int) -> Any:
    """Return the kernels for floating-point numbers of 4 or of 8 bytes."""
    import cupy  # type: ignore[import-not-found]

    kind = f"-DREAL={'float' if width == 4 else 'double'}"
    return cupy.RawModule(code=SOURCE.read_text(), options=(*OPTIONS, kind))


@lru_cache(maxsize=1)
def open_cuda() -> Cuda:
    """Return the graphics processor.

    Raises
    ------
    CannotDo
        Where CuPy is not installed, or finds no device.
    """
    try:
        import cupy
    except ImportError as error:
        raise CannotDo("a graphics processor needs CuPy, which is not installed", REMEDY) from error
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise CannotDo(f"no graphics processor can be used: {error}", REMEDY) from error
    if not count:
        raise CannotDo("there is no graphics processor", REMEDY)
    return Cuda(cupy)


@contextmanager
def _device_errors() -> Iterator[None]:
    """Raise failures of a graphics processor as CannotDo: no memory, or a device that is lost."""
    try:
        yield
    except Exception as error:
        module = type(error).__module__ or ""
        if not module.startswith("cupy"):
            raise
        out = "OutOfMemory" in type(error).__name__
        remedy = "use fewer pixels at once" if out else "look at the driver and start anew"
        raise CannotDo(
            f"the graphics processor failed: {error}", f"{remedy}, or --device cpu"
        ) from error
