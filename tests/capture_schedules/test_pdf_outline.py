"""The outline of a pdf that is drawn: the pixels of the pdf, and no comb that is not in them."""

import numpy as np
import pytest

from vcam_cli.capture_schedules.pdf_plots import DISPLAYED, outline
from vcam_cli.scheduling.pdf import Pdf

CODES = np.arange(1.0, 4097)
SMOOTH = {
    "codes of 8 bits": Pdf.levels(CODES[:255], np.ones(255)),
    "codes of 12 bits": Pdf.levels(CODES, np.ones(4096)),
    "a picture stretched by 1.4": Pdf.levels(np.unique(CODES[:255] * 7 // 5), np.ones(255)),
    "its histogram": Pdf.histogram(np.arange(358.0), np.tile([1, 1, 0, 1, 1, 1, 0], 51)),
    "a histogram that lacks every fourth code": Pdf.histogram(
        np.arange(1025.0), np.tile([1, 1, 1, 0], 256)
    ),
}
"""Photocurrents that are evenly spread, but for the codes that hold them."""


def drawn(pdf, wide):
    low = max(pdf.min, 1e-6 * pdf.max) if wide else 0.0
    x, y = outline(pdf, low, wide)
    return (np.log10(x) if wide else x), y


@pytest.mark.parametrize("wide", [False, True], ids=["linear", "per decade"])
@pytest.mark.parametrize("pdf", SMOOTH.values(), ids=SMOOTH)
def test_the_area_is_all_pixels(pdf, wide):
    x, y = drawn(pdf, wide)
    assert np.trapezoid(y, x) == pytest.approx(1, rel=1e-9)
    assert len(x) <= 2 * DISPLAYED + 4
    assert (np.diff(x) >= 0).all()


@pytest.mark.parametrize("pdf", SMOOTH.values(), ids=SMOOTH)
def test_even_light_is_drawn_even(pdf):
    """No bin has half of its neighbors' density, or twice: 2 codes of 3 is the worst there can be.

    The bins at both ends hold half a neighborhood more or less.
    """
    _, y = drawn(pdf, wide=False)
    tops = y[1:-1:2][2:-2]
    assert tops.max() / tops.min() <= 1.5


def test_equal_ratios_are_even_per_decade():
    _, y = drawn(Pdf.levels(np.geomspace(1, 1e6, 3000), np.ones(3000)), wide=True)
    tops = y[1:-1:2][2:-2]
    # 13 levels in one bin and 14 in the next are even, for bins end where neighborhoods do
    np.testing.assert_allclose(tops, 1 / 6, rtol=1e-3)


def test_wide_gaps_stay_empty():
    two = np.concatenate([CODES[:100], 9000 + CODES[:100]])
    x, y = drawn(Pdf.levels(two, np.ones(200)), wide=False)
    gap = int(np.argmax(np.diff(x)))
    assert x[gap + 1] - x[gap] > 8500
    assert y[gap] == y[gap + 1] == 0
