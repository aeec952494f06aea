"""S-CIELAB: maps of two other programs, brute force, and what a blur must and must not do."""

import itertools
import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from making import long_except
from scipy.integrate import quad

from vcam_cli import memory
from vcam_cli.errors import CannotDo
from vcam_cli.quality import scielab
from vcam_cli.quality.display import D65, Screen, rgb_to_xyz
from vcam_cli.quality.eye import GAUSSIANS, OPPONENT, kernels
from vcam_cli.quality.scielab import cielab_map, s_cielab_map

RESULTS = json.loads((Path(__file__).parent.parent / "data" / "scielab.json").read_text())[
    "results"
]
READINGS = ("zhang-wandell-1996", "isetcam", "continuous")


def screen(samples_per_degree: float = 23.0) -> Screen:
    return Screen(np.diag(D65), samples_per_degree)


def pictures(case: str, size: int, samples_per_degree: float) -> tuple[np.ndarray, np.ndarray]:
    """The two pictures of a case, (size, size, 3) X/Xn, Y/Yn, Z/Zn."""
    name, _, frequency = case.partition(":")
    one = np.ones((size, size))
    wave = np.cos(2 * np.pi * float(frequency or 0) * np.arange(size) / samples_per_degree) * one
    planes = {
        "gray": ((0.20 * one,) * 3, (0.22 * one,) * 3),
        "color": ((0.20 * one,) * 3, (0.21 * one, 0.20 * one, 0.18 * one)),
        "grat": ((0.3 * (1 + 0.5 * wave),) * 3, (0.3 * (1 + 0.45 * wave),) * 3),
        "gratflat": ((0.3 * (1 + 0.5 * wave),) * 3, (0.3 * one,) * 3),
        "rg": ((0.3 * (1 + 0.1 * wave), 0.3 * one, 0.3 * one), (0.3 * one,) * 3),
        "by": ((0.3 * one, 0.3 * one, 0.3 * (1 + 0.5 * wave)), (0.3 * one,) * 3),
    }[name]
    first, second = (np.stack(three, axis=-1) for three in planes)
    return first, second


@pytest.mark.parametrize(
    "result", RESULTS, ids=lambda r: f"{r['filters'][:4]}-{r['case']}-{r['samples_per_degree']}"
)
def test_maps_of_other_programs(result: dict) -> None:
    """ISETCam's pixels to rounding; the 1996 code's to the 0.8 % that its sums are off."""
    degree = result["samples_per_degree"]
    first, second = pictures(result["case"], result["size"], degree)
    if result["delta_e"] == "1994":  # weighted there by the first
        first, second = second, first
    found = s_cielab_map(first, second, screen(degree), result["filters"], result["delta_e"])
    tolerance = 1e-7 if result["filters"] == "isetcam" else 9e-3
    for place, expected in result["pixels"].items():
        row, column = map(int, place.split(","))
        assert found[row, column] == pytest.approx(expected, rel=tolerance), place


def blurred(picture: np.ndarray, filters: str, degree: float) -> np.ndarray:
    """Brute force: whole 2-D kernels, tap by tap, over a picture mirrored as often as needed."""
    opponent = np.array(OPPONENT[filters])
    seen = np.zeros_like(picture)
    rows, columns = picture.shape[:2]
    planes = picture * D65 @ opponent.T
    for plane, kernel in enumerate(kernels(filters, degree)):
        reach = kernel.reach
        wide = np.pad(planes[:, :, plane], reach, mode="symmetric")
        whole = sum(
            w * np.outer(taps, taps) for w, taps in zip(kernel.weights, kernel.taps, strict=True)
        )
        for (i, j), tap in np.ndenumerate(whole):
            seen[:, :, plane] += tap * wide[i : i + rows, j : j + columns]
    return seen @ np.linalg.inv(opponent).T / D65


@pytest.mark.parametrize("filters", READINGS[:2])  # the third: coarse pixels, below
@pytest.mark.parametrize(
    ("shape", "degree"), [((31, 37), 10.0), ((5, 23), 16.6), ((1, 1), 23.0), ((3, 4), 23.0)]
)
def test_brute_force(filters: str, shape: tuple[int, int], degree: float) -> None:
    """Borders, lengths that are no good for transforms, filters larger than the picture."""
    rng = np.random.default_rng(1)
    one, other = rng.random((2, *shape, 3))
    expected = cielab_map(
        blurred(one, filters, degree), blurred(other, filters, degree), screen(degree)
    )
    found = s_cielab_map(one, other, screen(degree), filters)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


FIELDS = list(itertools.product((0.7, 3.0, 22.62, 224.0, 500.3), READINGS))
FINEST = 0.7, "continuous"
"""Where the widest filters have the most samples: a second, for the sum of their taps."""


@pytest.mark.parametrize(
    ("degree", "filters"),
    long_except([field for field in FIELDS if field != FINEST], FIELDS, several=True),
)
def test_uniform_fields_have_the_delta_e_of_cielab(filters: str, degree: float) -> None:
    one, other = np.full((40, 53, 3), (0.2, 0.3, 0.1)), np.full((40, 53, 3), (0.22, 0.29, 0.1))
    found = s_cielab_map(one, other, screen(degree), filters)
    expected = cielab_map(one, other, screen(degree))
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("filters", READINGS[:2])  # the third looks within the pixel
def test_a_blurring_eye_is_the_unblurred_one_where_a_degree_is_a_pixel(filters: str) -> None:
    one, other = np.random.default_rng(2).random((2, 20, 30, 3))
    found = s_cielab_map(one, other, screen(1.0), filters)
    np.testing.assert_allclose(found, cielab_map(one, other, screen(1.0)), rtol=1e-9)


@pytest.mark.parametrize("filters", READINGS)
def test_nothing_shifts(filters: str) -> None:
    """A mirrored pair has the mirrored map; a dot's map is symmetric about the dot."""
    one, other = np.random.default_rng(3).random((2, 48, 61, 3))
    found = s_cielab_map(one, other, screen(), filters)
    turned = s_cielab_map(one[::-1, ::-1], other[::-1, ::-1], screen(), filters)
    np.testing.assert_allclose(turned[::-1, ::-1], found, rtol=1e-9, atol=1e-9)
    flat = np.full((50, 64, 3), 0.2)
    dot = flat.copy()
    dot[20, 30] = 0.8
    found = s_cielab_map(dot, flat, screen(), filters)
    assert np.unravel_index(found.argmax(), found.shape) == (20, 30)
    around = found[20 - 9 : 20 + 10, 30 - 9 : 30 + 10]
    np.testing.assert_allclose(around, around.T, rtol=1e-9)
    np.testing.assert_allclose(around, around[::-1, ::-1], rtol=1e-9)


@pytest.mark.parametrize("filters", READINGS)
def test_detail_too_fine_is_not_seen(filters: str) -> None:
    rows, columns = np.indices((90, 90))
    board = np.where((rows + columns) % 2, 0.4, 0.6)[..., None]
    flat = np.full((90, 90, 1), 0.5)
    assert cielab_map(board, flat, screen(60)).mean() > 5
    assert s_cielab_map(board, flat, screen(60), filters).mean() < 0.1


@pytest.mark.parametrize("workers", [2, 5])
def test_blocks_and_workers_do_not_show(monkeypatch, workers: int) -> None:
    one, other = np.random.default_rng(4).random((2, 137, 41, 3))
    whole = s_cielab_map(one, other, screen(9))
    assert scielab._block_and_halo(137, 41, 5) == (137, 0)
    monkeypatch.setattr(scielab, "BLOCK_ROWS", 16)
    assert scielab._block_and_halo(137, 41, 5) == (16, 5)  # nine blocks, the last of nine rows
    in_blocks = s_cielab_map(one, other, screen(9), workers=1)
    np.testing.assert_allclose(in_blocks, whole, rtol=1e-9, atol=1e-9)
    shared = s_cielab_map(one, other, screen(9), workers=workers)
    assert shared.tobytes() == in_blocks.tobytes()
    plain = [cielab_map(one, other, screen(), workers=w).tobytes() for w in (1, workers)]
    assert plain[0] == plain[1]


def test_black_equal_and_gray_pictures() -> None:
    black = np.zeros((30, 20, 3), np.float32)
    assert not s_cielab_map(black, black, screen()).any()
    noise = np.random.default_rng(5).random((30, 20, 3), np.float32)
    assert not s_cielab_map(noise, noise.copy(), screen()).any()
    assert np.isfinite(s_cielab_map(noise, black, screen())).all()
    gray = noise[:, :, :1]
    same = s_cielab_map(np.repeat(gray, 3, axis=2), black, screen())
    np.testing.assert_array_equal(s_cielab_map(gray, black[:, :, :1], screen()), same)


def test_float32_serves_and_what_is_bright_gets_more() -> None:
    one, other = np.random.default_rng(6).random((2, 64, 64, 3))
    crt = Screen(rgb_to_xyz("crt-brainard"), 30.0)
    single = s_cielab_map(one.astype(np.float32), other.astype(np.float32), crt)
    assert single.dtype == np.float32
    # transforms err by 5e-7 of white: 500 times that in a*, more in the shadows
    np.testing.assert_allclose(single, s_cielab_map(one, other, crt), atol=5e-3)
    one[0, 0] = 1e4
    bright = s_cielab_map(one.astype(np.float32), other.astype(np.float32), crt)
    assert bright.dtype == np.float64


def test_a_kernel_has_the_sum_one_and_the_stated_widths() -> None:
    """The light-dark plane's first Gaussian: half maximum at half of, and at, its spread."""
    fine = 2000.0
    for filters, part in (("zhang-wandell-1996", 0.5), ("isetcam", 1.0), ("continuous", 0.5)):
        planes = kernels(filters, fine)
        for kernel in planes:
            assert kernel.weights @ kernel.taps.sum(axis=1) ** 2 == pytest.approx(1, abs=1e-14)
            np.testing.assert_array_equal(kernel.taps, kernel.taps[:, ::-1])
        taps = planes[0].taps[0]
        half = round(GAUSSIANS[0][0][0] * fine * part)
        middle = taps.size // 2
        # the 1996 width is one sample less: 1 % of 100 samples
        assert taps[middle + half] / taps[middle] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("degree", [0.9, 8.1, 14.0, 22.62])
def test_continuous_kernels_are_integrals(degree: float) -> None:
    """Of Gaussians, cut to a degree, over each pixel."""
    for plane, kernel in zip(GAUSSIANS, kernels("continuous", degree), strict=True):
        for (spread, _), taps in zip(plane, kernel.taps, strict=True):
            edges = (np.arange(-kernel.reach, kernel.reach + 2) - 0.5) / degree
            edges = np.clip(edges, -0.5, 0.5)
            parts = [
                quad(lambda x, s=spread: 2 ** (-4 * (x / s) ** 2), low, high, epsabs=1e-13)[0]
                for low, high in itertools.pairwise(edges)
            ]
            np.testing.assert_allclose(taps, np.array(parts) / sum(parts), atol=1e-11)


@pytest.mark.parametrize("shape", [(9, 7), (300, 5), (1, 1)])
@pytest.mark.parametrize("degree", [3.0, 11.0, 40.0])
def test_coarse_pixels_are_squares_of_light(shape: tuple[int, int], degree: float) -> None:
    """The same as the mean over as many finer pixels of the same light, in blocks of rows too."""
    one, other = np.random.default_rng(4).random((2, *shape, 3))
    n = math.ceil(scielab.MIN_SAMPLES_PER_DEGREE / degree)
    finer = [x.repeat(n, axis=0).repeat(n, axis=1) for x in (one, other)]
    expected = s_cielab_map(*finer, screen(degree * n), "continuous")
    expected = expected.reshape(shape[0], n, shape[1], n).mean(axis=(1, 3))
    found = s_cielab_map(one, other, screen(degree), "continuous")
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("degree", [1 / 2, 1 / 4])
def test_pixels_of_more_than_a_degree_are_squares_of_light(degree: float) -> None:
    """Exactly the mean over so many finer pixels that 33 are a degree."""
    one, other = np.random.default_rng(4).random((2, 2, 3, 3))
    n = round(33 / degree)
    finer = [x.repeat(n, axis=0).repeat(n, axis=1) for x in (one, other)]
    expected = s_cielab_map(*finer, screen(degree * n), "continuous")
    expected = expected.reshape(2, n, 3, n).mean(axis=(1, 3))
    found = s_cielab_map(one, other, screen(degree), "continuous")
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("filters", READINGS)
def test_of_the_coarsest_pixels_each_is_judged_alone(filters: str) -> None:
    """Those of a million degrees look like CIELAB, but for a millionth of their width."""
    one, other = np.random.default_rng(5).random((2, 3, 4, 3))
    found = s_cielab_map(one, other, screen(1e-6), filters)
    alone = cielab_map(one, other, screen(1e-6))
    np.testing.assert_allclose(found, alone, rtol=1e-4)


@pytest.mark.parametrize(
    ("degree", "filters"),
    [
        pytest.param(
            *(degree, filters),
            marks=pytest.mark.long if degree == 1e6 and filters != "isetcam" else (),
        )
        for degree in (1e-44, 1e-3, 0.3, 1.0, 7.0, 40.0, 1e4, 1e6)
        for filters in READINGS
    ],
)
def test_memory_is_bounded_and_known(filters: str, degree: float) -> None:
    """However few or many pixels are a degree, 16 x 18 of them take some megabytes."""
    one, other = np.random.default_rng(6).random((2, 16, 18, 3), np.float32)
    foretold = scielab.needed_bytes((16, 18), screen(degree), filters, 1)
    assert foretold < 64e6
    tracemalloc.start()
    s_cielab_map(one, other, screen(degree), filters, workers=1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Kernels are not in it: three Gaussians, their folding, at most a degree of taps.
    assert peak < foretold + 2e6 + 200 * degree


def test_memory_that_does_not_suffice(monkeypatch) -> None:
    """Fewer threads where some suffice, and else an error before the work."""
    one, other = np.random.default_rng(6).random((2, 40, 30, 3))
    whole = s_cielab_map(one, other, screen(1), "continuous", workers=4)
    places = scielab._Places.prepare((40, 30), screen(1), "continuous")
    single = places.needed_bytes(np.dtype(float), 1)
    monkeypatch.setattr(memory, "available", lambda: single + 1)
    assert places.require_memory(np.dtype(float), 4) == 1
    fewer = s_cielab_map(one, other, screen(1), "continuous", workers=4)
    assert fewer.tobytes() == whole.tobytes()
    monkeypatch.setattr(memory, "available", lambda: single - 1)
    with pytest.raises(CannotDo, match="memory"):
        s_cielab_map(one, other, screen(1), "continuous", workers=4)


def test_continuous_kernels_are_continuous_in_the_size_of_pixels() -> None:
    """Where another pixel comes into a degree: the others jump by 1e-2 and more there."""
    for edge in (13.0, 15.0, 21.0):
        below, above = (kernels("continuous", edge + step) for step in (-1e-9, 1e-9))
        for one, other in zip(below, above, strict=True):
            # The next pixel comes in where a degree ends, with next to nothing.
            outer = (other.taps.shape[1] - one.taps.shape[1]) // 2
            padded = np.pad(one.taps, ((0, 0), (outer, outer)))
            np.testing.assert_allclose(padded, other.taps, atol=1e-8)


def test_what_cannot_be_compared() -> None:
    one = np.zeros((4, 5, 3))
    for shape in ((4, 6, 3), (4, 5, 1)):
        with pytest.raises(ValueError, match="shapes differ"):
            s_cielab_map(one, np.zeros(shape), screen())
    for shape in ((4, 5), (4, 5, 2), (0, 5, 3)):
        with pytest.raises(ValueError, match="pictures are"):
            cielab_map(np.zeros(shape), np.zeros(shape), screen())
    with pytest.raises(ValueError, match="filters"):
        s_cielab_map(one, one, screen(), "zhang")
    with pytest.raises(ValueError, match="formula"):
        s_cielab_map(one, one, screen(), formula="76")
