"""Streams: equal keys give equal numbers, different keys do not, blocks cover the array."""

import hashlib

import numpy as np
import pytest
from making import camera

from vcam_cli import rng, simulate
from vcam_cli.rng import BLOCK_ROWS, KeptNormals, blocks, coarse_normals, stream, streams
from vcam_cli.simulation.shared import Shared


@pytest.mark.parametrize("block", [0, 3, 1 << 40])
def test_a_stream_is_philox_of_its_key(block):
    """As NumPy opens it, key and counter handed in."""
    digest = hashlib.blake2b(b"vcam 7 read_noise 2", digest_size=16).digest()
    key = int.from_bytes(digest, "little")
    plain = np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, block]))
    found = stream(7, "read_noise", 2, block)
    assert np.array_equal(found.standard_normal(100), plain.standard_normal(100))
    assert found.integers(2**63) == plain.integers(2**63)


def test_equal_keys_give_equal_numbers():
    a = stream(3, "shot_noise", capture=1, block=7).standard_normal(100)
    b = stream(3, "shot_noise", capture=1, block=7).standard_normal(100)
    assert np.array_equal(a, b)


@pytest.mark.parametrize(
    "other",
    [
        (4, "shot_noise", 1, 7),
        (3, "read_noise", 1, 7),
        (3, "shot_noise", 2, 7),
        (3, "shot_noise", 1, 8),
    ],
)
def test_every_part_of_the_key_counts(other):
    a = stream(3, "shot_noise", 1, 7).standard_normal(1000)
    b = stream(*other).standard_normal(1000)
    # Independent: correlation within 5 standard errors of zero, and no shared number.
    assert abs(np.corrcoef(a, b)[0, 1]) < 5 / np.sqrt(1000)
    assert not np.isin(a, b).any()


def test_neighboring_blocks_do_not_overlap():
    # A block's counter starts 2^192 steps from its neighbor's: no finite frame reaches it.
    a = stream(1, "x", block=0).bit_generator.random_raw(20_000)
    b = stream(1, "x", block=1).bit_generator.random_raw(20_000)
    assert not np.isin(a, b).any()


@pytest.mark.parametrize("rows", [5, 150])
def test_kept_normals_are_those_of_the_stream(rows):
    """Drawn together or in parts, again or for the first time, and whatever becomes of them."""
    parts = (2, 3) if rows == 5 else (rows,)
    for dtype in (np.float32, np.float64):
        wanted = streams(3, "fpn", 0, 7, rows).standard_normal((rows, 9), dtype=dtype)
        for _ in range(2):
            kept = KeptNormals(3, "fpn", 0, 7, rows)
            drawn = [kept.standard_normal((part, 9), dtype) for part in parts]
            assert np.concatenate(drawn).tobytes() == wanted.tobytes()
            for block in drawn:
                block *= 0
    other = KeptNormals(4, "fpn", 0, 7, rows).standard_normal((rows, 9), np.float32)
    assert not np.isin(other, wanted).any()
    chances = KeptNormals(3, "fpn", 0, 7, rows).random((rows, 9))
    assert np.array_equal(chances, streams(3, "fpn", 0, 7, rows).random((rows, 9)))


def test_normals_of_a_frame_are_drawn_once_per_sensor(tmp_path, monkeypatch):
    """Frames of one sensor share the numbers of its fixed pattern, and those alone."""
    drawn = []
    true = rng.streams
    monkeypatch.setattr(rng, "streams", lambda *key: drawn.append(key[:2]) or true(*key))
    rng._NORMALS.clear()
    strengths = {"offset_pixel": "3 e", "gain_pixel": "1 %"}
    for frame in range(3):
        made = camera(tmp_path, {"pixel.fpn": strengths, "seed": {"sensor": 5, "frame": frame}})
        simulate(made, 1, shared=Shared())
    assert sorted(drawn) == [(5, "fpn gain pixel"), (5, "fpn offset pixel")]


@pytest.mark.parametrize("rows", [1, BLOCK_ROWS - 1, BLOCK_ROWS, BLOCK_ROWS + 1, 1000])
def test_blocks_cover_every_row_once(rows):
    covered = np.concatenate([np.arange(rows)[b] for b in blocks(rows)])
    assert np.array_equal(covered, np.arange(rows))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_coarse_normals_have_the_moments_of_a_normal_number(dtype):
    """Over all of their values: the variance is 1 by construction, and tails end at 4.3 sigma."""
    drawn = coarse_normals(_EveryValue(), 64, 1024, dtype).astype(float)
    assert len(np.unique(drawn)) == 1 << 16
    mean, variance, third, fourth = (np.mean(drawn**power) for power in (1, 2, 3, 4))
    # Rounding to 32 bits, of values that are symmetric about 0.
    assert abs(mean) < 1e-7
    assert abs(third) < 1e-6
    assert abs(variance - 1) < 1e-7
    assert abs(fourth / 3 - 1) < 1e-3  # what lies beyond the last value adds 6e-4 to it
    assert 4.2 < drawn.max() < 4.4


class _EveryValue:
    """A generator whose bits are each number of 16 bits once."""

    bit_generator = property(lambda self: self)

    def random_raw(self, count):
        return np.arange(1 << 16, dtype="<u2").view("<u8")[:count]


def test_rows_of_coarse_normals_do_not_depend_on_how_many_are_drawn():
    """A single exposure draws some rows at a time, and samples of an integration all."""
    one, other = stream(3, "shot_noise"), stream(3, "shot_noise")
    whole = coarse_normals(one, 5, 7, np.float32)  # rows that end within a word of 64 bits
    parts = [coarse_normals(other, rows, 7, np.float32) for rows in (2, 3)]
    assert np.array_equal(whole, np.concatenate(parts))
    flat = coarse_normals(one, 500, 400, np.float32).ravel()
    # Neighbors, which share words: 5 standard errors of a correlation of independent numbers.
    lags = [np.mean(flat[lag:] * flat[:-lag]) for lag in range(1, 9)]
    assert np.abs(lags).max() < 5 / np.sqrt(flat.size)
