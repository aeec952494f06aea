"""The times at which a camera samples one integration, where it chooses them for its scene.

`captures: {schedule: optimal, count: 8, max: 100 ms}` asks for the times whose mean SNR over the
pixels is largest, of all of at most that length. The camera plans with what it has: the noise-free
photocurrents of its pixels, its full well or the end of its ADC, whichever comes first, and its
dark current, readout and reset noise, as the file describes them; so a schedule does not depend on
which effects a plan leaves out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.electrical import Electrical
from vcam_cli.effects.base import Charge, Code, Effect
from vcam_cli.engine.captures import variances
from vcam_cli.scheduling import noisy
from vcam_cli.scheduling.levels import levels
from vcam_cli.scheduling.objective import Sensor


def sensor(electrical: Electrical, effects: Sequence[Effect], code: Code, longest: float) -> Sensor:
    """The pixel as a schedule sees it: effects, as described, and the longest exposure [s].

    Rounding of the ADC counts as readout noise, as it does in the reconstruction.
    """
    read, reset = variances(tuple(effects), code)
    return Sensor(
        well=electrical.saturation,
        dark=sum(e.rate() for e in effects if isinstance(e, Charge)),
        read=float(np.sqrt(read)),
        reset=float(np.sqrt(reset)),
        max_time=longest,
    )


def times_of(
    camera: Camera,
    rate: NDArray,
    electrical: Electrical,
    effects: Sequence[Effect],
    code: Code,
) -> tuple[float, ...]:
    """Times of the samples of one integration, rising [s]; () where there is a single exposure.

    rate: photo-electrons per second of every pixel, of any shape; effects: those that the camera
    has. Scheduled samples are as many as asked for, fewer where more would coincide.
    """
    asked = camera.exposure.schedule
    if asked is None:
        return camera.exposure.samples
    return best(rate, asked.count, sensor(electrical, effects, code, asked.max))


def best(rate: NDArray, count: int, pixel: Sensor) -> tuple[float, ...]:
    """The best times of at most `count` samples, rising [s].

    In the dark, one sample of the longest time that the dark current allows.
    """
    pdf = levels(rate)
    if pdf is None:
        filled = pixel.well / pixel.dark if pixel.dark > 0 else np.inf
        return (float(min(filled, pixel.max_time)),)
    found = noisy.optimal(pdf, [count], pixel)[count].times
    return tuple(float(time) for time in np.unique(found))
