"""Interrupts are raised at once, and deferred where they would leave something half done."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from making import tree
from pydantic import BaseModel, field_serializer
from pydantic_core import PydanticSerializationError

from vcam_cli import interrupts
from vcam_cli.parallel import ThreadPool


def environment():
    return os.environ | {"PYTHONPATH": str(Path(interrupts.__file__).parents[1])}


@pytest.fixture(autouse=True)
def handlers():
    """Those of the tests' own process, put back."""
    former = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, former)


class Model(BaseModel):
    """One that is interrupted while it is written."""

    width: float = 1.0

    @field_serializer("width")
    def write(self, width: float) -> str:
        signal.raise_signal(signal.SIGINT)
        return f"{width} um"


def wait():
    """Long enough for what waits to come."""
    until = time.monotonic() + 30
    while time.monotonic() < until:
        time.sleep(0.001)


def test_it_is_raised_at_once():
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it did not come")


def test_it_is_no_error_of_a_model_that_is_written():
    with pytest.raises(PydanticSerializationError):  # what would be taken for a bug
        Model().model_dump(mode="json")
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        assert Model().model_dump(mode="json") == {"width": "1.0 um"}
        wait()


def test_it_is_raised_again_where_python_drops_it(capfd):
    class Gone:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        gone = [Gone()]
        gone.clear()  # nobody called what is interrupted here
        wait()
    assert "ignored" not in capfd.readouterr().err


def test_other_errors_that_python_drops_are_reported(capfd):
    class Gone:
        def __del__(self):
            raise ZeroDivisionError

    with interrupts.raise_interrupts():
        gone = [Gone()]
        gone.clear()
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_it_is_no_error_of_a_module_that_is_loaded(tmp_path, monkeypatch):
    (tmp_path / "interrupted_module.py").write_text(
        "import signal\n"
        "class Name:\n"
        "    def __set_name__(self, *_): signal.raise_signal(signal.SIGINT)\n"
        "class Named:\n"
        "    name = Name()\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        import interrupted_module

        assert interrupted_module.Named
        wait()


def test_threads_have_ended_before_it_is_handled(monkeypatch):
    """Else they write on into a folder that is being cleared away."""
    done = threading.Event()
    start = threading.Thread.start

    def interrupted(thread):
        start(thread)
        signal.raise_signal(signal.SIGINT)

    def work():
        time.sleep(0.05)
        done.set()

    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        with ThreadPool(1) as pool:
            pool.submit(work).result()
        wait()
    assert done.is_set()


def test_it_is_deferred_to_the_end_of_the_outer_context():
    reached = []
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        with interrupts.defer_interrupts():
            with interrupts.defer_interrupts():
                signal.raise_signal(signal.SIGINT)
                reached.append("inner")
            reached.append("outer")
        reached.append("after")
    assert reached == ["inner", "outer"]


def test_it_is_deferred_where_the_context_ends_with_an_error():
    with (
        pytest.raises(KeyboardInterrupt),
        interrupts.raise_interrupts(),
        interrupts.defer_interrupts(),
    ):
        signal.raise_signal(signal.SIGINT)
        raise ZeroDivisionError


def test_other_threads_defer_nothing():
    with pytest.raises(KeyboardInterrupt), interrupts.raise_interrupts():
        entered, leave = threading.Event(), threading.Event()

        def deferring():
            with interrupts.defer_interrupts():
                entered.set()
                leave.wait()

        with ThreadPool(1) as pool:
            pool.submit(deferring)
            entered.wait()
            try:
                signal.raise_signal(signal.SIGINT)
                pytest.fail("it was deferred")
            finally:
                leave.set()


def test_errors_before_and_after_an_interrupt_stay_what_they_are():
    with pytest.raises(ZeroDivisionError), interrupts.raise_interrupts():
        raise ZeroDivisionError
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(ZeroDivisionError), interrupts.raise_interrupts():
        with suppress(KeyboardInterrupt), interrupts.restore_interrupt():
            signal.raise_signal(signal.SIGINT)
        raise ZeroDivisionError


def test_none_is_raised_after_the_end():
    with interrupts.raise_interrupts():
        pass
    signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("context", [interrupts.raise_interrupts, interrupts.exit_on_interrupt])
def test_a_job_in_the_background_ignores_it(context):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with context():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN


def test_an_interrupted_start_ends_the_process_and_its_end_restores_the_handler():
    code = (
        "import signal\n"
        "from vcam_cli.interrupts import exit_on_interrupt\n"
        "with exit_on_interrupt(): pass\n"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
        "with exit_on_interrupt(): signal.raise_signal(signal.SIGINT)"
    )
    line = [sys.executable, "-c", code]
    done = subprocess.run(line, env=environment(), capture_output=True)
    assert (done.returncode, done.stderr) == (interrupts.INTERRUPTED, b"")


def test_a_run_that_is_interrupted_while_it_loads_its_writers(tmp_path):
    """OpenImageIO would end the process with a dump (exit code -6)."""
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree({"accuracy": "draft"})))
    code = (
        "import signal, sys\n"
        "class Finder:\n"
        "    def find_spec(name, *_):\n"
        "        if name == 'OpenImageIO': signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder)\n"
        "from vcam_cli.commands.main import main\n"
        "main()"
    )
    line = [sys.executable, "-c", code, "run", "camera.yaml", "-o", "out"]
    done = subprocess.run(
        line, env=environment(), cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stdout) == (130, ""), done
    assert done.stderr.startswith("interrupted; ")
    assert len(done.stderr.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["camera.yaml"]
