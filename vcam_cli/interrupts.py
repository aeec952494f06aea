"""Ctrl-C as KeyboardInterrupt, deferred where work would be left half done.

Python raises KeyboardInterrupt between any two instructions of the main thread. Three cases need
care. Steps that belong together, such as making a folder, starting a thread or loading OpenImageIO
(whose C++ part would abort the process), run within `defer_interrupts`. A library may turn the
interrupt into an error of its own, as pydantic does while it writes a model; `restore_interrupt`
turns it back. What is raised while Python destroys an object is dropped; it is raised again.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130
"""The exit code of an interrupted process."""
_RETRY_AFTER = 0.005
"""Seconds after which an interrupt that Python has dropped is raised again."""


class _State:
    """What the signal handler knows."""

    deferrals = 0
    """The number of `defer_interrupts` contexts that are open."""
    deferred = False
    """Whether an interrupt waits for their end."""
    raised = False
    """Whether a KeyboardInterrupt has been raised and not yet caught."""


_state = _State()


@contextmanager
def exit_on_interrupt() -> Iterator[None]:
    """End the process at once on an interrupt: for a start that leaves nothing behind."""
    with _handler(lambda *_: os._exit(INTERRUPTED), signal.default_int_handler):
        yield


@contextmanager
def raise_interrupts() -> Iterator[None]:
    """Raise interrupts as KeyboardInterrupt, and ignore them after the end of the context.

    For a process that ends with this context: only Python's own end follows.
    """
    report, sys.unraisablehook = sys.unraisablehook, _raise_again
    try:
        with _handler(_raise_or_defer, signal.SIG_IGN), restore_interrupt():
            yield
    finally:
        sys.unraisablehook = report


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Let an interrupt of `raise_interrupts` wait until the context ends."""
    if threading.current_thread() is not threading.main_thread():  # none is raised there
        yield
        return
    _state.deferrals += 1
    try:
        yield
    finally:
        _state.deferrals -= 1
        if _state.deferred and not _state.deferrals:
            _raise_or_defer()


@contextmanager
def restore_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt in place of an error that a library has made of it."""
    try:
        yield
    except BaseException as error:
        raised, _state.raised = _state.raised, False
        if raised and isinstance(error, Exception):
            raise KeyboardInterrupt from error
        raise


@contextmanager
def _handler(handler: "signal._HANDLER", afterwards: "signal._HANDLER") -> Iterator[None]:
    """Set a handler of SIGINT, and another at the end, unless the caller has its own."""
    # A job in the background ignores interrupts, and goes on doing so.
    own = signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    if own or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, afterwards)


def _raise_or_defer(number: int = signal.SIGINT, frame: FrameType | None = None) -> None:
    """Raise KeyboardInterrupt, now or when no context defers it."""
    _state.deferred = bool(_state.deferrals)
    if not _state.deferred:
        _state.raised = True
        raise KeyboardInterrupt


def _raise_again(dropped: "sys.UnraisableHookArgs") -> None:
    """Raise an interrupt again that Python has dropped; report other errors."""
    if issubclass(dropped.exc_type, KeyboardInterrupt):
        main = threading.main_thread().ident
        threading.Timer(_RETRY_AFTER, signal.pthread_kill, [main, signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(dropped)
