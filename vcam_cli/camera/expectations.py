"""What a run is expected to measure: "mean_electrons >= 1000", in a file or behind `--expect`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic_core import InitErrorDetails

from vcam_cli import units
from vcam_cli.camera.quality import METRICS_OF, NEEDS, UNITS
from vcam_cli.config.lists import list_of
from vcam_cli.config.validation_messages import describe, fault, one_of
from vcam_cli.config.values import Either
from vcam_cli.errors import BadInput, Problem
from vcam_cli.records import dataclass

EXPECT = "expect"
"""The key of a file; the option is --expect."""
EXAMPLE = "mean_electrons >= 1000"
MISSED = 4
"""The exit code of a command whose expectation is missed."""
_RELATIONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
_FORM = re.compile(r"\s*([A-Za-z_][\w.-]*)\s*(>=|<=|>|<)\s*(\S.*?)\s*")
SNR_NOTE = (
    "snr_db is of a pixel at 20 % of its well and does not depend on the light;"
    " gray_snr_db is of 18 % gray in this exposure"
)


@dataclass(frozen=True)
class Limit:
    """A metric, and the limit that it is expected to keep."""

    metric: str
    relation: str
    """One of `_RELATIONS`."""
    value: float
    unit: str
    """The metric's, in which the value is."""

    def holds(self, found: float) -> bool:
        """Return whether a value keeps the limit; one that is not known does not."""
        return not math.isnan(found) and _RELATIONS[self.relation](found, self.value)

    def __str__(self) -> str:
        """Return it as a message has it: "mean_electrons >= 1000 e"."""
        return f"{self.metric} {self.relation} {self.value:g} {self.unit}".rstrip()

    def miss(self, found: float, where: str = "") -> str:
        """Return the sentence about a value that does not keep it."""
        what = "is not known" if math.isnan(found) else f"is {found:.6g} {self.unit}".rstrip()
        return f"missed: expected {self}, but {self.metric} {what}{where and f' ({where})'}"


def read_limit(text: Any, known: Mapping[str, str]) -> Limit:
    """Return the limit that a text states; known: metric -> its unit. Raises ValueError."""
    match = _FORM.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise ValueError(f"{describe(text)} is not METRIC >= VALUE; write for example {EXAMPLE}")
    metric, relation, written = match.groups()
    if metric not in known:
        message, remedy = one_of(metric, tuple(known))
        raise ValueError(f"{message}; {remedy}")
    number, unit = units.split(written)
    value = units.convert(number, unit, known[metric]) if unit else number
    return Limit(metric, relation, float(value), known[metric])


def read_limits(texts: Sequence[str], known: Mapping[str, str]) -> tuple[Limit, ...]:
    """Return the limits of `--expect`, `known` as of `read_limit`. Raises BadInput."""
    problems, found = [], []
    for text in texts:
        try:
            found.append(read_limit(text, known))
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            problems.append(Problem((), message, remedy, "--expect"))
    if problems:
        raise BadInput(problems)
    return tuple(found)


def _expected(given: Any) -> str:
    read_limit(given, UNITS)
    return str(given)


LIMIT_LIST = Either(list_of(_expected, f"[{EXAMPLE}]", 0, "expectations"), list[str])
"""The type of `expect` of a camera file."""


def unmeasured(metric: str, quality: Sequence[str], has_edge: bool, samples: bool) -> str | None:
    """Return what a camera lacks to measure a metric; None where it measures it."""
    if metric in METRICS_OF.values():
        asked = next(name for name, made in METRICS_OF.items() if made == metric)
        return None if asked in quality else f"add {asked} to quality"
    there = {"edge": has_edge, "samples": samples}
    missing = [remedy for what, remedy in NEEDS.get(metric, {}).items() if not there[what]]
    return missing[0] if missing else None


def unmeasured_mistakes(
    texts: Iterable[str], quality: Sequence[str], has_edge: bool, samples: bool
) -> Iterator[InitErrorDetails]:
    """Yield the mistakes of expectations about what the camera does not measure."""
    for number, text in enumerate(texts):
        metric = read_limit(text, UNITS).metric
        remedy = unmeasured(metric, quality, has_edge, samples)
        if remedy is not None:
            yield fault((EXPECT, number), f"this camera does not measure {metric}", remedy)


def misses(limits: Iterable[Limit], values: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each limit that the metrics of a frame do not keep."""
    found = ((limit, values.get(limit.metric, math.nan)) for limit in limits)
    return tuple(limit.miss(value) for limit, value in found if not limit.holds(value))


def notes(metrics: Iterable[str]) -> tuple[str, ...]:
    """Return what to know of metrics that are expected."""
    return (SNR_NOTE,) if "snr_db" in metrics else ()
