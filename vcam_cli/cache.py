"""A cache of computed tables that is bounded by the memory they take."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache, wraps
from threading import Lock
from typing import Generic, ParamSpec, Protocol, TypeVar


class _Sized(Protocol):
    @property
    def nbytes(self) -> int: ...


T = TypeVar("T", bound=_Sized)
Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def remembered(
    count: int,
) -> Callable[[Callable[Arguments, Returned]], Callable[Arguments, Returned]]:
    """Return a decorator that keeps the last results of a pure function, by equal arguments.

    Arguments without a hash, such as arrays, are computed with each time.

    Parameters
    ----------
    count : int
        Number of results.

    Returns
    -------
    callable
        The decorator; results are shared, and not to be changed.
    """

    def decorate(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
        kept = lru_cache(count)(function)

        @wraps(function)
        def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned:
            if not _has_hash((args, tuple(kwargs.values()))):
                return function(*args, **kwargs)
            return kept(*args, **kwargs)  # type: ignore[arg-type]  # they have a hash

        return call

    return decorate


def _has_hash(key: object) -> bool:
    try:
        hash(key)
    except TypeError:
        return False
    return True


class ByteCache(Generic[T]):
    """Keeps the results used last, at most `limit` bytes of them together.

    The newest is kept always, or, `strict`, only where it is within the limit by itself.
    """

    def __init__(self, limit: int, strict: bool = False) -> None:
        self._limit, self._least = limit, 0 if strict else 1
        self._kept: OrderedDict[object, tuple[T, int]] = OrderedDict()
        self._nbytes = self._asked = 0
        self._lock = Lock()

    def __reduce__(self) -> tuple[type[ByteCache[T]], tuple[int, bool]]:
        """Pickle as an empty cache of the same limit: results can be computed again."""
        return type(self), (self._limit, not self._least)

    def get(self, key: object, compute: Callable[[], T]) -> T:
        """Return the result of `compute`, or the one that is kept for the same key.

        Two threads may compute the same result at once; both get an equal one. A key without a
        hash is computed each time.

        Parameters
        ----------
        key : object
            What the result depends on.
        compute : callable
            What computes it; called without a lock.

        Returns
        -------
        T
            The result.
        """
        if not _has_hash(key):
            return compute()
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                found, nbytes = self._kept[key]
                self._asked += nbytes
                return found
        value = compute()
        with self._lock:
            self._nbytes -= self._kept.pop(key, (value, 0))[1]
            self._kept[key] = value, value.nbytes
            self._nbytes += value.nbytes
            self._asked += value.nbytes
            while len(self._kept) > self._least and self._nbytes > self._limit:
                self._nbytes -= self._kept.popitem(last=False)[1][1]
        return value

    def clear(self) -> None:
        """Keep nothing."""
        with self._lock:
            self._kept.clear()
            self._nbytes = 0

    @property
    def nbytes(self) -> int:
        """Memory that the results took when they were computed [bytes]."""
        return self._nbytes

    @property
    def asked(self) -> int:
        """The same of all results that `get` has returned so far, kept before or not [bytes]."""
        return self._asked
