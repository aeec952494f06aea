"""Ctrl-C: KeyboardInterrupt where Python can take it, and not in the midst of what cannot.

Why: Python raises KeyboardInterrupt between any two of its instructions, also in a function that
a library in another language has called. pydantic makes an error of its own of it, which looks
like a bug of vcam; OpenImageIO ends the process with a dump while it is loaded; a class that is
being made turns it into a RuntimeError; a module that is half loaded may keep its lock. And there
are moments in which nobody knows of a folder that has just been made, or of a thread that has
just been started and writes on while its folder is cleared away. So while modules are loaded,
models are read or written, folders come and go and threads begin or are waited for at their end,
an interrupt waits. One that comes while Python clears away an object is lost, for nobody called
that: it comes again.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

AGAIN = 0.005
"""Seconds after which an interrupt that waits looks again whether it may come."""
INTERRUPTED = 130
"""Exit code."""
_NOT_IN = (
    "<frozen importlib",
    "/pydantic/",
    "/concurrent/futures/thread.py",
    "/tempfile.py",
    "/vcam_cli/files/folder.py",
)
"""What the files of functions are called that must not be interrupted, nor what they call."""


@contextmanager
def at_once() -> Iterator[None]:
    """An interrupt ends the process while there is nothing to be cleared away."""
    former = signal.getsignal(signal.SIGINT)
    if former is not signal.default_int_handler:  # others' business, or a job in the background
        yield
        return
    with suppress(ValueError):  # not in the main thread
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        with suppress(ValueError):
            signal.signal(signal.SIGINT, former)


@contextmanager
def waiting() -> Iterator[None]:
    """An interrupt waits until it may come; after the end, none comes any more.

    For a process that ends with this context: what is left then is the end of Python, which an
    interrupt could only make ugly.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    with suppress(ValueError):
        signal.signal(signal.SIGALRM, _come)
        signal.signal(signal.SIGINT, _come)
    tell, sys.unraisablehook = sys.unraisablehook, _come_again
    try:
        yield
    finally:
        sys.unraisablehook = tell
        with suppress(ValueError):
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.setitimer(signal.ITIMER_REAL, 0)


def _come(number: int, frame: FrameType | None) -> None:
    """Raises KeyboardInterrupt, now or a little later."""
    if _may_come(frame):
        raise KeyboardInterrupt
    signal.setitimer(signal.ITIMER_REAL, AGAIN)


def _come_again(lost: "sys.UnraisableHookArgs") -> None:
    """Takes an exception that could not be raised, and sees to it that an interrupt still is."""
    if lost.exc_type is KeyboardInterrupt:
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    else:
        sys.__unraisablehook__(lost)


def _may_come(frame: FrameType | None) -> bool:
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in _NOT_IN):
            return False
        frame = frame.f_back
    return True
