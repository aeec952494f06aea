"""The largest memory that run.json states is that of the process itself."""

import subprocess
import sys

import pytest

CHILD = "from vcam_cli.memory import peak_memory; print(peak_memory())"
PARENT = (
    "import subprocess, sys\n"
    "held = b'x' * 400_000_000\n"
    f"subprocess.run([sys.executable, '-c', {CHILD!r}], check=True)\n"
)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak from /proc")
def test_memory_of_the_process_that_started_it_does_not_count():
    done = subprocess.run([sys.executable, "-c", PARENT], capture_output=True, text=True)
    assert 5e6 < int(done.stdout) < 350e6, done


def test_memory_that_was_held_counts():
    before = "held = b'x' * 400_000_000; del held; "
    done = subprocess.run([sys.executable, "-c", before + CHILD], capture_output=True, text=True)
    assert int(done.stdout) > 400e6, done
