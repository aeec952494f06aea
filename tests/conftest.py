"""Settings all tests share: hypothesis tries the same examples on every machine.

The tests run in as many processes as there are cores: threads of BLAS would only compete. No test
gets light that another one has brought, and only tests of plots draw them.
"""

import atexit
import contextlib
import functools
import gc
import os
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from vcam_cli import source_code
from vcam_cli.files import plots
from vcam_cli.files.atomic import write_whole

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Arrays of tests lie in memory that a worker keeps: to ask the system for pages, and to give them
# back, for each takes 4 to 11 % of the time of tests of the engine. A process reads this when it
# starts, so that workers have it of the process that starts them; the commands that tests start,
# some of whose peaks of memory are judged, do without.
KEPT_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 31)}
if "PYTEST_XDIST_WORKER" in os.environ:
    for name in KEPT_MEMORY:
        os.environ.pop(name, None)
else:
    os.environ.update(KEPT_MEMORY)

# Compiled modules and rewritten assertions are kept, whatever the environment says: without them a
# worker starts in twice the time, and each of the commands that tests start as well.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

gc.disable()  # until all tests are collected: what is made there stays

settings.register_profile("vcam", derandomize=True, database=None, deadline=None)
settings.register_profile("quick", settings.get_profile("vcam"), max_examples=25)


BLANK = {"png": b"\x89PNG\r\n\x1a\n", "svg": b"<?xml", "pdf": b"%PDF"}
"""How a file begins that is written in place of a drawn plot."""
drawn_figure = plots.plot_figure
are_drawn = True
"""Whether plots are drawn in the test that runs."""
kept_bytes = 0
"""What `shared.KEPT` is where no test is run."""


class _NotDrawnError(BaseException):
    """A plot that is not drawn would be."""


class _Undrawn:
    """A figure that ends the drawing where it begins."""

    def __getattr__(self, _: str) -> None:
        raise _NotDrawnError


@contextlib.contextmanager
def figure_or_blank(path: Path | str, *args: Any, **options: Any) -> Iterator[Any]:
    """Yield a figure to be drawn, or write a blank file in place of the plot.

    Drawing takes a seventh of the time of the quick suite, the making of axes a twentieth.
    """
    if are_drawn:
        with drawn_figure(path, *args, **options) as figure:
            yield figure
        return
    with contextlib.suppress(_NotDrawnError):
        yield _Undrawn()
    with write_whole(path) as temporary:
        Path(temporary).write_bytes(BLANK[Path(path).suffix.removeprefix(".")])


plots.plot_figure = figure_or_blank  # before other modules import it by its name
drawn_svg = plots.svg


def svg_or_blank(draw: Callable[[Any], None], size: tuple[float, float]) -> bytes:
    """Return a drawing of a report, or a blank one in its place."""
    if are_drawn:
        return drawn_svg(draw, size)
    with contextlib.suppress(_NotDrawnError):
        draw(_Undrawn())
    return b"<svg></svg>"


plots.svg = svg_or_blank


package_files = source_code._files


@functools.cache
def listed(place: Path, folder: str) -> list[tuple[str, os.stat_result]]:
    """The files of a package, listed once in a process.

    To list them with every result, 2 ms each, takes a fiftieth of the time of the quick suite.
    """
    return list(package_files(place, folder))


source_code._files = listed
os.fsync = lambda _: None  # no test needs its files after a power cut; a hundredth of the time


def is_quick(config: pytest.Config) -> bool:
    """Whether the tests marked `long` are left out."""
    return "not long" in config.option.markexpr


def pytest_configure(config: pytest.Config) -> None:
    """Let properties hold for 25 examples where time counts, else for 100, unless a test says."""
    settings.load_profile("quick" if is_quick(config) else "vcam")


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Draw plots in tests with the mark `draws` and in their fixtures, and in all `long` runs.

    Keep no light from one simulation to the next, but in tests of what is kept: tests that change
    the engine between two frames of one camera would compare one light. A fixture that all tests
    use would do the same and take time in each.
    """
    global are_drawn, kept_bytes
    are_drawn = "draws" in item.keywords or not is_quick(item.config)
    if shared := sys.modules.get("vcam_cli.simulation.shared"):
        kept_bytes = kept_bytes or shared.KEPT
        shared.KEPT = kept_bytes if "keeps_light" in item.keywords else 0
        shared.RECENT.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Leave out of reports the keywords, which nobody reads there.

    To send them from worker to main process takes a sixth of the time of a test that does nothing.
    """
    report = yield
    report.keywords = {}
    return report


def pytest_collection_finish() -> None:
    """Spare the garbage collector what collection has made: a sixth of the time of small tests.

    Another 4 % are saved where it runs after 20,000 new objects in place of 700. They stay frozen
    until Python ends: pytest collects twice when it ends, which would take 4 s.
    """
    gc.freeze()
    atexit.register(gc.unfreeze)
    gc.set_threshold(20_000)
    gc.enable()
