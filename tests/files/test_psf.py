"""Point spread functions from files: every kind to planes of sum 1, everything else refused."""

import numpy as np
import OpenImageIO as oiio
import pytest

from vcam_cli.errors import BadInput
from vcam_cli.files.images.psf import read_psf

PATH = ("optics", "psf", "file")
SPOT = np.array([[0, 1, 0], [2, 4, 1], [0, 1, 1]], np.float32)[..., None]


def write(path, data, names=None):
    height, width, channels = data.shape
    kind = {"float32": "float"}.get(str(data.dtype), str(data.dtype))
    spec = oiio.ImageSpec(width, height, channels, kind)
    if names:
        spec.channelnames = names
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(data))
    assert output.close()
    return path


def refused(path, words, channels=1):
    with pytest.raises(BadInput, match=words) as caught:
        read_psf(path, channels, PATH)
    (problem,) = caught.value.problems
    assert problem.path == PATH
    assert problem.remedy
    assert path.name in problem.message


@pytest.mark.parametrize("kind", ["exr", "tif"])
def test_is_scaled_to_the_sum_one(tmp_path, kind):
    found = read_psf(write(tmp_path / f"p.{kind}", 3e30 * SPOT), 1, PATH)
    assert found.shape == (1, 3, 3)
    assert found.dtype == np.float64
    # stored as 32 bits
    np.testing.assert_allclose(found[0], SPOT[..., 0] / 10, rtol=1e-6)
    assert found.sum() == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_integers_are_light(tmp_path, kind):
    found = read_psf(write(tmp_path / "p.png", (20 * SPOT).astype(kind)), 1, PATH)
    np.testing.assert_allclose(10 * found[0], SPOT[..., 0], rtol=1e-12)


def test_every_channel_on_its_own(tmp_path):
    data = np.concatenate([SPOT, 5 * SPOT[::-1]], axis=2)
    found = read_psf(write(tmp_path / "p.exr", data, ("450nm", "650nm")), 2, PATH)
    np.testing.assert_allclose(found[0], SPOT[..., 0] / 10, rtol=1e-6)
    np.testing.assert_allclose(found[1], SPOT[::-1, :, 0] / 10, rtol=1e-6)


def test_the_rounding_of_a_lens_program_is_nothing(tmp_path):
    data = SPOT.copy()
    data[0, 0] = -1e-4
    found = read_psf(write(tmp_path / "p.exr", data), 1, PATH)
    assert found[0, 0, 0] == 0
    assert found.sum() == pytest.approx(1, rel=1e-12)


def test_refuses_what_is_no_point_spread(tmp_path):
    wrong = SPOT.copy()
    wrong[0, 2] = -0.5
    refused(write(tmp_path / "a.exr", wrong), r"negative value \(-0.5 at row 0, column 2\)")
    wrong[0, 2] = np.nan
    refused(write(tmp_path / "b.exr", wrong), "not finite")
    wrong[0, 2] = np.inf
    refused(write(tmp_path / "c.exr", wrong), "not finite")
    refused(write(tmp_path / "d.exr", 0 * SPOT), "zero everywhere")
    refused(write(tmp_path / "e.exr", -SPOT), "negative value")
    three = np.repeat(SPOT, 3, axis=2)
    refused(write(tmp_path / "f.exr", three), "has 3 channels, where one")
    refused(write(tmp_path / "g.exr", three), "has 3 channels, but psf.wavelengths lists 2", 2)


def test_refuses_what_is_no_image(tmp_path):
    refused(tmp_path / "none.exr", "no such file")
    (tmp_path / "text.exr").write_text("hello")
    refused(tmp_path / "text.exr", "as an image")
    (tmp_path / "empty.exr").touch()
    refused(tmp_path / "empty.exr", "empty")
    refused(tmp_path, "folder")
    whole = write(tmp_path / "whole.png", (20 * np.tile(SPOT, (40, 40, 1))).astype(np.uint16))
    (tmp_path / "cut.png").write_bytes(whole.read_bytes()[:-30])
    refused(tmp_path / "cut.png", "truncated|damaged")
