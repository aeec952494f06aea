"""Computing a frame of a data set: its arrays, and the numbers that are its labels."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.datasets.device_frames import device_frames
from vcam_cli.datasets.drawing import Frame
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.frame_archive import archive_bytes
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.quality.photon_transfer import ROUNDING
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.exposure import mean_dark
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.solve.solved import Solved
from vcam_cli.sweeps.point_effects import with_every_effect
from vcam_cli.sweeps.sweep_result import Outcome, error_cell

LIGHT = 1 << 24
"""Bytes of light that are kept: no frame comes back to the scene of an earlier one."""
NPZ = "npz"
"""The file of a frame beside its point."""
ARRAYS: dict[str, Callable[[Result], Array]] = {
    "raw": lambda result: result.dn,
    "clean": lambda result: result.clean_dn.astype(np.float32),
    "depth": lambda result: result.frame.depth().astype(np.float32),
    "ideal": lambda result: np.moveaxis(result.frame.ideal_dn(), 0, -1).astype(np.float32),
}
"""Kind of array -> what it is of a frame."""


@dataclass(frozen=True)
class FrameJob:
    """A frame to compute."""

    id: str
    frame: Frame
    base: Document[Camera]
    """The data set's camera file."""
    write: tuple[str, ...]
    versions: dict[str, str]
    device: str = "cpu"

    def compute(self, threads: int, shared: Shared) -> tuple[dict[str, float], dict[str, bytes]]:
        """Return the labels of the frame, and the archive of its arrays."""
        if shared.rate_cache.limit != LIGHT:
            shared.rate_cache = RateCache(LIGHT)
        camera = with_every_effect(self.frame.camera(self.base))
        output = camera.output.model_copy(update={"render": None})
        result = simulate(
            camera.model_copy(update={"output": output, "quality": ()}),
            threads,
            shared=shared,
            device=self.device,
        )
        arrays = {kind: ARRAYS[kind](result) for kind in self.write}
        return labels(result), {NPZ: archive_bytes(arrays)}


def device_outcomes(jobs: Sequence[FrameJob], device: Processor) -> Iterator[Outcome]:
    """Yield the outcomes of frames of one `batch_key`, as a device takes them.

    Parameters
    ----------
    jobs : sequence of FrameJob
        The frames.
    device : Processor
        Where they are computed.
    """
    left = {job.frame.number: job for job in jobs}
    error, final = "", True
    start = time.perf_counter()
    try:
        batched = device_frames(jobs[0].frame, jobs[0].write, jobs[0].base, device)
        for frame, taker, raw, clean, seconds, gain in batched.take([job.frame for job in jobs]):
            job, camera = left.pop(frame.number), taker.at_gain(gain)
            arrays = {"raw": raw, "clean": clean}
            archive = archive_bytes({kind: arrays[kind] for kind in job.write})
            told = noise_labels(camera.solved, camera.chain, camera.effects, seconds, raw)
            spent = (time.perf_counter() - start) / len(jobs)
            yield Outcome(job.id, told, seconds=spent, frames={NPZ: archive})
    except BadInput as problem:
        error = error_cell(problem.problems)
    except CannotDo as problem:
        error, final = str(problem), False
    yield from (Outcome(job.id, error=error, final=final) for job in left.values())


def labels(result: Result) -> dict[str, float]:
    """Return what a noise model says of a frame, by the columns of the manifest.

    The temporal variance of a pixel is dark_variance + system_gain (clean - black_level), as long
    as it does not saturate and its signal chain is linear.
    """
    frame = result.frame
    return noise_labels(
        frame.solved, frame.chain, frame.plan.active, frame.exposure_time, result.dn
    )


def noise_labels(
    solved: Solved, chain: ReadoutChain, effects: tuple[Effect, ...], seconds: float, dn: Array
) -> dict[str, float]:
    """Return the labels of a frame: a camera at its gain, exposure time [s], its codes dn."""
    circuit, gain = solved.electrical, chain.system_gain
    dark = mean_dark(seconds, effects)
    sources = of_kind(effects, NoiseSource)
    rms = {f"{source.name} [e]": source.variance(dark, dark) ** 0.5 for source in sources}
    temporal = sum(s.variance(dark, dark) for s in sources if s.scope == "frame")
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
