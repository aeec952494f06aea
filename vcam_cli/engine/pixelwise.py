"""What the effects that act pixel by pixel do to a picture: gains, charges, the full well.

Their bounds assume full signal everywhere; with the signal at hand it is known, for a few
thousand pixels, what each of them changes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import Charge, Effect, Gain
from vcam_cli.effects.saturation import Saturation

SAMPLE = 1 << 16
"""Pixels looked at, at most."""


def changes(
    rate: NDArray,
    geometry: Geometry,
    present: Sequence[Effect],
    running: Sequence[Effect],
    time: float,
) -> dict[str, float]:
    """Rms change of the mean raw by leaving out each gain, charge and limit [electrons / s].

    rate: (rows, columns) photo-electrons per second with the gains among `running` in them;
    present: all effects that are wanted; time: exposure [s]. Of a gain that does not run: the
    change by simulating it. Every n-th row and column is looked at, n odd, so that every color of
    a mosaic is among them: exact where the array has at most `SAMPLE` pixels.
    """
    rows, columns = _thinned(rate.shape[0], rate.shape), _thinned(rate.shape[1], rate.shape)
    x, y = pixel_centers(geometry)
    photo = rate[rows, columns].astype(np.float64) * time
    dark = sum(e.rate() for e in present if isinstance(e, Charge)) * time
    well = next((e.full_well for e in present if isinstance(e, Saturation)), np.inf)

    def clipped(signal: NDArray) -> NDArray:
        return np.minimum(signal, well)

    raw = clipped(photo + dark)
    others: dict[str, NDArray] = {}
    for effect in present:
        if isinstance(effect, Gain):
            gain = effect.gain(x[columns], y[rows])
            factor = 1 / np.maximum(gain, 1e-6) if effect in running else gain
            others[effect.name] = clipped(photo * factor + dark)
        elif isinstance(effect, Charge):
            others[effect.name] = clipped(photo + (dark - effect.rate() * time))
        elif isinstance(effect, Saturation):
            others[effect.name] = photo + dark
    return {name: float(np.sqrt(np.mean((o - raw) ** 2))) / time for name, o in others.items()}


def _thinned(count: int, shape: tuple[int, ...]) -> slice:
    """Every n-th of `count`, n odd, such that at most `SAMPLE` pixels of the array are taken."""
    step = int(np.ceil(np.sqrt(shape[0] * shape[1] / SAMPLE)))
    return slice(min(step // 2, count - 1), None, step + 1 - step % 2)
