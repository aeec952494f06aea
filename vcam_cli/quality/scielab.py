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

References
----------
.. [1] X. Zhang, B. Wandell, "A spatial extension of CIELAB for digital color image reproduction",
   Journal of the SID 5, 61-63, 1997, doi:10.1889/1.1985127.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.parallel import available_workers, each, pieces
from vcam_cli.quality.cielab import Formula, delta_e, lab
from vcam_cli.quality.display import Screen
from vcam_cli.quality.eye import OPPONENT, Filters, kernels

BLOCK_ROWS = 256
SINGLE_PEAK = 16.0
"""Largest value, white = 1, up to which float32 serves: its transforms err by 5e-7 of it."""
MIN_SAMPLES_PER_DEGREE = 32.0
"""Places in a degree at which squares of light are looked at, at least.

The mean Delta E of a chirp is then good to 0.5 %, where 8 pixels are a degree; with one place a
pixel it is 35 % too large.
"""


def cielab_map(
    image: NDArray,
    reference: NDArray,
    screen: Screen,
    formula: Formula = "1976",
    workers: int | None = None,
) -> NDArray:
    """Return Delta E of every pixel, without regard to its neighbors.

    Parameters
    ----------
    image, reference : ndarray
        Linear display values, white = 1, (rows, columns, 3), or (rows, columns, 1) for gray.
    screen : Screen
        Display on which they are seen.
    formula : {"1976", "1994", "2000"}
        Formula of Delta E.
    workers : int, optional
        Number of threads; all processors unless given.

    Returns
    -------
    ndarray
        Delta E (rows, columns) [dimensionless].

    Raises
    ------
    ValueError
        The shapes differ or are none of these.
    """
    image, reference = _with_three_channels(image, reference)
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
    """Return S-CIELAB Delta E of every pixel [1]; pictures are mirrored at their borders.

    Parameters
    ----------
    image, reference : ndarray
        Linear display values, white = 1, (rows, columns, 3), or (rows, columns, 1) for gray.
    screen : Screen
        Display on which they are seen.
    filters : {"zhang-wandell-1996", "isetcam", "continuous"}
        Filters of the eye.
    formula : {"1976", "1994", "2000"}
        Formula of Delta E.
    workers : int, optional
        Number of threads; all processors unless given.

    Returns
    -------
    ndarray
        Delta E (rows, columns) [dimensionless]: float64 for float64 pictures or values above 16
        times white, else float32.

    Raises
    ------
    ValueError
        The shapes differ, or filters or formula are not known.
    """
    image, reference = _with_three_channels(image, reference)
    dtype = _float_type(image, reference)
    blur = _Blur.prepare(image.shape[:2], screen, filters, dtype)
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


def _samples_per_pixel(filters: Filters, screen: Screen) -> int:
    """Return the number of places along a pixel at which it is looked at."""
    if filters != "continuous":
        return 1
    return max(1, math.ceil(MIN_SAMPLES_PER_DEGREE / screen.samples_per_degree))


@dataclass(frozen=True)
class _Blur:
    """Takes rows of a picture to X/Xn, Y/Yn, Z/Zn as the eye gets them; `prepare` makes one."""

    to_opponent: NDArray
    """Matrix (3, 3) from display values to opponent planes."""
    to_relative: NDArray
    """Matrix (3, 3) from opponent planes to X/Xn, Y/Yn, Z/Zn."""
    response: NDArray
    """Factors (3, rows, columns) on the DCT-II of a block."""
    block: int
    """Rows that come out of a whole block."""
    halo: int
    """Rows above and below that go in."""
    places: int
    """Places along a pixel; rows and columns here are counted in them."""

    @classmethod
    def prepare(cls, shape: tuple[int, int], screen: Screen, filters: Filters, dtype: np.dtype):
        """Return the blur of pictures of a shape."""
        places = _samples_per_pixel(filters, screen)
        rows, columns = (count * places for count in shape)
        eye = kernels(filters, screen.samples_per_degree * places)
        reach = max(kernel.reach for kernel in eye)
        block, halo = _block_and_halo(rows, reach)
        block = -(-block // places) * places
        tall, wide = _transform_length(block + 2 * halo, reach), _transform_length(columns, reach)
        response = np.array([kernel.response(tall, wide) for kernel in eye], dtype)
        opponent = np.array(OPPONENT[filters])
        back = np.linalg.inv(opponent) / screen.white[:, None]
        into = _cast(opponent @ screen.to_xyz, dtype)
        return cls(into, _cast(back, dtype), response, block, halo, places)

    def __call__(self, picture: NDArray, rows: slice) -> NDArray:
        """(3, rows, columns) X/Xn, Y/Yn, Z/Zn of some rows, blurred as the eye blurs."""
        n, (_, tall, wide) = self.places, self.response.shape
        first, columns = rows.start * n - self.halo, picture.shape[1] * n
        values = picture[_pixel_indices(first, tall, picture.shape[0], n)]
        planes = _mix(self.to_opponent, _planes(values, self.response.dtype))
        if n > 1 or wide > columns:
            planes = planes[:, :, _pixel_indices(0, wide, picture.shape[1], n)]
        for plane, factor in zip(planes, self.response, strict=True):
            coefficients = scipy.fft.dctn(plane, overwrite_x=True)
            coefficients *= factor
            plane[...] = scipy.fft.idctn(coefficients, overwrite_x=True)
        height = (rows.stop - rows.start) * n
        return _mix(self.to_relative, planes[:, self.halo : self.halo + height, :columns])


def _block_and_halo(rows: int, reach: int) -> tuple[int, int]:
    """Return the rows of a block and of its halo.

    All rows and no halo, where a block would be hardly less.
    """
    block = max(BLOCK_ROWS, 2 * reach)
    if block + 2 * reach >= rows:
        return rows, 0
    count = -(-rows // block)
    return -(-rows // count), reach


def _transform_length(count: int, reach: int) -> int:
    """Return a length of fast transforms: `count`, or more so that the far border is not felt.

    A kernel that reaches across the picture does without: the mirrored rows would outnumber it.
    """
    if scipy.fft.next_fast_len(count, real=True) == count or reach > count:
        return count
    return scipy.fft.next_fast_len(count + reach, real=True)


def _pixel_indices(first: int, length: int, count: int, places: int) -> slice | NDArray:
    """Return the pixels, of `count` in a row, of the places first .. first + length - 1."""
    found = _mirrored_indices(first, length, count * places)
    if places == 1:
        return found
    every = np.arange(found.start, found.stop) if isinstance(found, slice) else found
    return every // places


def _mirrored_indices(first: int, length: int, count: int) -> slice | NDArray:
    """Return indices first .. first + length - 1 of `count` rows, mirrored at their borders.

    The border itself is the mirror, as in the DCT-II: index -1 is 0, `count` is count - 1.
    """
    if first >= 0 and first + length <= count:
        return slice(first, first + length)
    folded = np.arange(first, first + length) % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)


def _with_three_channels(image: NDArray, reference: NDArray) -> tuple[NDArray, NDArray]:
    """Return both pictures with three channels; gray has equal red, green and blue."""
    if image.shape != reference.shape:
        raise ValueError(f"shapes differ: {image.shape} and {reference.shape}")
    if image.ndim != 3 or image.shape[2] not in (1, 3) or image.size == 0:
        raise ValueError(f"pictures are (rows, columns, 1 or 3), not {image.shape}")
    shape = (*image.shape[:2], 3)
    return np.broadcast_to(image, shape), np.broadcast_to(reference, shape)


def _float_type(*pictures: NDArray) -> np.dtype:
    """Return float32 where it serves, else float64."""
    double = any(picture.dtype == np.float64 for picture in pictures)
    if double or not all(float(picture.max()) <= SINGLE_PEAK for picture in pictures):
        return np.dtype(np.float64)
    return np.dtype(np.float32)


def _cast(matrix: NDArray, dtype: np.dtype) -> NDArray:
    return np.asarray(matrix, dtype)


def _planes(rows: NDArray, dtype: np.dtype) -> NDArray:
    """Return a copy (3, rows, columns) of rows (rows, columns, 3)."""
    return np.array(np.moveaxis(rows, 2, 0), dtype, order="C")


def _mix(matrix: NDArray, planes: NDArray) -> NDArray:
    """Return matrix @ planes (3, rows, columns) at every pixel, always summed in the same order."""
    out = np.empty(planes.shape, planes.dtype)
    for mixed, (a, b, c) in zip(out, matrix, strict=True):
        np.multiply(planes[0], a, out=mixed)
        mixed += b * planes[1]
        mixed += c * planes[2]
    return out
