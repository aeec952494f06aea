"""Lists and mappings whose items are read one by one: the mistakes of all are raised at once."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal

from vcam_cli.config.validation_messages import describe, failure, fault, faults_at, one_of
from vcam_cli.config.values import Either


def read_items(items: Iterable[tuple[Any, Any]], read: Callable[[Any], Any]) -> list[Any]:
    """Return what `read` makes of items (place, value); raise the mistakes of all of them."""
    values, mistakes = [], []
    for place, item in items:
        try:
            values.append(read(item))
        except ValueError as error:
            mistakes += faults_at(place, error, item)
    if mistakes:
        raise failure(mistakes)
    return values


def check_list(given: Any, example: str, least: int = 0, what: str = "a list") -> None:
    """Raise ValueError where something is no list, or too short; `what` is a noun for it."""
    if not isinstance(given, (list, tuple)):
        raise ValueError(f"{describe(given)} is not {what}; write for example {example}")
    if len(given) < least:
        raise ValueError(f"is an empty list; write for example {example}")


def read_list(given: Any, example: str, least: int = 1) -> tuple[Any, ...]:
    """Return the items of a list; an error for another value, a short list, an item twice."""
    check_list(given, example, least)
    twice = sorted(repeats(given))
    if twice:
        said = [(i, f"{describe(given[i])} comes twice") for i in twice]
        raise failure([fault((i,), text, "keep one of them", given[i]) for i, text in said])
    return tuple(given)


def list_of_any(example: str, least: int = 1) -> Either:
    """Return the type of a list of values that are checked elsewhere."""
    return Either(lambda given: read_list(given, example, least), list[Any])


def list_of(
    read: Callable[[Any], Any], example: str, least: int, what: str
) -> Callable[[Any], tuple[Any, ...]]:
    """Return a reader of lists whose items `read` reads, none of them twice."""

    def pick(given: Any) -> tuple[Any, ...]:
        check_list(given, example, least, f"a list of {what}")
        values: set[Any] = set()

        def distinct(item: Any) -> Any:
            value = read(item)
            if value in values:
                raise ValueError(f"{describe(item)} comes twice; keep one of them")
            values.add(value)
            return value

        return tuple(read_items(enumerate(given), distinct))

    return pick


def words_of(
    allowed: tuple[str, ...], least: int, example: str = "", what: str = "a list"
) -> Either:
    """Return the type of a list of some of the words."""

    def pick(given: Any) -> tuple[str, ...]:
        check_list(given, example or f"[{allowed[0]}]", least, what)
        return distinct_words(given, allowed)

    return Either(pick, list[Literal[allowed]])  # type: ignore[valid-type]


def distinct_words(given: Sequence[Any], allowed: Sequence[str]) -> tuple[str, ...]:
    """Return a list of some of the allowed words, none of them twice; raise all its mistakes."""
    mistakes, twice = [], repeats(given)
    for i, item in enumerate(given):
        if item not in allowed:
            mistakes.append(fault((i,), *one_of(item, allowed), given=item))
        elif i in twice:
            mistakes.append(fault((i,), f"{item} comes twice", "keep one of them", item))
    if mistakes:
        raise failure(mistakes)
    return tuple(given)


def repeats(items: Iterable[object]) -> frozenset[int]:
    """Return places of the items that came before, in a time that grows as their number does."""
    before: set[object] = set()
    places = []
    for place, item in enumerate(items):
        try:
            known = item in before
        except TypeError:  # a list or mapping of YAML
            item = repr(item)
            known = item in before
        if known:
            places.append(place)
        before.add(item)
    return frozenset(places)
