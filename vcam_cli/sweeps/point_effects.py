"""Which effects the points of a sweep simulate: all that each camera describes.

One plan holds for all points, with everything on, so that no jump of a curve comes from a plan.
Leaving out what no point calls for would keep that promise too, but costs more than it gains: the
light of every point has to be planned before any is computed, whoever computes it, and a study that
is extended could not keep its points, since others may call for more. On the shipped studies a plan
for each light takes 16 to 68 % of the time of the points, and points with plans of their own take
0.99 to 1.07 of that with everything on.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from vcam_cli.accuracy_study.ablation import with_effects
from vcam_cli.camera.camera import Camera
from vcam_cli.effects.order import ORDER
from vcam_cli.sweeps.sweep_points import Point


def with_every_effect(camera: Camera) -> Camera:
    """Return the camera with all effects on but those that its file switches off."""
    return with_effects(camera, "all")


def with_named_effects(camera: Camera, names: Sequence[str]) -> Camera:
    """Return the same where the names of these effects are known, which takes no time."""
    own = camera.effects if isinstance(camera.effects, dict) else {}
    off = {name for name, wish in own.items() if wish == "off"}
    states = {name: "off" if name in off else "on" for name in sorted(off.union(names))}
    return camera.model_copy(update={"effects": states})


def effect_differences(points: Iterable[Point]) -> str:
    """Return a line on effects that some points simulate and others do not; empty without any.

    Such as a noise that the study varies from nothing, or what a case switches off.
    """
    cameras = {p.content: p.effects for p in points if p.id}
    counts = Counter(name for names in cameras.values() for name in names)
    some = [kind.name for kind in ORDER if 0 < counts[kind.name] < len(cameras)]
    if not some:
        return ""
    listed = ", ".join(f"{name} in {counts[name]} of {len(cameras)}" for name in some)
    return f"the camera files of this sweep set different effects: {listed}"
