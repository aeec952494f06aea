"""Layers of a scene, each solved as what the camera sees that looks at it alone."""

from __future__ import annotations

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.scene.scene import Scene
from vcam_cli.effects.base import Effect
from vcam_cli.records import dataclass
from vcam_cli.solve.effects import camera_effects


@dataclass(frozen=True)
class SolvedLayer:
    """One layer of a scene."""

    scene: Scene
    """The layer alone, at its distance."""
    geometry: Geometry
    """Geometry of the camera that is focused as before and sees the layer."""
    effects: tuple[Effect, ...]
    """Enabled effects that act on its light, in the order of action."""
    radius: float
    """Of a point's blur by defocus; positive where the layer is nearer than what is in focus [m]"""


def solve_layer(alone: Camera) -> SolvedLayer:
    """Return the geometry, effects and defocus of one layer of a scene.

    Parameters
    ----------
    alone : Camera
        Camera that looks at this layer only.

    Returns
    -------
    SolvedLayer
        Solved layer.
    """
    solved = geometry(alone)
    shift = alone.optics.defocus + solved.focus_shift
    radius = shift / (2 * solved.working_f_number)
    return SolvedLayer(alone.scene, solved, camera_effects(alone, solved).mean_signal, radius)
