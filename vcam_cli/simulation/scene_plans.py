"""The plans of one camera before many scenes: which effects are simulated before each.

Without files of the user's own, the scenes are six charts in the light of a street at night, of a
room, and of the sun.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

from vcam_cli.effects.order import ORDER
from vcam_cli.progress import Observer, Silent
from vcam_cli.records import dataclass
from vcam_cli.simulation.checks import load
from vcam_cli.simulation.plan import Decision, Plan
from vcam_cli.simulation.scene_times import SceneTimes, measure
from vcam_cli.simulation.simulate import prepare, threads

CHARTS = (
    "uniform", "step-wedge", "colorchecker", "dead-leaves", "slanted-edge", "hdr-patches",
)  # fmt: skip
LUMINANCES = (0.5, 100, 20000)
"""Luminances of the perfect white [cd/m2]."""
COLUMNS = ("scene", "effect", "state", "contribution", "allowed", "seconds")
MEASURED = ("seconds_auto", "seconds_all")
"""Further columns where frames were taken."""
NEVER_SKIPPED = frozenset(kind.name for kind in ORDER if not kind.removable)
"""Effects that no plan skips."""
LEAST_SAVED = 5e-5
"""Least time that is shown as saved [s]: a twentieth of a millisecond."""


@dataclass(frozen=True)
class ScenePlan:
    """The plan of a camera before one scene."""

    scene: str
    plan: Plan
    times: SceneTimes | None = None
    """Measured seconds, where frames were taken."""

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """Decisions on the effects that the camera has, in their order."""
        return tuple(d for d in self.plan.decisions if d.by != "camera")

    @property
    def seconds(self) -> tuple[float, float]:
        """Seconds of a frame with the plan and with all effects [s]: measured, else estimated."""
        if self.times is not None:
            return self.times.seconds_auto, self.times.seconds_all
        return self.plan.seconds, max(self.plan.seconds, self.plan.seconds_of_all)


def scene_settings(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return scenes and the overrides that put each before a camera.

    Parameters
    ----------
    names : sequence of str
        "all" for the charts in three lights; else scene files, or names of shipped scenes.

    Returns
    -------
    dict
        Name of a scene -> overrides as of `--set`.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name in names:
        if name == "all":
            for chart, luminance in itertools.product(CHARTS, LUMINANCES):
                found[f"{chart}, {luminance:g} cd/m2"] = (
                    f"scene.source={{kind: chart, chart: {chart}}}",
                    f"scene.luminance={luminance:g} cd/m2",
                )
        else:
            path = Path(name)
            found[path.stem] = (f"scene={path.resolve() if path.suffix else name}",)
    return found


def plan_scenes(
    camera: str,
    overrides: Sequence[str],
    scenes: Sequence[str],
    workers: int | None = None,
    turns: int = 0,
    watch: Observer | None = None,
) -> Iterator[ScenePlan]:
    """Plan a camera before each of several scenes, and measure its frames where that is wanted.

    Parameters
    ----------
    camera : str
        Camera file, or name of a shipped camera.
    overrides : sequence of str
        Overrides of its keys as of `--set`; those of the scenes come after them.
    scenes : sequence of str
        Scenes as for `scene_settings`.
    workers : int, optional
        Number of threads.
    turns : int
        Frames taken before each scene with the plan, and as many with all effects; 0: no frame is
        taken.
    watch : Observer, optional
        Observer of the scenes.

    Yields
    ------
    ScenePlan
        Plan before one scene, in their order.

    Raises
    ------
    BadInput
        For a scene that cannot be, or that the camera cannot be put before.
    CannotDo
        Where memory does not suffice.
    """
    watch, settings = watch or Silent(), scene_settings(scenes)
    watch.begin("scenes")
    for number, (scene, sets) in enumerate(settings.items()):
        watch.step(number, len(settings))
        made = load(camera, (*overrides, *sets))
        plan = prepare(made, workers)[0].plan
        times = measure(made, plan.decisions, workers or threads(made), turns) if turns else None
        yield ScenePlan(scene, plan, times)


def columns(plans: Sequence[ScenePlan]) -> tuple[str, ...]:
    """Return the columns of scenes.csv, with those of measured times where there are some.

    Parameters
    ----------
    plans : sequence of ScenePlan
        Plans of scenes.

    Returns
    -------
    tuple of str
        Names of the columns.
    """
    return COLUMNS + MEASURED if any(each.times for each in plans) else COLUMNS


def rows(plans: Sequence[ScenePlan]) -> Iterator[tuple[str | float, ...]]:
    """Yield the rows of scenes.csv: one effect before one scene each.

    Parameters
    ----------
    plans : sequence of ScenePlan
        Plans of scenes.

    Yields
    ------
    tuple of str or float
        Values in the order of `columns`.
    """
    for each in plans:
        taken = each.seconds if each.times else ()
        for d in each.decisions:
            amounts = ("" if value is None else value for value in (d.contribution, d.allowed))
            seconds = d.seconds if d.state == "on" else d.saved
            yield (each.scene, d.name, d.state, *amounts, seconds, *taken)


def time_text(time: float) -> str:
    """Return a time to two digits or more, without a power of ten.

    Parameters
    ----------
    time : float
        Time, in any unit.

    Returns
    -------
    str
        Text.
    """
    return f"{time:.2g}" if time < 9.95 else f"{time:.0f}"


def mark(decision: Decision) -> str:
    """Return the cell of a table for an effect before a scene.

    Parameters
    ----------
    decision : Decision
        Decision of the plan on the effect.

    Returns
    -------
    str
        "on" if it is simulated, "free" if it is simulated because skipping it would save nothing,
        "off" if the file switches it off; if the plan skips it, the milliseconds saved, or nothing.
    """
    if decision.state == "on":
        return "free" if decision.free else "on"
    if decision.by == "user":
        return "off"
    return time_text(1000 * decision.saved) if decision.saved >= LEAST_SAVED else ""


def effect_names(plans: Sequence[ScenePlan]) -> list[str]:
    """Return the names of the effects that occur, in the order of action.

    Parameters
    ----------
    plans : sequence of ScenePlan
        Plans of scenes.

    Returns
    -------
    list of str
        Names.
    """
    present = {d.name for each in plans for d in each.decisions}
    return [kind.name for kind in ORDER if kind.name in present]
