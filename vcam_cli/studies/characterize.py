"""`vcam characterize`: what a laboratory would measure of a camera, beside what its file says.

Flat frames at many levels of light, dark frames of many times, stacks of both and a slanted edge
are simulated (`bench.py`, `exposures.py`) and judged by the standards (`quality/`), which know
nothing of the file. Its closed forms stand beside each number (`datasheet.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.parallel import available_workers
from vcam_cli.engine.stages import Observer, Silent, Stages
from vcam_cli.errors import BadInput
from vcam_cli.studies.bench import Bench, bench
from vcam_cli.studies.datasheet import COLUMNS, Quantity, notes, quantities
from vcam_cli.studies.exposures import Channel, channels


@dataclass(frozen=True)
class Characterization:
    """The measurement of a camera."""

    bench: Bench
    channels: tuple[Channel, ...]
    quantities: tuple[Quantity, ...]
    notes: tuple[str, ...]
    stages: Stages

    @property
    def nyquist(self) -> float:
        """Of the array's columns [cycles/m]."""
        return 0.5 / self.bench.ready.geometry.pitch_x

    def get(self, name: str, channel: str | None = None) -> Quantity:
        """A number by its name, of one color or of the first. Raises KeyError."""
        for q in self.quantities:
            if q.name == name and channel in (None, q.channel):
                return q
        raise KeyError(name)

    def report(self) -> dict[str, Any]:
        """What `characterize.json` and `--json` say."""
        return {
            "name": self.bench.camera.name,
            "exposure_time": self.bench.time,
            "pedestal": self.bench.pedestal,
            "quantities": [dict(zip(COLUMNS, q.row, strict=True)) for q in self.quantities],
            "channels": {c.color: _curves(c) for c in self.channels},
            "notes": list(self.notes),
            "stages": self.stages.seconds,
        }


def _curves(channel: Channel) -> dict[str, Any]:
    """The measured points behind the numbers."""
    series, edge = channel.transfer.series, channel.edge
    kept = edge.measured.frequency * edge.measured.pitch <= 1
    return {
        "photons": series.photons,
        "mean": series.mean,
        "variance": series.variance,
        "dark_mean": series.dark_mean,
        "dark_variance": series.dark_variance,
        "frequency": edge.measured.frequency[kept],
        "mtf": edge.measured.mtf[kept],
        "mtf_expected": edge.expected[kept],
    }


def characterize(
    camera: Camera, workers: int | None = None, watch: Observer | None = None
) -> Characterization:
    """Measures `camera`.

    workers: threads, default all processors; results do not depend on it. watch: told of stages.
    Raises BadInput (with positions in the camera's file) where it cannot be measured.
    """
    try:
        stages = Stages(watch=watch or Silent())
        on = bench(camera, workers or available_workers(), stages)
        found = channels(on, stages)
    except BadInput as error:
        raise error.located(camera.locate) from None
    told = tuple(q for channel in found for q in quantities(on, channel))
    return Characterization(on, found, told, tuple(notes(on, found)), stages)
