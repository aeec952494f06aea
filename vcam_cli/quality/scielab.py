"""How different two pictures look: Delta E of every pixel, by CIELAB and by S-CIELAB.

S-CIELAB blurs both pictures as the eye does before CIELAB compares them: linear display values ->
opponent planes -> the eye's filters (`eye`) -> XYZ -> L*, a*, b* -> Delta E. Uniform fields have
the Delta E of CIELAB; detail too fine to be seen has none.

Why cosine transforms: in the DCT-II of a picture that is mirrored at its borders every symmetric
kernel, of whatever size, is one factor a coefficient. Nothing is dropped at the border, nothing
shifts, and a plane costs two transforms however many Gaussians it is seen through.

Why blocks of rows, with the rows above and below that the filter reaches: they stay in the cache,
threads share them, and memory does not grow with the picture. They are the same for any number of
workers, and so is every byte of the result.

The filters `continuous` see pixels as squares of light, and what is seen changes within a square
where pixels are coarse. Each is then looked at in several places, as if it were several pixels of
the same light, and its Delta E is the mean.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.engine.parallel import available_workers, each, pieces
from vcam_cli.quality.cielab import Formula, delta_e, lab
from vcam_cli.quality.display import Screen
from vcam_cli.quality.eye import OPPONENT, Filters, kernels

BLOCK_ROWS = 256
SINGLE_PEAK = 16.0
"""The largest value, white = 1, up to which float32 serves: its transforms err by 5e-7 of it."""
PLACES = 32.0
"""Places in a degree at which squares of light are looked at, at least. The mean Delta E of a chirp
is then good to 0.5 %, where 8 pixels are a degree; with one place a pixel it is 35 % too large."""

Look = Callable[[NDArray], NDArray]
"""Rows (3, rows, columns) of display values -> the X/Xn, Y/Yn, Z/Zn that the eye gets."""


def cielab_map(
    image: NDArray,
    reference: NDArray,
    screen: Screen,
    formula: Formula = "1976",
    workers: int | None = None,
) -> NDArray:
    """Delta E of every pixel, (rows, columns), without regard to its neighbors.

    image, reference: linear display values, white = 1, (rows, columns, 3), or (rows, columns, 1)
    for gray. Raises ValueError where shapes differ or are none of these.
    """
    image, reference = _alike(image, reference)
    dtype = _float_type(image, reference)
    to_relative = _cast(screen.to_xyz / screen.white[:, None], dtype)
    out = np.empty(image.shape[:2], dtype)

    def compare(rows: slice) -> None:
        seen, ideal = (lab(_mix(to_relative, _planes(x[rows], dtype))) for x in (image, reference))
        out[rows] = delta_e(seen, ideal, formula)

    each(compare, pieces(len(out), BLOCK_ROWS), workers or available_workers())
    return out


def s_cielab_map(
    image: NDArray,
    reference: NDArray,
    screen: Screen,
    filters: Filters = "zhang-wandell-1996",
    formula: Formula = "1976",
    workers: int | None = None,
) -> NDArray:
    """S-CIELAB Delta E of every pixel, (rows, columns); mirrored borders.

    image, reference: as for `cielab_map`. Raises ValueError where shapes differ, or for filters or
    a formula that are not known. float64 in, or values above 16 times white, float64 out.
    """
    image, reference = _alike(image, reference)
    dtype = _float_type(image, reference)
    blur = _Blur.of(image.shape[:2], screen, filters, dtype)
    out = np.empty(image.shape[:2], dtype)
    n = blur.places

    def compare(rows: slice) -> None:
        seen, ideal = (lab(blur(x, rows)) for x in (image, reference))
        different = delta_e(seen, ideal, formula)
        if n > 1:
            different = different.reshape(-1, n, out.shape[1], n).mean(axis=(1, 3))
        out[rows] = different

    each(compare, pieces(len(out), blur.block // n), workers or available_workers())
    return out


def _places(filters: Filters, screen: Screen) -> int:
    """Places along a pixel at which it is looked at."""
    if filters != "continuous":
        return 1
    return max(1, math.ceil(PLACES / screen.samples_per_degree))


@dataclass(frozen=True)
class _Blur:
    """The way of one picture's rows to what the eye gets; see `_Blur.of`."""

    to_opponent: NDArray
    to_relative: NDArray
    response: NDArray
    """(3, rows, columns) factors on the DCT-II of a block."""
    block: int
    """Rows that come out of a whole block."""
    halo: int
    """Rows above and below that go in."""
    places: int
    """Along a pixel: rows and columns here are these."""

    @classmethod
    def of(cls, shape: tuple[int, int], screen: Screen, filters: Filters, dtype: np.dtype):
        """Ready for pictures of that shape."""
        places = _places(filters, screen)
        rows, columns = (count * places for count in shape)
        eye = kernels(filters, screen.samples_per_degree * places)
        reach = max(kernel.reach for kernel in eye)
        block, halo = _block(rows, reach)
        block = -(-block // places) * places
        tall, wide = _good_length(block + 2 * halo, reach), _good_length(columns, reach)
        response = np.array([kernel.response(tall, wide) for kernel in eye], dtype)
        opponent = np.array(OPPONENT[filters])
        back = np.linalg.inv(opponent) / screen.white[:, None]
        into = _cast(opponent @ screen.to_xyz, dtype)
        return cls(into, _cast(back, dtype), response, block, halo, places)

    def __call__(self, picture: NDArray, rows: slice) -> NDArray:
        """(3, rows, columns) X/Xn, Y/Yn, Z/Zn of some rows, blurred as the eye blurs."""
        n, (_, tall, wide) = self.places, self.response.shape
        first, columns = rows.start * n - self.halo, picture.shape[1] * n
        values = picture[_pixels(first, tall, picture.shape[0], n)]
        planes = _mix(self.to_opponent, _planes(values, self.response.dtype))
        if n > 1 or wide > columns:
            planes = planes[:, :, _pixels(0, wide, picture.shape[1], n)]
        for plane, factor in zip(planes, self.response, strict=True):
            coefficients = scipy.fft.dctn(plane, overwrite_x=True)
            coefficients *= factor
            plane[...] = scipy.fft.idctn(coefficients, overwrite_x=True)
        height = (rows.stop - rows.start) * n
        return _mix(self.to_relative, planes[:, self.halo : self.halo + height, :columns])


def _block(rows: int, reach: int) -> tuple[int, int]:
    """Rows of a block and of its halo: all rows and none, where a block would be hardly less."""
    block = max(BLOCK_ROWS, 2 * reach)
    if block + 2 * reach >= rows:
        return rows, 0
    count = -(-rows // block)
    return -(-rows // count), reach


def _good_length(count: int, reach: int) -> int:
    """A length of fast transforms: `count`, or so much more that the far border is not felt.

    A kernel that reaches across the picture does without: the mirrored rows would outnumber it.
    """
    if scipy.fft.next_fast_len(count, real=True) == count or reach > count:
        return count
    return scipy.fft.next_fast_len(count + reach, real=True)


def _pixels(first: int, length: int, count: int, places: int) -> slice | NDArray:
    """The pixels, of `count` in a row, of the places first .. first + length - 1."""
    found = _mirrored(first, length, count * places)
    if places == 1:
        return found
    every = np.arange(found.start, found.stop) if isinstance(found, slice) else found
    return every // places


def _mirrored(first: int, length: int, count: int) -> slice | NDArray:
    """Indices first .. first + length - 1 of a picture of `count` rows, mirrored at its borders.

    The border itself is the mirror, as in the DCT-II: index -1 is 0, `count` is count - 1.
    """
    if first >= 0 and first + length <= count:
        return slice(first, first + length)
    folded = np.arange(first, first + length) % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)


def _alike(image: NDArray, reference: NDArray) -> tuple[NDArray, NDArray]:
    """Both with three channels; gray is shown with equal red, green and blue."""
    if image.shape != reference.shape:
        raise ValueError(f"shapes differ: {image.shape} and {reference.shape}")
    if image.ndim != 3 or image.shape[2] not in (1, 3) or image.size == 0:
        raise ValueError(f"pictures are (rows, columns, 1 or 3), not {image.shape}")
    shape = (*image.shape[:2], 3)
    return np.broadcast_to(image, shape), np.broadcast_to(reference, shape)


def _float_type(*pictures: NDArray) -> np.dtype:
    """float32 where it serves."""
    double = any(picture.dtype == np.float64 for picture in pictures)
    if double or not all(float(picture.max()) <= SINGLE_PEAK for picture in pictures):
        return np.dtype(np.float64)
    return np.dtype(np.float32)


def _cast(matrix: NDArray, dtype: np.dtype) -> NDArray:
    return np.asarray(matrix, dtype)


def _planes(rows: NDArray, dtype: np.dtype) -> NDArray:
    """(rows, columns, 3) -> (3, rows, columns), a copy."""
    return np.array(np.moveaxis(rows, 2, 0), dtype, order="C")


def _mix(matrix: NDArray, planes: NDArray) -> NDArray:
    """(3, rows, columns): matrix @ planes at every pixel, always summed in the same order."""
    out = np.empty(planes.shape, planes.dtype)
    for mixed, (a, b, c) in zip(out, matrix, strict=True):
        np.multiply(planes[0], a, out=mixed)
        mixed += b * planes[1]
        mixed += c * planes[2]
    return out
