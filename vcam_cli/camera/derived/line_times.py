"""When the lines of a rolling shutter begin their exposure."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.array import Positions
from vcam_cli.errors import bad
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class LineTimes:
    """Starts of exposure, line after line; of a global shutter all at once."""

    line_time: float
    """From the start of one line to that of the next [s]; 0 of a global shutter."""
    direction: str
    rows: int
    columns: int
    pitch_x: float
    pitch_y: float
    """Distances of columns and rows [m]."""

    @property
    def go_along_y(self) -> bool:
        """Whether the lines are rows."""
        return self.direction in ("down", "up")

    @property
    def last(self) -> float:
        """When the exposure of the last line begins, after that of the first [s]."""
        return self.line_time * ((self.rows if self.go_along_y else self.columns) - 1)

    def starts(self, x: Array, y: Array) -> Array:
        """Return when the exposure of pixels begins, after that of the first line [s].

        Their positions are right of the axis (columns,) and below it (rows,) [m]. The shape is
        (rows or 1, columns or 1): 1 where the times are the same along that axis.
        """
        if self.line_time == 0:
            return np.zeros((1, 1))
        at, pitch, count = (
            (y, self.pitch_y, self.rows) if self.go_along_y else (x, self.pitch_x, self.columns)
        )
        line = np.clip(np.floor(at.astype(float) / pitch + count / 2), 0, count - 1)
        if self.direction in ("up", "left"):
            line = count - 1 - line
        times = self.line_time * line
        return times[:, None] if self.go_along_y else times[None, :]


def line_times(camera: Camera, geometry: Geometry) -> LineTimes:
    """Return when the lines of a camera's array begin their exposure."""
    rolling = camera.exposure.rolling
    size = (geometry.rows, geometry.columns, geometry.pitch_x, geometry.pitch_y)
    if rolling is None:
        return LineTimes(0.0, "down", *size)
    return LineTimes(rolling.line_time, rolling.direction, *size)


def check_shutter(camera: Camera) -> None:
    """Refuse a rolling shutter where it is not known which pixels are read together (BadInput)."""
    if camera.exposure.rolling is None:
        return
    path, binning = ("exposure", "shutter"), camera.array.binning
    if isinstance(camera.array.pattern, Positions):
        message = "pixels at free positions have no lines for a rolling shutter"
        raise bad(path, message, "write shutter: global")
    if binning is not None and binning.kind != "digital":
        message = f"a rolling shutter with {binning.kind} binning is not built yet"
        raise bad(path, message, "write shutter: global, or binning of kind digital")
