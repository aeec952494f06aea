"""The plans of one camera before many scenes: which effects each scene calls for.

Without files of the user's own, the scenes are six charts in the light of a street at night, of a
room, and of the sun.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vcam_cli.effects.order import ORDER
from vcam_cli.simulation.checks import load
from vcam_cli.simulation.plan import Decision, Plan
from vcam_cli.simulation.simulate import prepare

CHARTS = (
    "uniform", "step-wedge", "colorchecker", "dead-leaves", "slanted-edge", "hdr-patches",
)  # fmt: skip
LUMINANCES = (0.5, 100, 20000)
"""Luminances of the perfect white [cd/m2]."""
COLUMNS = ("scene", "effect", "state", "contribution", "allowed", "seconds")


@dataclass(frozen=True)
class ScenePlan:
    """The plan of a camera before one scene."""

    scene: str
    plan: Plan

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """Decisions on the effects that the camera has, in their order."""
        return tuple(d for d in self.plan.decisions if d.by != "camera")

    @property
    def saved(self) -> float:
        """Estimated time that the plan saves of a frame with every effect [s]."""
        return max(0.0, self.plan.seconds_of_all - self.plan.seconds)


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
    camera: str, overrides: Sequence[str], scenes: Sequence[str], workers: int | None = None
) -> Iterator[ScenePlan]:
    """Plan a camera before each of several scenes; no frame is exposed.

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

    Raises
    ------
    BadInput
        For a scene that cannot be, or that the camera cannot be put before.
    CannotDo
        Where memory does not suffice.
    """
    for scene, sets in scene_settings(scenes).items():
        ready, _ = prepare(load(camera, (*overrides, *sets)), workers)
        yield ScenePlan(scene, ready.plan)


def rows(plans: Sequence[ScenePlan]) -> Iterator[tuple[str | float, ...]]:
    """Return the rows of scenes.csv: one effect before one scene each, by `COLUMNS`."""
    for each in plans:
        for d in each.decisions:
            amounts = ("" if value is None else value for value in (d.contribution, d.allowed))
            yield (each.scene, d.name, d.state, *amounts, d.seconds if d.state == "on" else d.saved)


def effect_names(plans: Sequence[ScenePlan]) -> list[str]:
    """Return the names of the effects that occur, in the order of action."""
    present = {d.name for each in plans for d in each.decisions}
    return [kind.name for kind in ORDER if kind.name in present]
