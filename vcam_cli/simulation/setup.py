"""What follows from a camera file before any light is known: places, circuit, settings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.image_formation.settings import Settings, camera_settings
from vcam_cli.readout import iso_speed
from vcam_cli.readout.layout import Layout, camera_layout


@dataclass(frozen=True)
class CameraSetup:
    """A camera, and what follows from its file alone."""

    camera: Camera
    """The camera at the gain of its exposure."""
    geometry: Geometry
    """Geometry of its array, lens and scene."""
    layout: Layout
    """Where its pixels are, and the lattice on which their light is computed."""
    electrical: Electrical
    """Its circuit at that gain."""
    settings: Settings
    """Settings of image formation on the lattice."""
    base_iso: float
    """ISO speed at gain 1; 0 of a camera that sees nothing of daylight."""

    def at_gain(self, gain: float) -> Self:
        """Return the setup of the same camera at another gain of the exposure."""
        camera = self.camera.with_exposure_gain(gain)
        return replace(self, camera=camera, electrical=electrical(camera))


def camera_setup(camera: Camera) -> CameraSetup:
    """Return the setup of a camera. Raise BadInput where its file contradicts itself."""
    solved = geometry(camera)
    layout = camera_layout(camera, solved)
    base_iso = iso_speed.base_iso(camera, solved, layout)
    camera = iso_speed.set_gain(camera, base_iso)
    circuit = electrical(camera)
    settings = layout.settings(camera_settings(camera))
    return CameraSetup(camera, solved, layout, circuit, settings, base_iso)
