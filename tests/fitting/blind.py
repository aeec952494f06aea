"""Cameras drawn at random, and frames of them on a bench: what a fit sees, and what it does not.

`python tests/fitting/blind.py N ROWS FRAMES` fits N of them and prints how often the intervals hold
the truth; with `all` behind it their pixels have traps, their pattern has shading, and every second
one is read as a mosaic.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vcam_cli import load, simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.fitting.fit import fit
from vcam_cli.fitting.result import Fit
from vcam_cli.verification import measurement_file

LEVELS = (0.04, 0.1, 0.18, 0.26, 0.34, 0.42, 0.5, 0.58, 0.66, 0.8, 1.5)
"""Light of the flat frames over that which fills a pixel."""
DARK_TIMES = (1e-3, 10e-3, 400e-3)
FLAT_TIME = 10e-3
LINE = {"monochromatic": "532 nm"}
PLANCK, LIGHT = 6.62607015e-34, 299792458.0


def truth(number: int) -> dict[str, float]:
    """The numbers of one camera, drawn by their own generator."""
    rng = np.random.default_rng([1288, number])

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    well = spread(6e3, 60e3)
    return {
        "system_gain": 0.92 * 4000 / well,
        "black_level": float(rng.integers(50, 90)),
        "full_well": well,
        "read_noise": spread(3, 12) * well / 20e3 + 1,
        "row_noise": spread(0.5, 2),
        "column_noise": spread(0.5, 2),
        "dark_current": spread(200, 2000),
        "offset_pixel": spread(3, 10),
        "offset_column": spread(1, 4),
        "gain_pixel": spread(0.005, 0.015),
        "gain_column": spread(0.002, 0.006),
        "quantum_efficiency.Y": float(rng.uniform(0.3, 0.8)),
    }


def traps_and_shading(number: int, known: dict[str, float]) -> dict[str, float]:
    """The numbers of these, drawn likewise: steps that stand out, shading of 1 to 3 %."""
    rng = np.random.default_rng([1289, number])
    noise = (known["read_noise"] ** 2 + 1 / 12 / known["system_gain"] ** 2) ** 0.5
    return {
        "telegraph_fraction": float(rng.uniform(0.01, 0.05)),
        "telegraph_amplitude": float(rng.uniform(4, 10)) * noise,
        "telegraph_occupancy": float(rng.uniform(0.15, 0.85)),
        "shading_offset": float(rng.uniform(1, 2)) * known["offset_column"],
        "shading_gain": float(rng.uniform(0.01, 0.03)),
    }


def bench(
    known: dict[str, float],
    folder: Path,
    rows: int,
    frames: int,
    sensor: int = 1,
    changes: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Write frames of a camera as npy files; return the measurement's YAML."""
    e = {name: f"{value!r} e" for name, value in known.items()}
    side = 4e-6
    full = known["full_well"] / known["quantum_efficiency.Y"] / FLAT_TIME
    watts = full * PLANCK * LIGHT / 532e-9 / side**2
    made = {
        "name": "blind",
        "scene": {
            "source": {"kind": "chart", "chart": "uniform"},
            "illuminant": LINE,
            "irradiance": f"{watts!r} W/m2",
        },
        "optics": "none",
        "pixel": {
            "width": "4 um",
            "photodetector": {
                "fill_factor": 1,
                "quantum_efficiency": known["quantum_efficiency.Y"],
                "dark_current": f"{known['dark_current']!r} e/s",
            },
            "readout": {name: e[name] for name in
                        ("full_well", "read_noise", "row_noise", "column_noise")},
            "fpn": {
                "offset_pixel": e["offset_pixel"],
                "offset_column": e["offset_column"],
                "gain_pixel": f"{100 * known['gain_pixel']!r} %",
                "gain_column": f"{100 * known['gain_column']!r} %",
            },
        },
        "array": {"rows": rows, "columns": rows, "pattern": "monochrome"},
        "exposure": {"time": "10 ms"},
        "adc": {
            "bits": 12,
            "offset": f"{known['black_level']:.0f} DN",
            "gain": f"{known['system_gain']!r} DN/e",
        },
        "processing": [],
        "effects": "all",
    }  # fmt: skip
    (folder / "camera.yaml").write_text(yaml.safe_dump(made))
    camera = load(folder / "camera.yaml").with_(changes or {})
    return frames_on_a_bench(camera, folder, watts, frames, sensor)


def frames_on_a_bench(
    camera: Camera, folder: Path, watts: float, frames: int, sensor: int, line: Any = LINE
) -> dict[str, Any]:
    """Write dark and flat frames of a bare sensor as npy files; return the measurement's YAML.

    watts: irradiance that fills a pixel in `FLAT_TIME` [W/m2].
    """
    camera = camera.with_({"seed.sensor": sensor})
    seed, entries = 1000 * sensor, []

    def take(name: str, count: int, settings: dict[str, Any], entry: dict[str, Any]) -> None:
        nonlocal seed
        for k in range(count):
            seed += 1
            shot = simulate(camera.with_({**settings, "seed.frame": seed}), 1)
            np.save(folder / f"{name}_{k:02d}.npy", shot.dn)
        entries.append({"files": f"{name}_*.npy", "name": name, **entry})

    for time in DARK_TIMES:
        told = f"{time!r} s"
        take(f"dark{time * 1e3:g}", frames, {"exposure.time": told, "scene.irradiance": "0 W/m2"},
             {"exposure": told, "light": "none"})  # fmt: skip
    for level in LEVELS:
        light = f"{level * watts!r} W/m2"
        count = frames if level == 0.5 else max(2, frames // 4)
        take(f"flat{level:g}", count, {"scene.irradiance": light},
             {"exposure": "10 ms", "light": line, "irradiance": light})  # fmt: skip
    width = f"{camera.pixel.width * 1e6!r} um"
    return {
        "kind": "measurement",
        "name": "blind",
        "frames": entries,
        "levels": {"bits": camera.adc.bits, "black": "auto"},
        "pixel": {"width": width},
    }


def blind_fit(
    number: int, folder: Path, rows: int, frames: int, everything: bool = False
) -> tuple[dict[str, float], Fit]:
    """One drawn camera and what the fit makes of its frames."""
    known, changes = truth(number), {}
    if everything:
        known |= traps_and_shading(number, known)
        changes = {
            "pixel.readout.telegraph_noise": {
                "fraction": f"{100 * known['telegraph_fraction']!r} %",
                "amplitude": f"{known['telegraph_amplitude']!r} e",
                "occupancy": f"{100 * known['telegraph_occupancy']!r} %",
            },
            "pixel.fpn.shading": {
                "offset": f"{known['shading_offset']!r} e",
                "gain": f"{100 * known['shading_gain']!r} %",
            },
        }
    form = bench(known, folder, rows, frames, number + 1, changes)
    if everything and number % 2:
        form["pattern"] = "bayer-rggb"
        efficiency = known.pop("quantum_efficiency.Y")
        known |= {f"quantum_efficiency.{color}": efficiency for color in "RGB"}
    (folder / "bench.yaml").write_text(yaml.safe_dump(form))
    return known, fit(measurement_file.read(folder / "bench.yaml"))


def main(count: int, rows: int = 256, frames: int = 16, everything: bool = False) -> None:
    """Print the mean and rms error of every parameter, and the share of intervals that hold it."""
    held: dict[str, list[bool]] = {}
    errors: dict[str, list[float]] = {}
    for number in range(count):
        with tempfile.TemporaryDirectory() as folder:
            known, found = blind_fit(number, Path(folder), rows, frames, everything)
        for p in found.parameters:
            if p.name in known:
                held.setdefault(p.name, []).append(p.low <= known[p.name] <= p.high)
                errors.setdefault(p.name, []).append(p.value / known[p.name] - 1)
    for name, shares in held.items():
        e = np.array(errors[name])
        print(f"{name:<22} held {np.mean(shares):5.0%}  bias {e.mean():+8.3%}"
              f"  rms {np.sqrt(np.mean(e**2)):8.3%}")  # fmt: skip
    everything = [held_ for shares in held.values() for held_ in shares]
    print(f"{len(everything)} intervals, {np.mean(everything):.1%} hold the truth")


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*(int(a) for a in given if a != "all"), everything="all" in given)
