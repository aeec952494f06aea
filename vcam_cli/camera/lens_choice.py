"""What stands before the sensor: a lens, or nothing."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Literal

from vcam_cli.camera.optics import Optics
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.values import Either
from vcam_cli.config.yaml_type import to_yaml


class NoLens(Optics):
    """Nothing before the sensor: the scene's light falls on it as it would on a white diffuser."""

    rules = ()

    @property
    def is_lens(self) -> bool:
        """False: this camera has no lens."""
        return False


@cache
def _no_lens() -> NoLens:
    return NoLens.model_validate({"transmittance": 1, "off_axis": "none", "diffraction": False})


def _optics(given: Any) -> Optics:
    if given == "none":
        return _no_lens()
    if isinstance(given, (Mapping, Optics)):
        return Optics.model_validate(given)
    remedy = "write {f_number: 2.8, focal_length: 3.2 mm}, the name of a part, or none"
    raise ValueError(f"{describe(given)} is no lens; {remedy}")


OPTICS = Either(
    _optics,
    Literal["none"] | Optics,
    yaml_form=lambda optics: to_yaml(optics) if optics.is_lens else "none",
)
"""The type of `optics`."""
