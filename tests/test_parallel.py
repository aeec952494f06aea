"""How many threads a frame is computed in, and that they see all of it."""

import pytest
from making import camera

from vcam_cli import parallel
from vcam_cli.simulation import simulate


@pytest.mark.parametrize(
    ("rows", "columns", "expected"),
    [(1, 1, 1), (432, 576, 1), (864, 1152, 1), (1024, 1024, 2), (3000, 4000, 8)],
)
def test_small_frames_are_not_shared(rows, columns, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(parallel, "available_workers", lambda: 8)
    made = camera(tmp_path, {"array.rows": rows, "array.columns": columns})
    assert simulate.threads(made) == expected


@pytest.mark.parametrize("workers", [1, 2, 7])
def test_every_item_is_done_and_errors_come_out(workers):
    done = []
    parallel.each(done.append, range(20), workers)
    assert sorted(done) == list(range(20))
    with pytest.raises(ZeroDivisionError):
        parallel.each(lambda item: 1 // (item - 3), range(5), workers)
