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

The filters `continuous` see pixels as squares of light, and the seen light changes within a square
where pixels are coarse. Each is then looked at in several places, as if it were several pixels of
the same light, and its Delta E is the mean. A pixel of more than a degree is seen across its
borders like one of a degree, since the filters end half a degree away; all the rest of it is seen
like its center. So neither time nor memory grows beyond those of pixels of one degree.

References
----------
.. [1] X. Zhang, B. Wandell, "A spatial extension of CIELAB for digital color image reproduction",
   Journal of the SID 5, 61-63, 1997, doi:10.1889/1.1985127.
"""

import math

import numpy as np
import scipy.fft

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.parallel import available_workers, each, pieces
from vcam_cli.quality.cielab import Formula, delta_e, lab
from vcam_cli.quality.display import Screen
from vcam_cli.quality.eye import OPPONENT, Filters, kernels
from vcam_cli.records import dataclass

BLOCK_ROWS = 256
BLOCK_PLACES = 1 << 21
"""Places that a block has at most, as long as its rows are more than its halo's."""
THREAD_BYTES = 7 * 3
"""Values that a thread holds for each place of its block: seven times three planes."""
SINGLE_PEAK = 16.0
"""Largest value, white = 1, up to which float32 serves: its transforms err by 5e-7 of it."""
MIN_SAMPLES_PER_DEGREE = 32.0
"""Places in a degree at which squares of light are looked at, at least.

The mean Delta E of a chirp is then good to 0.5 %, where 8 pixels are a degree; with one place a
pixel it is 35 % too large.
"""


def cielab_map(
    image: Array,
    reference: Array,
    screen: Screen,
    formula: Formula = "1976",
    workers: int | None = None,
) -> Array:
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
    image: Array,
    reference: Array,
    screen: Screen,
    filters: Filters = "zhang-wandell-1996",
    formula: Formula = "1976",
    workers: int | None = None,
) -> Array:
    """Return S-CIELAB Delta E of every pixel [1]; pictures are mirrored at their borders.

    Parameters
    ----------
    image, reference, screen, formula, workers
        As those of `cielab_map`.
    filters : {"zhang-wandell-1996", "isetcam", "continuous"}
        Filters of the eye.

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
    places = _Places.prepare(image.shape[:2], screen, filters)
    workers = places.require_memory(dtype, workers or available_workers())
    blur = _Blur.prepare(places, screen, filters, dtype)
    out = np.empty(image.shape[:2], dtype)

    def compare(rows: slice) -> None:
        seen, ideal = (lab(blur(x, rows)) for x in (image, reference))
        out[rows] = places.mean(delta_e(seen, ideal, formula))

    each(compare, pieces(len(out), places.block // places.along), workers)
    return out


def needed_bytes(shape: tuple[int, int], screen: Screen, filters: Filters, workers: int) -> int:
    """Return the memory that S-CIELAB takes with `threads` threads, without the pictures.

    With little memory fewer threads run; one is needed.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the pictures.
    screen : Screen
        Display on which they are seen.
    filters : {"zhang-wandell-1996", "isetcam", "continuous"}
        Filters of the eye.
    workers : int
        Number of threads.

    Returns
    -------
    int
        Bytes, with values of 32 bits.
    """
    return _Places.prepare(shape, screen, filters).needed_bytes(np.dtype(np.float32), workers)


def places_per_pixel(screen: Screen, filters: Filters) -> int:
    """Return the number of places at which each pixel is looked at.

    Parameters
    ----------
    screen : Screen
        The display and its viewing distance.
    filters : Filters
        Filters of the eye.

    Returns
    -------
    int
        Places in each pixel: the square of those along one side.
    """
    return _Places.prepare((1, 1), screen, filters).along ** 2


@dataclass(frozen=True)
class _Places:
    """Where a picture is looked at: in one place a pixel, or in several, block by block."""

    shape: tuple[int, int]
    """Rows and columns of the picture."""
    along: int
    """Places along a pixel; rows and columns of the others are counted in them."""
    per_degree: float
    """Places in a degree of visual angle; of a pixel larger than that, along its borders."""
    inside: float
    """Part of a pixel's length, around its center, that all looks like the center."""
    block: int
    """Rows that come out of a whole block."""
    halo: int
    """Rows above and below that go in."""
    transformed: tuple[int, int]
    """Rows and columns of a block's transform."""

    @classmethod
    def prepare(cls, shape: tuple[int, int], screen: Screen, filters: Filters) -> "_Places":
        """Return the places at which pictures of a shape are looked at."""
        per_degree, along, inside = screen.samples_per_degree, 1, 0.0
        if filters == "continuous":
            inside, per_degree = max(0.0, 1 - per_degree), max(1.0, per_degree)
            along = max(1, math.ceil(MIN_SAMPLES_PER_DEGREE / per_degree))
            along += inside > 0 and along % 2 == 0  # one of them is the center
        rows, columns = (count * along for count in shape)
        reach = max(kernel.reach for kernel in kernels(filters, per_degree * along))
        block, halo = _block_and_halo(rows, columns, reach)
        block = -(-block // along) * along
        transformed = _transform_length(block + 2 * halo, reach), _transform_length(columns, reach)
        return cls(shape, along, per_degree * along, inside, block, halo, transformed)

    def mean(self, different: Array) -> Array:
        """Return the mean over every pixel of what is at its places: (rows, columns)."""
        n = self.along
        if n == 1:
            return different
        by_pixel = different.reshape(-1, n, self.shape[1], n)
        if not self.inside:
            return np.asarray(by_pixel.mean(axis=(1, 3)))
        weights = np.full(n, (1 - self.inside) / n, different.dtype)
        weights[n // 2] += different.dtype.type(self.inside)
        averages: Array = np.einsum("i,ricj,j->rc", weights, by_pixel, weights)
        return averages

    def needed_bytes(self, dtype: np.dtype, workers: int) -> int:
        """Return the memory that it takes with `threads` threads."""
        values = math.prod(self.transformed) * dtype.itemsize
        threads = min(workers, -(-self.shape[0] * self.along // self.block))
        return values * (3 + THREAD_BYTES * threads)

    def require_memory(self, dtype: np.dtype, workers: int) -> int:
        """Return how many threads memory suffices for. Raises CannotDo where it does for none."""
        while workers > 1 and self.needed_bytes(dtype, workers) > memory.available():
            workers //= 2
        memory.require(self.needed_bytes(dtype, workers), *self.shape)
        return workers


@dataclass(frozen=True)
class _Blur:
    """Takes rows of a picture to X/Xn, Y/Yn, Z/Zn as the eye gets them; `prepare` makes one."""

    to_opponent: Array
    """Matrix (3, 3) from display values to opponent planes."""
    to_relative: Array
    """Matrix (3, 3) from opponent planes to X/Xn, Y/Yn, Z/Zn."""
    response: Array
    """Factors (3, rows, columns) on the DCT-II of a block."""
    places: _Places
    """Where the picture is looked at."""

    @classmethod
    def prepare(cls, places: _Places, screen: Screen, filters: Filters, dtype: np.dtype) -> "_Blur":
        """Return the blur of pictures that are looked at in these places."""
        eye = kernels(filters, places.per_degree)
        response = np.array([kernel.response(*places.transformed) for kernel in eye], dtype)
        opponent, to_xyz = np.array(OPPONENT[filters]), screen.to_xyz / screen.white[1]
        back = np.linalg.inv(opponent) / to_xyz.sum(axis=1)[:, None]
        return cls(_cast(opponent @ to_xyz, dtype), _cast(back, dtype), response, places)

    def __call__(self, picture: Array, rows: slice) -> Array:
        """(3, rows, columns) X/Xn, Y/Yn, Z/Zn of some rows, blurred as the eye blurs."""
        n, halo, (tall, wide) = self.places.along, self.places.halo, self.places.transformed
        first, columns = rows.start * n - halo, picture.shape[1] * n
        values = picture[_pixel_indices(first, tall, picture.shape[0], n)]
        planes = _mix(self.to_opponent, _planes(values, self.response.dtype))
        if n > 1 or wide > columns:
            planes = planes[:, :, _pixel_indices(0, wide, picture.shape[1], n)]
        for plane, factor in zip(planes, self.response, strict=True):
            coefficients = scipy.fft.dctn(plane, overwrite_x=True)
            coefficients *= factor
            plane[...] = scipy.fft.idctn(coefficients, overwrite_x=True)
        height = (rows.stop - rows.start) * n
        return _mix(self.to_relative, planes[:, halo : halo + height, :columns])


def _block_and_halo(rows: int, columns: int, reach: int) -> tuple[int, int]:
    """Return the rows of a block and of its halo.

    All rows and no halo, where a block would be hardly less.
    """
    block = max(min(BLOCK_ROWS, BLOCK_PLACES // columns), 2 * reach, 1)
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


def _pixel_indices(first: int, length: int, count: int, places: int) -> slice | Array:
    """Return the pixels, of `count` in a row, of the places first .. first + length - 1."""
    found = _mirrored_indices(first, length, count * places)
    if places == 1:
        return found
    every = np.arange(found.start, found.stop) if isinstance(found, slice) else found
    return every // places


def _mirrored_indices(first: int, length: int, count: int) -> slice | Array:
    """Return indices first .. first + length - 1 of `count` rows, mirrored at their borders.

    The border itself is the mirror, as in the DCT-II: index -1 is 0, `count` is count - 1.
    """
    if first >= 0 and first + length <= count:
        return slice(first, first + length)
    folded = np.arange(first, first + length) % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)


def _with_three_channels(image: Array, reference: Array) -> tuple[Array, Array]:
    """Return both pictures with three channels; gray has equal red, green and blue."""
    if image.shape != reference.shape:
        raise ValueError(f"shapes differ: {image.shape} and {reference.shape}")
    if image.ndim != 3 or image.shape[2] not in (1, 3) or image.size == 0:
        raise ValueError(f"pictures are (rows, columns, 1 or 3), not {image.shape}")
    shape = (*image.shape[:2], 3)
    return np.broadcast_to(image, shape), np.broadcast_to(reference, shape)


def _float_type(*pictures: Array) -> np.dtype:
    """Return float32 where it serves, else float64."""
    double = any(picture.dtype == np.float64 for picture in pictures)
    if double or not all(float(picture.max()) <= SINGLE_PEAK for picture in pictures):
        return np.dtype(np.float64)
    return np.dtype(np.float32)


def _cast(matrix: Array, dtype: np.dtype) -> Array:
    return np.asarray(matrix, dtype)


def _planes(rows: Array, dtype: np.dtype) -> Array:
    """Return a copy (3, rows, columns) of rows (rows, columns, 3)."""
    return np.array(np.moveaxis(rows, 2, 0), dtype, order="C")


def _mix(matrix: Array, planes: Array) -> Array:
    """Return matrix @ planes (3, rows, columns) at every pixel, always summed in the same order."""
    out = np.empty(planes.shape, planes.dtype)
    for mixed, (a, b, c) in zip(out, matrix, strict=True):
        np.multiply(planes[0], a, out=mixed)
        mixed += b * planes[1]
        mixed += c * planes[2]
    return out
