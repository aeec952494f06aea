"""Tables that are dear to compute and asked for again: kept while they fit a number of bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, Protocol, TypeVar


class _Sized(Protocol):
    @property
    def nbytes(self) -> int: ...


T = TypeVar("T", bound=_Sized)


class ByteCache(Generic[T]):
    """The results used last, at most `limit` bytes of them together (the newest always)."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._kept: OrderedDict[Hashable, T] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable, compute: Callable[[], T]) -> T:
        """What `compute` gives, or gave for the same key. Threads may compute it twice."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        value = compute()
        with self._lock:
            self._kept[key] = value
            while len(self._kept) > 1 and self.nbytes > self._limit:
                self._kept.popitem(last=False)
        return value

    @property
    def nbytes(self) -> int:
        """What is kept now [bytes]."""
        return sum(value.nbytes for value in self._kept.values())
