"""A sweep on a Dask scheduler and two workers in processes of their own, one of them killed."""

import json
import socket
import subprocess
import sys
import time
from contextlib import suppress
from threading import Thread

import pytest
from sweeping import VCAM, Cluster, environment, written

from vcam_cli import sweep
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.sweeps import workers
from vcam_cli.sweeps.point_work import Job

STUDY = {
    "vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 10}},
    "cases": {"a": {}, "b": {"optics.f_number": 5}},
    "seeds": 2,
    "optimize": {"metric": "mean_electrons", "goal": "max"},
}


def without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)


def test_without_dask_the_message_has_the_command(tmp_path, monkeypatch):
    without_dask(monkeypatch)
    with pytest.raises(CannotDo, match=r"pip install 'vcam-cli\[dask\]'"):
        sweep(written(tmp_path), tmp_path / "out", scheduler="tcp://127.0.0.1:8786")


class FakeFuture:
    """What a cluster gives back of a task."""

    def __init__(self, error=None, cancelled=False):
        self._error, self._cancelled = error, cancelled

    def cancelled(self):
        return self._cancelled

    def exception(self):
        return self._error

    def result(self):
        return "outcome"


def test_what_becomes_of_a_task():
    job = Job("ab", None, (), (), {})
    assert workers._outcomes([job], FakeFuture(), "lost") == "outcome"
    [given_up] = workers._outcomes([job], FakeFuture(RuntimeError("killed")), "lost")
    assert given_up.id == "ab"
    assert given_up.error
    assert not given_up.final
    assert workers._outcomes([job, job], FakeFuture(RuntimeError("killed")), "lost") is None
    with pytest.raises(CannotDo, match="lost"):
        workers._outcomes([job], FakeFuture(cancelled=True), "lost")
    with pytest.raises(CannotDo, match="install vcam"):
        workers._outcomes([job], FakeFuture(ModuleNotFoundError("vcam_cli")), "lost")


@pytest.mark.long
def test_a_killed_worker_changes_nothing(tmp_path):
    pytest.importorskip("distributed")
    study = written(tmp_path, **STUDY)
    sweep(study, tmp_path / "here", workers=1)
    cluster = Cluster(tmp_path)
    try:
        cluster.add_worker()
        cluster.add_worker()
        command = [*VCAM, "sweep", str(study), "--scheduler", cluster.address, "--json"]
        process = subprocess.Popen(
            [*command, "-o", str(tmp_path / "far")],
            env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        until = time.monotonic() + 60
        points = tmp_path / "far" / "points"
        while len(list(points.glob("*.json"))) < 5 and time.monotonic() < until:
            time.sleep(0.002)
        cluster.workers[0].kill()
        told, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
        assert json.loads(told)["computed"] == 40
        for name in ("points.csv", "optimum.csv"):
            assert (tmp_path / "far" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    finally:
        cluster.close()


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_scheduler_that_does_not_answer(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "CONNECT_TIMEOUT", 0.1)
    start = time.monotonic()
    with pytest.raises(CannotDo, match="no Dask scheduler answers at"):
        sweep(written(tmp_path), tmp_path / "out", scheduler="tcp://127.0.0.1:1")
    assert time.monotonic() - start < 10
    with pytest.raises(BadInput, match="--scheduler"):
        sweep(written(tmp_path), tmp_path / "out", scheduler="nonsense://x")


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
@pytest.mark.parametrize(
    "greeting", [b"SSH-2.0-OpenSSH_9.6\r\n", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\0" * 64]
)
def test_what_listens_may_be_another_program(greeting, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "CONNECT_TIMEOUT", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(20)

        def greet():
            with suppress(OSError):
                while True:
                    with server.accept()[0] as link:
                        link.sendall(greeting)

        Thread(target=greet, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(CannotDo, match=f"{address}.*") as caught:
            sweep(written(tmp_path), tmp_path / "out", scheduler=address)
    assert "no Dask scheduler" in str(caught.value)
    assert "memory" not in str(caught.value)
