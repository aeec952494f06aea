"""SNR over light of several readouts that are merged, measured on the bench."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.characterization.bench import prepare_even
from vcam_cli.progress import Stages
from vcam_cli.readout import several_readouts
from vcam_cli.records import dataclass

LEVELS = 33
"""Levels of light, from 1 electron to 95 % of the merge's saturation."""
COLUMNS = ("signal [e]", "measured_snr_db", "expected_snr_db")


@dataclass(frozen=True)
class MergedSnr:
    """SNR of the merged signal at one level of light."""

    signal: float
    """Photo-electrons of the large photodiode [e]."""
    measured: float
    """Of the difference of two flat frames [dB]."""
    expected: float
    """Of the closed form [dB]."""

    @property
    def row(self) -> tuple[float, float, float]:
        """The values in the order of `COLUMNS`."""
        return self.signal, self.measured, self.expected


def measure_merged_snr(camera: Camera, workers: int, stages: Stages) -> tuple[MergedSnr, ...]:
    """Measure the SNR of a camera whose pixels are read several times.

    Parameters
    ----------
    camera : Camera
        The camera.
    workers : int
        Number of threads.
    stages : Stages
        Observer of the stages.

    Returns
    -------
    tuple of MergedSnr
        Levels of light, rising.
    """
    ready = prepare_even(camera, workers, stages)
    chain, time, seed = ready.chain, ready.exposure_time, ready.solved.seed
    assert chain.merge is not None
    dark, found = ready.dark_rate * time, []
    shape = (ready.geometry.rows, ready.geometry.columns)
    with stages("merged SNR"):
        for number, signal in enumerate(np.geomspace(1, 0.95 * chain.merge.top, LEVELS)):
            rate: Array = np.full(shape, signal / time, ready.settings.dtype)
            frames = [
                several_readouts.capture(
                    rate,
                    time,
                    chain,
                    # No frame of another frame seed has the same noise.
                    {"sensor": seed.sensor, "frame": seed.frame + ((2 * number + k) << 64)},
                    workers,
                ).dn.astype(float)
                for k in range(2)
            ]
            first, second = (chain.to_electrons(dn) for dn in frames)
            mean, noise = (first + second).mean() / 2 - dark, np.std(first - second) / np.sqrt(2)
            stated = chain.noise(float(signal) + dark, dark).total
            found.append(
                MergedSnr(
                    float(signal),
                    float(20 * np.log10(max(mean, 1e-12) / noise)),
                    float(20 * np.log10(signal / np.sqrt(stated))),
                )
            )
    return tuple(found)
