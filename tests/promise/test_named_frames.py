"""Frames that once broke the promise, against truths of their own."""

import frames
import pytest


@pytest.mark.parametrize(
    "name",
    [
        "a lit sample cut off above black",  # 14 T at draft: its tail was cut off with it
        "a star of three spokes, 8 x 8",  # 2.2 T at reference: one edge lies along the columns
    ],
)
def test_a_frame_keeps_every_tolerance(name, tmp_path):
    found = frames.measure("named", name, tmp_path)
    assert not found.misses, found.text
