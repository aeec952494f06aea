"""Records are the standard library's frozen dataclasses, made by less code."""

import copy
import dataclasses
import inspect
import pickle
from functools import cached_property
from typing import Any

import pytest

from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Point:
    x: float
    y: float = 0.0
    name: str = dataclasses.field(default="", compare=False)
    words: dict[str, int] = dataclasses.field(default_factory=dict, hash=False)
    kept: list[int] = dataclasses.field(default_factory=list, compare=False, repr=False)

    @cached_property
    def size(self) -> float:
        return abs(self.x) + abs(self.y)


@dataclass(frozen=True, kw_only=True)
class Solid(Point):
    z: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "z", float(self.z))


@dataclass(frozen=True)
class Lone:
    value: Any


@dataclass(frozen=True)
class Named:
    x: float

    def __repr__(self) -> str:
        return "named"


@dataclass(frozen=True, eq=False)
class Thing:
    x: float


@dataclass(frozen=True)
class Nothing:
    pass


@dataclass
class Open:
    x: float


RECORDS = Point, Solid, Lone, Named, Thing, Nothing, Open
VALUES = {"x": 1.0, "y": 2.0, "name": "a", "words": {"a": 1}, "z": 3, "value": 4}


def standard(record: type[Any]) -> type[Any]:
    """Return a class with the same fields, made by the standard library."""
    body = {
        name: value
        for name, value in vars(record).items()
        if name in ("__annotations__", "__module__", "__doc__", "__post_init__")
        or (name == "__repr__" and record is Named)
    }
    for field in dataclasses.fields(record):
        given = {k: getattr(field, k) for k in ("default", "default_factory", "repr", "hash")}
        more = {"compare": field.compare, "kw_only": field.kw_only}
        body[field.name] = dataclasses.field(**given, **more)
    body["__annotations__"] = {f.name: f.type for f in dataclasses.fields(record)}
    eq, frozen = record is not Thing, record is not Open
    return dataclasses.dataclass(frozen=frozen, eq=eq)(type(record.__name__, (), body))


def made(cls: type[Any], **more: Any) -> Any:
    names = {field.name for field in dataclasses.fields(cls) if field.name in VALUES}
    return cls(**{name: VALUES[name] for name in names} | more)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_a_record_is_what_the_standard_library_makes(record):
    same = standard(record)
    assert inspect.signature(record) == inspect.signature(same)
    assert record.__match_args__ == same.__match_args__
    one, other = made(record), made(same)
    assert repr(one) == repr(other)
    assert dataclasses.asdict(one) == dataclasses.asdict(other)
    assert (one == made(record)) == (other == made(same))
    assert one != other
    if record not in (Thing, Open):
        assert hash(one) == hash(made(record))
    assert (record.__hash__ is None) == (same.__hash__ is None)


@pytest.mark.parametrize("change", [{"x": 9.0}, {"y": 9.0}, {"words": {}}, {"z": 9.0}])
def test_records_differ_by_their_compared_values(change):
    assert made(Solid) != made(Solid, **change)


def test_values_that_are_not_compared_or_hashed_change_nothing():
    assert made(Point) == made(Point, name="other", kept=[1])
    assert hash(made(Point)) == hash(made(Point, words={"b": 2}, name="other"))
    assert hash(made(Point)) != hash(made(Point, x=9.0))


def test_what_is_set_stays():
    solid = made(Solid)
    for name in ("x", "z", "kept", "new"):
        with pytest.raises(dataclasses.FrozenInstanceError, match=f"field '{name}'"):
            setattr(solid, name, 1)
    with pytest.raises(dataclasses.FrozenInstanceError, match="field 'x'"):
        del solid.x
    assert solid == made(Solid)
    assert isinstance(solid.z, float)


def test_a_record_is_copied_pickled_and_replaced():
    solid = made(Solid)
    assert solid.size == 3.0
    for again in (copy.copy(solid), copy.deepcopy(solid), pickle.loads(pickle.dumps(solid))):
        assert again == solid
        assert again.size == 3.0
    assert dataclasses.replace(solid, x=5.0).size == 7.0


def test_a_record_of_itself_is_shown():
    inside: list[Any] = []
    lone = Lone(inside)
    inside.append(lone)
    assert repr(lone) == "Lone(value=[...])"
