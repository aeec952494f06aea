"""Flicker of the lamp: every line integrates the light at its own time.

    E / mean = 1 + depth sinc(F T) cos(2 pi F (t + T / 2) + phase)

F is the lamp's frequency, t the start of the line's exposure and T its length: an exposure of a
whole number of periods has no modulation. A lamp with `duty` is on for that part of each period.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.line_times import LineTimes, line_times
from vcam_cli.camera.scene.illuminant import FlickerSpec
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import TemporalGain
from vcam_cli.physics import flicker
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Flicker(TemporalGain):
    """Modulation of the light: bands under a rolling shutter, one factor under a global one."""

    lamp: FlickerSpec
    lines: LineTimes
    begin: float = 0.0
    """When the exposure of the first line begins [s]."""

    name = "flicker"
    reference = "CIE TN 006:2016; the mean over an exposure is in closed form"
    absent = "scene.illuminant has no flicker"
    seconds_per_pixel = 1e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the flicker of the scene's lamp, or None where its light is steady."""
        lamp = camera.scene.illuminant
        if lamp is None or lamp.flicker is None or lamp.flicker.depth == 0:
            return None
        return cls(lamp.flicker, line_times(camera, geometry), camera.exposure.start)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        lamp = self.lamp
        if self.lines.last == 0:
            where = "no bands"
        else:
            where = f"{self.lines.last * lamp.frequency:.3g} bands over the frame"
        return f"{lamp.frequency:.6g} Hz, depth {100 * lamp.depth:.3g} %, {where}"

    def gain(self, x: Array, y: Array, start: float, stop: float) -> Array:
        """Return the mean light from `start` to `stop` after a line's exposure begins [s]."""
        time, lamp = stop - start, self.lamp
        begin = self.lines.starts(x, y) + (self.begin + start)
        known = (lamp.frequency, lamp.depth)
        if lamp.duty is None:
            return flicker.sinusoid_mean(begin, time, *known, lamp.phase)
        return flicker.pulse_mean(begin, time, *known, lamp.duty, lamp.phase)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        lamp = self.lamp
        most = flicker.most_change(signal.time, lamp.frequency, lamp.depth, lamp.duty)
        return most * signal.full_signal
