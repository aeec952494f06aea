"""`vcam verify`: measured signals beside those that a camera file predicts, and their errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.errors import BadInput, Collector
from vcam_cli.progress import Observer, Silent
from vcam_cli.verification.frames import raise_if_any
from vcam_cli.verification.measured_points import Points, measured_points
from vcam_cli.verification.model import UNITS, Measurement
from vcam_cli.verification.prediction import check, predict

COLUMNS = ("frame", "channel", "quantity", "measured", "predicted", "error_percent")


@dataclass(frozen=True)
class Row:
    """A measured quantity, and what was predicted of it."""

    frame: str
    """Name of the entry of the measurement."""
    channel: str
    """Color of the pixels; "" where there is but one."""
    quantity: str
    """What it is, with its unit: mean [V]."""
    measured: float
    predicted: float
    tolerance: float | None
    """Largest error that is asked for, relative; None for none."""

    @property
    def error(self) -> float:
        """The prediction's error relative to what was measured; inf where that is 0."""
        if self.measured == 0:
            return 0.0 if self.predicted == 0 else float(np.copysign(np.inf, self.predicted))
        return (self.predicted - self.measured) / abs(self.measured)

    @property
    def missed(self) -> bool:
        """Whether the error is larger than its tolerance."""
        return self.tolerance is not None and abs(self.error) > self.tolerance

    @property
    def cells(self) -> tuple[str | float, ...]:
        """The row of verify.csv."""
        named = (self.frame, self.channel, self.quantity)
        return (*named, self.measured, self.predicted, 100 * self.error)


@dataclass(frozen=True)
class Verification:
    """A measurement beside the predictions of a camera."""

    camera: Camera
    measurement: Measurement
    rows: tuple[Row, ...]
    notes: tuple[str, ...]

    @property
    def errors(self) -> NDArray:
        """The errors of all rows, relative."""
        return np.array([row.error for row in self.rows])

    @property
    def missed(self) -> tuple[Row, ...]:
        """The rows whose tolerance is missed."""
        return tuple(row for row in self.rows if row.missed)

    def summary(self) -> dict[str, float | int]:
        """Return numbers of the errors [%]: mean, rms, largest; how many rows miss a tolerance."""
        percent = 100 * self.errors
        return {
            "count": len(percent),
            "mean_error_percent": float(percent.mean()),
            "rms_error_percent": float(np.sqrt(np.mean(percent**2))),
            "largest_error_percent": float(np.abs(percent).max()),
            "missed": len(self.missed),
        }

    def report(self) -> dict[str, Any]:
        """Return what `verify.json` and `--json` say."""
        return {
            "name": self.measurement.name,
            "camera_name": self.camera.name,
            **self.summary(),
            "rows": [dict(zip(COLUMNS, row.cells, strict=True)) for row in self.rows],
            "notes": list(self.notes),
        }


def verify(camera: Camera, measurement: Measurement, watch: Observer | None = None) -> Verification:
    """Predict every entry of a measurement.

    Parameters
    ----------
    camera : Camera
        The camera; its scene, lens and exposure give way to the measurement's.
    measurement : Measurement
        What was measured.
    watch : Observer, optional
        Told of the progress.

    Raises
    ------
    BadInput
        With every entry that the camera cannot predict.
    """
    points, notes = measured_points(camera, measurement)
    _check_all(camera, measurement, points)
    return Verification(
        camera,
        measurement,
        tuple(_rows(camera, measurement, points, watch or Silent())),
        (*_notes(camera), *notes),
    )


def _check_all(camera: Camera, measurement: Measurement, points: Points) -> None:
    problems = Collector()
    for number, point in points:
        try:
            check(camera, point)
        except BadInput as error:
            for p in error.problems:
                problems.add(("frames", number, *p.path), p.message, p.remedy)
    raise_if_any(problems, measurement)


def _rows(
    camera: Camera, measurement: Measurement, points: Points, watch: Observer
) -> Iterator[Row]:
    for done, (number, point) in enumerate(points):
        watch.step(done, len(points))
        tolerance = measurement.tolerance if point.tolerance is None else point.tolerance
        yield Row(
            measurement.label(number),
            point.channel,
            f"mean [{UNITS[point.signal.channel]}]",
            point.signal.value,
            predict(camera, point).value,
            tolerance,
        )


def _notes(camera: Camera) -> Iterator[str]:
    if camera.optics.is_lens:
        yield "the camera's lens is left out: what was measured of light is that on the sensor"
