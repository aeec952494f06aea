"""Curves: readable PNG files, the same bytes for the same numbers, whatever the numbers are."""

import numpy as np
import pytest

from vcam_cli.files.curves import Curve, Mark, Panel, draw

pytestmark = pytest.mark.draws

X = np.linspace(0, 1, 30)
CURVES = (
    Curve("measured", X, X**2, "points", 1),
    Curve("described", X, X**2, "line", 1),
    Curve("", X, X, "dashed", -1),
)


def drawn(path, *panels):
    draw(path, "made", panels)
    return path.read_bytes()


def test_same_numbers_same_bytes(tmp_path):
    panel = Panel("x", "y", CURVES, (Mark(0.5, "half"), Mark(0.7, "more", 2)))
    assert drawn(tmp_path / "a.png", panel) == drawn(tmp_path / "b.png", panel)


def test_other_numbers_other_pictures(tmp_path):
    one = Panel("x", "y", CURVES)
    moved = Panel("x", "y", (Curve("measured", X, X**2 + 0.1, "points", 1), *CURVES[1:]))
    assert drawn(tmp_path / "a.png", one) != drawn(tmp_path / "b.png", moved)


def test_whatever_the_numbers_it_draws(tmp_path):
    """Without a warning: what has no place on the axes is left out."""
    odd = [-X, np.full(30, np.nan), np.full(30, np.inf), np.zeros(30), X[:0]]
    curves = (*(Curve("odd", X[: len(values)], values) for values in odd), *CURVES)
    panels = [Panel("x", "y", curves, log=log) for log in ("", "x", "y", "xy")]
    assert drawn(tmp_path / "a.png", *panels).startswith(b"\x89PNG")
