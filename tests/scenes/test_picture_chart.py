"""Pictures as charts: averages over cells of any size."""

import numpy as np
import pytest

from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.picture_chart import PictureChart


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-15])
def test_a_cell_wider_than_the_picture_has_its_share_of_it(size: float) -> None:
    """In closed form: the mean of the picture times the part of the cell that it fills."""
    picture = np.arange(12, dtype=float).reshape(3, 4, 1)
    out = np.zeros((1, 1, 3))
    edges = np.array([-6.0, -2.0, 2.0, 6.0])
    PictureChart(picture, Frame(size, size), False).paint(edges, edges[1:3], np.ones((1, 1)), out)
    assert out[0, 0] == pytest.approx([0, picture.mean() * size**2 / 16, 0], rel=1e-9)
