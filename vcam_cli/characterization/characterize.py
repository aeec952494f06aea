"""`vcam characterize`: what a laboratory would measure of a camera, beside what its file says.

Flat frames at many levels of light, dark frames of many times, stacks of both and a slanted edge
are simulated (`bench.py`, `exposures.py`) and evaluated by the standards (`quality/`), which know
nothing of the file. Its closed forms stand beside each number (`datasheet.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.readouts import LARGE_PHOTODIODE, has_several, readouts
from vcam_cli.camera.expectations import Limit
from vcam_cli.characterization.bench import Bench, prepare_bench
from vcam_cli.characterization.datasheet import COLUMNS, Quantity, notes, quantities
from vcam_cli.characterization.exposures import Channel, measure_channels
from vcam_cli.characterization.kept_frames import Keeper
from vcam_cli.characterization.merged_snr import MergedSnr, measure_merged_snr
from vcam_cli.devices.choice import open_device
from vcam_cli.devices.processor import Processor
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.floats import own_float_errors
from vcam_cli.parallel import available_workers
from vcam_cli.progress import Observer, Silent, Stages
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Characterization:
    """The measurement of a camera.

    Parameters
    ----------
    bench : Bench
        The camera in even light.
    channels : tuple of Channel
        What was measured of each color.
    quantities : tuple of Quantity
        Every number of every color.
    notes : tuple of str
        What a reader of the numbers has to know.
    stages : Stages
        Seconds that each stage took.
    merged : tuple of MergedSnr
        SNR of pixels that are read several times; () of others. Their quantities are those of each
        readout, bench and channels those of the first.
    """

    bench: Bench
    channels: tuple[Channel, ...]
    quantities: tuple[Quantity, ...]
    notes: tuple[str, ...]
    stages: Stages
    merged: tuple[MergedSnr, ...] = ()

    @property
    def nyquist(self) -> float:
        """Nyquist frequency of the array's columns [cycles/m]."""
        return 0.5 / self.bench.ready.geometry.pitch_x

    def get(self, name: str, channel: str | None = None) -> Quantity:
        """Return a number by its name, of one color or of the first.

        Raises
        ------
        KeyError
            If there is no such number.
        """
        for q in self.quantities:
            if q.name == name and channel in (None, q.channel):
                return q
        raise KeyError(name)

    def misses(self, limits: Iterable[Limit]) -> tuple[str, ...]:
        """Return a sentence for each limit that a color does not keep."""
        return tuple(
            limit.miss(q.measured, q.channel)
            for limit in limits
            for q in self.quantities
            if q.name == limit.metric and not limit.holds(q.measured)
        )

    def report(self) -> dict[str, Any]:
        """Return what `characterize.json` and `--json` say."""
        return {
            "name": self.bench.camera.name,
            "exposure_time": self.bench.time,
            "pedestal": self.bench.pedestal,
            "device": "cpu" if self.bench.device is None else self.bench.device.describe(),
            "quantities": [dict(zip(COLUMNS, q.row, strict=True)) for q in self.quantities],
            "channels": {c.color: _measured_points(c) for c in self.channels},
            **({"merged_snr": [point.row for point in self.merged]} if self.merged else {}),
            "notes": list(self.notes),
            "stages": self.stages.seconds,
        }


@own_float_errors
def characterize(
    camera: Camera,
    workers: int | None = None,
    watch: Observer | None = None,
    keeper: Keeper | None = None,
    device: str = "cpu",
) -> Characterization:
    """Measure a camera.

    Parameters
    ----------
    camera : Camera
        The camera.
    workers : int, optional
        Threads; by default as many as there are processors. Results do not depend on it.
    watch : Observer, optional
        Told of stages.
    keeper : Keeper, optional
        Shown the flat and dark frames.
    device : str, optional
        "gpu" takes the frames on a graphics processor.

    Raises
    ------
    BadInput
        With positions in the camera's file, if it cannot be measured.
    """
    try:
        stages, workers = Stages(watch=watch or Silent()), workers or available_workers()
        found = open_device(device)
        if has_several(camera):
            if found.name != "cpu":
                message = "several readouts of a pixel: not measured on a graphics processor"
                raise CannotDo(message, "use --device cpu")
            return _of_readouts(camera, workers, stages, keeper)
        return _of_one(camera, workers, stages, keeper, found)
    except BadInput as error:
        raise error.with_places(camera.locate) from None


def _of_one(
    camera: Camera,
    workers: int,
    stages: Stages,
    keeper: Keeper | None,
    device: Processor | None = None,
) -> Characterization:
    bench = replace(prepare_bench(camera, workers, stages), device=device)
    channels = measure_channels(bench, stages, keeper)
    numbers = tuple(q for channel in channels for q in quantities(bench, channel))
    return Characterization(bench, channels, numbers, tuple(notes(bench, channels)), stages)


def _of_readouts(
    camera: Camera, workers: int, stages: Stages, keeper: Keeper | None
) -> Characterization:
    """Measure each readout of a camera as if it were alone, and the SNR of their merge."""
    each = readouts(camera)
    parts = [
        _of_one(readout.camera, workers, stages, keeper if number == 0 else None)
        for number, readout in enumerate(each)
    ]
    numbers = tuple(
        replace(q, channel=f"{readout.name} {q.channel}")
        for readout, part in zip(each, parts, strict=True)
        for q in part.quantities
    )
    names = ", ".join(readout.name for readout in each)
    told = [f"every readout is measured separately ({names}); plots show {each[0].name}"]
    told += [
        f"{readout.name}: photons are those on its own photodiode"
        for readout in each
        if readout.photodiode != LARGE_PHOTODIODE
    ]
    for readout, part in zip(each, parts, strict=True):
        told += [f"{readout.name}: {note}" for note in part.notes]
    merged = measure_merged_snr(camera, workers, stages)
    return replace(parts[0], quantities=numbers, notes=tuple(told), merged=merged)


def _measured_points(channel: Channel) -> dict[str, Any]:
    """Return the measured points behind the numbers."""
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
