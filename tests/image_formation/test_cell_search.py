"""Cells of a chart are tried until few are found whose error keeps a budget."""

import math

import pytest

from vcam_cli.image_formation.estimates.cell_search import CellSearch, CellTrial
from vcam_cli.image_formation.estimates.chart_cells import LADDER

MEGAPIXEL = 1 << 20


def falling(power, needed):
    """An error that falls with a power of the cells, to the budget of 1 at those needed."""
    return lambda cells: (needed / cells) ** power


def searched(error, pixels):
    """The search over a ladder, and the cells that were tried."""
    tried = []

    def measure(cells):
        tried.append(cells)
        return CellTrial(cells, error(cells))

    search = CellSearch(measure, 1.0)
    search.try_upward(LADDER[2:])
    search.try_downward(LADDER[:2])
    search.try_between(pixels, LADDER[0])
    assert search.trials == 1 + len(tried)
    return search, tried


@pytest.mark.parametrize("power", [2.0, 2.5, 4.0])
@pytest.mark.parametrize("needed", [0.9, 1.3, 1.7, 2.0, 2.5, 4.0, 9.0])
def test_few_cells_that_keep_the_budget_are_found(needed, power):
    """Of a law of powers they are hardly more than needed, unless that spares little."""
    found, tried = searched(falling(power, needed), 4 * MEGAPIXEL)
    assert found.kept.error <= 1
    least = max(needed, LADDER[0])
    spared = (found.kept.cells**2 - (1.1 * least) ** 2) * 4
    assert found.kept.cells < 1.1 * least or spared < 1
    assert len(tried) <= 6


def test_no_more_is_tried_than_is_spared():
    """A small array keeps the step of the ladder."""
    found, tried = searched(falling(3.0, 1.7), 100_000)
    assert found.kept.cells == 2.2
    assert tried == [2.2, 1.6]


def test_an_error_that_follows_no_law_still_keeps_the_budget():
    """Twice at most are cells tried between two numbers."""
    search, tried = searched(lambda cells: 0.5 if cells >= 2.2 else 1.1, 4 * MEGAPIXEL)
    assert search.kept == CellTrial(2.2, 0.5)
    assert len(tried) == 4


def test_what_no_cells_keep_is_told():
    """The last trial is left, from which more cells than any tried are reckoned."""
    found, tried = searched(falling(1.0, 1000.0), MEGAPIXEL)
    assert found.kept is None
    assert found.failed.cells == max(tried)
    assert math.isclose(found.failed.error_of(1000.0, 1.0), 1.0)
