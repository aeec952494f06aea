"""Waves that pass by, turn and shake, as sums over instants: what no code of the package does."""

import math
from collections.abc import Callable

import numpy as np
from making import QUIET, radiance_for

PITCH, ROWS, COLUMNS, TIME, LINE = 5e-6, 48, 64, 0.01, 50e-6
"""Of the plain camera; the time of its exposure and of a line [s]."""
SIDE = PITCH * math.sqrt(0.5)
"""Of its photodetector, a square [m]."""
SCALE = 5e-3 / (1 - 5e-3)
"""Size of the magnification of a thin lens of 5 mm at 1 m."""
IMAGE = SCALE * 1.0
"""Distance from that lens to the image of what is at 1 m [m]."""
STILL = {"scene.radiance": radiance_for(40000), "effects": QUIET}
FREQUENCY, ANGLE = 23e3, math.radians(30)
WAVE = {
    "kind": "chart",
    "chart": "sinusoid",
    "frequency": "23 lp/mm",
    "orientation": "30 deg",
    "phase": "25 deg",
}
Turn = Callable[[np.ndarray], np.ndarray]


def places() -> np.ndarray:
    """Centers of the pixels as complex numbers, x + i y [m]."""
    x = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * PITCH
    y = (np.arange(ROWS) - (ROWS - 1) / 2) * PITCH
    return x[None, :] + 1j * y[:, None]


def delays(direction: str | None) -> np.ndarray:
    """When a pixel's exposure begins after that of the array's middle [s]: (rows, columns)."""
    rows = np.arange(ROWS)[:, None] - (ROWS - 1) / 2
    columns = np.arange(COLUMNS)[None, :] - (COLUMNS - 1) / 2
    late = {"down": rows, "up": -rows, "right": columns, "left": -columns, None: 0 * rows}
    return np.broadcast_to(late[direction] * LINE, (ROWS, COLUMNS))


def exposure(direction: str | None, time: str = "10 ms", **more) -> dict:
    """The exposure of a global shutter (None), or of one that rolls."""
    found = {"time": time, **more}
    if direction is not None:
        found["shutter"] = {"rolling": {"line_time": "50 us", "direction": direction}}
    return {"exposure": found}


def wave_and_levels(still: np.ndarray) -> tuple[float, float]:
    """Mean and amplitude of the still wave, the latter without the photodetector's averaging."""
    f = FREQUENCY * np.exp(-1j * ANGLE)
    phase = 2 * np.pi * (np.conj(f) * places()).real + math.radians(25)
    basis = np.stack([np.ones(still.size), np.cos(phase).ravel()], axis=1)
    level, amplitude = np.linalg.lstsq(basis, still.ravel(), rcond=None)[0]
    return level, amplitude / aperture(f)


def aperture(f: complex) -> float:
    """What a square photodetector leaves of a wave of frequency f = fx + i fy."""
    return float(np.sinc(f.real * SIDE) * np.sinc(f.imag * SIDE))


def seen(
    still: np.ndarray,
    position: Callable[[np.ndarray, np.ndarray], np.ndarray],
    turn: Turn = lambda t: 0 * t,
    direction: str | None = None,
    time: float = TIME,
    nodes: int = 60,
    start: float | None = None,
) -> np.ndarray:
    """The mean signal of a wave in motion: a sum over instants, by Gauss-Legendre.

    `position` gives where in the still image lies what is at places at times after the middle of
    the exposure of the array's middle; `turn` the turn of the image at times, `start` when the
    exposure begins (by default half of `time` before that).
    """
    level, amplitude = wave_and_levels(still)
    f = FREQUENCY * np.exp(-1j * ANGLE)
    at, weights = np.polynomial.legendre.leggauss(nodes)
    begin = (-time / 2 if start is None else start) + delays(direction)
    total = np.zeros((ROWS, COLUMNS))
    for node, weight in zip((at + 1) / 2, weights / 2, strict=True):
        times = begin + node * time
        # The photodetector does not turn with the wave; its averaging is taken at the mean turn.
        passed = aperture(f * np.exp(1j * float(np.mean(turn(times)))))
        phase = 2 * np.pi * (np.conj(f) * position(places(), times)).real + math.radians(25)
        total += weight * passed * np.cos(phase)
    return level + amplitude * total
