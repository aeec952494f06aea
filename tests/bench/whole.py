"""All parts of the benchmark, at a chosen size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from vcam_cli.parallel import available_workers

from . import sections
from .cameras import BUSY, studio
from .measure import yardstick

PIXELS = 12e6
"""Of the frame that schedules are compared with, whatever the size of the others."""


@dataclass(frozen=True)
class Size:
    """How large and how often."""

    frame: tuple[int, int]
    part: tuple[int, int]
    """Rows and columns of the frames for effects and sweeps."""
    growth: tuple[tuple[int, int], ...]
    repeats: int
    plain_repeats: int = 3
    plain_scenes: tuple[str, ...] = ("gray", "color")
    wavelengths: int = 31
    points: int = 20
    levels: int = 65_536
    effects: tuple[str, ...] = ()
    """Some of them; () for all."""
    varied: tuple[str, ...] = ()
    """Some of the sweeps; () for all."""
    scenes: tuple[str, ...] = ("color", "laser", "chart")
    """Beside the gray picture."""
    busy: dict[str, Any] = field(default_factory=lambda: BUSY)
    """The camera of the effects."""
    always: dict[str, Any] = field(default_factory=dict)
    """Keys laid over every camera."""


WHOLE = Size(
    frame=(3000, 4000),
    part=(864, 1152),
    growth=((432, 576), (864, 1152), (1728, 2304), (3000, 4000), (6144, 8192)),
    repeats=5,
)
QUICK = Size(
    frame=(432, 576),
    part=(216, 288),
    growth=((108, 144), (216, 288), (432, 576)),
    repeats=1,
    plain_repeats=1,
    plain_scenes=("color",),
    effects=("aberration", "stray_light", "pixel_vignetting", "microlens", "shot_noise", "fpn"),
    varied=("exposure time",),
)


def measure(size: Size, tell: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Every figure, as it goes to JSON. tell: gets a line before each part."""
    tell("yardstick")
    unit = yardstick(*size.frame, size.repeats)
    out: dict[str, Any] = {
        "processors": available_workers(),
        "size": list(size.frame),
        "repeats": size.repeats,
        "r_compute": asdict(unit.of(1)),
    }
    with studio(*size.frame, size.always) as place:
        tell("frames")
        out["yardstick"], gray = sections.against_yardstick(
            place, size.frame, size.repeats, size.scenes
        )
        out["stages"] = gray.shares
        tell("plain pipeline")
        plain = sections.against_plain(
            place, size.plain_repeats, size.plain_scenes, size.wavelengths
        )
        out["plain"], out["plain_apart"] = plain
        tell("wavelengths")
        out["wavelengths"] = sections.wavelengths(place, size.repeats)
    with studio(*size.part, size.always) as place:
        tell("effects")
        out["effects"] = sections.per_effect(place, size.repeats, size.effects, size.busy)
        tell("sweeps")
        out["sweeps"] = sections.sweeps(place, size.repeats, size.points, size.varied)
    tell("growth")
    out["growth"] = sections.growth(size.growth, size.repeats, size.always)
    tell("schedules")
    large = unit.of(1).scaled(PIXELS / (size.frame[0] * size.frame[1]))
    out["schedules"] = sections.schedules(large, size.repeats, size.levels)
    tell("command")
    out["command"] = sections.command(large, size.repeats)
    return out
