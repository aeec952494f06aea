"""Interrupts come where they can be taken, and wait where they would break something."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml
from making import tree
from pydantic import BaseModel, field_serializer
from pydantic_core import PydanticSerializationError

from vcam_cli.commands import interrupts


def environment():
    return os.environ | {"PYTHONPATH": str(Path(interrupts.__file__).parents[2])}


@pytest.fixture(autouse=True)
def handlers():
    """Those of the tests' own process, put back."""
    former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGALRM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in former.items():
        signal.signal(number, handler)


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


def test_it_comes_at_once_where_it_may():
    with pytest.raises(KeyboardInterrupt), interrupts.waiting():
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it did not come")


def test_it_waits_for_a_model_that_is_written():
    with pytest.raises(PydanticSerializationError):  # what would be taken for a bug
        Model().model_dump(mode="json")
    with pytest.raises(KeyboardInterrupt), interrupts.waiting():
        assert Model().model_dump(mode="json") == {"width": "1.0 um"}
        wait()


def test_it_comes_again_where_python_drops_it(capfd):
    class Gone:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), interrupts.waiting():
        gone = [Gone()]
        gone.clear()  # nobody called what is interrupted here
        wait()
    assert "ignored" not in capfd.readouterr().err


def test_other_losses_are_still_told(capfd):
    class Gone:
        def __del__(self):
            raise ZeroDivisionError

    with interrupts.waiting():
        gone = [Gone()]
        gone.clear()
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_it_waits_for_a_module_that_is_loaded(tmp_path, monkeypatch):
    (tmp_path / "interrupted_module.py").write_text(
        "import signal\n"
        "class Name:\n"
        "    def __set_name__(self, *_): signal.raise_signal(signal.SIGINT)\n"
        "class Named:\n"
        "    name = Name()\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupts.waiting():
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
    with pytest.raises(KeyboardInterrupt), interrupts.waiting():
        with ThreadPoolExecutor(1) as pool:
            pool.submit(work).result()
        wait()
    assert done.is_set()


@pytest.mark.parametrize("name", ["/x/vcam_cli/files/folder.py", "/x/tempfile.py", "/x/other.py"])
def test_where_it_waits(name):
    place = {"may": lambda: interrupts._may_come(sys._getframe())}
    exec(compile("came = may()", name, "exec"), place)
    assert place["came"] == name.endswith("other.py")


def test_none_comes_after_the_end():
    with interrupts.waiting():
        pass
    signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("context", [interrupts.waiting, interrupts.at_once])
def test_a_job_in_the_background_stays_deaf(context):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with context():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN


def test_at_once_ends_the_process_and_its_end_puts_the_handler_back():
    code = (
        "import signal\n"
        "from vcam_cli.commands.interrupts import at_once\n"
        "with at_once(): pass\n"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
        "with at_once(): signal.raise_signal(signal.SIGINT)"
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
    assert done.stderr.startswith("interrupted; ") and len(done.stderr.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["camera.yaml"]
