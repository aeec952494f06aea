"""How many threads a frame is computed in, that they see all of it, and what if few start."""

import platform
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from making import camera

import vcam_cli
from vcam_cli import memory, parallel
from vcam_cli.commands import options
from vcam_cli.errors import CannotDo
from vcam_cli.files.folder import OutputFolder
from vcam_cli.simulation import simulate
from vcam_cli.simulation.output import outputs


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


@pytest.fixture
def thread_limit(monkeypatch):
    """Lets so many further threads start, and no more; says so as CPython does."""

    def limit(most: int) -> None:
        start, started = threading.Thread.start, []

        def refuse(self) -> None:
            if sum(thread.is_alive() for thread in started) >= most:
                raise RuntimeError("can't start new thread")
            started.append(self)
            start(self)

        monkeypatch.setattr(threading.Thread, "start", refuse)

    return limit


@pytest.mark.parametrize("most", [1, 2, 3])
def test_fewer_threads_do_the_work_of_more(most, thread_limit):
    thread_limit(most)
    done = []
    parallel.each(done.append, range(50), 4)
    assert sorted(done) == list(range(50))


def test_no_thread_at_all_is_no_bug(thread_limit):
    thread_limit(0)
    assert parallel.results(str, range(5), 4) == ["0", "1", "2", "3", "4"]
    with parallel.ThreadPool(2) as pool, pytest.raises(CannotDo, match="starts no thread"):
        pool.submit(int)


def test_a_run_with_one_thread_to_start(tmp_path, thread_limit):
    """The frame is the same, and its files are written."""
    made = camera(tmp_path, {"array.rows": 300, "array.columns": 200})
    whole = simulate.simulate(made, 4)
    thread_limit(1)
    few = simulate.simulate(made, 4)
    np.testing.assert_array_equal(few.dn, whole.dn)
    with OutputFolder(tmp_path / "out") as folder:
        outputs.write(few, folder)
        folder.finish({})
    assert (tmp_path / "out" / "raw.exr").exists()


@pytest.mark.parametrize("count", [1, 2, 31, 97, 1000])
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_results_stay_in_order_however_many_there_are(count, workers):
    """And the first error is raised, whichever thread meets it first."""
    assert parallel.results(lambda i: i * i, range(count), workers) == [i * i for i in range(count)]
    with pytest.raises(KeyError, match=f"^{count // 2}$"):
        parallel.each(lambda i: {}[i] if i >= count // 2 else i, range(count), workers)


def test_threads_are_started_in_one_module_alone():
    """So that what holds of them there holds of all."""
    package = Path(vcam_cli.__file__).parent
    users = [p.name for p in package.rglob("*.py") if "ThreadPoolExecutor" in p.read_text("utf-8")]
    assert users == ["parallel.py"]


def limited(megabytes: int) -> subprocess.CompletedProcess:
    """`vcam list cameras` within so much address space."""
    line = f"ulimit -v {megabytes * 1000}; exec {sys.executable} -m vcam_cli.commands.main"
    return subprocess.run(
        ["bash", "-c", f"{line} list cameras"], capture_output=True, text=True, timeout=60
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="ulimit -v is Linux's")
@pytest.mark.parametrize("megabytes", [150, 300, 390])
def test_little_address_space_is_told_before_libraries_hang(megabytes):
    done = limited(megabytes)
    assert done.returncode == 3, done
    assert "address space" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_limits_of_a_process_count_as_its_memory(monkeypatch):
    monkeypatch.setattr(memory, "_address_space", lambda: 10**9)
    assert memory.available() < 10**9


def test_a_hundred_thousand_workers_are_as_many_as_help(capsys):
    most = 4 * parallel.available_workers()
    assert options.few_workers(100_000) == most
    assert str(most) in capsys.readouterr().err
    assert options.few_workers(most) == most
    assert options.few_workers(None) is None
    assert capsys.readouterr().err == ""


def test_a_blas_starts_no_threads_unless_asked(monkeypatch):
    """vcam has threads of its own; what the user says of a BLAS stands."""
    found = {"OMP_NUM_THREADS": "3"}
    monkeypatch.setattr(memory.os, "environ", found)
    memory.limit_blas_threads()
    assert [found[name] for name in memory.BLAS_VARIABLES] == ["3", "1", "1"]


HEAPS = """
import ctypes, re, sys, threading
from vcam_cli import memory
memory.share_heap()
library, places = ctypes.CDLL(None), []
library.malloc.restype = ctypes.c_void_p
threads = [threading.Thread(target=lambda: places.append(library.malloc(50_000))) for _ in "ab"]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
heap = re.search("([0-9a-f]+)-([0-9a-f]+) .*heap", open("/proc/self/maps").read())
low, high = (int(end, 16) for end in heap.group(1, 2))
sys.exit(not all(low <= place < high for place in places))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a heap for each thread is glibc's")
def test_threads_share_a_heap():
    assert subprocess.run([sys.executable, "-c", HEAPS]).returncode == 0
