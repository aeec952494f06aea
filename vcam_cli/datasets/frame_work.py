"""Computing a frame of a data set: its arrays, and the numbers that are its labels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.config.document import Document
from vcam_cli.datasets.drawing import Frame
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.files.frame_archive import archive_bytes
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.quality.photon_transfer import ROUNDING
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.sweeps.point_effects import with_every_effect

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

    def compute(self, threads: int, shared: Shared) -> tuple[dict[str, float], dict[str, bytes]]:
        """Return the labels of the frame, and the archive of its arrays."""
        if shared.rate_cache.limit != LIGHT:
            shared.rate_cache = RateCache(LIGHT)
        camera = with_every_effect(self.frame.camera(self.base))
        output = camera.output.model_copy(update={"render": None})
        result = simulate(
            camera.model_copy(update={"output": output, "quality": ()}), threads, shared=shared
        )
        arrays = {kind: ARRAYS[kind](result) for kind in self.write}
        return labels(result), {NPZ: archive_bytes(arrays)}


def labels(result: Result) -> dict[str, float]:
    """Return what a noise model says of a frame, by the columns of the manifest.

    The temporal variance of a pixel is dark_variance + system_gain (clean - black_level), as long
    as it does not saturate and its signal chain is linear.
    """
    frame, circuit = result.frame, result.frame.electrical
    gain = frame.chain.system_gain
    dark = frame.dark_rate * frame.exposure_time
    sources = of_kind(frame.plan.active, NoiseSource)
    rms = {f"{source.name} [e]": source.variance(dark, dark) ** 0.5 for source in sources}
    temporal = sum(s.variance(dark, dark) for s in sources if s.scope == "frame")
    fpn = frame.solved.pixel.fpn
    return {
        "exposure_time [s]": frame.exposure_time,
        "exposure_gain": circuit.exposure_gain,
        "system_gain [DN/e]": gain,
        "black_level [DN]": frame.black_dn,
        "saturation [DN]": frame.chain.saturated_dn,
        "full_well [e]": circuit.full_well,
        "dark_signal [e]": dark,
        "dark_variance [DN2]": gain**2 * temporal + ROUNDING,
        **rms,
        **{
            f"{what}.{branch.name}{unit}": value
            for branch in frame.chain.branches
            for what, unit, value in (
                ("system_gain", " [DN/e]", 1 / branch.circuit.electrons_per_dn),
                ("offset", " [DN]", branch.circuit.offset),
                ("sensitivity", "", branch.sensitivity),
            )
        },
        "gain_pixel": fpn.gain_pixel or 0.0,
        "gain_column": fpn.gain_column or 0.0,
        "mean [DN]": float(result.dn.mean(dtype=float)),
        "saturated_fraction": float(np.mean(result.dn >= frame.chain.saturated_dn)),
    }
