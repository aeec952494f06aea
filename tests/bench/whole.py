"""The parts of the benchmark, each at a chosen size, all by themselves or together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

from vcam_cli.config import shipped
from vcam_cli.parallel import available_workers

from . import sections
from .cameras import BUSY, Studio, studio
from .cheap import cheap
from .measure import Cost, Yardstick, yardstick
from .repeated import repeated
from .sections import Section

PIXELS = 12e6
"""Pixels of the frame that schedules are compared with, whatever the size of the others."""


@dataclass(frozen=True)
class Size:
    """How large frames are, and how often each is taken."""

    frame: tuple[int, int]
    part: tuple[int, int]
    """Rows and columns of the frames for effects and sweeps."""
    growth: tuple[tuple[int, int], ...]
    repeats: int
    """Frames of which a median is taken."""
    few: int
    """The same where frames are dear or many."""
    plain_scenes: tuple[str, ...] = ("gray", "color")
    wavelengths: int = 31
    points: int = 20
    levels: int = 65_536
    repeated: tuple[int, int, int] = (12, 200, 400)
    """Frames of a loop, and points of a sweep of small frames."""
    cheap: tuple[tuple[int, int], int, int] = ((5792, 8688), 1_000_000, 20)
    """Array of a plan, long side of a thin array, and frames of a sequence."""
    effects: tuple[str, ...] = ()
    """Some of the effects; () for all."""
    varied: tuple[str, ...] = ()
    """Some of the sweeps; () for all."""
    scenes: tuple[str, ...] = ("color", "laser", "chart")
    """Scenes beside the gray picture."""
    layers: tuple[int, int] = (1000, 1000)
    """Rows and columns of the frames with layers."""
    layered: tuple[str, ...] = ()
    """Some of the layered scenes; () for all."""
    lens: tuple[int, int] = (1224, 1632)
    """Rows and columns of the frames through a traced lens."""
    before_lens: tuple[str, ...] = ()
    """Some of the scenes before it; () for all."""
    shipped: tuple[str, ...] = ()
    """Some of the shipped cameras; () for all."""
    busy: dict[str, Any] = field(default_factory=lambda: BUSY)
    """The camera of the effects."""
    always: dict[str, Any] = field(default_factory=dict)
    """Keys laid over every camera but the shipped ones."""


WHOLE = Size(
    frame=(3000, 4000),
    part=(864, 1152),
    growth=((432, 576), (864, 1152), (1728, 2304), (3000, 4000), (6144, 8192)),
    repeats=5,
    few=3,
)
QUICK = Size(
    frame=(432, 576),
    part=(216, 288),
    growth=((108, 144), (216, 288), (432, 576)),
    repeats=1,
    few=1,
    plain_scenes=("color",),
    effects=("aberration", "stray_light", "pixel_vignetting", "microlens", "shot_noise", "fpn"),
    varied=("exposure time",),
    layers=(216, 288),
    lens=(216, 288),
    shipped=("starter", "csf-monochrome", "eye-chart"),
    cheap=((5792, 8688), 100_000, 4),
)


@dataclass
class Bench:
    """What the parts have in common: sizes, pictures that are made once, the yardstick."""

    size: Size
    stack: ExitStack
    _studios: dict[tuple[int, int], Studio] = field(default_factory=dict)

    def studio(self, shape: tuple[int, int]) -> Studio:
        """A picture of that many rows and columns, until the stack is closed."""
        if shape not in self._studios:
            made = self.stack.enter_context(studio(*shape, self.size.always))
            self._studios[shape] = made
        return self._studios[shape]

    @cached_property
    def unit(self) -> Yardstick:
        """The yardstick at the size of the frames."""
        return yardstick(*self.size.frame, self.size.repeats)

    @cached_property
    def large(self) -> Cost:
        """R_compute of one component at 12 megapixels."""
        rows, columns = self.size.frame
        return self.unit.compute(1).scale(PIXELS / (rows * columns))


def _frames(bench: Bench) -> dict[str, Section]:
    size = bench.size
    place = bench.studio(size.frame)
    return sections.against_yardstick(place, size.repeats, size.scenes)


def _shipped(bench: Bench) -> dict[str, Section]:
    return sections.shipped_cameras(bench.size.shipped or shipped.names("cameras"), bench.size.few)


def _painted(bench: Bench) -> dict[str, Section]:
    return sections.painted_chart(bench.studio(bench.size.frame), bench.size.few)


def _layers(bench: Bench) -> dict[str, Section]:
    size = bench.size
    return sections.layers(bench.studio(size.layers), size.few, size.layered)


def _lens(bench: Bench) -> dict[str, Section]:
    size = bench.size
    return sections.traced_lens(bench.studio(size.lens), size.few, size.before_lens)


def _plain(bench: Bench) -> dict[str, Section]:
    size = bench.size
    place = bench.studio(size.frame)
    return sections.against_plain(place, size.few, size.plain_scenes, size.wavelengths)


def _wavelengths(bench: Bench) -> dict[str, Section]:
    return sections.wavelengths(bench.studio(bench.size.frame), bench.size.repeats)


def _effects(bench: Bench) -> dict[str, Section]:
    size = bench.size
    return sections.per_effect(bench.studio(size.part), size.few, size.effects, size.busy)


def _sweeps(bench: Bench) -> dict[str, Section]:
    size = bench.size
    return sections.sweeps(bench.studio(size.part), size.repeats, size.points, size.varied)


def _growth(bench: Bench) -> dict[str, Section]:
    return sections.growth(bench.size.growth, bench.size.few, bench.size.always)


def _schedules(bench: Bench) -> dict[str, Section]:
    return sections.schedules(bench.large, bench.size.repeats, bench.size.levels)


def _command(bench: Bench) -> dict[str, Section]:
    return sections.command(bench.size.repeats)


def _repeated(bench: Bench) -> dict[str, Section]:
    return repeated(bench.size.few, *bench.size.repeated)


def _cheap(bench: Bench) -> dict[str, Section]:
    return cheap(bench.size.few, *bench.size.cheap)


PARTS: dict[str, Callable[[Bench], dict[str, Section]]] = {
    "frames": _frames,
    "shipped": _shipped,
    "painted": _painted,
    "layers": _layers,
    "lens": _lens,
    "plain": _plain,
    "wavelengths": _wavelengths,
    "effects": _effects,
    "sweeps": _sweeps,
    "growth": _growth,
    "schedules": _schedules,
    "command": _command,
    "repeated": _repeated,
    "cheap": _cheap,
}


def measure(
    size: Size, parts: Sequence[str] = (), tell: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """The figures of some parts, by default all, as they go to JSON.

    tell: is called with the name of each part before it begins.
    """
    out: dict[str, Any] = {
        "processors": available_workers(),
        "size": list(size.frame),
        "repeats": size.repeats,
    }
    found: dict[str, Section] = {}
    with ExitStack() as stack:
        bench = Bench(size, stack)
        tell("yardstick")
        out["r_compute"] = asdict(bench.unit.compute(1))
        for part in parts or PARTS:
            tell(part)
            found |= PARTS[part](bench)
    return {**out, "sections": found}
