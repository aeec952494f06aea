"""The program ends at once with its exit code, after everything that was promised for its end."""

import subprocess
import sys

import pytest

START = (
    "import atexit, sys, threading\n"
    "from vcam_cli.commands import main\n"
    "atexit.register(print, 'left')\n"
    "{before}\n"
    "sys.argv = ['vcam', {words}]\n"
    "main.program()\n"
)
WAITING = "threading.Timer(0.5, lambda: print('late', flush=True)).start()"


def ended(*words: str, before: str = "pass") -> subprocess.CompletedProcess[str]:
    code = START.format(before=before, words=", ".join(map(repr, words)))
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)


@pytest.mark.parametrize(("words", "code"), [(("--version",), 0), (("list", "nothing"), 2)])
def test_exit_code_and_what_is_registered_for_the_end(words, code):
    done = ended(*words)
    assert done.returncode == code, done
    assert done.stdout.endswith("left\n")


def test_threads_finish():
    done = ended("--version", before=WAITING)
    assert done.returncode == 0, done
    assert done.stdout.endswith("late\nleft\n")
