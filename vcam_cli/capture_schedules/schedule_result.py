"""What a schedule study finds: its schedules, and what they are worth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vcam_cli.arrays import Array
from vcam_cli.capture_schedules import schedule_rows
from vcam_cli.capture_schedules.fewest_captures import FewestCaptures
from vcam_cli.capture_schedules.frames import Frames
from vcam_cli.capture_schedules.methods import MethodResult, Task
from vcam_cli.capture_schedules.online_loss import OnlineLoss
from vcam_cli.capture_schedules.photocurrents import Approximation
from vcam_cli.capture_schedules.schedule_file import ScheduleFile
from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Pdf


@dataclass(frozen=True)
class ApproximationStep:
    """A pdf approximated by segments, and the schedules found on it."""

    density: str
    segments: int
    plan: Pdf
    found: tuple[MethodResult, ...]


@dataclass(frozen=True)
class ScheduleResult:
    """The schedules of a study, and what they are worth.

    Parameters
    ----------
    study : ScheduleFile
        The study as it was read.
    out : Path
        The output folder.
    task : Task
        The pdf, the sensor and their bounds.
    approximation : Approximation or None
        The pdf in fewer segments, where the study requests it.
    found : tuple of MethodResult
        Schedules of all methods and numbers of captures, in the study's order.
    steps : tuple of ApproximationStep
        Schedules found on approximations, where the study requests several.
    targets : tuple of FewestCaptures
        The fewest captures that reach each gain that the study names.
    online : tuple of OnlineLoss
        Loss of choosing times while capturing, where the study requests it.
    frames : Frames or None
        Pictures taken with several schedules, where the study requests them.
    notes : tuple of str
        What a user should know beside the numbers.
    seconds : float
        Time the study took.
    """

    study: ScheduleFile
    out: Path
    task: Task
    approximation: Approximation | None
    found: tuple[MethodResult, ...]
    steps: tuple[ApproximationStep, ...] = ()
    targets: tuple[FewestCaptures, ...] = ()
    online: tuple[OnlineLoss, ...] = ()
    frames: Frames | None = None
    notes: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def summary_rows(self) -> list[dict[str, Any]]:
        """The rows of summary.csv, with the names of its columns; None where a cell is empty."""
        return schedule_rows.summary_dicts(self.task, self.found)

    @property
    def schedule_rows(self) -> list[dict[str, Any]]:
        """The rows of schedule.csv, with the names of its columns."""
        columns = schedule_rows.schedule_columns(self.study.model)
        rows = schedule_rows.schedule_rows(self.study.model, self.found)
        return [dict(zip(columns, row, strict=True)) for row in rows]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of schedule.csv: what pandas and polars read, as `summary_rows`."""
        return self.schedule_rows

    def __repr__(self) -> str:
        """Return a line: name, number of schedules, numbers of captures."""
        model, counts = self.study.model, self.study.model.counts
        several = f"{min(counts)} to {max(counts)}" if len(counts) > 1 else f"{counts[0]}"
        return f"<ScheduleResult {model.name}: {len(self.found)} schedules of {several} captures>"

    def times(self, method: str, count: int) -> Array:
        """Return capture times (N,) [s]; without a sensor in 1 / the pdf's unit.

        Raises
        ------
        KeyError
            If the study has no such method and number of captures.
        """
        for one in self.found:
            if (one.method, one.count) == (method, count):
                return one.schedule.times
        raise KeyError((method, count))

    def summary(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        return {
            "name": self.study.model.name,
            "out": str(self.out),
            "summary": self.summary_rows,
            "schedule": self.schedule_rows,
            "targets": [vars(target) for target in self.targets],
            **({"frames": list(self.frames.dicts())} if self.frames else {}),
            "notes": list(self.notes),
            "seconds": self.seconds,
        }
