"""Blocks of short rows are drawn together, with the numbers that each has alone."""

import numpy as np
import pytest

from vcam_cli import load, simulate
from vcam_cli.readout import exposure, several_readouts
from vcam_cli.rng import BLOCK_ROWS, blocks, coarse_normals, stream, streams

ROWS, COLUMNS = 150, 3
NOISY = ("array.rows=150", "array.columns=4", "effects=all", "processing=[]", "output.render=none")


@pytest.mark.parametrize(
    "draw",
    [
        lambda s, rows: s.standard_normal((rows, COLUMNS), dtype=np.float32),
        lambda s, rows: s.standard_normal((rows, 1), dtype=np.float64),
        lambda s, rows: s.random((rows, COLUMNS)),
        lambda s, rows: s.standard_exponential((rows, COLUMNS)),
        lambda s, rows: coarse_normals(s, rows, COLUMNS, np.float32),
    ],
)
def test_every_block_goes_on_where_it_stopped(draw):
    """Two draws of three blocks, the second from where the first has left each block."""
    together = streams(7, "noise", 2, 5, ROWS)
    alone = [stream(7, "noise", 2, 5 + number) for number in range(3)]
    for _ in range(2):
        found = draw(together, ROWS)
        parts = [draw(s, b.stop - b.start) for s, b in zip(alone, blocks(ROWS), strict=True)]
        assert found.dtype == parts[0].dtype
        np.testing.assert_array_equal(found, np.concatenate(parts))


def test_one_block_has_a_generator_of_its_own():
    assert isinstance(streams(1, "noise", rows=BLOCK_ROWS), np.random.Generator)


@pytest.mark.parametrize(
    ("name", "accuracy"),
    [("kac-12040", "draft"), ("split-pixel", "0.1 %"), ("hdr-captures", "draft")],
)
def test_bytes_are_those_of_block_by_block(name, accuracy, monkeypatch):
    """With all noise, of pixels that are read once, twice, or several times in an integration."""
    camera = load(name, [*NOISY, f"accuracy={accuracy}"])
    together = simulate(camera, 1).frame
    for module in (exposure, several_readouts):
        monkeypatch.setattr(module, "AT_ONCE", 40)  # ten rows of four pixels
    alone = simulate(camera, 1).frame
    assert len(exposure.runs_of_rows(together.rate)) == 3
    np.testing.assert_array_equal(together.dn, alone.dn)
    np.testing.assert_array_equal(together.electrons, alone.electrons)
