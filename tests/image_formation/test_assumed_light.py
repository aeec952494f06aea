"""How bright a color is assumed to be before the light of a picture is formed."""

import numpy as np
import pytest
from optical_paths import of_picture

from vcam_cli.simulation import scene_light

LEVEL = np.array([[3.0, 0.0], [1.0, 2.0]])
"""Signal of two channels in two colors [e/s]: 4 and 2 where both are 1."""


@pytest.mark.parametrize(
    ("left", "right", "share"),
    [
        ((1, 1), (0, 0), 1.0),
        ((1, 0), (0, 1), 0.75),
        ((0, 1), (0, 0.5), 0.5),
        ((0.5, 0.25), (0, 0), 0.875),
        ((0, 0), (0, 0), 1.0),
    ],
)
def test_a_color_has_what_channels_give_in_one_place(left, right, share):
    picture = np.zeros((70, 140, 2))
    picture[:, :70], picture[:, 70:] = left, right
    assert scene_light._share_of_white(of_picture(picture, 1e-6), LEVEL) == pytest.approx(share)
    assert scene_light._share_of_white(of_picture(picture[:, :, :1], 1e-6), LEVEL[:1]) == 1
