"""How fast the image of a moving scene goes over the sensor."""

from __future__ import annotations

import math

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.errors import bad

SCENE, CAMERA = ("scene", "source", "motion"), ("scene", "camera_motion")


def image_velocity(camera: Camera, geometry: Geometry) -> tuple[float, float]:
    """Return the velocity of the image, to the right and down in the picture as seen [m/s].

    A scene's speed is multiplied by the size of the magnification; a camera that turns by w moves
    the image on its axis by w times the image distance, against the turn. Off the axis that is
    less than the truth by 1 + tan^2 of the field angle.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Its geometry.

    Returns
    -------
    tuple of float
        Velocity along x and y [m/s].
    """
    x = y = 0.0
    if motion := camera.scene.source.motion:
        scale = -geometry.magnification
        x, y = motion.x * scale, motion.y * scale
    if turn := camera.scene.camera_motion:
        x -= turn.pan * geometry.image_distance
        y += turn.tilt * geometry.image_distance
    return x, y


def check_motion(camera: Camera) -> None:
    """Refuse motion where its image is not known, or not built yet (BadInput)."""
    if not camera.scene.moves:
        return
    motion, exposure = camera.scene.source.motion, camera.exposure
    path = SCENE if motion else CAMERA
    if not camera.optics.is_lens:
        raise bad(path, "a bare sensor forms no image that could move", "remove it")
    if motion and (motion.x or motion.y) and math.isinf(camera.scene.distance):
        message = "what is infinitely far does not move by meters a second"
        raise bad(SCENE, message, "give scene.distance, or scene.camera_motion: {pan: 10 deg/s}")
    if exposure.auto is not None:
        message = "motion with an automatic exposure is not built yet"
        raise bad(path, message, "give exposure.time")
    if exposure.captures is not None:
        message = "motion with several samples of one integration is not built yet"
        raise bad(path, message, "give exposure.time in place of captures")
    if exposure.rolling is not None and exposure.rolling.direction in ("left", "right"):
        message = "motion with a shutter that rolls along rows is not built yet"
        raise bad(path, message, "write direction: down or up, or shutter: global")
