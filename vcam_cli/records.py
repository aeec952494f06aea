"""Frozen dataclasses, made in a fifth of the time.

The standard library writes six methods of each class as text and compiles them, 0.5 ms a class;
`vcam run` imports three hundred. Here it writes `__init__` alone. The others are the same
functions for all classes.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from functools import cache, partial
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, **more):
        """Return a class as `dataclasses.dataclass` does.

        Parameters
        ----------
        cls : type, optional
            The class; without it a decorator is returned.
        frozen, eq : bool, optional
            Whether its values stay, and whether it is compared and hashed by them.
        **more
            Other arguments of `dataclasses.dataclass`.

        Returns
        -------
        type
            The same class, with its methods.
        """
        if cls is None:
            return partial(dataclass, frozen=frozen, eq=eq, **more)
        if not frozen:
            return dataclasses.dataclass(cls, eq=eq, **more)
        own = set(vars(cls))
        dataclasses.dataclass(cls, eq=False, repr=False, **more)
        for name, method in (METHODS | COMPARISON if eq else METHODS).items():
            if name not in own:
                setattr(cls, name, method)
        return cls


def _set(self: Any, name: str, value: object) -> None:
    """Set a value that has none: `__init__` does."""
    if name in self.__dict__ or name not in self.__dataclass_fields__:
        raise FrozenInstanceError(f"cannot assign to field {name!r}")
    self.__dict__[name] = value


def _delete(self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


@recursive_repr()
def _repr(self: Any) -> str:
    shown = [f.name for f in dataclasses.fields(self) if f.repr]
    values = ", ".join(f"{name}={getattr(self, name)!r}" for name in shown)
    return f"{type(self).__qualname__}({values})"


@cache
def _compared(cls: Any) -> Callable[[Any], object]:
    """Return what takes from an object of a class the values that are compared."""
    return _getter([f.name for f in dataclasses.fields(cls) if f.compare])


@cache
def _hashed(cls: Any) -> Callable[[Any], object]:
    fields = dataclasses.fields(cls)
    return _getter([f.name for f in fields if (f.compare if f.hash is None else f.hash)])


def _getter(names: list[str]) -> Callable[[Any], object]:
    if len(names) > 1:
        return attrgetter(*names)
    return lambda self: tuple(getattr(self, name) for name in names)


def _eq(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = _compared(self.__class__)
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_hashed(self.__class__)(self))


METHODS = {"__setattr__": _set, "__delattr__": _delete, "__repr__": _repr}
COMPARISON = {"__eq__": _eq, "__hash__": _hash}
