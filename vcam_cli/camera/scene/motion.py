"""How a scene and its camera move while a frame is exposed."""

from typing import Annotated, Self

from pydantic import model_validator

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import FileName, mapping

Speed = Annotated[float, Quantity("speed", least=-3e8, most=3e8)]
TurningSpeed = Annotated[float, Quantity("turning_speed", least=-1e6, most=1e6)]


class SceneMotion(Model):
    """Motion of a scene, in the orientation of the displayed picture."""

    x: Speed = key("to the right, in the scene's plane", example="0.5 m/s", default=0.0)
    y: Speed = key("down, in the scene's plane", example="0.5 m/s", default=0.0)
    rotate: TurningSpeed = key(
        "clockwise, about the scene's point in the picture's center",
        example="5 deg/s",
        default=0.0,
    )

    @property
    def moves(self) -> bool:
        """Whether it is any motion."""
        return bool(self.x or self.y or self.rotate)


MaybeMotion = Annotated[SceneMotion | None, mapping(SceneMotion)]
MOTION = key("motion during the exposure", example={"x": "0.5 m/s"}, default=None)
"""The key of every source."""


class MovingSource(Model):
    """A source that may move as a whole."""

    def standing_still(self) -> Self:
        """Return the same source without motion."""
        return self.model_copy(update={"motion": None})


class CameraMotion(Model):
    """Rotation of the camera about its lens, at constant speeds or from a gyroscope's record."""

    pan: TurningSpeed = key("to the right", example="10 deg/s", default=0.0)
    tilt: TurningSpeed = key("upward", example="10 deg/s", default=0.0)
    roll: TurningSpeed = key(
        "about the optical axis, clockwise for the photographer", example="5 deg/s", default=0.0
    )
    jitter: Annotated[float, Quantity("pixels", least=0, most=1000)] = key(
        "fast random pointing, rms along each axis: a blur, the same in every frame",
        example="0.5 px",
        default=0.0,
    )
    file: Annotated[str | None, FileName()] = key(
        "angles or rates over time in place of constant speeds: a CSV file with a column of time"
        " (time_s, timestamp [ns]) and some of pan, tilt, roll (pan_deg) or gyro_x, gyro_y, gyro_z"
        " (gyro_x [rad/s]; x right, y down, z forward)",
        example="imu.csv",
        default=None,
    )

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        for name in ("pan", "tilt", "roll"):
            if self.file is not None and getattr(self, name):
                message = "is a constant speed in addition to a file of angles"
                raise refusal((name,), message, "remove one of them")
        return self

    @property
    def moves(self) -> bool:
        """Whether it turns over time; a file counts as motion without being read."""
        return bool(self.pan or self.tilt or self.roll or self.file)
