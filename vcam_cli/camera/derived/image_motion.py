"""How the image of a moving scene goes over the sensor of a moving camera."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.camera_angles import CameraAngles, camera_angles, require_times
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.geometry import geometry as solve
from vcam_cli.camera.derived.line_times import LineTimes, line_times
from vcam_cli.errors import bad
from vcam_cli.physics.motion_blur import turned_back
from vcam_cli.records import dataclass

SCENE, CAMERA = ("scene", "source", "motion"), ("scene", "camera_motion")


@dataclass(frozen=True)
class Trajectory:
    """Where the image of the scene is at any time, from where its file says at `reference`.

    The scene turns about its center and passes by; the camera's roll turns what it sees of that,
    pan and tilt displace it. A camera that turns by an angle moves the image on its axis by the
    angle times the image distance, against the turn. Off the axis that is less than the truth by
    1 + tan^2 of the field angle.
    """

    scene_x: float
    scene_y: float
    """Velocity of the scene's image, to the right and down in the picture as seen [m/s]."""
    scene_turn: float
    """Turning speed of the scene, clockwise [rad/s]."""
    pan: float
    tilt: float
    roll: float
    """Constant turning speeds of the camera [rad/s]."""
    image_distance: float
    """Distance from the lens to the sensor [m]."""
    reference: float
    """When the scene is where its file says [s]."""
    recorded: CameraAngles | None = None
    """The camera's angles in place of constant speeds."""

    @property
    def turns(self) -> bool:
        """Whether the image turns about its center."""
        rolls = self.recorded.rolls if self.recorded else self.roll
        return bool(self.scene_turn or rolls)

    @property
    def velocity(self) -> tuple[float, float]:
        """Constant velocity of the image on the axis, without its turning [m/s]."""
        return (
            self.scene_x - self.pan * self.image_distance,
            self.scene_y + self.tilt * self.image_distance,
        )

    @property
    def moves(self) -> bool:
        """Whether the image moves at all."""
        return self.recorded is not None or self.turns or any(self.velocity)

    def camera_angles(self, times: Array) -> tuple[Array, Array, Array]:
        """Return the camera's pan, tilt and roll since the reference, at times [rad]."""
        late = np.asarray(times, dtype=float) - self.reference
        if self.recorded is None:
            return self.pan * late, self.tilt * late, self.roll * late
        first = self.recorded.angles_at(np.array(self.reference))
        now = self.recorded.angles_at(np.asarray(times, dtype=float))
        pan, tilt, roll = (after - before for after, before in zip(now, first, strict=True))
        return pan, tilt, roll

    def image_turn(self, times: Array) -> Array:
        """Return by how much the image is turned at times, clockwise [rad]."""
        late = np.asarray(times, dtype=float) - self.reference
        return np.asarray(self.scene_turn * late - self.camera_angles(times)[2])

    def displacement(self, times: Array) -> tuple[Array, Array]:
        """Return where the image's center is at times, if nothing turns about it [m]."""
        late = np.asarray(times, dtype=float) - self.reference
        pan, tilt, _ = self.camera_angles(times)
        return (
            self.scene_x * late - pan * self.image_distance,
            self.scene_y * late + tilt * self.image_distance,
        )

    def still_places(self, x: Array, y: Array, times: Array) -> tuple[Array, Array]:
        """Return where in the still image is what lies at places of the sensor at their times.

        Parameters
        ----------
        x, y : Array
            Positions right of the axis and below it [m].
        times : Array
            Times [s]; the three have shapes that go together.

        Returns
        -------
        tuple of Array
            Positions in the image as it is at the reference [m].
        """
        late = times - self.reference
        pan, tilt, roll = self.camera_angles(times)
        moved_x, moved_y = x + pan * self.image_distance, y - tilt * self.image_distance
        if not self.turns:
            return moved_x - self.scene_x * late, moved_y - self.scene_y * late
        seen_x, seen_y = turned_back(moved_x, moved_y, -roll)
        return turned_back(
            seen_x - self.scene_x * late, seen_y - self.scene_y * late, self.scene_turn * late
        )

    def moved_places(self, x: Array, y: Array, times: Array) -> tuple[Array, Array]:
        """Return where on the sensor is at its time what lies at places of the still image.

        The inverse of `still_places`, with its parameters [m], [s].
        """
        late = times - self.reference
        pan, tilt, roll = self.camera_angles(times)
        seen_x, seen_y = x, y
        if self.turns:
            seen_x, seen_y = turned_back(x, y, -self.scene_turn * late)
        seen_x, seen_y = seen_x + self.scene_x * late, seen_y + self.scene_y * late
        if self.turns:
            seen_x, seen_y = turned_back(seen_x, seen_y, roll)
        return seen_x - pan * self.image_distance, seen_y + tilt * self.image_distance


@dataclass(frozen=True)
class ExposedMotion:
    """Motion, and when the lines of an array see it."""

    trajectory: Trajectory
    lines: LineTimes
    begin: float
    """When the exposure of the first line begins [s]."""
    time: float
    """How long a line is exposed [s]."""

    def part_of_exposure(self, start: float, stop: float) -> ExposedMotion:
        """Return that from `start` to `stop` after a line's exposure begins [s]."""
        return replace(self, begin=self.begin + start, time=stop - start)

    @property
    def centered(self) -> ExposedMotion:
        """The same of all pixels together, about the reference."""
        begin = self.trajectory.reference - self.time / 2
        return replace(self, lines=replace(self.lines, line_time=0.0), begin=begin)

    def times(self, x: Array, y: Array, share: float) -> Array:
        """Return when pixels at x (columns,), y (rows,) [m] have had a share of their exposure [s].

        The shape is (rows or 1, columns or 1).
        """
        return self.lines.starts(x, y) + (self.begin + share * self.time)

    @property
    def middle(self) -> float:
        """The middle of the exposure of the array's middle [s]."""
        return self.begin + (self.lines.last / 2 + self.time / 2)


def exposed_motion(camera: Camera, geometry: Geometry) -> ExposedMotion | None:
    """Return the motion of a camera's image; None where nothing moves.

    Where the length of the exposure is left to the camera, its longest stands in for it.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Its geometry.

    Raises
    ------
    BadInput
        For a file of angles that cannot be read or does not cover the exposure.
    """
    if not camera.scene.moves:
        return None
    lines, time, begin = line_times(camera, geometry), camera.exposure.longest_allowed, 0.0
    begin = camera.exposure.start
    reference = camera.exposure.reference
    if reference is None:
        reference = time / 2 + lines.last / 2
    path = trajectory(camera, geometry, reference)
    if path.recorded is not None:
        require_times(path.recorded, min(begin, reference), begin + lines.last + time)
        require_times(path.recorded, 0.0, reference)
    return ExposedMotion(path, lines, begin, time) if path.moves else None


def trajectory(camera: Camera, geometry: Geometry, reference: float = 0.0) -> Trajectory:
    """Return the motion of a camera's image, from a time on at which nothing has moved [s]."""
    motion, turn = camera.scene.source.motion, camera.scene.camera_motion
    scale = geometry.scene_scale
    return Trajectory(
        scene_x=motion.x * scale if motion else 0.0,
        scene_y=motion.y * scale if motion else 0.0,
        scene_turn=motion.rotate if motion else 0.0,
        pan=turn.pan if turn else 0.0,
        tilt=turn.tilt if turn else 0.0,
        roll=turn.roll if turn else 0.0,
        image_distance=geometry.image_distance,
        reference=reference,
        recorded=camera_angles(turn.file) if turn and turn.file else None,
    )


def check_motion(camera: Camera) -> None:
    """Refuse motion whose image is not known (BadInput)."""
    turn = camera.scene.camera_motion
    if turn is not None and turn.jitter and not camera.optics.is_lens:
        raise bad((*CAMERA, "jitter"), "a bare sensor forms no image that could move", "remove it")
    if not camera.scene.moves:
        return
    motion = camera.scene.source.motion
    if not camera.optics.is_lens:
        path = SCENE if motion else CAMERA
        raise bad(path, "a bare sensor forms no image that could move", "remove it")
    if motion and (motion.x or motion.y) and math.isinf(camera.scene.distance):
        message = "an object at infinity has no speed in meters per second"
        raise bad(SCENE, message, "give scene.distance, or scene.camera_motion: {pan: 10 deg/s}")
    exposed_motion(camera, solve(camera))
