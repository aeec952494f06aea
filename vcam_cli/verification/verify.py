"""`vcam verify`: measured signals beside those that a camera file predicts, and their errors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import BadInput, Collector
from vcam_cli.floats import rms
from vcam_cli.progress import Observer, Silent
from vcam_cli.records import dataclass
from vcam_cli.verification.edges import judge_edge
from vcam_cli.verification.frames import numbered_stacks, paths, raise_if_any
from vcam_cli.verification.measured_points import Points, measured_points, quantities_of_colors
from vcam_cli.verification.model import UNITS, Measurement
from vcam_cli.verification.pooled import MAIN, Pooled, is_clipped, pool
from vcam_cli.verification.prediction import check, predict
from vcam_cli.verification.stack_prediction import Judged, bound, judge

COLUMNS = (
    *("frame", "channel", "quantity", "measured", "predicted", "error_percent"),
    *("deviation", "bound", "verdict"),
)


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
    """Largest allowed error, relative; None: no limit."""
    deviation: float | None = None
    """Student's t of what was measured among what is predicted; None of a mean without noise."""
    bound: float | None = None
    """The deviation beyond which the two differ."""

    @property
    def error(self) -> float:
        """The prediction's error relative to what was measured; inf where that is 0."""
        if self.measured == 0:
            return 0.0 if self.predicted == 0 else float(np.copysign(np.inf, self.predicted))
        return (self.predicted - self.measured) / abs(self.measured)

    @property
    def differs(self) -> bool:
        """Whether the difference is significant; unknown counts as yes."""
        return self.deviation is None or self.bound is None or abs(self.deviation) > self.bound

    @property
    def missed(self) -> bool:
        """Whether the error is significant and exceeds its tolerance."""
        return self.tolerance is not None and abs(self.error) > self.tolerance and self.differs

    @property
    def verdict(self) -> str:
        """missed, differs (significant), agrees; "" without a test of significance."""
        if self.missed:
            return "missed"
        return "" if self.deviation is None else "differs" if self.differs else "agrees"

    @property
    def cells(self) -> tuple[str | float, ...]:
        """The row of verify.csv."""
        named = (self.frame, self.channel, self.quantity)
        told = ["" if v is None else v for v in (self.deviation, self.bound)]
        error = 100 * self.error if math.isfinite(self.error) else ""
        return (*named, self.measured, self.predicted, error, *told, self.verdict)


@dataclass(frozen=True)
class Verification:
    """A measurement beside the predictions of a camera."""

    camera: Camera
    measurement: Measurement
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    least_errors: dict[str, float] = field(default_factory=dict)
    """Kind of variance and frames -> relative error that is found in 90 % of tests."""

    @property
    def errors(self) -> Array:
        """The errors of all means, relative; those of means that were measured as 0 have none."""
        every = np.array([row.error for row in self.rows if row.quantity.startswith("mean")])
        finite: Array = every[np.isfinite(every)]
        return finite

    @property
    def missed(self) -> tuple[Row, ...]:
        """The rows whose tolerance is missed."""
        return tuple(row for row in self.rows if row.missed)

    @property
    def judged(self) -> tuple[Row, ...]:
        """The rows with a test of significance."""
        return tuple(row for row in self.rows if row.deviation is not None)

    def summary(self) -> dict[str, float | int]:
        """Return numbers of the errors of means [%], and counts of rows.

        These are all, those that miss a tolerance, those with a known distribution, and those
        that differ significantly.
        """
        percent = 100 * self.errors if self.errors.size else np.full(1, math.nan)
        return {
            "count": len(self.rows),
            "mean_error_percent": float(percent.mean()),
            "rms_error_percent": rms(percent),
            "largest_error_percent": float(np.abs(percent).max()),
            "missed": len(self.missed),
            "judged": sum(row.deviation is not None for row in self.rows),
            "differing": sum(row.verdict != "agrees" for row in self.judged),
        }

    def report(self) -> dict[str, Any]:
        """Return what `verify.json` and `--json` say."""
        return {
            "name": self.measurement.name,
            "camera_name": self.camera.name,
            **self.summary(),
            "least_errors": self.least_errors,
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
    watch = watch or Silent()
    points, taken, notes = measured_points(camera, measurement)
    _check_all(camera, measurement, points)
    means = list(_rows(camera, measurement, points, watch))
    watch.begin("stacks")
    judged: dict[int, list[Judged]] = {}
    for done, stack in enumerate(taken):
        watch.step(done, len(taken))
        measure = partial(quantities_of_colors, measurement)
        judged[stack.number] = judge(
            *(camera, stack.point, stack.frames, stack.shape, measure, stack.number),
            readout=measurement.readout,
        )
    edges, more = _edges(camera, measurement)
    pooled = pool(_groups(measurement, judged, edges))
    main = [each for each in pooled if each.kind]
    alone = [*judged.values(), *edges.values()]
    count = sum(len(each) for each in alone) + len(pooled) - len(main)
    limit, limit_of_main = bound(count, 0.5), bound(len(main), 0.5)
    rows = [*_with_noise(measurement, means, judged, limit)]
    for number, listed in edges.items():
        label = measurement.label(number)
        rows += [_judged_row(measurement, label, each, limit) for each in listed]
    for kind in pooled:
        own = limit_of_main if kind.kind else limit
        rows.append(_judged_row(measurement, kind.group, kind.judged, own))
    least = _least_errors(main, limit_of_main)
    told = (*_notes(camera, points), *notes, *more)
    return Verification(camera, measurement, tuple(rows), told, least)


def _groups(
    measurement: Measurement, judged: dict[int, list[Judged]], edges: dict[int, list[Judged]]
) -> dict[str, list[Judged]]:
    """Return what was judged of all frames, of dark ones, of lit ones, and of edges."""
    groups: dict[str, list[Judged]] = {name: [] for name in ("all frames", "dark frames",
                                                             "lit frames", "edges")}  # fmt: skip
    for number, listed in judged.items():
        entry = measurement.frames[number]
        if is_clipped(listed):
            continue
        groups["all frames"] += listed
        groups["dark frames" if entry.light is None else "lit frames"] += listed
    for listed in edges.values():
        groups["edges"] += listed
    if not (groups["dark frames"] and groups["lit frames"]):
        del groups["all frames"]
    return groups


def _least_errors(main: list[Pooled], limit: float) -> dict[str, float]:
    """Return the least relative error that would have been found, by kind and frames."""
    found: dict[str, float] = {}
    for kind in MAIN:
        same = [each for each in main if each.kind == kind]
        if same:
            best = min(same, key=lambda each: each.least_error(limit))
            found[f"{kind} ({best.group})"] = best.least_error(limit)
    return found


def _edges(camera: Camera, measurement: Measurement) -> tuple[dict[int, list[Judged]], list[str]]:
    """Return what is judged of frames of edges, by the number of the entry, and notes."""
    files = paths(measurement, held_out=True, edges=True)
    if files and not camera.optics.is_lens:
        labels = ", ".join(map(measurement.label, files))
        return {}, [f"{labels}: frames of an edge are not predicted, the camera has no lens"]
    found, notes = {}, []
    for number, stack in numbered_stacks(measurement, files):
        try:
            found[number] = judge_edge(camera, stack, measurement, number)
        except ValueError as error:
            notes.append(f"{stack.label}: {error}")
    return found, notes


def _judged_row(measurement: Measurement, label: str, each: Judged, limit: float) -> Row:
    return Row(
        label,
        each.channel,
        each.name,
        each.measured,
        each.predicted,
        measurement.noise_tolerance,
        each.deviation,
        limit,
    )


def _with_noise(
    measurement: Measurement,
    means: list[tuple[int, Row]],
    judged: dict[int, list[Judged]],
    limit: float,
) -> Iterator[Row]:
    """Yield the rows of means, each followed by those of the noise of its entry and color."""
    for number, row in means:
        own = [each for each in judged.get(number, ()) if each.channel == row.channel]
        for each in own:
            if each.name == row.quantity:
                yield replace(row, deviation=each.deviation, bound=limit)
        if not own:
            yield row
        for each in own:
            if each.name != row.quantity:
                yield _judged_row(measurement, measurement.label(number), each, limit)


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
) -> Iterator[tuple[int, Row]]:
    for done, (number, point) in enumerate(points):
        watch.step(done, len(points))
        tolerance = measurement.tolerance if point.tolerance is None else point.tolerance
        row = Row(
            measurement.label(number),
            point.channel,
            f"mean [{UNITS[point.signal.channel]}]",
            point.signal.value,
            predict(camera, point, measurement.readout).value,
            tolerance,
        )
        yield number, row


def _notes(camera: Camera, points: Points) -> Iterator[str]:
    if camera.optics.is_lens and points:
        yield "the camera's lens is skipped: the measured light is that on the sensor"
