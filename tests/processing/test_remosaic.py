"""A Bayer mosaic made of a quad-Bayer one."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.errors import BadInput
from vcam_cli.processing.base import padded_block
from vcam_cli.processing.guided_interpolation import GuidedInterpolation
from vcam_cli.processing.normalized_convolution import Sites
from vcam_cli.processing.remosaic import BAYER, QUAD, Remosaic

COLORS = ("R", "G", "B")


def sites(pattern, shape) -> np.ndarray:
    """Index of each pixel's color."""
    block = np.array([[COLORS.index(color) for color in row] for row in pattern])
    tiles = [-(-n // size) for n, size in zip(shape, block.shape, strict=True)]
    return np.tile(block, tiles)[: shape[0], : shape[1]]


def remosaiced(mosaic: np.ndarray, start: int = 0, stop: int | None = None, halo: int = 0):
    guided = GuidedInterpolation(QUAD, COLORS, (1.0, 1.0, 1.0), Sites(QUAD, mosaic.shape))
    step = Remosaic(guided, COLORS, len(mosaic))
    stop = len(mosaic) if stop is None else stop
    return step.process_block(padded_block(mosaic, start, stop, step.halo + halo)).planes[0]


def measured(planes: np.ndarray, pattern) -> np.ndarray:
    site = sites(pattern, planes.shape[1:])
    return np.take_along_axis(planes, site[None], axis=0)[0].astype(np.float32)


def test_pixels_of_the_wanted_color_stay():
    """Six of sixteen, in whatever picture."""
    mosaic = np.random.default_rng(0).random((40, 36)).astype(np.float32)
    kept = sites(QUAD, mosaic.shape) == sites(BAYER, mosaic.shape)
    assert kept.mean() == pytest.approx(6 / 16)
    np.testing.assert_array_equal(remosaiced(mosaic)[kept], mosaic[kept])


def test_even_colors_become_an_even_mosaic_up_to_and_beyond_the_border():
    planes = np.ones((3, 32, 40)) * np.array([0.2, 0.7, 0.4])[:, None, None]
    found = remosaiced(measured(planes, QUAD), halo=3)
    mirrored = np.pad(measured(planes, BAYER), ((3, 3), (0, 0)), mode="reflect")
    np.testing.assert_allclose(found, mirrored, rtol=1e-5)  # float32, some hundred terms


def test_a_gray_ramp_is_kept_within_a_share_of_its_step():
    """Gray: every color has the same value, which does not depend on the pattern."""
    ramp = np.broadcast_to(np.linspace(0.2, 0.8, 48), (3, 40, 48))
    error = remosaiced(measured(ramp, QUAD)) - measured(ramp, BAYER)
    step = 0.6 / 47
    assert np.abs(error[8:-8, 8:-8]).max() < 0.5 * step


def test_blocks_are_parts_of_the_whole():
    mosaic = np.random.default_rng(1).random((64, 40)).astype(np.float32)
    whole = remosaiced(mosaic)
    for start in (0, 16, 48):
        np.testing.assert_array_equal(remosaiced(mosaic, start, start + 16), whole[start:][:16])


QUAD_CAMERA = {
    "scene.illuminant": "D65",
    "optics.transmittance": "ir-cut-650",
    "array.pattern": "quad-bayer",
    "scene.radiance": radiance_for(350e3),
    "effects": QUIET,
    "accuracy": "standard",
}
STEPS = [
    {"black_level": "subtract"},
    {"remosaic": "bayer-rggb"},
    {"demosaic": "edge-aware"},
    {"white_balance": "gray-world"},
    {"gamma": "srgb"},
]


def test_a_wall_is_gray_behind_it(tmp_path):
    result = simulate(camera(tmp_path, QUAD_CAMERA | {"processing": STEPS}))
    render = np.asarray(result.render, int)
    assert np.abs(render - render[0, 0, 0]).max() <= 1


def test_the_word_alone_is_the_step(tmp_path):
    made = camera(tmp_path, QUAD_CAMERA | {"processing": ["remosaic", {"demosaic": "bilinear"}]})
    assert made.processing[0].value == "bayer-rggb"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"array.pattern": "bayer-rggb", "processing": STEPS}, "of a quad-bayer one"),
        ({"array.binning": {"rows": 2, "columns": 2}, "processing": STEPS}, "read singly"),
        ({"processing": [STEPS[2], STEPS[1]]}, "remosaic after demosaic"),
        ({"processing": [{"remosaic": "xtrans"}, STEPS[2]]}, "bayer-rggb"),
    ],
)
def test_where_it_cannot_stand(change, said, tmp_path):
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, QUAD_CAMERA | change)
