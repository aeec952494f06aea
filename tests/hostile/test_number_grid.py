"""Every number of every shipped camera, at its limits, at 0, a million times more and less."""

from pathlib import Path

import pytest
from number_grid import cases, outcome

from vcam_cli.config import shipped

STRIDE = 7919
"""A prime: cases of the quick slice are that far apart in the lists of successive cameras."""


def wrong(chosen, folder: Path) -> list[str]:
    found = ((case, *outcome(case, folder)) for case in chosen)
    return [f"{case}: {said}" for case, end, said in found if end == "bug"]


def test_a_slice_of_the_grid(tmp_path) -> None:
    """One case of every fifth camera, and most of other keys."""
    every = map(cases, shipped.names("cameras")[::5])
    chosen = [found[number * STRIDE % len(found)] for number, found in enumerate(every)]
    assert len({case.path for case in chosen}) > len(chosen) / 2
    assert wrong(chosen, tmp_path) == []


@pytest.mark.long
@pytest.mark.parametrize("name", shipped.names("cameras"))
def test_the_whole_grid(tmp_path, name: str) -> None:
    assert wrong(cases(name), tmp_path) == []
