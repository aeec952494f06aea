"""Layers at different distances: each has its own defocus and occludes those behind it.

    E = sum_i T_i[E_i a_i] prod_{j < i} (1 - T_j[a_j]) - covariances over the aperture

E_i and a_i are the light and the opacity of layer i, the nearest first; T_i is the blur of its
distance d before a lens that is focused at s: a shift of the image plane by v^2 (1/d - 1/s).

`image_formation.layers` computes it. If skipped, all layers are in focus.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.geometry import geometry as solve
from vcam_cli.camera.derived.scene_layers import layer_cameras
from vcam_cli.effects.base import Effect
from vcam_cli.physics.depth_of_field import blur_diameter
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Depth(Effect):
    """Layers with the radius of the defocus blur of each."""

    blurs: tuple[float, ...]
    """Diameters on the sensor, the nearest layer's first [m]; () where a map has the distances."""
    pitch: float
    """Of the pixels [m]."""

    name = "depth"
    reference = "blur A |1/d - 1/s| v: Ray, Applied Photographic Optics, 3rd ed., 2002"
    absent = (
        "the scene is flat, or all its layers are in focus and at rest;"
        " write source: {kind: layers, ...}, or depth: beside an image"
    )
    origin = "lens"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the layers of a scene, or None where it is flat, or sharp and at rest."""
        if camera.scene.has_depth:
            return cls((), geometry.pitch_x)
        cameras = layer_cameras(camera)
        if not cameras:
            return None
        lens = geometry.focus_distance, geometry.focal_length, geometry.f_number
        blurs = [float(blur_diameter(solve(c).object_distance, *lens)) for c in cameras]
        together = not any(blurs) and not camera.scene.moves
        return None if together else cls(tuple(blurs), geometry.pitch_x)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        if not self.blurs:
            return "the picture is cut into layers by depth, each with its own defocus"
        *others, last = (f"{blur / self.pitch:.3g}" for blur in self.blurs)
        pixels = f"{', '.join(others)} and {last}" if others else last
        return f"{len(self.blurs)} layers: defocus blurs points to {pixels} pixels"
