"""Frozen dataclasses, made in a fifth of the time.

The standard library writes six methods of each class as text and compiles them, 0.5 ms a class;
`vcam run` imports three hundred. Here it writes `__init__` alone. The others are closures, or the
same functions for all classes.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from functools import partial
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
        for name, method in (METHODS | _comparison_methods(cls) if eq else METHODS).items():
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


def _comparison_methods(cls: Any) -> dict[str, Callable[..., Any]]:
    """Return the methods that compare and hash objects of a class by their values."""
    fields = dataclasses.fields(cls)
    compared = _getter([f.name for f in fields if f.compare])
    hashed = _getter([f.name for f in fields if (f.compare if f.hash is None else f.hash)])

    def equal(self: Any, other: Any) -> Any:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return compared(self) == compared(other)

    def own_hash(self: Any) -> int:
        return hash(hashed(self))

    return {"__eq__": equal, "__hash__": own_hash}


def _getter(names: list[str]) -> Callable[[Any], object]:
    """Return what takes some values from an object."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda self: tuple(getattr(self, name) for name in names)


METHODS = {"__setattr__": _set, "__delattr__": _delete, "__repr__": _repr}
