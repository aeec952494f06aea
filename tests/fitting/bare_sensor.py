"""Sensors of a few lines of NumPy, on a bench: frames that no code of the simulator has seen.

`python tests/fitting/bare_sensor.py [N]` fits N sensors, of all kinds in turn, and prints by
parameter how often the 90 % intervals hold the truth.
"""

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vcam_cli.arrays import Array
from vcam_cli.fitting.fit import fit
from vcam_cli.fitting.result import Fit
from vcam_cli.verification import measurement_file

DARK_TIMES = (1e-3, 10e-3, 400e-3)
TIME = 10e-3
LEVELS = (0.04, 0.1, 0.18, 0.26, 0.34, 0.42, 0.5, 0.58, 0.66, 0.8, 1.5)
"""Light over that which saturates."""
KINDS = ("clean", "under a code", "tails", "black by color", "curved", "few frames")
NORMAL = 0.1349
"""Shape of Tukey's lambda distribution that is nearly normal."""


@dataclass(frozen=True)
class BareSensor:
    """Numbers of a sensor; charges in electrons."""

    bits: int = 12
    gain: float = 0.25
    well: float = 14e3
    efficiency: float = 0.6
    read_noise: float = 6.0
    shape: float = NORMAL
    dark_current: float = 300.0
    dsnu: float = 5.0
    prnu: float = 0.01
    black: tuple[float, ...] = (64.0,)
    """Of the colors of a Bayer mosaic, R G G B, or of all pixels [DN]."""
    curved: float = 0.0
    """Signal that is lost at saturation, in proportion to the square of the signal."""
    dull: float = 0.0
    """Variance of the signal that is lost at saturation, in proportion to the signal."""

    def frames(
        self,
        number: int,
        shape: tuple[int, int],
        seconds: float,
        photons: float,
        count: int,
        rng: np.random.Generator,
    ) -> Array:
        """Return frames (count, rows, columns) of one sensor of these numbers [DN]."""
        own = np.random.default_rng([77, number])
        offset = self.dsnu * own.standard_normal(shape)
        gains = 1 + self.prnu * own.standard_normal(shape)
        black = np.resize(np.array(self.black), 4)
        level = np.tile(black.reshape(2, 2), (shape[0] // 2, shape[1] // 2))
        mean = self.dark_current * seconds + self.efficiency * photons
        drawn = rng.poisson(np.broadcast_to(mean, (count, *shape))).astype(float)
        drawn = mean + (drawn - mean) * np.sqrt(1 - self.dull * np.minimum(mean / self.well, 1))
        drawn = np.minimum(drawn * gains, self.well)
        drawn *= 1 - self.curved * drawn / self.well
        drawn += offset + self._readout((count, *shape), rng)
        codes = np.rint(level + self.gain * drawn)
        return np.clip(codes, 0, 2**self.bits - 1).astype(np.uint16)

    def _readout(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        if self.shape == NORMAL:
            return self.read_noise * rng.standard_normal(shape)
        from scipy.special import beta

        lam, p = self.shape, rng.random(shape)
        variance = 2 / lam**2 * (1 / (1 + 2 * lam) - beta(lam + 1, lam + 1))
        return self.read_noise * (p**lam - (1 - p) ** lam) / lam / np.sqrt(variance)

    @property
    def truth(self) -> dict[str, float]:
        """What `vcam fit` should find."""
        known = {
            "system_gain": self.gain,
            "read_noise": self.read_noise,
            "dark_current": self.dark_current,
            "offset_pixel": self.dsnu,
            "gain_pixel": self.prnu,
            "full_well": self.well * (1 - self.curved),
        }
        if self.shape != NORMAL:
            known["read_noise_shape"] = self.shape
        if len(self.black) == 1:
            return known | {"black_level": self.black[0], "quantum_efficiency.Y": self.efficiency}
        levels = {f"black_level.{c}": self.black[i] for c, i in zip("RGB", (0, 1, 3), strict=True)}
        return known | levels | {f"quantum_efficiency.{c}": self.efficiency for c in "RGB"}


def bench(
    sensor: BareSensor, folder: Path, number: int = 0, side: int = 128, count: int = 8
) -> dict[str, Any]:
    """Write frames of a sensor as npy files; return the measurement's YAML."""
    rng, entries = np.random.default_rng([78, number]), []

    def take(name: str, seconds: float, photons: float, taken: int, light: dict[str, Any]) -> None:
        stack = sensor.frames(number, (side, side), seconds, photons, taken, rng)
        for k, frame in enumerate(stack):
            np.save(folder / f"{name}_{k:02d}.npy", frame)
        entries.append({"files": f"{name}_*.npy", "name": name, "exposure": f"{seconds!r} s"}
                       | light)  # fmt: skip

    for seconds in DARK_TIMES:
        take(f"dark{seconds * 1e3:g}", seconds, 0.0, count, {"light": "none"})
    full = sensor.well / sensor.efficiency
    for level in LEVELS:
        photons = level * full
        taken = count if level == 0.5 else max(2, count // 4)
        lit = {"light": {"monochromatic": "532 nm"}, "photons": photons}
        take(f"flat{level:g}", TIME, photons, taken, lit)
    pattern = "monochrome" if len(sensor.black) == 1 else "bayer-rggb"
    return {
        "kind": "measurement",
        "name": "bare",
        "frames": entries,
        "levels": {"bits": sensor.bits, "black": "auto"},
        "pixel": {"width": "4 um"},
        "pattern": pattern,
    }


def fitted(form: dict[str, Any], folder: Path, **changes: Any) -> Fit:
    """What the fit makes of frames."""
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | changes))
    return fit(measurement_file.read(folder / "bench.yaml"))


def drawn(number: int) -> tuple[str, BareSensor, int]:
    """A sensor drawn at random, its kind, and how many frames of each condition are taken."""
    rng, kind = np.random.default_rng([79, number]), KINDS[number % len(KINDS)]

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    well = spread(6e3, 30e3)
    gain = 0.9 * 4000 / well
    sensor = BareSensor(
        gain=gain,
        well=well,
        efficiency=float(rng.uniform(0.3, 0.8)),
        read_noise=spread(0.7, 3) / gain,
        dark_current=spread(200, 2000),
        dsnu=spread(0.7, 3) / gain,
        prnu=spread(0.005, 0.015),
        black=(float(rng.uniform(50, 90)),),
    )
    if kind == "under a code":
        gain = 0.9 * 240 / well
        sensor = replace(
            sensor, bits=8, gain=gain, read_noise=spread(0.1, 0.45) / gain,
            dsnu=spread(0.05, 0.3) / gain, black=(float(rng.uniform(4, 9)),),
            dark_current=spread(10, 200),
        )  # fmt: skip
    if kind == "tails":
        sensor = replace(sensor, shape=float(rng.uniform(-0.16, -0.06)))
    if kind == "black by color":
        black = 60 + rng.integers(0, 8, 3) + rng.uniform(-0.3, 0.3, 3)
        sensor = replace(sensor, black=(black[0], black[1], black[1], black[2]))
    if kind == "curved":
        sensor = replace(sensor, curved=float(rng.uniform(0.02, 0.08)))
    return kind, sensor, 3 if kind == "few frames" else 8


def coverage(numbers: range, side: int = 128) -> dict[str, list[tuple[str, bool]]]:
    """Return by parameter the kinds of the sensors, and whether its interval holds the truth."""
    held: dict[str, list[tuple[str, bool]]] = {}
    for number in numbers:
        kind, sensor, count = drawn(number)
        with tempfile.TemporaryDirectory() as folder:
            found = fitted(bench(sensor, Path(folder), number, side, count), Path(folder))
        named = {p.name: p for p in found.parameters}
        for name, value in sensor.truth.items():
            if name in named:
                inside = bool(named[name].low <= value <= named[name].high)
                held.setdefault(name.partition(".")[0], []).append((kind, inside))
    return held


def main(count: int = 40) -> None:
    """Print the coverage by parameter, and which kinds are not held."""
    for name, listed in coverage(range(count)).items():
        missed = [kind for kind, inside in listed if not inside]
        share = 1 - len(missed) / len(listed)
        print(f"{name:<20} {share:4.0%} of {len(listed)}  not held: {', '.join(missed) or '-'}")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
