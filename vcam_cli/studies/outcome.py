"""What came of a point of a sweep, and how it is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from vcam_cli.errors import Problem, dotted, one_line

FRAMES = {"raw": "raw.exr", "render": "render.png"}
"""What may be kept of a point -> its file's name."""


@dataclass(frozen=True)
class Outcome:
    """What came of a point."""

    id: str
    metrics: dict[str, float] = field(default_factory=dict)
    error: str = ""
    final: bool = True
    """Whether another try would end alike; a machine may have more memory tomorrow."""
    seconds: float = 0.0
    frames: dict[str, bytes] = field(default_factory=dict)
    """Name of a file -> its bytes."""
    trace: str = ""
    """Of a bug."""

    def content(self) -> dict:
        """As it is kept."""
        names = ("metrics", "error", "final", "seconds")
        return {name: getattr(self, name) for name in names}


def kept(point: str, content: dict) -> Outcome:
    """The outcome of what was kept of a point. Raises ValueError where it is none."""
    try:
        return Outcome(
            point,
            {str(name): float(value) for name, value in content["metrics"].items()},
            str(content["error"]),
            bool(content["final"]),
            float(content["seconds"]),
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(str(error)) from None


def in_a_cell(problems: Sequence[Problem]) -> str:
    """Problems as the column `error` has them: without places, which depend on the machine."""
    texts = []
    for p in problems:
        text = ": ".join(part for part in (dotted(p.path), p.message) if part)
        texts.append(one_line(f"{text}; {p.remedy}" if p.remedy else text))
    return " | ".join(dict.fromkeys(texts))
