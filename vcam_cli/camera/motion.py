"""How a scene and its camera move while a frame is exposed."""

from typing import Annotated, Any, Self

from pydantic import model_validator

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import FileName, mapping

Speed = Annotated[float, Quantity("speed", least=-3e8, most=3e8)]
TurningSpeed = Annotated[float, Quantity("turning_speed", least=-1e6, most=1e6)]


class SceneMotion(Model):
    """Straight motion of a scene across the view, as it is seen in the picture."""

    x: Speed = key("to the right, in the scene's plane", example="0.5 m/s", default=0.0)
    y: Speed = key("down, in the scene's plane", example="0.5 m/s", default=0.0)
    rotate: TurningSpeed = key(
        "about the picture's center: not built yet", example="0 deg/s", default=0.0
    )

    @model_validator(mode="after")
    def _is_built(self) -> Self:
        return _refuse(self, "rotate", "write x and y")


MaybeMotion = Annotated[SceneMotion | None, mapping(SceneMotion)]
MOTION = key("how it moves during the exposure", example={"x": "0.5 m/s"}, default=None)
"""The key of every source."""


class CameraMotion(Model):
    """Turning of the camera about its lens."""

    pan: TurningSpeed = key("to the right", example="10 deg/s", default=0.0)
    tilt: TurningSpeed = key("upward", example="10 deg/s", default=0.0)
    roll: TurningSpeed = key(
        "about the optical axis: not built yet", example="0 deg/s", default=0.0
    )
    file: Annotated[str | None, FileName()] = key(
        "angles over time, of a gyroscope: not built yet", example="imu.csv", default=None
    )

    @model_validator(mode="after")
    def _is_built(self) -> Self:
        for name in ("roll", "file"):
            _refuse(self, name, "write pan and tilt")
        return self


def _refuse(model: Any, name: str, remedy: str) -> Any:
    """Refuse a key that is named in files but does nothing yet."""
    if getattr(model, name):
        raise refusal((name,), "is not built yet", f"{remedy}, and leave it out")
    return model
