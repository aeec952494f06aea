"""Computing frames of a data set: their arrays, and the numbers that are their labels."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import partial
from itertools import chain

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.datasets.device_frames import batch_key, device_frames
from vcam_cli.datasets.drawing import Frame
from vcam_cli.devices.choice import open_device
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.errors import BadInput
from vcam_cli.files.frame_archive import archive_bytes, array_hash
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.parallel import ThreadPool, suitable_workers
from vcam_cli.quality.photon_transfer import ROUNDING
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.exposure import mean_dark
from vcam_cli.records import dataclass
from vcam_cli.simulation.exposures import exposures, share_light
from vcam_cli.simulation.photograph import Photograph
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import simulate
from vcam_cli.solve.solved import Solved
from vcam_cli.sweeps.point_effects import with_every_effect
from vcam_cli.sweeps.sweep_result import error_cell

LIGHT, PICTURES = 1 << 24, 1 << 28
"""Bytes of light that are kept, since no frame comes back to the scene of an earlier one, and of
pictures, since other crops of them do."""
HASHERS = 4
"""Threads that hash the arrays of a batch."""
NPZ = "npz"
"""The file of frames beside their point."""
RECORDS = "records.json"
"""Its member that is no array: labels and hashes of the frames."""
ARRAYS: dict[str, Callable[[Photograph], Array]] = {
    "raw": lambda result: result.dn,
    "clean": lambda result: result.clean_dn.astype(np.float32),
    "depth": lambda result: result.frame.depth().astype(np.float32),
    "ideal": lambda result: np.moveaxis(result.frame.ideal_dn(), 0, -1).astype(np.float32),
}
"""Kind of array -> what it is of a frame."""


Made = tuple[dict[str, float], dict[str, Array]]
"""Labels of a frame, and its arrays by their kind."""


@dataclass(frozen=True)
class Record:
    """Labels and hashes of a frame, or its error."""

    labels: dict[str, float] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)
    """Kind of array -> SHA-256 of its values."""
    error: str = ""
    """Why there is no such frame; it would fail so again."""


@dataclass(frozen=True)
class FramesJob:
    """Frames to compute, of one shard."""

    id: str
    lit: tuple[tuple[Frame, ...], ...]
    """Frames that share a light, all of them, for every light."""
    numbers: range
    """Those of the shard: the others are not computed."""
    base: Document[Camera]
    """The data set's camera file."""
    write: tuple[str, ...]
    versions: dict[str, str]
    pixels: int
    """Pixels of a frame."""
    device: str = "cpu"

    def compute(self, threads: int, shared: Shared) -> tuple[dict[str, float], dict[str, bytes]]:
        """Return no metrics, and the archive of the frames' arrays and records."""
        if shared.rate_cache.limit != LIGHT:
            shared.rate_cache, shared.pictures = RateCache(LIGHT), ByteCache(PICTURES)
        threads = min(threads, suitable_workers(self.pixels))
        arrays: dict[str, Array] = {}
        entries: dict[str, Callable[[], Record]] = {}
        with ThreadPool(HASHERS) as pool:
            on_device = self.device != "cpu"  # which goes on while threads hash
            for frame, made in chain(self._batched(), self._single(threads, shared)):
                name = str(frame.number)
                if isinstance(made, BadInput):
                    entries[name] = partial(Record, error=error_cell(made.problems))
                    continue
                told, own = made
                arrays |= {f"{name}.{kind}": values for kind, values in own.items()}
                hashes: dict[str, Callable[[], str]] = {
                    kind: pool.submit(array_hash, values).result
                    if on_device
                    else partial(array_hash, values)
                    for kind, values in own.items()
                }
                entries[name] = partial(_record, told, hashes)
            records = {name: entry() for name, entry in entries.items()}
        return {}, {NPZ: archive_bytes(arrays, {RECORDS: write_records(records).encode()})}

    def _batched(self) -> Iterator[tuple[Frame, Made | BadInput]]:
        """Yield the frames that batches on a device compute, or why they cannot be."""
        batches: dict[str, list[Frame]] = {}
        for frame in (frame for frames in self.lit for frame in frames):
            key = batch_key(frame, self.write) if self.device != "cpu" else None
            if frame.number in self.numbers and key is not None:
                batches.setdefault(key, []).append(frame)
        for frames in batches.values():
            left = {frame.number: frame for frame in frames}
            try:
                device = open_device(self.device)
                taken = device_frames(frames[0], self.write, self.base, device).take(frames)
                for frame, taker, raw, clean, seconds, gain in taken:
                    camera, own = taker.at_gain(gain), {"raw": raw, "clean": clean}
                    given = camera.solved, camera.chain, camera.effects, seconds, raw
                    del left[frame.number]
                    yield frame, (noise_labels(*given), {kind: own[kind] for kind in self.write})
            except BadInput as error:
                yield from ((frame, error) for frame in left.values())

    def _single(self, threads: int, shared: Shared) -> Iterator[tuple[Frame, Made | BadInput]]:
        """Yield all other frames, light by light, or why they cannot be."""
        known: list[tuple[Frame, Camera]] = []
        for frames in self.lit:
            wanted = [
                number
                for number, frame in enumerate(frames)
                if frame.number in self.numbers
                and (self.device == "cpu" or batch_key(frame, self.write) is None)
            ]
            if not wanted:
                continue
            for frame, result in self._results(frames, wanted, known, threads, shared):
                if isinstance(result, BadInput):
                    yield frame, result
                else:
                    own = {kind: ARRAYS[kind](result) for kind in self.write}
                    yield frame, (labels(result), own)

    def _results(
        self,
        frames: tuple[Frame, ...],
        wanted: Sequence[int],
        known: list[tuple[Frame, Camera]],
        threads: int,
        shared: Shared,
    ) -> Iterator[tuple[Frame, Photograph | BadInput]]:
        """Yield the wanted frames of one light as they are simulated, or why they cannot be.

        known: the first frame of the last light and its camera, once there is one.
        """
        cameras: dict[int, Camera] = {}
        for number, frame in enumerate(frames):
            try:
                if known:
                    camera = frame.camera_after(*known[0], self.base)
                else:
                    camera = frame.camera(self.base)
                if not cameras:
                    known[:] = [(frame, camera)]
                cameras[number] = _raw_camera(camera)
            except BadInput as error:
                if number in wanted:
                    yield frame, error
        rest = [number for number in wanted if number in cameras]
        if rest and self.device == "cpu" and all(map(share_light, cameras.values())):
            order = list(cameras)
            places = [order.index(number) for number in rest]
            try:
                for result in exposures(list(cameras.values()), threads, shared, places):
                    yield frames[rest.pop(0)], result
            except BadInput:  # of one of them: each of the others by itself
                pass
        for number in rest:
            try:
                every = with_every_effect(cameras[number])
                yield frames[number], simulate(every, threads, shared=shared, device=self.device)
            except BadInput as error:
                yield frames[number], error


def _record(told: dict[str, float], hashes: Mapping[str, Callable[[], str]]) -> Record:
    return Record(told, {kind: found() for kind, found in hashes.items()})


def write_records(records: Mapping[str, Record]) -> str:
    """Return the records of frames by their names as a text."""
    return json.dumps({name: vars(record) for name, record in records.items()})


def read_records(text: str | bytes) -> dict[str, Record]:
    """Return the records of such a text. Raises ValueError for another one."""
    try:
        return {name: Record(**record) for name, record in json.loads(text).items()}
    except (TypeError, AttributeError) as error:
        raise ValueError(str(error)) from None


def _raw_camera(camera: Camera) -> Camera:
    """Return the camera without a picture."""
    output = camera.output.model_copy(update={"render": None})
    return camera.model_copy(update={"output": output, "quality": ()})


def labels(result: Photograph) -> dict[str, float]:
    """Return what a noise model says of a frame, by the columns of the manifest.

    The temporal variance of a pixel is dark_variance + system_gain (clean - black_level), as long
    as it does not saturate and its signal chain is linear.
    """
    frame = result.frame
    running = frame.plan.active
    return noise_labels(frame.solved, frame.chain, running, frame.exposure_time, result.dn)


def noise_labels(
    solved: Solved, chain: ReadoutChain, effects: tuple[Effect, ...], seconds: float, dn: Array
) -> dict[str, float]:
    """Return the labels of a frame: a camera at its gain, exposure time [s], its codes dn."""
    circuit, gain = solved.electrical, chain.system_gain
    dark = mean_dark(seconds, effects)
    sources = of_kind(effects, NoiseSource)
    variances = [source.variance(dark, dark) for source in sources]
    rms = {f"{s.name} [e]": own**0.5 for s, own in zip(sources, variances, strict=True)}
    temporal = sum(own for s, own in zip(sources, variances, strict=True) if s.scope == "frame")
    fpn = solved.pixel.fpn
    return {
        "exposure_time [s]": seconds,
        "exposure_gain": circuit.exposure_gain,
        "system_gain [DN/e]": gain,
        "black_level [DN]": chain.black_dn(dark),
        "saturation [DN]": chain.saturated_dn,
        "full_well [e]": circuit.full_well,
        "dark_signal [e]": dark,
        "dark_variance [DN2]": gain**2 * temporal + ROUNDING,
        **rms,
        **{
            f"{what}.{branch.name}{unit}": value
            for branch in chain.branches
            for what, unit, value in (
                ("system_gain", " [DN/e]", 1 / branch.circuit.electrons_per_dn),
                ("offset", " [DN]", branch.circuit.offset),
                ("sensitivity", "", branch.sensitivity),
            )
        },
        "gain_pixel": fpn.gain_pixel or 0.0,
        "gain_column": fpn.gain_column or 0.0,
        "mean [DN]": float(dn.mean(dtype=float)),
        "saturated_fraction": float(np.mean(dn >= chain.saturated_dn)),
    }
