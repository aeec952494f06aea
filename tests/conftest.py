"""Settings all tests share: hypothesis tries the same examples on every machine.

The tests run in as many processes as there are cores: threads of BLAS would only compete. No test
gets light that another one has brought, and only tests of plots draw them.
"""

import gc
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from vcam_cli.files import plots
from vcam_cli.files.atomic import write_whole

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Compiled modules and rewritten assertions are kept, whatever the environment says: without them a
# worker starts in twice the time, and each of the commands that tests start as well.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

settings.register_profile("vcam", derandomize=True, database=None, deadline=None)
settings.load_profile("vcam")


BLANK = {"png": b"\x89PNG\r\n\x1a\n", "svg": b"<?xml", "pdf": b"%PDF"}
"""How a file begins that is written in place of a drawn plot."""
DRAWN = plots.save


def blank(_: object, path: Path | str) -> None:
    """Write a file in place of a plot: drawing takes a seventh of the time of the quick suite."""
    with write_whole(path) as temporary:
        Path(temporary).write_bytes(BLANK[Path(path).suffix.removeprefix(".")])


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Draw plots in tests with the mark `draws` and in their fixtures, nowhere else."""
    plots.save = DRAWN if "draws" in item.keywords else blank


def pytest_collection_finish() -> None:
    """Spare the garbage collector what collection has made: a sixth of the time of small tests."""
    gc.freeze()


def pytest_unconfigure() -> None:
    gc.unfreeze()


@pytest.fixture(autouse=True)
def nothing_kept(request, monkeypatch):
    """Keep no light from one simulation to the next, but in tests of what is kept.

    Tests that change the engine between two frames of one camera would compare one light.
    """
    if "keeps_light" in request.keywords:
        from vcam_cli.simulation.shared import RECENT

        RECENT.clear()
        return
    if module := sys.modules.get("vcam_cli.simulation.shared"):
        monkeypatch.setattr(module, "KEPT", 0)
        module.RECENT.clear()
