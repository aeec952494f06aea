"""Every number of every shipped camera, at its limits, at 0, a million times more and less."""

from pathlib import Path

import pytest
from number_grid import all_cases, cases, outcome

from vcam_cli.config import shipped

SAMPLE = 80
"""Cases of the quick slice, evenly spread over all of them."""


def wrong(chosen, folder: Path) -> list[str]:
    found = ((case, *outcome(case, folder)) for case in chosen)
    return [f"{case}: {said}" for case, end, said in found if end == "bug"]


def test_a_slice_of_the_grid(tmp_path) -> None:
    """Of every camera, and nearly every key."""
    every = all_cases()
    chosen = [every[i * len(every) // SAMPLE] for i in range(SAMPLE)]
    assert {case.camera for case in chosen} == set(shipped.names("cameras"))
    assert len({case.path for case in chosen}) > SAMPLE / 3
    assert wrong(chosen, tmp_path) == []


@pytest.mark.long
@pytest.mark.parametrize("name", shipped.names("cameras"))
def test_the_whole_grid(tmp_path, name: str) -> None:
    assert wrong(cases(name), tmp_path) == []
