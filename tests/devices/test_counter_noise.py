"""Random numbers by counters: known words, statistics, and independence of batches."""

import numpy as np
import pytest
from scipy.special import ndtri

from tests.gpu.noise_statistics import generator, sources, worst
from vcam_cli.devices import counter_noise
from vcam_cli.devices.choice import open_device
from vcam_cli.devices.processor import Processor, require
from vcam_cli.errors import CannotDo


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ([0, 0, 0, 0], [0, 0], [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
        (
            [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
            [0xA4093822, 0x299F31D0],
            [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
        ),
    ],
)
def test_the_generator_is_philox(counter, key, expected):
    """The known answers of Random123, the authors' own library."""
    words = [np.array([[word]], np.uint32) for word in counter]
    keys = [np.array([[word]], np.uint32) for word in key]
    assert [int(word[0, 0]) for word in counter_noise.philox(words, keys)] == expected


def test_normal_numbers_are_quantiles():
    word = np.concatenate(
        [
            np.arange(2000, dtype=np.uint32),
            np.linspace(0, 2**31 - 1, 100_000).astype(np.uint32),
        ]
    )
    exact = ndtri((word.astype(float) + 0.5) / 2**32)
    for sign, words in ((1, word), (-1, word | np.uint32(1 << 31))):
        found = counter_noise.normals(words)
        assert found.dtype == np.float32
        assert np.abs(found / (sign * exact) - 1).max() < 1e-6
        upper = counter_noise.uniforms(words)
        assert np.allclose(upper, 1 - (word + 0.5) / 2**32 if sign > 0 else (word + 0.5) / 2**32)


def test_statistics_of_the_generator():
    found, beyond = worst(generator(Processor(), 6, 96))
    assert not beyond
    assert len(found) > 90


def test_statistics_of_every_source():
    found, beyond = worst(sources(Processor(), 8, 96))
    assert not beyond
    assert {"read_noise", "telegraph_noise", "heavy_tailed_noise", "shot_noise"} <= {
        what.split()[1] for what, _ in found
    }


def test_a_frame_does_not_depend_on_its_batch():
    device, seeds = Processor(), [5, 2**63, 2**64 + 3]
    together = device.normals(device.keys(seeds), "read_noise", 1, 1001, np.float32)
    for seed, expected in zip(seeds, together, strict=True):
        alone = device.normals(device.keys([seed]), "read_noise", 1, 1001, np.float32)
        assert (alone[0] == expected).all()


def test_seeds_beyond_64_bits_are_hashed():
    assert counter_noise.seed_key(7) == 7
    assert counter_noise.seed_key(2**64) != counter_noise.seed_key(0)


def test_a_device_needs_its_name_and_memory():
    with pytest.raises(ValueError, match="write one of cpu, gpu"):
        open_device("tpu")
    with pytest.raises(CannotDo, match="4 frames need about 1e\\+09 GB"):
        require(Processor(), 10**18, "4 frames")


def test_smaller_batches_are_a_remedy_of_batches_alone():
    with pytest.raises(CannotDo) as single:
        require(Processor(), 10**18, "2 x 3 pixels")
    with pytest.raises(CannotDo) as several:
        require(Processor(), 10**18, "4 frames", "smaller batches, ")
    assert str(single.value).endswith("use fewer pixels (array), or --device cpu")
    assert str(several.value).endswith("use smaller batches, fewer pixels (array), or --device cpu")
