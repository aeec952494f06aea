"""Threads over fixed pieces of work.

The pieces do not depend on the number of workers, and no two of them write the same place, so
neither does the result: same bytes for one worker and for many.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import ParamSpec, TypeVar

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import CannotDo
from vcam_cli.interrupts import defer_interrupts

Item = TypeVar("Item")
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")

A_THREAD = 1 << 19
"""Pixels that are worth a thread of their own."""
LEAST = 32
"""Rows or columns of a piece of work."""
AT_ONCE = 1 << 17
"""Values of a larger one, about."""
RUNS = 32
"""Runs of consecutive items for each thread, at most: handing one to a thread takes 0.1 ms, as long
as work on 64 short rows, and the last of 32 runs leaves other threads idle for 3 % of the time."""
PRODUCT = 1 << 18
"""Multiplications of a product of matrices, at most: from more on a BLAS starts threads of its own,
which on a busy machine wait for each other longer than they work."""


def available_workers() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def suitable_workers(pixels: int) -> int:
    """Return the number of threads that suits a frame of `pixels` pixels.

    Half a megapixel takes a fifth longer with two threads than with one; a whole one gains a tenth
    by the clock and takes a third more of the processors.
    """
    return max(1, min(available_workers(), pixels // A_THREAD))


class NoThread(CannotDo):
    """The system starts no thread."""


class ThreadPool(ThreadPoolExecutor):
    """Threads that have ended when the context has, also when an interrupt ends it.

    Where the system starts no more of them, those that there are do the work.
    """

    def _adjust_thread_count(self) -> None:
        try:
            super()._adjust_thread_count()
        except RuntimeError as error:
            if not self._threads:
                raise NoThread(
                    f"the system starts no thread: {error}",
                    "write --workers 1, or allow more threads (ulimit -u)",
                ) from error

    def submit(
        self,
        fn: Callable[Arguments, Returned],
        /,
        *args: Arguments.args,
        **kwargs: Arguments.kwargs,
    ) -> Future[Returned]:
        """Call a function in a thread."""
        with defer_interrupts():  # a thread that has just started would not be waited for
            return super().submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the threads to end."""
        with defer_interrupts():
            super().shutdown(wait, cancel_futures=cancel_futures)


def each(work: Callable[[Item], object], items: Iterable[Item], workers: int) -> None:
    """Call `work` on every item; raise the first exception that any of them raises."""
    results(work, items, workers)


def results(work: Callable[[Item], Result], items: Iterable[Item], workers: int) -> list[Result]:
    """Return what `work` makes of every item; raise the first exception that it raises."""
    every = list(items)

    def run(places: slice) -> list[Result]:
        return [work(item) for item in every[places]]

    if workers > 1 and len(every) > 1:
        runs = pieces(len(every), -(-len(every) // (workers * RUNS)))
        with suppress(NoThread), ThreadPool(min(workers, len(runs))) as pool:
            return [result for some in pool.map(run, runs) for result in some]
    return run(slice(None))


def rows_at_once(values: int) -> int:
    """Return the number of rows or columns of `values` values that are processed together.

    Few enough for the cache; more of short ones, since every piece costs some calls.
    """
    return min(max(LEAST, AT_ONCE // max(1, values)), 4 * LEAST)


def pieces(count: int, size: int) -> list[slice]:
    """Return consecutive slices of at most `size` that cover `count`."""
    return slices_within(slice(0, count), size)


def slices_within(whole: slice, size: int) -> list[slice]:
    """Return consecutive slices of at most `size` that cover a slice."""
    return [slice(i, min(i + size, whole.stop)) for i in range(whole.start, whole.stop, size)]


def product(left: Array, right: Array, dtype: type | None = None) -> Array:
    """Return the product of two matrices of the same float type, computed in one thread.

    It is computed in their float type, and rounded to `dtype` where that is another.
    """
    out = np.empty((len(left), right.shape[1]), dtype or right.dtype)
    if left.size * right.shape[1] <= PRODUCT:
        return np.matmul(left, right, out=out)
    if left.size > PRODUCT >= right.size:
        for rows in pieces(len(out), max(1, PRODUCT // max(1, right.size))):
            np.matmul(left[rows], right, out=out[rows])
        return out
    for columns in pieces(out.shape[1], max(1, PRODUCT // max(1, left.size))):
        np.matmul(left, right[:, columns], out=out[:, columns])
    return out
